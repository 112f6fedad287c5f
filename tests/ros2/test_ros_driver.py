"""`fsoe_net_ros/EthercatDriver`: the description of an ethercat_driver_ros2 robot, unchanged."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from live.on_the_wire import on_the_wire
from master.rig import Client
from ros2.package import COUNTS_PER_RAD, built
from ros2.rig import System

TOOL = Path(sys.executable).with_name("fsoe-net")
MASTER = Path(sys.executable).with_name("fsn-master")
OUTPUTS = """vendor_id: 0x00000002
product_id: 0x07d83052
rpdo:
  - index: 0x1600
    channels: [{index: 0x7000, sub_index: 1, type: int16, command_interface: lamp, factor: -10}]
  - index: 0x1601
    channels: [{index: 0x7010, sub_index: 1, type: int16, command_interface: horn, default: 7}]
"""
INPUTS = """vendor_id: 0x00000002
product_id: 0x03f03052
tpdo:
  - index: 0x1a00
    channels: [{index: 0x6000, sub_index: 1, type: int16, state_interface: door}]
"""
# Two joints of one module, one joint of two modules, and names that are not those of the modules.
ROBOT = """<robot name="cell"><ros2_control name="bus" type="system">
  <hardware><plugin>fsoe_net_ros/EthercatDriver</plugin>
    <param name="master_id">0</param><param name="control_frequency">100</param></hardware>
  <gpio name="left">
    <command_interface name="lamp"/><state_interface name="door"/>
    <ec_module name="el2008"><plugin>ethercat_generic_plugins/GenericEcSlave</plugin>
      <param name="alias">0</param><param name="position">0</param>
      <param name="slave_config">{folder}/outputs.yaml</param></ec_module>
    <ec_module name="el1008"><plugin>ethercat_generic_plugins/GenericEcSlave</plugin>
      <param name="alias">0</param><param name="position">1</param>
      <param name="slave_config">{folder}/inputs.yaml</param></ec_module>
  </gpio>
  <gpio name="right">
    <command_interface name="horn"/>
    <ec_module name="el2008"><plugin>ethercat_generic_plugins/GenericEcSlave</plugin>
      <param name="alias">0</param><param name="position">0</param>
      <param name="slave_config">{folder}/outputs.yaml</param></ec_module>
  </gpio>
