"""Numbers in messages: one thing is no several things."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from fsoe_net.diag.words import counted
from fsoe_net.document.model import Number, number_of, stated

PACKAGE = Path(__file__).parents[2] / "fsoe_net"
NOUNS = [
    "SubDevice",
    "connection",
    "cycle",
    "frame",
    "step",
    "reset",
    "time",
    "packet",
    "line",
    "change",
    "module",
    "device",
    "overrun",
    "expectation",
    "pair",
    "argument",
    "copie",
    "reply",
    "replie",
    "file",
]
PLURAL = re.compile(rf" (?:[a-zA-Z]+ )?(?:{'|'.join(NOUNS)})s\b")
NUMBER = re.compile(r"len\(|count|cycles|steps|frames|times|packets|overruns|resets")


def uncounted() -> list[str]:
    """Return places of f-strings where a number stands before a plural that is always one."""
    found = []
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(node, ast.JoinedStr):
                continue
            for value, after in zip(node.values, node.values[1:], strict=False):
                if (
                    isinstance(value, ast.FormattedValue)
                    and isinstance(after, ast.Constant)
                    and PLURAL.match(str(after.value))
                    and NUMBER.search(ast.unparse(value.value))
                    and "counted(" not in ast.unparse(value.value)
                ):
                    text = ast.unparse(node)
                    found.append(f"{path.relative_to(PACKAGE)}:{node.lineno} {text}")
    return found


def test_numbers_before_things_are_counted():
    assert uncounted() == []


@pytest.mark.parametrize(
    ("number", "word", "text"),
    [
        (0, "copy", "0 copies"),
        (1, "copy", "1 copy"),
        (2, "connection", "2 connections"),
        (1, "reply", "1 reply"),
        (2, "reply", "2 replies"),
        (2, "entry", "2 entries"),
        (2, "day", "2 days"),
    ],
)
def test_number_and_noun_agree(number: int, word: str, text: str):
    assert counted(number, word) == text


UNIT = re.compile(rf"(?:[a-z]+ )?(?:{'|'.join([*NOUNS, 'byte', 'copie', 'year'])})s")


def test_a_number_of_a_document_has_no_plural_as_its_unit() -> None:
    """`number_of` gives the singular for one."""
    units = [
        argument.value
        for path in sorted(PACKAGE.rglob("*.py"))
        for call in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") in ("stated", "Number")
        for argument in (*call.args[1:2], *(k.value for k in call.keywords if k.arg == "unit"))
        if isinstance(argument, ast.Constant)
    ]
    assert "ms" in units
    assert [unit for unit in units if UNIT.fullmatch(str(unit))] == []


@pytest.mark.parametrize(
    ("value", "unit"), [(0, "copies"), (1, "copy"), (1.0, "copy"), (1.5, "copies"), (2, "copies")]
)
def test_the_unit_of_a_number_is_the_singular_for_one(value: float, unit: str) -> None:
    item = number_of(value, "copy", "a file")
    assert isinstance(item, Number)
    assert item.unit == unit
    assert number_of(None, "copy", "a file") == stated(None, "", "a file")
