"""Basis of PFH and claims of elements, and the rate of safety PDUs."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.document.model import (
    Cell,
    Column,
    Heading,
    Level,
    Paragraph,
    Part,
    Table,
    Text,
    Verdict,
    cell,
    muted,
    number_of,
    stated,
    strong,
)
from fsoe_net.model.safety import SafetyElement
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.report.model import Point, ReportSection, assumption, open_point
from fsoe_net.timing.elements import ElementRow
from fsoe_net.timing.pfh import NOT_ASSESSED
from fsoe_net.timing.reaction import FunctionBudget
from fsoe_net.timing.watchdogs import WatchdogBudget


def quantities(inputs: ReportInputs) -> ReportSection:
    """Return the basis of the PFH sums on the pages of safety functions, and the rate of PDUs."""
    budget = inputs.budget
    points: list[Point] = []
    parts: list[Part] = []
    functions = () if budget is None else budget.functions
    for row in functions:
        name = row.function.name
        points += [open_point(f"{name}: no PFH of {w}") for w in row.pfh.missing]
        unclaimed = dict.fromkeys(w for claim in row.levels for w in claim.missing)
        points += [open_point(f"{name}: no PL or SIL claim of {w}") for w in unclaimed]
        # Without a level there is no limit to compare the sum with.
        if row.pfh.limit is None:
            words = f"{name}: no level (PL or SIL) is required"
            points.append(open_point(words))
    if functions:
        words = "PFH and claims of elements, and their sums, are on the page of each function."
        parts.append(Paragraph((Text(words),)))
        words = f"sums of PFH (in older data sheets PFH_D) only: {NOT_ASSESSED}"
        points.append(assumption(words))
        points.append(
            assumption(
                "1.00e-09 1/h is charged once per function for Safety over EtherCAT, as Beckhoff's "
                "application guide for TwinSAFE does"
            )
        )
    else:
        parts.append(Paragraph((Text("No safety function is stated: there is no sum of PFH."),)))
        points.append(open_point("no PFH is summed: no safety function is stated"))
    if budget is not None and budget.connections:
        parts += [Heading("Rate of safety PDUs"), _rates(budget.connections)]
        points.append(
            assumption(
                "residual errors of FSoE are covered by its approval for the rate of safety PDUs "
                "above; they are not worked out here"
            )
        )
    return ReportSection(
        key="quantities", title="Quantities", parts=tuple(parts), points=tuple(points)
    )


def claim_cell(e: ElementRow) -> Cell:
    """Return PL and SIL claimed by the source of an element, and whether a person confirms them."""
    if e.has_no_claim:
        return cell(Verdict("not stated", Level.OPEN))
    if not e.claim:
        return cell(muted("needs none"))
    open_claim = [] if e.claim_answered_for else [Verdict("unverified", Level.OPEN)]
    return cell(e.claim, *open_claim)


def mission_cell(element: SafetyElement) -> Cell:
    """Return the mission time of an element."""
    years = element.mission_years
    if years is None:
        return cell(muted("not stated"))
    return cell(number_of(years, "year", element.source or "no source"))


def shortest_mission(row: FunctionBudget) -> list[Part]:
    """Return a note about the element with the shortest mission time, if they differ."""
    stated_years = [
        (e.element.mission_years, e.element.name)
        for e in row.parts.rows
        if e.element.mission_years is not None
    ]
    years = [value for value, _ in stated_years]
    # All elements have the same mission time: none is a limit.
    if not years or min(years) == max(years):
        return []
    least = min(years)
    names = ", ".join(dict.fromkeys(name for value, name in stated_years if value == least))
    words = f" is the shortest mission time, of {names}: its PFH holds no longer."
    number = number_of(least, "year", "network file", f"{least:g}")
    return [Paragraph((number, Text(words)))]


def _rates(rows: Sequence[WatchdogBudget]) -> Table:
    source = "two safety PDUs in four bus cycles, two of the bus of each end"
    return Table(
        name="safety PDUs",
        columns=(Column("Connection"), Column("Safety PDUs, both directions", number=True)),
        rows=(
            *(
                (
                    cell(strong(c.connection.name)),
                    cell(stated(c.spdus_per_hour, "per hour", source)),
                )
                for c in rows
            ),
            (
                cell(strong("logical connections")),
                cell(number_of(len(rows), "connection", "network files")),
            ),
        ),
    )
