"""What is proposed for small rings when files and answers say each thing about a connection."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from operator import attrgetter

import pytest
from changed import compare, findings, whole
from model.fsoe_table import pdo
from proposal.made_bus import EL1904, EL2904, LIBRARY, LOGIC, SEVEN, SIX, device, sub

from fsoe_net.diag.diagnostic import Span
from fsoe_net.model.answers import AnsweredWord, Answers
from fsoe_net.model.bus import Device, Direction, SyncManager
from fsoe_net.model.description import (
    DescribedConnection,
    DescribedCopy,
    DescribedEnd,
    DescribedSubDevice,
    Description,
)
from fsoe_net.model.network import ConnectionFacts
from fsoe_net.proposal.proposal import Proposal, propose

# A frame whose places are right and whose objects are not one: taken only when a person says so.
LIKELY = "60{0}0:01/8=Command 60{0}1:01/8 60{0}2:01/16=CRC_0 60{0}3:01/16=Connection_ID"
# The same with objects so far apart that a plan does not recognise it: copies are written out.
FAR = "6{0}00:01/8=Command 6{0}01:01/8 6{0}40:01/16=CRC_0 6{0}80:01/16=Connection_ID"
NEAR_MISS = "60A0:01/8=CMD 60A1:01-05/1 60A0:03/16=CRC 60A0:02/16=Conn"


def unusual(name: str, frame: str) -> DescribedSubDevice:
    managers = tuple(
        SyncManager(
            index=index,
            direction=way,
            pdos=tuple(pdo(text, index=0x1A00 + n) for n, text in enumerate(texts)),
        )
        for index, way, texts in (
            (2, Direction.OUTPUT, [frame.format(5), frame.format(6)]),
            (3, Direction.INPUT, [frame.format(7), frame.format(8), NEAR_MISS]),
        )
    )
    made = Device(path="", vendor_id=3, product_code=5, sync_managers=managers)
    return DescribedSubDevice(name=name, device=made, span=Span("ring.xml", 9, 1))


def addressed(made: DescribedSubDevice, address: int) -> DescribedSubDevice:
    return replace(made, fsoe_address=address)


RINGS = {
    "one": [sub("logic", LOGIC, SIX), addressed(EL1904, 31)],
    "two": [sub("logic", LOGIC, SIX, SIX), EL1904, EL2904],
    "lengths": [sub("logic", LOGIC, SIX, SEVEN), sub("stop", 0x99, SEVEN), EL2904],
    "mains": [sub("one", LOGIC, SIX, SIX), sub("two", 0x1AF43052, SIX), EL1904, EL2904],
    "slots": [sub("logic", LOGIC, SIX, SEVEN, SIX), sub("drive", 0x99, SIX, SEVEN), EL1904],
    "lonely": [
        sub("logic", LOGIC, SIX),
        DescribedSubDevice(
            name="half",
            device=replace(
                device(0x98, SIX, SIX), sync_managers=device(0x98, SIX, SIX).sync_managers[:1]
            ),
        ),
        EL1904,
    ],
    "likely": [sub("logic", LOGIC, SIX, SIX, SIX), unusual("drive", LIKELY), EL1904],
    "beyond": [sub("logic", LOGIC, SIX, SIX, SIX), unusual("drive", FAR), EL1904],
}


CONNECTION = attrgetter(
    *["name", "main", "slot", "sub", "sub_slot", "address", "connection_id", "watchdog_ms"],
    *["app_parameters", "net", "unconfirmed"],
)


def text_of(made: Proposal) -> str:
    rows = [CONNECTION(c) for c in made.bus.connections]
    copies = [
        [(e.subdevice, e.sm_index, e.bit_offset) for e in (c.source, c.destination)]
        + [c.bits, c.fsoe, c.name]
        for c in made.bus.copies
    ]
    asked = [(q.ask, q.text, q.subject, q.sub_slot, q.facts, q.choices) for q in made.questions]
    texts = [rows, copies, asked, made.mains, dict(made.remarks), dict(made.notes)]
    texts += [made.reasons, made.open]
    return "\n".join([*map(whole, texts), findings(made.findings)])


def proposed(ring: str, answers: Answers | None = None, connections=(), copies=()) -> str:
    subs = tuple(RINGS[ring])
    bus = Description(
        format="x",
        path="ring.xml",
        subdevices=subs,
        connections=tuple(connections),
        copies=tuple(copies),
    )
    return text_of(propose(bus, [s.name for s in subs], LIBRARY, answers or Answers()))


def _answers(ring: str) -> Iterator[tuple[str, Answers]]:
    names = [s.name for s in RINGS[ring]]
    yield "nothing", Answers()
    for name, word in product([*names, "nobody"], ["yes", "no", "N"]):
        yield f"frames {name} {word}", Answers(frames={name: AnsweredWord(text=word)})
    for one, two in product(names, ["", *names]):
        words = tuple(AnsweredWord(text=t) for t in (one, two) if t)
        yield f"main {one} {two}", Answers(main=words)
    for name, main, slot, sub_slot in product(
        names, [None, *names[:2]], [None, 0, 1, 9], [None, 0, 1]
    ):
        row = ConnectionFacts(
            sub=name,
            main=main,
            slot=slot,
            sub_slot=sub_slot,
            address=17,
            span=Span("answers.yaml", 4, 3) if slot else Span(""),
        )
        yield f"{name} {main} {slot} {sub_slot}", Answers(connections=(row,))
        second = ConnectionFacts(sub=names[-1], slot=0, connection_id=5, watchdog_ms=60)
        yield f"{name} {main} {slot} {sub_slot} two", Answers(connections=(row, second))
        if "drive" in names:
            taken = Answers(
                main=(AnsweredWord(text=names[0]),),
                frames={"drive": AnsweredWord(text="yes")},
                connections=(row,),
            )
            yield f"{name} {main} {slot} {sub_slot} yes", taken


@pytest.mark.weekly
@pytest.mark.parametrize("ring", RINGS)
def test_each_change_of_an_answer(ring: str) -> None:
    rows = [(name, proposed(ring, answers)) for name, answers in _answers(ring)]
    compare(__file__, f"answered {ring}", rows)


def _connections(ring: str) -> Iterator[tuple[str, list[DescribedConnection]]]:
    numbers = range(len(RINGS[ring]))
    last = numbers[-1]
    for main, end, slot, where in product([None, 0, 1], numbers, [None, 0, 1, 7], [0, 4]):
        row = DescribedConnection(
            name="a",
            main=main,
            sub=end,
            slot=slot,
            address=7,
            span=Span("project.xml", where, 2) if where else Span(""),
            net="net a",
        )
        yield f"{main} {end} {slot} {where}", [row]
        for address, line in ((7, where), (8, where), (None, 5)):
            other = DescribedConnection(
                main=0,
                sub=end if line == where else last,
                slot=slot,
                address=address,
                connection_id=3,
                watchdog_ms=100,
                app_parameters=b"\1",
                span=Span("other.xml", line, 1) if line else Span(""),
            )
            yield f"{main} {end} {slot} {where} then {address} {line}", [row, other]


@pytest.mark.weekly
@pytest.mark.parametrize("ring", RINGS)
def test_each_change_of_a_connection_in_files(ring: str) -> None:
    rows = [(name, proposed(ring, connections=rows)) for name, rows in _connections(ring)]
    compare(__file__, f"connections {ring}", rows)


def _copies(ring: str) -> Iterator[tuple[str, list[DescribedCopy]]]:
    """Yield copies between each two SubDevices, both ways, and one of them changed."""

    def copy(source, at: int, destination, to: int, bits: int, **more) -> DescribedCopy:
        ends = [
            DescribedEnd(subdevice=n, sm_index=sm, bit_offset=b)
            for n, sm, b in ((source, 3, at), (destination, 2, to))
        ]
        return DescribedCopy(source=ends[0], destination=ends[1], bits=bits, **more)

    for one, two, at, to in product(range(len(RINGS[ring])), range(2), (0, 48), (0, 48)):
        span = Span("net.xml", 6, 1) if at else Span("")
        there = copy(one, at, two, to, 48, name="there", span=span)
        back = copy(two, to, one, at, 48, name="back")
        for fsoe in (None, True, False):
            rows = [replace(there, fsoe=fsoe), back]
            yield f"{one} {two} {at} {to} {fsoe}", rows
        yield f"{one} {two} {at} {to} only", [there]
        yield f"{one} {two} {at} {to} twice", [there, back, there, back]
        yield f"{one} {two} {at} {to} short", [replace(there, bits=40), back]
        yield f"{one} {two} {at} {to} beside", [copy(one, at + 8, two, to, 48), back]


@pytest.mark.weekly
@pytest.mark.parametrize("ring", RINGS)
def test_each_change_of_copies_in_files(ring: str) -> None:
    rows = [(name, proposed(ring, copies=copies)) for name, copies in _copies(ring)]
    compare(__file__, f"copies {ring}", rows)
