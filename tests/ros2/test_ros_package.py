"""The package `ros/fsoe_net_ros`: its class beside fsn-master, its adapter against stubs."""

from __future__ import annotations

import ast
import os
import re
import runpy
import shutil
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from cli.tool import fsn
from live.on_the_wire import ESTOP, on_the_wire
from master.rig import Client, Master
from master.rig import running as master_running
from networks import EXAMPLES, example
from patience import PATIENCE_S
from ros2.package import GENERATIONS, PACKAGE, ROOT, built, converted, motors
from ros2.rig import System
from weekly import first

from fsoe_net.plan.codec import decode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.testing.fake_master import FakeMaster

REPLY_S = 1.0  # kReplyMs of control_socket.cpp
UNKNOWN = "7"
LAMP, OUTPUT = "el2904/standard_1", "el2904.standard_1"
VELOCITY, MODE = "drive_1/0x60ff:00", "drive_1/0x6060:00"


@pytest.fixture(scope="session")
def program() -> Path:
    """Return the substitute for a controller manager of Jazzy."""
    return built("jazzy")


@pytest.fixture(params=first(1, GENERATIONS))
def each(request: pytest.FixtureRequest) -> Path:
    """Return the substitute for a controller manager of each distribution."""
    return built(request.param)


@pytest.fixture(scope="module")
def robot() -> Iterator[Master]:
    with master_running(name="el6910") as master:
        yield master


@pytest.fixture
def reader(robot: Master) -> Iterator[Client]:
    with robot.client() as client:
        yield client


def test_a_lifecycle_from_configure_to_cleanup(each: Path, robot: Master, reader: Client) -> None:
    names = (f"c:{LAMP}", "s:el6910-el1904/in_data", "s:el6910-el1904/state")
    with System(each, f"socket={robot.path}", "misses=1000", *names) as system:
        system.goes("init", "configure", "cycle 3")
        assert system.ask("get el6910-el1904/in_data") == "0"  # no device is at its ends
        assert system.ask("get el6910-el1904/state") == "0"
        system.goes("activate", f"start {LAMP}", f"set {LAMP} 1")
        system.sends(lambda: reader.value(OUTPUT) is True)
        system.goes("deactivate")
        reader.wait_for(OUTPUT, False)
        system.goes("cycle 3", "activate", f"set {LAMP} 1", "cycle 20")
        assert reader.value(OUTPUT) is False  # a controller of the activation before does not count
        system.goes(f"start {LAMP}", f"set {LAMP} 1")
        system.sends(lambda: reader.value(OUTPUT) is True)
        system.goes("cleanup")
        assert system.ask("get el6910-el1904/state") == "nan"
        reader.wait_for(OUTPUT, False)


def test_an_output_without_a_controller_has_its_stop_value(
    each: Path, robot: Master, reader: Client
) -> None:
    """The stop value of the mode is 8, its `default` in the slave YAML; the others have none."""
    velocity, mode = VELOCITY.replace("/", "."), MODE.replace("/", ".")
    names = (f"c:{VELOCITY}", f"c:{MODE}")
    with System(each, f"socket={robot.path}", "misses=1000", *names) as system:
        system.goes("init", "configure", "activate", f"set {VELOCITY} 500", "cycle 20")
        assert reader.value(velocity) == 0  # no controller has it
        system.goes(f"start {VELOCITY} {MODE}", f"set {VELOCITY} 500", f"set {MODE} 3")
        system.sends(lambda: (reader.value(velocity), reader.value(mode)) == (500, 3))
        system.goes(f"set {VELOCITY} nan")
        system.sends(lambda: (reader.value(velocity), reader.value(mode)) == (0, 3))
        system.goes(f"set {VELOCITY} 500")
        system.sends(lambda: reader.value(velocity) == 500)
        # A controller may write in its on_deactivate, after the switch: that does not count.
        system.goes(f"stop {VELOCITY} {MODE}", f"set {VELOCITY} 700")
        system.sends(lambda: (reader.value(velocity), reader.value(mode)) == (0, 8))
        system.goes(f"start {VELOCITY}", "cycle 20")
        assert reader.value(velocity) == 0  # 700 is not a command of the next one either
        system.goes(f"set {VELOCITY} 1e30")
        error = "write ERROR" if "humble" in each.parts else "write DEACTIVATE"
        assert system.ask("cycle 3") == error
        assert "drive_1/0x60ff:00 cannot take 1" in system.end()


