"""What a narrow terminal shows: fewer columns, whole names, whole heads."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from fsoe_net.cli.fitted_table import FittedTable
from fsoe_net.cli.monitor_output import _COLUMNS as OF_MONITOR
from fsoe_net.cli.run_output import _COLUMNS as OF_RUN

NAMES = ("el6910-drive_1", "el6910-drive_2")
CELLS = {
    "state": "[bold green]Data · ProcessData[/]",
    "ConnID": "65535",
    "FSoE cycle ms": "4.71",
    "FSoE cycle": "4.7 ms",
    "longest": "21.14",
    "of watchdog": "[yellow]100 % of 1000 ms[/]",
    "held": "34152",
    "CRC wrong": "12",
    "resets": "240",
    "last cause": "MainInstance: command not allowed in this state",
    "last reason": "command not allowed in this state",
}


def shown(columns, width: int) -> list[str]:
    rows = [[name if c.head == "connection" else CELLS[c.head] for c in columns] for name in NAMES]
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(FittedTable(columns, rows))
    return console.export_text().splitlines()


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
        assert column.head in head + named


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
