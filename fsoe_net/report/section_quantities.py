"""Block 7: PFH of each element with its sum, what its source claims, rate of safety PDUs."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.document.model import (
    Cell,
    Column,
    Heading,
    Item,
    Level,
    Number,
    Paragraph,
    Part,
    Table,
    Text,
    Verdict,
    cell,
    muted,
    stated,
    strong,
)
from fsoe_net.model.safety import SafetyElement
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.report.model import Point, PointKind, ReportSection
from fsoe_net.report.section_timing import JUDGED, quantity_cell
from fsoe_net.timing.elements import ElementRow
from fsoe_net.timing.pfh import NOT_ASSESSED
from fsoe_net.timing.reaction import FunctionBudget
from fsoe_net.timing.watchdogs import ConnectionBudget

__all__ = ["claim_cell", "level_words", "quantities"]


def quantities(inputs: ReportInputs) -> ReportSection:
    """PFH of every element with the sum, the claim limit, and the rate of safety PDUs."""
    budget = inputs.budget
    points: list[Point] = []
    parts: list[Part] = []
    for row in () if budget is None else budget.functions:
        name = row.function.name
        parts += [Heading(f"PFH of {name}"), _pfh(row), *level_words(row)]
        points += [Point(PointKind.OPEN, f"{name}: no PFH of {w}") for w in row.pfh.missing]
        unclaimed = dict.fromkeys(w for claim in row.levels for w in claim.missing)
        points += [Point(PointKind.OPEN, f"{name}: no PL or SIL claim of {w}") for w in unclaimed]
        if row.pfh.limit is None:
            words = f"{name}: no level (PL or SIL) is required"
            points.append(Point(PointKind.OPEN, words))
    if parts:
        words = f"sums of PFH (in older data sheets PFH_D) only: {NOT_ASSESSED}"
        points.append(Point(PointKind.ASSUMPTION, words))
        points.append(
            Point(
                PointKind.ASSUMPTION,
                "1.00e-09 1/h is charged once per function for Safety over EtherCAT, as Beckhoff's "
                "application guide for TwinSAFE does",
            )
        )
    else:
        parts.append(Paragraph((Text("No safety function is stated: there is no sum of PFH."),)))
        points.append(Point(PointKind.OPEN, "no PFH is summed: no safety function is stated"))
    if budget is not None and budget.connections:
        parts += [Heading("Rate of safety PDUs"), _rates(budget.connections)]
        points.append(
            Point(
                PointKind.ASSUMPTION,
                "residual errors of FSoE are covered by its approval for the rate of safety PDUs "
                "above; they are not worked out here",
            )
        )
    return ReportSection(
        key="quantities", title="Quantities", parts=tuple(parts), points=tuple(points)
    )


def _pfh(row: FunctionBudget) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            cell(e.element.kind.value),
            cell(strong(e.element.name)),
            quantity_cell(e.pfh, "" if e.pfh.value is None else f"{e.pfh.value:.2e}"),
            claim_cell(e),
            cell(e.element.category or muted("not stated")),
            _mission(e.element),
            cell(e.pfh.source or e.element.source or muted("no source")),
        )
        for e in row.parts.rows
    ]
    if row.pfh.fsoe:
        source = "Beckhoff, Application Guide TwinSAFE"
        rows.append(
            (
                cell("bus"),
                cell("Safety over EtherCAT"),
                cell(stated(row.pfh.fsoe, "1/h", source, f"{row.pfh.fsoe:.2e}")),
                *(cell(), cell(), cell()),
                cell(source),
            )
        )
    total = stated(row.pfh.total, "1/h", "sum of the rows above", f"{row.pfh.total:.2e}")
    weakest = tuple(strong(c.lowest) for c in row.levels if c.lowest)
    lowest = cell(*weakest, muted("lowest claim")) if weakest else cell()
    end = (cell(strong("sum")), cell(), (total,), lowest, cell(), cell(), cell())
    rows.append(end)
    return Table(
        name=f"PFH of {row.function.name}",
        columns=(
            Column("Part"),
            Column("Element"),
            Column("PFH", number=True),
            Column("Claim"),
            Column("Category"),
            Column("Mission time", number=True),
            Column("Source"),
        ),
        rows=tuple(rows),
    )


def claim_cell(e: ElementRow) -> Cell:
    """Return PL and SIL that the source of an element claims, and whether anybody answers."""
    if e.has_no_claim:
        return cell(Verdict("not stated", Level.OPEN))
    if not e.claim:
        return cell(muted("needs none"))
    open_claim = [] if e.claim_answered_for else [Verdict("unverified", Level.OPEN)]
    return cell(e.claim, *open_claim)


def _mission(element: SafetyElement) -> Cell:
    years = element.mission_years
    return cell(muted("not stated") if years is None else stated(years, "years", element.source))


def level_words(row: FunctionBudget) -> list[Part]:
    """Say what is required, how sum and claims stand to it, and how long the figures hold."""
    f = row.function
    levels = [w for w in (f"PL {f.pl}" if f.pl else "", f"SIL {f.sil}" if f.sil else "") if w]
    items: list[Item] = [Text(f"Required: {' and '.join(levels) or 'no level stated'}")]
    if row.pfh.limit is not None:
        source = "ISO 13849-1 table 2, IEC 62061 table 3"
        limit = stated(row.pfh.limit, "1/h", source, f"{row.pfh.limit:.0e}")
        items += [Text(", PFH below "), limit]
    items += [Text(". "), Verdict(row.pfh.verdict, JUDGED[row.pfh.judgement]), Text(".")]
    parts: list[Part] = [Paragraph(tuple(items))]
    for claim in row.levels:
        said: list[Item] = [Text("Weakest element: ")]
        said.append(Verdict(claim.verdict, JUDGED[claim.judgement]))
        if claim.sum_words:
            said += [Text("; "), Verdict(claim.sum_words, Level.NOTE)]
        said.append(Text(". A claim is that of a source; no level is judged as reached."))
        parts.append(Paragraph(tuple(said)))
    return [*parts, *_shortest(row)]


def _shortest(row: FunctionBudget) -> list[Part]:
    """Say which element has a shorter mission time than others; nothing where none has."""
    stated_years = [
        (e.element.mission_years, e.element.name)
        for e in row.parts.rows
        if e.element.mission_years is not None
    ]
    years = [value for value, _ in stated_years]
    if not years or min(years) == max(years):
        return []
    least = min(years)
    names = ", ".join(dict.fromkeys(name for value, name in stated_years if value == least))
    words = f" is the shortest mission time, of {names}: its PFH holds no longer."
    number = Number(value=least, text=f"{least:g}", unit="years", source="network file")
    return [Paragraph((number, Text(words)))]


def _rates(rows: Sequence[ConnectionBudget]) -> Table:
    source = "two safety PDUs in four bus cycles"
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
                cell(
                    Number(
                        value=len(rows),
                        text=str(len(rows)),
                        unit="connections",
                        source="network files",
                    )
                ),
            ),
        ),
    )
