"""Requirements and the tests that show them: the table, and the markers in the tests."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[1]
_COMMENT = re.compile(r"(?:/\*|#) shows (R\d+(?:, R\d+)*)(?: \*/|$)", re.MULTILINE)


def requirements() -> dict[str, str]:
    """Return each number with its sentence."""
    return yaml.safe_load((ROOT / "docs" / "requirements.yaml").read_text("utf-8"))


def _numbers(decorator: ast.expr) -> list[str]:
    """Return what ``@pytest.mark.shows("R1", "R2")`` names; of other decorators nothing."""
    if not isinstance(decorator, ast.Call) or ast.unparse(decorator.func) != "pytest.mark.shows":
        return []
    return [ast.literal_eval(argument) for argument in decorator.args]


def shown_in(path: Path) -> Iterator[tuple[str, str]]:
    """Yield each requirement with the test that shows it; the file alone outside of Python."""
    text = path.read_text("utf-8")
    if path.suffix != ".py":
        for found in _COMMENT.finditer(text):
            yield from ((number, "") for number in found[1].split(", "))
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            for decorator in node.decorator_list:
                yield from ((number, node.name) for number in _numbers(decorator))


def shown() -> dict[str, dict[str, list[str]]]:
    """Return files and tests by requirement."""
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    files += sorted((ROOT / "master_core" / "tests").glob("*.c"))
    for folder in (ROOT / "scripts", ROOT / "scripts" / "rig"):
        files += sorted(path for path in folder.iterdir() if path.is_file())
    found: dict[str, dict[str, list[str]]] = {}
    for path in files:
        for number, test in shown_in(path):
            tests = found.setdefault(number, {}).setdefault(str(path.relative_to(ROOT)), [])
            tests += [test] * bool(test)
    return found


def sections() -> str:
    """Return a section of the page for each requirement."""
    tests_of, parts = shown(), []
    for number, sentence in requirements().items():
        rows = [f"## {number}\n\n{sentence}\n"]
        for file, tests in tests_of.get(number, {}).items():
            names = "; ".join(t.removeprefix("test_").replace("_", " ") for t in tests)
            rows.append(f"- `{file}`: {names}" if names else f"- `{file}`")
        parts.append("\n".join(rows) + "\n")
    return "\n".join(parts)
