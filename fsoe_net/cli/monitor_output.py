"""How a bus that is watched is shown: one view for the live display and for the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fsoe_net.cli.fitted_table import Column, FittedTable
from fsoe_net.cli.run_output import cycle_text, not_in_op, number_text, state_markup
from fsoe_net.diag.words import counted
from fsoe_net.report.cycle_times import timing_bars, timing_text
from fsoe_net.run.attachment import BusView, WatchedConnection
from fsoe_net.run.live_snapshot import SubDeviceSnapshot

if TYPE_CHECKING:
    from rich.console import Group, RenderableType

from typing import TYPE_CHECKING

from fsoe_net.run.live_capture import LiveCapture

if TYPE_CHECKING:
    pass

__all__ = ["bus_view", "capture_text"]

_TIGHT = 0.8  # of the watchdog; beyond it one lost frame more can be one too many
_COLUMNS = (
    Column(head="connection", rank=0),
    Column(head="state", rank=0),
    Column(head="ConnID", rank=6, is_number=True),
    Column(head="FSoE cycle ms", rank=5, is_number=True),
    Column(head="longest", rank=8, is_number=True),
    Column(head="of watchdog", rank=2),
    Column(head="held", rank=7, is_number=True),
    Column(head="CRC wrong", rank=4, is_number=True),
    Column(head="resets", rank=1, is_number=True),
    Column(head="last cause", rank=3, wraps=True),
)


def bus_view(view: BusView, *, bars: bool = True) -> Group:
    """Return what is known: connections, SubDevices that lack something, timing."""
    from rich.console import Group
    from rich.text import Text

    parts: list[RenderableType] = [Text(_title(view), style="bold")]
    if view.away:
        parts.append(Text(f"fsn-master is gone, waiting for it: {view.away}", style="red"))
    elif not view.current:
        parts.append(Text(_stopped(view), style="red"))
    snapshot = view.snapshot
    if snapshot is None:
        return Group(*parts)
    if view.connections:
        parts.append(_connections(view))
    parts += [Text(line, style="red") for line in not_in_op(snapshot.subdevices)]
    parts += [Text(line, style="yellow") for line in _worn(snapshot.subdevices)]
    s = snapshot.cycle.statistics
    parts.append(Text(f"\n{timing_text(s)}"))
    if bars and s.latency.count:
        lines = "\n".join(timing_bars(s.latency))
        parts.append(Text(f"\nwake-up latency, how often (log scale)\n{lines}"))
    parts.append(
        Text(
            f"\n{counted(s.cycles, 'cycle')}, {s.wkc_errors} with incomplete working "
            f"counter, {counted(s.overruns, 'overrun')}, "
            f"{counted(s.lost_frames, 'frame')} lost, {s.old_replies} came too late"
        )
    )
    return Group(*parts)


def _title(view: BusView) -> str:
    status, snapshot = view.status, view.snapshot
    words = []
    if status is not None:
        state = "gone" if view.away else status.state.value
        words = [f"{status.backend} on {status.interface or 'memory'}", state]
    words.append(f"{view.now_s:.1f} s")
    if snapshot is not None:
        words.append(cycle_text(snapshot.cycle.statistics))
    if status is not None and status.cycle_ns:
        words.append(f"{status.cycle_ns / 1e6:g} ms {status.policy}")
    return " · ".join(words)


def _stopped(view: BusView) -> str:
    status = view.status
    if status is None:
        return "nothing is known yet"
    fault = f": {status.fault}" if status.fault else ""
    shown = "; what is shown was seen last" if view.snapshot is not None else ""
    return f"the bus does not run ({status.state.value}){fault}{shown}"


def _connections(view: BusView) -> FittedTable:
    from rich.markup import escape

    rows = [
        (
            escape(c.name),
            state_markup(c.state),
            number_text(c.connection_id),
            f"{c.fsoe_cycle_ms['mean']:.2f}",
            f"{c.fsoe_cycle_ms['max']:.2f}",
            _watchdog(row),
            str(row.held_main + row.held_sub),
            str(c.wrong_to_sub + c.wrong_to_main),
            str(c.resets),
            escape(row.cause),
        )
        for row in view.connections
        for c in [row.result]
    ]
    return FittedTable(_COLUMNS, rows)


def _watchdog(row: WatchedConnection) -> str:
    share, watchdog_ms = row.watchdog_share, row.result.watchdog_ms
    if share is None or watchdog_ms is None:
        return "not known"
    text = f"{100 * share:.0f} % of {watchdog_ms} ms"
    return f"[yellow]{text}[/]" if share > _TIGHT else text


def _worn(subdevices: tuple[SubDeviceSnapshot, ...]) -> list[str]:
    """Return a line for each SubDevice whose ports have counted faults, or that was away."""
    lines = []
    for s in subdevices:
        found = []
        if s.returns:
            found.append(f"lost and back {counted(s.returns, 'time')}")
        for what, counts in (("link lost", s.link_lost), ("receive errors", s.rx_errors)):
            ports = [f"port {n}: {count}" for n, count in enumerate(counts) if count]
            if ports:
                found.append(f"{what} ({', '.join(ports)})")
        if s.in_op and s.detail:
            found.insert(0, s.detail)
        if found:
            lines.append(f"{s.name}: {', '.join(found)}")
    return lines


def capture_text(recorder: LiveCapture, path: str | None) -> str:
    """Return what was captured, as a line."""
    how = f"rebuilt: {recorder.rebuilt}" if recorder.rebuilt else "from the wire"
    lost = f", {recorder.skipped} missed" if recorder.skipped else ""
    text = f"{path}: {counted(recorder.packets, 'frame')}, {how}{lost}"
    if recorder.fault:
        text += f"; it ended early: {recorder.fault}"
    elif not recorder.packets and not recorder.rebuilt:
        text += "; is fsn-master in another network namespace? --rebuild needs none"
    return text