def test_nothing_is_sent_before_a_cycle_was_read(
    program: Path, robot: Master, reader: Client
) -> None:
    """The actual position is not known yet; 0 in its place would be a command."""

    def state() -> str:
        (row,) = [r for r in reader.good("status")["in_cycle"] if r["outputs"]]
        return str(row["state"])

    with System(program, f"socket={robot.path}", "misses=1000", "c:drive_1/position") as system:
        system.goes("init", "configure", "activate", "write")
        begun = reader.good("status")["cycles"]
        while reader.good("status")["cycles"] < begun + 5:
            pass
        assert state() == "waits"
        system.sends(lambda: state() == "runs")


def test_read_waits_for_each_cycle_of_the_bus(each: Path, robot: Master, reader: Client) -> None:
    """On a busy machine some calls end without a cycle; without waiting most do."""

    def passed(waits: str) -> int:
        words = (f"socket={robot.path}", "misses=1000", f"wait_for_cycle={waits}", f"c:{LAMP}")
        with System(each, *words) as system:
            system.goes("init", "configure", "activate", "tight 5")
            before = reader.good("status")["cycles"]
            system.goes("tight 300")
            return int(reader.good("status")["cycles"]) - before

    assert passed("true") > 150 > min(passed("false") for _ in range(5))


def test_read_waits_only_for_a_moment(program: Path) -> None:
    """Other hardware of the controller manager continues when fsn-master is frozen."""
    with master_running(name="el6910") as master:
        words = (f"socket={master.path}", "wait_for_cycle=true", "lost_ms=1", f"s:{INPUT}")
        with System(program, *words) as system:
            system.goes("init", "configure", "activate", "tight 5")
            os.kill(master.process.pid, signal.SIGSTOP)
            try:
                begun_s = time.monotonic()
                system.ask("tight 100")
                assert time.monotonic() - begun_s < REPLY_S
            finally:
                os.kill(master.process.pid, signal.SIGCONT)


def test_an_initial_value_is_what_an_output_has_without_a_controller(
    program: Path, robot: Master, reader: Client
) -> None:
    with System(program, f"socket={robot.path}", "misses=1000", f"c:{MODE}=9") as system:
        system.goes("init", "configure", "activate")
        system.sends(lambda: reader.value("drive_1.0x6060:00") == 9)
        system.goes("deactivate")
        reader.wait_for("drive_1.0x6060:00", 8)


def test_names_may_be_mapped_to_those_of_the_plan(
    program: Path, robot: Master, reader: Client
) -> None:
    names = (
        "s:joint_1/position",
        "s:joint_1/mode",
        "c:joint_1/mode",
        "p:joint_1/subdevice=drive_2",
    )
    names += ("p:joint_1/state_interface/mode=drive_2.0x6061:00",)
    names += ("p:joint_1/command_interface/mode=drive_1.0x6060:00",)
    with System(program, f"socket={robot.path}", "misses=1000", *names) as system:
        system.goes("init", "configure", "activate", "start joint_1/mode", "set joint_1/mode 1")
        system.sends(lambda: reader.value("drive_1.0x6060:00") == 1)
        assert system.ask("get joint_1/position") == "0"
        assert system.ask("get joint_1/mode") == "0"  # 0x6061, not what is sent


STATE, INPUT = "el6910-el1904/state", "el6910/logic_state"


def lost(system: System) -> None:
    """Run cycles until the commands end."""
    while (answer := system.ask("cycle 1")) == "OK":
        pass
    assert answer == "write DEACTIVATE"


