"""FSN602 … FSN616: watchdogs and safety functions compared with the timing budget."""

from __future__ import annotations

from collections.abc import Iterable

from fsoe_net.diag.diagnostic import (
    Diagnostic,
    FindingList,
    Related,
    Severity,
    Span,
    sort_diagnostics,
)
from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.safety import SafetyFunction
from fsoe_net.rules.safe_bits import check_safe_bits
from fsoe_net.timing.budget import Budget
from fsoe_net.timing.claims import most_of_category
from fsoe_net.timing.elements import ElementRow
from fsoe_net.timing.judgement import Judgement, exceeds
from fsoe_net.timing.reaction import FunctionBudget
from fsoe_net.timing.watchdogs import WatchdogBudget

_FOLLOWS = frozenset({"FSN605", "FSN606", "FSN615"})  # a part of a missing function


def check_timing(
    network: NetworkConfig, budget: Budget, *, found: Iterable[Diagnostic] = ()
) -> list[Diagnostic]:
    """Return the findings about the budget of a network, sorted by place.

    Args:
        network: The network with its safety functions; without any the result is empty.
        budget: Budget of this network.
        found: Other findings. A part that an error excludes from the network is not reported again
            as missing from its safety functions.
    """
    out = FindingList()
    if not network.safety_functions:
        return []
    _names(out, network)
    # A function with a misspelt SubDevice cannot be judged; the misspelling is the finding.
    broken = {f.name for f in network.safety_functions if _elements(out, network, f)}
    # If no watchdog fits, a reaction time would not help.
    hopeless = {name for c in budget.connections if c.empty for name in c.functions}
    check_safe_bits(out, budget, broken)
    for row in budget.functions:
        if row.function.name not in broken:
            _function(out, row, hopeless=row.function.name in hopeless)
    for connection in budget.connections:
        _connection(out, connection)
    has_error = any(d.level is Severity.ERROR for d in found)
    hidden = _FOLLOWS if has_error else frozenset[str]()
    # The function with the misspelt name may use the connection that seems to be unused.
    if broken:  # the function with the misspelt name may use the connection
        hidden |= {"FSN610"}
    return sort_diagnostics(d for d in out.diagnostics if d.code not in hidden)


def _names(out: FindingList, network: NetworkConfig) -> None:
    seen: dict[str, SafetyFunction] = {}
    for function in network.safety_functions:
        first = seen.setdefault(function.name, function)
        if first is not function:
            out.add(
                "FSN609",
                function.at("name"),
                f"safety function {function.name!r} is there twice",
                hint="give each its own name",
                related=(Related(span=first.at("name"), message="the first one"),),
            )


def _elements(out: FindingList, network: NetworkConfig, function: SafetyFunction) -> bool:
    """Report elements that are not SubDevices; return whether there is one."""
    names = [s.name for s in network.subdevices]
    wrong = [e for e in function.elements if e.sub and e.sub not in names]
    for element in wrong:
        near = guesses(element.sub, names)
        out.add(
            "FSN605",
            element.at("sub"),
            f"{function.name}: {element.sub} is not a SubDevice of this network",
            hint=f"did you mean {one_of(near)}?" if near else f"SubDevices: {', '.join(names[:8])}",
        )
    return bool(wrong)


def _function(out: FindingList, row: FunctionBudget, *, hopeless: bool) -> None:
    function = row.function
    for apart in row.parts.apart:
        out.add(
            "FSN605",
            function.span,
            f"{function.name}: {apart.words}",
            hint="name the SubDevices that talk to the logic, and state their connections",
        )
    open_points = list(row.unstated)
    # Without a required level, PFH and claims are not needed.
    if row.pfh.limit is not None:
        open_points += [f"the PFH of {name} is not stated" for name in row.pfh.missing]
        unclaimed = dict.fromkeys(name for claim in row.levels for name in claim.missing)
        if unclaimed:
            open_points.append(f"no PL or SIL claim of {', '.join(unclaimed)} is stated")
    # Elements without a connection leave all other facts unknown.
    if open_points and not row.parts.apart:
        out.add(
            "FSN606",
            function.span,
            f"{function.name} cannot be judged: {'; '.join(open_points)}",
            hint="state it with its source; nothing is taken as zero",
        )
    _sources(out, row)
    if not hopeless:
        _reaction(out, row)
    if row.pfh.judgement is Judgement.ABOVE:
        out.add(
            "FSN608",
            function.at("required"),
            f"{function.name}: PFH sum {row.pfh.total:.3g}/h is above the limit "
            f"{row.pfh.limit:.3g}/h",
            hint="the elements with the largest PFH come first",
        )
    _levels(out, row)


