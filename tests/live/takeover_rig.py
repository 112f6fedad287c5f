"""One `fsn-master` after the other on a wire, with a listener that knows who sent which frame.

Run as a program: ``takeover_rig.py CASE NETWORK [OTHER_NETWORK]`` inside a namespace; prints what
was seen as JSON. Each frame of the cycle carries the number of its run, so the wire itself shows
who drives the bus, and when nobody does.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from itertools import groupby, pairwise
from pathlib import Path

from live.live_rig import FSN, Emulator, wait_for
from tied import tied
from wires import make_room

from fsoe_net.errors import FsnError
from fsoe_net.live.client import Client
from fsoe_net.live.master import find_master

ALL_PROTOCOLS, OUTGOING, TIMESTAMP_NS = 3, 4, 35
INDEX_BYTE, FIRST_CYCLIC, RUN_AT = 17, 0x80, 26
CYCLE_NS = 1_000_000


class Wire:
    """Notes run and time of every process data frame that reaches the SubDevices."""

    def __init__(self):
        self.frames = []
        self._raw = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ALL_PROTOCOLS))
        make_room(self._raw, 32 << 20)
        self._raw.setsockopt(socket.SOL_SOCKET, TIMESTAMP_NS, 1)
        self._raw.bind(("far", ALL_PROTOCOLS))
        self._ends = False
        self._thread = threading.Thread(target=self._hear, daemon=True)
        self._thread.start()

    def _hear(self):
        self._raw.settimeout(0.2)
        while not self._ends:
            try:
                packet, extra, _, sender = self._raw.recvmsg(64, 64)
            except TimeoutError:
                continue
            if sender[2] == OUTGOING or packet[INDEX_BYTE] < FIRST_CYCLIC:
                continue
            seconds, ns = struct.unpack("qq", extra[0][2][:16])
            run = struct.unpack_from("<I", packet, RUN_AT)[0]
            self.frames.append((run, seconds * 10**9 + ns))

    def end(self):
        self._ends = True
        self._thread.join()
        self._raw.close()

    def blocks(self):
        """Return ``(run, frames, first_ns, last_ns)`` of successive frames of one run."""
        found = []
        for run, frames in groupby(self.frames, key=lambda frame: frame[0]):
            times = [at for _, at in frames]
            found.append((run, len(times), times[0], times[-1]))
        return found

    def seen(self):
        """Return how often the sender changed, how many there were, and the gaps between them."""
        blocks = self.blocks()
        gaps = [(after[2] - before[3]) / CYCLE_NS for before, after in pairwise(blocks)]
        return {"changes": len(blocks) - 1, "senders": len({b[0] for b in blocks}), "gaps": gaps}


class Program:
    """An `fsn-master`; ``lines()`` are its own."""

    def __init__(self, name, *options, plan="n.fsnplan"):
        self.log = Path(name)
        at = [] if "--socket" in options else ["--socket", "s"]
        words = [plan, "--interface", "near", *at, *options]
        with self.log.open("wb") as lines:
            self.process = subprocess.Popen(tied(find_master(), *words), stderr=lines)
        self.pid = self.process.pid

    def lines(self):
        return self.log.read_text("utf-8")

    def wait_for(self, text):
        def found():
            if text not in self.lines() and self.process.poll() is not None:
                sys.exit(f"{self.log} has ended without {text!r}: {self.lines()}")
            return text in self.lines()

        wait_for(text, found)

    def end(self):
        self.process.terminate()
        return self.process.wait()


def connect():
    try:
        return Client("s")
    except FsnError:
        return None


def in_data(client):
    try:
        return all(c.state.in_data for c in client.connections())
    except FsnError:
        return False


def wait_for_data(client):
    wait_for("Data", lambda: in_data(client))


def make_plan(network, name="n.fsnplan"):
    subprocess.run([*FSN, "plan", network, "-o", name], check=True, capture_output=True)


def start(network, *options):
    """A bus whose connections are in Data, its wire, and a client."""
    if not Path("n.fsnplan").exists():
        make_plan(network)
    emulator = Emulator(network)
    wire = Wire()
    program = Program("first", "--wait", "30s", *options)
    client = wait_for("the socket", connect)
    wait_for_data(client)
    return emulator, wire, program, client


def left_data(lines):
    """Lines of a successor about a connection that was anywhere but in Data."""
    return [
        line
        for line in lines.splitlines()
        if ": connection " in line.replace(" info ", ": ").replace(" warning ", ": ")
        and not line.split(" -> ")[-1].strip().endswith("data")
    ]


def finish(emulator, wire, program):
    with Client("s") as client:
        returns = [s.returns for s in client.subdevices()]
        where = [s.al for s in client.subdevices()]
        data = in_data(client)
    program.end()
    emulator.end()
    wire.end()
    return wire.seen() | {"returns": returns, "al": where, "data": data}


def planned(network, _other):
    """Three take-overs while clients read all the time; the intervention log goes on."""
    shutil.rmtree("log", ignore_errors=True)  # of a run that was no good
    Path("log").mkdir()
    kept = ("--intervention-log", "log")
    emulator, wire, program, client = start(network, *kept)
    programs, codes, cycles = [program], [], []
    for number in range(3):
        cycles.append(client.snapshot().cycle.statistics.cycles)
        program = Program(f"next{number}", "--take-over", *kept)
        while "took the bus over" not in program.lines() and program.process.poll() is None:
            try:
                client.snapshot()
            except (FsnError, OSError):
                client = wait_for("the socket", connect)
        codes.append(programs[-1].process.wait())
        programs.append(program)
        program.wait_for("ready: every SubDevice is in OP")
        client = wait_for("the socket", connect)
        wait_for_data(client)
    cycles.append(client.snapshot().cycle.statistics.cycles)
    later = "".join(p.lines() for p in programs[1:])
    seen = finish(emulator, wire, program)
    entries = Path("log/interventions-000001.jsonl").read_text("utf-8").splitlines()
    events = [json.loads(line)["event"] for line in entries]
    return seen | {"codes": codes, "cycles": cycles, "left": left_data(later), "events": events}


def output(network, _other):
    """An output that a client holds falls back to its stop value, and is free for the next one."""
    emulator, wire, program, client = start(network)
    name, value = "drive_1.0x6060:00", 3  # its stop value is 8
    client.request("lease", "60000")
    client.request("set", f"{name}={value}")
    wait_for("the value", lambda: client.request("get", name)["outputs"][name] == value)
    program = Program("next", "--take-over")
    program.wait_for("took the bus over")
    client = wait_for("the socket", connect)
    fallen = client.request("get", name)["outputs"][name]
    client.request("set", f"{name}={value}")
    return finish(emulator, wire, program) | {"fallen": fallen}


def refused(network, other):
    """Whatever differs is refused before the former is touched."""
    make_plan(other, "other.fsnplan")
    make_plan(network)
    nobody = Program("nobody", "--take-over")
    codes = {"nobody": nobody.process.wait()}
    emulator, wire, program, _client = start(network)
    tries = {"plan": {"plan": "other.fsnplan"}, "cycle": {"cycle": "2ms"}, "lock": {}}
    for name, how in tries.items():
        words = ["--cycle", how["cycle"]] if "cycle" in how else []
        words += ["--take-over"] if name != "lock" else []
        tried = Program(name, *words, plan=how.get("plan", "n.fsnplan"))
        codes[name] = tried.process.wait()
    emulator.do("wrong drive_2 2 3")
    texts = {name: Path(name).read_text("utf-8") for name in ["nobody", *tries]}
    good = Program("good", "--take-over")  # and it can still be handed over
    good.wait_for("took the bus over")
    return finish(emulator, wire, good) | {
        "codes": codes,
        "texts": texts,
        "left": left_data(program.lines().partition("process data")[2]),
    }


def frozen(network, _other):
    """A former that does not answer is left alone; it thaws, and drives the bus as before."""
    emulator, wire, program, _client = start(network)
    os.kill(program.pid, signal.SIGSTOP)
    tried = Program("next", "--take-over")
    code = tried.process.wait()
    os.kill(program.pid, signal.SIGCONT)
    with wait_for("the socket", connect) as client:
        cycles = client.snapshot().cycle.statistics.cycles  # what it shows first is of before
        wait_for("cycles", lambda: client.snapshot().cycle.statistics.cycles > cycles + 500)
        wait_for("OP", lambda: in_data(client) and all(s.in_op for s in client.subdevices()))
    return finish(emulator, wire, program) | {"code": code, "text": tried.lines()}


def standby_output(network, _other):
    """Frozen and thawed while a client holds an output; `status` names the standby before."""
    emulator, wire, program, client = start(network)
    name = "drive_1.0x6060:00"  # its stop value is 8
    client.request("lease", "60000")
    client.request("set", f"{name}=3")
    standby = Program("next", "--standby")
    standby.wait_for("follows process")
    second = Program("second", "--standby")  # waits for its turn
    named = wait_for("its name", lambda: client.status().standby)
    os.kill(program.pid, signal.SIGSTOP)
    standby.wait_for("took the bus over")
    os.kill(program.pid, signal.SIGCONT)  # it has ended
    code = program.process.wait()
    client = wait_for("the socket", connect)
    fallen = client.request("get", name)["outputs"][name]
    second.wait_for("follows process")
    os.kill(standby.pid, signal.SIGKILL)
    second.wait_for("took the bus over")
    later = standby.lines() + second.lines()
    return finish(emulator, wire, second) | {
        "fallen": fallen,
        "code": code,
        "named": named.pid == standby.pid and not named.held,
        "left": left_data(later),
    }


def frozen_standby(network, _other):
    """A frozen standby whose former ends blocks the bus; the refusal names the standby."""
    emulator, wire, program, _client = start(network)
    standby = Program("next", "--standby")
    standby.wait_for("follows process")
    os.kill(standby.pid, signal.SIGSTOP)
    os.kill(program.pid, signal.SIGKILL)
    program.process.wait()
    refused = Program("refused", "--socket", "s2")
    code = refused.process.wait()
    os.kill(standby.pid, signal.SIGKILL)
    standby.process.wait()
    after = Program("after", "--wait", "30s")
    after.wait_for("ready: every SubDevice is in OP")
    wait_for_data(wait_for("the socket", connect))
    seen = finish(emulator, wire, after)
    return seen | {"code": code, "text": refused.lines(), "standby": standby.pid}


def maintenance(network, _other):
    """Held, it takes nothing over, whatever happens; and a stop that is meant is no failure."""
    emulator, wire, program, client = start(network)
    standby = Program("next", "--standby", "--socket", "s2")
    standby.wait_for("follows process")
    with Client("s2") as second:
        states = [second.status().state]
    client.hold()
    standby.wait_for("maintenance")
    os.kill(program.pid, signal.SIGSTOP)
    time.sleep(0.2)  # far longer than what is missed otherwise
    states.append("took" in standby.lines())
    os.kill(program.pid, signal.SIGCONT)
    client.resume()
    standby.wait_for("follows again")
    wait_for_data(client)
    client.stop()
    codes = [standby.process.wait()]
    client.start()
    wait_for("Data", lambda: client.status().state == "running")
    held = Program("held", "--standby")
    held.wait_for("follows process")
    client.hold()
    held.wait_for("maintenance")
    os.kill(program.pid, signal.SIGKILL)
    codes.append(held.process.wait())
    emulator.end()
    wire.end()
    return wire.seen() | {"states": states, "codes": codes, "text": held.lines()}


def hostile(network, _other):
    """Whatever comes through the lock: the bus goes on, and a take-over still works."""
    emulator, wire, _program, client = start(network)
    left = []
    for message in (b"", b"x", bytes(76), b"\xff" * 4096, bytes(60000)):
        left.append(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
        left[-1].connect("\0fsn-maindevice:near")
        left[-1].send(message)
    silent = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    silent.connect("\0fsn-maindevice:near")
    cycles = client.snapshot().cycle.statistics.cycles
    wait_for("cycles", lambda: client.snapshot().cycle.statistics.cycles > cycles + 100)
    good = Program("good", "--take-over")
    good.wait_for("took the bus over")
    return finish(emulator, wire, good) | {"left": left_data(good.lines())}


def undecided(network, _other):
    """One that was given the lock and says nothing: supervision goes on after ten seconds."""
    emulator, wire, program, _client = start(network)
    plan = hashlib.sha256(Path("n.fsnplan").read_bytes()).digest()
    hello = struct.pack("<4I2Q2I32s32s", 2, 0, 0, 0, CYCLE_NS, 0, 0, 0, plan, b"mute")
    script = f"""
import socket, time
lock = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
lock.connect("\\0fsn-maindevice:near")
lock.send({hello!r})
time.sleep(1000)
"""
    mute = subprocess.Popen(tied(sys.executable, "-c", script))
    program.wait_for("does not take the bus over")
    early = Program("early", "--take-over")  # the mute one still lives, and may believe it is next
    code = early.process.wait()
    mute.kill()
    mute.wait()
    good = Program("good", "--take-over")
    good.wait_for("took the bus over")
    return finish(emulator, wire, good) | {"code": code, "text": early.lines()}


CASES = {
    f.__name__: f
    for f in (
        *(planned, output, refused, frozen),
        *(standby_output, frozen_standby, maintenance, hostile, undecided),
    )
}


def main():
    network, other = sys.argv[2], sys.argv[3] if len(sys.argv) > 3 else None
    seen = CASES[sys.argv[1]](network, other)
    sys.stdout.write(json.dumps(seen) + "\n")


if __name__ == "__main__":
    main()
