"""The timing budget of a network: each watchdog with its admissible interval, each safety function.

    required reaction   time the risk assessment allows          safety function
    least watchdog      availability: 1.2 x the round trip       each connection, by ETG.5100 9.3
    greatest watchdog   the required reaction, by both schools   each connection

A value that nobody states stays open and is named; what is missing is never taken as zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fsoe_net.model import Connection, Library, Resolution, SafetyFunction
from fsoe_net.timing.elements import FunctionParts, parts_of
from fsoe_net.timing.formulas import (
    RESERVE,
    PartTimes,
    beckhoff_typical,
    beckhoff_worst_case,
    error_free,
    lost_frames_survived,
    round_trip_input,
    round_trip_output,
    worst_case_input,
    worst_case_output,
)
from fsoe_net.timing.handshake import (
    broken_input,
    broken_output,
    disturbed_both,
    polled_error_free,
)
from fsoe_net.timing.judgement import Judgement
from fsoe_net.timing.pfh import PfhSum, sum_pfh

__all__ = [
    "Budget",
    "ConnectionBudget",
    "FunctionBudget",
    "Limit",
    "Reaction",
    "make_budget",
    "with_cycle",
]

COPY_CYCLES = 2  # this core copies in the cycle in which a frame arrived


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """One bound of a watchdog, ms, and what sets it, in words."""

    ms: float
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionBudget:
    """Watchdog of one connection; times in ms.

    Attributes:
        connection: Which.
        configured: Watchdog of the network file; ``None`` when not stated.
        round_trip: Longest time between two frames without a fault, from the formulas or as
            measured, whichever is longer; ``None`` when times are missing.
        measured: Longest round trip that was measured; ``None`` without a measurement.
        least: Smallest watchdog that a healthy connection keeps.
        greatest: Largest one that the required reaction times allow; ``None``: nothing asks.
        margin: Configured over least.
        lost_frames: Bus cycles in a row that may be lost.
        functions: Safety functions that use it.
        spdus_per_hour: Safety PDUs per hour, both directions.
    """

    connection: Connection
    configured: float | None
    round_trip: float | None = None
    measured: float | None = None
    least: Limit | None = None
    greatest: Limit | None = None
    functions: tuple[str, ...] = ()
    spdus_per_hour: float | None = None
    cycle: float | None = None

    @property
    def empty(self) -> bool:
        """Whether no watchdog fits at all."""
        return (
            self.least is not None
            and self.greatest is not None
            and self.greatest.ms < self.least.ms
        )

    @property
    def margin(self) -> float | None:
        """How many times the least watchdog the configured one is."""
        if self.configured is None or self.least is None or not self.least.ms:
            return None
        return self.configured / self.least.ms

    @property
    def lost_frames(self) -> int | None:
        """Bus cycles in a row that may be lost before the watchdog ends."""
        if self.configured is None or self.round_trip is None or self.cycle is None:
            return None
        return lost_frames_survived(self.configured, self.round_trip, self.cycle)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reaction:
    """Response times of a safety function in ms, both schools, with the watchdogs they count.

    ``worst_etg`` is the larger of one failed input connection and one failed output connection;
    ``worst_beckhoff`` counts both watchdogs and the actuator. ``worst`` is the larger of the two.
    Neither school counts the handshake of FSoE (`fsoe_net.timing.handshake`): ``polled`` is the
    response without a fault that does, ``broken`` that with one connection broken for good,
    ``disturbed`` that with both lost and late at will.
    """

    watchdog_in: float | None
    watchdog_out: float | None
    error_free: float
    typical: float
    worst_input: float | None
    worst_output: float | None
    worst_beckhoff: float
    polled: float
    broken: float
    disturbed: float

    @property
    def worst_etg(self) -> float:
        """Longest response with one failure, ETG.5100."""
        failed = [w for w in (self.worst_input, self.worst_output) if w is not None]
        return max([self.error_free, *failed])

    @property
    def counted(self) -> float:
        """Longest response with one failure and the handshake of FSoE counted."""
        return max(self.polled, self.broken)

    @property
    def worst(self) -> float:
        """The larger of both schools."""
        return max(self.worst_etg, self.worst_beckhoff)


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionBudget:
    """One safety function: its parts, its times, its sum of PFH.

    Attributes:
        function: What the network file states.
        parts: Elements with times, and the connections between them.
        times: Times in the formulas; ``None`` while one is missing.
        reaction: With the configured watchdogs; ``None`` while a time or a watchdog is missing.
        unstated: What has to be stated before there is a reaction time, in words.
        pfh: Sum of PFH_D.
    """

    function: SafetyFunction
    parts: FunctionParts
    times: PartTimes | None
    reaction: Reaction | None
    unstated: tuple[str, ...]
    pfh: PfhSum

    @property
    def missing(self) -> tuple[str, ...]:
        """Why there is no reaction time, in words: connections that are not there included."""
        return (*self.unstated, *(a.words for a in self.parts.apart))

    @property
    def judgement(self) -> Judgement:
        """How the reaction time stands to the required one."""
        required, reaction = self.function.required_reaction_ms, self.reaction
        if required is None:
            return Judgement.NONE
        if reaction is None:
            return Judgement.MISSING
        if reaction.worst > required:
            return Judgement.ABOVE
        if reaction.counted > required:
            return Judgement.PRINTED_ONLY
        return Judgement.UNVERIFIED if self.parts.unverified else Judgement.WITHIN

    @property
    def verdict(self) -> str:
        """What is said about the required reaction time, in words."""
        counted = 0.0 if self.reaction is None else self.reaction.counted
        return {
            Judgement.NONE: "no reaction time is required",
            Judgement.MISSING: f"not judged: {'; '.join(self.missing)}",
            Judgement.ABOVE: "above the required reaction time",
            Judgement.PRINTED_ONLY: f"not judged: within by both schools, but {counted:g} ms are "
            "possible with the handshake of FSoE counted",
            Judgement.UNVERIFIED: f"not judged: unverified: {', '.join(self.parts.unverified)}",
            Judgement.WITHIN: "within the required reaction time",
        }[self.judgement]


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """All watchdogs and safety functions of a network.

    Attributes:
        cycle: Bus cycle, ms; ``None`` when the network does not state it.
        copy_cycles: Bus cycles per direction, k.
        drift: Share by which a clock of a device may be slow; watchdogs count that much longer.
        connections: In the order of the resolution.
        functions: In the order of the network file.
    """

    cycle: float | None
    copy_cycles: int
    drift: float
    connections: tuple[ConnectionBudget, ...]
    functions: tuple[FunctionBudget, ...]


def make_budget(
    resolution: Resolution,
    library: Library,
    *,
    cycle: float | None = None,
    copy_cycles: int = COPY_CYCLES,
    drift: float = 0.0,
    measured: Mapping[str, float] | None = None,
) -> Budget:
    """Work out the budget of a network.

    Args:
        resolution: The network.
        library: Device times and PFH where the network states none; they count as unverified.
        cycle: Bus cycle in ms instead of that of the network.
        copy_cycles: Bus cycles that a frame needs per direction: 2 for this core, 3 for a program
            that copies one cycle later.
        drift: Share by which clocks of devices may be slow, such as 0.01.
        measured: Longest FSoE round trip in ms that was seen, by name of the connection. It
            replaces a shorter one of the formulas and never a longer one.
    """
    network = resolution.network
    if cycle is None and network.cycle_ns is not None:
        cycle = network.cycle_ns / 1e6
    rows = [
        _function(f, parts_of(f, resolution, library), resolution, cycle, copy_cycles, drift)
        for f in network.safety_functions
    ]
    connections = tuple(
        _connection(c, rows, cycle, (measured or {}).get(c.name), drift)
        for c in resolution.connections
    )
    return Budget(
        cycle=cycle,
        copy_cycles=copy_cycles,
        drift=drift,
        connections=connections,
        functions=tuple(rows),
    )


# -- safety functions -----------------------------------------------------------------------------


def _function(
    function: SafetyFunction,
    parts: FunctionParts,
    resolution: Resolution,
    cycle: float | None,
    k: int,
    drift: float,
) -> FunctionBudget:
    unstated = list(parts.unstated)
    if cycle is None:
        unstated.append("the bus cycle is not stated")
    times = None
    if cycle is not None and not unstated and not parts.apart:
        times = PartTimes(
            sensor=parts.sensor,
            input=parts.input,
            logic=parts.logic,
            output=parts.output,
            actuator=parts.actuator,
            cycle=cycle,
            cycles_in=k if parts.to_input else 0,
            cycles_out=k if parts.to_output else 0,
        )
    used = (*parts.to_input, *parts.to_output)
    for connection in dict.fromkeys(c.name for c in used if _watchdog(c) is None):
        unstated.append(f"the watchdog of {connection} is not stated")
    reaction = None
    if times is not None and not unstated:
        reaction = _reaction(times, parts, drift)
    return FunctionBudget(
        function=function,
        parts=parts,
        times=times,
        reaction=reaction,
        unstated=tuple(unstated),
        pfh=sum_pfh(function, parts, crosses_bus=bool(used)),
    )


def _watchdog(connection: Connection) -> float | None:
    facts = connection.facts
    return None if facts is None or not facts.watchdog_ms else float(facts.watchdog_ms)


def _longest(connections: Sequence[Connection], drift: float) -> float | None:
    """Return the longest watchdog of connections that work in parallel, on a slow clock."""
    known = [w for w in map(_watchdog, connections) if w is not None]
    return max(known) * (1 + drift) if known else None


def _reaction(times: PartTimes, parts: FunctionParts, drift: float) -> Reaction:
    one, two = _longest(parts.to_input, drift), _longest(parts.to_output, drift)
    return Reaction(
        watchdog_in=one,
        watchdog_out=two,
        error_free=error_free(times),
        typical=beckhoff_typical(times),
        worst_input=None if one is None else worst_case_input(times, one),
        worst_output=None if two is None else worst_case_output(times, two),
        worst_beckhoff=beckhoff_worst_case(one or 0.0, two or 0.0, times.actuator),
        polled=polled_error_free(times),
        broken=_broken(times, one, two),
        disturbed=disturbed_both(times, one or 0.0, two or 0.0),
    )


def _broken(times: PartTimes, one: float | None, two: float | None) -> float:
    """Return the longest response with one connection broken, handshake counted."""
    found = [polled_error_free(times)]
    if one is not None:
        found.append(broken_input(times, one))
    if two is not None:
        found.append(broken_output(times, two))
    return max(found)


def with_cycle(row: FunctionBudget, cycle: float, drift: float) -> Reaction:
    """Return the response times of a judged function at another bus cycle.

    Args:
        row: With times and watchdogs.
        cycle: Bus cycle, ms.
        drift: As in `Budget`.

    Raises:
        ValueError: Its times are not complete.
    """
    if row.times is None or row.reaction is None:
        raise ValueError(f"{row.function.name} has no reaction time")
    return _reaction(replace(row.times, cycle=cycle), row.parts, drift)


# -- connections ----------------------------------------------------------------------------------


def _connection(
    connection: Connection,
    rows: Sequence[FunctionBudget],
    cycle: float | None,
    measured: float | None,
    drift: float,
) -> ConnectionBudget:
    least: Limit | None = None
    trip: float | None = None
    greatest: Limit | None = None
    for row in rows:
        for there, side in ((row.parts.to_input, "input"), (row.parts.to_output, "output")):
            if connection.name not in (c.name for c in there) or row.times is None:
                continue
            time = (round_trip_input if side == "input" else round_trip_output)(row.times)
            if trip is None or time > trip:
                why = f"{row.function.name}: 1.2 x {time:g} ms round trip of its {side}"
                trip, least = time, Limit(ms=time * RESERVE, why=why)
            bound = _greatest(connection, row, side, drift)
            if bound is not None and (greatest is None or bound.ms < greatest.ms):
                greatest = bound
    if measured is not None and (trip is None or measured > trip):
        trip = measured
        least = Limit(ms=measured * RESERVE, why=f"1.2 x {measured:g} ms round trip as measured")
    functions = [r.function.name for r in rows if connection.name in _names(r)]
    return ConnectionBudget(
        connection=connection,
        configured=_watchdog(connection),
        round_trip=trip,
        measured=measured,
        least=least,
        greatest=greatest,
        functions=tuple(functions),
        # Two safety PDUs in four bus cycles, see the reference on residual errors.
        spdus_per_hour=None if cycle is None else 2 * 3_600_000 / (4 * cycle),
        cycle=cycle,
    )


def _names(row: FunctionBudget) -> set[str]:
    return {c.name for c in (*row.parts.to_input, *row.parts.to_output)}


def _greatest(connection: Connection, row: FunctionBudget, side: str, drift: float) -> Limit | None:
    """Return the largest watchdog that keeps the required reaction time in both schools."""
    required, times = row.function.required_reaction_ms, row.times
    if required is None or times is None:
        return None
    name = row.function.name
    rest = worst_case_input(times, 0.0) if side == "input" else worst_case_output(times, 0.0)
    by_etg = Limit(
        ms=(required - rest) / (1 + drift),
        why=f"{name}: {required:g} ms required, {rest:g} ms besides the watchdog (ETG.5100)",
    )
    others = row.parts.to_output if side == "input" else row.parts.to_input
    other = _longest(others, drift)
    if other is None and others:
        return by_etg  # the other watchdog is open; FunctionBudget.missing says so
    rest = (other or 0.0) + times.actuator
    by_beckhoff = Limit(
        ms=(required - rest) / (1 + drift),
        why=f"{name}: {required:g} ms required, {rest:g} ms besides the watchdog (two watchdogs "
        "and actuator, Beckhoff)",
    )
    return min(by_etg, by_beckhoff, key=lambda limit: limit.ms)
