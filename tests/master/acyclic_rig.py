"""Transfers with SubDevices of the emulated segment, over the control socket of ``fsn-master``.

Run as a program: ``acyclic_rig.py CASE NETWORK PLAN`` inside a network namespace; prints what was
seen as JSON. Waiting is always for something that must come, never for a fixed time.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from live.live_rig import Emulator, wait_for
from master.rig import Client, program

NEAR = ["--interface", "near", "--policy", "other", "--log", "json"]
DRIVE = "drive_1"
MAIN = "el6910"


class Bus:
    """A running ``fsn-master``, all SubDevices in OP."""

    def __init__(self, network, plan):
        self.emulator = Emulator(network)
        self.folder = tempfile.TemporaryDirectory(prefix="fsn-")  # a short path, for a socket
        self.path = str(Path(self.folder.name) / "s")
        self.process = subprocess.Popen(
            [program(), plan, *NEAR, "--wait", "30s", "--socket", self.path],
            stderr=subprocess.DEVNULL,
        )
        wait_for("the socket", lambda: os.path.exists(self.path))
        self.client = wait_for("a client", self.connect)
        wait_for("OP", self.in_op)

    def connect(self):
        try:
            return Client(self.path)
        except OSError:
            return None

    def in_op(self):
        status = self.client.ask("status")
        found = status["subdevices"]
        return status["state"] == "running" and found["in_op"] == found["planned"]

    def ask(self, *lines):
        return [self.client.ask(line) for line in lines]

    def end(self):
        self.client.ask("shutdown")
        code = self.process.wait()
        self.emulator.end()
        self.folder.cleanup()
        return code


def objects(bus):
    """Values of every kind, abort codes, refusals."""
    return bus.ask(
        f"sdo-read {DRIVE} 0x1018 1 uint32",
        f"#7 sdo-read {DRIVE} 0x1008 0x0 string",
        f"sdo-read {DRIVE} 4096 0",
        f"sdo-read {DRIVE} 0x5fff 0",
        f"sdo-read {DRIVE} 0x1018 99 uint8",
        f"sdo-read {DRIVE} 0x10000 0",
        f"sdo-read {DRIVE} 0x1000 256",
        f"sdo-read {DRIVE} 0x1000 0 int24",
        "sdo-read nobody 0x1000 0",
        f"sdo-write {DRIVE} 0x1018 1 uint32 1",
        f"sdo-write {DRIVE} 0x10f3 5 uint16 0b11",
        f"sdo-read {DRIVE} 0x10f3 5 uint16",
        f"sdo-write {DRIVE} 0x10f3 5 uint16 0x10000",
        f"sdo-write {DRIVE} 0x10f3 5 uint32 1",
        f"sdo-write {DRIVE} 0x1600 0 uint8 0",
        f"sdo-write {DRIVE} 0x6640 0 uint8 0",
        f"sdo-write {MAIN} 0xe901 2 uint16 5",
        f"sdo-write {DRIVE} 0xf980 1 uint16 5",
        f"sdo-read {DRIVE} 0xf980 1 uint16",
        f"history {DRIVE}",
    )


def sii(bus):
    """The SII, and an alias that is used after the next power-on."""
    seen = bus.ask(f"sii-read {DRIVE}", f"alias-write {DRIVE} 0x1234", f"sii-read {DRIVE}")
    seen += bus.ask(f"alias-write {DRIVE} 65536", f"sii-read {DRIVE} 1", "scan now")
    return seen


def scan(bus):
    other = bus.connect()
    other.socket.sendall(b"events on\n#s scan\n")
    answered = bus.ask(*["status"] * 20)  # while that goes on
    reply = other.line()
    while reply.get("tag") != "s":
        reply = other.line()
    return {"scan": reply, "ok": all(a["ok"] for a in answered), "op": bool(bus.in_op())}


def queue(bus):
    """A thousand requests at once are answered in order; others go on meanwhile."""
    other = bus.connect()
    lines = [f"#{n} sdo-read {DRIVE} 0x1018 1 uint32" for n in range(1000)]
    other.socket.setblocking(True)
    other.socket.sendall("".join(line + "\n" for line in lines).encode())
    between = bus.ask(*["hello"] * 10)
    replies = [other.line() for _ in lines]
    tags = [int(r["tag"]) for r in replies]
    return {
        "in_order": tags == sorted(tags) == list(range(1000)),
        "refused": [r for r in replies if not r["ok"]],
        "between": all(b["ok"] for b in between),
    }


def leaves(bus):
    """Clients that leave during a transfer; a mailbox that is slow; one that never answers."""
    bus.emulator.do(f"mailbox-delay {DRIVE} 200ms")
    for _ in range(20):
        client = bus.connect()
        client.socket.sendall(f"sdo-read {DRIVE} 0x1018 1\n".encode() * 50)
        client.close()
    slow = bus.ask(f"sdo-read {DRIVE} 0x1018 1 uint32")[0]
    bus.emulator.do(f"mailbox-delay {DRIVE} 100s")
    never = bus.ask(f"sdo-read {DRIVE} 0x1018 1")[0]
    bus.emulator.do(f"mailbox-delay {DRIVE} 0")
    again = wait_for(
        "an answer again",
        lambda: [r for r in bus.ask(f"sdo-read {DRIVE} 0x1018 1 uint32") if r["ok"]],
    )
    half = bus.connect()  # as `nc -N` does: writes, then closes its own direction
    half.socket.sendall(f"sdo-read {DRIVE} 0x1018 1 uint32\n".encode())
    half.socket.shutdown(1)
    clients = bus.ask("status")[0]["clients"]
    return {"slow": slow, "never": never, "again": again[0], "half": half.line(), "left": clients}


def unplug(bus):
    """The device goes during a long transfer; the others are supervised all the time."""
    bus.emulator.do(f"mailbox-delay {DRIVE} 300ms")
    other = bus.connect()
    other.socket.sendall(f"history {DRIVE}\nsdo-read {DRIVE} 0x1018 1\n".encode())
    bus.emulator.do(f"break {DRIVE}")
    replies = [other.line(), other.line()]
    wait_for("its loss", lambda: bus.ask("status")[0]["subdevices"]["missing"] != 0)
    gone = bus.ask(f"sdo-read {DRIVE} 0x1018 1", "scan")
    rest = bus.ask(f"sdo-read {MAIN} 0x1018 1 uint32")[0]
    return {"replies": replies, "gone": gone[0], "scan": gone[1], "rest": rest}


def stop(bus):
    """A stop ends what is under way and what waits."""
    bus.emulator.do(f"mailbox-delay {DRIVE} 100ms")
    others = [bus.connect() for _ in range(8)]
    for other in others:
        other.socket.sendall(f"history {DRIVE}\n".encode())
    bus.ask("stop")
    replies = [other.line() for other in others]
    stopped = bus.ask(f"sdo-read {DRIVE} 0x1018 1", "scan")
    return {"replies": replies, "stopped": stopped}


CASES = {f.__name__: f for f in (objects, sii, scan, queue, leaves, unplug, stop)}


def without_plan(network, half):
    """``fsn-master --scan``; with `half` one mailbox is dead and one SubDevice refuses."""
    emulator = Emulator(network)
    if half:
        emulator.do(f"mailbox-delay {DRIVE} 100s")
        emulator.do("sdo-abort el1904 0x1c12 0x08000000")
    done = subprocess.run(
        [program(), "--scan", "--interface", "near"], capture_output=True, text=True, check=False
    )
    emulator.end()
    silent = subprocess.run(
        [program(), "--scan", "--interface", "near"], capture_output=True, text=True, check=False
    )
    return {
        "code": done.returncode,
        "document": json.loads(done.stdout),
        "silent": [silent.returncode, silent.stdout, silent.stderr],
    }


def main():
    case, network, plan = sys.argv[1:4]
    if case in ("whole", "half"):
        seen = without_plan(network, case == "half")
    else:
        bus = Bus(network, plan)
        seen = CASES[case](bus)
        code = bus.end()
        assert code == 0, code
    sys.stdout.write(json.dumps(seen) + "\n")


if __name__ == "__main__":
    main()
