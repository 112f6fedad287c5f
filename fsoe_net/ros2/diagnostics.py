"""What is known of a bus as statuses of ``/diagnostics``: connections, SubDevices, the cycle.

Levels are those of ``diagnostic_msgs/DiagnosticStatus``. Nothing here knows of DDS.
"""

from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import dataclass

from fsoe_net.core.snapshot import Histogram, Statistics
from fsoe_net.live.control_values import BusState, Status
from fsoe_net.observe.bus_documents import SubDeviceSnapshot
from fsoe_net.run.attachment import BusView, WatchedConnection
from fsoe_net.run.result import is_data, state_text

__all__ = ["HOLD_S", "Health", "HealthLevel", "HealthStatus"]

HOLD_S = 5.0
"""How long a Reset keeps its connection at ERROR: longer than people and aggregators look away."""


class HealthLevel(enum.IntEnum):
    """Levels of a status; the numbers are those of the message."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthStatus:
    """One status: ``name`` of what it is about, ``message`` in words, ``values`` by key."""

    level: HealthLevel
    name: str
    message: str
    values: tuple[tuple[str, str], ...] = ()


class Health:
    """Turns views of a bus into statuses; remembers what only a change shows."""

    def __init__(self) -> None:
        self._resets: dict[str, int] = {}
        self._error_until: dict[str, float] = {}
        self._cycle: Statistics | None = None

    def statuses(self, view: BusView, now_s: float) -> list[HealthStatus]:
        """Return the statuses of a view: the bus, then each SubDevice and each connection.

        Args:
            view: What is known.
            now_s: Any clock that does not go back, seconds.
        """
        known = view.current and not view.away
        found = [self._bus(view, known=known)]
        rows = view.snapshot.subdevices if view.snapshot is not None else ()
        absent = {s.name for s in rows if s.is_absent}
        found += [_subdevice(s, known=known) for s in rows]
        for connection in view.connections:
            name = connection.result.name
            if self._was_reset(name, connection.resets_to_sub + connection.resets_to_main):
                self._error_until[name] = now_s + HOLD_S
            if {connection.result.main, connection.result.sub} & absent:
                level, text = HealthLevel.OK, "a SubDevice of it is absent, as it may be"
            else:
                level, text = _state(
                    connection, was_reset=now_s < self._error_until.get(name, now_s)
                )
            if not known:
                level, text = HealthLevel.STALE, f"not known now; last: {text}"
            found.append(
                HealthStatus(
                    level=level,
                    name=f"connection {name}",
                    message=text,
                    values=tuple(_connection_values(connection)),
                )
            )
        return found

    def _was_reset(self, name: str, resets: int) -> bool:
        """Whether there are more Resets than before; fewer are those of a bus opened again."""
        before = self._resets.get(name, resets)
        self._resets[name] = resets
        return resets > before

    def _bus(self, view: BusView, *, known: bool) -> HealthStatus:
        status = view.status
        if view.away or status is None:
            level, text = HealthLevel.ERROR, f"fsn-master does not answer: {view.away}"
        elif status.fault:
            level, text = HealthLevel.ERROR, f"the bus did not open: {status.fault}"
        elif not known:
            level = HealthLevel.ERROR if status.state is BusState.FAILED else HealthLevel.WARN
            text = f"the bus does not run ({status.state.value})"
            if view.refused:
                level, text = HealthLevel.ERROR, f"its state cannot be read: {view.refused}"
        else:
            level, text = self._cycle_level(view, status)
        values = [] if status is None else list(_bus_values(status))
        if view.snapshot is not None:
            values += _cycle_values(view.snapshot.cycle.statistics)
        return HealthStatus(level=level, name="bus", message=text, values=tuple(values))

    def _cycle_level(self, view: BusView, status: Status) -> tuple[HealthLevel, str]:
        snapshot = view.snapshot
        if snapshot is None:
            return HealthLevel.WARN, "no cycle is known yet"
        now = snapshot.cycle.statistics
        before, self._cycle = self._cycle, now
        if now.actual_wkc != now.expected_wkc:
            return HealthLevel.ERROR, f"working counter {now.actual_wkc} of {now.expected_wkc}"
        ring = status.ring.state if status.ring is not None else ""
        clocks = status.clocks.state if status.clocks is not None else ""
        notes = [
            text
            for text, is_so in (
                ("the ring is not closed", ring in ("open", "one way")),
                ("distributed clocks are apart", clocks == "apart"),
                ("distributed clocks have no reference", clocks == "no reference"),
                ("the cycle was late", _grew(before, now, "overruns")),
                ("working counter was incomplete", _grew(before, now, "wkc_errors")),
                ("frames were lost", _grew(before, now, "lost_frames")),
            )
            if is_so
        ]
        if notes:
            return HealthLevel.WARN, ", ".join(notes)
        return HealthLevel.OK, f"{status.state.value}, working counter complete"


def _grew(before: Statistics | None, now: Statistics, name: str) -> bool:
    return before is not None and getattr(now, name) > getattr(before, name)


def _state(connection: WatchedConnection, *, was_reset: bool) -> tuple[HealthLevel, str]:
    state = connection.result.state
    text = state_text(state)
    if was_reset or not is_data(state):
        return HealthLevel.ERROR, text + f"; last Reset: {connection.cause}" * bool(
            connection.cause
        )
    if connection.result.differs:
        names = ", ".join(connection.result.differs)
        return HealthLevel.ERROR, f"{text}; not as planned: {names}"
    return (HealthLevel.OK if state == "data_process" else HealthLevel.WARN), text


def _connection_values(connection: WatchedConnection) -> Iterator[tuple[str, str]]:
    result = connection.result
    yield "state", result.state
    yield "MainInstance", result.main
    yield "SubInstance", result.sub
    for key, value in (
        ("connection ID", result.connection_id),
        ("FSoE address", result.address),
        ("FSoE watchdog ms", result.watchdog_ms),
    ):
        yield key, "not known" if value is None else str(value)
    yield "FSoE cycle mean ms", f"{result.fsoe_cycle_ms['mean']:.3f}"
    yield "FSoE cycle longest ms", f"{result.fsoe_cycle_ms['max']:.3f}"
    share = connection.watchdog_share
    yield "longest of watchdog", "not known" if share is None else f"{100 * share:.0f} %"
    yield "resets", str(result.resets)
    yield "last cause", connection.cause
    yield "frames with wrong CRC", str(result.wrong_to_sub + result.wrong_to_main)
    yield "gaps", str(result.gaps)
    yield "cycles with held inputs", str(connection.held_main + connection.held_sub)


def _subdevice(row: SubDeviceSnapshot, *, known: bool) -> HealthStatus:
    text = row.al + (f", AL status code 0x{row.al_code:04x}" if row.al_code else "")
    text += f": {row.detail}" if row.detail else ""
    level = HealthLevel.OK if row.in_op and not row.detail else HealthLevel.ERROR
    if row.in_op and row.detail:
        level = HealthLevel.WARN
    if row.is_absent:
        level, text = HealthLevel.OK, row.found_text
    if not row.known or not known:
        level, text = HealthLevel.STALE, "not known now"
    values = (
        ("alias", str(row.alias)),
        ("position", str(row.position)),
        ("found", row.found_text),
        ("vendor ID", f"0x{row.vendor_id:08x}"),
        ("product code", f"0x{row.product_code:08x}"),
        ("revision", f"0x{row.revision:08x}"),
        ("lost and back", str(row.returns)),
        ("cycles with held inputs", str(row.stale_cycles)),
        ("links lost by port", _by_port(row.link_lost)),
        ("receive errors by port", _by_port(row.rx_errors)),
    )
    return HealthStatus(level=level, name=f"SubDevice {row.name}", message=text, values=values)


def _by_port(counts: tuple[int, ...]) -> str:
    return " ".join(map(str, counts)) or "not counted"


def _bus_values(status: Status) -> Iterator[tuple[str, str]]:
    yield "state", status.state.value
    yield "backend", status.backend
    yield "interface", status.interface
    yield "plan SHA-256", status.plan_sha256
    if status.fingerprint is not None:
        yield "fingerprint", status.fingerprint.short
    yield "bus cycle ms", f"{status.cycle_ns / 1e6:g}"
    yield "SubDevices in OP", f"{status.in_op} of {status.planned}"
    if status.ring is not None:
        yield "ring", f"{status.ring.state} {status.ring.place}".strip()
    if status.clocks is not None:
        yield "distributed clocks", f"{status.clocks.state} {status.clocks.place}".strip()
    for bus in status.buses:
        yield f"bus {bus.name}", f"working counter {bus.actual_wkc} of {bus.expected_wkc}"
    for group in status.groups:
        yield f"group {group.name}", f"{group.state} {group.detail}".strip()


def _cycle_values(row: Statistics) -> list[tuple[str, str]]:
    found = [
        ("working counter", f"{row.actual_wkc} of {row.expected_wkc}"),
        ("cycles", str(row.cycles)),
        ("overruns", str(row.overruns)),
        ("cycles with incomplete working counter", str(row.wkc_errors)),
        ("frames lost", str(row.lost_frames)),
    ]
    for name, times in (("wake-up late", row.latency), ("period", row.period), ("work", row.work)):
        found += _times(name, times)
    return found


def _times(name: str, times: Histogram) -> list[tuple[str, str]]:
    if not times.count:
        return []
    return [
        (f"{name} {part} us", f"{ns / 1e3:.1f}")
        for part, ns in (("median", times.p50_ns), ("99.9 %", times.p999_ns), ("max", times.max_ns))
    ]
