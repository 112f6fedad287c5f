"""`cell.launch.py` of `ros/fsoe_net_ros`, as ``ros2 launch`` of an installation runs it."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from cli.tool import fsn
from master.rig import running as master_running
from networks import EXAMPLES
from patience import PATIENCE_S
from ros2.manager import Started, environment_with, find_program, ros2_words
from ros2.rig import bridged

pytestmark = pytest.mark.skipif(
    find_program("robot_state_publisher", "robot_state_publisher") is None,
    reason="needs ros2launch, ros2_control and robot_state_publisher of a sourced ROS 2",
)
NETWORK = EXAMPLES / "robot-cell" / "network.yaml"
AXES = ("axis_1", "axis_2")


@pytest.fixture
def description(tmp_path: Path) -> Path:
    path = tmp_path / "ros2_control.urdf.xacro"
    done = fsn("convert", str(NETWORK), "-o", str(path))
    assert done.returncode == 0, done.stderr
    text, start = path.read_text("utf-8"), '<param name="start">false</param>'
    patience = '<param name="misses">1000</param><param name="lost_ms">5000</param>'
    assert start in text
    path.write_text(text.replace(start, start + patience), "utf-8")  # for a busy machine
    return path


def launch_words(description: Path, socket: Path, *more: str) -> list[str]:
    words = ("launch", "fsoe_net_ros", "cell.launch.py")
    return ros2_words(*words, f"description:={description}", f"socket:={socket}", *more)


@pytest.fixture
def viewer(tmp_path: Path) -> Path:
    """A package rviz2 whose program writes down its arguments."""
    folder = tmp_path / "viewer"
    marker = folder / "share" / "ament_index" / "resource_index" / "packages" / "rviz2"
    program = folder / "lib" / "rviz2" / "rviz2"
    for file, text in ((marker, ""), (program, f'#!/bin/sh\necho "$@" > {folder}/arguments\n')):
        file.parent.mkdir(parents=True)
        file.write_text(text, "utf-8")
    program.chmod(0o755)
    return folder


def ended_cleanly(started: Started) -> int:
    return started.said().count("process has finished cleanly")


@pytest.fixture
def launched(
    package: Path, description: Path, viewer: Path, tmp_path: Path
) -> Iterator[tuple[Started, int]]:
    with (
        master_running(name="robot-cell") as master,
        bridged(master.path, name="fsoe_net") as domain,
    ):
        environment = environment_with(package, domain)
        environment["AMENT_PREFIX_PATH"] += f":{viewer}"
        words = launch_words(description, master.path, "rviz:=true")
        with Started(tmp_path / "log", environment, *words) as started:
            started.until_states(cell="active", joint_state_broadcaster="active")
            started.until(lambda: ended_cleanly(started) == 2)  # spawner, and `viewer`
            yield started, master.process.pid


def test_the_launch_file_publishes_joints_and_frames_until_it_is_interrupted(
    launched: tuple[Started, int],
) -> None:
    started, master = launched
    assert started.joints().keys() == {*AXES}
    started.until(lambda: len(started.ask("frames")) == len(AXES))
    assert started.ask("frames") == [["world", f"{axis}_link"] for axis in AXES]
    ours = {f"/fsoe_net/inputs/{axis}/position" for axis in AXES} | {"/diagnostics"}
    started.until(lambda: ours <= started.ask("publishers").keys())
    os.kill(started.node.pid, signal.SIGINT)
    assert started.node.wait(PATIENCE_S) == 0
    assert "Successful 'shutdown' of hardware 'cell'" in started.said()
    assert ended_cleanly(started) == 4, started.said()
    os.kill(master, 0)  # the bus continues


def test_rviz_shows_what_the_launch_file_publishes(
    launched: tuple[Started, int], viewer: Path, package: Path
) -> None:
    started, _ = launched
    file = package / "share" / "fsoe_net_ros" / "config" / "cell.rviz"
    assert (viewer / "arguments").read_text("utf-8").split()[:2] == ["-d", str(file)]
    config = yaml.safe_load(file.read_text("utf-8"))["Visualization Manager"]
    started.until(lambda: len(started.ask("frames")) == len(AXES))
    assert config["Global Options"]["Fixed Frame"] in {frame for frame, _ in started.ask("frames")}
    topics = [v for row in config["Displays"] for v in row.values() if isinstance(v, dict)]
    assert [topic["Value"] for topic in topics] == ["/robot_description"]
    started.until(lambda: {"/robot_description", "/tf"} <= started.ask("publishers").keys())
    keeps = started.ask("publishers")
    assert [topic["Durability Policy"] == "Transient Local" for topic in topics] == [
        keeps[topic["Value"]] for topic in topics
    ]


def test_it_waits_for_fsn_master(
    package: Path, domain: int, description: Path, tmp_path: Path
) -> None:
    """And what the page states then, once fsn-master runs."""
    socket = tmp_path / "s"
    environment = environment_with(package, domain)
    with Started(tmp_path / "log", environment, *launch_words(description, socket)) as started:
        started.until(lambda: f"no answer on {socket}" in started.said())
        started.until(lambda: "[spawner-3]: process has died" in started.said())
        started.until_states(cell="unconfigured")
        with master_running(name="robot-cell") as master:
            socket.symlink_to(master.path)
            for words in (
                ("control", "set_hardware_component_state", "cell", "active"),
                ("daemon", "stop"),  # which the first has started
                ("run", "controller_manager", "spawner", "joint_state_broadcaster"),
            ):
                subprocess.run(ros2_words(*words), env=environment, check=True, timeout=PATIENCE_S)
            started.until_states(cell="active", joint_state_broadcaster="active")
            assert started.joints().keys() == {*AXES}


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (
            ["description:=missing.xacro"],
            "missing.xacro is not a file; `fsoe-net convert` writes it",
        ),
        ([f"description:={NETWORK}"], "XML parsing error"),
        ([], "missing required argument 'description'"),
    ],
)
def test_a_wrong_description_ends_it(
    package: Path, domain: int, words: list[str], reason: str
) -> None:
    done = subprocess.run(
        ros2_words("launch", "fsoe_net_ros", "cell.launch.py", *words),
        env=environment_with(package, domain), capture_output=True, text=True,
        check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 1
    assert reason in done.stdout + done.stderr