def test_a_frozen_fsn_master_ends_commands_and_states_return_by_themselves(program: Path) -> None:
    """Nothing waits for it: other hardware of the controller manager continues."""
    with master_running(name="el6910") as master, master.client() as reader:
        words = (f"socket={master.path}", "misses=1000", f"c:{LAMP}", f"s:{STATE}", f"s:{INPUT}")
        with System(program, *words) as system:
            system.goes("init", "configure", "activate", f"start {LAMP}", f"set {LAMP} 1")
            system.sends(lambda: reader.value(OUTPUT) is True)
            os.kill(master.process.pid, signal.SIGSTOP)
            try:
                begun_s = time.monotonic()
                lost(system)
                assert time.monotonic() - begun_s < REPLY_S
                system.goes("cycle 3")
                assert system.ask(f"get {INPUT}") == "nan"
                assert system.ask(f"get {STATE}") == UNKNOWN
                begun_s = time.monotonic()
                assert system.ask("activate") == "FAILURE"
                system.goes("cleanup")
                assert system.ask("configure") == "FAILURE"
                assert time.monotonic() - begun_s < 8 * REPLY_S  # each waits once for a reply
            finally:
                os.kill(master.process.pid, signal.SIGCONT)
            while system.ask("configure") != "SUCCESS":
                pass
            os.kill(master.process.pid, signal.SIGSTOP)
            try:
                system.until(f"get {STATE}", UNKNOWN)
            finally:
                os.kill(master.process.pid, signal.SIGCONT)
            system.until(f"get {STATE}", "0")
            system.until(f"get {INPUT}", "0")
            # The command is still there, and a controller has it; both need an activation.
            system.goes("cycle 20")
            assert reader.value(OUTPUT) is False
            system.goes("activate", f"set {LAMP} 1", "cycle 20")
            assert reader.value(OUTPUT) is False
            system.goes(f"start {LAMP}", f"set {LAMP} 1")
            system.sends(lambda: reader.value(OUTPUT) is True)
            assert "set_hardware_component_state" in system.end()


@pytest.mark.weekly
def test_a_fault_is_an_error_in_humble_which_has_no_other_value() -> None:
    with master_running(name="el6910") as master, master.client() as reader:
        words = (f"socket={master.path}", "misses=1000", f"c:{LAMP}", f"s:{STATE}")
        with System(built("humble"), *words) as system:
            system.goes("init", "configure", "activate", f"start {LAMP}", f"set {LAMP} 1")
            system.sends(lambda: reader.value(OUTPUT) is True)
            reader.good("stop")
            while (answer := system.ask("cycle 1")) == "OK":
                pass
            assert answer == "write ERROR"
            assert system.ask(f"get {STATE}") == "nan"
            while reader.good("status")["state"] != "stopped":
                pass
            reader.good("start")
            while reader.good("status")["state"] != "running":
                pass
            system.goes("configure", "activate", f"set {LAMP} 1", "cycle 20")
            assert reader.value(OUTPUT) is False  # its controller is still active
            system.goes(f"start {LAMP}", f"set {LAMP} 1")
            system.sends(lambda: reader.value(OUTPUT) is True)


def test_states_return_when_fsn_master_is_started_again(program: Path, tmp_path: Path) -> None:
    """With a plan that lacks a name they do not, and the reason is logged."""
    socket = tmp_path / "s"
    words = (f"socket={socket}", f"c:{LAMP}", f"s:{STATE}", f"s:{INPUT}")
    with System(program, *words) as system:
        system.goes("init")
        assert system.ask("configure") == "FAILURE"  # it is not there yet
        with master_running(name="el6910") as master:
            socket.symlink_to(master.path)
            system.goes("configure", "activate", f"start {LAMP}", f"set {LAMP} 1", "cycle 3")
            master.process.kill()
            lost(system)
        socket.unlink()
        with master_running(name="estop") as master:
            socket.symlink_to(master.path)
            for _ in range(3):
                system.goes("cycle 200")
            assert system.ask(f"get {INPUT}") == "nan"
            assert system.ask("activate") == "FAILURE"
        socket.unlink()
        with master_running(name="el6910") as master, master.client() as reader:
            socket.symlink_to(master.path)
            system.until(f"get {INPUT}", "0")
            system.goes("cycle 20")
            assert reader.value(OUTPUT) is False
            system.goes("activate", f"start {LAMP}", f"set {LAMP} 1")
            system.sends(lambda: reader.value(OUTPUT) is True)
        said = system.end()
    assert "the plan has no input el6910.logic_state" in said
    assert "connected to fsn-master again; commands need a new activation" in said


def test_an_axis_by_ros2_control(program: Path, tmp_path: Path) -> None:
    """An emulated drive that is not at 0, over a wire: its states are never its commands."""
    scenario = motors(tmp_path)
    network = EXAMPLES / "robot-cell" / "network.yaml"
    case = ("axis", network, program, scenario)
    seen = on_the_wire(*case, tmp=tmp_path, script="live/ros2_rig.py", good=lambda s: s["late"])
    # 0.25 revolutions are 16384 of the drive's 65536 counts.
    assert seen["disabled"] == {"state": "16384", "sent": 100000, "actual": 16384}
    assert seen["released"] == 16384  # the target follows the actual position
    assert seen["enabled"] == 16384
    assert abs(seen["moved"] - 20000) <= 2
    assert seen["held"] == 40000  # the last target, not the actual position of an enabled drive
    assert seen["not_a_number"] == 21000


