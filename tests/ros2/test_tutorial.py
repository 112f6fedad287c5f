"""The tutorial for users of ethercat_driver_ros2: its commands run on the emulated bus."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from networks import EXAMPLES
from ros2.page import Session, page_commands
from ros2.rig import own_domain

PAGE = (EXAMPLES.parent / "docs" / "tutorial" / "robot.md").read_text("utf-8")
COMMANDS = page_commands(PAGE)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, dict[str, str]]]:
    """Run every command of the page in its order; yield the folder and the outputs."""
    folder = tmp_path_factory.mktemp("page")
    for name in ("robot-cell", "el6910"):
        shutil.copytree(EXAMPLES / name, folder / "examples" / name)
    with own_domain() as domain, ExitStack() as stack:
        shell = Session(folder, domain, stack)
        yield folder, {line: shell.run(line) for line in COMMANDS}


def output(said: dict[str, str], begin: str) -> str:
    (found,) = [text for line, text in said.items() if line.startswith(begin)]
    return found


def test_each_command_does_what_the_page_states(session: tuple[Path, dict[str, str]]) -> None:
    folder, said = session
    assert "robot_cell: 5 SubDevices, 3 FSoE connections" in output(
        said, "fsoe-net check my/robot-cell/robot.urdf.xacro my"
    )
    assert "unbound: nothing" in output(said, "fsoe-net graph")
    assert "6 copies, 3 connections" in output(said, "fsoe-net plan")
    run = output(said, "fsoe-net run")
    assert run.count("Data · ProcessData  ") == 3
    assert "8 of 8 expectations held" in run
    assert "axis_1: the command position has no factor" in output(said, "fsoe-net convert")
    assert (folder / "robot.svg").read_text("utf-8").startswith("<svg")


def test_the_recording_has_the_topics_of_the_page(session: tuple[Path, dict[str, str]]) -> None:
    from mcap.reader import make_reader

    folder, _ = session
    with open(folder / "robot.mcap", "rb") as file:
        topics = {c.topic for _, c, _ in make_reader(file).iter_messages()}
    assert {
        "/diagnostics",
        "/fsoe_net/hardware_status",
        "/fsoe_net/inputs/axis_1/position",
    } <= topics


def test_only_the_plugin_of_the_hardware_changes(session: tuple[Path, dict[str, str]]) -> None:
    folder, _ = session
    before, after = (
        (folder / name / "robot-cell" / "robot.urdf.xacro").read_text("utf-8").splitlines()
        for name in ("examples", "my")
    )
    (row,) = [new for old, new in zip(before, after, strict=True) if old != new]
    assert row.strip() == "<plugin>fsoe_net_ros/EthercatDriver</plugin>"
