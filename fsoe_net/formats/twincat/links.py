"""Links of a TwinCAT project: copies between SubDevices, and the FSoE connections they carry."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.diag.words import counted
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.xml_tree import Element
from fsoe_net.formats.twincat.box import Box, Message, Range
from fsoe_net.formats.twinsafe.alias_devices import SafetyProject
from fsoe_net.model.bus import Direction
from fsoe_net.model.description import DescribedConnection, DescribedCopy, DescribedEnd

_MOST_FINDINGS = 20
_MOST_SIGNALS = 100
_DEEPEST = 60  # names in a path
_SIGNAL = re.compile(r"Standard (In|Out) Var ([0-9]{1,5})\Z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Links:
    """The variables that the links of a project connect."""

    copies: tuple[DescribedCopy, ...]
    connections: tuple[DescribedConnection, ...]
    notes: Mapping[int, tuple[str, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class _End:
    """One end of a link: the number of the box, or ``None`` if it is not on this ring."""

    box: int | None
    place: Range | None = None
    message: Message | None = None
    text: str = ""


def read_links(
    root: Element, boxes: Sequence[Box], safety: SafetyProject | None, out: Collector
) -> Links:
    """Read the links between SubDevices.

    Args:
        root: The project.
        boxes: SubDevices of one master.
        safety: Alias devices of its safety project.
        out: Takes FSN145 and FSN148 for links that cannot be used.
    """
    return _Links(boxes, safety, out).read(root)


class _Links:
    def __init__(self, boxes: Sequence[Box], safety: SafetyProject | None, out: Collector) -> None:
        self._boxes, self._safety, self._out = boxes, safety, out
        self._by_path = {b.path: n for n, b in enumerate(boxes)}
        self._partners: dict[tuple[int, Message], dict[int, Span]] = {}
        self._findings = 0
        self._away: set[tuple[int, int]] = set()
        self._signals: dict[int, list[str]] = {}

    def read(self, root: Element) -> Links:
        copies = []
        for one, two, span in self._pairs(root):
            copy = self._copy(one, two, span)
            if copy is not None:
                copies.append(copy)
        return Links(
            copies=tuple(copies),
            connections=tuple(self._connections()),
            notes={number: tuple(rows) for number, rows in self._signals.items()},
        )

    def _pairs(self, root: Element) -> Iterator[tuple[_End, _End, Span]]:
        mappings = root.first("Mappings")
        for first in mappings.all("OwnerA") if mappings is not None else ():
            for second in first.all("OwnerB"):
                owners = (first.attributes.get("Name", ""), second.attributes.get("Name", ""))
                if not all(o.startswith("TIID^") for o in owners):
                    self._standard(owners, second)
                    continue
                for link in second.all("Link"):
                    ends = [
                        self._end(f"{owner}^{link.attributes.get(key, '')}")
                        for owner, key in zip(owners, ("VarA", "VarB"), strict=True)
                    ]
                    yield ends[0], ends[1], link.span

    def _standard(self, owners: tuple[str, str], second: Element) -> None:
        """Record the variables of the standard program that are signals of a safety logic."""
        for link in second.all("Link"):
            rows = [
                f"{owner}^{link.attributes.get(key, '')}"
                for owner, key in zip(owners, ("VarA", "VarB"), strict=True)
            ]
            # Either side of the mapping may be the SubDevice.
            for one, two in (rows, rows[::-1]):
                end = self._end(one) if one.startswith("TIID^") else None
                signal = None if end is None else _SIGNAL.search(one)
                if end is None or end.box is None or signal is None:
                    continue
                notes = self._signals.setdefault(end.box, [])
                alias = None if self._safety is None else self._safety.aliases.get(int(signal[2]))
                name = f" ({alias.name[:60]})" if alias is not None else ""
                if len(notes) < _MOST_SIGNALS:
                    notes.append(f"{signal[0]}{name} is linked to {two.rpartition('^')[2][:80]}")

    def _end(self, text: str) -> _End:
        parts = tuple(text.split("^", _DEEPEST)[1:])
        # Boxes can be nested, so the box with the longest path owns the variable.
        for cut in range(len(parts) - 1, 0, -1):
            number = self._by_path.get(parts[:cut])
            if number is not None:
                rest, box = parts[cut:], self._boxes[number]
                message = box.messages.get((rest[0], rest[-1])) if len(rest) == 2 else None
                place = box.find(rest)
                return _End(box=number, place=place, message=message, text=text)
        return _End(box=None, text=text)

    def _copy(self, one: _End, two: _End, span: Span) -> DescribedCopy | None:
        if one.box is None or two.box is None:
            self._leaves_ring(one, two, span)
            return None
        if one.place is None or two.place is None:
            lost = one if one.place is None else two
            self._add("FSN145", span, f"no variable is {_shown(lost)}", "save the project again")
            return None
        # TwinCAT writes the ends of a link in any order; the input is the source.
        source, target = one, two
        if one.place.direction is Direction.OUTPUT:
            source, target = two, one
        assert source.place is not None  # noqa: S101 - both are, see above
        assert target.place is not None  # noqa: S101
        if (source.place.direction, target.place.direction) != (Direction.INPUT, Direction.OUTPUT):
            self._add(
                "FSN145",
                span,
                f"{_shown(one)} and {_shown(two)} have the same direction",
                "save the project again",
            )
            return None
        if source.place.bits != target.place.bits:
            self._add(
                "FSN145",
                span,
                f"{_shown(source)} has {source.place.bits} bits, {_shown(target)} has "
                f"{target.place.bits}",
                "link variables of one length",
            )
            return None
        self._note(source, target, span)
        return DescribedCopy(
            span=span,
            source=_place(source, source.place),
            destination=_place(target, target.place),
            bits=source.place.bits,
            fsoe=True if one.message or two.message else None,
        )

    def _leaves_ring(self, one: _End, two: _End, span: Span) -> None:
        """FSN148, once for each message of the logic that is linked to another ring."""
        away, other = (one, two) if one.message is not None else (two, one)
        if away.message is None or away.box is None:
            return
        key = (away.box, away.message.number)
        if key in self._away:
            return
        self._away.add(key)
        self._add(
            "FSN148",
            span,
            f"Message_{away.message.number} of {self._boxes[away.box].path[-1][:60]} is "
            f"linked to {_shown(other)}, which is not on this ring",
            "its frames leave this ring, so this connection is left out",
        )

    def _note(self, source: _End, target: _End, span: Span) -> None:
        """Record the SubDevice with which a message is exchanged."""
        for end, other in ((source, target), (target, source)):
            if end.message is not None and end.box is not None and other.box is not None:
                self._partners.setdefault((end.box, end.message), {}).setdefault(other.box, span)

    def _add(self, code: str, span: Span, message: str, hint: str) -> None:
        self._findings += 1
        if self._findings <= _MOST_FINDINGS:
            self._out.add(code, span, message, hint=hint, severity=Severity.WARNING)

    def _connections(self) -> Iterator[DescribedConnection]:
        """Yield a connection for each message with one partner, with the facts of its alias."""
        for (logic, message), partners in sorted(
            self._partners.items(), key=lambda row: (row[0][0], row[0][1].slot)
        ):
            other, span = next(iter(partners.items()))
            if len(partners) > 1 or other == logic:
                whom = "itself" if other == logic else counted(len(partners), "SubDevice")
                name = f"Message_{message.number} of {self._boxes[logic].path[-1][:60]}"
                what = f"{name} is linked to {whom}, so this connection is left out"
                self._add("FSN148", span, what, "link both ways of a message to one SubDevice")
                continue
            ends = DescribedConnection(
                span=span,
                name=f"Message_{message.number}",
                main=logic,
                sub=other,
                slot=message.slot,
            )
            alias = None if self._safety is None else self._safety.aliases.get(message.number)
            if alias is None or not self._safety_is_of(logic):
                yield ends
            # The MainInstance is elsewhere and this logic is its SubInstance: the roles change.
            elif alias.is_sub:
                yield replace(ends, main=other, sub=logic, slot=None, sub_slot=message.slot)
            else:
                stated = alias.connection or DescribedConnection(span=alias.span, name=alias.name)
                yield replace(stated, main=logic, sub=other, slot=message.slot)

    def _safety_is_of(self, logic: int) -> bool:
        """Whether the safety project belongs to this logic, or to the only one with messages."""
        if self._safety is not None and self._safety.logic_name:
            return self._boxes[logic].path[-1] == self._safety.logic_name
        return len({box for box, _ in self._partners}) == 1


def _shown(end: _End) -> str:
    text = end.text.removeprefix("TIID^").replace("^", " ^ ")
    return text if len(text) <= 120 else "... " + text[-116:]


def _place(end: _End, place: Range) -> DescribedEnd:
    assert end.box is not None  # noqa: S101 - the caller has looked
    return DescribedEnd(subdevice=end.box, sm_index=place.sm_index, bit_offset=place.bit)
