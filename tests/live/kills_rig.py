"""A case of `live_rig.py`: fsn-master is killed and frozen at random times under a manager.

What must never happen is looked for in each cycle of the bus, as fsn-master has sent it.
"""

from __future__ import annotations

import math
import os
import random
import signal
import sys
import threading
import time
from collections import deque
from contextlib import suppress

from live.live_rig import CASES, main, wait_for
from live.manager_rig import PARAMETERS, Shoulder
from live.ros2_rig import state_of
from ros2.package import COUNTS_PER_RAD

from fsoe_net.errors import FsnError
from fsoe_net.live.client import Client

CYCLE_S, MISSES, MAX_VELOCITY = 0.004, 25, 0.5
MAX_STEP = MAX_VELOCITY * CYCLE_S * (MISSES + 1) * COUNTS_PER_RAD + 1  # between two writes
PARAMS = {"misses": MISSES, "lost_ms": 500}
ENABLE_OPERATION = 0x0F  # bits of the controlword
VALUES = ("status_word", "control_word", "position")
HOME_RAD = -math.pi / 2  # of `motors`, backwards
SPEED, POINTS = 0.3, 8
SECOND = {"second": {"trajectory": 0.3, "goal": 0.01}}
MANAGER = PARAMETERS["controller_manager"]
JOINTS = {"shoulder": "axis_1", "elbow": "axis_2"}
LATE_NS = 20_000_000  # of a manager that waits for a processor
CLOCKS = (time.CLOCK_REALTIME, time.CLOCK_MONOTONIC_RAW)  # of ROS, of ros2_control since Jazzy


def bus_time_ns(at_s):
    """Return a time of a message in the clock of the bus."""
    ages_ns = [time.clock_gettime_ns(clock) - int(1e9 * at_s) for clock in CLOCKS]
    return time.monotonic_ns() - min(ages_ns, key=abs)


def trajectory(start, goal):
    """Return points from rest to rest, as MoveIt sends them, and their time."""
    length = max(abs(b - a) for a, b in zip(start, goal, strict=True))
    time_s = max(1.0, 1.875 * length / SPEED)  # of the polynomial below
    rows = []
    for number in range(POINTS + 1):
        s = number / POINTS
        place = s**3 * (10 - 15 * s + 6 * s * s)
        speed = 30 * s * s * (1 - s) ** 2 / time_s
        gain = 60 * s * (1 - s) * (1 - 2 * s) / time_s**2
        steps = [b - a for a, b in zip(start, goal, strict=True)]
        positions = [a + place * step for a, step in zip(start, steps, strict=True)]
        rows.append([s * time_s, positions, *([k * d for d in steps] for k in (speed, gain))])
    return rows, time_s


class Judge:
    """Follows a drive from cycle to cycle, and notes what it must not do."""

    def __init__(self, drive, notes):
        self.drive, self.notes = drive, notes
        self.claimed_ns, self.stopped_ns = 0, time.monotonic_ns()
        self.was_on, self.target = False, None

    def see(self, cycle):
        status, actual = (cycle.inputs[f"{self.drive}.{v}"] for v in ("status_word", "position"))
        control, target = (cycle.outputs[f"{self.drive}.{v}"] for v in ("control_word", "position"))
        is_on = state_of(status) == Shoulder.ENABLED
        if is_on and not self.was_on and self.claimed_ns < self.stopped_ns:
            self.notes.append(["has started by itself", self.drive, cycle.cycle])
        if self.was_on and not is_on:
            self.stopped_ns = cycle.now_ns
        self.was_on = is_on
        if control & ENABLE_OPERATION != ENABLE_OPERATION:
            self.target = None
            return
        before = actual if self.target is None else self.target
        if abs(target - before) > MAX_STEP * (1 + cycle.skipped):
            self.notes.append(["has jumped", self.drive, cycle.cycle, before, target])
        self.target = target


class Watch(threading.Thread):
    """The cycles of an fsn-master until it ends."""

    def __init__(self, socket, judges):
        super().__init__(daemon=True)
        self.client, self.judges, self.rows = Client(socket), judges, deque(maxlen=1000)
        self.start()

    def run(self):
        names = [f"{judge.drive}.{value}" for judge in self.judges for value in VALUES]
        with suppress(FsnError):
            for cycle in self.client.watch(*names):
                self.rows.append(cycle)
                for judge in self.judges:
                    judge.see(cycle)

    def between(self, begin_ns, end_ns):
        """Return the cycles of a time and the one before it; none if they do not come."""
        until_s = time.monotonic() + 1
        while not self.rows or self.rows[-1].now_ns < end_ns:
            if time.monotonic() > until_s or not self.is_alive():
                return []
            time.sleep(0.005)
        rows = [row for row in list(self.rows) if row.now_ns <= end_ns]
        earlier = sum(row.now_ns < begin_ns for row in rows)
        return rows[max(0, earlier - 1) :]


