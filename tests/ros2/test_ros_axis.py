"""Axes by CiA 402 of the package `ros/fsoe_net_ros`, and how `convert` describes them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cli.tool import fsn
from live.on_the_wire import on_the_wire
from master.rig import Master
from master.rig import running as master_running
from ros2.package import COUNTS_PER_RAD, GENERATIONS, built, converted, motors, reversed_cell
from ros2.rig import System
from weekly import first

from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import resolve
from fsoe_net.plan.compile import compile_plan


@pytest.fixture(scope="session")
def program() -> Path:
    """Return the substitute for a controller manager of Jazzy."""
    return built("jazzy")


@pytest.fixture(scope="module")
def robot() -> Iterator[Master]:
    with master_running(name="robot-cell") as master:
        yield master


ENABLED, DISABLED, FAULT = 0x27, 0x40, 0x08  # IEC 61800-7-201, bits of the statusword


def at(facts: list[float], state: int, position: int) -> bool:
    """Whether a drive is in a state and rests, with its target and its joint, at a position."""
    found, target, actual, joint = facts
    rest = abs(target - position) < 20 and abs(actual - position) < 20
    return found == state and rest and abs(joint * -COUNTS_PER_RAD - actual) < 20


def test_an_axis_starts_only_when_it_is_claimed(program: Path, tmp_path: Path) -> None:
    """Each value is an object that the emulated drive itself reports.

    Tried again if the drive is off after it moved, as below.
    """

    def moved(seen: Any) -> bool:
        return bool(seen["moved"][0] == ENABLED)

    case = ("cia402", reversed_cell(tmp_path), program, motors(tmp_path))
    seen = on_the_wire(*case, tmp=tmp_path, script="live/ros2_rig.py", good=moved)
    assert at(seen["unclaimed"], DISABLED, 16384), seen
    assert at(seen["claimed"], ENABLED, 16384), seen
    assert at(seen["moved"], ENABLED, 14298), seen
    # The command of 1 rad is still there; the target follows the actual position.
    assert seen["jump"][0] == DISABLED
    assert at(seen["jump"], DISABLED, seen["jump"][2]), seen
    assert abs(seen["jump"][2] - 14298) < 200
    assert at(seen["e-stop"], DISABLED, seen["e-stop"][2]), seen
    assert seen["fault"][0] == FAULT
    assert at(seen["reset"], DISABLED, seen["reset"][2]), seen
    assert at(seen["again"], ENABLED, seen["reset"][2]), seen
    assert "shoulder is commanded beyond its limits, all axes stop" in seen["said"]
    assert "shoulder cannot be enabled (faulted)" in seen["said"]


def test_an_axis_stays_off_after_its_bus_was_lost(program: Path, tmp_path: Path) -> None:
    """Tried again if the drive is off at the end: a busy machine has made the logic take torque."""

    def claimed(seen: Any) -> bool:
        return bool(seen["claimed"][0] == ENABLED)

    case = ("cia402_lost", reversed_cell(tmp_path), program, motors(tmp_path))
    seen = on_the_wire(*case, tmp=tmp_path, script="live/ros2_rig.py", good=claimed)
    for loss in ("cut", "frozen"):
        answer, facts = seen[loss]
        assert answer == "write DEACTIVATE"
        assert at(facts, DISABLED, 15646), (loss, facts)
    assert at(seen["claimed"], ENABLED, 15646), seen


def test_an_axis_takes_its_mode_and_homing_from_a_controller(program: Path, tmp_path: Path) -> None:
    """The drive homes by method 37: its position becomes 0 without a movement."""
    case = ("cia402_modes", reversed_cell(tmp_path), program, motors(tmp_path))
    seen = on_the_wire(*case, tmp=tmp_path, script="live/ros2_rig.py")
    assert 60000 < seen["turns"] <= 70000
    assert seen["released"] == ENABLED  # at velocity 0
    waits, actual = seen["homing waits"][0], seen["homing waits"][2]
    assert waits == ENABLED
    assert abs(actual) > 1000
    assert at(seen["home"], ENABLED, 0), seen
    assert 15 <= seen["torque"] <= 25  # per mille
    assert seen["reset"][0] == DISABLED
    assert "shoulder is commanded beyond its limits" in seen["said"]
    assert "shoulder has stopped (faulted)" in seen["said"]


DRIVE = """vendor_id: 0x000000fb
product_id: 0x64400000
rpdo:
  - index: 0x1603
    channels:
      - {index: 0x6040, sub_index: 0, type: uint16, default: 0}
      - {index: 0x607a, sub_index: 0, type: int32, command_interface: position, default: .nan}
      - {index: 0x60ff, sub_index: 0, type: int32, default: 0}
      - {index: 0x6060, sub_index: 0, type: int8, default: 8}
