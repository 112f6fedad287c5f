"""A network proposed: who is the MainInstance, what settles a pair, what a wrong answer says."""

from __future__ import annotations

from dataclasses import replace

import pytest
from formats.texts import TWINSAFE
from proposal.made_bus import EL1904, EL2904, INPUT, LIBRARY, LOGIC, SEVEN, SIX, device, rows, sub

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.twinsafe.read import load_twinsafe
from fsoe_net.model.answers import AnsweredWord, Answers, Ask
from fsoe_net.model.bus import Device, Direction
from fsoe_net.model.description import DescribedConnection, DescribedSubDevice, Description
from fsoe_net.model.library import LibraryMapping
from fsoe_net.model.library_fill import library_role
from fsoe_net.model.network import ConnectionFacts
from fsoe_net.proposal.proposal import Proposal, propose
from fsoe_net.proposal.safety_project import match_project


def proposed(*subs: DescribedSubDevice, answers: Answers | None = None, connections=()) -> Proposal:
    bus = Description(format="x", path="x", subdevices=subs, connections=tuple(connections))
    names = [s.name for s in subs]
    return propose(bus, names, LIBRARY, answers or Answers())


def test_one_way_only_is_settled():
    made = proposed(sub("logic", LOGIC, SIX), EL1904)
    assert rows(made) == [(0, 0, 1, False)]
    assert made.questions == ()
    assert "only" not in made.open


@pytest.mark.parametrize("slots", [1, 2, 3])
def test_input_and_output_of_one_length_are_never_distinguished(slots: int):
    made = proposed(sub("logic", LOGIC, *[SIX] * slots), EL1904, EL2904)
    assert all(unconfirmed for *_, unconfirmed in rows(made))
    assert [q.subject for q in made.questions] == ["stop", "motor"]
    assert [len(q.choices) for q in made.questions] == [slots, slots]


def test_an_answer_leaves_one_way_for_the_other():
    answer = ConnectionFacts(sub="motor", slot=0)
    made = proposed(
        sub("logic", LOGIC, SIX, SIX), EL1904, EL2904, answers=Answers(connections=(answer,))
    )
    assert rows(made) == [(0, 0, 2, False), (0, 1, 1, False)]
    assert made.questions == ()


def test_a_question_is_asked_once():
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
        (Answers(connections=(ConnectionFacts(sub="nobody"),)), "FSN155"),
        (Answers(connections=(ConnectionFacts(sub="stop", main="nobody"),)), "FSN155"),
        (Answers(connections=(ConnectionFacts(sub="stop", slot=9),)), "FSN155"),
        (Answers(connections=(ConnectionFacts(sub="stop", slot=1),)), "FSN156"),
        (Answers(connections=(ConnectionFacts(sub="logic", slot=0),)), "FSN156"),
        (Answers(main=(AnsweredWord(text="nobody"),)), "FSN155"),
        (Answers(process_data={"stop": AnsweredWord(text="device PDO")}), "FSN156"),
        (Answers(frames={"nobody": AnsweredWord(text="yes")}), "FSN155"),
    ],
)
def test_wrong_answer_is_reported_with_a_hint(answers: Answers, code: str):
    made = proposed(sub("logic", LOGIC, SIX, SEVEN), EL1904, answers=answers)
    assert [d.code for d in made.findings] == [code]
    assert made.findings[0].hint


def test_a_value_that_a_file_contradicts():
    known = DescribedConnection(main=0, sub=1, slot=0, address=7, span=Span("project.xml", 4, 2))
    answer = ConnectionFacts(sub="stop", slot=0, address=8)
    made = proposed(
        sub("logic", LOGIC, SIX),
        EL1904,
        connections=[known],
        answers=Answers(connections=(answer,)),
    )
    assert [d.code for d in made.findings] == ["FSN156"]
    assert "project.xml:4:2 has 7" in made.findings[0].message


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


def bare(name: str, product: int, **more: object) -> DescribedSubDevice:
    empty = Device(path="", vendor_id=2, product_code=product, sync_managers=())
    return DescribedSubDevice(name=name, device=empty, **more)


def said(made: Proposal) -> list[tuple[str, str, str]]:
    return [(d.code, d.message, d.hint) for d in made.findings]


def test_a_device_whose_process_data_no_one_has_stays_open():
    made = proposed(bare("logic", LOGIC), sub("stop", INPUT, (6, 6)))
    assert made.open[0] == "logic: an FSoE device, and no file has its process data"
    assert "the device library has no process data for this EL6910" in made.remarks[0]


def test_an_answer_that_names_no_process_data():
    answers = Answers(process_data={"box": AnsweredWord(text="mine")})
    made = proposed(bare("box", 0x077E3052), sub("stop", INPUT, (6, 6)), answers=answers)
    names = ", ".join(m.name for m in LIBRARY.named("EL1918").mappings)
    what = "the device library has no process data 'mine' for this device"
    assert said(made)[0] == ("FSN155", what, f"it has: {names}")


def test_answers_that_leave_out_a_main_instance_of_a_file():
    row = DescribedConnection(main=0, sub=2, span=Span("net.xml", 5, 1))
    made = proposed(
        sub("logic", LOGIC, (6, 6)),
        sub("other", LOGIC, (6, 6)),
        sub("stop", INPUT, (6, 6)),
        answers=Answers(main=(AnsweredWord(text="other"),)),
        connections=[row],
    )
    what = "logic is not among them, and net.xml:5:1 names it as a MainInstance"
    assert ("FSN156", what, "add it, or correct that file") in said(made)


def test_a_main_instance_without_frames():
    answers = Answers(main=(AnsweredWord(text="plain"),))
    made = proposed(bare("plain", 1), sub("stop", INPUT, (6, 6)), answers=answers)
    what = "plain has no pair of FSoE frames, so it is not a MainInstance"
    hint = "name another SubDevice, or give a file with its process data"
    assert ("FSN156", what, hint) in said(made)


@pytest.mark.parametrize(
    ("order", "lengths", "role"),
    [("EL6910", (), "main"), ("EL1904", (), "sub"), ("EL9999", (), ""), ("", (), "")],
)
def test_roles_of_the_library(order: str, lengths: tuple, role: str):
    device = Device(path="", vendor_id=0, product_code=0, sync_managers=())
    assert library_role(DescribedSubDevice(order=order, device=device), lengths, LIBRARY) == role


@pytest.mark.parametrize("pair", [True, False])
def test_a_device_of_both_roles_is_known_by_its_frames(pair: bool):
    known = next(d for d in LIBRARY.devices if len(set(d.roles)) > 1)
    at = known.identities[0]
    device = Device(path="", vendor_id=at.vendor_id, product_code=at.product_code, sync_managers=())
    rows = {m.role: _frames(m) for m in known.mappings}
    for role, lengths in rows.items():
        others = [other for name, other in rows.items() if name != role]
        expected = role if lengths not in others else ""
        given = tuple(lengths) if pair else ((999, 999),)
        found = library_role(DescribedSubDevice(device=device), given, LIBRARY)
        assert found == (expected if pair else "")


def _frames(mapping: LibraryMapping) -> list[tuple[int, int]]:
    ways: dict[bool, list[int]] = {True: [], False: []}
    sides = {s.index: s.direction is Direction.OUTPUT for s in mapping.sync_managers}
    for row in mapping.frames:
        ways[sides[row.sm_index]].append(row.frame_bytes)
    return sorted(zip(ways[True], ways[False], strict=False))
