"""SII images: round trip, and every way in which real ones are odd or damaged."""

from __future__ import annotations

import struct
from dataclasses import replace

import pytest
from data_files import listed, need
from described import described_devices
from formats.sii_image import category, image, image_of, strings
from hypothesis import given, settings
from hypothesis import strategies as st
from weekly import examples

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.sii.read import load_sii, read_sii, sii_checksum
from fsoe_net.model.bus import Direction


def load(data: bytes):
    out = Collector()
    description = load_sii(data, out, name="a.bin")
    assert all(d.hint for d in out.diagnostics)
    return description, out


def one(data: bytes):
    description, out = load(data)
    assert out.diagnostics == []
    assert not description.truncated
    (subdevice,) = description.subdevices
    return subdevice


def damaged(data: bytes) -> str:
    description, out = load(data)
    assert [d.code for d in out.diagnostics] == ["FSN138"]
    if description is not None:
        assert description.truncated
        assert description.subdevices[0].truncated
        assert description.subdevices[0].device.vendor_id == 0xA5F
    return out.diagnostics[0].message


MANAGERS = category(
    41,
    struct.pack("<HHBBBB", 0x1000, 128, 0x26, 0, 1, 1)
    + struct.pack("<HHBBBB", 0x1080, 128, 0x22, 0, 1, 2)
    + struct.pack("<HHBBBB", 0x1100, 6, 0x64, 0, 1, 3)
    + struct.pack("<HHBBBB", 0x1180, 6, 0x20, 0, 1, 4),
)


def pdo(index: int, sm: int, *bits: int, flags: int = 0) -> bytes:
    head = struct.pack("<HBBBBH", index, len(bits), sm, 0, 0, flags)
    rows = (struct.pack("<HBBBBH", 0x6000 + n, 1, 0, 5, b, 0) for n, b in enumerate(bits))
    return head + b"".join(rows)


@settings(max_examples=examples(80), deadline=None)
@given(described_devices(sdos=False), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF))
@pytest.mark.uncounted
def test_written_values_are_read_back(made, alias, serial):
    named = [p for sm in made.device.sync_managers for p in sm.pdos or ()]
    made = replace(made, alias=alias, serial=serial)
    found = one(image_of(made))
    pairs = [(sm.direction, len(sm.pdos)) for sm in made.device.sync_managers]
    assert [(sm.direction, len(sm.pdos)) for sm in found.device.sync_managers] == pairs
    assert len(named) == sum(n for _, n in pairs)
    assert found == replace(made, device=replace(made.device, path="a.bin"))


def test_identity_and_alias():
    found = one(image(identity=(2, 0x07703052, 0x120000, 9), alias=513))
    assert (found.device.vendor_id, found.device.product_code) == (2, 0x07703052)
    assert (found.revision, found.serial, found.alias) == (0x120000, 9, 513)


def test_pdos_without_a_sync_manager_and_virtual_ones_are_available():
    body = pdo(0x1A00, 3, 8, 16) + pdo(0x1A01, 0xFF, 8) + pdo(0x1A02, 3, 8, flags=0x20)
    found = one(image(MANAGERS, category(50, body)))
    assert [[p.index for p in sm.pdos] for sm in found.device.sync_managers] == [
        [],
        [],
        [],
        [0x1A00],
    ]
    assert [p.index for p in found.available] == [0x1A01, 0x1A02]
    assert "virtual" in found.notes[0]


def test_a_virtual_pdo_has_its_place_on_a_virtual_sync_manager():
    """The time register of an output terminal with oversampling, as its image has it."""
    sub = one(need("sii", "ethercrab_el2262.bin").read_bytes())
    clock = sub.device.sync_managers[2]
    assert [p.index for p in clock.pdos or ()] == [0x1702]
    assert (clock.start_byte, clock.direction) == (0x0998, Direction.INPUT)
    assert sub.available == ()
    assert sub.notes == ("of 4 clock modes the first is taken",)


def test_a_coe_device_without_pdos_is_reported():
    found = one(image(MANAGERS, protocols=4))
    assert "object dictionary" in found.notes[0]
    assert one(image(MANAGERS)).notes == ()


@pytest.mark.parametrize("size", [256, 2048, 131_070])
def test_sizes_and_what_is_after_the_end(size):
    assert one(image(MANAGERS, size=size)).device.sync_managers


def test_zero_length_and_unknown_categories_are_passed():
    data = image(category(1, b""), category(0x800, b"abcd"), category(20, b""), MANAGERS)
    assert len(one(data).device.sync_managers) == 4
    assert one(image(strings(), category(30, b""), category(50, b""))).name == ""


def test_zeros_after_the_last_category_end_it():
    assert one(image(MANAGERS, end=bytes(200))).device.sync_managers