@pytest.mark.parametrize(
    ("words", "line", "text"),
    [
        (["s:el2904/lamp"], "configure", "el2904/lamp: the plan has no input el2904.lamp; `fsoe"),
        (
            ["s:el2904/standard_1"],
            "configure",
            "the plan has no input el2904.standard_1; the output of that name is what is sent",
        ),
        (["c:drive_1/velocity"], "configure", "the plan has no output drive_1.velocity"),
        (["c:drive_1/effort", "p:drive_1/command_interface/effort=x.y"], "configure", "output x.y"),
        (["c:el2904/standard_1=on"], "init", "initial_value of el2904/standard_1 is not a number"),
        (["c:el6910/logic_control"], "activate", "logic_control"),
        (["misses=x"], "init", "param `misses` of the hardware is not a whole number: x"),
        (["socket=/nowhere/s"], "configure", "no answer on /nowhere/s"),
        (["socket="], "init", "the hardware has no param `socket`"),
    ],
)
def test_mistakes_are_reported_as_errors(
    program: Path, robot: Master, words: list[str], line: str, text: str
) -> None:
    with System(program, f"socket={robot.path}", *words) as system:
        steps = ["init", "configure", "activate"]
        system.goes(*steps[: steps.index(line)])
        assert system.ask(line) == ("ERROR" if line == "init" else "FAILURE")
        assert text in system.end()


def test_a_bus_that_stops_ends_the_commands_and_may_be_started(program: Path) -> None:
    with master_running(name="estop") as master, master.client() as client:
        with System(program, f"socket={master.path}", "s:ek1914/input_1") as system:
            system.goes("init", "configure", "activate", "cycle 3")
            client.good("stop")
            lost(system)
            while client.good("status")["state"] != "stopped":
                pass
            system.goes("cycle 3")
            assert system.ask("get ek1914/input_1") == "nan"
            assert system.ask("activate") == "FAILURE"
            system.goes("cleanup")
            assert system.ask("configure") == "FAILURE"
            said = system.end()
            assert "the bus was stopped, or fsn-master has ended" in said
            assert "the bus does not run (stopped); `fsoe-net console -c start` starts it" in said
        with System(program, f"socket={master.path}", "start=true", "s:ek1914/input_1") as system:
            system.goes("init")
            while system.ask("configure") != "SUCCESS":
                pass
            system.goes("activate", "cycle 3")


def test_commands_that_come_too_late_are_taken_back(
    program: Path, robot: Master, reader: Client
) -> None:
    words = (f"socket={robot.path}", "misses=0", f"c:{LAMP}", f"s:{STATE}")
    with System(program, *words) as system:
        system.goes("init", "configure", "activate", f"set {LAMP} 1")
        system.ask("cycle 1")
        reader.wait_for("el2904.standard_1", False)
        lost(system)
        system.goes("cycle 20")
        assert system.ask(f"get {STATE}") == "0"  # states live on
        assert "their stop values" in system.end()


def test_an_answer_that_is_none_is_an_error(program: Path) -> None:
    """A fake that has no memory to share, and one that answers nonsense."""
    with FakeMaster() as master:
        with System(program, f"socket={master.path}", "s:c1/state") as system:
            system.goes("init")
            assert system.ask("configure") == "FAILURE"
        master.state = "failed"
        with System(program, f"socket={master.path}") as system:
            system.goes("init")
            assert system.ask("configure") == "FAILURE"
            assert "the bus does not run (failed)" in system.end()


def test_the_states_of_a_connection_are_those_of_real_frames(program: Path, tmp_path: Path) -> None:
    """fsn-master on SOEM and emulated SubDevices with FSoE: e-stop, a cable cut, and back."""
    seen = on_the_wire("adapter", ESTOP, program, tmp=tmp_path, script="live/ros2_rig.py")
    assert seen["pressed"] == ["1", "5"]  # Data, with FailSafeData
    assert seen["released"] == ["1", "6"]
    assert seen["cut"] == "write DEACTIVATE"
    assert seen["without_it"] == "0"  # the state of the connection lives on
    assert "SubDevices" in seen["said"]