tpdo:
  - index: 0x1a03
    channels:
      - {index: 0x6041, sub_index: 0, type: uint16}
      - {index: 0x6064, sub_index: 0, type: int32, state_interface: position}
      - {index: 0x606c, sub_index: 0, type: int32}
      - {index: 0x6061, sub_index: 0, type: int8}
"""
ROBOT = """<robot name="arm"><ros2_control name="motors" type="system">
  <hardware><plugin>ethercat_driver/EthercatDriver</plugin>
    <param name="master_id">0</param><param name="control_frequency">1000</param></hardware>
  <joint name="shoulder">
    <state_interface name="velocity"/><state_interface name="position"/>
    <command_interface name="position"/><command_interface name="reset_fault"/>
    <ec_module name="first"><plugin>ethercat_generic_plugins/EcCiA402Drive</plugin>
      <param name="alias">0</param><param name="position">0</param>
      <param name="mode_of_operation">9</param><param name="slave_config">drive.yaml</param>
    </ec_module></joint>
  <joint name="second">
    <state_interface name="position"/><command_interface name="position"/>
    <ec_module name="second"><plugin>ethercat_generic_plugins/EcCiA402Drive</plugin>
      <param name="alias">0</param><param name="position">1</param>
      <param name="slave_config">drive.yaml</param>
    </ec_module></joint>
