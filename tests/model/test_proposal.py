"""A network proposed: who is the MainInstance, what settles a pair, what a wrong answer says."""

from __future__ import annotations

from dataclasses import replace

import pytest
from load.test_other_tools import TWINSAFE

from fsoe_net.diag import Span
from fsoe_net.load import Collector, builtin_library
from fsoe_net.load.twinsafe import load_twinsafe
from fsoe_net.model import (
    AnsweredConnection,
    AnsweredWord,
    Answers,
    Ask,
    DescribedConnection,
    DescribedSubDevice,
    Description,
    Device,
    Direction,
    Entry,
    Pdo,
    Proposal,
    SyncManager,
    match_project,
    propose,
)

LIBRARY = builtin_library()


def words(index: int, safe_bits: int) -> tuple[Entry, ...]:
    rows = ((index, 1, 8), (index + 1, 1, safe_bits), (index, 3, 16), (index, 2, 16))
    return tuple(Entry(index=i, subindex=s, bits=b, name="") for i, s, b in rows)


def device(product: int, *lengths: tuple[int, int]) -> Device:
    """A device with a pair of frames of one or two safe bytes for each pair of lengths."""
    managers = []
    for sm, way, column, base in ((2, "output", 0, 0x7000), (3, "input", 1, 0x6000)):
        pdos = tuple(
            Pdo(index=0x1600 + n, entries=words(base + 16 * n, 8 * (pair[column] - 5)))
            for n, pair in enumerate(lengths)
        )
        managers.append(SyncManager(index=sm, direction=Direction(way), carries=None, pdos=pdos))
    return Device(path="", vendor_id=2, product_code=product, sync_managers=tuple(managers))


LOGIC, INPUT, OUTPUT = 0x1AFE3052, 0x07703052, 0x0B583052


def sub(name: str, product: int, *lengths: tuple[int, int]) -> DescribedSubDevice:
    return DescribedSubDevice(name=name, device=device(product, *lengths))


def proposed(*subs: DescribedSubDevice, answers: Answers | None = None, connections=()) -> Proposal:
    bus = Description(format="x", path="x", subdevices=subs, connections=tuple(connections))
    names = [s.name for s in subs]
    return propose(bus, names, LIBRARY, answers or Answers())


def rows(made: Proposal) -> list[tuple]:
    return [(c.main, c.slot, c.sub, bool(c.unconfirmed)) for c in made.bus.connections]


SIX, SEVEN = (6, 6), (6, 7)
EL1904 = sub("stop", INPUT, SIX)
EL2904 = sub("motor", OUTPUT, SIX)


def test_one_way_only_is_settled():
    made = proposed(sub("logic", LOGIC, SIX), EL1904)
    assert rows(made) == [(0, 0, 1, False)]
    assert made.questions == ()
    assert "only" not in made.open


@pytest.mark.parametrize("slots", [1, 2, 3])
def test_input_and_output_of_one_length_are_never_told_apart(slots: int):
    made = proposed(sub("logic", LOGIC, *[SIX] * slots), EL1904, EL2904)
    assert all(unconfirmed for *_, unconfirmed in rows(made))
    assert [q.subject for q in made.questions] == ["stop", "motor"]
    assert [len(q.choices) for q in made.questions] == [slots, slots]


def test_an_answer_leaves_one_way_for_the_other():
    answer = AnsweredConnection(sub="motor", slot=0)
    made = proposed(
        sub("logic", LOGIC, SIX, SIX), EL1904, EL2904, answers=Answers(connections=(answer,))
    )
    assert rows(made) == [(0, 0, 2, False), (0, 1, 1, False)]
    assert made.questions == ()


def test_nobody_is_asked_twice():
    logic = sub("logic", LOGIC, SIX, SIX)
    first = proposed(logic, EL1904)
    assert len(first.questions) == 1
    passed = Answers(passed=frozenset({first.questions[0].key}))
    again = proposed(logic, EL1904, answers=passed)
    assert again.questions == ()
    assert rows(again) == [(0, 0, 1, True)]


def test_two_unknown_devices_are_asked_about():
    made = proposed(sub("a", 0x99, SIX), sub("b", 0x98, SIX))
    assert [q.ask for q in made.questions] == [Ask.MAIN]
    assert rows(made) == []
    told = Answers(main=(AnsweredWord(text="b"),))
    assert rows(proposed(sub("a", 0x99, SIX), sub("b", 0x98, SIX), answers=told)) == [
        (1, 0, 0, False)
    ]