@pytest.mark.parametrize("name", ["el6910", "estop", "legs", "robot-cell"])
def test_every_symbol_that_a_controller_may_use_is_written_once(name: str, tmp_path: Path) -> None:
    target = tmp_path / "ros2_control.urdf.xacro"
    rows = converted(EXAMPLES / name / "network.yaml", target=target)
    plan = decode_plan(compile_plan(example(name)).to_bytes())
    outputs = {s.name for s in plan.symbols if s.output and not s.restart_relevant}
    inputs = {s.name for s in plan.symbols if not s.output}
    found = [(kind, symbol) for row in rows.values() for (kind, _), symbol in row.items()]
    assert len(set(found)) == len(found)
    assert {symbol for kind, symbol in found if kind == "command_interface"} == outputs
    assert {symbol for kind, symbol in found if kind == "state_interface"} == inputs
    sensors = {s.get("name") for s in ET.parse(target).getroot().iter("sensor")}
    assert sensors == {c.name for c in example(name).connections}


def test_a_name_is_a_name_to_xacro_too(tmp_path: Path) -> None:
    folder = tmp_path / "estop"
    shutil.copytree(EXAMPLES / "estop", folder)
    text = (folder / "network.yaml").read_text("utf-8").replace("ek1914,", '"a${1+1}<b",')
    text = text.partition("safety_functions:")[0].replace(
        "ec_module: ek1914", 'ec_module: "a${1+1}<b"'
    )
    (folder / "network.yaml").write_text(text.replace("sub: ek1914", 'sub: "a${1+1}<b"'), "utf-8")
    target = tmp_path / "ros2_control.urdf.xacro"
    done = fsn("convert", str(folder / "network.yaml"), "-o", str(target))
    assert done.returncode == 0, done.stderr
    names = {row.get("name") for row in ET.parse(target).getroot().iter("gpio")}
    assert "a$${1+1}<b" in names


def test_a_whole_description_is_taken(program: Path, robot: Master, tmp_path: Path) -> None:
    target = tmp_path / "ros2_control.urdf.xacro"
    fsn("convert", str(EXAMPLES / "el6910" / "network.yaml"), "-o", str(target))
    words = []
    (block,) = ET.parse(target).getroot().iter("ros2_control")
    for component in block:
        for row in component:
            name = f"{component.get('name')}/{row.get('name')}"
            if row.tag == "param":
                words.append(f"p:{name}={row.text}")
            elif row.tag.endswith("_interface"):
                initial = row.findtext("param")
                words.append(f"{row.tag[0]}:{name}" + (f"={initial}" if initial else ""))
    with System(program, f"socket={robot.path}", "misses=1000", *words) as system:
        system.goes("init", "configure", "activate", "cycle 20", "deactivate", "cleanup")


