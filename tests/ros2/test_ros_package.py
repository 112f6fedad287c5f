"""The package `ros/fsoe_net_ros`: its class beside fsn-master, its adapter against stubs."""

from __future__ import annotations

import ast
import fcntl
import hashlib
import os
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import pytest
from cli.tool import fsn
from master.rig import Client, Master
from master.rig import running as master_running
from networks import EXAMPLES, example
from ros2.rig import System
from run.test_live_bus import ESTOP, on_the_wire

from fsoe_net.plan.codec import decode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.testing.fake_master import FakeMaster

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "ros" / "fsoe_net_ros"
CORE = ROOT / "master_core"
REQUIRED = "ros2" in os.environ.get("FSN_REQUIRE", "").split(",")
LAMP, POSITION = "el2904/standard_1", "drive_1/position"


@pytest.fixture(scope="session")
def program() -> Path:
    """Have ament build the package against the stubs, once, and what stands in for a manager.

    Returns:
        The stand-in, which has the library of the package; beside it ``out``, what is installed.
    """
    cmake, compiler = shutil.which("cmake"), shutil.which("g++")
    there = [Path("/usr/share") / p for p in ("ament_cmake", "cmake/nlohmann_json")]
    if cmake is None or compiler is None or not all(path.is_dir() for path in there):
        why = "needs g++, cmake, ament-cmake and nlohmann-json3-dev of Debian"
        (pytest.fail if REQUIRED else pytest.skip)(why)
    sources = sorted(p for p in PACKAGE.rglob("*") if p.is_file())
    whole = b"".join(p.read_bytes() for p in (*sources, CORE / "src" / "client" / "client.c"))
    folder = ROOT / "build" / "ros-package" / hashlib.sha256(whole).hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    made = folder / "drive_system"
    with open(folder / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not made.exists():
            _build(cmake, compiler, folder, made)
    return made


def _build(cmake: str, compiler: str, folder: Path, made: Path) -> None:
    build, out = folder / "build", folder / "out"
    config = folder / "prefix" / "lib" / "cmake" / "fsn"
    config.mkdir(parents=True, exist_ok=True)
    (config / "fsnConfig.cmake").write_text(
        f"""enable_language(C)
add_library(fsn_client STATIC {CORE}/src/client/client.c)
add_library(fsn::fsn_client ALIAS fsn_client)
set_target_properties(fsn_client PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_include_directories(fsn_client PUBLIC {CORE}/include {CORE}/src)
""",
        "utf-8",
    )
    options = {
        "FSN_ROS_STUBS": "ON",
        "CMAKE_CXX_FLAGS": "-Werror",
        "CMAKE_PREFIX_PATH": folder / "prefix",
        "CMAKE_INSTALL_PREFIX": out,
        "Python3_EXECUTABLE": "/usr/bin/python3",
    }
    given = [f"-D{name}={value}" for name, value in options.items()]
    stand_in = [
        compiler,
        "-std=c++17",
        f"-I{PACKAGE}/test/stubs",
        f"{PACKAGE}/test/drive_system.cpp",
    ]
    library = [f"-L{build}", "-lfsoe_net_ros", f"-Wl,-rpath,{build}"]
    for words in (
        [cmake, "-S", PACKAGE, "-B", build, *given],
        [cmake, "--build", build],
        [cmake, "--install", build],
        [*stand_in, "-o", made, *library],
    ):
        done = subprocess.run(map(str, words), capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def robot() -> Iterator[Master]:
    with master_running(name="el6910") as master:
        yield master


@pytest.fixture
def reader(robot: Master) -> Iterator[Client]:
    with robot.client() as client:
        yield client


def test_a_lifecycle_from_configure_to_cleanup(
    program: Path, robot: Master, reader: Client
) -> None:
    names = (f"s:{LAMP}", f"c:{LAMP}", "s:el6910-el1904/in_data", "s:el6910-el1904/state")
    with System(program, f"socket={robot.path}", "misses=1000", *names) as system:
        system.goes("init", "configure")
        system.until(f"get {LAMP}", "0")
        assert system.ask("get el6910-el1904/in_data") == "0"  # nobody is at its ends
        assert system.ask("get el6910-el1904/state") == "0"
        system.goes("activate", f"set {LAMP} 1")
        system.until(f"get {LAMP}", "1")
        assert reader.value("el2904.standard_1") is True
        system.goes("deactivate")
        reader.wait_for("el2904.standard_1", False)
        system.goes("cycle 3", "activate", "cycle 3")
        assert reader.value("el2904.standard_1") is False  # the old command counts no longer
        system.goes(f"set {LAMP} 1")
        system.until(f"get {LAMP}", "1")
        system.goes("cleanup")
        reader.wait_for("el2904.standard_1", False)


def test_a_target_position_without_a_command_follows_the_axis(
    program: Path, robot: Master, reader: Client
) -> None:
    names = (f"s:{POSITION}", f"c:{POSITION}", "c:drive_1/0x60ff:00")
    with System(program, f"socket={robot.path}", "misses=1000", *names) as system:
        system.goes("init", "configure", "activate", f"set {POSITION} 4711")
        system.until(f"get {POSITION}", "4711")
        system.goes(f"set {POSITION} nan")
        system.until(f"get {POSITION}", "0")  # where the emulated axis is
        system.goes("set drive_1/0x60ff:00 1e30")
        assert system.ask("cycle 3") == "write ERROR"
        assert "drive_1/0x60ff:00 cannot take 1" in system.end()


@pytest.mark.parametrize(
    ("words", "line", "text"),
    [
        (["s:el2904/lamp"], "configure", "the plan has no state el2904/lamp"),
        (["c:drive_1/velocity"], "configure", "the plan has no output drive_1/velocity"),
        (["c:el6910/logic_control"], "activate", "logic_control"),
        (["misses=x"], "init", "param `misses` of the hardware is no whole number: x"),
        (["socket=/nowhere/s"], "configure", "nobody answers on /nowhere/s"),
        (["socket="], "init", "the hardware has no param `socket`"),
    ],
)
def test_what_is_wrong_is_said_and_an_error(
    program: Path, robot: Master, words: list[str], line: str, text: str
) -> None:
    with System(program, f"socket={robot.path}", *words) as system:
        steps = ["init", "configure", "activate"]
        system.goes(*steps[: steps.index(line)])
        assert system.ask(line) == "ERROR"
        assert text in system.end()


def test_a_bus_that_stops_is_an_error_and_may_be_started(program: Path) -> None:
    with master_running(name="estop") as master, master.client() as client:
        with System(program, f"socket={master.path}", "s:ek1914/input_1") as system:
            system.goes("init", "configure", "activate", "cycle 3")
            client.good("stop")
            while (answer := system.ask("cycle 1")) == "OK":
                pass
            assert answer == "read ERROR"
            while client.good("status")["state"] != "stopped":
                pass
            assert system.ask("configure") == "ERROR"
            said = system.end()
            assert "the bus was stopped, or fsn-master has ended" in said
            assert "the bus does not run (stopped)" in said
        with System(program, f"socket={master.path}", "start=true", "s:ek1914/input_1") as system:
            system.goes("init", "configure", "activate", "cycle 3")


def test_commands_that_come_too_late_are_taken_back(
    program: Path, robot: Master, reader: Client
) -> None:
    with System(program, f"socket={robot.path}", "misses=0", f"c:{LAMP}") as system:
        system.goes("init", "configure", "activate", f"set {LAMP} 1")
        system.ask("cycle 1")
        reader.wait_for("el2904.standard_1", False)
        while (answer := system.ask("cycle 1")) == "OK":
            pass
        assert answer == "read ERROR"
        assert "their stop values" in system.end()


def test_an_answer_that_is_none_is_an_error(program: Path) -> None:
    """A fake that has no memory to share, and one that answers nonsense."""
    with FakeMaster() as master:
        with System(program, f"socket={master.path}", "s:c1/state") as system:
            system.goes("init")
            assert system.ask("configure") == "ERROR"
        master.state = "failed"
        with System(program, f"socket={master.path}") as system:
            system.goes("init")
            assert system.ask("configure") == "ERROR"
            assert "the bus does not run (failed)" in system.end()


def test_the_states_of_a_connection_are_those_of_real_frames(program: Path, tmp_path: Path) -> None:
    """fsn-master on SOEM and emulated SubDevices with FSoE: e-stop, a cable cut, and back."""
    seen = on_the_wire("adapter", ESTOP, program, tmp=tmp_path, script="ros2_rig.py")
    assert seen["pressed"] == ["1", "5"]  # Data, with FailSafeData
    assert seen["released"] == ["1", "6"]
    assert seen["cut"] == "read ERROR"
    assert "SubDevices" in seen["said"]
    assert seen["back"] == "1"


@pytest.mark.parametrize("name", ["el6910", "estop", "legs"])
def test_the_converted_description_has_the_names_of_the_plan(name: str, tmp_path: Path) -> None:
    target = tmp_path / "ros2_control.urdf.xacro"
    done = fsn("convert", str(EXAMPLES / name / "network.yaml"), "-o", str(target))
    assert done.returncode == 0, done.stderr
    root = ET.parse(target).getroot()
    plan = decode_plan(compile_plan(example(name)).to_bytes())
    outputs = {s.name for s in plan.symbols if s.output and not s.restart_relevant}
    inputs = {s.name for s in plan.symbols if not s.output}
    found: dict[str, set[str]] = {"command_interface": set(), "state_interface": set()}
    for component in (*root.iter("joint"), *root.iter("gpio")):
        for side, names in found.items():
            names |= {f"{component.get('name')}.{row.get('name')}" for row in component.iter(side)}
    assert found == {"command_interface": outputs, "state_interface": inputs}
    sensors = {s.get("name") for s in root.iter("sensor")}
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
            if row.tag.endswith("_interface"):
                words.append(f"{row.tag[0]}:{component.get('name')}/{row.get('name')}")
    with System(program, f"socket={robot.path}", "misses=1000", *words) as system:
        system.goes("init", "configure", "activate", "cycle 20", "deactivate", "cleanup")


def test_ament_installs_the_package(program: Path) -> None:
    out = program.with_name("out")
    assert (out / "lib" / "libfsoe_net_ros.so").is_file()
    assert (out / "share/ament_index/resource_index/packages/fsoe_net_ros").is_file()
    files = {p.name for p in (out / "share" / "fsoe_net_ros").rglob("*")}
    assert {"package.xml", "fsoe_net_ros.xml", "cell.launch.py", "controllers.yaml"} <= files


def test_the_files_around_it_name_what_is_there() -> None:
    plugin = ET.parse(PACKAGE / "fsoe_net_ros.xml").getroot().find("class")
    assert plugin is not None
    text = (PACKAGE / "src" / "cell_system.cpp").read_text("utf-8")
    assert f"PLUGINLIB_EXPORT_CLASS({plugin.get('type')}, {plugin.get('base_class_type')})" in text
    ast.parse((PACKAGE / "launch" / "cell.launch.py").read_text("utf-8"))
    includes = re.findall(r"#include <((?:hardware_interface|rclcpp|pluginlib)[^>]*)>", text)
    assert [i for i in includes if not (PACKAGE / "test" / "stubs" / i).is_file()] == []
    assert "Not built with ROS" in (PACKAGE / "package.xml").read_text("utf-8")
