"""FSN448 for a device of the library that maps no FSoE frame."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.project.check import check_files

DEVICE = """\
vendor_id: {vendor}
product_id: {product}
tpdo:
  - index: 0x1a00
{channels}
"""
STATUS = "    channels:\n      - {index: 0x6041, sub_index: 0, type: uint16}"
CIRCULO, EL1904, EL6900 = (0x22D2, 0x201), (2, 0x07703052), (2, 0x1AF43052)


def notes(tmp_path: Path, device: tuple[int, int], channels: str = STATUS) -> list[Severity]:
    path = tmp_path / "device.yaml"
    vendor, product = device
    path.write_text(DEVICE.format(vendor=vendor, product=product, channels=channels), "utf-8")
    found = check_files([str(path)], compared=True).diagnostics
    return [d.level for d in found if d.code == "FSN448"]


@pytest.mark.parametrize("device", [CIRCULO, EL1904])
def test_a_safe_device_without_a_frame_is_noted(device: tuple[int, int], tmp_path: Path):
    assert notes(tmp_path, device) == [Severity.INFO]


def test_a_safety_logic_can_be_without_connections(tmp_path: Path):
    assert notes(tmp_path, EL6900) == []


def test_an_unknown_device_or_mapping_is_accepted(tmp_path: Path):
    assert notes(tmp_path, (2, 3)) == []
    assert notes(tmp_path, EL1904, channels="    channels: []") == []
