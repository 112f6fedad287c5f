"""A bus as nodes of ROS 2 read and set it: of Jazzy on Fast DDS by `scripts/rig/ros2`, or of a
sourced installation on its ``RMW_IMPLEMENTATION``.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sysconfig
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import pytest
from master.rig import Master
from master.rig import running as master_running
from networks import EXAMPLES
from ros2.caller import Caller
from ros2.rig import ROOT, bridged, own_domain
from tied import tied

from fsoe_net.ros2.bridge import LOOK_S

PYTHON = os.environ.get("FSN_ROS2_PYTHON")
LAMP = "el2904.standard_1"
LAMP_TOPIC = "/cell/outputs/el2904/standard_1"
BOOL = "std_msgs/msg/Bool"
INT = "std_msgs/msg/Int64"
ARRAY = "diagnostic_msgs/msg/DiagnosticArray"
NEED = "callers of /cell/stop need RMW_IMPLEMENTATION=rmw_cyclonedds_cpp"

DISTRO = os.environ.get("ROS_DISTRO", "jazzy")
RMW = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "RMW_IMPLEMENTATION": os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp"),
    "ROS_DISTRO": DISTRO,
}
by_its_rclpy = pytest.mark.skipif(DISTRO == "humble", reason="its rclpy has no type hashes")
CYCLONE = RMW["RMW_IMPLEMENTATION"] == "rmw_cyclonedds_cpp"

pytestmark = [
    pytest.mark.skipif(PYTHON is None, reason="needs rclpy: scripts/rig/ros2"),
    pytest.mark.timeout(240),
]


class Node:
    """A process with a node; a context manager."""

    def __init__(self, domain: int, *words: str) -> None:
        assert PYTHON is not None
        environment = os.environ | RMW | {"ROS_DOMAIN_ID": str(domain)}
        self.process = subprocess.Popen(
            tied(PYTHON, str(Path(__file__).with_name("rclpy_peer.py")), *words),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.stdin: IO[str] = self.process.stdin
        self.stdout: IO[str] = self.process.stdout

    def write(self, value: object) -> None:
        self.stdin.write(json.dumps(value) + "\n")
        self.stdin.flush()

    def ask(self, value: object = None) -> Any:
        self.write(value)
        return next(self.messages())

    def messages(self) -> Iterator[Any]:
        for line in self.stdout:
            yield json.loads(line)

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: object) -> None:
        """Let it end by itself: a killed node may leave locks of Fast DDS behind, held for ever."""
        self.process.terminate()
        try:
            self.process.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate()


@pytest.fixture(scope="module")
def robot() -> Iterator[Master]:
    with master_running(name="el6910") as master:
        yield master


def test_a_node_receives_diagnostics_and_values(robot: Master) -> None:
    with bridged(robot.path) as domain:
        with Node(domain, "listen", "/diagnostics", ARRAY) as node:
            rows = {row["name"]: row for row in next(node.messages())["status"]}
        assert {"cell: bus", "cell: SubDevice drive_1"} <= rows.keys()
        values = {v["key"]: v["value"] for v in rows["cell: bus"]["values"]}
        assert values["state"] == "running"
        with Node(domain, "listen", LAMP_TOPIC, BOOL) as node:
            assert next(node.messages()) == {"data": False}


def test_a_node_sets_an_output_by_its_topic(robot: Master) -> None:
    with (
        bridged(robot.path, allow_control=True) as domain,
        robot.client() as reader,
        Node(domain, "send", f"{LAMP_TOPIC}/set", BOOL) as node,
    ):
        while not reader.value(LAMP):
            node.write(value=True)
            time.sleep(0.05)
        node.write(value=False)
        reader.wait_for(LAMP, False)


@pytest.mark.skipif(not CYCLONE, reason="needs RMW_IMPLEMENTATION=rmw_cyclonedds_cpp")
def test_a_service_answers_a_caller_on_cyclone_dds(robot: Master) -> None:
    with bridged(robot.path, allow_control=True) as domain, robot.client() as client:
        for word, is_running in (("stop", False), ("start", True)):
            with Node(domain, "call", f"/cell/{word}") as node:
                while node.ask() != [True, True]:
                    pass
            while (client.good("status")["state"] == "running") is not is_running:
                pass
        with Node(domain, "set", "/cell/set_parameters") as node:
            assert node.ask([LAMP, True]) == [{"successful": True, "reason": ""}]
            (row,) = node.ask(["el2904.nothing", True])
            assert not row["successful"]


@pytest.mark.skipif(CYCLONE, reason="needs another RMW_IMPLEMENTATION")
def test_a_service_is_not_available_to_a_caller_that_cannot_be_answered(robot: Master) -> None:
    with (
        bridged(robot.path, allow_control=True) as domain,
        Node(domain, "listen", "/diagnostics", ARRAY) as diagnostics,
        Node(domain, "call", "/cell/stop") as node,
    ):
        replies = node.messages()
        for _ in range(3):
            node.write(None)
            assert next(replies) == [False, False]

        def control() -> Any:
            rows = {row["name"]: row for row in next(diagnostics.messages())["status"]}
            return rows["cell: control"]

        while control()["message"] != NEED:
            pass
        caller = Caller(domain, "/cell/stop")
        while True:
            node.write(None)
            if next(replies) == [True, False]:
                break
        del caller
        with robot.client() as client:
            assert client.good("status")["state"] == "running"  # its request was not executed


@contextmanager
def by_rclpy(
    robot: Master, *words: str, first: str = "", name: str = "cell"
) -> Iterator[tuple[int, list[str]]]:
    """`fsoe-net ros2` in the Python that has rclpy, after what it does first.

    Yields the domain and what it has printed.
    """
    assert PYTHON is not None
    paths = (str(ROOT), sysconfig.get_path("platlib"))
    with own_domain() as domain:
        code = f"{first}\nfrom fsoe_net.cli.main import cli\ncli()"
        command = ("-c", code, "ros2", "--socket", str(robot.path), "--name", name)
        process = subprocess.Popen(
            tied(PYTHON, *command, "--localhost", "--domain", str(domain), *words),
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | RMW | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONUNBUFFERED": "1"},
        )
        assert process.stdout is not None
        printed = [process.stdout.readline()]
        try:
            yield domain, printed
        finally:
            process.terminate()
            printed += process.communicate()[0].splitlines()
        assert process.returncode == 0


@by_its_rclpy
def test_with_ros_it_is_a_node_that_ros_lists(robot: Master) -> None:
    with by_rclpy(robot) as (domain, printed):
        with Node(domain, "nodes") as node:
            while "cell" not in node.ask():
                pass
        with Node(domain, "listen", "/diagnostics", ARRAY) as node:
            rows = {row["name"]: row for row in next(node.messages())["status"]}
        assert {"cell: bus", "cell: SubDevice drive_1"} <= rows.keys()
        with Node(domain, "listen", LAMP_TOPIC, BOOL) as node:
            assert next(node.messages()) == {"data": False}
    assert f"by rclpy of {DISTRO}" in printed[0]
    # The wheels have no control_msgs.
    assert [line.split()[0] for line in printed[1:]] == ["/cell/hardware_status"]
    assert printed[1].endswith("no control_msgs/msg/HardwareStatus")


@by_its_rclpy
def test_with_ros_nodes_of_any_rmw_control_it(robot: Master) -> None:
    with by_rclpy(robot, "--allow-control") as (domain, printed):
        with robot.client() as reader, Node(domain, "send", f"{LAMP_TOPIC}/set", BOOL) as node:
            while not reader.value(LAMP):
                node.write(value=True)
                time.sleep(0.05)
        with Node(domain, "set", "/cell/set_parameters") as node:
            assert node.ask([LAMP, True]) == [{"successful": True, "reason": ""}]
            (row,) = node.ask(["el2904.nothing", True])
            assert not row["successful"]
            assert row["reason"]
        with robot.client() as reader, Node(domain, "call", "/cell/stop") as node:
            while node.ask() != [True, True]:
                pass
            assert reader.good("status")["state"] != "running"
        with robot.client() as reader, Node(domain, "call", "/cell/start") as node:
            while node.ask() != [True, True]:
                pass
    left = {line.split()[0] for line in printed[1:] if "is left out" in line}
    assert left == {"/cell/hardware_status", "/cell/get_sdo", "/cell/set_sdo"}


@by_its_rclpy
def test_with_ros_a_type_of_another_version_is_left_out(robot: Master) -> None:
    other = "import fsoe_net.ros2.messages as m; m.HASHES[m.SIGNALS[m.SignalKind.BOOL]] = '00' * 32"
    with by_rclpy(robot, first=other) as (domain, printed):
        with Node(domain, "listen", "/cell/outputs/drive_1/position", INT) as node:
            next(node.messages())
        time.sleep(2 * LOOK_S)
    left = {line.split()[0]: line for line in printed if "is left out" in line}
    assert left[LAMP_TOPIC].endswith(f"another version of {BOOL}")


PAGE = (ROOT / "docs" / "reference" / "ether-ros.md").read_text("utf-8")


@pytest.fixture
def legs() -> Iterator[Master]:
    with master_running(network=EXAMPLES / "legs" / "network.yaml") as master:
        yield master


@contextmanager
def by_dds(legs: Master) -> Iterator[tuple[int, list[str]]]:
    with bridged(legs.path, allow_control=True, name="fsoe_net") as domain:
        yield domain, []


@pytest.mark.parametrize(
    "has_ros",
    [pytest.param(False, id="by DDS"), pytest.param(True, id="by rclpy", marks=by_its_rclpy)],
)
def test_the_commands_of_ros_do_what_a_page_states(legs: Master, has_ros: bool) -> None:
    """`ros2` of ROS itself, as docs/reference/ether-ros.md calls it."""
    assert PYTHON is not None
    tool = Path(PYTHON).with_name("ros2")
    if not tool.exists():
        pytest.skip("needs the command ros2 next to this Python")
    echo, send, stop, start = re.findall(r"^ros2 (.*)$", PAGE, re.MULTILINE)
    running = by_rclpy(legs, "--allow-control", name="fsoe_net") if has_ros else by_dds(legs)
    with running as (domain, _):
        environment = os.environ | RMW | {"ROS_DOMAIN_ID": str(domain)}

        def ros2(words: str) -> str:
            command = tied(PYTHON, str(tool), *shlex.split(words))
            done = subprocess.run(
                command, env=environment, check=True, capture_output=True, text=True
            )
            return done.stdout

        assert ros2(f"{echo} std_msgs/msg/Int64 --once --no-daemon").startswith("data: 0\n")
        sender = subprocess.Popen(tied(PYTHON, str(tool), *shlex.split(send)), env=environment)
        with legs.client() as client:
            client.wait_for("front_left_leg.kp_100_knee", 5)
            sender.terminate()
            sender.wait()
            client.wait_for("front_left_leg.kp_100_knee", 0)
        # Without its daemon it looks for half a second.
        while has_ros and "/fsoe_net" not in ros2("node list --no-daemon").split():
            pass
        if has_ros:  # this rmw is one whose callers Cyclone DDS cannot answer
            assert "success=True" in ros2(f"service call {stop.split(maxsplit=2)[2]}")
            assert "success=True" in ros2(f"service call {start.split(maxsplit=2)[2]}")
