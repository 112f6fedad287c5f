"""Console commands for the whole bus: start, stop, status."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from fsoe_net.core.bus_documents import BusSnapshot, SubDeviceSnapshot
from fsoe_net.core.snapshot import ConnectionSnapshot
from fsoe_net.diag.words import counted
from fsoe_net.errors import ConsoleError, ControlRefused
from fsoe_net.live.client import Client
from fsoe_net.live.console.command import CommandContext, CommandForm, table, usage
from fsoe_net.live.console.names import seconds
from fsoe_net.live.control_values import BusState, Status
from fsoe_net.live.health import (
    Health,
    HealthLevel,
    HealthReason,
    SubDeviceHealth,
    bus_health,
    health_texts,
    reason_text,
    snapshot_health,
    subdevice_health,
)

_CHANGE_S = 60.0
_POLL_S = 0.05
_UP = (BusState.RUNNING, BusState.FAILED)
_DOWN = (BusState.STOPPED, BusState.FAILED)
_CLOCKS = {HealthReason.CLOCKS_APART, HealthReason.CLOCKS_WITHOUT_REFERENCE}


def _for(name: str, words: Sequence[str], default: float | None) -> float | None:
    """Return the time of ``[for TIME]``."""
    if not words:
        return default
    if len(words) == 2 and words[0] == "for":
        return seconds(words[1])
    raise usage(name, BUS_COMMANDS[name].usage)


def _change(context: CommandContext, name: str, words: Sequence[str]) -> None:
    """Request start, stop or restart, and wait until the bus is in the target state."""
    limit = _for(name, words, _CHANGE_S) or 0.0
    before = context.link.call(lambda client: client.status().state)
    if name == "start" and before is BusState.RUNNING:
        context.out("already running")
        return
    if name == "stop" and before is BusState.STOPPED:
        context.out("already stopped")
        return
    wanted = BusState.STOPPED if name == "stop" else BusState.RUNNING
    # A start may load another plan, so that known names are no longer valid.
    context.forget()
    state, fault = context.link.aside(lambda client: _changed(client, name, before, limit))
    if state is not wanted:
        raise ConsoleError(f"{name}: fsn-master is {state}{f': {fault}' if fault else ''}")
    context.out(str(state))


def _changed(client: Client, name: str, before: BusState, limit_s: float) -> tuple[BusState, str]:
    """Send the request; return the state it led to, or the one it is stuck in, and its fault."""
    until = time.monotonic() + limit_s
    ends = _DOWN if name == "stop" else _UP
    # Subscribe before the request: the event of a fast change would otherwise be missed.
    client.subscribe()
    coming = {"start": (BusState.OPENING, BusState.STARTING), "stop": (BusState.STOPPING,)}
    # If the bus is already changing, no second request is needed; fsn-master would refuse it.
    if before not in coming.get(name, ()):
        client.request(name)
    # It may have arrived between the first status and the subscription; then no event follows.
    elif client.status().state in ends:
        return _where(client)
    moved = False
    while time.monotonic() < until:
        for event in client.events(min(_POLL_S * 10, max(0.0, until - time.monotonic()))):
            if event.get("event") != "state":
                continue
            # A restart of a stopped bus and a start begin with `opening`; others with `stopping`.
            state = str(event.get("state"))
            if state in ends and (moved or name != "restart" or state == BusState.FAILED):
                return _where(client)
            # The first state after `restart` is that of the stop, which must not end the wait.
            moved = True
    return _where(client)


def _where(client: Client) -> tuple[BusState, str]:
    status = client.status()
    return status.state, status.fault


def _changer(name: str) -> Callable[[CommandContext, Sequence[str]], None]:
    return lambda context, words: _change(context, name, words)


def _state(context: CommandContext, words: Sequence[str]) -> None:
    if len(words) > 1:
        raise usage("state", BUS_COMMANDS["state"].usage)
    if words:
        _state_of(context, words[0])
    else:
        _state_of_bus(context)


def _state_of_bus(context: CommandContext) -> None:
    """Show the status, ring and clocks if present, and current problems."""
    status, rows, seen = context.link.call(
        lambda client: (client.status(), client.subdevices(), _seen(client))
    )
    context.out(_status_line(status, () if seen is None else seen.cycle.connections))
    statistics = None if seen is None else seen.cycle.statistics
    bus = bus_health(status, statistics, current=seen is not None)
    for reason in bus.reasons:
        context.out(f"{reason.level.name.lower()}: {reason_text(reason, bus)}")
    # A reason that is shown above contains the same text: do not print it twice.
    ring = None if HealthReason.RING_OPEN in bus.reasons else status.ring
    clocks = None if _CLOCKS.intersection(bus.reasons) else status.clocks
    for part in (ring, clocks, *status.in_cycle):
        if part is not None:
            context.out(part.text)
    # SubDevices without a problem are not listed: a bus has hundreds of them.
    for health in map(subdevice_health, rows):
        if health.level > HealthLevel.UNKNOWN:
            context.out("  ".join(part for part in _device(health) if part))


def _seen(client: Client) -> BusSnapshot | None:
    try:
        return client.snapshot()
    except ControlRefused as refused:
        if not refused.bus_stopped:
            raise
        return None


def _state_of(context: CommandContext, name: str) -> None:
    """Show one SubDevice with its connections, or all of them."""
    found = context.link.call(lambda client: client.subdevices())
    chosen = [row for row in found if name in ("all", row.name)]
    if not chosen:
        known = ", ".join(row.name for row in found)
        raise ConsoleError(f"no SubDevice is called {name}; there are: {known}")
    for line in table([_device(subdevice_health(row)) for row in chosen]):
        context.out(line)
    if name != "all":
        seen = context.link.call(_seen)
        rows = () if seen is None else seen.cycle.connections
        for line in table([_connection(c, found) for c in rows if name in (c.main, c.sub)]):
            context.out(line)


def _status_line(status: Status, connections: Sequence[ConnectionSnapshot]) -> str:
    parts = [str(status.state)]
    if status.state in (BusState.RUNNING, BusState.STARTING):
        in_data = sum(c.state.in_data for c in connections)
        parts += [
            f"cycle {status.cycle_ns / 1e6:g} ms",
            f"{counted(status.cycles, 'cycle')}",
            f"working counter {status.actual_wkc} of {status.expected_wkc}",
            f"{status.in_op} of {status.planned} SubDevices in OP",
            f"{in_data} of {counted(len(connections), 'connection')} in Data",
        ]
    return ", ".join(parts)


def _device(health: SubDeviceHealth) -> tuple[str, ...]:
    row = health.seen
    al = row.al if row.known else "state unknown"
    return row.name, al, f"alias {row.alias} position {row.position}", _reasons(health)


def _connection(
    row: ConnectionSnapshot, subdevices: Sequence[SubDeviceSnapshot]
) -> tuple[str, ...]:
    frames = f"{row.to_sub.frames} / {counted(row.to_main.frames, 'frame')}"
    wrong = row.to_sub.wrong + row.to_main.wrong
    counts = [counted(n, what) for n, what in ((row.resets, "reset"), (wrong, "wrong CRC")) if n]
    health = _reasons(snapshot_health(row, subdevices))
    return row.name, f"{row.main} - {row.sub}", row.state, frames, ", ".join(counts), health


def _reasons(health: Health) -> str:
    """Return level and reasons; empty if there is nothing to report."""
    texts = "; ".join(health_texts(health))
    return texts and f"{health.level.name.lower()}: {texts}"


def _show_connections(context: CommandContext, words: Sequence[str]) -> None:
    if words:
        raise usage("connections", "")
    seen = context.link.call(lambda client: client.snapshot())
    for line in table([_connection(row, seen.subdevices) for row in seen.cycle.connections]):
        context.out(line)


def _snapshot(context: CommandContext, words: Sequence[str]) -> None:
    if words:
        raise usage("snapshot", "")
    status, seen = context.link.call(lambda client: (client.status(), client.snapshot()))
    s, rows = seen.cycle.statistics, seen.cycle.connections
    context.out(_status_line(status, rows))
    context.out(
        f"overruns {s.overruns}, incomplete cycles {s.wkc_errors}, lost frames {s.lost_frames}, "
        f"late {s.latency.p50_ns / 1e3:g} us (half), {s.latency.p99_ns / 1e3:g} us (99 %), "
        f"{s.latency.max_ns / 1e3:g} us (most)"
    )
    for line in table([_connection(row, seen.subdevices) for row in rows]):
        context.out(line)
    for line in table([_device(subdevice_health(row)) for row in seen.subdevices]):
        context.out(line)


def event_line(event: dict[str, Any]) -> str:
    """Return an event for people."""
    return f"{event.get('utc', '')} {event.get('level', '')} {event.get('text', '')}".strip()


def _events(context: CommandContext, words: Sequence[str]) -> None:
    if words in (["on"], ["off"]):
        context.link.subscribe(words[0] == "on")
        context.out(f"events {words[0]}")
        return
    limit = _for("events", words, 0.0) or 0.0
    until = time.monotonic() + limit
    # Check once even without `for`: events that have arrived are always shown.
    while True:
        for event in context.events():
            context.out(event_line(event))
        if time.monotonic() >= until:
            return
        context.sleep(_POLL_S)


def _incident(context: CommandContext, words: Sequence[str]) -> None:
    file = context.link.call(lambda client: client.incident(" ".join(words)))
    context.out(f"incident {file}" if file else "incident requested; an event names its file")


BUS_COMMANDS = {
    "start": CommandForm(
        "[for TIME]",
        "open the bus and bring it to OP; waits for it, a minute at most",
        "start for 20s",
        _changer("start"),
    ),
    "stop": CommandForm(
        "[for TIME]",
        "stop values, SAFEOP, bus closed; no emergency stop",
        "stop",
        _changer("stop"),
    ),
    "restart": CommandForm(
        "[for TIME]", "stop, then start with the same plan", "restart", _changer("restart")
    ),
    "state": CommandForm(
        "[SUBDEVICE|all]", "state of the bus, of one SubDevice or of each", "state drive_1", _state
    ),
    "connections": CommandForm(
        "", "FSoE connections as seen on the wire", "connections", _show_connections
    ),
    "snapshot": CommandForm(
        "", "bus, timing, connections and SubDevices of one cycle", "snapshot", _snapshot
    ),
    "events": CommandForm(
        "[on|off|for TIME]", "what has happened, or happens within a time", "events for 5s", _events
    ),
    "incident": CommandForm(
        "[TEXT]", "write the last seconds to an incident file", "incident jerk", _incident
    ),
}
