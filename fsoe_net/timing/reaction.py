"""Response times of a safety function with its watchdogs, compared with the requirements.

A value that is not stated stays open and is reported; a missing value never counts as zero.
"""

from __future__ import annotations

from fsoe_net.dataclass import dataclass
from fsoe_net.model.safety import SafetyFunction
from fsoe_net.timing.claims import LevelClaim, level_claims
from fsoe_net.timing.elements import FunctionParts
from fsoe_net.timing.formulas import (
    PartTimes,
    beckhoff_typical,
    beckhoff_worst_case,
    error_free,
    worst_case_input,
    worst_case_output,
)
from fsoe_net.timing.handshake import (
    broken_input,
    broken_output,
    disturbed_both,
    disturbed_input,
    disturbed_output,
    disturbed_shared,
    polled_error_free,
    shared_ways,
)
from fsoe_net.timing.judgement import Judgement, exceeds
from fsoe_net.timing.pfh import PfhSum, sum_pfh
from fsoe_net.timing.transit import Transit
from fsoe_net.timing.ways import part_times, watchdog_of


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseCase:
    """A case of a response time: one connection late and then lost, no fault, or a printed formula.

    Attributes:
        way: ``input``, ``output``, ``both ways`` of one connection; ``no fault``; ``ETG.5100`` or
            ``Beckhoff``.
        connection: Name of the connection; empty unless one is late.
        ms: Longest response, including the FSoE handshake except for a printed formula.
    """

    way: str
    connection: str = ""
    ms: float

    @property
    def words(self) -> str:
        """The conditions of this response, in words."""
        if self.way == "no fault":
            return "values wait for their turn"
        if not self.connection:
            return f"counted as {self.way} prints it"
        ways = " both ways" if self.way == "both ways" else ""
        return f"{self.connection} is late up to its watchdog{ways} and then lost"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reaction:
    """Response times of a safety function in ms by both methods, with the watchdogs used.

    ``worst_etg`` is the larger of one failed input connection and one failed output connection;
    ``worst_beckhoff`` counts both watchdogs and the actuator. ``printed`` is the larger of the two.
    Neither method includes the FSoE handshake (`fsoe_net.timing.handshake`). The following
    responses do: ``polled`` is without a fault, ``broken`` with one connection broken permanently,
    ``late`` contains the response without a fault and, per way, the longest one with one connection
    late and then lost; ``disturbed`` is with one connection in and one out.
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
    late: tuple[ResponseCase, ...]
    disturbed: float

    @property
    def worst_etg(self) -> float:
        """Longest response with one failure, ETG.5100."""
        failed = [w for w in (self.worst_input, self.worst_output) if w is not None]
        return max([self.error_free, *failed])

    @property
    def decides(self) -> ResponseCase:
        """The longest case, which is judged; a printed one only if a watchdog is too short."""
        etg = ResponseCase(way="ETG.5100", ms=self.worst_etg)
        beckhoff = ResponseCase(way="Beckhoff", ms=self.worst_beckhoff)
        return max((*self.late, etg, beckhoff), key=lambda case: case.ms)

    @property
    def printed(self) -> float:
        """The larger of both methods."""
        return max(self.worst_etg, self.worst_beckhoff)


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionBudget:
    """One safety function: its parts, its times, its sum of PFH.

    Attributes:
        function: The function in the network file.
        parts: Elements with times, and the connections between them.
        times: Times in the formulas; ``None`` if one is missing.
        reaction: Response times with the configured watchdogs; ``None`` if a time or a watchdog is
            missing.
        unstated: Data required for a reaction time, in words.
        pfh: Sum of PFH.
        levels: Claims of its elements, in PL and in SIL as far as required.
    """

    function: SafetyFunction
    parts: FunctionParts
    times: PartTimes | None
    reaction: Reaction | None
    unstated: tuple[str, ...]
    pfh: PfhSum
    levels: tuple[LevelClaim, ...]

    @property
    def missing(self) -> tuple[str, ...]:
        """Why the reaction time is missing, in words, including missing connections."""
        return (*self.unstated, *(a.words for a in self.parts.apart))

    @property
    def judgement(self) -> Judgement:
        """The reaction time compared with the required one."""
        required, reaction = self.function.required_reaction_ms, self.reaction
        if required is None:
            return Judgement.NONE
        if reaction is None:
            return Judgement.MISSING
        if exceeds(reaction.decides.ms, required):
            return Judgement.ABOVE
        return Judgement.UNVERIFIED if self.parts.unverified else Judgement.WITHIN

    @property
    def verdict(self) -> str:
        """Statement about the required reaction time, in words, with the deciding case."""
        at_most = ""
        if self.reaction is not None:
            case = self.reaction.decides
            at_most = f"{case.ms:g} ms when {case.words}"
        return {
            Judgement.NONE: "no reaction time is required",
            Judgement.MISSING: f"not judged: {'; '.join(self.missing)}",
            Judgement.ABOVE: f"above the required reaction time: {at_most}",
            Judgement.UNVERIFIED: f"not judged: unverified: {', '.join(self.parts.unverified)}",
            Judgement.WITHIN: f"within the required reaction time: at most {at_most}",
        }[self.judgement]


def function_budget(
    function: SafetyFunction,
    parts: FunctionParts,
    bus: Transit,
    drift: float,
) -> FunctionBudget:
    """Calculate the budget of one safety function.

    Args:
        function: The safety function.
        parts: Its elements and connections.
        bus: Bus cycles, and the number of cycles that a frame needs.
        drift: As in `Budget`.
    """
    unstated = list(parts.unstated)
    used = (*parts.to_input, *parts.to_output)
    times = part_times(parts, bus, drift)
    if times is None:
        unstated.append("the bus cycle is not stated")
    # Some of the times would give a reaction time that looks complete.
    if unstated or parts.apart:
        times = None
    # Reported after all others: without a watchdog only the time is unknown, not the sum of PFH.
    for connection in dict.fromkeys(c.name for c in used if watchdog_of(c) is None):
        unstated.append(f"the watchdog of {connection} is not stated")
    reaction = None if times is None or unstated else reaction_of(times)
    pfh = sum_pfh(function, parts, crosses_bus=bool(used))
    return FunctionBudget(
        function=function,
        parts=parts,
        times=times,
        reaction=reaction,
        unstated=tuple(unstated),
        pfh=pfh,
        levels=level_claims(function, parts, pfh),
    )


def _late(t: PartTimes) -> list[ResponseCase]:
    """Return the responses without a fault, and with one connection late and lost, for each way."""
    late = {
        "input": [(w, disturbed_input(t, w)) for w in t.inputs_by_bus],
        "output": [(w, disturbed_output(t, w)) for w in t.outputs_by_bus],
        "both ways": [(w, disturbed_shared(t, w, back)) for w, back in shared_ways(t)],
    }
    # The longest case of each way, because a function reacts to any of them.
    longest = {way: max(cases, key=lambda case: case[1]) for way, cases in late.items() if cases}
    return [
        ResponseCase(way="no fault", ms=polled_error_free(t)),
        *(
            ResponseCase(way=way, connection=w.connection, ms=ms)
            for way, (w, ms) in longest.items()
        ),
    ]


def reaction_of(t: PartTimes) -> Reaction:
    """Return the response times of a safety function.

    Args:
        t: Times of the function, with every watchdog.
    """
    one = max((w.watchdog for w in t.inputs_by_bus), default=None)
    two = max((w.watchdog for w in t.outputs_by_bus), default=None)
    broken = [
        *(broken_input(t, w) for w in t.inputs_by_bus),
        *(broken_output(t, w) for w in t.outputs_by_bus),
    ]
    return Reaction(
        watchdog_in=one,
        watchdog_out=two,
        error_free=error_free(t),
        typical=beckhoff_typical(t),
        worst_input=None if one is None else worst_case_input(t, one),
        worst_output=None if two is None else worst_case_output(t, two),
        worst_beckhoff=beckhoff_worst_case(one or 0.0, two or 0.0, t.actuator),  # mutants: a sum
        polled=polled_error_free(t),
        broken=max([polled_error_free(t), *broken]),
        late=tuple(_late(t)),
        disturbed=disturbed_both(t),
    )
