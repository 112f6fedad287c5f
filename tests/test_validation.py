"""The page of requirements is made of one table and of the markers of the tests that show them."""

import ast
import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from live.support import ROOT

PAGE, TABLE = ROOT / "docs" / "reference" / "validation.md", ROOT / "docs" / "requirements.yaml"
COMMENT = re.compile(r"(?:/\*|#) shows (R\d+(?:, R\d+)*)(?: \*/|$)", re.MULTILINE)
HEAD = """\
# Requirements and the tests that show them

Requirements on the tool itself, for an assessor ([what kind of tool it
is](../explanation/tool-classification.md)). Made from `docs/requirements.yaml` and from markers in
the tests, all of which run in CI with every change. A test shows that a requirement holds in the
cases it tries, not that it holds always.
"""


def _requirements() -> dict[str, str]:
    return yaml.safe_load(TABLE.read_text("utf-8"))


def _numbers(decorator: ast.expr) -> list[str]:
    """Return what ``@pytest.mark.shows("R1", "R2")`` names; of other decorators nothing."""
    if not isinstance(decorator, ast.Call) or ast.unparse(decorator.func) != "pytest.mark.shows":
        return []
    return [ast.literal_eval(argument) for argument in decorator.args]


def shown_in(path: Path) -> Iterator[tuple[str, str]]:
    """Yield each requirement with the test that shows it; the file alone outside of Python."""
    text = path.read_text("utf-8")
    if path.suffix != ".py":
        for found in COMMENT.finditer(text):
            yield from ((number, "") for number in found[1].split(", "))
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            for decorator in node.decorator_list:
                yield from ((number, node.name) for number in _numbers(decorator))


def _shown() -> dict[str, dict[str, list[str]]]:
    """Return files and tests by requirement."""
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    files += sorted((ROOT / "master_core" / "tests").glob("*.c"))
    files += sorted(p for p in (ROOT / "scripts").iterdir() if p.is_file())
    shown: dict[str, dict[str, list[str]]] = {}
    for path in files:
        for number, test in shown_in(path):
            tests = shown.setdefault(number, {}).setdefault(str(path.relative_to(ROOT)), [])
            tests += [test] * bool(test)
    return shown


def _page() -> str:
    shown = _shown()
    parts = [HEAD]
    for number, sentence in _requirements().items():
        rows, whole = [], []
        for file, tests in shown.get(number, {}).items():
            names = "; ".join(t.removeprefix("test_").replace("_", " ") for t in tests)
            if names:
                rows.append(f"- `{file}`: {names}")
            else:
                whole.append(f"`{file}`")
        rows += [f"- {', '.join(whole)}"] if whole else []
        parts.append(f"\n## {number}\n\n{sentence}\n\n" + "\n".join(rows) + "\n")
    return "".join(parts)


def test_the_page_is_that_of_the_table_and_the_markers():
    if os.environ.get("FSN_RECORD"):
        PAGE.write_text(_page(), "utf-8")
    assert PAGE.read_text("utf-8") == _page()


def test_each_requirement_has_a_test_and_each_marker_a_requirement():
    requirements = _requirements()
    assert sorted(requirements) == sorted(_shown())
    assert list(requirements) == [f"R{n}" for n in range(1, len(requirements) + 1)]
    assert len(set(requirements.values())) == len(requirements)


def test_the_classification_names_requirements_that_are_there():
    text = (ROOT / "docs" / "explanation" / "tool-classification.md").read_text("utf-8")
    named = set(re.findall(r"\bR\d+\b", text))
    assert named <= set(_requirements())
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
    assert list(shown_in(tmp_path / name)) == expected


def test_each_requirement_is_broken_once():
    breaks = yaml.safe_load((ROOT / "tests" / "broken_requirements.yaml").read_text("utf-8"))
    assert breaks.keys() == _requirements().keys()
    for row in breaks.values():
        assert row["find"] in (ROOT / row["file"]).read_text("utf-8"), row