def test_an_unknown_device_keeps_equal_lengths_open():
    logic = DescribedSubDevice(name="logic", device=device(0x1AF43052, SIX))  # EL6900
    made = proposed(logic, EL1904, sub("who", 0x99, SIX))
    assert rows(made) == [(0, 0, 1, True)]
    assert [q.ask for q in made.questions] == [Ask.MAIN, Ask.CONNECTIONS]


def test_a_connection_that_a_file_names():
    known = DescribedConnection(main=0, sub=2, slot=1, address=7)
    made = proposed(sub("logic", LOGIC, SIX, SIX), EL1904, EL2904, connections=[known])
    assert rows(made) == [(0, 0, 1, False), (0, 1, 2, False)]
    assert made.bus.connections[1].address == 7


def test_a_connection_that_does_not_fit_settles_nothing():
    known = DescribedConnection(main=0, sub=1, slot=1, span=Span("project.xml", 4, 2))
    made = proposed(sub("logic", LOGIC, SIX, SEVEN), EL1904, connections=[known])
    assert [(d.code, str(d.span)) for d in made.findings] == [("FSN159", "project.xml:4:2")]
    assert rows(made) == [(0, 0, 1, True)]
    other = replace(known, slot=0)
    made = proposed(sub("logic", LOGIC, SEVEN), EL1904, connections=[other])
    assert rows(made) == []


def test_a_connection_of_a_project_when_there_are_two_logics():
    known = DescribedConnection(main=None, sub=2, slot=0, span=Span("project.xml", 4, 2))
    logics = [replace(sub(n, 0x1AF43052, SIX), name=n) for n in ("one", "two")]
    stop = sub("stop", INPUT, SIX)
    made = proposed(*logics, stop, connections=[known])
    assert [unconfirmed for *_, unconfirmed in rows(made)] == [True]
    assert any("project.xml:4 names a connection of stop" in text for text in made.open)


@pytest.mark.parametrize(
    ("answers", "code"),
    [
        (Answers(connections=(AnsweredConnection(sub="nobody"),)), "FSN155"),
        (Answers(connections=(AnsweredConnection(sub="stop", main="nobody"),)), "FSN155"),
        (Answers(connections=(AnsweredConnection(sub="stop", slot=9),)), "FSN155"),
        (Answers(connections=(AnsweredConnection(sub="stop", slot=1),)), "FSN156"),
        (Answers(connections=(AnsweredConnection(sub="logic", slot=0),)), "FSN156"),
        (Answers(main=(AnsweredWord(text="nobody"),)), "FSN155"),
        (Answers(process_data={"stop": AnsweredWord(text="device PDO")}), "FSN156"),
        (Answers(frames={"nobody": AnsweredWord(text="yes")}), "FSN155"),
    ],
)
def test_wrong_answers(answers: Answers, code: str):
    made = proposed(sub("logic", LOGIC, SIX, SEVEN), EL1904, answers=answers)
    assert [d.code for d in made.findings] == [code]
    assert made.findings[0].hint


def test_a_value_that_a_file_contradicts():
    known = DescribedConnection(main=0, sub=1, slot=0, address=7, span=Span("project.xml", 4, 2))
    answer = AnsweredConnection(sub="stop", slot=0, address=8)
    made = proposed(
        sub("logic", LOGIC, SIX),
        EL1904,
        connections=[known],
        answers=Answers(connections=(answer,)),
    )
    assert [d.code for d in made.findings] == ["FSN156"]
    assert "project.xml:4:2 says 7" in made.findings[0].message


def test_a_safety_project_names_devices_by_their_order_number():
    project = load_twinsafe(TWINSAFE.encode(), Collector(), name="x.xml")
    assert project is not None
    ring = [sub("logic", LOGIC, SIX, SIX), EL1904, EL2904]
    one = match_project(ring, project, LIBRARY)
    assert [(c.sub, c.slot, c.address) for c in one.connections] == [(2, 0, 4)]
    assert one.hints == ()
    assert len(one.lost) == 1  # the connection of a device that is not told
    two = match_project([*ring, replace(EL2904, name="motor_2")], project, LIBRARY)
    assert two.connections == ()
    assert [numbers for numbers, _ in two.hints] == [{2, 3}]
    assert "address 4, connection ID 3, watchdog ms 100" in two.hints[0][1]
    bus = Description(format="x", path="x", subdevices=tuple(ring), connections=one.connections)
    made = propose(bus, ["logic", "stop", "motor"], LIBRARY, Answers())
    assert rows(made) == [(0, 0, 2, False), (0, 1, 1, False)]
