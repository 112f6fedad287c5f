"""Output of `ethercat sii_read -v`: the devices of the image, and every damage named."""

from __future__ import annotations

import pytest
from data_files import listed, need
from formats.sii_image import category, image, printed, strings
from formats.texts import SII_V

from fsoe_net.formats.igh.read import load_igh_text
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.sii.hex_text import binary_of, is_hex_text
from fsoe_net.formats.sii.read import load_sii
from fsoe_net.model.description import DescribedSubDevice, Description

IMAGE = image(strings(b"EK1914"), category(30, bytes([0, 0, 0, 1]) + bytes(28)))
TEXT = printed(IMAGE)


def load(text: str) -> tuple[Description | None, list[str]]:
    out = Collector()
    found = load_igh_text(text.encode(), out, name="paste.txt")
    assert all(d.hint for d in out.diagnostics)
    return found, [f"{d.code} {d.span}: {d.message}" for d in out.diagnostics]


def facts(sub: DescribedSubDevice) -> tuple:
    device = sub.device
    assert device is not None
    managers = [
        (m.index, m.direction, m.start_byte, [(p.index, p.entries) for p in m.pdos or ()])
        for m in device.sync_managers
    ]
    available = [(p.index, len(p.entries)) for p in sub.available]
    identity = (device.vendor_id, device.product_code, sub.revision, sub.serial, sub.alias)
    return identity, sub.name, sub.order, device.assign_activate, managers, available, sub.truncated


# The tool stops in the image that is damaged on purpose.
@pytest.mark.parametrize("name", [n for n in listed("sii", "*") if "null_strings" not in n])
def test_printed_image_gives_the_device_of_the_image(name: str):
    data = need("sii", name).read_bytes()
    data = binary_of(data) if is_hex_text(data[:256]) else data
    out = Collector()
    image_read = load_sii(data, out, name=name)
    assert image_read is not None
    text_read, found = load(printed(data))
    assert text_read is not None
    assert text_read.format == "ethercat-sii"
    assert [facts(s) for s in text_read.subdevices] == [facts(s) for s in image_read.subdevices]
    assert [f.split(" ")[0] for f in found] == [d.code for d in out.diagnostics]


def test_output_of_the_tool():
    found, said = load(SII_V)
    assert said == []
    assert found is not None
    (sub,) = found.subdevices
    assert facts(sub)[:4] == ((2, 0x077A2C52, 0, 0, 0), "ek1914", "ek1914", 0)
    assert sub.device is not None
    assert [
        (m.index, m.start_byte, [p.index for p in m.pdos or ()]) for m in sub.device.sync_managers
    ] == [
        (0, 0x1000, []),
        (1, 0x1080, []),
        (2, 0x1100, [0x1600, 0x1601]),
        (3, 0x1110, [0x1A00, 0x1A01]),
    ]


def test_several_devices_in_a_row():
    other = printed(image(strings(b"EL1918"), category(30, bytes([0, 0, 0, 1]) + bytes(28))))
    found, said = load(TEXT + other)
    assert said == []
    assert found is not None
    assert [s.name for s in found.subdevices] == ["EK1914", "EL1918"]
    assert not found.truncated


LINES = TEXT.splitlines()
GENERAL = 11  # number of the line of the category after the strings, from 0


@pytest.mark.parametrize(
    ("changes", "said", "names"),
    [
        ({}, [], ["EK1914"]),
        (
            {8: "  00 00"},
            ["FSN147 paste.txt:10:1: the SII area has 114 of 128 bytes before this line"],
            [],
        ),
        (
            {9: "SII Category 0x000a (STRINGS), 5 words"},
            ["FSN147 paste.txt:12:1: category 0x000a has 8 of 10 bytes before this line"],
            [""],
        ),
        (
            {9: "SII Category 0x000a (STRINGS), 3 words"},
            ["FSN147 paste.txt:12:1: category 0x000a has 8 of 6 bytes before this line"],
            [""],
        ),
        (
            {10: "  01 06 45 4b 31 39 31 3x"},
            ["FSN147 paste.txt:12:1: category 0x000a has 0 of 8 bytes before this line"],
            [""],
        ),
        (
            {GENERAL: "SII Category 0x001e (General), 65536 words"},
            [
                "FSN147 paste.txt:12:1: 'SII Category 0x001e (General), 65536 words' is not a line "
                "of `ethercat sii_read -v`",
                "FSN146 paste.txt:14:3: the text is cut off: category 0x000a has 40 of 8 bytes; "
                "line 14 is the last good one",
            ],
            [""],
        ),
        (
            {13: "  00 00"},
            [
                "FSN146 paste.txt:14:3: the text is cut off: category 0x001e has 18 of 32 bytes; "
                "line 14 is the last good one"
            ],
            [""],
        ),
        (
            {13: "  00 0"},
            [
                "FSN146 paste.txt:14:3: the text is cut off: '00 0' is not a whole line; "
                "line 13 is the last good one"
            ],
            [""],
        ),
    ],
)
def test_damaged_part_is_named_and_left_out(
    changes: dict[int, str], said: list[str], names: list[str]
):
    lines = [changes.get(n, line) for n, line in enumerate(LINES)]
    found, findings = load("\n".join(lines) + "\n")
    assert findings == said
    assert found is not None
    assert [s.name for s in found.subdevices] == names
    assert all(s.truncated == bool(said) for s in found.subdevices)


def test_bytes_before_the_first_area_are_noise():
    found, said = load("00 01\nSII Category 0x000a (STRINGS), 4 words\n" + TEXT)
    assert said == []
    assert found is not None
    assert [s.name for s in found.subdevices] == ["EK1914"]
