"""The package `ros/fsoe_net_ros` in the controller_manager of an installation of ROS 2.

Needs ros2_control, ros2_controllers and the sourced ``setup.bash`` of their installation.
"""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import fmean
from typing import Any

import pytest
from live.on_the_wire import on_the_wire
from master.rig import Client, Master
from master.rig import running as master_running
from ros2.manager import HUMBLE, Manager, cell_of, description_of, find_program
from ros2.package import COUNTS_PER_RAD, motors, reversed_cell

pytestmark = pytest.mark.skipif(
    find_program("controller_manager", "ros2_control_node") is None,
    reason="needs the controller_manager of a sourced installation of ROS 2",
)

REPLY_S = 1.0  # kReplyMs of control_socket.cpp
ENABLED, DISABLED = 0x27, 0x40
SUCCEEDED = 4  # status of an action
KILLS_SEED, KILLS_ROUNDS = (os.environ.get(f"FSN_KILLS_{n}", "1") for n in ("SEED", "ROUNDS"))
LAMP = "el2904.standard_1"
PARAMETERS: dict[str, dict[str, Any]] = {
    "controller_manager": {
        "update_rate": 100,
        "states": {"type": "joint_state_broadcaster/JointStateBroadcaster"},
        "lamp": {"type": "forward_command_controller/MultiInterfaceForwardCommandController"},
        "other": {"type": "forward_command_controller/ForwardCommandController"},
    },
    "lamp": {"joint": "el2904", "interface_names": ["standard_1"]},
    "other": {"joints": ["second"], "interface_name": "position"},
}
GPIO = '<gpio name="el2904"><command_interface name="standard_1"/></gpio>'


def at(facts: list[float], state: int, position: float) -> bool:
    """Whether a drive is in a state and rests, with its target and its joint, at a position."""
    found, target, actual, joint = facts
    return found == state and all(abs(p - position) < 20 for p in (target, actual, joint))


def on_a_bus(case: str, package: Path, folder: Path) -> dict[str, Any]:
    """Run a case of the rig with an emulated drive; 0.25 revolutions are 16384 of its counts."""
    network = reversed_cell(folder, "velocity")
    words = (case, network, package, motors(folder))
    done = on_the_wire(*words, tmp=folder, script="live/manager_rig.py", good=undisturbed)
    return dict(done)


def undisturbed(seen: dict[str, Any]) -> bool:
    """Whether a busy machine has not stopped the axis where nothing else does."""
    steps = ("claimed", "moved", "released", "claimed again", "started")
    steps += ("not a number", "then", "arm")
    return all(seen[step][0] == ENABLED for step in steps if step in seen)


def test_a_trajectory_moves_an_axis_that_only_a_controller_starts(
    package: Path, tmp_path: Path
) -> None:
    seen = on_a_bus("managed", package, tmp_path)
    assert at(seen["unclaimed"], DISABLED, 16384), seen
    assert at(seen["claimed"], ENABLED, 16384), seen
    assert at(seen["moved"], ENABLED, 12212), seen
    for before, actual, after, *_ in seen["moving"]:
        assert after - 2 <= actual <= before + 2, seen  # its position decreases
    for velocities in list(zip(*seen["moving"], strict=True))[3:]:
        assert abs(fmean(velocities) + 0.1 * COUNTS_PER_RAD) < 150, seen  # 0.4 rad in 4 s
    target = seen["target"]
    assert 12500 < target < 16000
    assert at(seen["released"], ENABLED, target), seen  # it holds; the trajectory has ended
    assert at(seen["claimed again"], ENABLED, target), seen
    assert at(seen["e-stop"], DISABLED, seen["e-stop"][2]), seen
    assert seen["states"]["arm"] == "active"  # a controller that is still there starts nothing
    assert at(seen["started"], ENABLED, seen["e-stop"][2]), seen


def test_a_command_that_is_not_a_number_moves_nothing(package: Path, tmp_path: Path) -> None:
    seen = on_a_bus("commanded", package, tmp_path)
    assert at(seen["not a number"], ENABLED, 16384), seen
    for step in ("moved", "then", "arm"):
        assert at(seen[step], ENABLED, 14298), (step, seen)