def _sources(out: FindingList, row: FunctionBudget) -> None:
    """Report unsupported values: values and claims without a source, 0 without a reason."""
    name = row.function.name
    unverified = [r.element.name for r in row.parts.rows if _is_unverified(r)]
    if unverified:
        out.add(
            "FSN607",
            row.function.span,
            f"{name}: unverified values of {', '.join(dict.fromkeys(unverified))}",
            hint="read the manual and add source: for own values, manual: with its revision for "
            "those of the device library",
        )
    for r in row.parts.rows:
        element = r.element
        for key, quantity in (("time_ms", r.time), ("pfh_per_hour", r.pfh)):
            # A time of 0 is plausible only with a reason.
            if quantity.needs_reason:
                out.add(
                    "FSN612",
                    element.at(key),
                    f"{name}: {key} 0 of {element.name} without a reason",
                    hint="write zero_because: with the reason, or the figure of its manual",
                )
        most = most_of_category(element)
        if most:
            out.add(
                "FSN614",
                element.at("claim"),
                f"{name}: {element.name} claims PL {element.pl} in category {element.category}, "
                f"which reaches PL {most} at most",
                hint="read claim and category in its manual again; the lower level is judged",
            )


def _is_unverified(row: ElementRow) -> bool:
    """Whether a value lacks a source; 0 without a reason is a separate finding."""
    known = [q for q in (row.time, row.pfh) if q.value is not None]
    values = any(not q.answered_for and not q.needs_reason for q in known)
    claims = bool(row.claim) and not row.claim_answered_for
    return values or claims


def _levels(out: FindingList, row: FunctionBudget) -> None:
    for claim in row.levels:
        if claim.judgement is Judgement.ABOVE:
            out.add(
                "FSN613",
                row.function.at("required"),
                f"{row.function.name}: {claim.verdict}",
                hint="a function has at most the level of its weakest element: another element, or "
                "another structure with its own claim; then calculate the reaction time again, and "
                "accept again",
            )


def _reaction(out: FindingList, row: FunctionBudget) -> None:
    function, reaction = row.function, row.reaction
    place = function.at("required_reaction_ms")
    if reaction is None:
        return
    if row.judgement is Judgement.ABOVE:
        method = "ETG.5100" if reaction.worst_etg >= reaction.worst_beckhoff else "Beckhoff"
        required, case = function.required_reaction_ms or 0.0, reaction.decides
        printed = exceeds(reaction.printed, required)
        keeps = "exceeds that, too" if printed else "would keep that"
        out.add(
            "FSN604" if printed else "FSN611",
            place,
            f"{function.name} may take {case.ms:g} ms when {case.words}; {required:g} ms are "
            f"required; {reaction.printed:g} ms, as {method} prints it, {keeps}",
            hint="shorter watchdogs where their interval allows, a shorter bus cycle, faster "
            "parts; `fsoe-net timing` shows what each costs; accept again after a change",
        )


def _use(out: FindingList, row: WatchdogBudget, place: Span) -> None:
    """Report a connection that no function uses; one with safe outputs needs a justification."""
    if row.functions:
        return
    end = row.connection.to_sub.destination
    acts = end.block is None or end.sm is None or end.sm.has_safe_data(end.block)
    out.add(
        "FSN610",
        place,
        f"{row.connection.name} belongs to no safety function",
        hint="name its SubDevices as elements, or "
        + ("justify it when the report is signed" if acts else "leave it as it is"),
        severity=Severity.WARNING if acts else Severity.INFO,
    )


def _connection(out: FindingList, row: WatchdogBudget) -> None:
    facts = row.connection.facts
    name = row.connection.name
    place = facts.at("watchdog_ms") if facts is not None else _place(row)
    if row.empty and row.least is not None and row.greatest is not None:
        hint = "a shorter bus cycle or faster parts; then calculate again, and accept again"
        if row.printed is not None and not exceeds(row.least.ms, row.printed.ms):
            hint += f"; as vendors print it, {row.printed.ms:g} ms would be left"
        out.add(
            "FSN603",
            place,
            f"no watchdog fits {name}: at least {row.least.ms:g} ms ({row.least.why}), at most "
            f"{row.greatest.ms:g} ms ({row.greatest.why})",
            hint=hint,
        )
        return
    _use(out, row, facts.span if facts is not None else place)
    if row.configured is None or row.least is None or not row.below_least:
        return
    breaks = row.round_trip is not None and exceeds(row.round_trip, row.configured)
    out.add(
        "FSN602",
        place,
        f"watchdog {row.configured:g} ms of {name} is below {row.least.ms:g} ms ({row.least.why})",
        hint="it would expire without a fault"
        if breaks
        else "less than the reserve of 20 % is left: it may expire without a fault",
        severity=Severity.ERROR if breaks else Severity.WARNING,
    )


def _place(row: WatchdogBudget) -> Span:
    return row.connection.to_sub.transfer.span
