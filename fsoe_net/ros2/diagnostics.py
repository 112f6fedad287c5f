"""State of a bus as statuses of ``/diagnostics``: connections, SubDevices, the cycle.

Levels are those of ``diagnostic_msgs/DiagnosticStatus``. Independent of DDS.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from fsoe_net.core.snapshot import Histogram, Statistics
from fsoe_net.live.attachment import BusView, WatchedConnection
from fsoe_net.live.control_values import Status
from fsoe_net.live.health import (
    BusHealth,
    FsoeHealth,
    Health,
    HealthLevel,
    SubDeviceHealth,
    health_texts,
)
from fsoe_net.ros2.values import Joint


class RosLevel(enum.IntEnum):
    """Levels of a status; the numbers are those of the message."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


_LEVELS = {
    HealthLevel.GOOD: RosLevel.OK,
    HealthLevel.UNKNOWN: RosLevel.STALE,
    HealthLevel.WARNING: RosLevel.WARN,
    HealthLevel.ERROR: RosLevel.ERROR,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RosStatus:
    """One status: ``name`` of its subject, ``message`` in words, ``values`` by key."""

    level: RosLevel
    name: str
    message: str
    values: tuple[tuple[str, str], ...] = ()


def joint_status(joints: Sequence[Joint], topic: str, *, yields: bool) -> RosStatus:
    """Return the axes published as joints, and the reasons why others are not.

    Args:
        joints: Axes of the plan.
        topic: Topic on which they are published.
        yields: Whether another node publishes there, so that this one does not.
    """
    raw = [joint.name for joint in joints if joint.is_raw]
    if yields:
        level, message = RosLevel.WARN, f"another node publishes {topic}: not published here"
    elif raw:
        level = RosLevel.WARN
        message = f"raw counts, not in {topic}: {', '.join(raw)}; give the position a factor"
    else:
        level, message = RosLevel.OK, f"published in {topic}"
    return RosStatus(level=level, name="joints", message=message)


def ros_statuses(view: BusView) -> list[RosStatus]:
    """Return the statuses of a view: the bus, then each SubDevice and each connection."""
    health = view.health
    return [
        _bus(view, health.bus),
        *(_subdevice(row) for row in health.subdevices),
        *map(_connection, view.connections, health.connections),
    ]


def _status(
    health: Health, name: str, values: Iterable[tuple[str, str]], message: str
) -> RosStatus:
    return RosStatus(level=_LEVELS[health.level], name=name, message=message, values=tuple(values))


def _bus(view: BusView, health: BusHealth) -> RosStatus:
    values: list[tuple[str, str]] = []
    state = ""
    if view.status is not None:
        state = view.status.state.value
        values += _bus_values(view.status)
    if view.snapshot is not None:
        values += _cycle_values(view.snapshot.cycle.statistics)
    text = "; ".join(health_texts(health))
    return _status(health, "bus", values, text or f"{state}, working counter complete")


def _connection(connection: WatchedConnection, health: FsoeHealth) -> RosStatus:
    parts = [connection.result.state.text, *health_texts(health)]
    if connection.cause and health.level is HealthLevel.ERROR:
        parts.append(f"last Reset: {connection.cause}")
    values = _connection_values(connection)
    return _status(health, f"connection {health.name}", values, "; ".join(parts))


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


def _subdevice(health: SubDeviceHealth) -> RosStatus:
    row = health.seen
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
    text = "; ".join(health_texts(health))
    return _status(health, f"SubDevice {row.name}", values, text or row.al)


def _by_port(counts: tuple[int, ...]) -> str:
    return " ".join(map(str, counts)) or "not counted"


def _bus_values(status: Status) -> Iterator[tuple[str, str]]:
    yield "state", status.state.value
    yield "backend", status.backend
    yield "interface", status.interface
    yield "plan SHA-256", status.plan_sha256
    # Without a plan there is no fingerprint, for example before the first start.
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
