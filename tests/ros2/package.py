"""The package `ros/fsoe_net_ros`, built against stubs of ros2_control, and an axis for it."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import math
import os
import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import EXAMPLES

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "ros" / "fsoe_net_ros"
CORE = ROOT / "master_core"
REQUIRED = "ros2" in os.environ.get("FSN_REQUIRE", "").split(",")
GENERATIONS = ("jazzy", "humble", "rolling")
COUNTS_PER_RAD = 65536 / math.tau  # of an emulated drive


def built(generation: str) -> Path:
    """Have ament build the package against the stubs, once, and what stands in for a manager.

    Returns:
        The stand-in, which has the library of the package; beside it ``out``, what is installed.
    """
    compiler = shutil.which("g++")
    parts = ("share/ament_cmake_gtest", "share/ament_cmake_cpplint", "share/cmake/nlohmann_json",
             "include/tinyxml2.h")  # fmt: skip
    there = [Path("/usr") / part for part in parts]
    if shutil.which("cmake") is None or compiler is None or not all(p.exists() for p in there):
        why = "needs g++, cmake and the packages that .ci/run installs for ament"
        (pytest.fail if REQUIRED else pytest.skip)(why)
    with _folder(generation) as folder:
        made = folder / "drive_system"
        if not made.exists():
            _install(folder, FSN_ROS_STUBS=generation, Python3_EXECUTABLE="/usr/bin/python3")
            _build_stand_in(compiler, generation, folder)
        return made


def built_with_ros(python: str) -> Path:
    """Have ament build the package against the installation of ROS, once.

    Args:
        python: that of the installation.

    Returns:
        The folder where it is installed.
    """
    installation = hashlib.sha256(os.environ["AMENT_PREFIX_PATH"].encode()).hexdigest()[:16]
    with _folder(installation) as folder:
        if not (folder / "out" / "lib").exists():
            _install(folder, BUILD_TESTING="OFF", Python3_EXECUTABLE=python)
        return folder / "out"


@contextlib.contextmanager
def _folder(name: str) -> Iterator[Path]:
    """Yield, to one process at a time, the folder of a build of the sources as they are now."""
    sources = sorted(p for p in PACKAGE.rglob("*") if p.is_file())
    client = sorted((CORE / "src" / "client").glob("*.c"))
    whole = b"".join(p.read_bytes() for p in (*sources, *client))
    folder = ROOT / "build" / "ros-package" / hashlib.sha256(whole).hexdigest()[:16] / name
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield folder


def _install(folder: Path, **options: str) -> None:
    """Configure, build and install the package."""
    build = folder / "build"
    given = {"CMAKE_CXX_FLAGS": "-Werror", "CMAKE_INSTALL_PREFIX": folder / "out"} | options
    # As in a workspace of colcon: a link leads to the package.
    link = folder / "src"
    link.unlink(missing_ok=True)
    link.symlink_to(PACKAGE)
    _run("cmake", "-S", link, "-B", build, *(f"-D{name}={given[name]}" for name in given))
    _run("cmake", "--build", build)
    _run("cmake", "--install", build)


def _build_stand_in(compiler: str, generation: str, folder: Path) -> None:
    build = folder / "build"
    stubs = PACKAGE / "test" / "stubs"
    folders = [stubs, stubs / generation]
    folders += [stubs / "shared_handles"] if generation != "humble" else []
    words = ["-std=c++17", "-Wl,--no-as-needed", *(f"-I{f}" for f in folders)]
    library = [f"-L{build}", "-lfsoe_net_ros", "-ltinyxml2", f"-Wl,-rpath,{build}"]
    target = folder / "drive_system"
    _run(compiler, *words, f"{PACKAGE}/test/drive_system.cpp", "-o", target, *library)


def _run(*words: str | Path) -> None:
    done = subprocess.run(map(str, words), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def motors(folder: Path) -> Path:
    """Write a scenario without steps, whose first axis is not at 0."""
    scenario = folder / "motors.yaml"
    text = (EXAMPLES / "robot-cell" / "scenario.yaml").read_text("utf-8")
    text = text.partition("\nsteps:")[0].replace("duration_s: 4\n", "")
    assert "axis_1: {" in text
    scenario.write_text(text.replace("axis_1: {", "axis_1: {position_rev: 0.25, "), "utf-8")
    return scenario


def reversed_cell(folder: Path, *further: str) -> Path:
    """Copy the robot cell, with positions and further interfaces in radians, backwards."""
    for name in ("robot-cell", "el6910"):
        shutil.copytree(EXAMPLES / name, folder / name)
    drive = folder / "robot-cell" / "devices" / "drive.yaml"
    text = drive.read_text("utf-8")
    for name in ("position", *further):
        for side, factor in (("command", -COUNTS_PER_RAD), ("state", -1 / COUNTS_PER_RAD)):
            old = f"{side}_interface: {name}}}"
            assert text.count(old) == 1
            text = text.replace(old, f"{old[:-1]}, factor: {factor!r}}}")
    drive.write_text(text, "utf-8")
    return folder / "robot-cell" / "network.yaml"


def interfaces(component: ET.Element) -> dict[tuple[str, str], str]:
    """Return the symbol of each interface by kind and name, as the package finds it."""
    given = {row.get("name", ""): row.text or "" for row in component.findall("param")}
    owner = given.get("subdevice", component.get("name", ""))
    return {
        (row.tag, name): given.get(f"{row.tag}/{name}", f"{owner}.{name}")
        for row in component
        if row.tag.endswith("_interface")
        for name in [row.get("name", "")]
    }


def converted(*words: str | Path, target: Path) -> dict[str, dict[tuple[str, str], str]]:
    """Convert to ros2_control; return the interfaces of each joint and gpio by its name."""
    done = fsn("convert", *map(str, words), "-o", str(target))
    assert done.returncode == 0, done.stderr
    (block,) = ET.parse(target).getroot().iter("ros2_control")
    return {c.get("name", ""): interfaces(c) for c in block if c.tag in ("joint", "gpio")}
