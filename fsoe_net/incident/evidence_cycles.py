"""Facts from the cycles of an incident file: working counters, lost frames, late cycles."""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

from fsoe_net.incident.incident import CycleRecord

_MOST_RUNS = 2_000
_MOST_OLD = 20_000
_WORST = 10
_TIMELINE = 240


@dataclass(slots=True, kw_only=True)
class BadCycles:
    """Consecutive cycles with an error; ``least`` is the smallest working counter."""

    start_ns: int
    end_ns: int
    cycles: int = 1
    least: int = 0
    expected: int = 0

    @property
    def length_ns(self) -> int:
        """Time from the first of them to the next good cycle."""
        return self.end_ns - self.start_ns


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class SlowCycle:
    """A late cycle: ``extra_ns`` more than its period after the previous one."""

    extra_ns: int
    now_ns: int
    cycle: int
    late_ns: int
    work_ns: int
    round_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class BusFacts:
    """Facts about the cycles. Runs are in order of time and bounded; the counts are not.

    ``short``: incomplete working counters; ``lost``: lost frames. ``open_short``: the working
    counter was incomplete to the end of the file. ``missed``: cycles between those of the file.
    ``old``: time and number of replies that came too late. ``foreign_frames``: of another
    MainDevice.
    ``timeline`` are slices: ``(start_ns, cycles, incomplete, lost, most extra ns)``.
    """

    cycles: int
    first_ns: int
    last_ns: int
    cycle_ns: int
    short: tuple[BadCycles, ...]
    open_short: bool
    lost: tuple[BadCycles, ...]
    lost_frames: int
    old_replies: int
    old: tuple[tuple[int, int], ...]
    foreign_frames: int
    late_cycles: int
    missed: int
    worst: tuple[SlowCycle, ...]
    slow: tuple[SlowCycle, ...]
    timeline: tuple[tuple[int, int, int, int, int], ...]

    def short_between(self, start_ns: int, end_ns: int) -> list[BadCycles]:
        """Return the runs of incomplete working counters that overlap a period."""
        return [r for r in self.short if r.end_ns >= start_ns and r.start_ns <= end_ns]

    def lost_between(self, start_ns: int, end_ns: int) -> list[BadCycles]:
        """Return the runs of lost frames that overlap a period."""
        return [r for r in self.lost if r.end_ns >= start_ns and r.start_ns <= end_ns]

    def old_between(self, start_ns: int, end_ns: int) -> int:
        """Return how many replies to earlier cycles arrived in a period."""
        return sum(number for now_ns, number in self.old if start_ns <= now_ns <= end_ns)

    def slow_between(self, start_ns: int, end_ns: int) -> list[SlowCycle]:
        """Return the late cycles of a period."""
        return [s for s in self.slow if start_ns <= s.now_ns <= end_ns]


