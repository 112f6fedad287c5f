"""Type words: what is written is read back with the same length, whatever the type was called."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.slave_yaml import device_from_yaml, load_device
from fsoe_net.formats.own.type_words import _meant, type_bits
from fsoe_net.formats.own.write_slave_yaml import type_word, write_slave_yaml
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.yaml_tree import parse_yaml
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, SyncManager
from fsoe_net.model.type_words import DRIVER_WORD, TYPE_BITS

NAMES = sorted({*TYPE_BITS, *DRIVER_WORD})


def entry(name: str, bits: int, subindex: int = 1) -> Entry:
    return Entry(index=0x6000, subindex=subindex, bits=bits, type_name=name)


def test_every_name_leads_to_a_word_of_the_driver():
    assert set(DRIVER_WORD.values()) <= set(TYPE_BITS)
    assert not set(DRIVER_WORD) & set(TYPE_BITS)


@pytest.mark.parametrize("name", NAMES)
def test_each_type_is_written_by_its_own_word(name: str):
    word = DRIVER_WORD.get(name, name)
    for spelling in (name, name.upper()):
        assert type_word(entry(spelling, TYPE_BITS[word])) == word


@pytest.mark.parametrize("name", [*NAMES, "", "ARRAY [0..3] OF BYTE", "bit7", "DT0800EN08"])
def test_each_word_written_has_the_length_of_the_entry(name: str):
    for bits in range(1, 256):
        out = Collector()
        assert type_bits(type_word(entry(name, bits)), Span(""), out) == bits
        assert out.diagnostics == []


def test_a_device_with_every_type_is_read_back(tmp_path: Path):
    rows = [
        entry(name, TYPE_BITS[DRIVER_WORD.get(name, name)], subindex)
        for subindex, name in enumerate(NAMES, start=1)
    ]
    pdo = Pdo(index=0x1A00, entries=tuple(rows))
    device = Device(
        path="",
        vendor_id=2,
        product_code=3,
        tpdos=(pdo,),
        sync_managers=(SyncManager(index=3, direction=Direction.INPUT, carries="tpdo"),),
    )
    file = tmp_path / "device.yaml"
    file.write_text(write_slave_yaml(device, "device", []), "utf-8")
    network = load_network([str(file)]).network
    assert network is not None
    read = network.subdevices[0].device
    assert read is not None
    assert [(e.subindex, e.bits) for e in read.tpdos[0].entries] == [
        (e.subindex, e.bits) for e in rows
    ]


MASKED = """\
vendor_id: 2
product_id: 3
rpdo:
  - index: 0x1600
    channels:
      - {{index: 0x7000, sub_index: 1, type: uint8{first}}}
      - {{index: 0x7000, sub_index: 1, type: uint8{second}}}
