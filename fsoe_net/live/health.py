"""The health of a bus in one place: reasons with a level for bus, SubDevices and connections.

Every program that shows a bus uses the levels and reasons of this module. A new reason is a member
of `HealthReason`, a line in a rule and a line in `TEXTS`, all in this module.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from fsoe_net.core.bus_documents import BusSnapshot, SubDeviceSnapshot
from fsoe_net.core.snapshot import ConnectionSnapshot, Statistics
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.parameters import SeenParameters, differences
from fsoe_net.live.control_values import BusState, Status
from fsoe_net.timing.formulas import RESERVE

HOLD_S = 5.0
"""How long a Reset or a counted fault stays a reason: longer than the interval of two views."""

WATCHDOG_SHARE_LIMIT = 1 / RESERVE
"""Share of the watchdog (83 %) above which an FSoE cycle uses the reserve over the round trip."""


class HealthLevel(enum.IntEnum):
    """Levels, from best to worst."""

    GOOD = 0
    UNKNOWN = 1
    WARNING = 2
    ERROR = 3


class HealthReason(enum.Enum):
    """Reasons for a level: each has a stable key and its level."""

    def __init__(self, key: str, level: HealthLevel) -> None:
        self.key = key
        self.level = level

    # Of a SubDevice or a connection: the values are outdated.
    NOT_CURRENT = "not_current", HealthLevel.UNKNOWN

    # Of a connection.
    END_ABSENT = "end_absent", HealthLevel.GOOD
    NOT_IN_DATA = "not_in_data", HealthLevel.ERROR
    FAILSAFE_DATA = "failsafe_data", HealthLevel.WARNING
    END_NOT_IN_OP = "end_not_in_op", HealthLevel.ERROR
    RESET = "reset", HealthLevel.ERROR
    OTHER_PARAMETERS = "other_parameters", HealthLevel.ERROR
    WATCHDOG_RESERVE = "watchdog_reserve", HealthLevel.WARNING

    # Of a SubDevice.
    NOT_READ = "not_read", HealthLevel.UNKNOWN
    ABSENT = "absent", HealthLevel.GOOD
    NOT_IN_OP = "not_in_op", HealthLevel.ERROR
    DEFECT = "defect", HealthLevel.WARNING
    RETURNED = "returned", HealthLevel.WARNING
    LINK_LOST = "link_lost", HealthLevel.WARNING
    RECEIVE_ERRORS = "receive_errors", HealthLevel.WARNING

    # Of the bus.
    NOTHING_KNOWN = "nothing_known", HealthLevel.UNKNOWN
    MASTER_GONE = "master_gone", HealthLevel.ERROR
    BUS_FAILED = "bus_failed", HealthLevel.ERROR
    SNAPSHOT_REFUSED = "snapshot_refused", HealthLevel.ERROR
    BUS_STOPPED = "bus_stopped", HealthLevel.WARNING
    WKC_INCOMPLETE = "wkc_incomplete", HealthLevel.ERROR
    RING_OPEN = "ring_open", HealthLevel.WARNING
    CLOCKS_APART = "clocks_apart", HealthLevel.WARNING
    CLOCKS_WITHOUT_REFERENCE = "clocks_without_reference", HealthLevel.WARNING
    GROUP_WRONG = "group_wrong", HealthLevel.ERROR
    LOG_NOT_WRITTEN = "log_not_written", HealthLevel.WARNING
    OVERRUNS = "overruns", HealthLevel.WARNING
    WKC_ERRORS = "wkc_errors", HealthLevel.WARNING
    LOST_FRAMES = "lost_frames", HealthLevel.WARNING


Changes = frozenset[tuple[str, HealthReason]]
"""Counters that increased recently: the name of the subject (empty for the bus), and the reason."""

NO_CHANGES: Changes = frozenset()

_BUS_COUNTERS = (HealthReason.OVERRUNS, HealthReason.WKC_ERRORS, HealthReason.LOST_FRAMES)
_SUBDEVICE_COUNTERS = (
    HealthReason.RETURNED,
    HealthReason.LINK_LOST,
    HealthReason.RECEIVE_ERRORS,
)
_NOT_IN_OPERATION = {
    HealthReason.NOT_CURRENT,
    HealthReason.NOT_IN_DATA,
    HealthReason.END_NOT_IN_OP,
    HealthReason.NOT_IN_OP,
}


class _SeenOnBus(SeenParameters, Protocol):
    """A connection of a snapshot or of a run."""

    @property
    def name(self) -> str: ...
    @property
    def main(self) -> str: ...
    @property
    def sub(self) -> str: ...
    @property
    def state(self) -> ConnectionState: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """The health of one subject.

    Attributes:
        name: Name of the subject; empty for the bus.
        reasons: All reasons that apply.
    """

    name: str
    reasons: tuple[HealthReason, ...]

    @property
    def level(self) -> HealthLevel:
        """The worst level of the reasons; unknown if the values are not current."""
        if HealthReason.NOT_CURRENT in self.reasons:
            return HealthLevel.UNKNOWN
        return max((r.level for r in self.reasons), default=HealthLevel.GOOD)


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeHealth(Health):
    """The health of a connection; ``share`` of the watchdog used by the longest FSoE cycle."""

    seen: _SeenOnBus
    share: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class SubDeviceHealth(Health):
    """The health of a SubDevice."""

    seen: SubDeviceSnapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class BusHealth(Health):
    """The health of the bus and its cycle; ``away`` and ``refused`` as in `bus_health`."""

    status: Status | None
    statistics: Statistics | None
    away: str
    refused: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthReport:
    """The health of the bus and of all its parts; both lists in plan order."""

    bus: BusHealth
    subdevices: tuple[SubDeviceHealth, ...]
    connections: tuple[FsoeHealth, ...]


# -- rules ----------------------------------------------------------------------------------------


def watchdog_share(longest_ms: float, watchdog_ms: int | None) -> float | None:
    """Return the longest FSoE cycle as a share of the watchdog; ``None`` without a watchdog."""
    return longest_ms / watchdog_ms if watchdog_ms else None


def connection_health(
    seen: _SeenOnBus,
    subdevices: Iterable[SubDeviceSnapshot],
    *,
    share: float | None,
    changes: Changes = NO_CHANGES,
    current: bool = True,
) -> FsoeHealth:
    """Return the health of a connection.

    Args:
        seen: The connection.
        subdevices: SubDevices of the bus; empty if the bus does not read their state.
        share: See `watchdog_share`.
        changes: See `RecentChanges`.
        current: Whether the values are current.
    """
    ends = [s for s in subdevices if s.name in (seen.main, seen.sub)]
    reasons = [] if current else [HealthReason.NOT_CURRENT]
    # If one of its SubDevices is absent, a connection cannot be in Data. This is not a fault.
    if any(s.is_absent for s in ends):
        reasons.append(HealthReason.END_ABSENT)
    else:
        reasons += _of_connection(seen, ends, share, changes)
    return FsoeHealth(name=seen.name, reasons=tuple(reasons), seen=seen, share=share)


def _of_connection(
    seen: _SeenOnBus,
    ends: Iterable[SubDeviceSnapshot],
    share: float | None,
    changes: Changes,
) -> Iterator[HealthReason]:
    # All reasons are reported, not only the worst: a reset is often the cause of the others.
    if not seen.state.in_data:
        yield HealthReason.NOT_IN_DATA
    if seen.state is ConnectionState.DATA_FAILSAFE:
        yield HealthReason.FAILSAFE_DATA
    # The state of an end is unknown until it has been read.
    if any(s.known and not s.in_op for s in ends):
        yield HealthReason.END_NOT_IN_OP
    if (seen.name, HealthReason.RESET) in changes:
        yield HealthReason.RESET
    if seen.differs:
        yield HealthReason.OTHER_PARAMETERS
    if share is not None and share > WATCHDOG_SHARE_LIMIT:
        yield HealthReason.WATCHDOG_RESERVE


def snapshot_health(
    seen: ConnectionSnapshot, subdevices: Iterable[SubDeviceSnapshot]
) -> FsoeHealth:
    """Return the health of a connection from a single snapshot."""
    longest_ns = max(seen.to_sub.interval_max_ns, seen.to_main.interval_max_ns)
    share = watchdog_share(longest_ns / 1e6, seen.configured.watchdog_ms)
    return connection_health(seen, subdevices, share=share)


def subdevice_health(
    seen: SubDeviceSnapshot, *, changes: Changes = NO_CHANGES, current: bool = True
) -> SubDeviceHealth:
    """Return the health of a SubDevice; arguments as in `connection_health`."""
    reasons = [] if current else [HealthReason.NOT_CURRENT]
    reasons += _of_subdevice(seen, changes)
    return SubDeviceHealth(name=seen.name, reasons=tuple(reasons), seen=seen)


def _of_subdevice(seen: SubDeviceSnapshot, changes: Changes) -> Iterator[HealthReason]:
    if not seen.known:
        yield HealthReason.NOT_READ
        return
    if seen.is_absent:
        yield HealthReason.ABSENT
    elif not seen.in_op:
        yield HealthReason.NOT_IN_OP
    # A SubDevice on its way to OP also has a detail; then it is progress, not a fault.
    if seen.detail and (seen.in_op or seen.is_absent):
        yield HealthReason.DEFECT
    yield from (r for r in _SUBDEVICE_COUNTERS if (seen.name, r) in changes)


def bus_health(
    status: Status | None,
    statistics: Statistics | None,
    *,
    changes: Changes = NO_CHANGES,
    current: bool = True,
    away: str = "",
    refused: str = "",
) -> BusHealth:
    """Return the health of the bus.

    Args:
        status: Status of ``fsn-master``; ``None`` before its first reply, and for an emulated run,
            which has only statistics.
        statistics: Statistics of the cycle; ``None`` before the first snapshot.
        changes: See `RecentChanges`.
        current: Whether the statistics are current.
        away: Why ``fsn-master`` does not answer; empty while it does.
        refused: Why it returns no snapshot of a running bus.
    """
    reasons: list[HealthReason] = []
    if away:
        reasons.append(HealthReason.MASTER_GONE)
    # Before the cycle: counters of a failed or stopped bus are outdated and would mislead.
    elif status is not None:
        reasons += _of_master(status, current=current, refused=refused)
    elif statistics is None:
        reasons.append(HealthReason.NOTHING_KNOWN)
    if not reasons and statistics is not None:
        reasons += _of_cycle(statistics, changes)
        reasons += _of_parts(status) if status is not None else ()
    # Independent of the state of the bus: an intervention that is not logged must always be
    # visible.
    if not away and status is not None and status.interventions and status.interventions.fault:
        reasons.append(HealthReason.LOG_NOT_WRITTEN)
    return BusHealth(
        name="",
        reasons=tuple(reasons),
        status=status,
        statistics=statistics,
        away=away,
        refused=refused,
    )


def _of_master(status: Status, *, current: bool, refused: str) -> Iterator[HealthReason]:
    if status.fault or status.state is BusState.FAILED:
        yield HealthReason.BUS_FAILED
    elif refused:
        yield HealthReason.SNAPSHOT_REFUSED
    # While the bus runs, missing values are an error; while it is stopped they are expected.
    elif not current and status.state in (BusState.RUNNING, BusState.STARTING):
        yield HealthReason.NOTHING_KNOWN
    elif not current:
        yield HealthReason.BUS_STOPPED


def _of_cycle(now: Statistics, changes: Changes) -> Iterator[HealthReason]:
    if now.actual_wkc != now.expected_wkc:
        yield HealthReason.WKC_INCOMPLETE
    yield from (r for r in _BUS_COUNTERS if ("", r) in changes)


def _of_parts(status: Status) -> Iterator[HealthReason]:
    if status.ring is not None and status.ring.state in ("open", "one way"):
        yield HealthReason.RING_OPEN
    if status.clocks is not None and status.clocks.state == "apart":
        yield HealthReason.CLOCKS_APART
    if status.clocks is not None and status.clocks.state == "no reference":
        yield HealthReason.CLOCKS_WITHOUT_REFERENCE
    if any(group.detail for group in status.groups):
        yield HealthReason.GROUP_WRONG


def in_operation(rows: Iterable[Health]) -> bool:
    """Return whether all connections are in Data and all SubDevices in OP, or may be absent."""
    return not any(_NOT_IN_OPERATION.intersection(row.reasons) for row in rows)


class RecentChanges:
    """Remembers counters, so that a program with long intervals still detects a short fault."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, HealthReason], int] = {}
        self._until: dict[tuple[str, HealthReason], float] = {}

    def take(self, snapshot: BusSnapshot, now_s: float) -> Changes:
        """Return the counters that increased in the last `HOLD_S`; a lower value means a restart.

        Args:
            snapshot: Current counters.
            now_s: Time of a monotonic clock, seconds.
        """
        for key, count in _counters(snapshot):
            # A first value is not an increase: the counters started before this program.
            if count > self._last.get(key, count):
                self._until[key] = now_s + HOLD_S
            self._last[key] = count
        return frozenset(key for key, until in self._until.items() if now_s < until)


