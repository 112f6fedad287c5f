"""Each known mistake is found as docs/reference/hazards.md says; its fixed form is not blamed.

The table is hazards.yaml: for each number the codes, and the smallest files that raise them.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
import yaml
from diagnostics import test_cases as cases

from fsoe_net.diag.diagnostic import Severity

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "hazards.md"
TABLE = yaml.safe_load(Path(__file__).with_name("hazards.yaml").read_text("utf-8"))
NUMBERS = range(1, 74)


def _codes(folder: Path, case: dict, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the codes found in the clean files with the edits of a case, notes too."""
    shutil.copytree(cases.HERE / "base", folder)
    edits = [*case.get("edit", ()), *case.get("then", ())]
    edits = [[file, find, put.replace("@", str(folder))] for file, find, put in edits]
    cases._seed(folder, case | {"edit": edits})
    monkeypatch.chdir(folder)
    return [d.code for d in cases.findings(case)]


def _try(entry: dict) -> tuple[str, dict, dict]:
    """Return the code, the files with the mistake and the fixed ones."""
    code = entry.get("like") or entry["code"]
    case = dict(cases.CASES[code] if "like" in entry else entry)
    clean = {k: v for k, v in case.items() if k in ("check", "scan", "reader", "runtime", "choice")}
    if "write" in case and "fix" not in entry:  # a file of its own has no clean form in the base
        clean["check"] = [f for f in case["check"] if (cases.HERE / "base" / f).is_file()]
    return code, case, clean | entry.get("fix", {})


TRIES = [(number, n) for number in TABLE for n in range(len(TABLE[number].get("tries", ())))]
QUIET = [(number, n) for number in TABLE for n in range(len(TABLE[number].get("quiet", ())))]


@pytest.mark.shows("R6")
@pytest.mark.parametrize(("number", "n"), TRIES)
def test_mistake_is_found(number: int, n: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    code, case, fixed = _try(TABLE[number]["tries"][n])
    assert code in _codes(tmp_path / "wrong", case, monkeypatch)
    assert code not in _codes(tmp_path / "right", fixed, monkeypatch)


@pytest.mark.shows("R6")
@pytest.mark.parametrize(("number", "n"), QUIET)
def test_correct_files_raise_no_finding(
    number: int, n: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    case = TABLE[number]["quiet"][n]
    cases._seed(shutil.copytree(cases.HERE / "base", tmp_path / "q"), case)
    monkeypatch.chdir(tmp_path / "q")
    assert [d.code for d in cases.findings(case) if d.level is not Severity.INFO] == []


@pytest.mark.shows("R6")
def test_every_hazard_is_in_the_table_and_each_code_is_tried():
    assert list(TABLE) == list(NUMBERS)
    for number, row in TABLE.items():
        tried = {_try(entry)[0] for entry in row.get("tries", ())}
        assert tried == set(row.get("found", ())), number
        assert bool(tried) != bool(row.get("elsewhere")), number


def _page_rows() -> dict[int, tuple[str, list[str]]]:
    """Return of each row of the page how it is found, and all its cells."""
    rows = {}
    for line in PAGE.read_text("utf-8").splitlines():
        cells = [c.strip() for c in re.split(r"(?<!\\)\|", line.strip())[1:-1]]
        if len(cells) == 4 and cells[0].isdigit():
            assert int(cells[0]) not in rows, f"hazard {cells[0]} stands twice"
            rows[int(cells[0])] = (cells[3], cells)
    return rows


def test_the_page_names_what_the_table_states():
    rows = _page_rows()
    assert sorted(rows) == list(NUMBERS)
    for number, (how, cells) in rows.items():
        assert all(cells), number
        row = TABLE[number]
        linked = re.findall(r"\[(FSN[0-9]{3})\]\(\.\./diagnostics/\1\.md\)", how)
        assert sorted(linked) == sorted(set(row.get("found", ()))), number
        assert len(re.findall(r"FSN[0-9]{3}", how)) == 2 * len(linked), (number, how)
        assert ("other descriptions" in how) == bool(row.get("esi")), number
        online = {c for c in linked if c.startswith("FSN5")}
        online |= {
            e["code"] for e in row.get("tries", ()) if "scan" in e and e.get("code") in linked
        }
        assert ("bus:" in how) == bool(online), (number, how)
        profile = {"runtime" in _try(e)[1] for e in row.get("tries", ())}
        assert ("`--runtime" in how) == (True in profile), (number, how)
        assert how.startswith("not by `check`") == bool(row.get("elsewhere")), number


def test_the_page_counts_right():
    how = [row[0] for row in _page_rows().values()]
    elsewhere = sum(h.startswith("not by `check`") for h in how)
    offline = sum(bool(re.search(r"FSN[1-46]", h)) and not h.startswith("bus:") for h in how)
    text = PAGE.read_text("utf-8")
    counts = (len(how), offline, len(how) - offline - elsewhere, elsewhere)
    words = (
        "{} mistakes: {} found in the files, {} on the bus or by other descriptions, {} elsewhere"
    )
    assert words.format(*counts) in " ".join(text.split()), counts
