"""FSN490: limits of a joint in increments of its drive."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.project.check import check_files

DRIVE = """\
vendor_id: 2
product_id: 3
rpdo:
  - index: 0x1600
    channels:
      - {{index: 0x6040, sub_index: 0, type: uint16}}
      - {{index: {target}, sub_index: 0, type: {type}, command_interface: position{scale}}}
tpdo:
  - index: 0x1a00
    channels:
      - {{index: 0x6041, sub_index: 0, type: uint16}}
"""
ROBOT = """\
<robot name="r"><joint name="a" type="{kind}">{limit}</joint>
<ros2_control name="s" type="system">
<hardware><plugin>ethercat_driver/EthercatDriver</plugin></hardware>
<{component} name="a"><command_interface name="{command}"/><ec_module name="m">
<plugin>ethercat_generic_plugins/GenericEcSlave</plugin><param name="position">0</param>
<param name="slave_config">drive.yaml</param></ec_module></{component}>{more}
</ros2_control></robot>
"""
LIMIT = '<limit lower="-3.14" upper="3.14"/>'
DEFAULTS = {
    "target": "0x607a",
    "type": "int32",
    "scale": "",
    "kind": "revolute",
    "limit": LIMIT,
    "component": "joint",
    "command": "position",
    "more": "",
}


def lines(tmp_path: Path, **changes: str) -> list[int]:
    values = DEFAULTS | changes
    (tmp_path / "drive.yaml").write_text(DRIVE.format(**values), "utf-8")
    path = tmp_path / "r.urdf"
    path.write_text(ROBOT.format(**values), "utf-8")
    return [d.span.line for d in check_files([str(path)]).diagnostics if d.code == "FSN490"]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"scale": ", factor: 3"},  # 18.84 increments
        {"scale": ", factor: -3"},
        {"kind": "prismatic", "limit": '<limit upper="0.5"/>'},
        {"scale": ", factor: 684000000"},  # 3.14 times it is just above 2 ** 31
        {"type": "int16", "scale": ", factor: 20861"},
        {"type": "uint32", "scale": ", factor: 20861"},
        {"scale": ", factor: 20861, offset: 2147483647"},
    ],
)
def test_limits_that_the_command_cannot_express_are_named(changes: dict[str, str], tmp_path: Path):
    assert lines(tmp_path, **changes) == [7]


@pytest.mark.parametrize(
    "changes",
    [
        {"scale": ", factor: 20861"},
        {"scale": ", factor: -20861"},
        {"scale": ", factor: 4"},  # 25.12 increments
        {"scale": ", factor: 683900000"},
        {"type": "float"},
        {"kind": "continuous"},
        {"limit": ""},
        {"limit": '<limit effort="1"/>'},
        {"limit": '<limit lower="a" upper="3"/>'},
        {"limit": '<limit lower="3" upper="-3"/>'},
        {"limit": '<limit lower="-inf" upper="inf"/>'},
        {"component": "gpio"},
        {"command": "velocity"},
        {"target": "0x7000"},
        {"target": "0x687a"},  # of a second axis, which is not there
        {"scale": ", factor_from_sdo: {index: 0x608f, sub_index: 1}"},
        {"more": "<transmission/>"},
    ],
)
def test_other_joints_and_channels_are_accepted(changes: dict[str, str], tmp_path: Path):
    assert lines(tmp_path, **changes) == []