"""


@pytest.mark.parametrize(
    ("first", "second", "stated"),
    [
        ("", "", ""),
        (", mask: 1", "", '{"mask":{"0x7000:01":[1,null]}}'),
        ("", ", mask: 1", '{"mask":{"0x7000:01":[null,1]}}'),
        (", mask: 1", ", mask: 2", '{"mask":{"0x7000:01":[1,2]}}'),
    ],
)
def test_each_mask_of_an_entry_that_is_mapped_twice_is_kept(first: str, second: str, stated: str):
    out = Collector()
    root = parse_yaml(MASKED.format(first=first, second=second).encode(), "x.yaml", out)
    assert root is not None
    device = device_from_yaml(root, "x.yaml", out)
    assert device is not None
    assert device.driver == stated


@pytest.mark.parametrize(
    ("word", "value", "hint"),
    [
        ("uint32", 0x80000000, "write -2147483648, the same bytes"),
        ("uint32", 0xFFFFFFFF, "write -1, the same bytes"),
        ("uint32", 0x7FFFFFFF, None),
        ("uint64", 0x80000000, ""),
        ("uint64", 2**64 - 1, ""),
    ],
)
def test_a_value_that_the_driver_cannot_read_has_another_spelling(
    word: str, value: int, hint: str | None
):
    text = (
        "vendor_id: 2\nproduct_id: 3\nsdo:\n"
        f"  - {{index: 0x8000, sub_index: 1, type: {word}, value: {value}}}\n"
    )
    out = Collector()
    root = parse_yaml(text.encode(), "d.yaml", out)
    assert root is not None
    device_from_yaml(root, "d.yaml", out)
    found = [(d.hint, d.span.column) for d in out.diagnostics if d.code == "FSN418"]
    assert found == ([] if hint is None else [(hint, text.splitlines()[3].index("value") + 8)])


def test_a_file_that_is_named_as_a_slave_yaml_and_is_none(tmp_path: Path):
    file = tmp_path / "bus.yaml"
    file.write_text("a: 1\nb: 2\nc: 3\nd: 4\ne: 5\nf: 6\n", "utf-8")
    out = Collector()
    assert load_device(file, out, named_at=Span("network.yaml", 7, 3)) is None
    (said,) = out.diagnostics
    assert (said.code, str(said.span)) == ("FSN140", "network.yaml:7:3")
    assert said.message == f"{str(file)!r} is not a slave YAML; its keys are: a, b, c, d, e"


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("BIT12", ("bit12",)),
        ("bits 7", ("bit7",)),
        ("gap_3", ("bit3",)),
        ("pad5", ("bit5",)),
        ("255", ("bit255",)),
        ("16 bits", ("bit16",)),
        ("256", ()),
        ("UINT16", ("uint16",)),
        ("INT", ("int16",)),  # of IEC 61131-3
        ("int", ("int16", "int32")),  # that one, or the one of C
        ("unit16", ("uint16",)),
        ("uint16_t", ("uint16",)),
        ("uint16_le", ("uint16",)),
        ("uint12", ()),
        ("int24", ()),
        ("zzz", ()),
    ],
)
def test_the_types_that_a_word_may_mean(word: str, meant: tuple[str, ...]):
    assert _meant(word) == meant


@pytest.mark.parametrize("word", ["uint16_be", "uint16be", "float-swapped", "UINT32 big endian"])
def test_a_big_endian_type_is_not_replaced_silently(word: str):
    out = Collector()
    bits = type_bits(word, Span("x"), out)
    assert bits in (16, 32)
    (found,) = out.diagnostics
    assert "exchange the bytes" in found.hint


@pytest.mark.parametrize("word", ["uint16_rev", "be_uint16", "int16_bcd", "float-gray"])
def test_a_type_with_one_more_part_is_not_replaced(word: str):
    out = Collector()
    assert type_bits(word, Span("x"), out) in (16, 32)
    (found,) = out.diagnostics
    assert found.hint.startswith("look up the coding of its bytes")


@pytest.mark.parametrize("key", ["complete_access", "value_hex"])
def test_a_key_of_forks_is_named_as_one(key: str):
    out = Collector()
    text = f"vendor_id: 1\nproduct_id: 2\nsdo: [{{index: 1, sub_index: 1, type: int8, {key}: 1}}]\n"
    root = parse_yaml(text.encode(), "x.yaml", out)
    assert root is not None
    device_from_yaml(root, "x.yaml", out)
    rows = {d.code: (d.level, d.hint) for d in out.diagnostics}
    level, hint = rows.pop("FSN109")
    assert level is Severity.WARNING
    assert "forks of ethercat_driver_ros2" in hint
    assert "FSN110" in rows  # the driver itself finds no value


def test_the_length_of_a_type_that_may_be_two_is_not_known():
    out = Collector()
    assert type_bits("int", Span("x"), out) is None
    assert [d.hint for d in out.diagnostics] == ["write int16 or int32"]


OUTPUTS = """\
vendor_id: 2
product_id: 3
rpdo:
  - index: 0x1600
    channels:
      - {index: 0x7000, sub_index: 1, type: uint8, default: 5}
      - {index: 0x7000, sub_index: 2, type: uint8, command_interface: speed, default: 5}
tpdo:
  - index: 0x1a00
    channels:
      - {index: 0x6000, sub_index: 1, type: uint8, default: 5}
"""


def test_a_default_is_written_with_an_interface_that_binds_nothing():
    """Versions of the driver of 2025 read no default without one, and refuse one of an input."""
    out = Collector()
    root = parse_yaml(OUTPUTS.encode(), "x.yaml", out)
    assert root is not None
    device = device_from_yaml(root, "x.yaml", out)
    assert device is not None
    rows = [line for line in write_slave_yaml(device, "x", []).splitlines() if "default" in line]
    assert [("command_interface: ~" in row, "speed" in row) for row in rows] == [
        (True, False),
        (False, True),
        (False, False),
    ]


@pytest.mark.parametrize(
    ("key", "value", "stated"),
    [
        ("auto_fault_reset", "true", '{"auto_fault_reset":true}'),
        ("auto_fault_reset", "off", ""),  # as when the key is missing
        ("auto_state_transitions", "n", '{"auto_state_transitions":false}'),
        ("auto_state_transitions", "Yes", ""),
    ],
)
def test_a_switch_of_the_driver_is_kept_where_it_differs_from_an_absent_one(
    key: str, value: str, stated: str
):
    out = Collector()
    root = parse_yaml(f"vendor_id: 2\nproduct_id: 3\n{key}: {value}\n".encode(), "x.yaml", out)
    assert root is not None
    device = device_from_yaml(root, "x.yaml", out)
    assert device is not None
    assert (device.driver, out.diagnostics) == (stated, [])


def test_the_name_of_a_pdo_is_a_comment():
    pdo = Pdo(index=0x1A00, entries=(entry("USINT", 8),), name="FSoE\ninputs")
    manager = SyncManager(index=3, direction=Direction.INPUT, pdos=(pdo,))
    device = Device(path="", vendor_id=1, product_code=2, sync_managers=(manager,))
    text = write_slave_yaml(device, "x", [])
    assert "  - index: 0x1a00   # FSoE inputs\n" in text
