"""Determines which SubDevices take part in FSoE, with which frames, and at which end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from fsoe_net.diag.diagnostic import Span
from fsoe_net.model.answers import Answers, Ask, Question
from fsoe_net.model.bus import Direction, same_devices
from fsoe_net.model.description import DescribedSubDevice
from fsoe_net.model.detect import FsoeGuess, detect_fsoe, near_misses
from fsoe_net.model.layout import DeviceLayout, FsoeBlock
from fsoe_net.model.library import Library
from fsoe_net.model.library_fill import library_role
from fsoe_net.model.pairing import PairEnd, lonely_frames, pair_ends


@dataclass(slots=True, kw_only=True)
class FrameEnd:
    """The FSoE side of a SubDevice.

    Attributes:
        number: Number of the SubDevice.
        name: Name of the SubDevice.
        pairs: Its accepted pairs of frames.
        doubtful: Pairs that may be frames; not yet answered.
        beyond: Whether it has an accepted frame that plans do not recognise, so that its copies
            must be written explicitly.
        role: ``main``, ``sub`` or empty.
        remarks: Remarks for readers of the network.
        unconnected: Why its frames are not connected.
        likely: Uncertain frames without an answer.
        question: The question whether doubtful pairs are frames.
    """

    number: int
    name: str
    pairs: tuple[PairEnd, ...] = ()
    doubtful: tuple[PairEnd, ...] = ()
    beyond: bool = False
    role: str = ""
    remarks: list[str] = field(default_factory=list)
    unconnected: list[str] = field(default_factory=list)
    likely: tuple[FsoeGuess, ...] = ()
    question: Question | None = None

    @property
    def is_bare(self) -> bool:
        """Whether it has no possible frame."""
        return not self.pairs and not self.doubtful

    def accept(self, moved: set[tuple[int, int]]) -> None:
        """Accept doubtful pairs that files copy in both directions, which confirms them.

        Args:
            moved: Their keys.
        """
        taken = [p for p in self.doubtful if p.key in moved]
        if taken:
            self.pairs = tuple(sorted((*self.pairs, *taken), key=lambda p: p.slot))
            self.doubtful = tuple(p for p in self.doubtful if p not in taken)
            blocks = {b.key for p in taken for b in (p.written, p.read)}
            self.likely = tuple(g for g in self.likely if g.block.key not in blocks)
            if not self.likely:
                self.question = None


def find_ends(
    subdevices: Sequence[DescribedSubDevice], names: Sequence[str], answers: Answers
) -> list[FrameEnd]:
    """Find the frames of each SubDevice; certain ones are accepted, probable ones as answered.

    Args:
        subdevices: In ring order.
        names: Their names.
        answers: Answers, which accept or reject probable frames.
    """
    devices = same_devices(sub.device for sub in subdevices)
    known: dict[int, list[FsoeGuess]] = {}  # by device
    ends = []
    for number, (sub, name, device) in enumerate(zip(subdevices, names, devices, strict=True)):
        # Devices of one type are analysed once.
        if device not in known:
            managers = sub.device.layout.managers
            known[device] = [g for m in managers for g in detect_fsoe(m.placed, m.sm)]
        end = FrameEnd(number=number, name=name)
        _take(end, sub, known[device], answers)
        ends.append(end)
    return ends


def _take(
    end: FrameEnd,
    sub: DescribedSubDevice,
    guesses: list[FsoeGuess],
    answers: Answers,
) -> None:
    layout = sub.device.layout
    likely = {g.block.key: g for g in guesses if not g.sure}
    answer = _answer(answers, end.name)
    # Frames that only an answer confirms may be at places where plans do not search.
    end.beyond = bool(answer) and not likely.keys() <= _regular(layout)
    pairs = _all_pairs(guesses, end.number) if end.beyond else pair_ends(layout, end.number)
    unsure = [p for p in pairs if p.written.key in likely or p.read.key in likely]
    # Without an answer, doubtful frames take no part in pairing.
    sure = [p for p in pairs if p not in unsure]
    if answer is None:
        end.pairs, end.doubtful = tuple(sure), tuple(unsure)
        end.likely = tuple(likely.values())
        if likely:
            end.question = _ask_frames(end, sub, list(likely.values()))
    else:
        end.pairs = tuple(pairs if answer else sure)
        verdict = "taken" if answer else "left out"
        for guess in likely.values():
            where = where_is(guess.block)
            end.remarks.append(f"likely FSoE frame, {verdict} as answered: {where}")
    _remark(end, layout)


def _answer(answers: Answers, name: str) -> bool | None:
    """Return the answer whether probable frames are frames; ``None`` if unanswered."""
    word = answers.frames.get(name)
    return None if word is None else word.text.casefold() not in ("no", "n", "false")


def _regular(layout: DeviceLayout) -> set[tuple[int, int]]:
    return {b.key for m in layout.managers for b in m.blocks}


def _remark(end: FrameEnd, layout: DeviceLayout) -> None:
    """Add a remark about probable frames that are not used."""
    if not end.beyond:
        end.remarks += [
            f"FSoE frame that none in the other direction belongs to, not used: {where_is(b)}"
            for b in lonely_frames(layout)
        ]
    for manager in layout.managers:
        for miss in near_misses(manager.placed, manager.sm):
            end.remarks.append(
                f"PDO 0x{miss.pdo.index:04x} is named like an FSoE frame, but is "
                f"not one: {miss.why}"
            )


def _all_pairs(guesses: list[FsoeGuess], number: int) -> tuple[PairEnd, ...]:
    ways: dict[Direction, list[FsoeBlock]] = {way: [] for way in Direction}
    for guess in guesses:
        ways[guess.block.direction].append(guess.block)
    rows = zip(ways[Direction.OUTPUT], ways[Direction.INPUT], strict=False)
    return tuple(
        PairEnd(subdevice=number, slot=slot, written=out, read=into)
        for slot, (out, into) in enumerate(rows)
    )


def where_is(block: FsoeBlock) -> str:
    """Return length, direction and place of a frame, in words."""
    way = "to" if block.direction is Direction.OUTPUT else "from"
    return (
        f"{block.frame_bytes} bytes {way} the SubDevice at {block.command.address} "
        f"(byte {block.byte_offset} of Sm{block.sm_index})"
    )


def _ask_frames(end: FrameEnd, sub: DescribedSubDevice, likely: list[FsoeGuess]) -> Question:
    facts = []
    for guess in likely:
        facts.append(f"{where_is(guess.block)}, {guess.score} of 100")
        facts += [f"  for it: {r}" for r in guess.reasons]
        facts += [f"  against it: {d}" for d in guess.doubts]
    what = "these FSoE frames" if len(likely) > 1 else "this an FSoE frame"
    return Question(
        ask=Ask.FRAMES,
        subject=end.name,
        span=sub.span,
        text=f"{end.name}: {'are' if len(likely) > 1 else 'is'} {what}?",
        facts=tuple(facts),
        choices=(("yes", "take it"), ("no", "ordinary process data")),
    )


def give_roles(
    ends: Sequence[FrameEnd],
    subdevices: Sequence[DescribedSubDevice],
    library: Library,
    answers: Answers,
    stated: dict[int, str],
) -> Question | None:
    """Assign each end its role, and return the question about undecided ends.

    Args:
        ends: Receive their roles.
        subdevices: The SubDevices.
        library: Identifies MainInstances.
        answers: Answers, which name the MainInstances.
        stated: Roles that connections of the files state, by number of the SubDevice.
    """
    if answers.main is not None:
        roles = {w.text: "main" for w in answers.main}
        for end in ends:
            # Answers name the MainInstances; all others are SubInstances.
            end.role = roles.get(end.name, "sub")
        return None
    for end in ends:
        lengths = tuple(p.lengths for p in (*end.pairs, *end.doubtful))
        known = library_role(subdevices[end.number], lengths, library)
        end.role = stated.get(end.number, "") or known
    open_ends = [e for e in ends if not e.role and not e.is_bare]
    if not open_ends:
        return None
    # A single undecided end with matching SubInstances can only be the MainInstance.
    if len(open_ends) == 1 and _only_choice(open_ends[0], ends):
        open_ends[0].role = "main"
        open_ends[0].remarks.append(
            "taken as the MainInstance: all others with FSoE frames are known as SubInstances"
        )
        return None
    for end in open_ends:
        end.remarks.append("TODO: MainInstance (safety logic) or SubInstance? No file states it")
    return _which_is_main(open_ends, subdevices[open_ends[0].number].span)


def _which_is_main(ends: Sequence[FrameEnd], span: Span) -> Question:
    return Question(
        ask=Ask.MAIN,
        text="Which of these are FSoE MainInstances (safety logic)? The others are SubInstances.",
        facts=tuple(f"{e.name}: {len(e.pairs) + len(e.doubtful)} pair(s) of frames" for e in ends),
        choices=tuple((e.name, "") for e in ends),
        span=span,
    )


def _only_choice(end: FrameEnd, ends: Sequence[FrameEnd]) -> bool:
    """Whether an end must be the MainInstance: it is the only one, and a SubInstance matches it."""
    subs = [p for e in ends if e.role == "sub" for p in e.pairs]
    none = not any(e.role == "main" for e in ends)
    return none and any(p.fits(s) for p in end.pairs for s in subs)
