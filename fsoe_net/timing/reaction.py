"""Response times of a safety function with its watchdogs, and how they stand to what is required.

A value that nobody states stays open and is named; what is missing is never taken as zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fsoe_net.model.resolve import Connection
from fsoe_net.model.safety import SafetyFunction
from fsoe_net.timing.elements import FunctionParts
from fsoe_net.timing.formulas import (
    PartTimes,
    beckhoff_typical,
    beckhoff_worst_case,
    error_free,
    worst_case_input,
    worst_case_output,
)
from fsoe_net.timing.handshake import broken, disturbed_both, polled_error_free
from fsoe_net.timing.judgement import Judgement, exceeds
from fsoe_net.timing.pfh import PfhSum, sum_pfh

__all__ = [
    "FunctionBudget",
    "Reaction",
    "function_budget",
    "longest_watchdog",
    "watchdog_of",
    "with_cycle",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reaction:
    """Response times of a safety function in ms, both methods, with the watchdogs they count.

    ``worst_etg`` is the larger of one failed input connection and one failed output connection;
    ``worst_beckhoff`` counts both watchdogs and the actuator. ``worst`` is the larger of the two.
    Neither method counts the handshake of FSoE (`fsoe_net.timing.handshake`): ``polled`` is the
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
        """The larger of both methods."""
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
        if exceeds(reaction.worst, required):
            return Judgement.ABOVE
        if exceeds(reaction.counted, required):
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
            Judgement.PRINTED_ONLY: f"not judged: within by both methods, but {counted:g} ms are "
            "possible with the handshake of FSoE counted",
            Judgement.UNVERIFIED: f"not judged: unverified: {', '.join(self.parts.unverified)}",
            Judgement.WITHIN: "within the required reaction time",
        }[self.judgement]


def function_budget(
    function: SafetyFunction,
    parts: FunctionParts,
    cycle: float | None,
    k: int,
    drift: float,
) -> FunctionBudget:
    """Work out one safety function.

    Args:
        function: As stated.
        parts: Its elements and connections.
        cycle: Bus cycle, ms; ``None`` when nobody states it.
        k: Bus cycles that a frame needs per direction.
        drift: As in `Budget`.
    """
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
    for connection in dict.fromkeys(c.name for c in used if watchdog_of(c) is None):
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


def watchdog_of(connection: Connection) -> float | None:
    """Return the configured watchdog, ms; ``None`` when it is not stated or 0."""
    facts = connection.facts
    return None if facts is None or not facts.watchdog_ms else float(facts.watchdog_ms)


def longest_watchdog(connections: Sequence[Connection], drift: float) -> float | None:
    """Return the longest watchdog of connections that work in parallel, on a slow clock."""
    known = [w for w in map(watchdog_of, connections) if w is not None]
    return max(known) * (1 + drift) if known else None


def _reaction(times: PartTimes, parts: FunctionParts, drift: float) -> Reaction:
    one, two = longest_watchdog(parts.to_input, drift), longest_watchdog(parts.to_output, drift)
    there, back = one or 0.0, two or 0.0
    return Reaction(
        watchdog_in=one,
        watchdog_out=two,
        error_free=error_free(times),
        typical=beckhoff_typical(times),
        worst_input=None if one is None else worst_case_input(times, one),
        worst_output=None if two is None else worst_case_output(times, two),
        worst_beckhoff=beckhoff_worst_case(there, back, times.actuator),  # mutants: a sum
        polled=polled_error_free(times),
        broken=broken(times, one, two),
        disturbed=disturbed_both(times, there, back),
    )


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
