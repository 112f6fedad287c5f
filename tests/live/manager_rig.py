"""Cases of `live_rig.py` with the controller_manager of an installation of ROS 2."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

from live.live_rig import CASES, main, wait_for
from live.ros2_rig import Drive
from ros2.manager import Manager, cell_of, description_of
from ros2.package import COUNTS_PER_RAD

DOMAIN = 1  # no other namespace has it


def axis_of(joint, drive):
    """Return a joint that is an axis of CiA 402."""
    return f"""<joint name="{joint}"><param name="subdevice">{drive}</param>
  <param name="axis">{drive}</param><param name="max_velocity">0.5</param>
  <param name="auto_fault_reset">true</param>
  <command_interface name="position"/>
  <state_interface name="position"/><state_interface name="velocity"/></joint>"""


PARAMETERS = {
    "controller_manager": {
        "update_rate": 100,
        "states": {"type": "joint_state_broadcaster/JointStateBroadcaster"},
        "arm": {"type": "joint_trajectory_controller/JointTrajectoryController"},
        "points": {"type": "forward_command_controller/ForwardCommandController"},
        "other": {"type": "forward_command_controller/ForwardCommandController"},
    },
    "arm": {
        "joints": ["shoulder"],
        "command_interfaces": ["position"],
        "state_interfaces": ["position", "velocity"],
    },
    "points": {"joints": ["shoulder"], "interface_name": "position"},
    "other": {"joints": ["second"], "interface_name": "position"},
}


class Shoulder(Drive):
    """Joints of a controller_manager, and the emulated drives that they are."""

    cell = "cell"
    JOINTS: ClassVar = {"shoulder": "axis_1"}
    PARAMETERS = PARAMETERS
    PARAMS: ClassVar = {"misses": 1000, "lost_ms": 2000}

    def __init__(self, network, package, scenario):
        super().__init__(network, scenario)
        axes = "".join(axis_of(joint, drive) for joint, drive in self.JOINTS.items())
        text = description_of(cell_of(self.socket, axes, **self.PARAMS))
        self.manager = Manager(Path(), Path(package), text, self.PARAMETERS, DOMAIN)
        for name in ("states", "arm", "points", "other"):
            self.manager.goes("load", name)
        self.manager.goes("switch", ["states", "other"], [])

    def counts(self, joint="shoulder"):
        """Return position and velocity of a joint, in units of the drive."""
        return [-COUNTS_PER_RAD * value for value in self.manager.joints()[joint]]

    def facts(self):
        """State, target and actual position of the drive, and the position of the joint."""
        position, _ = self.counts()
        return [self.state(), self.object(0x607A), self.object(0x6064), position]

    def restore(self):
        """Wait for states after a fault, which in Humble has also unconfigured the hardware."""

        def has_states():
            if self.manager.ask("states")[self.cell] == "unconfigured":
                self.manager.ask("hardware", self.cell, "inactive")
            joints = self.manager.joints()
            return all(math.isfinite(joints[joint][0]) for joint in self.JOINTS)

        wait_for("states", has_states)

    def acknowledge(self):
        while any(map(self.has_sto, self.JOINTS.values())):
            for word in ("release", "press"):
                self.emulator.do(word)
                self.manager.joints()

    def is_enabled(self):
        return all(self.state(drive) == self.ENABLED for drive in self.JOINTS.values())

    def enable(self, controller="arm"):
        """Activate a controller; again if a busy machine has ended the hardware, or has made the
        logic take the torque."""
        while not self.is_enabled():
            self.manager.ask("hardware", self.cell, "active")
            self.acknowledge()
            if self.manager.ask("states")[controller] == "active":
                self.manager.ask("switch", [], [controller])
            self.manager.ask("switch", [controller], [])
            for _ in range(50):
                if not self.is_enabled():
                    self.manager.joints()

    def stays(self):
        """Wait for long enough to enable a drive that may; return its facts."""
        self.acknowledge()
        for _ in range(30):
            self.counts()
        return self.facts()

    def arrives(self, counts):
        wait_for("the position", lambda: abs(self.object(0x6064) - counts) < 20)
        return self.stays()

    def follow(self, samples):
        """Return positions of the joint before and after an object of the drive was read, and a
        velocity of both, while the drive moves."""
        rows = []
        for _ in range(samples):
            before, _ = self.counts()
            actual, speed = self.object(0x6064), self.object(0x606C)
            after, velocity = self.counts()
            rows.append([before, actual, after, speed, velocity])
        return rows

    def end(self):
        with self.manager:
            said = self.manager.said()
        super().end()
        return said


def managed(network, package, scenario):
    """A trajectory moves the joint; then it is released, and stopped by the safety logic."""
    axis = Shoulder(network, package, scenario)
    manager = axis.manager
    manager.until(lambda: axis.object(0x607A) == 16384)
    seen = {"unclaimed": axis.stays()}
    axis.enable()
    seen["claimed"] = axis.stays()
    manager.goes("follow", "arm", ["shoulder"], [4.0, [-1.1708]])
    wait_for("a movement", lambda: axis.object(0x6064) < 16000)
    seen["moving"] = axis.follow(10)
    seen["moved"] = axis.arrives(12212)
    manager.goes("follow", "arm", ["shoulder"], [8.0, [-1.5708]])
    wait_for("a movement", lambda: axis.object(0x6064) > 12500)
    manager.goes("switch", [], ["arm"])
    seen["target"] = axis.object(0x607A)
    seen["released"] = axis.arrives(seen["target"])
    manager.goes("switch", ["arm"], [])
    seen["claimed again"] = axis.stays()
    axis.press_stop(pressed=True)
    wait_for("STO", axis.has_sto)
    axis.press_stop(pressed=False)
    seen["e-stop"] = axis.stays()
    seen["states"] = manager.ask("states")
    axis.enable()
    return seen | {"started": axis.stays(), "said": axis.end()}


def commanded(network, package, scenario):
    """Set-points of a controller that does not interpolate, some that are not a number."""
    axis = Shoulder(network, package, scenario)
    axis.enable("points")
    axis.manager.goes("command", "points", float("nan"))
    seen = {"not a number": axis.stays()}
    axis.manager.goes("command", "points", -1.3708)
    seen["moved"] = axis.arrives(14298)
    axis.manager.goes("command", "points", float("nan"))
    seen["then"] = axis.stays()
    axis.manager.goes("switch", ["arm"], ["points"])
    seen["arm"] = axis.stays()
    return seen | {"said": axis.end()}


CASES |= {"managed": managed, "commanded": commanded}

if __name__ == "__main__":
    main()