def _counters(snapshot: BusSnapshot) -> Iterator[tuple[tuple[str, HealthReason], int]]:
    for reason in _BUS_COUNTERS:
        yield ("", reason), getattr(snapshot.cycle.statistics, reason.key)
    for c in snapshot.cycle.connections:
        yield (c.name, HealthReason.RESET), c.to_sub.resets + c.to_main.resets
    for s in snapshot.subdevices:
        counts = (s.returns, sum(s.link_lost), sum(s.rx_errors))
        for reason, count in zip(_SUBDEVICE_COUNTERS, counts, strict=True):
            yield (s.name, reason), count


# -- texts ----------------------------------------------------------------------------------------


def health_texts(health: Health) -> list[str]:
    """Return the reasons in words, in the same order."""
    return [reason_text(reason, health) for reason in health.reasons]


def reason_text(reason: HealthReason, health: Health) -> str:
    """Return one of the reasons in words."""
    text = TEXTS[reason]
    return text if isinstance(text, str) else text(health)


def _not_in_op(health: SubDeviceHealth) -> str:
    s = health.seen
    state = "no answer" if s.al == "none" else s.al
    code = f", AL status code 0x{s.al_code:04x}" if s.al_code else ""
    return f"{state}{code}: {s.detail or s.found_text or 'its state is unknown'}"


