"""A wire on which tools are plugged and pulled, one fsn-master on it.

Run as a program: ``groups_rig.py exchange NETWORK`` inside a namespace with a cable.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from dataclasses import asdict

from live.live_rig import FSN, Emulator, Running, wait_for

VALVES, SPINDLE, ALWAYS = "el6910-valves", "el6910-spindle", "el6910-el1904"


def words(running):
    return {c.name: c.state for c in running.client.connections()}


def groups(running):
    return {g.name: asdict(g) for g in running.client.status().groups}


def monitored(running):
    done = subprocess.run(
        [*FSN, "monitor", "--socket", str(running.socket), "--once"],
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


def in_data(name):
    return lambda running: words(running)[name].startswith("data")


class Tools(Running):
    """A run that is ready when what is always there is in Data, and the first tool."""

    def in_data(self):
        seen = self.snapshot()
        found = {c.name: c.state for c in seen.cycle.connections} if seen else {}
        return all(found.get(n, "").startswith("data") for n in (ALWAYS, VALVES)) and seen


def resets(running):
    return {c.name: (c.to_sub.resets, c.to_main.resets) for c in running.client.connections()}


def whole(running):
    """Return a status of a cycle that lost no frame; a busy machine loses some."""

    def found():
        status = running.client.status()
        return status.actual_wkc == status.expected_wkc and status

    return wait_for("a whole cycle", found)


def exchange(network):
    """The gripper is pulled, the drill comes; then the gripper is plugged in beside it."""
    emulator = Emulator(network)
    running = Tools(network, "--format", "json", "--incidents", ".")
    first, before = groups(running), resets(running)[ALWAYS]
    emulator.do("pull gripper")
    wait_for("its absence", lambda: groups(running)["gripper"]["state"] == "absent")
    wait_for("its end", lambda: words(running)[VALVES] == "reset")
    none, empty = whole(running), monitored(running)
    emulator.do("plug drill")
    wait_for("the drill", lambda: groups(running)["drill"]["state"] == "there")
    wait_for("its Data", lambda: words(running)[SPINDLE].startswith("data"))
    second, full = whole(running), monitored(running)
    emulator.do("plug gripper")
    wait_for("a word on the second", lambda: groups(running)["gripper"]["state"] == "wrong")
    both = groups(running)["gripper"]
    emulator.do("pull gripper")
    wait_for("its absence", lambda: groups(running)["gripper"]["state"] == "absent")
    after = resets(running)[ALWAYS]
    refused = emulator.do("plug welder")
    files = subprocess.run(["ls"], capture_output=True, text=True, check=True).stdout.split()
    seen = running.end(signal.SIGINT)
    emulator.end()
    return seen | {
        "first": first,
        "none": [none.absent, none.missing, none.expected_wkc, none.actual_wkc],
        "second": [second.absent, second.missing, second.expected_wkc, second.actual_wkc],
        "monitor": [empty, full],
        "both": both,
        "resets": [before, after],
        "refused": refused,
        "incidents": [name for name in files if name.startswith("incident-")],
    }


if __name__ == "__main__":
    sys.stdout.write(json.dumps({"exchange": exchange}[sys.argv[1]](sys.argv[2])) + "\n")
