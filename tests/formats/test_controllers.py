"""Parameters of controllers, as the documentation of ros2_controllers names them."""

from __future__ import annotations

import pytest

from fsoe_net.formats.ros2.controllers import is_controllers, read_controllers
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.yaml_tree import MapNode, parse_yaml
from fsoe_net.model.robot import Controller


def _root(text: str) -> MapNode:
    root = parse_yaml(text.encode(), "controllers.yaml", Collector())
    assert root is not None
    return root


def _one(kind: str, parameters: str) -> Controller:
    text = f"controller_manager: {{ros__parameters: {{c: {{type: {kind}}}}}}}\n"
    text += f"c: {{ros__parameters: {parameters}}}\n"
    out = Collector()
    _, (found,) = read_controllers([_root(text)], out)
    assert not out.diagnostics
    return found


def _uses(found: Controller) -> list[str]:
    return [f"{'->' if use.is_command else '<-'} {use.name}" for use in found.uses]


@pytest.mark.parametrize(
    ("kind", "parameters", "uses"),
    [
        ("joint_state_broadcaster/JointStateBroadcaster", "{}", []),
        (
            "joint_state_broadcaster/JointStateBroadcaster",
            "{joints: [a], interfaces: [position]}",
            ["<- a/position"],
        ),
        (
            "joint_trajectory_controller/JointTrajectoryController",
            "{joints: [a, b], command_interfaces: [position], state_interfaces: [velocity]}",
            ["-> a/position", "-> b/position", "<- a/velocity", "<- b/velocity"],
        ),
        (
            "joint_trajectory_controller/JointTrajectoryController",
            "{joints: [a], command_joints: [pid/a], command_interfaces: [position]}",
            ["-> pid/a/position"],
        ),
        (
            "forward_command_controller/ForwardCommandController",
            "{joints: [a], interface_name: effort}",
            ["-> a/effort"],
        ),
        (
            "forward_command_controller/MultiInterfaceForwardCommandController",
            "{joint: a, interface_names: [position, effort]}",
            ["-> a/position", "-> a/effort"],
        ),
        ("position_controllers/JointGroupPositionController", "{joints: [a]}", ["-> a/position"]),
        ("velocity_controllers/JointGroupVelocityController", "{joints: [a]}", ["-> a/velocity"]),
        ("effort_controllers/JointGroupEffortController", "{joints: [a]}", ["-> a/effort"]),
        (
            "diff_drive_controller/DiffDriveController",
            "{left_wheel_names: [l], right_wheel_names: [r]}",
            ["-> l/velocity", "-> r/velocity", "<- l/position", "<- r/position"],
        ),
        (
            "diff_drive_controller/DiffDriveController",
            "{left_wheel_names: [l], right_wheel_names: [], position_feedback: false}",
            ["-> l/velocity", "<- l/velocity"],
        ),
        (
            "diff_drive_controller/DiffDriveController",
            "{left_wheel_names: [l], open_loop: true}",
            ["-> l/velocity"],
        ),
        (
            "gpio_controllers/GpioCommandController",
            "{gpios: [g], command_interfaces: {g: {interfaces: [out]}},"
            " state_interfaces: {g: {interfaces: [in]}}}",
            ["-> g/out", "<- g/in"],
        ),
    ],
)
def test_interfaces_of_each_type(kind: str, parameters: str, uses: list[str]) -> None:
    found = _one(kind, parameters)
    assert _uses(found) == uses
    assert found.is_checked


def test_an_unknown_type_is_kept_without_interfaces() -> None:
    found = _one("my_package/MyController", "{joints: [a], command_interfaces: [position]}")
    assert (found.type, found.uses, found.is_checked) == ("my_package/MyController", (), False)


def test_a_launch_substitution_is_not_a_name() -> None:
    found = _one("effort_controllers/JointGroupEffortController", "{joints: ['$(var prefix)a', b]}")
    assert _uses(found) == ["-> b/effort"]
    assert not found.is_checked


def test_namespaces_wildcards_and_several_files() -> None:
    first = _root(
        "/**: {ros__parameters: {update_rate: 250, joints: [a]}}\n"
        "robot:\n"
        "  controller_manager:\n"
        "    ros__parameters: {c: {type: effort_controllers/JointGroupEffortController}}\n"
    )
    second = _root("/robot/d: {ros__parameters: {type: x/Y}}\n")
    rates, controllers = read_controllers([first, second], Collector())
    assert [rate.hz for rate in rates] == [250]
    assert [(c.name, c.type) for c in controllers] == [
        ("c", "effort_controllers/JointGroupEffortController"),
        ("d", "x/Y"),
    ]
    assert _uses(controllers[0]) == ["-> a/effort"]


@pytest.mark.parametrize("rate", ["0", "-1", ".nan", ".inf", "fast", "nan", "inf"])
def test_an_impossible_update_rate_is_located(rate: str) -> None:
    out = Collector()
    text = "controller_manager: {ros__parameters: {update_rate: "
    rates, _ = read_controllers([_root(f"{text}{rate}}}}}")], out)
    assert rates == ()
    (finding,) = out.diagnostics
    assert (finding.code, finding.span.column) == ("FSN113", len(text) + 1)


def test_long_lists_are_bounded_and_the_controller_is_not_called_checked() -> None:
    names = ", ".join(f"n{n}" for n in range(2000))
    found = _one(
        "joint_trajectory_controller/JointTrajectoryController",
        f"{{joints: [{names}], command_interfaces: [{names}]}}",
    )
    assert len(found.uses) == 4096
    assert not found.is_checked


def test_another_yaml_has_no_controllers() -> None:
    assert not is_controllers(_root("nets: []"))
    assert not is_controllers(_root("a: {ros__parameters: 3}"))
