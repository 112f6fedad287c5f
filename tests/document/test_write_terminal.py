"""What a narrow terminal shows: fewer columns, whole names, whole heads; nothing acts on it."""

from __future__ import annotations

import io

import pytest
from document.pages import ALL
from rich.console import Console

from fsoe_net.cli.monitor_output import _COLUMNS as OF_MONITOR
from fsoe_net.cli.run_output import _COLUMNS as OF_RUN
from fsoe_net.document.model import (
    Column,
    Document,
    Level,
    Table,
    Verdict,
    cell,
    words,
)
from fsoe_net.document.write_terminal import TerminalView, document_text

NAMES = ("el6910-drive_1", "el6910-drive_2")
CELLS = {
    "state": Verdict("Data · ProcessData", Level.CLEAR),
    "ConnID": "65535",
    "FSoE cycle ms": "4.71",
    "FSoE cycle": "4.7 ms",
    "longest": "21.14",
    "of watchdog": Verdict("100 % of 1000 ms", Level.WARNING),
    "held": "34152",
    "CRC wrong": "12",
    "resets": "240",
    "last cause": "MainInstance: command not allowed in this state",
    "last reason": "command not allowed in this state",
}


def at(width: int, *parts) -> list[str]:
    """Return the lines of a terminal of this width."""
    console = Console(width=width, record=True, file=io.StringIO(), force_terminal=True)
    console.print(TerminalView(Document(lead=parts)))
    return console.export_text().splitlines()


def shown(columns, width: int) -> list[str]:
    rows = tuple(
        tuple(cell(name if c.title == "connection" else CELLS[c.title]) for c in columns)
        for name in NAMES
    )
    return at(width, Table(columns=columns, rows=rows))


@pytest.mark.parametrize("columns", [OF_MONITOR, OF_RUN], ids=["monitor", "run"])
@pytest.mark.parametrize("width", [40, 60, 80, 100, 120, 160, 240])
def test_names_and_heads_are_whole_at_any_width(columns, width: int):
    lines = shown(columns, width)
    assert all(len(line) <= width for line in lines)
    text = "\n".join(lines)
    for name in NAMES:
        assert name in text
    assert "…" not in text
    head = next(line for line in lines if "connection" in line)
    named = " ".join(text.partition("too narrow for: ")[2].split())
    for column in columns:
        assert column.title in head + named


def test_a_wide_terminal_shows_everything():
    assert not any("too narrow" in line for line in shown(OF_MONITOR, 160))
    assert not any("too narrow" in line for line in shown(OF_RUN, 100))


def test_eighty_columns_keep_what_matters():
    lines = shown(OF_MONITOR, 80)
    head = next(line for line in lines if "connection" in line)
    assert head.split() == ["connection", "state", "of", "watchdog", "resets"]
    assert " ".join(lines[-2:]).endswith(
        "too narrow for: ConnID, FSoE cycle ms, longest, held, CRC wrong, last cause"
    )


def test_required_columns_stay_in_a_narrow_terminal():
    columns = (Column("connection"), Column("resets", rank=1))
    lines = at(8, Table(columns=columns, rows=((cell("el1918-ek1914"), cell("3")),)))
    assert "".join(line.strip() for line in lines[2:4]) == "el1918-ek1914", lines
    assert " ".join(lines[4:]).split() == ["too", "narrow", "for:", "resets"]


TEXT = """\
title \\u001b[31m
not \\u202eso

first second\\u0007
- one two three
  four

Section
───────
Heading
name      time  why
a         1 ms  because it is so, and not otherwise, whatever anybody says
b
\\u009b2J    12
of the machine

$ a command that stays on its line, however narrow the terminal is

##.

none
"""


def test_a_document_as_text():
    assert document_text(ALL, width=18) == TEXT


def test_a_document_without_a_width_breaks_no_line():
    assert document_text(Document(lead=(words("word " * 99),)), width=None).count("\n") == 1


def test_colours_are_those_of_a_terminal_only():
    out = io.StringIO()
    Console(file=out, width=60, force_terminal=True, color_system="standard").print(
        TerminalView(ALL)
    )
    assert "\x1b[31mnot \\u202eso\x1b[0m" in out.getvalue()
    assert "\x1b" not in document_text(ALL)
