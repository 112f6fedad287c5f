"""The watchdog of a connection and its permitted interval.

    least watchdog      availability: 1.2 x the round trip       ETG.5100 9.3, or as measured
    greatest, printed   the required reaction, by both methods   ETG.5100 9.3 and Beckhoff
    greatest, handshake the same, one late and lost connection   `fsoe_net.timing.handshake`

The smaller of the two maxima counts; an empty interval is an error.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.model.resolve import Connection
from fsoe_net.timing.formulas import (
    RESERVE,
    SignalWay,
    lost_frames_survived,
    round_trip,
    worst_case_input,
    worst_case_output,
)
from fsoe_net.timing.handshake import besides_input, besides_output, besides_shared, shared_ways
from fsoe_net.timing.judgement import WatchdogJudgement, exceeds
from fsoe_net.timing.reaction import FunctionBudget
from fsoe_net.timing.ways import watchdog_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """One bound of a watchdog, ms, and its cause, in words."""

    ms: float
    why: str

    def __str__(self) -> str:
        """Return the bound with its unit: ``38.4 ms``."""
        return f"{self.ms:g} ms"


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchdogBudget:
    """Watchdog of one connection; times in ms.

    Attributes:
        connection: The connection.
        configured: Watchdog in the network file; ``None`` if not stated.
        round_trip: Longest time between two frames without a fault, from the formulas or as
            measured, whichever is longer; ``None`` if times are missing.
        measured: Longest measured round trip; ``None`` without a measurement.
        least: Smallest watchdog that does not expire without a fault.
        printed: Largest watchdog that the required reaction times allow by the formulas of both
            methods; ``None`` without a requirement.
        handshake: The same with the FSoE handshake, if the connection is late by up to its watchdog
            and then lost.
        functions: Safety functions that use it.
        spdus_per_hour: Safety PDUs per hour, both directions.
    """

    connection: Connection
    configured: float | None
    round_trip: float | None = None
    measured: float | None = None
    least: Limit | None = None
    printed: Limit | None = None
    handshake: Limit | None = None
    functions: tuple[str, ...] = ()
    spdus_per_hour: float | None = None
    cycle: float | None = None

    @property
    def name(self) -> str:
        """Name of the connection."""
        return self.connection.name

    @property
    def greatest(self) -> Limit | None:
        """The smaller of both maximum watchdogs; ``None`` without a requirement."""
        return _smallest(self.printed, self.handshake)

    @property
    def empty(self) -> bool:
        """Whether no watchdog is possible at all."""
        return (
            self.least is not None
            and self.greatest is not None
            and exceeds(self.least.ms, self.greatest.ms)
        )

    @property
    def margin(self) -> float | None:
        """Ratio of the configured watchdog to the minimum."""
        if self.configured is None or self.least is None or not self.least.ms:
            return None
        return self.configured / self.least.ms

    @property
    def below_least(self) -> bool:
        """Whether the configured watchdog may expire without a fault."""
        return (
            self.configured is not None
            and self.least is not None
            and exceeds(self.least.ms, self.configured)
        )

    @property
    def judgement(self) -> WatchdogJudgement:
        """The configured watchdog compared with its interval."""
        # An empty interval is checked first, because then no watchdog can be correct.
        if self.empty:
            return WatchdogJudgement.EMPTY
        if self.configured is None:
            return WatchdogJudgement.UNSTATED
        if self.below_least:
            return WatchdogJudgement.BELOW
        if self.greatest is None:
            return WatchdogJudgement.NO_TIMES if self.least is None else WatchdogJudgement.UNLIMITED
        if exceeds(self.configured, self.greatest.ms):
            return WatchdogJudgement.ABOVE
        return WatchdogJudgement.WITHIN

    @property
    def verdict(self) -> str:
        """The judgement in words."""
        return {
            WatchdogJudgement.EMPTY: "no watchdog fits",
            WatchdogJudgement.UNSTATED: "not judged: not stated",
            WatchdogJudgement.NO_TIMES: "not judged: no times",
            WatchdogJudgement.BELOW: "below the least",
            WatchdogJudgement.ABOVE: "above the greatest",
            WatchdogJudgement.UNLIMITED: "not below the least value; no upper limit",
            WatchdogJudgement.WITHIN: "inside the interval",
        }[self.judgement]

    @property
    def lost_frames(self) -> int | None:
        """Consecutive bus cycles that may be lost before the watchdog expires."""
        if self.configured is None or self.round_trip is None or self.cycle is None:
            return None
        return lost_frames_survived(self.configured, self.round_trip, self.cycle)


def connection_budget(
    connection: Connection,
    rows: Sequence[FunctionBudget],
    cycles: tuple[float, ...] | None,
    measured: float | None,
    drift: float,
) -> WatchdogBudget:
    """Calculate the budget of the watchdog of one connection.

    Args:
        connection: The connection.
        rows: All safety functions.
        cycles: Cycle of each bus on its path, ms; ``None`` if one is not stated.
        measured: Longest observed round trip, ms; used if it is longer than the calculated one.
        drift: As in `Budget`.
    """
    least: Limit | None = None
    trip: float | None = None
    printed: Limit | None = None
    handshake: Limit | None = None
    for row, way, side in _uses(connection, rows):
        time = round_trip(way)
        # The slowest function that uses the connection is decisive.
        if trip is None or time > trip:
            why = f"{row.function.name}: 1.2 x {time:g} ms round trip of its {side}"
            trip, least = time, Limit(ms=time * RESERVE, why=why)
        printed = _smallest(printed, _printed(way, row, side, drift))
        handshake = _smallest(handshake, _handshake(way, row, side, drift))
    # A shorter measured time was luck, and does not lower the limit.
    if measured is not None and (trip is None or measured > trip):
        trip = measured
        least = Limit(ms=measured * RESERVE, why=f"1.2 x {measured:g} ms round trip as measured")
    functions = [r.function.name for r in rows if connection.name in _names(r)]
    return WatchdogBudget(
        connection=connection,
        configured=watchdog_of(connection),
        round_trip=trip,
        measured=measured,
        least=least,
        printed=printed,
        handshake=handshake,
        functions=tuple(functions),
        spdus_per_hour=None if cycles is None else _spdus_per_hour(cycles),
        cycle=None if cycles is None else max(cycles),
    )


def _uses(
    connection: Connection, rows: Sequence[FunctionBudget]
) -> Iterator[tuple[FunctionBudget, SignalWay, str]]:
    """Yield each safety function that uses a connection, with its way."""
    for row in rows:
        if row.times is not None:
            for ways, side in ((row.times.inputs, "input"), (row.times.outputs, "output")):
                for way in ways:
                    if way.connection == connection.name:
                        yield row, way, side


def _spdus_per_hour(cycles: tuple[float, ...]) -> float:
    """Return the highest rate of safety PDUs, both directions.

    One FSoE cycle transfers two PDUs. Devices that answer immediately still wait for their own bus:
    each frame needs one cycle of the fetching bus to be fetched, and one to be forwarded.
    """
    return 2 * 3_600_000 / (2 * cycles[0] + 2 * cycles[-1])


def _names(row: FunctionBudget) -> set[str]:
    return {c.name for c in (*row.parts.to_input, *row.parts.to_output)}


def _smallest(*limits: Limit | None) -> Limit | None:
    """Return the smallest limit; of equal ones, the first."""
    known = [limit for limit in limits if limit is not None]
    return min(known, key=lambda limit: limit.ms, default=None)


def _room(row: FunctionBudget, rest: float, what: str, drift: float, *, share: int = 1) -> Limit:
    """Return the time that a required reaction leaves for each of `share` watchdogs."""
    required = row.function.required_reaction_ms or 0.0
    counts = {1: "", 2: ", which counts twice", 3: ", which counts three times"}[share]
    besides = f"{rest:g} ms besides the watchdog{counts}"
    return Limit(
        ms=(required - rest) / share / (1 + drift),
        why=f"{row.function.name}: {required:g} ms required, {besides} ({what})",
    )


def _printed(way: SignalWay, row: FunctionBudget, side: str, drift: float) -> Limit | None:
    """Return the largest watchdog that keeps the required reaction time in both methods."""
    times = row.times
    if row.function.required_reaction_ms is None or times is None:
        return None
    # The limit is the required time minus everything except the watchdog itself.
    rest = worst_case_input(times, 0.0) if side == "input" else worst_case_output(times, 0.0)
    by_etg = _room(row, rest, "ETG.5100", drift)
    others = times.outputs_by_bus if side == "input" else times.inputs_by_bus
    apart = [w for w in others if w.connection != way.connection]
    what = "two watchdogs and actuator, Beckhoff"
    both = None
    if len(apart) < len(others):  # one connection for both ways: its watchdog is also the other one
        both = _room(row, times.actuator, what, drift, share=2)
    # An open watchdog counts as 0, which leaves more than ETG.5100; FunctionBudget reports it.
    other = max((w.watchdog for w in apart), default=0.0)
    by_beckhoff = _room(row, other + times.actuator, what, drift)
    return _smallest(by_etg, both, by_beckhoff)


def _handshake(way: SignalWay, row: FunctionBudget, side: str, drift: float) -> Limit | None:
    """Return the largest watchdog that keeps the required time if this one is late, then lost."""
    times = row.times
    if row.function.required_reaction_ms is None or times is None:
        return None
    rest = besides_input(times, way) if side == "input" else besides_output(times, way)
    one_way = _room(row, rest, "late, then lost; FSoE handshake counted", drift, share=2)
    what = "late both ways, then lost; FSoE handshake counted"
    both = [
        _room(row, besides_shared(times, there, back), what, drift, share=3)
        for there, back in shared_ways(times)
        if there.connection == way.connection
    ]
    return _smallest(one_way, *both)
