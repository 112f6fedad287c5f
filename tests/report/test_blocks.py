"""What the blocks of a report say of a network that states little, and of a plan that is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from report.made import BASE, TIMED, inputs_of
from report.made_blocks import LOCAL, SPARSE

from fsoe_net.document.model import (
    Heading,
    Item,
    Level,
    Paragraph,
    Table,
    Verdict,
)
from fsoe_net.fsoe.crc import sra_crc
from fsoe_net.plan.image import igh_image
from fsoe_net.plan.model import Plan
from fsoe_net.report import section_network
from fsoe_net.report.compose import _lead, compose_report
from fsoe_net.report.model import PointKind
from fsoe_net.report.section_copies import _copy_table

OPEN = """\
SF2 local stop: no reset is stated
SF2 local stop: no modes are stated
Architecture: firmware to be read at the device: io, io2, logic
Architecture: serial number to be read at the device: io, io2, logic
Architecture: CRC of the safety project to be read at the device: logic
Change log: not compared with the state that was accepted last
Sign-off: not signed
Identity: the machine is not named; write project: in the network file
Tests: no test record: nothing was tried at the machine
FSoE connections: logic-io is unconfirmed: asked by mail
FSoE connections: logic-io2 is unconfirmed
Timing: estop: values without a responsible person: ES1
Timing: estop: no required reaction time is stated
Timing: local stop: no sensor is stated; write time_ms: 0 and zero_because: for what takes no time
Timing: local stop: no input is stated; write time_ms: 0 and zero_because: for what takes no time
Timing: local stop: no output is stated; write time_ms: 0 and zero_because: for what takes no time
Timing: local stop: no actuator is stated; write time_ms: 0 and zero_because: for what takes no time
Timing: local stop: no required reaction time is stated
Quantities: estop: no PFH of ES1
Quantities: estop: no PL or SIL claim of ES1
Quantities: estop: no level (PL or SIL) is required
Quantities: local stop: no PL or SIL claim of relay
Quantities: local stop: no level (PL or SIL) is required
Bus evidence: no evidence of the machine: give --evidence scan.json or --interface IF
"""


@pytest.fixture(scope="module")
def sparse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    text = TIMED.read_text("utf-8").replace("devices/", f"{BASE}/devices/")
    for find, put in SPARSE:
        assert find in text
        text = text.replace(find, put)
    path = tmp_path_factory.mktemp("sparse") / "sparse.yaml"
    path.write_text(text + LOCAL, "utf-8")
    return path


def said(items: tuple[Item, ...]) -> str:
    return " ".join(str(getattr(i, "word", None) or getattr(i, "text", "")) for i in items)


@pytest.mark.shows("R12")
def test_missing_facts_are_open_points(sparse: Path):
    points = compose_report(inputs_of(sparse)).points
    told = [(title, p.text) for title, p in points if p.kind is PointKind.OPEN]
    assert "".join(f"{t}: {text}\n" for t, text in told if t != "Findings") == OPEN


def test_missing_facts_are_in_the_tables(sparse: Path):
    blocks = {b.key: b.parts for b in compose_report(inputs_of(sparse)).sections}
    rows = {p.name: p.rows for parts in blocks.values() for p in parts if isinstance(p, Table)}
    assert [said(row[0]) for row in rows["subdevices"]] == ["0", "1 alias 7", "2"]
    assert next(said(row[3]) for row in rows["parts of estop"]) == "not stated"
    # A function without a connection has no share for the bus.
    assert [said(row[1]) for row in rows["parts of local stop"]] == ["relay", ""]
    facts = {said(row[0]): said(row[1]) for row in rows["facts of local stop"]}
    assert facts["Required"] == "not stated not stated"
    assert facts["Claimed"] == "no level is claimed"
    assert (facts["Reset"], facts["Modes"]) == ("not stated", "not stated")


def test_nothing_open_is_not_a_list():
    head, numbers = _lead(inputs_of(TIMED), (), (), (), 13)
    assert head == Heading("Open points and assumptions")
    assert isinstance(numbers, Paragraph)


def test_some_of_many_objections_are_on_the_first_page():
    against = [("Tests", Verdict(f"fault {n}", Level.ERROR)) for n in range(40)]
    rows = [said(row) for row in _lead(inputs_of(TIMED), (), (), against, 13)[1].rows]
    shown = len(rows) - 1
    assert rows[:2] == ["Tests:  fault 0", "Tests:  fault 1"]
    assert rows[-1] == f"and {40 - shown} more in the blocks"


def no_first(plan: Plan) -> Plan:
    """Return a plan in which the first FSoE frame is not known."""
    return replace(plan, blocks=plan.blocks[1:])


@pytest.mark.parametrize(
    ("change", "cut", "verdicts"),
    [
        (lambda p: p, 0, "no overlap one whole frame, no gap both directions"),
        (no_first, 0, "no overlap frame not recognised both directions"),
        (
            lambda p: p,
            3,
            "straddles datagrams no overlap one whole frame, no gap both directions",
        ),
    ],
    ids=["right", "unknown frame", "datagram that ends in a frame"],
)
def test_verdicts_on_a_copy(change: Callable[[Plan], Plan], cut: int, verdicts: str):
    plan = inputs_of(TIMED).plan
    assert plan is not None
    domain = igh_image(plan)
    (whole,) = domain.datagrams
    if cut:
        rest = replace(
            whole, offset_bytes=whole.offset_bytes + cut, size_bytes=whole.size_bytes - cut
        )
        domain = replace(domain, datagrams=(replace(whole, size_bytes=cut), rest))
    assert said(_copy_table(change(plan), domain).rows[0][-1]) == verdicts


def test_a_copy_without_a_place_in_the_image():
    plan = inputs_of(TIMED).plan
    assert plan is not None
    row = _copy_table(plan, replace(igh_image(plan), fmmus=())).rows[0]
    assert [said(end) for end in row[2:4]] == [
        "logic SM3 byte 0 (0x6000:01) no place in the image",
        "io SM2 byte 0 (0x7000:01) no place in the image",
    ]


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ("581cec59 0100020003000400", ["begin with their SRA CRC 0x59ec1c58"]),
        ("591cec59 0100020003000400", ["do not begin with an SRA CRC of the rest"]),
        ("0100020003000400", ["do not begin with an SRA CRC of the rest"]),
        ("00000000", ["do not begin with an SRA CRC of the rest"]),
    ],
)
def test_the_sra_crc_is_that_of_the_rest(parameters: str, said: list[str]):
    """Words 1 to 4 of the test record notes (§12), and the CRC low byte first in front of them."""
    data = bytes.fromhex(parameters)
    number, shown, *rest = section_network._parameters(data)
    assert (number.value, shown.text) == (len(data), data.hex(" "))
    assert [item.text for item in rest] == said


def test_an_odd_rest_may_be_padded_and_long_parameters_are_cut():
    rest = bytes(range(1, 20))
    for covered in (rest, rest + b"\0"):
        crc = sra_crc(covered)
        _, shown, said = section_network._parameters(crc.to_bytes(4, "little") + rest)
        assert said.text == f"begin with their SRA CRC 0x{crc:08x}"
        assert shown.text.endswith("0a 0b 0c …")
