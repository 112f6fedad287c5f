"""The page of features is made of one table, whose rows name the tests that hold them."""

import os
from pathlib import Path

import yaml
from live.support import ROOT

PAGE, TABLE = ROOT / "docs" / "FEATURES.md", ROOT / "docs" / "features.yaml"
MARKS = {"works": "✔", "partly": "◐", "not yet": "✘", "not claimed": ""}
HEAD = """\
# What works today

✔ works and is tested · ◐ works in part · ✘ not yet

Made from `docs/features.yaml`, which also names the tests of each row.

| | | |
|---|---|---|
"""


def _topics() -> dict[str, list[dict[str, object]]]:
    return yaml.safe_load(TABLE.read_text("utf-8"))


def _page() -> str:
    lines = []
    for topic, rows in _topics().items():
        for number, row in enumerate(rows):
            first = "" if number else f"**{topic}**"
            state = f"{MARKS[str(row['state'])]} {row.get('note', '')}".strip()
            lines.append(f"| {first} | {row['feature']} | {state} |".replace("|  |", "| |"))
    return HEAD + "\n".join(lines) + "\n"


def test_the_page_is_that_of_the_table():
    if os.environ.get("FSN_RECORD"):
        PAGE.write_text(_page(), "utf-8")
    assert PAGE.read_text("utf-8") == _page()


def test_each_row_is_there_once_and_names_tests_that_exist():
    rows = [row for rows in _topics().values() for row in rows]
    features = [row["feature"] for row in rows]
    assert len(features) == len(set(features))
    for row in rows:
        tests = row.get("tests", [])
        assert bool(tests) == (row["state"] in ("works", "partly")), row["feature"]
        assert [t for t in tests if not Path(ROOT, "tests", t).is_file()] == []
