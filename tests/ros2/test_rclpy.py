"""A bus as nodes of ROS 2 Jazzy on Fast DDS read and set it: see `scripts/rig/ros2`."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import pytest
from master.rig import Master
from master.rig import running as master_running
from ros2.caller import Caller
from ros2.rig import bridged
from tied import tied

PYTHON = os.environ.get("FSN_ROS2_PYTHON")
LAMP = "el2904.standard_1"
LAMP_TOPIC = "/cell/outputs/el2904/standard_1"
BOOL = "std_msgs/msg/Bool"
ARRAY = "diagnostic_msgs/msg/DiagnosticArray"
NEED = "callers of /cell/stop need RMW_IMPLEMENTATION=rmw_cyclonedds_cpp"

pytestmark = pytest.mark.skipif(PYTHON is None, reason="needs rclpy: scripts/rig/ros2")


class Node:
    """A process with a node; a context manager."""

    def __init__(self, domain: int, *words: str) -> None:
        assert PYTHON is not None
        environment = os.environ | {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_LOCALHOST_ONLY": "1",
            "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        }
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

    def messages(self) -> Iterator[Any]:
        for line in self.stdout:
            yield json.loads(line)

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: object) -> None:
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
