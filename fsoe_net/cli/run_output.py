"""How a run is shown: the live table, the text at the end, files of its timing."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from fsoe_net.cli.terminal import echo, show, terminal
from fsoe_net.core.snapshot import Statistics
from fsoe_net.diag.words import counted
from fsoe_net.document.model import (
    Cell,
    Column,
    Document,
    Level,
    Paragraph,
    Table,
    Verdict,
    cell,
    words,
)
from fsoe_net.document.write_terminal import TerminalView
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.observe.bus_documents import SubDeviceSnapshot
from fsoe_net.report.cycle_times import times_table, timing_csv, timing_picture
from fsoe_net.run.result import (
    ConnectionResult,
    Run,
    RunEvent,
    RunEventKind,
    RunUpdate,
    state_text,
)

__all__ = [
    "Show",
    "cycle_text",
    "display",
    "event_line",
    "interesting",
    "joined_events",
    "not_in_op",
    "number_text",
    "other_parameters",
    "print_events",
    "print_result",
    "state_verdict",
    "write_timing",
]

_COLUMNS = (
    Column("connection"),
    Column("state"),
    Column("ConnID", number=True, rank=4),
    Column("FSoE cycle", number=True, rank=3),
    Column("resets", number=True, rank=1),
    Column("last reason", rank=2, wraps=True),
)
_AT_THE_END = (
    Column("connection"),
    Column("state"),
    Column("ConnID", number=True, rank=3),
    Column("address", number=True, rank=4),
    Column("FSoE cycle", number=True, rank=2),
    Column("to Data", number=True, rank=5),
    Column("resets", rank=1, wraps=True),
)
_STATE_LEVELS = {"data_process": Level.CLEAR, "data_failsafe": Level.WARNING}


Show = Callable[[RunUpdate], None]


@contextmanager
def display(name: str) -> Iterator[Show]:
    """Show a run on the terminal while it goes on; gives what takes the updates."""
    from rich.live import Live

    with Live(refresh_per_second=10, transient=True, console=terminal()) as live:
        yield lambda update: live.update(_live_view(name, update))


def _live_view(name: str, update: RunUpdate) -> TerminalView:
    """Return what a terminal shows during a run: connections, and SubDevices not in OP."""
    cells = tuple(
        (
            cell(c.name),
            cell(state_verdict(c.state)),
            cell(number_text(c.connection_id)),
            cell(f"{c.fsoe_cycle_ms['last']:.1f} ms"),
            cell(str(c.resets)),
            cell(c.last_reset_text),
        )
        for c in update.connections
    )
    title = f"{name} · {update.now_s:.1f} s · {cycle_text(update.statistics)}"
    table = Table(columns=_COLUMNS, rows=cells)
    return TerminalView(Document(title=title, lead=(table, *not_in_op(update.subdevices))))


def cycle_text(statistics: Statistics) -> str:
    """Return the number of the cycle, and its working counter where that is not complete."""
    s = statistics
    wkc = "" if s.expected_wkc == s.actual_wkc else f" · WKC {s.actual_wkc}/{s.expected_wkc}"
    return f"cycle {s.cycles}{wkc}"


def state_verdict(word: str) -> Verdict:
    """Return a state for people."""
    return Verdict(state_text(word), _STATE_LEVELS.get(word, Level.ERROR))


def not_in_op(subdevices: Sequence[SubDeviceSnapshot]) -> list[Paragraph]:
    """Return a line for every SubDevice that should be in OP and is not, with what is known."""
    lines = []
    for s in subdevices:
        if s.in_op or (s.is_absent and not s.detail):
            continue
        code = f", AL status code 0x{s.al_code:04x}" if s.al_code else ""
        text = s.detail or s.found_text or "nothing is known about it"
        state = "no answer" if s.al == "none" else s.al
        lines.append(words(Verdict(f"{s.name}: {state}{code}: {text}", Level.ERROR)))
    return lines


def number_text(value: int | None) -> str:
    """Return a number, ``-`` for none."""
    return "-" if value is None else str(value)


def other_parameters(connections: Iterable[ConnectionResult]) -> list[Paragraph]:
    """Return a line for each connection with other parameters than the plan has."""
    return [
        words(Verdict(f"{c.name}: other parameters: {'; '.join(c.differences)}", Level.ERROR))
        for c in connections
        if c.differs
    ]


def print_result(result: Run) -> None:
    """Print events, connections, SubDevices not in OP, totals and verdicts."""
    print_events(result.events)
    echo()
    show(_result(result))


def _result(result: Run) -> Document:
    rows = tuple(_row(c) for c in result.connections)
    chosen = any(c.chosen for c in result.connections)
    s = result.statistics
    totals = (
        f"{counted(s.cycles, 'bus cycle')} in {result.duration_ms / 1000:.1f} s "
        f"({_mode(result)}), {s.wkc_errors} with incomplete working counter, "
        f"{counted(s.overruns, 'overrun')}"
    )
    table = Table(
        columns=_AT_THE_END,
        rows=rows,
        remark="* chosen here; no file states it" if chosen else "",
    )
    return Document(
        lead=(
            table,
            *other_parameters(result.connections),
            *not_in_op(result.subdevices),
            words(totals),
            *_verdicts(result),
        ),
    )


def _row(c: ConnectionResult) -> tuple[Cell, ...]:
    reason = f" ({c.last_reset_text})" if c.resets else ""
    return (
        cell(c.name),
        cell(state_verdict(c.state)),
        cell(number_text(c.connection_id) + _mark(c, "connection_id")),
        cell(number_text(c.address) + _mark(c, "address")),
        cell(f"{c.fsoe_cycle_ms['mean']:.2f} ms"),
        cell("-" if c.time_to_data_ms is None else f"{c.time_to_data_ms:.0f} ms"),
        cell(f"{c.resets}{reason}"),
    )


def _mark(c: ConnectionResult, what: str) -> str:
    return "*" if what in c.chosen else ""


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
    quiet = (RunEventKind.STATE, RunEventKind.WORKING_COUNTER, RunEventKind.LINKS)
    return [e for e in events if e.kind not in quiet or e.in_data]


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


def _verdicts(result: Run) -> list[Paragraph]:
    lines = [
        words(Verdict(f"{v.place}: not observed: {v.text}; {v.seen}", Level.ERROR))
        for v in result.verdicts
        if not v.held
    ]
    if result.verdicts:
        held = sum(v.held for v in result.verdicts)
        lines.append(words(f"{held} of {counted(len(result.verdicts), 'expectation')} held"))
    if result.passed:
        return lines
    if not result.verdicts:
        missing = " with its SubDevices in OP" if not_in_op(result.subdevices) else ""
        lines.append(words(f"not every connection is in Data{missing}"))
    stall = _stall_text(result)
    return [*lines, words(stall)] if stall else lines


def write_timing(
    result: Run, stats: str | None, plot: str | None, *, text: bool, overwrite: bool
) -> None:
    """Write the requested files, and print percentiles when ``text`` is wanted.

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
        show(Document(lead=(times_table(result.statistics),)))
