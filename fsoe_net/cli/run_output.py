"""Output of a run: the live table, the text at the end, the timing files."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
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
from fsoe_net.live.health import (
    FsoeHealth,
    Health,
    HealthLevel,
    HealthReason,
    health_texts,
    in_operation,
    subdevice_health,
)
from fsoe_net.live.result import (
    ConnectionResult,
    Run,
    RunEvent,
    RunEventKind,
    RunUpdate,
    result_health,
)
from fsoe_net.report.cycle_times import times_table, timing_csv, timing_picture
from fsoe_net.report.section_evidence import HEALTH_LEVELS

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

STATE_REASONS = (HealthReason.NOT_IN_DATA, HealthReason.FAILSAFE_DATA)
"""Reasons that the state of a connection already shows."""

Show = Callable[[RunUpdate], None]


@contextmanager
def display(name: str) -> Iterator[Show]:
    """Display a run on the terminal; yields the function for updates."""
    from rich.live import Live

    with Live(refresh_per_second=10, transient=True, console=terminal()) as live:
        yield lambda update: live.update(_live_view(name, update))


def _live_view(name: str, update: RunUpdate) -> TerminalView:
    """Return the terminal view during a run: connections, and SubDevices not in OP."""
    cells = tuple(
        (
            cell(c.name),
            state_cell(c, result_health(c, update.subdevices)),
            cell(number_text(c.connection_id)),
            cell(f"{c.fsoe_cycle_ms['last']:.1f} ms"),
            cell(str(c.resets)),
            cell(c.last_reset_text),
        )
        for c in update.connections
    )
    title = f"{name} · {update.now_s:.1f} s · {cycle_text(update.statistics)}"
    table = Table(columns=_COLUMNS, rows=cells)
    lines = health_lines(map(subdevice_health, update.subdevices))
    return TerminalView(Document(title=title, lead=(table, *lines)))


def cycle_text(statistics: Statistics) -> str:
    """Return the number of the cycle, and its working counter if that is incomplete."""
    s = statistics
    wkc = "" if s.expected_wkc == s.actual_wkc else f" · WKC {s.actual_wkc}/{s.expected_wkc}"
    return f"cycle {s.cycles}{wkc}"


def health_verdict(text: str, level: HealthLevel) -> Verdict:
    """Return a verdict with this text and level of health."""
    return Verdict(text, HEALTH_LEVELS[level])


def state_cell(result: ConnectionResult, health: FsoeHealth) -> Cell:
    """Return the state of a connection with the level of its health."""
    is_absent = HealthReason.END_ABSENT in health.reasons
    text = "absent" if is_absent else result.state.text
    return cell(health_verdict(text, health.level))


def health_lines(rows: Iterable[Health], shown: Collection[HealthReason] = ()) -> list[Paragraph]:
    """Return a line with the reasons for every subject that has a problem.

    Args:
        rows: All subjects.
        shown: Reasons that a table already shows.
    """
    lines = []
    for row in rows:
        rest = replace(row, reasons=tuple(r for r in row.reasons if r not in shown))
        if any(r.level > HealthLevel.UNKNOWN for r in rest.reasons):
            text = f"{row.name}: {'; '.join(health_texts(rest))}"
            lines.append(words(health_verdict(text, rest.level)))
    return lines


def number_text(value: int | None) -> str:
    """Return a number as text, or ``-`` for ``None``."""
    return "-" if value is None else str(value)


def print_result(result: Run) -> None:
    """Print events, connections, SubDevices not in OP, totals and verdicts."""
    print_events(result.events)
    echo()
    show(_result(result))


def _result(result: Run) -> Document:
    health = [result_health(c, result.subdevices) for c in result.connections]
    rows = tuple(map(_row, result.connections, health))
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
            table if rows else words("no FSoE connections"),
            *health_lines(health, STATE_REASONS),
            *health_lines(map(subdevice_health, result.subdevices)),
            words(totals),
            *_verdicts(result),
        ),
    )


def _row(c: ConnectionResult, health: FsoeHealth) -> tuple[Cell, ...]:
    reason = f" ({c.last_reset_text})" if c.resets else ""
    return (
        cell(c.name),
        state_cell(c, health),
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
    """Print interesting events; simultaneous or repeated ones with the same text are joined."""
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
    """Return the events, joining those with the same time and text, as after the loss of a bus."""
    found = []
    # A lost bus resets all connections within a millisecond.
    for _, rows in itertools.groupby(events, key=lambda e: (round(e.time_ms), e.text)):
        same = list(rows)
        names = ", ".join(dict.fromkeys(e.source for e in same))
        found.append(replace(same[0], source=names))
    return found


def event_line(event: RunEvent) -> str:
    """Return an event as one line."""
    return f"{event.time_ms:10.1f} ms  {event.source}: {event.text}"


def interesting(events: Sequence[RunEvent]) -> list[RunEvent]:
    """Return the events of interest to a person: not every step of a start-up."""
    quiet = (RunEventKind.STATE, RunEventKind.WORKING_COUNTER, RunEventKind.LINKS)
    return [e for e in events if e.kind not in quiet or e.in_data]


def _stall_text(result: Run) -> str:
    """Return how a stall of this machine explains the result; empty if shorter than a watchdog."""
    watchdogs = [c.watchdog_ms for c in result.connections if c.watchdog_ms]
    if not watchdogs or result.stalled_ms < min(watchdogs):
        return ""
    return (
        f"this machine stood still for {result.stalled_ms:.0f} ms, longer than an FSoE watchdog "
        f"({min(watchdogs)} ms): its effects are not caused by the files; run it again, "
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
        # If all SubDevices are in OP, the cause is in FSoE; otherwise it is on the bus.
        in_op = in_operation(map(subdevice_health, result.subdevices))
        missing = "" if in_op else " with its SubDevices in OP"
        lines.append(words(f"not every connection is in Data{missing}"))
    stall = _stall_text(result)
    return [*lines, words(stall)] if stall else lines


def write_timing(
    result: Run, stats: str | None, plot: str | None, *, text: bool, overwrite: bool
) -> None:
    """Write the requested files, and print percentiles if ``text`` is set.

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
