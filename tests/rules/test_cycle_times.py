"""FSN488: a cycle time in a start-up SDO against that of the bus."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.project.check import check_files

DRIVE = """\
vendor_id: 2
product_id: 3
sdo:
{sdo}
rpdo:
  - index: 0x1600
    channels:
      - {{index: 0x6040, sub_index: 0, type: uint16}}
tpdo:
  - index: 0x1a00
    channels:
      - {{index: 0x6041, sub_index: 0, type: uint16}}
"""
NETWORK = """\
version: 1
name: cell
cycle_us: {cycle}
subdevices:
  - {{name: drive, position: 0, config: drive.yaml}}
"""


def row(index: str, subindex: int, value: int) -> str:
    return f"  - {{index: {index}, sub_index: {subindex}, type: int32, value: {value}}}"


def found(tmp_path: Path, sdo: list[str], cycle_us: int) -> list[Diagnostic]:
    (tmp_path / "drive.yaml").write_text(DRIVE.format(sdo="\n".join(sdo)), "utf-8")
    network = tmp_path / "network.yaml"
    network.write_text(NETWORK.format(cycle=cycle_us), "utf-8")
    return [d for d in check_files([str(network)]).diagnostics if d.code == "FSN488"]


def lines(tmp_path: Path, sdo: list[str], cycle_us: int) -> list[int]:
    return [d.span.line for d in found(tmp_path, sdo, cycle_us)]


TWO_MS = [row("0x60c2", 1, 2), row("0x60c2", 2, -3)]


@pytest.mark.parametrize(
    ("sdo", "cycle_us"),
    [
        (TWO_MS, 2000),
        (TWO_MS, 2010),  # within 1 %
        ([row("0x60c2", 1, 4)], 4000),  # milliseconds by default
        ([row("0x60c2", 1, 25), row("0x60c2", 2, -5)], 250),
        ([row("0x60c2", 2, -3)], 1000),
        ([row("0x60c2", 1, 2), row("0x60c2", 2, 99)], 1000),
        ([row("0x60c2", 1, 0)], 1000),
        ([row("0x1c32", 2, 1_000_000)], 1000),
        ([row("0x1c32", 2, 0)], 1000),
        ([row("0x1c32", 1, 2)], 1000),
        ([row("0x68c2", 1, 2)], 1000),  # of a second axis, which is not there
    ],
)
def test_the_time_of_the_bus_is_accepted(sdo: list[str], cycle_us: int, tmp_path: Path):
    assert lines(tmp_path, sdo, cycle_us) == []


@pytest.mark.parametrize(
    ("sdo", "cycle_us", "line"),
    [
        (TWO_MS, 1000, 4),
        (TWO_MS, 2050, 4),
        (list(reversed(TWO_MS)), 1000, 5),
        ([row("0x60c2", 1, 25), row("0x60c2", 2, -5)], 1000, 4),
        ([row("0x1c33", 2, 2_000_000)], 1000, 4),
    ],
)
def test_another_time_is_named_at_its_value(
    sdo: list[str], cycle_us: int, line: int, tmp_path: Path
):
    assert lines(tmp_path, sdo, cycle_us) == [line]


@pytest.mark.parametrize(
    ("sdo", "cycle_us", "word"),
    [
        (TWO_MS, 4000, "4"),
        ([row("0x60c2", 1, 25), row("0x60c2", 2, -5)], 500, "50"),
        ([row("0x1c32", 2, 2_000_000)], 1000, "1000000"),
        (TWO_MS, 250, "exponent"),
    ],
)
def test_the_hint_has_the_value_in_the_unit_of_the_object(
    sdo: list[str], cycle_us: int, word: str, tmp_path: Path
):
    (one,) = found(tmp_path, sdo, cycle_us)
    assert word in (one.hint or "").split()


def test_two_masters_of_a_urdf_have_cycles_of_their_own(tmp_path: Path):
    (tmp_path / "drive.yaml").write_text(DRIVE.format(sdo="\n".join(TWO_MS)), "utf-8")
    block = """<ros2_control name="m{n}" type="system"><hardware>
<plugin>ethercat_driver/EthercatDriver</plugin><param name="master_id">{n}</param>
<param name="control_frequency">{hz}</param></hardware><joint name="j{n}"><ec_module name="d{n}">
<plugin>ethercat_generic_plugins/GenericEcSlave</plugin><param name="position">0</param>
<param name="slave_config">drive.yaml</param></ec_module></joint></ros2_control>"""
    path = tmp_path / "r.urdf"
    blocks = [block.format(n=0, hz=500), block.format(n=1, hz=1000)]
    path.write_text(f'<robot name="r">{"".join(blocks)}</robot>', "utf-8")
    assert "FSN488" not in [d.code for d in check_files([str(path)]).diagnostics]
    path.write_text(f'<robot name="r">{blocks[1]}</robot>', "utf-8")
    assert "FSN488" in [d.code for d in check_files([str(path)]).diagnostics]
