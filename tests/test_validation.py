"""The page of requirements is made of one table and of the markers of the tests that show them."""

import re
from pathlib import Path

import pytest
import shown
import yaml
from live.support import ROOT


def test_the_page_has_each_requirement_and_each_test():
    text = shown.sections()
    for number, sentence in shown.requirements().items():
        assert f"## {number}\n\n{sentence}\n" in text
    markers = re.findall(
        r"@pytest\.mark\.shows\([^)]*\)\n(?:@.*\n|    .*\n|\)\n)*?(?:    )?def test_(\w+)",
        "\n".join(path.read_text("utf-8") for path in (ROOT / "tests").rglob("test_*.py")),
    )
    assert len(markers) > 100
    assert [name for name in markers if name.replace("_", " ") not in text] == []


def test_each_requirement_has_a_test_and_each_marker_a_requirement():
    requirements = shown.requirements()
    assert sorted(requirements) == sorted(shown.shown())
    assert list(requirements) == [f"R{n}" for n in range(1, len(requirements) + 1)]
    assert len(set(requirements.values())) == len(requirements)


def test_the_classification_names_requirements_that_are_there():
    text = (ROOT / "docs" / "explanation" / "tool-classification.md").read_text("utf-8")
    named = set(re.findall(r"\bR\d+\b", text))
    assert named <= set(shown.requirements())
    assert len(named) > 20


MARKED = {
    "test_a.py": (
        '@pytest.mark.shows("R1", "R3")\ndef test_x(): ...\n\n'
        'class TestIt:\n    @other\n    @pytest.mark.shows("R2")\n    def test_y(self): ...\n'
        '@pytest.mark.shows("R4")\ndef helper(): ...\n# shows R5\n',
        [("R1", "test_x"), ("R3", "test_x"), ("R2", "test_y")],
    ),
    "test_a.c": ("/** Words. */\n/* shows R1, R2 */\n/* R3 */\n", [("R1", ""), ("R2", "")]),
    "script": ("#!/bin/sh\n# shows R7\necho shows R8\n", [("R7", "")]),
}


@pytest.mark.parametrize("name", MARKED)
def test_markers_are_read_where_they_count(name: str, tmp_path: Path):
    text, expected = MARKED[name]
    (tmp_path / name).write_text(text)
    assert list(shown.shown_in(tmp_path / name)) == expected


def test_each_requirement_is_broken_once():
    breaks = yaml.safe_load((ROOT / "tests" / "broken_requirements.yaml").read_text("utf-8"))
    assert breaks.keys() == shown.requirements().keys()
    for row in breaks.values():
        assert row["find"] in (ROOT / row["file"]).read_text("utf-8"), row
