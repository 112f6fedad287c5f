"""Two wires: a network of two buses on emulated segments, one fsn-master on both.

Run as a program: ``several_rig.py CASE NETWORK`` inside a namespace with two cables.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from dataclasses import asdict

from live.live_rig import FSN, Emulator, Running, wait_for

FAR = ("cell=far", "drives=far2")
NEAR = ("cell=near", "drives=near2")
ACROSS = ("el6910-drive_1", "el6910-drive_2")


def words(running):
    return {c.name: c.state for c in running.client.connections()}


def resets(running):
    return {c.name: (c.to_sub.resets, c.to_main.resets) for c in running.client.connections()}


def are_gone(running):
    return not any(word.startswith("data") for n, word in words(running).items() if n in ACROSS)


def status(running, *, drives):
    """Of a cycle that was whole on the first bus, and whole or lost on the other one."""

    def found():
        seen = running.client.status()
        cell, other = seen.buses
        wanted = other.expected_wkc if drives else 0
        return (cell.actual_wkc, other.actual_wkc) == (cell.expected_wkc, wanted) and seen

    return wait_for("a status of such a cycle", found)


def lost(network):
    """The further bus goes and comes back: what is on the first does not notice."""
    emulator = Emulator(network, interfaces=FAR)
    running = Running(network, "--format", "json", interfaces=NEAR)
    before, said = resets(running), status(running, drives=True)
    emulator.do("break drive_1")
    wait_for("the loss", lambda: are_gone(running))
    away = status(running, drives=False)
    stay, count = words(running), resets(running)
    wait_for("more cycles", lambda: running.cycles() > away.cycles + 500)
    later = resets(running)
    emulator.do("heal drive_1")
    wait_for("Data again", running.in_data)
    back = status(running, drives=True)
    vendor = running.client.sdo_read("drive_2", 0x1018, 1, "uint32").value
    monitor = subprocess.run(
        [*FSN, "monitor", "--socket", str(running.socket), "--once"],
        capture_output=True,
        text=True,
        check=False,
    )
    seen = running.end(signal.SIGINT)
    emulator.end()
    return seen | {
        "status": [asdict(s.buses[n]) for s in (said, away, back) for n in (0, 1)],
        "stay": stay,
        "resets": [before, count, later],
        "vendor": vendor,
        "monitor": monitor.stdout,
    }


def first_lost(network):
    """The leading bus goes: its own cycle goes on, and so does the further bus."""
    emulator = Emulator(network, interfaces=FAR)
    running = Running(network, "--format", "json", interfaces=NEAR)
    emulator.do("break el6910")

    def left():
        seen = {s.name: s.in_op for s in running.client.subdevices()}
        return not any(seen[name] for name in ("el6910", "el1904", "el2904")) and seen

    in_op = wait_for("the loss", left)
    before = running.client.status().buses
    wait_for("more cycles", lambda: running.cycles() > before[0].cycles + 200)
    after = running.client.status().buses
    emulator.do("heal el6910")
    wait_for("Data again", running.in_data)
    seen = running.end(signal.SIGINT)
    emulator.end()
    return seen | {"in_op": in_op, "cycles": [[b.cycles for b in x] for x in (before, after)]}


if __name__ == "__main__":
    CASES = {"lost": lost, "first_lost": first_lost}
    sys.stdout.write(json.dumps(CASES[sys.argv[1]](sys.argv[2])) + "\n")