class Arm(Shoulder):
    """Two axes whose states are compared with those of the drives, and other hardware."""

    JOINTS = JOINTS
    PARAMS = PARAMS
    PARAMETERS = PARAMETERS | {
        "controller_manager": MANAGER | {"other": MANAGER["arm"]},
        "arm": PARAMETERS["arm"] | {"joints": [*JOINTS]},
        "points": PARAMETERS["points"] | {"joints": [*JOINTS]},
        "other": PARAMETERS["arm"] | {"joints": ["second"], "constraints": SECOND},
    }

    def __init__(self, network, package, scenario, chance):
        super().__init__(network, package, scenario)
        self.chance = chance
        self.notes, self.compared, self.moving, self.gaps_s, self.ends = [], 0, 0, [], []
        self.watch_master()

    def watch_master(self):
        self.judges = [Judge(drive, self.notes) for drive in self.JOINTS.values()]
        self.watch = Watch(self.running.socket, self.judges)

    def positions(self, *names):
        joints = self.manager.joints()
        return [joints[name][0] for name in names]

    def compare(self):
        """Compare the next joint states with the drives, if both are valid."""
        at_s, joints = self.manager.stamped_joints()
        at_ns = bus_time_ns(at_s)
        rows = self.watch.between(at_ns - LATE_NS, at_ns + LATE_NS)
        for joint, drive in self.JOINTS.items():
            position, _ = joints[joint]
            if not rows or math.isnan(position):
                continue
            actual = [row.inputs[f"{drive}.position"] for row in rows]
            lowest, highest = min(actual), max(actual)
            self.compared += 1
            self.moving += lowest < highest
            if not lowest - 1 <= -COUNTS_PER_RAD * position <= highest + 1:
                self.notes.append(["is not its joint", drive, lowest, highest, position])

    def observe(self, longest_s):
        until_s = time.monotonic() + self.chance.uniform(0.02, longest_s)
        while time.monotonic() < until_s:
            self.compare()

    def claim(self, started, stopped):
        for judge in self.judges:
            judge.claimed_ns = time.monotonic_ns()
        return self.manager.ask("switch", started, stopped)

    def recover(self):
        """Do what a person does, until the axes can be moved."""
        if self.running.process.poll() is not None:
            self.start_master()
            self.watch_master()
        wait_for("the bus", self.running.in_data)
        self.restore()
        self.observe(0.5)
        while not (self.is_enabled() and self.manager.ask("states")["arm"] == "active"):
            self.manager.ask("hardware", "cell", "active")
            self.acknowledge()
            states = self.manager.ask("states")
            self.manager.ask("switch", [], [n for n in ("arm", "points") if states[n] == "active"])
            self.claim(["arm"], [])
            self.observe(1.0)

    def follow(self, controller, joints, middle):
        start = self.positions(*joints)
        goal = [middle + self.chance.uniform(-0.35, 0.35) for _ in joints]
        rows, time_s = trajectory(start, goal)
        return self.manager.ask("follow", controller, joints, *rows) and time_s

    def kill(self):
        self.lose(signal.SIGKILL)

    def terminate(self):
        self.lose(signal.SIGTERM)

    def lose(self, number):
        os.kill(self.running.pid, number)
        self.running.process.communicate()
        wait_for("its loss", lambda: all(map(math.isnan, self.positions(*self.JOINTS))))

    def freeze(self):
        os.kill(self.running.pid, signal.SIGSTOP)
        self.observe(1.5)
        os.kill(self.running.pid, signal.SIGCONT)

    def switch(self):
        self.claim(["points"], ["arm"])

    def release(self):
        self.manager.ask("switch", [], ["arm"])

    def deactivate(self):
        self.manager.ask("hardware", "cell", "inactive")

    def stop(self):
        self.press_stop(pressed=True)
        wait_for("STO", self.has_sto)
        self.press_stop(pressed=False)

    def disturb(self, way):
        """Begin two trajectories, and disturb one of them at a random time."""
        self.recover()
        self.manager.ask("gap")
        while not self.follow("other", ["second"], 0.0):
            pass
        time_s = self.follow("arm", [*self.JOINTS], HOME_RAD)
        self.observe(time_s or 0.1)
        getattr(self, way)()
        self.observe(1.0)
        self.ends.append(self.manager.ask("outcome", "other"))
        self.gaps_s.append(self.manager.ask("gap"))


WAYS = ("kill", "freeze", "terminate", "switch", "stop", "freeze", "release", "deactivate")


def kills(network, package, scenario, seed, rounds):
    """Disturb trajectories in each way, in random order."""
    sys.stderr.write(f"FSN_KILLS_SEED={seed}\n")
    chance = random.Random(int(seed))
    arm = Arm(network, package, scenario, chance)
    ways = [way for _ in range(int(rounds)) for way in chance.sample(WAYS, len(WAYS))]
    for way in ways:
        sys.stderr.write(f"{way}\n")
        arm.disturb(way)
    arm.recover()
    arm.observe(1.0)
    seen = {"notes": arm.notes, "ends": arm.ends, "gaps_s": arm.gaps_s}
    seen |= {"compared": arm.compared, "moving": arm.moving, "states": arm.manager.ask("states")}
    return seen | {"ways": ways, "said": arm.end()}


CASES |= {"kills": kills}

if __name__ == "__main__":
    main()