def _bus_failed(health: BusHealth) -> str:
    fault = health.status.fault if health.status is not None else ""
    return f"the bus did not open: {fault}" if fault else "the bus has failed"


def _wrong_groups(health: BusHealth) -> str:
    groups: Sequence[Any] = health.status.groups if health.status is not None else ()
    return ", ".join(f"group {g.name}: {g.detail}" for g in groups if g.detail)


_LATELY = f"in the last {HOLD_S:g} s"

TEXTS: Mapping[HealthReason, str | Callable[[Any], str]] = {
    HealthReason.NOT_CURRENT: "not current, last known values",
    HealthReason.END_ABSENT: "one of its SubDevices is absent, as planned",
    HealthReason.NOT_IN_DATA: "not in Data",
    HealthReason.FAILSAFE_DATA: "not ProcessData in both directions",
    HealthReason.END_NOT_IN_OP: "one of its SubDevices is not in OP",
    HealthReason.RESET: f"Reset {_LATELY}",
    HealthReason.OTHER_PARAMETERS: lambda h: (
        "other parameters: "
        + "; ".join(differences(h.seen.differs, h.seen.configured, h.seen.observed))
    ),
    HealthReason.WATCHDOG_RESERVE: lambda h: f"longest FSoE cycle {h.share:.0%} of the watchdog",
    HealthReason.NOT_READ: "not known now",
    HealthReason.ABSENT: "absent, as it may be",
    HealthReason.NOT_IN_OP: _not_in_op,
    HealthReason.DEFECT: lambda h: str(h.seen.detail),
    HealthReason.RETURNED: f"lost and back {_LATELY}",
    HealthReason.LINK_LOST: f"link lost {_LATELY}",
    HealthReason.RECEIVE_ERRORS: f"receive errors {_LATELY}",
    HealthReason.NOTHING_KNOWN: "nothing is known yet",
    HealthReason.MASTER_GONE: lambda h: f"fsn-master does not answer: {h.away}",
    HealthReason.BUS_FAILED: _bus_failed,
    HealthReason.SNAPSHOT_REFUSED: lambda h: (
        f"the bus is {h.status.state.value}, but its state cannot be read: {h.refused}"
    ),
    HealthReason.BUS_STOPPED: lambda h: f"the bus does not run ({h.status.state.value})",
    HealthReason.WKC_INCOMPLETE: lambda h: (
        f"working counter {h.statistics.actual_wkc} of {h.statistics.expected_wkc}"
    ),
    HealthReason.RING_OPEN: lambda h: str(h.status.ring.text),
    HealthReason.CLOCKS_APART: lambda h: str(h.status.clocks.text),
    HealthReason.CLOCKS_WITHOUT_REFERENCE: lambda h: str(h.status.clocks.text),
    HealthReason.GROUP_WRONG: _wrong_groups,
    HealthReason.LOG_NOT_WRITTEN: lambda h: (
        f"the intervention log is not written: {h.status.interventions.fault}"
    ),
    HealthReason.OVERRUNS: f"late cycles {_LATELY}",
    HealthReason.WKC_ERRORS: f"working counter incomplete {_LATELY}",
    HealthReason.LOST_FRAMES: f"frames lost {_LATELY}",
}