</ros2_control></robot>
"""


def arm(folder: Path, robot: str = ROBOT, drive: str = DRIVE) -> ET.Element:
    """Convert a robot to ros2_control; return the document."""
    (folder / "drive.yaml").write_text(drive, "utf-8")
    (folder / "arm.urdf").write_text(robot, "utf-8")
    target = folder / "ros2_control.urdf.xacro"
    done = fsn("convert", str(folder / "arm.urdf"), "-o", str(target))
    assert done.returncode == 0, done.stderr
    return ET.parse(target).getroot()


def params(root: ET.Element, joint: str) -> dict[str, str]:
    """Return the params of a joint that are not names of the plan."""
    found = {
        row.get("name", ""): row.text or ""
        for row in root.findall(f".//joint[@name='{joint}']/param")
    }
    return {name: text for name, text in found.items() if "/" not in name}


def commands(root: ET.Element, joint: str) -> list[str]:
    rows = root.findall(f".//joint[@name='{joint}']/command_interface")
    return [row.get("name", "") for row in rows]


def test_joints_of_a_robot_keep_their_names_and_states(tmp_path: Path) -> None:
    arm(tmp_path)
    rows = converted(tmp_path / "arm.urdf", target=tmp_path / "again.urdf.xacro")
    assert list(rows) == ["shoulder", "second"]
    # The order of the description first; then the objects, with the names of ros2_control.
    assert list(rows["shoulder"].items()) == [
        (("command_interface", "position"), "first.position"),
        (("state_interface", "velocity"), "first.0x606c:00"),
        (("state_interface", "position"), "first.position"),
        (("command_interface", "velocity"), "first.0x60ff:00"),
        (("command_interface", "mode_of_operation"), "first.0x6060:00"),
        (("state_interface", "status_word"), "first.0x6041:00"),
        (("state_interface", "mode_of_operation_display"), "first.0x6061:00"),
        (("command_interface", "reset_fault"), "first.reset_fault"),
    ]
    plan = compile_plan(resolve(load_network([tmp_path / "arm.urdf"]).network))
    stops = {s.name: s.stop_value for s in plan.symbols if s.name.endswith("0x6060:00")}
    assert stops == {"first.0x6060:00": 9, "second.0x6060:00": 8}


LIMIT = '<joint name="shoulder" type="revolute"><limit lower="-1" upper="1" {}/></joint></robot>'


@pytest.mark.parametrize(
    ("limit", "expected"),
    [
        ('velocity="2.5" effort="30"', {"max_velocity": "2.5", "max_effort": "30.0"}),
        ('velocity="0" effort="1e999"', {}),
        ('velocity="-2" effort="nan"', {}),
        (f'velocity="{"9" * 5000}" effort="fast"', {}),
    ],
)
def test_a_joint_of_the_cia402_plugin_is_an_axis(
    limit: str, expected: dict[str, str], tmp_path: Path
) -> None:
    root = arm(tmp_path, ROBOT.replace("</robot>", LIMIT.format(limit)))
    mode = {"mode_of_operation": "9"}
    assert params(root, "shoulder") == {"subdevice": "first", "axis": "first"} | mode | expected
    assert params(root, "second") == {"axis": "second", "mode_of_operation": "8"}


@pytest.mark.parametrize(
    ("kind", "limit", "expected"),
    [
        ("revolute", 'lower="-1.5" upper="2" velocity="2.5" effort="30"', ("-1.5", "2.0")),
        ("prismatic", 'upper="0.5" velocity="2.5"', ("0.0", "0.5")),
        ("continuous", 'velocity="2.5"', None),
    ],
)
def test_limits_of_the_urdf_are_those_of_commands(
    kind: str, limit: str, expected: tuple[str, str] | None, tmp_path: Path
) -> None:
    """`min` and `max` of ros2_control; the command of a position needs a factor."""
    joint = f'<joint name="shoulder" type="{kind}"><limit {limit}/></joint></robot>'
    drive = DRIVE.replace("default: .nan", "default: .nan, factor: 1000")
    drive = drive.replace(
        "0x60ff, sub_index: 0, type: int32, default: 0",
        "0x60ff, sub_index: 0, type: int32, factor: 10",
    )
    root = arm(tmp_path, ROBOT.replace("</robot>", joint), drive)

    def limits(command: str) -> tuple[str | None, ...] | None:
        row = root.find(
            f".//ros2_control/joint[@name='shoulder']/command_interface[@name='{command}']"
        )
        assert row is not None
        rows = {p.get("name"): p.text for p in row}
        return (rows["min"], rows["max"]) if rows else None

    assert limits("position") == expected
    assert limits("velocity") == ("-2.5", "2.5")
    (written,) = root.findall("./joint[@name='shoulder']")
    assert written.get("type") == kind
    tag = written.find("limit")
    assert tag is not None
    assert (tag.get("velocity"), tag.get("lower"), tag.get("upper")) == (
        "2.5",
        *(expected or (None, None)),
    )
    (other,) = root.findall("./joint[@name='second']")
    assert (other.get("type"), other.find("limit")) == ("continuous", None)


def test_increments_of_a_drive_have_no_limits_in_radians(tmp_path: Path) -> None:
    root = arm(tmp_path, ROBOT.replace("</robot>", LIMIT.format('velocity="2.5" effort="30"')))
    assert root.findall(".//command_interface/param[@name='max']") == []


def test_switches_of_the_plugin_are_kept(tmp_path: Path) -> None:
    root = arm(tmp_path, drive=DRIVE + "auto_fault_reset: true\n")
    assert params(root, "second")["auto_fault_reset"] == "true"
    (tmp_path / "manual").mkdir()
    root = arm(tmp_path / "manual", drive=DRIVE + "auto_state_transitions: false\n")
    assert "axis" not in params(root, "second")
    assert "control_word" in commands(root, "second")


def test_a_joint_of_several_drives_is_no_axis(tmp_path: Path) -> None:
    both = ROBOT.replace('</joint>\n  <joint name="second">', "").replace(
        """
    <state_interface name="position"/><command_interface name="position"/>
    <ec_module name="second">""",
        '<ec_module name="second">',
    )
    assert both.count("<joint") == 1
    root = arm(tmp_path, both)
    assert "axis" not in params(root, "shoulder")
    done = fsn("convert", str(tmp_path / "arm.urdf"), "-o", str(tmp_path / "2.urdf.xacro"))
    assert "shoulder: not an axis, because several drives have it: first, second" in done.stderr


def test_positions_without_a_factor_are_named(tmp_path: Path) -> None:
    arm(tmp_path)
    done = fsn("convert", str(tmp_path / "arm.urdf"), "-o", str(tmp_path / "x" / "out.urdf.xacro"))
    assert "shoulder: the state position has no factor" in done.stderr
    assert "reset_fault" not in done.stderr


SPEED = "p:axis_1/max_velocity=1"


@pytest.mark.parametrize("generation", first(1, GENERATIONS))
@pytest.mark.parametrize(
    ("words", "line", "text"),
    [
        (["c:axis_1/position"], "configure", "axis_1 has no `max_velocity`: add <limit velocity="),
        (["p:axis_1/mode_of_operation=10"], "configure", "axis_1 has no `max_effort`: add <limit"),
        ([SPEED, "c:axis_1/control_word"], "configure", "the axis axis_1 writes its controlword"),
        ([SPEED, "p:axis_1/axis=el6910"], "activate", "0x6040 is not mapped as an output"),
        ([SPEED, "p:axis_1/axis_number=8"], "activate", "a device has axes 0 to 7"),
        ([SPEED, "p:axis_1/mode_of_operation=2"], "activate", "its mode is none of PP, PV"),
        (["p:axis_1/max_velocity=fast"], "init", "param `max_velocity` of axis_1 is not a number"),
    ],
)
def test_mistakes_of_an_axis_are_reported(
    generation: str, robot: Master, words: list[str], line: str, text: str
) -> None:
    words = ["p:axis_1/axis=axis_1", *words]
    with System(built(generation), f"socket={robot.path}", *words) as system:
        steps = ["init", "configure", "activate"]
        system.goes(*steps[: steps.index(line)])
        assert system.ask(line) == ("ERROR" if line == "init" else "FAILURE")
        assert text in system.end()