def test_the_package_passes_its_own_tests_and_linters(program: Path) -> None:
    """As `colcon test` runs them, with the programs of ament that Debian has."""
    done = subprocess.run(
        ["ctest", "--output-on-failure"], cwd=program.with_name("build"),
        capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    passed = set(re.findall(r"Test +#\d+: (\w+) \.+ +Passed", done.stdout))
    assert passed == {"cpplint", "flake8", "lint_cmake", "pep257", "test_cell", "xmllint"}


def test_inputs_are_newer_when_read_waits_for_the_cycle(program: Path, robot: Master) -> None:
    """A clock that is not that of the bus meets each age up to the period of the bus."""

    def ages(way: str, period_us: int = 700) -> list[float]:
        words = [robot.path, "el6910.logic_state", way, str(period_us), "300"]
        done = subprocess.run(
            [program.with_name("build") / "measure_age", *words],
            capture_output=True, text=True, check=False, timeout=PATIENCE_S,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return [float(word) for word in done.stdout.split()]

    # A machine that stands still makes every age large; then it is measured again.
    runs = ((ages("wait"), ages("poll")) for _ in range(10))
    assert any(0 < waiting[0] < polled[0] < 1000 for waiting, polled in runs)


def test_ament_installs_the_package(program: Path) -> None:
    out = program.with_name("out")
    assert (out / "lib" / "libfsoe_net_ros.so").is_file()
    assert (out / "share/ament_index/resource_index/packages/fsoe_net_ros").is_file()
    files = {p.name for p in (out / "share" / "fsoe_net_ros").rglob("*")}
    assert {"package.xml", "fsoe_net_ros.xml", "cell.launch.py", "controllers.yaml"} <= files
    assert {"README.md", "CHANGELOG.rst", "LICENSE", "export_fsoe_net_rosExport.cmake"} <= files


def test_the_package_states_what_the_index_of_ros_requires() -> None:
    root = ET.parse(PACKAGE / "package.xml").getroot()
    assert root.findtext("license") == "Apache-2.0"
    assert (PACKAGE / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
    launches = (PACKAGE / "launch" / "cell.launch.py").read_text("utf-8")
    imported = {m.partition(".")[0] for m in re.findall(r"^from (\S+)", launches, re.M)}
    started = set(re.findall(r'package="(\w+)"', launches)) - {"rviz2"}  # large, and an option
    config = (PACKAGE / "config" / "controllers.yaml").read_text("utf-8")
    controllers = set(re.findall(r"type: (\w+)/", config))
    stated = {row.text for row in root.findall("exec_depend")}
    assert (imported - sys.stdlib_module_names) | started | controllers <= stated


def launched(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Any]]:
    """Return the actions of the launch file, with its substitutions as plain text."""
    names = {
        "launch": ("LaunchDescription",),
        "launch.actions": ("DeclareLaunchArgument", "OpaqueFunction"),
        "launch.conditions": ("IfCondition",),
        "launch.substitutions": ("Command", "LaunchConfiguration", "PathJoinSubstitution"),
        "launch_ros": (),
        "launch_ros.actions": ("Node",),
        "launch_ros.parameter_descriptions": ("ParameterValue",),
        "launch_ros.substitutions": ("FindPackageShare",),
    }
    made = {
        "LaunchDescription": lambda rows: rows,
        "Command": "".join,
        "LaunchConfiguration": lambda name: f"<{name}>",
        "PathJoinSubstitution": "/".join,
        "ParameterValue": lambda value, **_: value,
        "FindPackageShare": str,
        "IfCondition": str,
        "OpaqueFunction": lambda function: (function.__name__, function),
        "DeclareLaunchArgument": lambda name, **more: (name, more),
        "Node": lambda **more: (more["executable"], more),
    }
    for module, kinds in names.items():
        fake = ModuleType(module)
        vars(fake).update({kind: made[kind] for kind in kinds})
        monkeypatch.setitem(sys.modules, module, fake)
    file = runpy.run_path(str(PACKAGE / "launch" / "cell.launch.py"))
    return list(file["generate_launch_description"]())


def test_the_launch_file_gives_the_socket_and_waits_for_fsn_master(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Parameters of controller_manager 4.46: its default ends it when a component is not active."""
    rows = dict(launched(monkeypatch))
    assert {"description", "socket", "controllers"} <= rows.keys()
    robot, controllers, more = rows["ros2_control_node"]["parameters"]
    assert (robot["robot_description"], controllers, more) == (
        "xacro <description> socket:=<socket>",
        "<controllers>",
        {"hardware_components_initial_state.shutdown_on_initial_state_failure": False},
    )
    name, *given_file = rows["spawner"]["arguments"]
    assert (name, given_file) == ("joint_state_broadcaster", ["--param-file", "<controllers>"])
    target = tmp_path / "cell.urdf.xacro"
    converted(EXAMPLES / "el6910" / "network.yaml", target=target)
    words = ["xacro", str(target), "socket:=/tmp/s"]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=PATIENCE_S)
    (hardware,) = ET.fromstring(done.stdout).iter("hardware")
    given = {row.get("name"): row.text for row in hardware.iter("param")}
    assert given["socket"] == "/tmp/s"
    default = ET.parse(target).find("{http://www.ros.org/wiki/xacro}arg")
    assert default is not None
    assert rows["socket"]["default_value"] == default.get("default")


def test_the_files_around_it_name_what_is_there() -> None:
    plugins = list(ET.parse(PACKAGE / "fsoe_net_ros.xml").getroot().iter("class"))
    rows = {(row.get("type", ""), row.get("base_class_type", "")) for row in plugins}
    text = "".join(path.read_text("utf-8") for path in (PACKAGE / "src").iterdir())
    assert set(re.findall(r"PLUGINLIB_EXPORT_CLASS\((\S+), (\S+)\)", text)) == rows
    assert {row.get("name", "").replace("/", "::") for row in plugins} == {name for name, _ in rows}
    ast.parse((PACKAGE / "launch" / "cell.launch.py").read_text("utf-8"))
    includes = re.findall(r"#include <((?:hardware_interface|rclcpp|pluginlib)[^>]*)>", text)
    stubs = PACKAGE / "test" / "stubs"
    assert [i for i in includes if not list(stubs.glob(i)) + list(stubs.glob(f"*/{i}"))] == []
