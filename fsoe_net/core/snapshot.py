"""What the cyclic thread lets others see, as plain values."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.fsoe import OutsideState

__all__ = [
    "ConnectionSnapshot",
    "CoreEvent",
    "DirectionSnapshot",
    "Glance",
    "Histogram",
    "Snapshot",
    "Statistics",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Histogram:
    """Times in nanoseconds; see ``struct fsn_histogram``.

    ``buckets`` holds, for each bucket that is not empty, its smallest time and how many times fell
    into it; a bucket is at most a quarter of its smallest time wide (below 4 ns: 1 ns). Percentiles
    are the upper end of a bucket, never above ``max_ns``.
    """

    count: int
    min_ns: int
    mean_ns: int
    p50_ns: int
    p99_ns: int
    p999_ns: int
    max_ns: int
    buckets: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """Counters of the cyclic thread; the histograms stay empty in virtual time.

    ``latency``: how late wake-ups came; ``period``: from one cycle to the next; ``work``: from the
    wake-up to the end of sending; ``copy``: the copies alone; ``round_trip``: from sending to the
    last reply, where the bus knows it; ``dc_offset``: distance from the phase of the DC clock.
    """

    cycles: int
    overruns: int
    wkc_errors: int
    lost_frames: int
    old_replies: int
    bytes_copied: int
    now_ns: int
    dc_time_ns: int
    events_lost: int
    expected_wkc: int
    actual_wkc: int
    copies: int
    merged_copies: int
    realtime: bool
    locked: bool
    latency: Histogram
    period: Histogram
    work: Histogram
    copy: Histogram
    round_trip: Histogram
    dc_offset: Histogram


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Glance:
    """What a recorder takes of one cycle: its number, counters so far, and the process image."""

    cycle: int
    now_ns: int
    expected_wkc: int
    actual_wkc: int
    lost_frames: int
    old_replies: int
    image: bytes
