"""Output of a watched bus: one view for the live display and for the end."""

from __future__ import annotations

from fsoe_net.cli.run_output import (
    STATE_REASONS,
    cycle_text,
    health_lines,
    health_verdict,
    number_text,
    state_cell,
)
from fsoe_net.core.bus_documents import SubDeviceSnapshot
from fsoe_net.core.snapshot import Statistics
from fsoe_net.diag.words import counted
from fsoe_net.document.model import (
    Cell,
    Column,
    Document,
    Heading,
    Lines,
    Paragraph,
    Part,
    Table,
    cell,
    words,
)
from fsoe_net.live.attachment import BusView, WatchedConnection
from fsoe_net.live.control_values import Status
from fsoe_net.live.health import FsoeHealth, HealthReason, reason_text
from fsoe_net.live.live_capture import LiveCapture
from fsoe_net.report.cycle_times import times_table, timing_bars

_SHOWN = (*STATE_REASONS, HealthReason.WATCHDOG_RESERVE)
_COLUMNS = (
    Column("connection"),
    Column("state"),
    Column("ConnID", number=True, rank=6),
    Column("FSoE cycle ms", number=True, rank=5),
    Column("longest", number=True, rank=8),
    Column("of watchdog", rank=2),
    Column("held", number=True, rank=7),
    Column("CRC wrong", number=True, rank=4),
    Column("resets", number=True, rank=1),
    Column("last cause", rank=3, wraps=True),
)


def bus_document(view: BusView) -> Document:
    """Return the known facts: connections, SubDevices with problems, timing."""
    health = view.health
    parts: list[Part] = [
        words(health_verdict(reason_text(r, health.bus), r.level)) for r in health.bus.reasons
    ]
    if view.snapshot is not None:
        # Outdated values stay visible: they show the previous state of the bus.
        if not view.current:
            parts.append(words("the values are the last known ones"))
        if view.connections:
            rows = tuple(map(_row, view.connections, health.connections))
            parts.append(Table(columns=_COLUMNS, rows=rows))
            parts += health_lines(health.connections, _SHOWN)
        parts += health_lines(health.subdevices)
        parts += _counted(view.snapshot.subdevices)
        parts += _buses(view.status)
        parts += [words(c.text) for c in (view.status.in_cycle if view.status else ())]
        parts += _groups(view.status)
        parts += _timing(view.snapshot.cycle.statistics)
    return Document(title=_title(view), lead=tuple(parts))


def _buses(status: Status | None) -> list[Part]:
    return [
        words(
            f"bus {b.name}: {b.cycle_ns / 1e6:g} ms, {counted(b.cycles, 'cycle')}, working counter "
            f"{b.actual_wkc} of {b.expected_wkc}, {b.wkc_errors} with incomplete working counter, "
            f"{counted(b.overruns, 'overrun')}, {counted(b.lost_frames, 'frame')} lost"
        )
        for b in (status.buses if status is not None else ())
    ]


def _groups(status: Status | None) -> list[Part]:
    groups = status.groups if status is not None else ()
    return [
        words(f"group {g.name}" + f" at {g.place}" * bool(g.place) + f": {g.state}") for g in groups
    ]


def _timing(s: Statistics) -> list[Part]:
    parts: list[Part] = [times_table(s)]
    if s.latency.count:
        title = Heading("wake-up latency, how often (log scale)")
        parts += [title, Lines(tuple(timing_bars(s.latency)))]
    totals = (
        f"{counted(s.cycles, 'cycle')}, {s.wkc_errors} with incomplete working "
        f"counter, {counted(s.overruns, 'overrun')}, "
        f"{counted(s.lost_frames, 'frame')} lost, {s.old_replies} came too late"
    )
    return [*parts, words(totals)]


def _title(view: BusView) -> str:
    status, snapshot = view.status, view.snapshot
    words = []
    if status is not None:
        state = "gone" if view.away else status.state.value
        where = ", ".join(f"{b.name}={b.interface}" for b in status.buses if b.interface)
        words = [f"{status.backend} on {where or status.interface or 'memory'}", state]
    words.append(f"{view.now_s:.1f} s")
    if snapshot is not None:
        words.append(cycle_text(snapshot.cycle.statistics))
    if status is not None and status.cycle_ns:
        words.append(f"{status.cycle_ns / 1e6:g} ms {status.policy}")
    return " · ".join(words)


def _row(row: WatchedConnection, health: FsoeHealth) -> tuple[Cell, ...]:
    c = row.result
    return (
        cell(c.name),
        state_cell(c, health),
        cell(number_text(c.connection_id)),
        cell(f"{c.fsoe_cycle_ms['mean']:.2f}"),
        cell(f"{c.fsoe_cycle_ms['max']:.2f}"),
        _watchdog(row, health),
        cell(str(row.held_main + row.held_sub)),
        cell(str(c.wrong_to_sub + c.wrong_to_main)),
        cell(str(c.resets)),
        cell(row.cause),
    )


def _watchdog(row: WatchedConnection, health: FsoeHealth) -> Cell:
    share, watchdog_ms = row.watchdog_share, row.result.watchdog_ms
    if share is None or watchdog_ms is None:
        return cell("not known")
    text = f"{100 * share:.0f} % of {watchdog_ms} ms"
    reason = HealthReason.WATCHDOG_RESERVE
    return cell(health_verdict(text, reason.level) if reason in health.reasons else text)


def _counted(subdevices: tuple[SubDeviceSnapshot, ...]) -> list[Paragraph]:
    """Return a line for each SubDevice that was absent or whose ports counted faults."""
    lines = []
    for s in subdevices:
        found = []
        if s.returns:
            found.append(f"lost and back {counted(s.returns, 'time')}")
        for what, counts in (("link lost", s.link_lost), ("receive errors", s.rx_errors)):
            ports = [f"port {n}: {count}" for n, count in enumerate(counts) if count]
            if ports:
                found.append(f"{what} ({', '.join(ports)})")
        if found:
            lines.append(words(f"{s.name}: {', '.join(found)}"))
    return lines


def capture_text(recorder: LiveCapture, path: str | None) -> str:
    """Return a line about what was captured."""
    how = f"rebuilt: {recorder.rebuilt}" if recorder.rebuilt else "from the wire"
    lost = f", {recorder.skipped} missed" if recorder.skipped else ""
    text = f"{path}: {counted(recorder.packets, 'frame')}, {how}{lost}"
    if recorder.fault:
        text += f"; it ended early: {recorder.fault}"
    # No frames: probably the wrong interface, even if it has the same name.
    elif not recorder.packets and not recorder.rebuilt:
        text += "; is fsn-master in another network namespace? --rebuild needs none"
    return text
