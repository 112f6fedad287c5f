"""Block 5: the bytes that are copied in every bus cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fsoe_net.diag.words import counted
from fsoe_net.document.model import (
    Cell,
    Column,
    Heading,
    Item,
    Level,
    Paragraph,
    Part,
    Picture,
    Table,
    Text,
    Verdict,
    cell,
    muted,
    number_of,
    stated,
    strong,
)
from fsoe_net.plan.image import IghDomain, igh_image
from fsoe_net.plan.model import NONE, Plan, PlanCopy
from fsoe_net.plan.show import copy_end
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.report.model import ReportSection, assumption, open_point
from fsoe_net.report.svg import copy_picture

_IMAGE = "process image that IgH and fsn-master lay out from the plan"
_PLAN = "copy plan"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Range:
    """Bytes in the image: first byte, end, and the datagrams that contain them."""

    first: int
    end: int
    datagrams: tuple[int, ...]


def copies(inputs: ReportInputs) -> ReportSection:
    """Return every copy with its ends, places in the image and datagrams, with a drawing."""
    title = "Copies"
    plan = inputs.plan
    if plan is None:
        return ReportSection(
            key="copies",
            title=title,
            parts=(Paragraph((Text("No plan can be made: there is no copy table to judge."),)),),
            points=(open_point("there is no copy table"),),
        )
    domain = igh_image(plan)
    moved = sum(c.size_bytes for c in plan.copies)
    parts: list[Part] = [
        Paragraph(
            (
                Text("Every bus cycle "),
                number_of(len(plan.copies), "copy", _PLAN),
                Text(" move "),
                number_of(moved, "byte", _PLAN),
                Text(
                    ", unmodified and in the cycle in which the source arrived. Each copy goes "
                    "from an input to an output, in whole bytes inside one sync manager."
                ),
            )
        ),
        _copy_table(plan, domain),
        Heading("Datagrams"),
        _datagrams(domain),
        Heading("Bytes in the sync managers"),
    ]
    parts += [
        Picture(
            title=f"Copy {n}: {_name(plan, c)}",
            words=f"{_end(plan, c, source=True)} → {_end(plan, c, source=False)}, "
            f"{counted(c.size_bytes, 'byte')}",
            svg=copy_picture(plan, n),
            wide=False,
        )
        for n, c in enumerate(plan.copies)
    ]
    points = (
        assumption(
            "logical addresses and datagrams are those of a MainDevice that registers the entries "
            "in driver order in one domain from address 0, with at most 1486 bytes per datagram; "
            "others lay the image out otherwise, the copied bytes are the same"
        ),
    )
    return ReportSection(key="copies", title=title, parts=tuple(parts), points=points)


def _name(plan: Plan, c: PlanCopy) -> str:
    return "standard data" if c.connection == NONE else plan.connections[c.connection].name


def _end(plan: Plan, c: PlanCopy, *, source: bool) -> str:
    sm, bit = (c.source_sm, c.source_bit) if source else (c.destination_sm, c.destination_bit)
    return copy_end(plan, sm, bit)


def _place(
    bases: Mapping[int, int], domain: IghDomain, c: PlanCopy, *, source: bool
) -> _Range | None:
    sm, bit = (c.source_sm, c.source_bit) if source else (c.destination_sm, c.destination_bit)
    base = bases.get(sm)
    if base is None:
        return None
    first = base + bit // 8
    end = first + c.size_bytes
    held = tuple(
        n
        for n, d in enumerate(domain.datagrams)
        if d.offset_bytes < end and first < d.offset_bytes + d.size_bytes
    )
    return _Range(first=first, end=end, datagrams=held)


def _copy_table(plan: Plan, domain: IghDomain) -> Table:
    rows = []
    taken = _targets(plan)
    bases = {f.sm: f.offset_bytes for f in domain.fmmus}
    for n, c in enumerate(plan.copies):
        ends: list[Cell] = []
        verdicts: list[Item] = []
        for source in (True, False):
            place = _place(bases, domain, c, source=source)
            ends.append((Text(_end(plan, c, source=source)), *_range_items(place)))
            # A copy over two datagrams is not consistent: each datagram has its own working
            # counter.
            if place is not None and len(place.datagrams) != 1:
                verdicts.append(Verdict("straddles datagrams", Level.ERROR))
        verdicts += _verdicts(plan, c, taken)
        rows.append(
            (
                cell(strong(f"{n}"), muted(_name(plan, c))),
                cell(number_of(c.size_bytes, "byte", _PLAN)),
                *ends,
                tuple(verdicts),
            )
        )
    return Table(
        name="copies",
        columns=(
            Column("Copy"),
            Column("Length", number=True),
            Column("From"),
            Column("To"),
            Column("Verdicts"),
        ),
        rows=tuple(rows),
    )


def _range_items(place: _Range | None) -> tuple[Item, ...]:
    if place is None:
        return (Verdict("no place in the image", Level.ERROR),)
    logical = f"logical 0x{place.first:08x} … 0x{place.end - 1:08x}"
    words = ", ".join(str(n) for n in place.datagrams)
    first = place.datagrams[0] if place.datagrams else -1
    return (
        stated(place.first, "", _IMAGE, logical),
        stated(first, "", _IMAGE, f"datagram {words}"),
    )


def _targets(plan: Plan) -> dict[tuple[int, int], int]:
    """Return how many copies write each byte: a map from (sync manager, byte) to the count."""
    taken: dict[tuple[int, int], int] = {}
    for c in plan.copies:
        first = c.destination_bit // 8
        for byte in range(first, first + c.size_bytes):
            key = (c.destination_sm, byte)
            taken[key] = taken.get(key, 0) + 1
    return taken


def _verdicts(plan: Plan, c: PlanCopy, taken: dict[tuple[int, int], int]) -> list[Item]:
    first = c.destination_bit // 8
    found: list[Item] = []
    # Two writers of one byte: the result depends on the order of copies.
    if any(taken[c.destination_sm, b] > 1 for b in range(first, first + c.size_bytes)):
        found.append(Verdict("bytes written twice", Level.ERROR))
    else:
        found.append(Verdict("no overlap", Level.CLEAR))
    ends = (
        _frames(plan, c.source_sm, c.source_bit // 8, c.size_bytes),
        _frames(plan, c.destination_sm, first, c.size_bytes),
    )
    # A copy of standard data that overlaps a frame would alter safety data.
    if c.connection == NONE:
        word = "touches an FSoE frame" if any(ends) else "no FSoE frame touched"
        found.append(Verdict(word, Level.ERROR if any(ends) else Level.CLEAR))
        return found
    # Frames can be recognised only if the device file describes them.
    if not all(ends):
        found.append(Verdict("frame not recognised", Level.OPEN))
    elif ends == ([(c.source_bit // 8, c.size_bytes)], [(first, c.size_bytes)]):
        found.append(Verdict("one whole frame, no gap", Level.CLEAR))
    else:
        found.append(Verdict("not one whole frame", Level.ERROR))
    # A connection with a single direction never leaves Reset.
    pair = plan.connections[c.connection]
    both = len({pair.copy_to_sub, pair.copy_to_main}) == 2
    found.append(
        Verdict("both directions", Level.CLEAR)
        if both
        else Verdict("one direction only", Level.ERROR)
    )
    return found


def _frames(plan: Plan, sm: int, first: int, size: int) -> list[tuple[int, int]]:
    """Return first byte and length of the FSoE frames that overlap a range of a sync manager."""
    return [
        (b.byte_offset, b.frame_bytes)
        for b in plan.blocks
        if b.sm == sm and b.byte_offset < first + size and first < b.byte_offset + b.frame_bytes
    ]


def _datagrams(domain: IghDomain) -> Table:
    rows = tuple(
        (
            cell(strong(str(n))),
            cell(stated(d.offset_bytes, "", _IMAGE, f"0x{d.offset_bytes:08x}")),
            cell(number_of(d.size_bytes, "byte", _IMAGE)),
            cell(stated(d.working_counter, "", _IMAGE)),
        )
        for n, d in enumerate(domain.datagrams)
    )
    return Table(
        name="datagrams",
        columns=(
            Column("Datagram"),
            Column("First logical address", number=True),
            Column("Length", number=True),
            Column("Working counter expected", number=True),
        ),
        rows=rows,
    )
