"""FSN489: PDO assignment and mapping by start-up SDOs against rpdo and tpdo."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.project.check import check_files

DEVICE = """\
vendor_id: 2
product_id: 3
sdo:
{sdo}
rpdo:
  - index: 0x1600
    channels:
      - {{index: 0x7000, sub_index: 1, type: uint16}}
      - {{index: 0x0000, sub_index: 0, type: bit8}}
  - index: 0x1601
    channels:
      - {{index: 0x9000, sub_index: 2, type: int32}}
tpdo:
  - {{index: 0x1a00}}
"""


def row(index: int, subindex: int, value: int, kind: str = "uint32") -> str:
    return f"  - {{index: {index:#x}, sub_index: {subindex}, type: {kind}, value: {value}}}"


def lines(tmp_path: Path, sdo: list[str]) -> list[int]:
    path = tmp_path / "device.yaml"
    path.write_text(DEVICE.format(sdo="\n".join(sdo)), "utf-8")
    return [d.span.line for d in check_files([str(path)]).diagnostics if d.code == "FSN489"]


ALIKE = {
    "cleared and filled with the same PDOs": [
        row(0x1C12, 0, 0),
        row(0x1C12, 1, 0x1600),
        row(0x1C12, 2, 0x1601),
        row(0x1C12, 0, 2),
    ],
    "the same entries": [row(0x1600, 1, 0x70000110), row(0x1600, 2, 8), row(0x1600, 0, 2)],
    "the same bytes as a negative number": [row(0x1601, 1, 0x90000220 - 2**32, "int32")],
    "other objects": [row(0x1C32, 1, 2), row(0x8000, 0, 9), row(0x1602, 0, 0)],
    "a mapping of the device": [row(0x1A00, 1, 0x60000110), row(0x1A00, 0, 1)],
    "entries after the last one": [row(0x1C12, 3, 0x1699)],
}


@pytest.mark.parametrize("name", ALIKE)
def test_sdos_of_the_same_pdos_are_accepted(name: str, tmp_path: Path):
    assert lines(tmp_path, ALIKE[name]) == []


OTHERS = {
    "another number of PDOs": ([row(0x1C12, 0, 0), row(0x1C12, 0, 1)], 5),
    "another order": ([row(0x1C12, 1, 0x1601), row(0x1C12, 2, 0x1600)], 4),
    "inputs that are cleared": ([row(0x1C13, 0, 0)], 4),
    "another length": ([row(0x1600, 1, 0x70000108)], 4),
    "another entry": ([row(0x1600, 1, 0x70000110), row(0x1600, 2, 0x70000208)], 5),
}


@pytest.mark.parametrize("name", OTHERS)
def test_the_first_difference_of_a_list_is_named(name: str, tmp_path: Path):
    sdo, line = OTHERS[name]
    assert lines(tmp_path, sdo) == [line]
