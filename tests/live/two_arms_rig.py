"""A case of `live_rig.py`: a robot with two arms, each on a bus and an fsn-master of its own."""

from __future__ import annotations

import math
import os
import signal
from pathlib import Path

from live.kills_rig import trajectory
from live.live_rig import CASES, main, wait_for
from live.manager_rig import DOMAIN, PARAMETERS, Shoulder, axis_of
from live.ros2_rig import Drive
from ros2.manager import Manager, cell_of, description_of

DRIVES = ("axis_1", "axis_2")


class Arm(Shoulder):
    """Two joints; the manager, which has both arms, is set later."""

    def __init__(self, name, network, scenario, cable):
        Drive.__init__(self, network, scenario, cable)
        self.cell, self.controller = name, f"{name}_arm"
        self.JOINTS = {f"{name}_{number}": drive for number, drive in enumerate(DRIVES)}
        axes = "".join(axis_of(joint, drive) for joint, drive in self.JOINTS.items())
        self.block = cell_of(self.socket, axes, name, **self.PARAMS)

    def parameters(self):
        return PARAMETERS["arm"] | {"joints": [*self.JOINTS]}

    def positions(self):
        joints = self.manager.joints()
        return [joints[joint][0] for joint in self.JOINTS]

    def actual(self):
        """Return the positions of the drives after they have settled."""
        for _ in range(50):
            self.manager.joints()
        return [self.object(0x6064, drive) for drive in DRIVES]

    def move(self, goal):
        """Begin a trajectory, again if a busy machine has made the logic take the torque."""
        accepted = False
        while not accepted:
            self.enable(self.controller)
            points, _ = trajectory(self.positions(), goal)
            accepted = self.manager.ask("follow", self.controller, [*self.JOINTS], *points)

    def end(self):
        Drive.end(self)


def two_arms(network, package, scenario, *goals):
    """Both arms move; the fsn-master of one is killed, and started again."""
    goal = [float(goal) for goal in goals]
    arms = [Arm("left", network, scenario, ""), Arm("right", network, scenario, "2")]
    left, right = arms
    kinds = {row.controller: PARAMETERS["controller_manager"]["arm"] for row in arms}
    parameters = {row.controller: row.parameters() for row in arms}
    parameters["controller_manager"] = PARAMETERS["controller_manager"] | kinds
    text = description_of(*(row.block for row in arms))
    manager = Manager(Path(), Path(package), text, parameters, DOMAIN)
    left.manager = right.manager = manager
    for name in ("states", *kinds):
        manager.goes("load", name)
    manager.goes("switch", ["states"], [])
    for row in arms:
        row.move(goal)
    while left.object(0x6064) > 16000:
        if not left.is_enabled():
            left.move(goal)
    os.kill(left.running.pid, signal.SIGKILL)
    left.running.process.communicate()
    wait_for("its loss", lambda: all(map(math.isnan, left.positions())))
    seen = {"right": manager.ask("outcome", "right_arm"), "arrived": right.actual()}
    seen["enabled"] = right.is_enabled()
    seen["lost"] = manager.ask("states")
    left.start_master()
    left.restore()
    left.actual()
    seen["returned"] = [left.state(drive) for drive in DRIVES]
    left.move(goal)
    seen |= {"left": manager.ask("outcome", "left_arm"), "then": left.actual()}
    with manager:
        seen["said"] = manager.said()
    for row in arms:
        row.end()
    return seen


CASES |= {"two_arms": two_arms}

if __name__ == "__main__":
    main()