def slow_cell(folder: Path) -> Path:
    """The reversed cell for a busy machine, with a bus cycle of 4 ms and long watchdogs."""
    network = reversed_cell(folder, "velocity")
    text = network.read_text("utf-8")
    for old, new in (
        ("cycle_us: 1000", "cycle_us: 4000"),
        ("watchdog_ms: 100", "watchdog_ms: 1000"),
        ("required_reaction_ms: 1000", "required_reaction_ms: 9000"),
    ):
        assert old in text
        text = text.replace(old, new)
    network.write_text(text, "utf-8")
    return network


def test_random_kills_and_freezes_move_no_axis(package: Path, tmp_path: Path) -> None:
    """Two axes on a trajectory, next to hardware on another; see `kills_rig.py`."""
    words = ("kills", slow_cell(tmp_path), package, motors(tmp_path), KILLS_SEED, KILLS_ROUNDS)
    seen = dict(on_the_wire(*words, tmp=tmp_path, script="live/kills_rig.py", limit_s=None))
    assert seen["notes"] == [], f"FSN_KILLS_SEED={KILLS_SEED}"
    assert seen["moving"] > 5 * len(seen["ways"]), seen
    assert seen["ends"] == [[SUCCEEDED, 0]] * len(seen["ways"]), seen
    assert max(seen["gaps_s"]) < REPLY_S, seen
    assert seen["states"]["mock"] == seen["states"]["other"] == "active"


def right_moves(seen: dict[str, Any]) -> bool:
    """Whether a busy machine has not stopped the arm whose fsn-master continues."""
    return bool(seen["enabled"])


def test_an_arm_that_loses_its_fsn_master_does_not_disturb_the_other(
    package: Path, tmp_path: Path
) -> None:
    goals = (-1.3, 0.25)
    words = ("two_arms", slow_cell(tmp_path), package, motors(tmp_path), *map(str, goals))
    script = "live/two_arms_rig.py"
    seen = dict(on_the_wire(*words, tmp=tmp_path, script=script, good=right_moves, cables=2))
    for outcome, actual in (("right", "arrived"), ("left", "then")):
        assert seen[outcome] == [SUCCEEDED, 0], seen
        for counts, goal in zip(seen[actual], goals, strict=True):
            assert abs(counts + COUNTS_PER_RAD * goal) < 20, seen
    left = ("unconfigured", "active") if HUMBLE else ("inactive", "inactive")
    for arm, states in (("left", left), ("right", ("active", "active"))):
        assert (seen["lost"][arm], seen["lost"][f"{arm}_arm"]) == states, seen
    assert ENABLED not in seen["returned"], seen  # nothing starts by itself


@pytest.fixture
def cell(package: Path, domain: int, tmp_path: Path) -> Iterator[tuple[Manager, Path]]:
    """A manager whose component is not configured yet, and where it looks for fsn-master."""
    socket = tmp_path / "s"
    text = description_of(cell_of(socket, GPIO, misses=1000))
    waits = {"hardware_components_initial_state": {"unconfigured": ["cell"]}}
    parameters = PARAMETERS | {"controller_manager": PARAMETERS["controller_manager"] | waits}
    with Manager(tmp_path, package, text, parameters, domain) as manager:
        manager.until_states(cell="unconfigured", mock="active")
        yield manager, socket


def start(manager: Manager, socket: Path, master: Master) -> None:
    """Let the component find an fsn-master, and take its outputs."""
    socket.unlink(missing_ok=True)
    socket.symlink_to(master.path)
    manager.until(lambda: manager.ask("hardware", "cell", "active"))


def test_an_output_follows_its_controller(cell: tuple[Manager, Path]) -> None:
    manager, socket = cell
    with master_running(name="el6910") as master, master.client() as reader:
        start(manager, socket, master)
        manager.goes("load", "lamp")
        manager.goes("switch", ["lamp"], [])
        stays(reader, value=False)
        turn_on(manager, reader)
        manager.goes("command", "lamp", math.nan)
        if HUMBLE:
            reader.wait_for(LAMP, False)
            turn_on(manager, reader)
        stays(reader, value=True)  # since Jazzy this controller drops it
        manager.goes("switch", [], ["lamp"])
        reader.wait_for(LAMP, False)
        manager.goes("switch", ["lamp"], [])
        stays(reader, value=False)
        turn_on(manager, reader)
        manager.goes("hardware", "cell", "inactive")
        reader.wait_for(LAMP, False)
        manager.goes("hardware", "cell", "active")
        assert manager.ask("states")["lamp"] == "active"  # and commands the lamp in each cycle
        stays(reader, value=False)


