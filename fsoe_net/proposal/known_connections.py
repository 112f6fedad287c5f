"""Known connections: from copies, from connections in files, from answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

from fsoe_net.diag.diagnostic import FindingList, Span
from fsoe_net.diag.words import counted
from fsoe_net.model.answers import Answers
from fsoe_net.model.description import DescribedConnection, DescribedCopy, DescribedEnd, Description
from fsoe_net.model.layout import FsoeBlock
from fsoe_net.model.network import ConnectionFacts
from fsoe_net.model.pairing import PairEnd
from fsoe_net.proposal.roles import FrameEnd

_FrameAt = tuple[PairEnd, FsoeBlock]
_VALUES = ("address", "connection_id", "watchdog_ms", "app_parameters")


@dataclass(slots=True, kw_only=True)
class CopyLink:
    """A connection between two pairs of frames, and the source of this fact."""

    main: PairEnd
    sub: PairEnd
    why: str
    facts: DescribedConnection = field(default_factory=DescribedConnection)
    net: str = ""
    unconfirmed: str = ""
    remarks: list[str] = field(default_factory=list)


@dataclass(slots=True, kw_only=True)
class Moves:
    """Data moved by the copies of the files.

    Attributes:
        both: Two pairs whose complete frames are copied in both directions, with both copies.
        rest: All other copies, unchanged.
        touched: Pairs used by the other copies.
    """

    both: list[tuple[PairEnd, PairEnd, DescribedCopy, DescribedCopy]] = field(default_factory=list)
    rest: list[DescribedCopy] = field(default_factory=list)
    touched: set[tuple[int, int]] = field(default_factory=set)

    def join(
        self,
        found: Mapping[tuple[tuple[int, int], ...], DescribedCopy],
        pairs: Mapping[tuple[int, int], PairEnd],
    ) -> None:
        """Add copies from pair to pair; together with the reverse copies they are a connection."""
        for (one, two), copy in found.items():
            back = found.get((two, one))
            if back is None:
                self.rest.append(copy)
                self.touched |= {one, two}
            elif one < two:
                self.both.append((pairs[one], pairs[two], copy, back))


def find_moves(bus: Description, ends: Sequence[FrameEnd]) -> Moves:
    """Find the connections in the copies of a bus, whichever end is the MainInstance."""
    places = _frame_places(ends)
    moves = Moves()
    found: dict[tuple[tuple[int, int], ...], DescribedCopy] = {}  # by both pairs
    pairs: dict[tuple[int, int], PairEnd] = {}
    for copy in bus.copies:
        at = [_place(end) for end in (copy.source, copy.destination)]
        hit = [places[place] for place in at if place in places]
        # A copy of a part of a frame is not a connection.
        whole = [pair for pair, block in hit if 8 * block.frame_bytes == copy.bits]
        pairs.update({pair.key: pair for pair in whole})
        if copy.fsoe is False:
            moves.rest.append(copy)
            continue
        keys = tuple(pair.key for pair in whole)
        # A second copy between the same frames is left to the user.
        if len(keys) != 2 or keys in found:
            moves.rest.append(copy)
            moves.touched |= {pair.key for pair, _ in hit}
        else:
            found[keys] = copy
    moves.join(found, pairs)
    moves.rest.sort(key=bus.copies.index)
    return moves


def _frame_places(ends: Sequence[FrameEnd]) -> dict[tuple[int, int, int], _FrameAt]:
    """Return the frames by SubDevice, sync manager and bit."""
    places = {}
    for end in ends:
        for pair in (*end.pairs, *end.doubtful):
            for block in (pair.written, pair.read):
                places[end.number, block.sm_index, 8 * block.byte_offset] = (pair, block)
    return places


def _place(end: DescribedEnd) -> tuple[int, int, int]:
    return (end.subdevice, end.sm_index, end.bit_offset)


def link_moves(moves: Moves, ends: Sequence[FrameEnd], path: str) -> list[CopyLink]:
    """Return a link for each connection in the copies; those with unknown roles stay copies."""
    links = []
    for one, two, copy, back in moves.both:
        roles = [ends[p.subdevice].role for p in (one, two)]
        if roles == ["sub", "main"]:
            one, two = two, one
        # Roles that contradict the copies: do not guess.
        elif roles != ["main", "sub"]:
            moves.rest += [copy, back]
            moves.touched |= {one.key, two.key}
            continue
        where = copy.span.file or path
        line = f":{copy.span.line}" if copy.span.line else ""
        links.append(
            CopyLink(
                main=one, sub=two, why=f"copied in both directions by {where}{line}", net=copy.name
            )
        )
    return links


def link_connections(
    rows: Sequence[DescribedConnection],
    ends: Sequence[FrameEnd],
    links: list[CopyLink],
    path: str,
    out: FindingList,
) -> tuple[list[str], list[PairEnd]]:
    """Add the facts about connections in files, and return those that do not match.

    Args:
        rows: Connections of the files.
        ends: Pairs of frames with their roles.
        links: Links from copies, which receive the facts; new ones are added.
        path: The file.
        out: Takes FSN159 for facts that do not match.

    Returns:
        The mismatches in words, and the frames concerned, which must not be paired by lengths.
    """
    problems: list[str] = []
    disputed: list[PairEnd] = []
    for row in rows:
        main = row.main
        if row.sub is None:
            continue
        if main is None:
            problems.append(
                f"{_where(row, path)} names a connection of {ends[row.sub].name} and no "
                "MainInstance, of which there is more than one here, or none"
            )
            disputed += ends[row.sub].pairs
            continue
        if ends[main].role != "main":
            continue
        # Copies determine the frames; the connection adds its facts.
        same = next((link for link in links if _is_same(link, main, row)), None)
        if same is not None:
            _take(same, row, path)
            continue
        # The frames are not known yet: another file may contain them.
        bare = next((e for e in (ends[main], ends[row.sub]) if e.is_bare), None)
        if bare is not None:
            problems.append(
                f"{_said(row, main, ends, path)}; FSoE frames of {bare.name} are not known"
            )
            continue
        text = _link_row(row, main, ends, links, path)
        if text:
            problems.append(text)
            # Frames that two files dispute must not be paired by lengths.
            disputed += _in_slot(ends[main].pairs, row.slot)
            disputed += ends[row.sub].pairs
            out.add(
                "FSN159",
                row.span if row.span.file else Span(path),
                text,
                hint="compare the safety project with the process data; then connections: in the "
                "answers",
            )
    return problems, disputed


def _is_same(link: CopyLink, main: int, row: DescribedConnection) -> bool:
    """Whether a file describes this connection."""
    if (link.main.subdevice, link.sub.subdevice) != (main, row.sub):
        return False
    return row.slot in (None, link.main.slot) and _agree(link.facts, row)


def _agree(one: DescribedConnection, two: DescribedConnection) -> bool:
    """Whether two files may describe the same connection: no common fact differs."""
    # Within one file, two rows are two connections, even if all facts are equal.
    if one.span.file and one.span.file == two.span.file:
        return one.span == two.span
    pairs = [(getattr(one, key), getattr(two, key)) for key in _VALUES]
    return all(a == b or a in (None, b"") or b in (None, b"") for a, b in pairs)


def _take(link: CopyLink, row: DescribedConnection, path: str) -> None:
    """Add facts of a file to a link from another file."""
    if not link.facts.span.file:
        link.facts = _marked(row, path)
        return
    given = {
        k: v
        for k in _VALUES
        if getattr(link.facts, k) in (None, b"") and (v := getattr(row, k)) not in (None, b"")
    }
    if given:
        link.facts = replace(link.facts, **given)
        link.why += f"; {_where(row, path)} has its values"


def _marked(row: DescribedConnection, path: str) -> DescribedConnection:
    return row if row.span.file else replace(row, span=row.span._replace(file=path or "?"))


def _where(row: DescribedConnection, path: str) -> str:
    return f"{row.span.file or path}{f':{row.span.line}' if row.span.line else ''}"


def _said(row: DescribedConnection, main: int, ends: Sequence[FrameEnd], path: str) -> str:
    what = f"slot {row.slot} of {ends[main].name}" if row.slot is not None else ends[main].name
    return f"{_where(row, path)} connects {what} with {ends[row.sub or 0].name}"


def _link_row(
    row: DescribedConnection,
    main: int,
    ends: Sequence[FrameEnd],
    links: list[CopyLink],
    path: str,
) -> str:
    assert row.sub is not None  # noqa: S101 - the caller has looked
    used = {p.key for k in links for p in (k.main, k.sub)}
    slots = [p for p in ends[main].pairs if p.key not in used and row.slot in (None, p.slot)]
    free = [p for p in ends[row.sub].pairs if p.key not in used]
    fitting = [(m, s) for m in slots for s in free if m.fits(s)]
    said = _said(row, main, ends, path)
    # A single match is decided; several are a question for the user.
    if len(fitting) == 1:
        links.append(
            CopyLink(
                main=fitting[0][0],
                sub=fitting[0][1],
                why=f"{_where(row, path)} names this connection",
                facts=_marked(row, path),
                net=row.net,
            )
        )
        return ""
    if fitting:
        return f"{said}; {counted(len(fitting), 'pair')} of frames fit"
    return f"{said}; no free frames of equal lengths are there"


def link_answers(
    answers: Answers, ends: Sequence[FrameEnd], links: list[CopyLink], out: FindingList
) -> None:
    """Add the connections of the answers.

    Args:
        answers: Answers with their places.
        ends: Pairs of frames with their roles.
        links: Known links, which answers must not contradict; new ones are added.
        out: Takes FSN155 for unknown names, FSN156 for facts that do not match.
    """
    by_name = {e.name: e for e in ends}
    for row in answers.connections:
        sub = _named(row, "sub", row.sub, by_name, out)
        main = _named(row, "main", row.main, by_name, out) if row.main else None
        if sub is None or (row.main and main is None):
            continue
        if _has_roles(row, main, sub, out):
            mains = [e for e in ends if e.role == "main"] if main is None else [main]
            _link_answer(row, mains, sub, links, out)


def _has_roles(
    row: ConnectionFacts, main: FrameEnd | None, sub: FrameEnd, out: FindingList
) -> bool:
    """Report an end that has the other role."""
    if main is not None and main.role != "main":
        key, text = "main", f"{main.name} is not a MainInstance here"
    elif sub.role != "sub":
        key, text = "sub", f"{sub.name} is not a SubInstance here"
    else:
        return True
    hint = "main: in the answers lists the MainInstances"
    out.add("FSN156", row.at(key), text, hint=hint)
    return False


def _named(
    row: ConnectionFacts, key: str, name: str, ends: dict[str, FrameEnd], out: FindingList
) -> FrameEnd | None:
    end = ends.get(name)
    if end is None:
        known = ", ".join(e.name for e in ends.values() if e.pairs) or "none"
        out.add(
            "FSN155",
            row.at(key),
            f"no SubDevice {name!r} is here",
            hint=f"with FSoE frames there are: {known}",
        )
    return end


def _link_answer(
    row: ConnectionFacts,
    mains: list[FrameEnd],
    sub: FrameEnd,
    links: list[CopyLink],
    out: FindingList,
) -> None:
    subs = _in_slot(sub.pairs, row.sub_slot)
    slots = [p for end in mains for p in _in_slot(end.pairs, row.slot)]
    if not subs:
        _no_slot(row, "sub_slot", [sub], out)
        return
    if not slots:
        _no_slot(row, "slot", mains, out)
        return
    # If a file already connects these frames, it only has to match.
    if _is_linked(row, slots, subs, links, out):
        return
    taken = {pair.key for link in links for pair in (link.main, link.sub)}
    fitting = [(m, s) for m, s in product(slots, subs) if m.fits(s)]
    free = [(m, s) for m, s in fitting if not taken & {m.key, s.key}]
    # One free pair among several could be accidental, unless the answer names a slot.
    if len(free) == 1 and (row.slot is not None or len(fitting) == 1):
        main, pair = free[0]
        links.append(CopyLink(main=main, sub=pair, why=_as_answered(row), facts=_facts(row)))
        return
    _refuse(row, slots, subs, fitting, free, links, out)


def _in_slot(pairs: Sequence[PairEnd], slot: int | None) -> list[PairEnd]:
    return [pair for pair in pairs if slot in (None, pair.slot)]


def _as_answered(row: ConnectionFacts) -> str:
    where = f"{row.span.file}:{row.span.line}" if row.span.line else "your answer"
    return f"as answered, {where}"


def _is_linked(
    row: ConnectionFacts,
    slots: list[PairEnd],
    subs: list[PairEnd],
    links: list[CopyLink],
    out: FindingList,
) -> bool:
    """Whether a file already connects these frames as in the answer; otherwise FSN156."""
    known = [link for link in links if link.sub in subs]
    same = next((link for link in known if link.main in slots), None)
    if same is not None:
        state_facts(same, row, out)
        return True
    if not known or len(subs) > 1:
        return False
    wrong = known[0]
    out.add(
        "FSN156",
        row.at("slot" if row.slot is not None else "main"),
        f"{row.sub} is connected to another slot: slot {wrong.main.slot}, {wrong.why}",
        hint="correct the answer, or the file that states this",
    )
    return True


def _no_slot(row: ConnectionFacts, key: str, ends: Sequence[FrameEnd], out: FindingList) -> None:
    names = " and ".join(f"{e.name} has {_range(e)}" for e in ends) or "no MainInstance is known"
    stated = getattr(row, key)
    what = "a slot" if stated is None else f"{key} {stated}"
    out.add("FSN155", row.at(key), f"{what} is not there", hint=names)


def _refuse(
    row: ConnectionFacts,
    slots: list[PairEnd],
    subs: list[PairEnd],
    fitting: list[tuple[PairEnd, PairEnd]],
    free: list[tuple[PairEnd, PairEnd]],
    links: list[CopyLink],
    out: FindingList,
) -> None:
    key = "slot" if row.slot is not None else "sub"
    if not fitting:
        have = ", ".join(f"{p.lengths[0]}/{p.lengths[1]}" for p in subs)
        want = ", ".join(f"{p.lengths[1]}/{p.lengths[0]}" for p in slots[:6])
        out.add(
            "FSN156",
            row.at(key),
            f"{row.sub} has frames of {have} bytes (to it / from it), the slot takes {want}",
            hint="name another slot",
        )
    elif not free:
        main = fitting[0][0]
        link = next((link for link in links if link.main.key == main.key), None)
        why = f": {link.why}" if link else ""
        out.add("FSN156", row.at(key), f"this slot is given already{why}", hint="name another slot")
    elif row.slot is not None:
        numbers = " or ".join(str(s) for s in sorted({s.slot for _, s in free}))
        ends = sorted({m.subdevice for m, _ in free})
        out.add(
            "FSN156",
            row.span,
            f"slot {row.slot} of which MainInstance?"
            if len(ends) > 1
            else f"which frames of {row.sub} are in slot {row.slot}?",
            hint="add main:" if len(ends) > 1 else f"add sub_slot: {numbers}",
        )
    # Without a slot the row only states facts; the slot remains a question.


def _range(end: FrameEnd) -> str:
    return f"slots 0 to {len(end.pairs) - 1}" if len(end.pairs) > 1 else "slot 0"


def _facts(row: ConnectionFacts) -> DescribedConnection:
    return DescribedConnection(
        span=row.span,
        fields=row.fields,
        address=row.address,
        connection_id=row.connection_id,
        watchdog_ms=row.watchdog_ms,
    )


def state_facts(link: CopyLink, row: ConnectionFacts, out: FindingList) -> None:
    """Add the facts of an answer to a connection.

    Args:
        link: The connection.
        row: The answer.
        out: Takes FSN156 if a file contradicts it.
    """
    values: dict[str, int | None] = {}
    for key in ("address", "connection_id", "watchdog_ms"):
        # An answer adds facts that a file leaves open, and never replaces any silently.
        old, new = getattr(link.facts, key), getattr(row, key)
        values[key] = old if new is None else new
        if new is not None and old is not None and new != old:
            out.add(
                "FSN156",
                row.at(key),
                f"{key} {new} is answered, and {link.facts.span} has {old}",
                hint="correct one of them; the safety project counts",
            )
    link.facts = replace(
        link.facts,
        address=values["address"],
        connection_id=values["connection_id"],
        watchdog_ms=values["watchdog_ms"],
    )
