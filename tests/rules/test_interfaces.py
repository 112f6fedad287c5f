"""FSN476, FSN481, FSN482: interfaces of a robot and the channels of its SubDevices."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.project.check import check_files

GENERIC = "ethercat_generic_plugins/GenericEcSlave"
DRIVE = "ethercat_generic_plugins/EcCiA402Drive"
VENDOR = "ethercat_plugins/Beckhoff_EL2008"
ROBOT = """<robot name="r"><ros2_control name="s" type="system">
<hardware><plugin>ethercat_driver/EthercatDriver</plugin></hardware>
{components}
</ros2_control></robot>
"""
MODULE = """<ec_module name="{name}"><plugin>{plugin}</plugin>
<param name="position">{position}</param><param name="slave_config">{config}</param>
<param name="mode_of_operation">8</param></ec_module>
"""
FILES = {
    "axis.yaml": """\
vendor_id: 2
product_id: 3
rpdo:
  - index: 0x1600
    channels:
      - {index: 0x607a, sub_index: 0, type: int32, command_interface: position}
      - {index: 0x6040, sub_index: 0, type: uint16}
tpdo:
  - index: 0x1a00
    channels:
      - {index: 0x6064, sub_index: 0, type: int32, state_interface: position}
      - {index: 0x6061, sub_index: 0, type: int8}
""",
    "two.yaml": """\
vendor_id: 2
product_id: 3
rpdo:
  - index: 0x1600
    for: a
    channels:
      - {index: 0x7000, sub_index: 1, type: int32, command_interface: speed}
tpdo:
  - index: 0x1a00
    for: b
    channels:
      - {index: 0x6000, sub_index: 1, type: int32, state_interface: speed}
""",
    "targets.yaml": """\
vendor_id: 2
product_id: 3
rpdo:
  - index: 0x1600
    channels:
      - {index: 0x6040, sub_index: 0, type: uint16, command_interface: control}
      - {index: 0x607a, sub_index: 0, type: int32, command_interface: position}
      - {index: 0x60ff, sub_index: 0, type: int32, command_interface: speed, default: .nan}
      - {index: 0x6071, sub_index: 0, type: int16, command_interface: effort, default: 0}
tpdo:
  - index: 0x1a00
    channels:
      - {index: 0x6041, sub_index: 0, type: uint16}
      - {index: 0x6064, sub_index: 0, type: int32, state_interface: position}
      - {index: 0x6061, sub_index: 0, type: int8}
""",
    "alike.yaml": """\
vendor_id: 2
product_id: 3
rpdo:
  - index: 0x1600
    channels:
      - {index: 0x7000, sub_index: 1, type: int32, command_interface: speed}
      - {index: 0x7010, sub_index: 1, type: int32, command_interface: speed}
tpdo:
  - index: 0x1a00
    channels:
      - {index: 0x6000, sub_index: 1, type: int32, state_interface: speed}
      - {index: 0x6010, sub_index: 1, type: int32, state_interface: speed}
""",
    "bits.yaml": """\
vendor_id: 2
product_id: 3
tpdo:
  - index: 0x1a00
    channels:
      - index: 0x6000
        sub_index: 1
        type: uint8
        data_mapping:
          - {type: bool, addr_offset: 0, mask: 1, state_interface: low}
          - {type: bool, addr_offset: 0, mask: 2, state_interface: high}
