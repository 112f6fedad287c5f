"""A network proposed from the available files, with open points and questions.

Pairs are determined by copies and connections in the files, then by answers, then by lengths if
only one choice remains. The rest is proposed as unconfirmed, or not at all. No question is
repeated: the caller adds an answer and creates a new proposal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fsoe_net.diag.diagnostic import Diagnostic, FindingList
from fsoe_net.diag.words import noun
from fsoe_net.model.answers import AnsweredWord, Answers, Ask, Question
from fsoe_net.model.description import (
    DescribedConnection,
    DescribedCopy,
    DescribedEnd,
    DescribedSubDevice,
    Description,
)
from fsoe_net.model.joined_descriptions import has_layout
from fsoe_net.model.layout import FsoeBlock
from fsoe_net.model.library import Library
from fsoe_net.model.library_fill import fill_from_library, library_device
from fsoe_net.model.pairing import OpenPair, PairEnd, pair_by_lengths
from fsoe_net.proposal.known_connections import (
    CopyLink,
    find_moves,
    link_answers,
    link_connections,
    link_moves,
    state_facts,
)
from fsoe_net.proposal.roles import FrameEnd, find_ends, give_roles, where_is


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """A network to be written.

    Attributes:
        bus: SubDevices with their names, remaining copies, connections to write.
        mains: Numbers of the MainInstances.
        sources: Source of library process data, by number of the SubDevice.
        remarks: Other remarks about a SubDevice, by its number.
        unconnected: Why frames of a SubDevice are not connected, by its number.
        notes: Notes of the device library about its type, by number of the SubDevice.
        reasons: Source of each connection of ``bus``, first line first.
        open: Remaining tasks of a person, in words.
        open_devices: The items of ``open`` about a single SubDevice, without its name.
        questions: Open questions, in the order to ask them.
        findings: Invalid answers.
    """

    bus: Description
    mains: tuple[int, ...]
    sources: Mapping[int, tuple[str, ...]]
    remarks: Mapping[int, tuple[str, ...]]
    unconnected: Mapping[int, tuple[str, ...]]
    notes: Mapping[int, tuple[str, ...]]
    reasons: tuple[tuple[str, ...], ...]
    open: tuple[str, ...]
    open_devices: tuple[str, ...]
    questions: tuple[Question, ...]
    findings: tuple[Diagnostic, ...]


def propose(
    bus: Description,
    names: Sequence[str],
    library: Library,
    answers: Answers,
    hints: Sequence[tuple[frozenset[int], str]] = (),
) -> Proposal:
    """Propose a network.

    Args:
        bus: Data of the files, joined.
        names: Unique name for each SubDevice.
        library: Provides roles, and process data missing in files.
        answers: Answers of the user.
        hints: Facts about connections that may belong to any of these SubDevices.
    """
    return _Maker(bus, names, library, answers, hints).proposal()


class _Maker:
    def __init__(
        self,
        bus: Description,
        names: Sequence[str],
        library: Library,
        answers: Answers,
        hints: Sequence[tuple[frozenset[int], str]],
    ) -> None:
        self._names, self._library, self._answers = tuple(names), library, answers
        self._hints = hints
        self._out = FindingList()
        self._open: list[str] = []  # of connections, after those of devices
        self._devices: list[str] = []  # open points of devices
        self._about: list[str] = []  # the same without names
        self._questions: list[Question] = []
        self._sources: dict[int, tuple[str, ...]] = {}
        self._remarks: dict[int, list[str]] = {n: [] for n in range(len(bus.subdevices))}
        self._check_names()
        self._bus = replace(bus, subdevices=tuple(self._filled(bus.subdevices)))
        self._links: list[CopyLink] = []

    def _check_names(self) -> None:
        known = ", ".join(self._names) or "none"
        words = [*(self._answers.main or ())]
        for table in (self._answers.process_data, self._answers.frames):
            words += [replace(word, text=name) for name, word in table.items()]
        for word in words:
            if word.text not in self._names:
                self._out.add(
                    "FSN155",
                    word.span,
                    f"no SubDevice {word.text!r} is here",
                    hint=f"there are: {known}",
                )

    def _filled(self, subdevices: Sequence[DescribedSubDevice]) -> list[DescribedSubDevice]:
        rows = []
        for number, (sub, name) in enumerate(zip(subdevices, self._names, strict=True)):
            fill = fill_from_library(sub, name, self._library, self._answers)
            self._sources[number] = fill.sources
            self._remarks[number] += fill.remarks
            self._ask(fill.question)
            answer = self._answers.process_data.get(name)
            if answer is not None:
                filled = has_layout(fill.sub.device) and not has_layout(sub.device)
                self._check_process_data(sub, answer, fill.wrong, filled=filled)
            # Without an identity the device cannot be checked at the start.
            if not fill.sub.device.product_code:
                what = "vendor and product are not known"
                self._remarks[number].append(
                    f"TODO {what}: no file states them, put them into its config"
                )
                self._open_device(name, what)
            if fill.question is not None:
                words = ", ".join(word for word, _ in fill.question.choices)
                self._open_device(name, f"which process data? {words}")
            elif not has_layout(fill.sub.device) and library_device(sub, self._library):
                text = "an FSoE device, and no file has its process data"
                self._open_device(name, text)
            rows.append(fill.sub)
        return rows

    def _open_device(self, name: str, text: str) -> None:
        self._devices.append(f"{name}: {text}")
        self._about.append(text)

    def _check_process_data(
        self, sub: DescribedSubDevice, answer: AnsweredWord, wrong: tuple[str, ...], *, filled: bool
    ) -> None:
        if wrong:
            self._out.add(
                "FSN155",
                answer.at("value"),
                f"the device library has no process data {answer.text!r} for this device",
                hint=f"it has: {', '.join(wrong)}",
            )
        elif not filled:
            known = has_layout(sub.device)
            self._out.add(
                "FSN156",
                answer.span,
                "its process data are in a file already"
                if known
                else "this device is not in the device library",
                hint="delete this answer" if known else "give its ESI or the output of ethercat",
            )

    def _ask(self, question: Question | None) -> None:
        if question is not None and question.key not in self._answers.passed:
            self._questions.append(question)

    def proposal(self) -> Proposal:
        """Return the result."""
        subs = self._bus.subdevices
        ends = find_ends(subs, self._names, self._answers)
        moves = find_moves(self._bus, ends)
        for end in ends:
            # Frames that files copy in both directions are FSoE, whatever their structure.
            end.accept({p.key for row in moves.both for p in row[:2]})
            self._ask(end.question)
            for guess in end.likely:
                what = f"likely FSoE frame, not taken: {where_is(guess.block)}"
                end.remarks += [what, *(f"  doubt: {d}" for d in guess.doubts)]
                self._open_device(end.name, what)
        question = give_roles(ends, subs, self._library, self._answers, self._told(moves.both))
        self._check_mains(ends)
        self._ask(question)
        if question is not None:
            who = ", ".join(n for n, _ in question.choices)
            self._open.append(f"MainInstance or SubInstance: {who}")
        self._links = link_moves(moves, ends, self._bus.path)
        # In order of trust: copies, connections in files, answers, then lengths.
        problems, disputed = link_connections(
            self._connections(ends), ends, self._links, self._bus.path, self._out
        )
        self._open += problems
        link_answers(self._answers, ends, self._links, self._out)
        self._by_lengths(ends, moves.touched, disputed)
        return self._made(ends, moves.rest)

    def _told(self, both: Sequence[tuple[PairEnd, PairEnd, object, object]]) -> dict[int, str]:
        """Return the roles implied by connections: an end connected to several others is a main."""
        known: dict[int, str] = {}
        for row in self._bus.connections:
            for number, role in ((row.main, "main"), (row.sub, "sub")):
                if number is not None:
                    known.setdefault(number, role)
        partners: dict[int, set[int]] = {}
        for one, two, *_ in both:
            partners.setdefault(one.subdevice, set()).add(two.subdevice)
            partners.setdefault(two.subdevice, set()).add(one.subdevice)
        for number, others in partners.items():
            # An end with several partners is the MainInstance, as a SubInstance has one in most
            # networks.
            if len(others) > 1 and not any(len(partners[o]) > 1 for o in others):
                known.setdefault(number, "main")
        for number, others in partners.items():
            if any(known.get(o) == "main" for o in others):
                known.setdefault(number, "sub")
        return known

    def _check_mains(self, ends: list[FrameEnd]) -> None:
        by_name = {e.name: e for e in ends}
        for word in self._answers.main or ():
            end = by_name.get(word.text)
            if end is not None and not end.pairs and not end.doubtful:
                self._out.add(
                    "FSN156",
                    word.span,
                    f"{word.text} has no pair of FSoE frames, so it is not a MainInstance",
                    hint="name another SubDevice, or give a file with its process data",
                )
        if self._answers.main is None:
            return
        chosen = {w.text for w in self._answers.main}
        for row in self._bus.connections:
            if row.main is not None and self._names[row.main] not in chosen:
                self._out.add(
                    "FSN156",
                    self._answers.at("main"),
                    f"{self._names[row.main]} is not among them, and {row.span or self._bus.path} "
                    "names it as a MainInstance",
                    hint="add it, or correct that file",
                )
                return

    def _connections(self, ends: list[FrameEnd]) -> list[DescribedConnection]:
        """Return the connections of the files; if one names no MainInstance, use the only one."""
        mains = [e.number for e in ends if e.role == "main"]
        return [
            replace(c, main=mains[0]) if c.main is None and len(mains) == 1 else c
            for c in self._bus.connections
        ]

    def _by_lengths(
        self, ends: list[FrameEnd], touched: set[tuple[int, int]], disputed: list[PairEnd]
    ) -> None:
        used = touched | {p.key for k in self._links for p in (k.main, k.sub)}
        free: dict[str, list[PairEnd]] = {"main": [], "sub": [], "": []}  # by role
        for end in ends:
            free[end.role] += [p for p in end.pairs if p.key not in used]
        # Undecided ends could still take part, so nothing with their lengths is decided.
        doubtful = [*free[""], *(p for e in ends for p in e.doubtful), *disputed]
        pairing = pair_by_lengths(free["main"], free["sub"], doubtful)
        for main, sub in pairing.settled:
            why = f"settled by lengths: {_bytes(sub)} occur only once on each side"
            self._add(CopyLink(main=main, sub=sub, why=why), ends)
        for row in pairing.open:
            self._open_pair(row, ends, has_main=any(e.role == "main" for e in ends))

    def _add(self, link: CopyLink, ends: list[FrameEnd]) -> None:
        self._links.append(link)
        several = len(ends[link.sub.subdevice].pairs) > 1
        # An answer without a slot applies to the only connection of this SubInstance.
        for row in self._answers.connections:
            same = row.sub == self._names[link.sub.subdevice]
            if same and row.slot is None and (not several or row.sub_slot == link.sub.slot):
                state_facts(link, row, self._out)

    def _facts_of(self, subdevice: int) -> list[str]:
        """Return the answers about a SubInstance that has no connection to store them."""
        facts = [
            f"{key} {value}"
            for row in self._answers.connections
            if row.sub == self._names[subdevice] and row.slot is None
            for key in ("address", "connection_id", "watchdog_ms")
            if (value := getattr(row, key)) is not None
        ]
        return [f"answered: {', '.join(facts)}"] if facts else []

    def _open_pair(self, row: OpenPair, ends: list[FrameEnd], *, has_main: bool) -> None:
        sub = row.sub
        end = ends[sub.subdevice]
        name = end.name if len(end.pairs) == 1 else f"{end.name}, frames {sub.slot}"
        if not row.candidates:
            why = (
                f"no free slot of a MainInstance has {_bytes(sub)}"
                if has_main
                else "no MainInstance is known"
            )
            self._open.append(f"{name}: not connected: {why}")
            end.unconnected += [f"not connected: {why}", *self._facts_of(sub.subdevice)]
            return
        slots = self._slots(row.candidates)
        rivals = ", ".join(dict.fromkeys(self._names[r.subdevice] for r in row.rivals))
        facts = [f"All have {_bytes(sub)}: {slots}" + (f"; so have {rivals}" if rivals else "")]
        facts += [text for numbers, text in self._hints if sub.subdevice in numbers]
        self._ask(
            Question(
                ask=Ask.CONNECTIONS,
                subject=end.name,
                sub_slot=None if len(end.pairs) == 1 else sub.slot,
                span=self._bus.subdevices[sub.subdevice].span,
                text=f"Which slot does {name} belong to?",
                facts=tuple(facts),
                choices=tuple((f"{self._names[c.subdevice]} {c.slot}", "") for c in row.candidates),
            )
        )
        self._open.append(f"{name}: which slot? {slots}")
        # More SubInstances than slots: connecting some would be a guess.
        if row.proposed is None:
            why = f"more SubInstances than slots of {_bytes(sub)}"
            end.unconnected += [f"not connected: {why}", *self._facts_of(sub.subdevice)]
            return
        link = CopyLink(
            main=row.proposed,
            sub=sub,
            # Written as unconfirmed: `check` reports an error until a person has compared it.
            why=f"NOT CONFIRMED: {_bytes(sub)} fit {slots}",
            unconfirmed=f"lengths fit {slots}; compare with the safety project",
        )
        if rivals:
            link.remarks.append(f"the same lengths: {rivals}")
        link.remarks += facts[1:]
        self._add(link, ends)

    def _slots(self, pairs: Sequence[PairEnd]) -> str:
        by_main: dict[int, list[int]] = {}
        for pair in pairs:
            by_main.setdefault(pair.subdevice, []).append(pair.slot)
        return " and ".join(
            f"{noun(len(s), 'slot')} {', '.join(map(str, s))} of {self._names[n]}"
            for n, s in by_main.items()
        )

    def _made(self, ends: list[FrameEnd], rest: Sequence[DescribedCopy]) -> Proposal:
        copies = [c for c in self._bus.copies if c in rest]
        links = sorted(self._links, key=lambda k: (k.main.key, k.sub.key))
        rows, reasons = [], []
        notes: dict[int, tuple[str, ...]] = {}
        unconnected: dict[int, tuple[str, ...]] = {}
        for link in links:
            main, sub = ends[link.main.subdevice], ends[link.sub.subdevice]
            # Frames that plans do not recognise need explicit copies.
            beyond = main.beyond or sub.beyond
            if beyond:
                copies += _copies(link)
            rows.append(_row(link, ends, self._address(link), beyond=beyond))
            reasons.append((link.why, *link.remarks))
        for end in ends:
            self._remarks[end.number] += end.remarks
            unconnected[end.number] = tuple(dict.fromkeys(end.unconnected))
            known = library_device(self._bus.subdevices[end.number], self._library)
            if known is not None and (end.pairs or end.doubtful):
                notes[end.number] = known.notes
        return Proposal(
            bus=replace(self._bus, copies=tuple(copies), connections=tuple(rows)),
            mains=tuple(e.number for e in ends if e.role == "main" and e.pairs),
            notes=notes,
            sources=self._sources,
            remarks={n: tuple(dict.fromkeys(r)) for n, r in self._remarks.items()},
            unconnected=unconnected,
            reasons=tuple(reasons),
            open=tuple(dict.fromkeys((*self._devices, *self._open))),
            open_devices=tuple(dict.fromkeys(self._about)),
            questions=tuple(self._questions),
            findings=tuple(self._out.diagnostics),
        )

    def _address(self, link: CopyLink) -> int | None:
        if link.facts.address is not None:
            return link.facts.address
        return self._bus.subdevices[link.sub.subdevice].fsoe_address


def _bytes(sub: PairEnd) -> str:
    return f"{sub.lengths[0]} bytes to the SubInstance and {sub.lengths[1]} from it"


def _row(
    link: CopyLink, ends: Sequence[FrameEnd], address: int | None, *, beyond: bool
) -> DescribedConnection:
    several = len(ends[link.sub.subdevice].pairs) + len(ends[link.sub.subdevice].doubtful) > 1
    return replace(
        link.facts,
        name="",
        main=link.main.subdevice,
        sub=link.sub.subdevice,
        address=address,
        slot=None if beyond else link.main.slot,
        sub_slot=link.sub.slot if several and not beyond else None,
        net=link.net,
        unconfirmed=link.unconfirmed,
    )


def _copies(link: CopyLink) -> list[DescribedCopy]:
    return [
        DescribedCopy(
            source=_end(source, source.read),
            destination=_end(sink, sink.written),
            bits=8 * source.read.frame_bytes,
            fsoe=True,
            name=link.net,
        )
        for source, sink in ((link.sub, link.main), (link.main, link.sub))
    ]


def _end(pair: PairEnd, block: FsoeBlock) -> DescribedEnd:
    return DescribedEnd(
        subdevice=pair.subdevice, sm_index=block.sm_index, bit_offset=8 * block.byte_offset
    )