def turn_on(manager: Manager, reader: Client) -> None:
    manager.until(lambda: manager.ask("command", "lamp", 1.0) and reader.value(LAMP) is True)


def stays(reader: Client, *, value: bool) -> None:
    """Whether the lamp stays on or off for 300 cycles of the bus, 30 of the controller manager."""
    begun = reader.good("status")["cycles"]
    while reader.good("status")["cycles"] < begun + 300:
        assert reader.value(LAMP) is value


def lamp_is_lost(manager: Manager, master: Master, number: signal.Signals) -> None:
    """Turn the lamp on, send a signal to fsn-master, and expect that only its cell ends. Humble
    unconfigures the cell, and ends no controller."""
    manager.goes("switch", ["lamp"], [])
    with master.client() as reader:
        turn_on(manager, reader)
    manager.ask("gap")
    os.kill(master.process.pid, number)
    cell, lamp = ("unconfigured", "active") if HUMBLE else ("inactive", "inactive")
    manager.until_states(cell=cell, lamp=lamp, mock="active", other="active")
    manager.until(
        lambda: manager.ask("command", "other", 0.25) and manager.joints()["second"][0] == 0.25
    )
    assert manager.ask("gap") < REPLY_S


def lamp_returns(manager: Manager, socket: Path, master: Master) -> None:
    """Expect that the lamp is off until its controller commands it again."""
    start(manager, socket, master)
    with master.client() as reader:
        stays(reader, value=False)
        if HUMBLE:
            manager.goes("switch", [], ["lamp"])
        manager.goes("switch", ["lamp"], [])
        stays(reader, value=False)
        turn_on(manager, reader)


@pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGTERM])
def test_fsn_master_ends_and_is_started_again(
    cell: tuple[Manager, Path], ending: signal.Signals
) -> None:
    manager, socket = cell
    load(manager)
    with master_running(name="el6910") as master:
        start(manager, socket, master)
        lamp_is_lost(manager, master, ending)
    with master_running(name="el6910") as master:
        lamp_returns(manager, socket, master)


def test_a_frozen_fsn_master_disturbs_no_other_hardware(cell: tuple[Manager, Path]) -> None:
    manager, socket = cell
    load(manager)
    with master_running(name="el6910") as master:
        start(manager, socket, master)
        try:
            lamp_is_lost(manager, master, signal.SIGSTOP)
        finally:
            os.kill(master.process.pid, signal.SIGCONT)
        lamp_returns(manager, socket, master)


def load(manager: Manager) -> None:
    for name in ("states", "lamp", "other"):
        manager.goes("load", name)
    manager.goes("switch", ["states", "other"], [])


def test_controllers_run_while_a_component_waits_for_fsn_master(cell: tuple[Manager, Path]) -> None:
    manager, socket = cell
    manager.goes("load", "states")
    manager.goes("switch", ["states"], [])
    with master_running(name="el6910") as master:
        socket.symlink_to(master.path)
        os.kill(master.process.pid, signal.SIGSTOP)
        try:
            manager.joints()
            manager.ask("gap")
            begun_s = time.monotonic()
            assert manager.ask("hardware", "cell", "active") is False
            assert time.monotonic() - begun_s > REPLY_S / 2  # it has waited
            manager.joints()
            longest_s = 1.5 * REPLY_S if HUMBLE else REPLY_S / 2  # its loop waits as well
            assert manager.ask("gap") < longest_s
        finally:
            os.kill(master.process.pid, signal.SIGCONT)


@pytest.mark.skipif(HUMBLE, reason="there it has no services if a component is not active")
@pytest.mark.parametrize("continues", [True, False])
def test_the_manager_starts_without_fsn_master(
    package: Path, domain: int, tmp_path: Path, continues: bool
) -> None:
    """By the default of Jazzy it ends; with the value of `cell.launch.py` other hardware runs."""
    name = "hardware_components_initial_state"
    waits = {name: {"shutdown_on_initial_state_failure": not continues}}
    parameters = {"controller_manager": PARAMETERS["controller_manager"] | waits}
    text = description_of(cell_of(tmp_path / "s", GPIO))
    with Manager(tmp_path, package, text, parameters, domain) as manager:
        if continues:
            manager.until_states(cell="unconfigured", mock="active")
        else:
            assert manager.node.wait(60) != 0
        assert f"no answer on {tmp_path / 's'}" in manager.said()