def test_names_in_any_encoding():
    general = category(30, bytes([0, 0, 1, 2, 0, 0]))
    found = one(image(strings(b"EL\xb5", "Größe".encode()), general))
    assert (found.order, found.name) == ("ELµ", "Größe")
    padded = one(image(strings(b"ABC\0\0", b"\x01\x02x"), general))
    assert (padded.order, padded.name) == ("ABC", "x")
    assert one(image(strings(b"ABC\0DE", b"x"), general)).order == "ABC"
    assert one(image(strings(b"A"), general)).name == ""  # a number that names no string


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "too short"),
        (bytes(31), "too short"),
        (bytes(131_070), "nothing but 0x00"),
        (b"\xff" * 2048, "nothing but 0xff"),
        (image(identity=(0, 0, 0, 0)), "both 0"),
        (image(MANAGERS, end=b""), "without an end mark"),
        (image(end=b"")[:100], "without an end mark"),
        (image(MANAGERS)[:0x90], "category 41 at byte 0x80 has 16 words, 12 bytes are left"),
        (image(end=b"\x0a\x00"), "category 10"),
        (image(end=b"\x0a"), "without an end mark"),
        (image(end=bytes(40) + b"x"), "end in zeros"),
        (image(category(10, bytes([9]) + b"\x01a")), "promises 9 strings"),
        (image(category(10, bytes([1, 200]) + b"abc")), "string 1 is cut off"),
        (image(category(30, b"ab")), "category 30 at byte 0x80 is damaged: it is too short"),
        (image(category(41, bytes(10))), "multiple of 8"),
        (image(category(50, pdo(0x1A00, 0xFF, 8)[:-2])), "PDO 0x1a00 with 1 entry is cut off"),
        (image(category(50, pdo(0x1A00, 0xFF) + b"abcd")), "4 bytes are left over"),
        (image(category(50, bytes(8) + pdo(0x1A00, 0xFF))), "zeros follow"),
    ],
)
def test_damage_is_reported(data, message):
    assert message in damaged(data)


def test_text_is_not_an_image():
    description, out = load(
        b"this is a text and no image, it goes on and on and on until the end. " * 5
    )
    assert description is None
    assert [d.code for d in out.diagnostics] == ["FSN140"]


def test_wrong_checksum_is_a_warning():
    data = bytearray(image(MANAGERS))
    data[2] ^= 1
    description, out = load(bytes(data))
    assert description.subdevices[0].device.sync_managers
    assert [(d.code, d.level.value) for d in out.diagnostics] == [("FSN138", "warning")]


def test_shifted_image_is_recognised():
    _, out = load(b"\x01\x02" + image(MANAGERS))
    assert out.diagnostics[0].code == "FSN138"
    assert "byte 2" in out.diagnostics[0].hint


def test_repeated_sii_category_is_reported():
    _, out = load(image(MANAGERS, MANAGERS))
    assert [(d.code, d.level.value) for d in out.diagnostics] == [("FSN138", "warning")]
    body = category(50, pdo(0x1A00, 0xFF, 8))
    assert len(one(image(body, body)).available) == 2  # PDOs may be in several


@pytest.mark.parametrize(
    ("sm", "message"), [(0, "mailbox"), (2, "other direction"), (9, "does not set up")]
)
def test_pdos_on_wrong_sync_managers(sm, message):
    description, out = load(image(MANAGERS, category(50, pdo(0x1A00, sm, 8))))
    assert [d.code for d in out.diagnostics] == ["FSN139"]
    assert message in out.diagnostics[0].message
    (manager,) = [m for m in description.subdevices[0].device.sync_managers if m.index == sm]
    assert [p.index for p in manager.pdos] == [0x1A00]


def test_clock_modes_are_read_and_noted():
    mode = struct.pack("<3IhHhBB4x", 0, 0, 0, 0, 0x300, 0, 0, 0)
    out = Collector()
    data = image(category(40, b"\x01\x02\x03\xff"), category(60, mode + mode))
    found = read_sii(data, Span("a.bin"), out)
    assert found.assign_activate == (0x300, 0x300)
    assert "2 clock modes" in one(data).notes[0]


def test_checksum_begins_with_ff_and_has_polynomial_07():
    assert sii_checksum(b"") == 0xFF
    assert sii_checksum(b"\xff") == 0
    assert sii_checksum(b"\xfe") == 0x07
    assert sii_checksum(bytes([*range(13), sii_checksum(bytes(range(13)))])) == 0


@settings(max_examples=examples(200), deadline=None)
@given(st.binary(max_size=600), st.integers(0, 600))
def test_any_bytes_are_read_or_refused(noise, at):
    data = bytearray(image(strings(b"A"), MANAGERS, category(50, pdo(0x1A00, 3, 8))))
    data[at : at + len(noise)] = noise
    description, out = load(bytes(data))
    assert description is not None or out.diagnostics


@pytest.mark.parametrize("name", listed("sii", "*"))
def test_real_sii_image_is_read(name):
    out = Collector()
    description = load_sii(need("sii", name), out)
    found = description.subdevices[0]
    assert found.device.vendor_id
    broken = "null_strings" in name
    assert [d.code for d in out.diagnostics] == (["FSN138"] if broken else [])
    assert found.truncated is broken
    assert bool(found.name) is not broken