@dataclass(slots=True)
class BusWatch:
    """Collects `BusFacts` cycle by cycle.

    Args:
        cycle_ns: Bus cycle; 0 if unknown, then no cycle counts as late.
        span_ns: Length of the timeline.
    """

    cycle_ns: int
    span_ns: int = 6_000_000_000
    _cycles: int = 0
    _first_ns: int = 0
    _last: CycleRecord | None = None
    _short: list[BadCycles] = field(default_factory=list)
    _in_short: bool = False
    _lost: list[BadCycles] = field(default_factory=list)
    _lost_frames: int = 0
    _old: int = 0
    _olds: list[tuple[int, int]] = field(default_factory=list)
    _foreign: int = 0
    _late: int = 0
    _missed: int = 0
    _worst: list[SlowCycle] = field(default_factory=list)
    _slow: list[SlowCycle] = field(default_factory=list)
    _slices: list[list[int]] = field(default_factory=list)

    def cycle(self, record: CycleRecord) -> None:
        """Process one cycle."""
        last = self._last
        if last is None:
            self._first_ns = record.now_ns
        else:
            self._missed += record.cycle - last.cycle - 1
        self._cycles += 1
        self._old += record.old
        self._foreign += record.foreign
        if record.old and len(self._olds) < _MOST_OLD:
            self._olds.append((record.now_ns, record.old))
        extra = self._timing(record, last)
        self._wkc(record)
        if record.lost:
            self._lost_frames += record.lost
            self._losses(record, last)
        self._slice(record, extra)
        self._last = record

    def _timing(self, record: CycleRecord, last: CycleRecord | None) -> int:
        """Return the delay of the cycle, relative to its period after the previous one."""
        if last is None or not self.cycle_ns:
            return 0
        passed = record.now_ns - last.now_ns
        # Cycles that were not recorded must not count as delay.
        extra = passed - (record.cycle - last.cycle) * self.cycle_ns
        extra = max(extra, 0)
        slow = SlowCycle(
            extra_ns=extra,
            now_ns=record.now_ns,
            cycle=record.cycle,
            late_ns=record.late_ns,
            work_ns=record.work_ns,
            round_ns=record.round_ns,
        )
        if extra > self.cycle_ns // 2:
            self._late += 1
            # Bounded: a recording of hours may have millions of late cycles.
            if len(self._slow) < _MOST_RUNS:
                self._slow.append(slow)
        # The worst ones are kept even if the list is full.
        if len(self._worst) < _WORST:
            heapq.heappush(self._worst, slow)
        elif slow > self._worst[0]:
            heapq.heapreplace(self._worst, slow)
        return extra

    def _wkc(self, record: CycleRecord) -> None:
        if record.wkc is None:
            if self._in_short and self._short:
                self._short[-1].end_ns = record.now_ns
            self._in_short = False
            return
        expected, actual = record.wkc
        if self._in_short and self._short:
            run = self._short[-1]
            run.end_ns = record.now_ns
            run.cycles += 1
            run.least = min(run.least, actual)
        elif len(self._short) < _MOST_RUNS:
            now = record.now_ns
            self._short.append(BadCycles(start_ns=now, end_ns=now, least=actual, expected=expected))
        self._in_short = True

    def _losses(self, record: CycleRecord, last: CycleRecord | None) -> None:
        run = self._lost[-1] if self._lost else None
        # Losses in consecutive cycles are one burst.
        if run is not None and last is not None and run.end_ns == last.now_ns:
            run.end_ns = record.now_ns
            run.cycles += 1
        elif len(self._lost) < _MOST_RUNS:
            self._lost.append(BadCycles(start_ns=record.now_ns, end_ns=record.now_ns))

    def _slice(self, record: CycleRecord, extra: int) -> None:
        length = max(1, self.span_ns // _TIMELINE)
        # Bounded: a damaged time must not exhaust the memory.
        number = min((record.now_ns - self._first_ns) // length, 2 * _TIMELINE)
        while len(self._slices) <= max(number, 0):
            self._slices.append([self._first_ns + len(self._slices) * length, 0, 0, 0, 0])
        row = self._slices[max(number, 0)]
        row[1] += 1
        row[2] += record.wkc is not None
        row[3] += record.lost
        row[4] = max(row[4], extra)

    def facts(self) -> BusFacts:
        """Return the result."""
        return BusFacts(
            cycles=self._cycles,
            first_ns=self._first_ns,
            last_ns=self._last.now_ns if self._last else 0,
            cycle_ns=self.cycle_ns,
            short=tuple(self._short),
            open_short=self._in_short,
            lost=tuple(self._lost),
            lost_frames=self._lost_frames,
            old_replies=self._old,
            old=tuple(self._olds),
            foreign_frames=self._foreign,
            late_cycles=self._late,
            missed=self._missed,
            worst=tuple(s for s in sorted(self._worst, reverse=True) if s.extra_ns),
            slow=tuple(self._slow),
            timeline=tuple((r[0], r[1], r[2], r[3], r[4]) for r in self._slices),
        )