</ros2_control></robot>
"""


@pytest.fixture(scope="session")
def program() -> Path:
    """Return the substitute for a controller manager of Jazzy."""
    return built("jazzy")


def robot(folder: Path, text: str = ROBOT) -> Path:
    (folder / "outputs.yaml").write_text(OUTPUTS, "utf-8")
    (folder / "inputs.yaml").write_text(INPUTS, "utf-8")
    path = folder / "robot.urdf"
    path.write_text(text.format(folder=folder), "utf-8")
    return path


def words(urdf: Path, socket: Path, **params: object) -> list[str]:
    given = {
        "class": "EthercatDriver",
        "urdf": urdf,
        "socket": socket,
        "interface": "none0",
        "bus": "emulated",
        "misses": 1000,
        "fsoe_net": TOOL,
        "fsn_master": MASTER,
    }
    return [f"{name}={value}" for name, value in (given | params).items()]


def test_the_robot_runs_with_its_own_names(program: Path, tmp_path: Path) -> None:
    socket = tmp_path / "s"
    with System(program, *words(robot(tmp_path), socket)) as system:
        system.goes("init", "configure", "activate")
        with Client(socket) as client:
            system.goes("start left/lamp right/horn", "set left/lamp 12", "set right/horn 3")
            # Raw values: factor * command; the `default` of the horn is its value without one.
            system.sends(lambda: client.value("el2008.lamp") == -120)
            assert client.value("el2008.horn") == 3
            system.goes("stop right/horn")
            system.sends(lambda: client.value("el2008.horn") == 7)
            system.until("get left/door", "0")
        system.goes("cleanup")
        assert not socket.exists()  # its fsn-master has ended
        system.goes("configure", "cycle 3")


def fails(program: Path, *given: str) -> str:
    """Configure; return what was logged."""
    with System(program, *given) as system:
        system.goes("init")
        assert system.ask("configure") == "FAILURE"
        return system.end()


def test_findings_are_reported_before_the_bus_opens(program: Path, tmp_path: Path) -> None:
    urdf = robot(tmp_path)
    (tmp_path / "inputs.yaml").write_text(INPUTS.replace("int16", "int17"), "utf-8")
    logged = fails(program, *words(urdf, tmp_path / "s"))
    assert "error[FSN" in logged
    assert f"{tmp_path}/inputs.yaml:5:" in logged
    assert "hint: " in logged
    assert not (tmp_path / "s").exists()


def answers(socket: Path) -> bool:
    try:
        Client(socket).close()
    except OSError:
        return False
    return True


@contextlib.contextmanager
def master_of(urdf: Path, socket: Path) -> Iterator[Client]:
    """Run fsn-master with the plan of a robot."""
    plan = urdf.with_suffix(".fsnplan")
    subprocess.run([TOOL, "plan", urdf, "-o", plan], check=True, capture_output=True)
    command = [MASTER, plan, "--bus", "emulated", "--interface", "none0", "--socket", socket]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as master:
        try:
            while not answers(socket):
                time.sleep(0.01)
            with Client(socket) as client:
                yield client
        finally:
            master.kill()


def test_a_master_of_another_plan_is_left_alone(program: Path, tmp_path: Path) -> None:
    """A plan that differs only in its cycle has the same names."""
    urdf, socket = robot(tmp_path), tmp_path / "s"
    with master_of(urdf, socket) as client:
        faster = robot(tmp_path, ROBOT.replace(">100<", ">200<"))
        assert f"the fsn-master at {socket} drives another plan" in fails(
            program, *words(faster, socket)
        )
        status = client.good("status")
        assert (status["state"], status.get("in_cycle", [])) == ("running", [])


def test_a_running_master_of_the_same_plan_is_used(program: Path, tmp_path: Path) -> None:
    urdf, socket = robot(tmp_path), tmp_path / "s"
    with master_of(urdf, socket) as client:
        given = words(urdf, socket, fsn_master="/nowhere/fsn-master")
        with System(program, *given) as system:
            system.goes("init", "configure", "activate", "cycle 3", "cleanup")
        assert client.good("status")["state"] == "running"


def script(folder: Path, text: str) -> Path:
    path = folder / "program"
    path.write_text(f"#!/bin/sh\n{text}\n", "utf-8")
    path.chmod(0o755)
    return path


def test_a_tool_that_fails_is_bounded(program: Path, tmp_path: Path) -> None:
    urdf, socket = robot(tmp_path), tmp_path / "s"
    flood = script(tmp_path, "yes x | head -c 20000000 >&2; exit 1")
    logged = fails(program, *words(urdf, socket, fsoe_net=flood))
    assert 8_000 < len(logged) < 10_000
    endless = script(tmp_path, "exec sleep 1000")
    logged = fails(program, *words(urdf, socket, fsoe_net=endless, fsoe_net_s=1))
    assert "took longer than 1 s and was ended" in logged
    logged = fails(program, *words(urdf, socket, fsoe_net="/nowhere/fsoe-net"))
    assert "/nowhere/fsoe-net cannot be started: No such file or directory; install it" in logged
    logged = fails(program, *words(urdf, socket, fsoe_net=script(tmp_path, "echo '{}'")))
    assert "gives no hash" in logged


def test_a_master_that_ends_at_once_is_an_error(program: Path, tmp_path: Path) -> None:
    given = words(
        robot(tmp_path), tmp_path / "s", fsn_master=script(tmp_path, "echo no >&2; exit 3")
    )
    logged = fails(program, *given)
    assert "no\n" in logged
    assert "fsn-master has ended; its messages are above" in logged


def test_an_unknown_interface_is_named(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("FSN_INTERFACE", raising=False)
    given = [
        row
        for row in words(robot(tmp_path), Path())
        if not row.startswith(("socket=", "interface="))
    ]
    assert "set FSN_INTERFACE in the environment" in fails(program, *given)
    monkeypatch.setenv("FSN_INTERFACE", "none0")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    with System(program, *given) as system:
        system.goes("init", "configure")
        assert (tmp_path / "fsn-master-none0.sock").exists()


def test_its_master_ends_with_a_component_that_is_killed(program: Path, tmp_path: Path) -> None:
    socket = tmp_path / "s"
    given = words(robot(tmp_path), socket)
    with System(program, *given) as system:
        system.goes("init", "configure")
        os.kill(system.process.pid, signal.SIGKILL)
        while answers(socket):
            time.sleep(0.01)
    with System(program, *given) as system:
        system.goes("init", "configure", "activate")


@pytest.mark.weekly
def test_humble_takes_the_file_of_the_description(tmp_path: Path) -> None:
    """The stub is that of a version that does not pass the description on."""
    urdf, socket = robot(tmp_path), tmp_path / "s"
    humble = built("humble")
    assert "give its file as param `description`" in fails(humble, *words(urdf, socket))
    with System(humble, *words(urdf, socket, description=urdf)) as system:
        system.goes("init", "configure", "activate", "cycle 3")


def test_an_interface_that_nothing_provides_is_named(program: Path, tmp_path: Path) -> None:
    more = ROBOT.replace('name="horn"/>', 'name="horn"/><state_interface name="heat"/>')
    with System(program, *words(robot(tmp_path, more), tmp_path / "s")) as system:
        system.goes("init", "configure", "activate", "cycle 5")
        assert system.ask("get right/heat") == "nan"
        logged = system.end()
    assert "right/heat: the plan has nothing for this interface" in logged
    assert "FSN121" not in logged  # the plugin is known


DRIVE = f"""vendor_id: 0x000000fb
product_id: 0x64400000
rpdo:
  - index: 0x1603
    channels:
      - {{index: 0x6040, sub_index: 0, type: uint16, command_interface: control_word}}
      - {{index: 0x607a, sub_index: 0, type: int32, command_interface: position,
         default: .nan, factor: {-COUNTS_PER_RAD!r}}}
      - {{index: 0x6060, sub_index: 0, type: int8, default: 8}}
