"""What readers keep beside the process data, for comparisons: fixed PDOs, sizes, modules."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from formats.sii_image import category, image
from formats.texts import PDOS, SLAVES

from fsoe_net.formats.recognise import find_format
from fsoe_net.formats.registry import read_foreign
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Direction
from fsoe_net.model.description import DescribedSubDevice

BASE = Path(__file__).parents[1] / "diagnostics" / "base"


def read(data: bytes) -> DescribedSubDevice:
    out = Collector()
    kind = find_format(data, out)
    assert kind is not None
    found = read_foreign(data, kind, out)
    assert found is not None, out.diagnostics
    return found.subdevices[0]


def test_esi_keeps_what_is_fixed_mandatory_and_excluded():
    facts = read((BASE / "coupler.xml").read_bytes()).facts
    rows = {f.index: f for f in facts.pdos}
    assert [(i, f.fixed, f.mandatory, f.sm) for i, f in rows.items()] == [
        (0x1600, True, True, 2),
        (0x1601, True, False, 2),
        (0x1602, True, False, None),
        (0x1603, True, False, None),
        (0x1A00, True, True, 3),
        (0x1A01, True, False, 3),
    ]
    assert rows[0x1602].excludes == {0x1601}
    assert rows[0x1A00].direction is Direction.INPUT
    assert (facts.assignable, facts.modular) == (True, False)
    assert facts.default_bytes == {2: 8, 3: 8}  # mailboxes have sizes of their own


@pytest.mark.parametrize(
    ("find", "put", "modular"),
    [
        ("", "", False),
        ("</ModuleIdent></Slot>", "</ModuleIdent><ModuleIdent>#x21</ModuleIdent></Slot>", True),
        (' Default="1"', "", True),
        ("<Slot>", '<Slot MaxInstances="4">', True),
    ],
)
def test_esi_has_whether_there_is_a_choice_of_modules(find: str, put: str, modular: bool):
    text = (BASE / "gate.xml").read_text("utf-8")
    assert find in text
    facts = read(text.replace(find, put).encode()).facts
    assert (facts.modular, facts.assignable) == (modular, None)


def test_default_sizes_of_sii_and_text():
    assert read(PDOS.encode()).facts.default_bytes == {2: 8, 3: 6}
    rows = [
        (0x1000, 128, 0x26, 1),
        (0x1080, 128, 0x22, 2),
        (0x1100, 9, 0x24, 3),
        (0x1180, 0, 0x20, 4),
    ]
    body = b"".join(struct.pack("<HHBBBB", s, n, c, 0, 1, use) for s, n, c, use in rows)
    assert read(image(category(41, body))).facts.default_bytes == {2: 9}


def test_plain_list_of_subdevices_is_known():
    assert find_format(SLAVES.encode(), Collector()).kind == "ethercat"
    assert find_format(b"3  5:0      SAFEOP+ERROR  E  x\n", Collector()).kind == "ethercat"
