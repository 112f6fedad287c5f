"""The controller_manager of a sourced installation of ROS 2, and a node that drives it."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from patience import PATIENCE_S
from tied import tied

PYTHON = os.environ.get("FSN_ROS2_PYTHON", "/usr/bin/python3")
"""The Python of the installation."""
HUMBLE = os.environ.get("ROS_DISTRO") == "humble"

JOINT = """<link name="{name}_link"/><joint name="{name}" type="revolute"><parent link="base"/>
  <child link="{name}_link"/><axis xyz="0 0 1"/>
  <limit lower="-3" upper="3" velocity="0.5" effort="30"/></joint>"""
DESCRIPTION = ("-r", "~/robot_description:=/robot_description")
"""The controller manager of Humble looks for it in its own namespace."""
Joints = dict[str, tuple[float, float]]


def prefixes() -> list[Path]:
    """Return the folders of the installation, as ``setup.bash`` of ROS names them."""
    return [Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if p]


def find_program(package: str, name: str) -> Path | None:
    """Return an executable of a package of the installation."""
    programs = (prefix / "lib" / package / name for prefix in prefixes())
    return next((program for program in programs if program.is_file()), None)


def ros2_words(*words: str) -> list[str]:
    """Return a command of the installation, such as ``ros2 launch``."""
    programs = (prefix / "bin" / "ros2" for prefix in prefixes())
    return [PYTHON, str(next(program for program in programs if program.is_file())), *words]


def cell_of(socket: Path | str, components: str, name: str = "cell", **params: object) -> str:
    """Return a component of ros2_control: the bus that the fsn-master at a socket drives."""
    rows = "".join(f'<param name="{name}">{params[name]}</param>' for name in params)
    return f"""<ros2_control name="{name}" type="system">
<hardware><plugin>fsoe_net_ros/CellSystem</plugin>
  <param name="socket">{socket}</param>{rows}</hardware>{components}</ros2_control>"""


def description_of(*cells: str) -> str:
    """Return a robot of cells, and of another component whose joint follows its commands."""
    names = [*re.findall(r'<joint name="(\w+)"', "".join(cells)), "second"]
    joints = "".join(JOINT.format(name=name) for name in names)
    return f"""<robot name="robot"><link name="base"/>{joints}{"".join(cells)}
<ros2_control name="mock" type="system">
  <hardware><plugin>mock_components/GenericSystem</plugin></hardware>
  <joint name="second"><command_interface name="position"/>
    <state_interface name="position"><param name="initial_value">0</param></state_interface>
    <state_interface name="velocity"/></joint></ros2_control></robot>"""


def environment_with(package: Path, domain: int) -> dict[str, str]:
    """Return the environment of a process of ROS that finds a package installed in a folder."""
    folders = [package, *prefixes()]
    modules = [path for folder in folders for path in folder.glob("lib/python3*/site-packages")]
    libraries = [*(folder / "lib" for folder in folders), os.environ.get("LD_LIBRARY_PATH", "")]
    return os.environ | {
        "AMENT_PREFIX_PATH": ":".join(map(str, folders)),
        "PYTHONPATH": ":".join(map(str, modules)),
        "LD_LIBRARY_PATH": ":".join(map(str, libraries)),
        "ROS_DOMAIN_ID": str(domain),
        "ROS_LOCALHOST_ONLY": "1",
        # Shared memory of another namespace, or of another test, has the same names.
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    }


class Peer:
    """The node of `manager_peer.py`; a context manager."""

    def __init__(self, environment: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            tied(PYTHON, Path(__file__).with_name("manager_peer.py")),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )

    def ask(self, *words: object) -> Any:
        """Call a function of the node, and return what it returns."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(words) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def stamped_joints(self) -> tuple[float, Joints]:
        """Return joint states that were made after the call, and their time."""
        self.ask("joints")  # on its way already
        at_s, joints = self.ask("joints")
        return at_s, {name: tuple(values) for name, values in joints.items()}

    def joints(self) -> Joints:
        """Return joint states that were made after the call: position and velocity."""
        return self.stamped_joints()[1]

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.communicate()


class Started(Peer):
    """A program that runs a controller manager, and a node that drives it.

    Args:
        log: where the output of the program is written.
        environment: of `environment_with`.
        words: the program and its arguments.
    """

    def __init__(self, log: Path, environment: dict[str, str], *words: str | Path) -> None:
        self._log = log
        with log.open("w") as file:
            self.node = subprocess.Popen(
                tied(*words), stdout=file, stderr=file, env=environment, start_new_session=True
            )
        super().__init__(environment)

    def said(self) -> str:
        return self._log.read_text("utf-8", "replace")

    def goes(self, *words: object) -> None:
        """Call a function of the node that succeeds."""
        assert self.ask(*words) is True, (words, self.said())

    def until(self, found: Callable[[], object]) -> None:
        """Ask until something has come."""
        until_s = time.monotonic() + PATIENCE_S
        while not found():
            assert self.node.poll() is None, self.said()
            assert time.monotonic() < until_s, self.said()

    def until_states(self, **expected: str) -> None:
        """Wait for states of components and controllers."""
        self.until(lambda: expected.items() <= self.ask("states").items())

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.node.pid, signal.SIGKILL)
        self.node.wait()


class Manager(Started):
    """``ros2_control_node`` with a robot description.

    Args:
        folder: where its parameters and its log are written.
        package: what ament has installed of `ros/fsoe_net_ros`.
        description: the URDF.
        parameters: of each node, the one of the controller manager as well.
        domain: the DDS domain.
    """

    def __init__(
        self,
        folder: Path,
        package: Path,
        description: str,
        parameters: dict[str, dict[str, Any]],
        domain: int,
    ) -> None:
        given = folder / "parameters.yaml"
        files = {f"{name}.params_file": str(given) for name in parameters}  # for ros2_control 6
        parameters = parameters | {"controller_manager": parameters["controller_manager"] | files}
        rows = {name: {"ros__parameters": values} for name, values in parameters.items()}
        given.write_text(json.dumps(rows), "utf-8")
        program = find_program("controller_manager", "ros2_control_node")
        assert program is not None
        words = (program, "--ros-args", "--params-file", given, *DESCRIPTION)
        super().__init__(folder / "manager.log", environment_with(package, domain), *words)
        self.ask("describe", description)
