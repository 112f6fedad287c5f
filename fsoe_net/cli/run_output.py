"""How a run is shown: the live table, the text at the end, files of its timing."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from fsoe_net.cli.fitted_table import Column, FittedTable
from fsoe_net.cli.terminal import echo, terminal
from fsoe_net.core.snapshot import Statistics
from fsoe_net.diag.words import counted
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.report.cycle_times import timing_csv, timing_picture, timing_text
from fsoe_net.run.live_snapshot import SubDeviceSnapshot
from fsoe_net.run.result import Run, RunEvent, RunUpdate, state_text

if TYPE_CHECKING:
    from rich.console import Group

__all__ = [
    "Show",
    "cycle_text",
    "display",
    "event_line",
    "interesting",
    "joined_events",
    "not_in_op",
    "number_text",
    "print_events",
    "print_result",
    "state_markup",
    "write_timing",
]

_COLUMNS = (
    Column(head="connection", rank=0),
    Column(head="state", rank=0),
    Column(head="ConnID", rank=4, is_number=True),
    Column(head="FSoE cycle", rank=3, is_number=True),
    Column(head="resets", rank=1, is_number=True),
    Column(head="last reason", rank=2, wraps=True),
)
_STATE_STYLE = {"data_process": "bold green", "data_failsafe": "yellow"}


Show = Callable[[RunUpdate], None]


@contextmanager
def display(name: str) -> Iterator[Show]:
    """Show a run on the terminal while it goes on; gives what takes the updates."""
    from rich.live import Live

    with Live(refresh_per_second=10, transient=True, console=terminal()) as live:
        yield lambda update: live.update(_live_view(name, update))


def _live_view(name: str, update: RunUpdate) -> Group:
    """Return what a terminal shows during a run: connections, and SubDevices not in OP."""
    from rich.console import Group
    from rich.markup import escape
    from rich.text import Text

    cells = [
        (
            escape(c.name),
            state_markup(c.state),
            number_text(c.connection_id),
            f"{c.fsoe_cycle_ms['last']:.1f} ms",
            str(c.resets),
            escape(c.last_reset_text),
        )
        for c in update.connections
    ]
    title = f"{escape(name)} · {update.now_s:.1f} s · {cycle_text(update.statistics)}"
    table = FittedTable(_COLUMNS, cells, title=title)
    return Group(table, *(Text(line, style="red") for line in not_in_op(update.subdevices)))


def cycle_text(statistics: Statistics) -> str:
    """Return the number of the cycle, and its working counter where that is not complete."""
    s = statistics
    wkc = "" if s.expected_wkc == s.actual_wkc else f" · WKC {s.actual_wkc}/{s.expected_wkc}"
    return f"cycle {s.cycles}{wkc}"


def state_markup(word: str) -> str:
    """Return a state for people, in its colour."""
    return f"[{_STATE_STYLE.get(word, 'red')}]{state_text(word)}[/]"


def not_in_op(subdevices: Sequence[SubDeviceSnapshot]) -> list[str]:
    """Return a line for every SubDevice that is not in OP, with what is known about it."""
    lines = []
    for s in subdevices:
        if s.in_op:
            continue
        code = f", AL status code 0x{s.al_code:04x}" if s.al_code else ""
        text = s.detail or s.found or "nothing is known about it"
        lines.append(f"{s.name}: {'no answer' if s.al == 'none' else s.al}{code}: {text}")
    return lines


def number_text(value: int | None) -> str:
    """Return a number, ``-`` for none."""
    return "-" if value is None else str(value)


def print_result(result: Run) -> None:
    """Print events, connections, SubDevices not in OP, totals and verdicts."""
    rows = [["connection", "state", "ConnID", "address", "FSoE cycle", "to Data", "resets"]]
    for c in result.connections:
        to_data = "-" if c.time_to_data_ms is None else f"{c.time_to_data_ms:.0f} ms"
        resets = str(c.resets) if not c.resets else f"{c.resets} ({c.last_reset_text})"
        rows.append(
            [
                c.name,
                state_text(c.state),
                number_text(c.connection_id) + ("*" if "connection_id" in c.chosen else ""),
                number_text(c.address) + ("*" if "address" in c.chosen else ""),
                f"{c.fsoe_cycle_ms['mean']:.2f} ms",
                to_data,
                resets,
            ]
        )
    print_events(result.events)
    widths = [max(len(row[n]) for row in rows) for n in range(len(rows[0]))]
    echo()
    for row in rows:
        echo("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip())
    if any(c.chosen for c in result.connections):
        echo("* chosen here; no file states it")
    for line in not_in_op(result.subdevices):
        echo(line)
    s = result.statistics
    echo(
        f"\n{counted(s.cycles, 'bus cycle')} in {result.duration_ms / 1000:.1f} s "
        f"({_mode(result)}), "
        f"{s.wkc_errors} with incomplete working counter, {counted(s.overruns, 'overrun')}"
    )
    _print_verdicts(result)


def _mode(result: Run) -> str:
    if result.bus.interface is None:
        return result.mode
    return f"{result.bus.backend} on {result.bus.interface}"


def print_events(events: Sequence[RunEvent]) -> None:
    """Print interesting events; what several sources say at once, or one again, is one line."""
    joined = joined_events(interesting(events))
    runs = itertools.groupby(joined, key=lambda e: (e.source, e.text))
    for _, rows in runs:
        same = list(rows)
        first, last = same[0], same[-1]
        again = (
            f" ({counted(len(same), 'time')} until {last.time_ms:.1f} ms)" if len(same) > 1 else ""
        )
        echo(event_line(first) + again)


def joined_events(events: Sequence[RunEvent]) -> list[RunEvent]:
    """Return events of which those with one time and text, as of a lost bus, are one."""
    found = []
    for _, rows in itertools.groupby(events, key=lambda e: (round(e.time_ms), e.text)):
        same = list(rows)
        names = ", ".join(dict.fromkeys(e.source for e in same))
        found.append(replace(same[0], source=names))
    return found


def event_line(event: RunEvent) -> str:
    """Return an event as one line."""
    return f"{event.time_ms:10.1f} ms  {event.source}: {event.text}"


def interesting(events: Sequence[RunEvent]) -> list[RunEvent]:
    """Return the events a person wants to read: not every step of a start-up."""
    quiet = ("MainInstance: ", "SubInstance: ", "wire: ", "working counter ", "ports: ")
    return [e for e in events if not e.text.startswith(quiet) or e.text.endswith("Data")]


def _stall_text(result: Run) -> str:
    """Return what a stall of this machine explains; empty where it was shorter than a watchdog."""
    watchdogs = [c.watchdog_ms for c in result.connections if c.watchdog_ms]
    if not watchdogs or result.stalled_ms < min(watchdogs):
        return ""
    return (
        f"this machine stood still for {result.stalled_ms:.0f} ms, longer than an FSoE watchdog "
        f"({min(watchdogs)} ms): what follows from that is no fault of the files; run it again, "
        "with --virtual-time, or see `fsoe-net doctor`"
    )


def _print_verdicts(result: Run) -> None:
    for verdict in result.verdicts:
        if not verdict.held:
            echo(f"{verdict.place}: not observed: {verdict.text}; {verdict.seen}")
    if result.verdicts:
        held = sum(v.held for v in result.verdicts)
        echo(f"{held} of {counted(len(result.verdicts), 'expectation')} held")
    if not result.passed and not result.verdicts:
        missing = not_in_op(result.subdevices)
        echo(f"not every connection is in Data{' with its SubDevices in OP' if missing else ''}")
    stall = "" if result.passed else _stall_text(result)
    if stall:
        echo(stall)


def write_timing(
    result: Run, stats: str | None, plot: str | None, *, text: bool, overwrite: bool
) -> None:
    """Write the files that were asked for, and print percentiles when ``text`` is wanted.

    Raises:
        EnvironmentFault: A file cannot be written.
    """
    title = f"{result.network}: {counted(result.statistics.cycles, 'cycle')}, {_mode(result)}"
    for path, content in (
        (stats, timing_csv(result.statistics)),
        (plot, timing_picture(result.statistics, title)),
    ):
        if path is None:
            continue
        write_whole(path, content.encode("utf-8"), overwrite=overwrite)
    if text and (stats is not None or plot is not None):
        echo(timing_text(result.statistics))
