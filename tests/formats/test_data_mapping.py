"""Items of ``data_mapping``: each is a run of bits inside its channel, or is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.formats.own.slave_yaml import load_device
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import EntryView

SLAVE = """vendor_id: 2
product_id: 3
tpdo:
  - index: 0x1a00
    channels:
      - {index: 0x6000, sub_index: 1, type: uint32, data_mapping: [%s]}
"""


def _read(item: str, folder: Path) -> tuple[tuple[EntryView, ...], list[tuple[str, int, str]]]:
    file = folder / "device.yaml"
    file.write_text(SLAVE % item, "utf-8")
    out = Collector()
    device = load_device(file, out)
    assert device is not None
    text = SLAVE % item
    at = [(d.code, d.span.line, text.splitlines()[5][d.span.column - 1 :]) for d in out.diagnostics]
    return device.tpdos[0].entries[0].views, at


@pytest.mark.parametrize(
    ("item", "bit", "bits"),
    [
        ("{type: uint32}", 0, 32),
        ("{type: uint16, addr_offset: 2}", 16, 16),
        ("{type: uint8, addr_offset: 3, mask: 0xf0}", 28, 4),
        ("{type: uint8, mask: 0xff}", 0, 8),
        ("{type: bool, addr_offset: 3, mask: 0x80}", 31, 1),
        ("{type: bit3}", 0, 3),
        ("{type: uint16, mask: 5}", 0, 16),  # a mask is for one byte
    ],
)
def test_an_item_inside_its_channel(item: str, bit: int, bits: int, tmp_path: Path):
    views, found = _read(item, tmp_path)
    assert found == []
    assert [(v.bit, v.bits) for v in views] == [(bit, bits)]


@pytest.mark.parametrize(
    ("item", "code", "at"),
    [
        ("{type: uint64}", "FSN422", "uint64"),
        ("{type: uint16, addr_offset: 3}", "FSN422", "3}"),
        ("{type: uint8, addr_offset: 4}", "FSN422", "4}"),
        ("{type: uint8, addr_offset: 65535}", "FSN422", "65535}"),
        ("{type: uint8, mask: 5}", "FSN422", "5}"),
        ("{type: uint8, mask: 0}", "FSN422", "0}"),
        ("{state_interface: a}", "FSN404", "{state"),
        ("{type: nonsense}", "FSN402", "nonsense}"),
    ],
)
def test_an_item_that_is_not_a_value_is_named_at_its_key(
    item: str, code: str, at: str, tmp_path: Path
):
    views, found = _read(item, tmp_path)
    assert views == ()
    assert [(c, line) for c, line, _ in found] == [(code, 6)]
    assert found[0][2].startswith(at)


@pytest.mark.parametrize(
    ("item", "code"),
    [
        ("{type: bool}", "FSN405"),
        ("{type: bool, mask: 3}", "FSN405"),
        ("{type: bool, mask: 0}", "FSN405"),
        ("{type: bit12}", "FSN427"),
    ],
)
def test_an_item_the_driver_reads_otherwise_is_named_and_kept(item: str, code: str, tmp_path: Path):
    views, found = _read(item, tmp_path)
    assert len(views) == 1
    assert [c for c, _, _ in found] == [code]


def test_one_wrong_item_does_not_take_the_others_along(tmp_path: Path):
    views, found = _read("{type: uint16}, {type: uint32, addr_offset: 2}, {type: bit4}", tmp_path)
    assert [(v.bit, v.bits) for v in views] == [(0, 16), (0, 4)]
    assert [c for c, _, _ in found] == ["FSN422"]