tpdo:
  - index: 0x1a03
    channels:
      - {{index: 0x6041, sub_index: 0, type: uint16}}
      - {{index: 0x6064, sub_index: 0, type: int32, state_interface: position,
         factor: {-1 / COUNTS_PER_RAD!r}}}
      - {{index: 0x6061, sub_index: 0, type: int8}}
"""
ARM = """<robot name="arm"><ros2_control name="motors" type="system">
  <hardware><plugin>fsoe_net_ros/EthercatDriver</plugin>
    <param name="master_id">0</param><param name="control_frequency">1000</param></hardware>
  <joint name="elbow">
    <state_interface name="position"/><command_interface name="position"/>
    <command_interface name="control_word"/><command_interface name="reset_fault"/>
    <ec_module name="axis"><plugin>ethercat_generic_plugins/EcCiA402Drive</plugin>
      <param name="alias">0</param><param name="position">0</param>
      <param name="mode_of_operation">8</param>
      <param name="slave_config">{folder}/drive.yaml</param></ec_module></joint>
</ros2_control>
<joint name="elbow" type="revolute"><limit lower="-3" upper="3" velocity="0.5" effort="9"/></joint>
</robot>
"""


def test_a_drive_of_the_robot_is_an_axis(program: Path, tmp_path: Path) -> None:
    """Over a wire, with its own fsn-master; values are those that the emulated drive reports."""
    urdf, scenario = tmp_path / "arm.urdf", tmp_path / "scenario.yaml"
    urdf.write_text(ARM.format(folder=tmp_path), "utf-8")
    (tmp_path / "drive.yaml").write_text(DRIVE, "utf-8")
    scenario.write_text("version: 1\ndrives: {axis: {position_rev: 0.25}}\n", "utf-8")
    seen = on_the_wire("driver", urdf, program, scenario, tmp=tmp_path, script="live/ros2_rig.py")
    state, target, actual, joint = seen["unclaimed"]
    assert state & 0x4F == 0x40  # Switch on disabled
    assert target == actual == 16384
    assert abs(joint * -COUNTS_PER_RAD - 16384) < 1
    state, target, actual, joint = seen["moved"]
    assert (state, target) == (0x27, 13559)  # -1.3 rad
    assert abs(actual - target) < 20
    assert abs(joint + 1.3) < 0.01
    assert seen["ended"]
    assert "elbow/control_word: the plan has nothing for this interface" in seen["said"]


def test_a_joint_of_two_drives_is_rejected_before_the_bus_opens(
    program: Path, tmp_path: Path
) -> None:
    first = ARM[ARM.index("<ec_module") : ARM.index("</joint>")]
    second = first.replace('"axis"', '"twin"').replace('"position">0', '"position">1')
    urdf, socket = tmp_path / "arm.urdf", tmp_path / "s"
    urdf.write_text(ARM.replace(first, first + second).format(folder=tmp_path), "utf-8")
    (tmp_path / "drive.yaml").write_text(DRIVE, "utf-8")
    logged = fails(program, *words(urdf, socket))
    # The driver passes the description on, so the file is a copy.
    assert re.search(r"robot\.urdf:10:\d+: error\[FSN491\]: joint elbow has .* axis, twin", logged)
    assert not socket.exists()


def test_an_axis_without_a_velocity_is_named_before_the_bus_opens(
    program: Path, tmp_path: Path
) -> None:
    urdf, socket = tmp_path / "arm.urdf", tmp_path / "s"
    urdf.write_text(ARM.replace('velocity="0.5" ', "").format(folder=tmp_path), "utf-8")
    (tmp_path / "drive.yaml").write_text(DRIVE, "utf-8")
    logged = fails(program, *words(urdf, socket))
    assert "elbow has no `max_velocity`: add <limit velocity=…> to its joint in the URDF" in logged
    assert "ros2 control set_hardware_component_state" in logged
    assert not socket.exists()
