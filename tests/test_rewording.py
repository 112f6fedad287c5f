"""Decisions survive any rewording of any message: they rest on enums, numbers and identifiers."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# What is for people, and what would look into it.
TEXTS = {"text", "message", "detail", "hint", "title", "found_text", "remedy", "reason"}
LOOKS = {"startswith", "endswith", "partition", "rpartition", "split", "removeprefix", "find"}
# Their `text` is that of a file of the user's, or of what a person typed.
OF_USERS = ("formats", "studio/workspace.py", "live/console", "cli/init_prompt.py")


def decisions(*words: str) -> dict[str, object]:
    done = subprocess.run(
        [sys.executable, ROOT / "tests/decisions.py", *words],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


@pytest.mark.weekly
def test_sentences_in_capitals_change_no_decision():
    plain, capitals = decisions(), decisions("capitals")
    said, changed = plain.pop("title"), capitals.pop("title")
    assert said.upper() == changed.upper()
    assert said != changed
    assert capitals == plain


def _looks(tree: ast.AST) -> Iterator[int]:
    """Yield the lines that look into an attribute which is for people."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            held, name = node.func.value, node.func.attr
            if name in LOOKS and isinstance(held, ast.Attribute) and held.attr in TEXTS:
                yield node.lineno
        elif isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.In | ast.NotIn):
            held = node.comparators[0]
            if isinstance(held, ast.Attribute) and held.attr in TEXTS:
                yield node.lineno


@pytest.mark.parametrize(
    "package", sorted(p.name for p in (ROOT / "fsoe_net").iterdir() if (p / "__init__.py").exists())
)
def test_no_code_looks_into_its_own_texts(package: str):
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in sorted((ROOT / "fsoe_net" / package).rglob("*.py"))
        if not str(path.relative_to(ROOT / "fsoe_net")).startswith(OF_USERS)
        for line in _looks(ast.parse(path.read_bytes()))
    ]
    assert found == []
