"""Data that the cyclic thread publishes, as plain values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields

from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.parameters import NOT_OBSERVED, FsoeParameters
from fsoe_net.fsoe.pdu import Command


@dataclass(frozen=True, slots=True, kw_only=True)
class Histogram:
    """Times in nanoseconds; see ``struct fsn_histogram``.

    ``buckets`` contains the smallest time and the count of each non-empty bucket. The width of a
    bucket is at most 1/64 of its smallest time (below 64 ns: 1 ns). Percentiles are the upper end
    of a bucket, never above ``max_ns``.
    """

    count: int
    min_ns: int
    sum_ns: int
    p50_ns: int
    p99_ns: int
    p999_ns: int
    max_ns: int
    buckets: tuple[tuple[int, int], ...]

    @property
    def mean_ns(self) -> int:
        """The mean of all times; 0 if there are none."""
        return self.sum_ns // self.count if self.count else 0

    def to_json(self) -> dict[str, object]:
        """Return the stable JSON form."""
        names = [f.name.replace("sum_ns", "mean_ns") for f in fields(self)]
        return {name: getattr(self, name) for name in names}

    def at_most(self, per_million: int) -> int:
        """Return the time in ns that a share of all times does not exceed, as the core does.

        It is the upper end of the bucket that contains this time, never above ``max_ns``; 0 if
        there are no times.

        Args:
            per_million: The share, such as 999990 for 99.999 %.
        """
        seen = 0
        for floor_ns, times in self.buckets[:-1]:
            seen += times
            if seen * 1_000_000 >= self.count * per_million:
                return min(bucket_end(floor_ns) - 1, self.max_ns)
        return self.max_ns


def bucket_end(floor_ns: int) -> int:
    """Return the end of the bucket with this smallest time in ns: the smallest time of the next.

    The width of a bucket is 1/64 of the power of two below it, and 1 ns below 64 ns.
    """
    return floor_ns + max(1, 1 << floor_ns.bit_length() >> 7)


def bars_of(buckets: Iterable[Sequence[int]]) -> list[tuple[int, int, int]]:
    """Return buckets merged into bars to draw, at most sixteen per factor of two in time.

    Returns:
        For each bar its start and the first time after it, ns, and the number of times in it; only
        non-empty bars.
    """
    bars: dict[int, tuple[int, int, int]] = {}
    for floor_ns, times in buckets:
        wide = max(1, 1 << floor_ns.bit_length() >> 5)
        first = floor_ns // wide * wide
        before = bars[first][2] if first in bars else 0
        bars[first] = (first, first + wide, before + times)
    return list(bars.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """Counters of the cyclic thread; the histograms stay empty in virtual time.

    ``latency``: delay of wake-ups; ``period``: from one cycle to the next; ``work``: from the
        wake-up to the end of sending; ``copy``: the copies alone; ``round_trip``: from sending to
        the last reply, if the bus measures it; ``dc_offset``: distance from the phase of the DC
        clock.
    """

    cycles: int
    overruns: int
    wkc_errors: int
    lost_frames: int
    old_replies: int
    foreign_frames: int
    unsent_frames: int
    send_errno: int
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

    @property
    def histograms(self) -> dict[str, Histogram]:
        """The histograms by name."""
        rows = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: row for name, row in rows.items() if isinstance(row, Histogram)}

    def to_json(self) -> dict[str, object]:
        """Return the stable JSON form."""
        rows = {f.name: getattr(self, f.name) for f in fields(self)}
        return rows | {name: h.to_json() for name, h in self.histograms.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionSnapshot:
    """One direction of a connection; ``interval_*`` is the time between new data frames.

    ``right``, ``wrong`` and ``unchecked`` count frames by their CRCs, see `Verdict`.
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
    interval_last_ns: int
    interval_min_ns: int
    interval_max_ns: int
    interval_sum_ns: int
    intervals: int

    @property
    def has_reset(self) -> bool:
        """Whether a Reset was observed, also that of a start: ``reset_code`` is valid."""
        return self.resets > 0 or self.command == Command.RESET

    @property
    def interval_mean_ns(self) -> int:
        """The mean of all intervals; 0 if there are none."""
        return self.interval_sum_ns // self.intervals if self.intervals else 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionSnapshot:
    """One connection as observed on the bus, with its names of the plan if they are known."""

    name: str = ""
    net: str = ""
    main: str = ""
    sub: str = ""
    state: ConnectionState
    to_sub: DirectionSnapshot
    to_main: DirectionSnapshot
    gaps: int
    """How often the chain was lost and found without a Reset, because frames were not observed."""
    observed: FsoeParameters = NOT_OBSERVED
    """The parameters that the main sent in its last start-up."""
    configured: FsoeParameters = NOT_OBSERVED
    """The parameters of the plan; only from a program that reports them."""
    differs: tuple[str, ...] = ()
    """Names of the parameters that differed from the plan when last observed."""

    @property
    def resets(self) -> int:
        """Resets on the wire since the bus was opened; the first frame of a start is not counted.

        Each Reset is answered by a Reset of the other end, so the larger of the two counts is used.
        """
        return max(self.to_sub.resets, self.to_main.resets)


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """A consistent snapshot of one cycle; connections in plan order."""

    statistics: Statistics
    connections: tuple[ConnectionSnapshot, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoreEvent:
    """A change that the core observed on the wire.

    ``by``: the end that began the reset, ``main`` or ``sub``; empty for other changes. If
    ``before`` equals ``after``, the parameters of the connection have started or stopped to differ
    from the plan: ``differs`` names the differing ones, ``parameters`` are those observed.
    """

    now_ns: int
    connection: int
    before: ConnectionState
    after: ConnectionState
    reset_code: int
    by: str
    differs: tuple[str, ...] = ()
    parameters: FsoeParameters = NOT_OBSERVED


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleImage:
    """The data of one cycle for a recorder: its number, the counters so far, the process image."""

    cycle: int
    now_ns: int
    expected_wkc: int
    actual_wkc: int
    frames: Mapping[str, int]
    """Counts of frames so far, by their names in `Statistics`."""
    image: bytes