""",
}


def module(config: str, position: int = 0, plugin: str = GENERIC, name: str = "") -> str:
    return MODULE.format(
        name=name or f"m{position}", plugin=plugin, position=position, config=config
    )


def component(
    inside: str, *, states: str = "", commands: str = "", name: str = "a", kind: str = "joint"
) -> str:
    rows = [
        f'<{side}_interface name="{n}"/>'
        for side, names in (("state", states), ("command", commands))
        for n in names.split()
    ]
    return f'<{kind} name="{name}">\n' + "\n".join([*rows, inside]) + f"</{kind}>"


# Interfaces that a hint may name.
NAMES = ("position", "effort", "low", "high", "speed")


def found(
    tmp_path: Path, components: str, code: str = "FSN476"
) -> list[tuple[int, list[str], list[str]]]:
    """Return line, names in the hint and further files of each finding."""
    return [
        (
            d.span.line,
            [word for word in NAMES if word in (d.hint or "").split()],
            [Path(r.span.file).name for r in d.related],
        )
        for d in findings(tmp_path, components)
        if d.code == code
    ]


def findings(tmp_path: Path, components: str) -> list[Diagnostic]:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, "utf-8")
    path = tmp_path / "r.urdf"
    path.write_text(ROBOT.format(components=components), "utf-8")
    return list(check_files([str(path)]).diagnostics)


ACCEPTED = {
    "the same names": component(module("axis.yaml"), states="position", commands="position"),
    "fewer than there are": component(module("axis.yaml"), states="position"),
    "the plugin for drives resets faults": component(
        module("axis.yaml", plugin=DRIVE), commands="position reset_fault"
    ),
    "another plugin has names of its own": component(
        module("axis.yaml", plugin=VENDOR), commands="d_output.1"
    ),
    "one of two modules": component(
        module("axis.yaml") + module("bits.yaml", 1), states="position high", kind="gpio"
    ),
    "items of a mapping": component(module("bits.yaml"), states="low high", kind="sensor"),
    "a description that cannot be read": component(module("none.yaml"), states="high"),
    "each joint its own": component(module("two.yaml", name="m"), commands="speed")
    + component(module("two.yaml", name="m"), states="speed", name="b"),
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_interfaces_that_are_provided_or_not_known_are_accepted(name: str, tmp_path: Path):
    assert found(tmp_path, ACCEPTED[name]) == []


def test_a_misspelt_interface_is_named_at_both_ends(tmp_path: Path):
    row = component(module("axis.yaml"), states="position", commands="positon")
    assert found(tmp_path, row) == [
        (5, ["position"], ["axis.yaml"]),
    ]


def test_an_interface_without_a_similar_one_is_named_with_those_that_are_free(tmp_path: Path):
    rows = found(tmp_path, component(module("bits.yaml"), states="low effort", kind="gpio"))
    assert rows == [(5, ["effort"], ["bits.yaml"])]


def test_a_command_is_not_provided_by_a_state(tmp_path: Path):
    rows = found(tmp_path, component(module("bits.yaml"), commands="low"))
    assert [row[:2] for row in rows] == [(4, ["low"])]


def test_reset_fault_of_another_plugin_is_a_name_like_others(tmp_path: Path):
    rows = found(tmp_path, component(module("axis.yaml"), commands="position reset_fault"))
    assert [line for line, *_ in rows] == [5]


def test_channels_for_another_joint_do_not_count(tmp_path: Path):
    both = component(module("two.yaml", name="m"), states="speed", commands="speed")
    both += component(module("two.yaml", name="m"), states="speed", commands="speed", name="b")
    assert [line for line, *_ in found(tmp_path, both)] == [4, 11]


def test_commands_that_nothing_writes_are_named_once_for_a_subdevice(tmp_path: Path):
    assert [row[0] for row in found(tmp_path, component(module("targets.yaml")), "FSN481")] == [6]
    with_speed = component(module("targets.yaml"), commands="control speed")
    assert [row[0] for row in found(tmp_path, with_speed, "FSN481")] == [7]


def test_outputs_of_the_drive_plugin_need_no_command(tmp_path: Path):
    rows = found(tmp_path, component(module("targets.yaml", plugin=DRIVE)), "FSN481")
    assert [line for line, *_ in rows] == [8]


UNBOUND = {
    "all have a command or a default": component(
        module("targets.yaml"), commands="control position speed"
    ),
    "another plugin has names of its own": component(module("targets.yaml", plugin=VENDOR)),
    "a misspelt command is named once": component(
        module("targets.yaml"), commands="control position sped"
    ),
    "a command of the other joint": component(module("two.yaml", name="m"), commands="speed")
    + component(module("two.yaml", name="m"), name="b"),
}


@pytest.mark.parametrize("name", UNBOUND)
def test_outputs_with_a_value_are_accepted(name: str, tmp_path: Path):
    assert found(tmp_path, UNBOUND[name], "FSN481") == []


def test_a_channel_for_a_joint_that_does_not_request_it_has_no_command(tmp_path: Path):
    both = component(module("two.yaml", name="m"), name="a")
    both += component(module("two.yaml", name="m"), commands="speed", name="b")
    assert [line for line, *_ in found(tmp_path, both, "FSN481")] == [7]


def test_an_interface_of_several_channels_is_named_at_the_second(tmp_path: Path):
    row = component(module("alike.yaml"), commands="speed", states="speed")
    assert found(tmp_path, row, "FSN482") == [(7, [], ["alike.yaml"]), (12, [], ["alike.yaml"])]


PAIRS = {"joint": Severity.INFO, "gpio": Severity.WARNING}


@pytest.mark.parametrize("kind", PAIRS)
def test_two_drives_can_move_one_joint(kind: str, tmp_path: Path):
    pair = component(module("axis.yaml") + module("axis.yaml", 1), states="position", kind=kind)
    rows = [d for d in findings(tmp_path, pair) if d.code == "FSN482"]
    assert [(d.level, d.span.line) for d in rows] == [(PAIRS[kind], 11)]


OWN_HARDWARE = ("ethercat_driver/EthercatDriver", "fsoe_net_ros/EthercatDriver")


@pytest.mark.parametrize(
    ("hardware", "more", "kind", "expected"),
    [
        (OWN_HARDWARE[1], "", "joint", [(8, Severity.ERROR)]),
        (OWN_HARDWARE[0], "", "joint", []),  # it gives both drives each command
        (OWN_HARDWARE[1], "auto_state_transitions: false\n", "joint", []),
        (OWN_HARDWARE[1], "", "gpio", []),
    ],
)
def test_the_package_for_ros2_control_drives_one_drive_of_a_joint(
    hardware: str, more: str, kind: str, expected: list[object], tmp_path: Path
):
    drives = module("axis.yaml", plugin=DRIVE) + module("axis.yaml", 1, plugin=DRIVE)
    (tmp_path / "axis.yaml").write_text(FILES["axis.yaml"] + more, "utf-8")
    text = ROBOT.format(components=component(drives, states="position", kind=kind))
    robot = tmp_path / "own.urdf"
    robot.write_text(text.replace(OWN_HARDWARE[0], hardware), "utf-8")
    rows = [d for d in check_files([str(robot)]).diagnostics if d.code == "FSN491"]
    assert [(d.span.line, d.level) for d in rows] == expected


BOUND_ONCE = {
    "nothing requests it": component(module("alike.yaml")),
    "one channel of each side": component(
        module("axis.yaml"), states="position", commands="position"
    ),
    "bits of one channel": component(module("bits.yaml"), states="low high", kind="sensor"),
    "each joint its own": component(module("two.yaml", name="m"), commands="speed")
    + component(module("two.yaml", name="m"), states="speed", name="b"),
}


@pytest.mark.parametrize("name", BOUND_ONCE)
def test_interfaces_of_one_channel_are_accepted(name: str, tmp_path: Path):
    assert found(tmp_path, BOUND_ONCE[name], "FSN482") == []
