"""The picture of a robot: its lines are those of the files, and its red ends those of the check."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest
from cases_file import DIAGNOSTICS
from cli.tool import fsn
from networks import EXAMPLES
from studio.browser import chromium  # noqa: F401 - a fixture

from fsoe_net.document.style import standalone_picture
from fsoe_net.project.check import Checked, check_files
from fsoe_net.report.robot_boxes import EndState, RobotGraph, robot_graph
from fsoe_net.report.robot_picture import robot_picture

CELL = ("robot.urdf.xacro", "controllers.yaml")
HOSTILE = "&lt;/title>&lt;script>alert(1)&lt;/script>"


def cell() -> tuple[Checked, RobotGraph]:
    checked = check_files([str(EXAMPLES / "robot-cell" / name) for name in CELL])
    assert checked.resolution is not None
    return checked, robot_graph(checked.resolution, checked.diagnostics)


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    shutil.copytree(DIAGNOSTICS / "base", tmp_path / "robot")
    return tmp_path / "robot"


def change(file: Path, find: str, put: str) -> None:
    text = file.read_text("utf-8")
    assert find in text
    file.write_text(text.replace(find, put), "utf-8")


def graph_of(folder: Path) -> RobotGraph:
    checked = check_files([str(folder / "robot.urdf"), str(folder / "controllers.yaml")])
    assert checked.resolution is not None
    return robot_graph(checked.resolution, checked.diagnostics)


def ends(graph: RobotGraph, state: EndState) -> set[tuple[str, str]]:
    boxes = (*graph.controllers, *graph.components)
    return {(b.name, e.name) for b in boxes for e in b.ends if e.state is state}


def test_lines_join_what_the_files_of_the_cell_join():
    _, graph = cell()
    parts = (graph.controllers, graph.components, graph.subdevices)
    assert [[b.name for b in boxes] for boxes in parts] == [
        ["joint_state_broadcaster", "arm", "panel_state"],
        ["axis_1", "axis_2", "panel"],
        ["axis_1", "axis_2", "el6910", "el1904", "el1008"],
    ]
    claims = {
        (
            graph.controllers[line.left[0]].name,
            graph.components[line.right[0]].name,
            graph.components[line.right[0]].ends[line.right[1]].name,
            line.is_command,
        )
        for line in graph.claims
    }
    axes = ("axis_1", "axis_2")
    assert claims == {
        *(("joint_state_broadcaster", a, i, False) for a in axes for i in ("position", "velocity")),
        *(("arm", a, i, False) for a in axes for i in ("position", "velocity")),
        *(("arm", a, "position", True) for a in axes),
        ("panel_state", "panel", "start", False),
    }
    bindings = {
        (
            graph.components[line.left[0]].name,
            graph.subdevices[line.right[0]].name,
            graph.subdevices[line.right[0]].ends[line.right[1]].at,
        )
        for line in graph.bindings
    }
    objects = ("0x607a:00", "0x6064:00", "0x606c:00")  # of examples/robot-cell/devices/drive.yaml
    assert bindings == {
        *((a, a, o) for a in axes for o in objects),
        ("panel", "el1008", "0x6000:01"),
    }
    names = [box.name for box in graph.subdevices]
    assert [(names[c.main], names[c.sub]) for c in graph.safety] == [
        ("el6910", "el1904"),
        ("el6910", "axis_1"),
        ("el6910", "axis_2"),
    ]
    assert graph.unbound == ()


def test_a_channel_is_bound_to_the_joint_that_it_is_for(robot: Path):
    urdf = robot / "robot.urdf"
    joint = re.search(r"<joint.*</joint>", urdf.read_text("utf-8"), re.DOTALL)
    assert joint is not None
    change(urdf, joint[0], joint[0] + joint[0].replace('<joint name="axis">', '<joint name="b">'))
    change(
        robot / "devices" / "drive.yaml", "command_interface: pos", "for: b, command_interface: pos"
    )
    graph = graph_of(robot)
    (line,) = graph.bindings
    assert graph.components[line.left[0]].name == "b"
    assert ends(graph, EndState.WRONG) == {("axis", "position")}


def test_each_line_of_the_graph_is_drawn():
    _, graph = cell()
    root = ElementTree.fromstring(robot_picture(graph))
    paths = [p.get("style", "") for p in root.iter("path")]
    legend = 1  # each kind of line is explained once
    assert sum("--c0" in p for p in paths) == 4 + legend
    assert sum("--c2" in p for p in paths) == 14 + legend
    assert sum("--c4" in p for p in paths) == 3 + legend
    assert sum("--red" in p for p in paths) == legend
    assert root.get("aria-label", "").endswith("unbound: nothing")


def test_an_end_that_the_check_reports_is_red_and_has_a_cross(robot: Path):
    change(robot / "controllers.yaml", "joints: [axis]", "joints: [axis, axis_9]")
    change(
        robot / "robot.urdf",
        '<command_interface name="position"/>',
        '<command_interface name="position"/><command_interface name="speed"/>',
    )
    graph = graph_of(robot)
    assert ends(graph, EndState.WRONG) == {("axes", "axis_9/position"), ("axis", "speed")}
    root = ElementTree.fromstring(robot_picture(graph))
    red = [t.text for t in root.iter("text") if "--red" in t.get("style", "")]
    assert red == ["✖ axis_9/position", "✖ speed"]
    assert root.get("aria-label", "").endswith("unbound: axes axis_9/position, axis speed")


def test_an_interface_that_other_hardware_may_offer_is_open_and_not_red(robot: Path):
    change(robot / "controllers.yaml", "joints: [axis]", "joints: [axis, finger]")
    change(
        robot / "robot.urdf",
        "</robot>",
        '<ros2_control name="g" type="system"><hardware><plugin>a/Gripper</plugin></hardware>'
        "</ros2_control></robot>",
    )
    graph = graph_of(robot)
    assert ends(graph, EndState.WRONG) == set()
    assert ("axes", "finger/position") in ends(graph, EndState.OPEN)


def test_a_picture_of_hostile_names_has_no_markup_of_theirs(robot: Path):
    change(robot / "robot.urdf", '<joint name="axis">', f'<joint name="{HOSTILE}{"x" * 5000}">')
    svg = robot_picture(graph_of(robot))
    assert "<script" not in svg
    root = ElementTree.fromstring(svg)
    assert max(len(t.text or "") for t in (*root.iter("text"), *root.iter("title"))) <= 230


def test_a_huge_robot_makes_a_picture_of_bounded_size(robot: Path):
    interfaces = "".join(f'<state_interface name="i{n}"/>' for n in range(3000))
    joints = "".join(f'<joint name="j{n}"/>' for n in range(1000))
    change(robot / "robot.urdf", '<joint name="axis">', f'{joints}<joint name="axis">{interfaces}')
    change(robot / "controllers.yaml", "joints: [axis]", f"joints: [{'axis, ' * 3000}axis]")
    svg = robot_picture(graph_of(robot))
    assert len(svg) < 200_000
    assert "boxes not drawn: " in svg


def test_the_picture_fits_its_boxes(chromium, tmp_path: Path):  # noqa: F811
    _, graph = cell()
    file = tmp_path / "robot.svg"
    file.write_text(standalone_picture(robot_picture(graph)), "utf-8")
    page = chromium.new_page(viewport={"width": 1280, "height": 800})
    page.goto(file.as_uri())
    wide = page.evaluate(
        """() => [...document.querySelectorAll("g")].filter(g => g.querySelector("rect.box"))
          .flatMap(g => { const box = g.querySelector("rect").getBoundingClientRect()
            return [...g.querySelectorAll("text")].filter(
              t => t.getBoundingClientRect().right > box.right).map(t => t.textContent) })"""
    )
    assert wide == []


@pytest.mark.parametrize("suffix", ["svg", "html"])
def test_graph_writes_a_picture_or_a_page(suffix: str, tmp_path: Path):
    out = tmp_path / f"robot.{suffix}"
    done = fsn("graph", *CELL, "-o", str(out), cwd=EXAMPLES / "robot-cell")
    assert (done.returncode, done.stderr) == (0, "")
    assert "3 controllers, 3 components, 5 SubDevices, 3 FSoE connections" in done.stdout
    text = out.read_text("utf-8")
    assert robot_picture(cell()[1]).partition(">")[2] in text
    assert not re.search(r"<script|<link|\ssrc=|\son\w+=|url\(", text)
    assert fsn("graph", *CELL, "-o", str(out), cwd=EXAMPLES / "robot-cell").returncode == 1


def test_graph_names_what_it_cannot_draw_or_write(tmp_path: Path):
    done = fsn("graph", "nothing.urdf", "-o", "a.svg", cwd=tmp_path)
    assert done.returncode == 1
    assert "error: nothing drawn" in done.stderr
    assert "FSN101" in done.stderr
    done = fsn("graph", "nothing.urdf", "-o", "a.png", cwd=tmp_path)
    assert done.returncode == 2
    assert "-o a.png: write a picture, .svg, or a page, .html" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_picture_on_standard_output_comes_alone():
    done = fsn("graph", "network.yaml", "-o", "-", cwd=EXAMPLES / "estop")
    assert done.returncode == 0
    ElementTree.fromstring(done.stdout)
    assert done.stderr.startswith("-: 0 controllers, 0 components, 2 SubDevices")
