"""What the cyclic thread lets others see, as plain values."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.fsoe import OutsideState

__all__ = [
    "ConnectionSnapshot",
    "CoreEvent",
    "DirectionSnapshot",
    "Snapshot",
    "Statistics",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """Counters of the cyclic thread; times in nanoseconds.

    Entry ``n`` of ``latency_histogram`` counts wake-ups that came 2^(n-1) to 2^n ns late, entry 0
    those in time, the last one all above. Latencies stay 0 in virtual time.
    """

    cycles: int
    overruns: int
    wkc_errors: int
    bytes_copied: int
    now_ns: int
    latency_max_ns: int
    latency_mean_ns: int
    latency_min_ns: int
    latency_histogram: tuple[int, ...]
    cycle_max_ns: int
    copy_max_ns: int
    events_lost: int
    expected_wkc: int
    actual_wkc: int
    copies: int
    merged_copies: int
    realtime: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionSnapshot:
    """One direction of a connection; ``cycle_*`` is the time between new data frames.

    ``right``, ``wrong`` and ``unchecked`` count frames by their CRCs (`fsoe_net.fsoe.Verdict`).
    """

    command: int
    connection_id: int
    reset_code: int
    frames: int
    process_data: int
    failsafe_data: int
    right: int
    wrong: int
    unchecked: int
    resets: int
    last_new_ns: int
    cycle_last_ns: int
    cycle_min_ns: int
    cycle_mean_ns: int
    cycle_max_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionSnapshot:
    """One connection as seen from outside."""

    state: OutsideState
    to_sub: DirectionSnapshot
    to_main: DirectionSnapshot
    gaps: int
    """Times the chain was lost and found again without a Reset: frames passed unseen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """A consistent picture of one cycle; connections in plan order."""

    statistics: Statistics
    connections: tuple[ConnectionSnapshot, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoreEvent:
    """A change of state the core has seen on the wire.

    ``by``: who began the reset, ``main`` or ``sub``; empty when it is none.
    """

    now_ns: int
    connection: int
    before: OutsideState
    after: OutsideState
    reset_code: int
    by: str
