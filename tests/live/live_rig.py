"""A wire in a network namespace of its own: the emulated segment at one end, `run` at the other.

Run as a program: ``live_rig.py CASE NETWORK [OTHER_NETWORK]`` inside a namespace; prints what was
seen as JSON. Waiting is always for something that must come, never for a fixed time.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import asdict
from functools import partial
from pathlib import Path

from incident.rig import judged
from patience import PATIENCE_S
from uncounted import not_counted

from fsoe_net.errors import FsnError
from fsoe_net.live.client import Client
from fsoe_net.live.master import find_master

FSN = [sys.executable, "-m", "fsoe_net.cli"]


def wait_for(what, found):
    until = time.monotonic() + PATIENCE_S
    while not (value := found()):
        if time.monotonic() > until:
            sys.exit(f"never came: {what}")
        time.sleep(0.02)
    return value


# Half the processor time of the default.
PERIOD = ("--device-period", "2ms")


class Emulator:
    """`fsoe-net emulate` on the far end of each cable; takes commands."""

    def __init__(self, network, *options, interfaces=("far",), before=()):
        where = [word for far in interfaces for word in ("--interface", far)]
        with not_counted():  # at each cycle it would take twice the processor time
            self._process = subprocess.Popen(
                [*before, *FSN, "emulate", network, *where, "--commands", *PERIOD, *options],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
            )
        self.do("status")  # answers once it serves

    def give(self, line):
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def do(self, line):
        self.give(line)
        answers = ""
        for answer in self._process.stderr:
            if answer.startswith("EMULATION"):
                continue
            answers += answer
            if line != "status" or " frames, " in answer:
                return answers
        sys.exit(f"the emulator has ended: {answers}")

    def end(self):
        self._process.send_signal(signal.SIGTERM)  # SIGINT may be ignored here
        self._process.communicate()


def run(network, *options):
    done = subprocess.run(
        [*FSN, "run", network, "--interface", "near", *options],
        capture_output=True,
        text=True,
        check=False,
    )
    return {"code": done.returncode, "out": done.stdout, "err": done.stderr}


class Running:
    """A run in the background, with its fsn-master and a client of our own."""

    def __init__(self, network, *options, interfaces=("near",)):
        where = [word for near in interfaces for word in ("--interface", near)]
        self.process = subprocess.Popen(
            [*FSN, "run", network, *where, "--wait", "30", *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        line = self.process.stderr.readline()
        self.pid = int(line.partition("(process ")[2].partition(")")[0])
        self.socket = Path(line.rpartition("control socket ")[2].strip())
        self.client = wait_for("the socket", self.connect)
        wait_for("Data", self.in_data)

    def connect(self):
        try:
            return Client(self.socket)
        except FsnError:
            return None

    def snapshot(self):
        try:
            return self.client.snapshot()
        except FsnError:
            if self.process.poll() is not None:  # nothing comes any more: say why
                sys.exit(f"the run has ended: {self.process.communicate()[1]}")
            return None

    def in_data(self):
        seen = self.snapshot()
        words = [c.state for c in seen.cycle.connections] if seen else [""]
        return all(word.startswith("data") for word in words) and seen

    def cycles(self):
        return self.client.snapshot().cycle.statistics.cycles

    def end(self, number):
        os.kill(self.process.pid, number)
        out, err = self.process.communicate()
        return {"code": self.process.returncode, "out": out, "err": err}


def comes_up(network, other):
    """Runs until the connections are in Data at the end; a busy machine may need a few goes."""
    emulator = Emulator(other or network)
    for _ in range(5):
        seen = run(
            network,
            *("--wait", "30", "--duration", "3", "--format", "json"),
            *("--stats", "timing.csv", "--plot", "timing.svg"),
        )
        if seen["code"] == 0 or other:
            break
    emulator.end()
    return seen


def silent(network, _other):
    return run(network)


def small(network, _other):
    """Long frames do not fit through the interface."""
    subprocess.run(["ip", "link", "set", "near", "mtu", "1400"], check=True)
    return run(network)


def wrong(network, other):
    return comes_up(network, other)


def unplug(network, other):
    """The last SubDevice goes; it is named, also at the end."""
    emulator = Emulator(network)
    running = Running(network, "--format", "json")
    before = running.in_data()
    last = before.subdevices[-1].name

    def synchronous():
        found = running.client.status().clocks
        return found.state == "synchronous" and found

    clocks = wait_for("clocks", synchronous)
    emulator.do(f"break {last}")
    wait_for("its loss", lambda: not running.client.subdevices()[-1].in_op)
    wait_for("a Reset", lambda: not running.in_data())
    seen = running.end(signal.SIGINT)
    emulator.end()
    return seen | {"last": last, "left": _is_running(running.pid), "clocks": asdict(clocks)}


def incident(network, other):
    """The last SubDevice goes and comes back: fsn-master writes what happened into a file."""
    emulator = Emulator(network)
    running = Running(network, "--incidents", ".")
    last = running.in_data().subdevices[-1].name

    def written():
        """Files that are whole and of a fault: a reset with code 0 is somebody's wish."""
        texts = {path: path.read_text() for path in Path().glob("incident-*")}
        whole = {p: json.loads(t.partition("\n")[0]) for p, t in texts.items() if '"end":true' in t}
        return {p: head for p, head in whole.items() if head["trigger"]["reset_code"]}

    def named():
        """Those that name the SubDevice and hold what devices have answered; a busy machine has
        incidents of its own, and answers that come too late."""
        return [
            path
            for path, head in written().items()
            if (why := judged(path).likely) and last in why.title and "fsoe" in head
        ]

    until = time.monotonic() + PATIENCE_S
    while not named() and time.monotonic() < until:  # one in ten seconds is written
        wait_for("Data", running.in_data)
        emulator.do(f"break {last}")
        wait_for("its loss", lambda: not running.client.subdevices()[-1].in_op)
        wait_for("a Reset", lambda: not running.in_data())
        emulator.do(f"heal {last}")
        wait_for("its return", lambda: running.client.subdevices()[-1].in_op)
    running.end(signal.SIGINT)
    emulator.end()
    return {"last": last, "file": str(named()[0]) if named() else None}


def gap(network, kind):
    """The line opens for a while: after a SubDevice, or at the interface of the MainDevice."""
    emulator = Emulator(network)
    running = Running(network, "--incidents", ".")
    opens, closes = {
        "line": (lambda: emulator.do("cut el1904"), lambda: emulator.do("splice el1904")),
        "interface": (partial(_set_link, "down"), partial(_set_link, "up")),
    }[kind]
    opens()
    wait_for("its loss", lambda: not running.client.subdevices()[-1].in_op)
    wait_for("a Reset", lambda: not running.in_data())
    closes()
    wait_for("a file", lambda: [p for p in Path().glob("incident-*") if _is_whole(p)])
    running.end(signal.SIGINT)
    emulator.end()
    first = min(Path().glob("incident-*"), key=lambda p: p.stat().st_mtime_ns)
    likely = judged(first).likely
    return {"key": likely and likely.key, "title": likely and likely.title}


def _set_link(state):
    subprocess.run(["ip", "link", "set", "near", state], check=True)


def _send_as_another(frames):
    """Frames of another MainDevice: a BRD with an index that SOEM uses, too."""
    frame = bytes.fromhex("ffffffffffff 010101010101 88a4 0d10 0703") + bytes(42)
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW) as raw:
        raw.bind(("near", 0x88A4))
        for _ in range(frames):
            raw.send(frame)


FAULTS = {
    "foreign": ("foreign", "break LAST"),
    "wrong": ("wrong LAST 2 3", "power-cycle LAST"),
    "late": ("delay 1500us",),
}


def fault(name):
    """Something happens to a running bus; which cause is named in the files it leaves?"""

    def case(network, other):
        emulator = Emulator(network)
        running = Running(network, "--incidents", ".", "--intervention-log", "log")
        last = running.in_data().subdevices[-1].name
        for step in FAULTS[name]:
            _send_as_another(50) if step == "foreign" else emulator.do(step.replace("LAST", last))
        log = Path("log/interventions-000001.jsonl")
        wait_for("a file", lambda: [p for p in Path().glob("incident-*") if _is_whole(p)])
        wait_for("its entry", lambda: '"event":"incident"' in log.read_text("utf-8"))
        running.end(signal.SIGINT)
        emulator.end()
        first = min(Path().glob("incident-*"), key=lambda p: p.stat().st_mtime_ns)
        likely = judged(first).likely
        lines = log.read_text("utf-8").splitlines()
        return {
            "key": likely and likely.key,
            "title": likely and likely.title,
            "last": last,
            "log": [json.loads(line) for line in lines],
            "files": {str(p): _sha256(p) for p in Path().glob("incident-*")},
        }

    return case


def swapped_at_start(network, _other):
    """Two SubDevices stand in each other's place: the file has what was found of both."""
    emulator = Emulator(network)
    emulator.do("swap ek1914 el1918")
    seen = run(network, "--incidents", ".")
    emulator.end()
    files = sorted(Path().glob("incident-*"))  # a first try may meet nobody on a busy machine
    likely = judged(files[-1]).likely if files else None
    head = json.loads(files[-1].read_text().partition("\n")[0]) if files else {"subdevices": []}
    found = [row.get("found") for row in head["subdevices"]]
    return seen | {"title": likely and likely.title, "found": found}


def _sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _is_whole(path):
    return '"end":true' in path.read_text()


RING = {
    "first cable": "cut main",
    "middle cable": "cut ek1914",
    "last cable": "cut el1918",
    "near": "far down",
    "near2": "far2 down",
}


def ring(network, _other):
    """Each cable and interface of a ring goes and comes back; then two at once, in an incident."""
    subprocess.run(["ip", "link", "set", "far", "down"], check=True)
    emulator = Emulator(network, "--redundant", "far2")
    running = Running(network, "--redundant", "near2", "--incidents", ".")

    def becomes(state):
        def settled():
            found = running.client.status().ring
            return found.state == state and found

        return wait_for(f"a ring that is {state}", settled)

    def put(step):
        words = step.split()
        if words[0] in ("far", "far2"):
            subprocess.run(["ip", "link", "set", *words], check=True)
        else:
            emulator.do(step)

    seen = {"start": becomes("open").place}
    put("far up")
    becomes("closed")
    for name, step in RING.items():
        put(step)
        seen[name] = becomes("open").place
        wait_for("Data", running.in_data)
        put(step.replace("cut", "splice").replace("down", "up"))
        seen["breaks"] = becomes("closed").breaks
    put("cut main")
    becomes("open")
    put("cut el1918")
    wait_for("a Reset", lambda: not running.in_data())
    wait_for("a file", lambda: [p for p in Path().glob("incident-*") if _is_whole(p)])
    ended = running.end(signal.SIGINT)
    emulator.end()
    last = max(Path().glob("incident-*"), key=lambda p: p.stat().st_mtime_ns)
    head = json.loads(last.read_text("utf-8").partition("\n")[0])
    likely = judged(last).likely
    return seen | {
        "events": [line for line in ended["out"].splitlines() if "the ring" in line],
        "incident": head["ring"],
        "evidence": list(likely.evidence) if likely else [],
    }


def in_the_cycle(network, other):
    """A loop of our own runs in the cycle, while a SubDevice goes and comes back."""
    mode = "drive_1.0x6060:00"
    emulator = Emulator(network)
    running = Running(network)
    last = running.in_data().subdevices[-1].name
    seen = {}
    with running.client.realtime(mode, misses=1000) as realtime:

        def turns(until):
            for _ in range(20_000):
                cycle = realtime.wait(PATIENCE_S)
                realtime[mode] = cycle.cycle % 100
                realtime.send()
                if until(cycle):
                    return True
            return False

        def complete(cycle):
            return cycle.expected_wkc == cycle.actual_wkc

        first = realtime.wait(PATIENCE_S).cycle
        seen["begins"] = turns(lambda cycle: cycle.cycle > first + 300)
        emulator.do(f"break {last}")
        seen["breaks"] = turns(lambda cycle: not complete(cycle))
        emulator.do(f"heal {last}")
        seen["heals"] = turns(complete)
        sent = realtime.sent(mode)
        seen["sent"] = 0 <= sent < 100
        counts = realtime.counts()
        seen |= {"on_time": counts.on_time, "late": counts.late, "missed": counts.missed}
    wait_for("Data", running.in_data)
    wait_for("its stop value", lambda: running.client.get(mode).outputs[mode] == 8)
    running.end(signal.SIGINT)
    emulator.end()
    return seen


def kill_tool(network, other):
    """fsoe-net is killed: fsn-master cycles on, its socket is usable, and ends when asked."""
    emulator = Emulator(network)
    running = Running(network)
    running.end(signal.SIGKILL)
    cycles = running.cycles()
    wait_for("more cycles", lambda: running.cycles() > cycles + 100)
    again = Client(running.socket)
    data = running.in_data() is not None
    again.request("shutdown")
    wait_for("its end", lambda: not _is_running(running.pid))
    emulator.end()
    return {"data": data, "socket_left": running.socket.exists()}


def kill_master(network, other):
    emulator = Emulator(network)
    running = Running(network)
    os.kill(running.pid, signal.SIGKILL)
    out, err = running.process.communicate()
    emulator.end()
    left = running.socket.parent.exists()
    return {"code": running.process.returncode, "out": out, "err": err, "left": left}


def interrupt(network, other):
    """Ctrl-C ends it orderly and still shows the result; the SubDevices have left OP."""
    emulator = Emulator(network)
    running = Running(network)
    seen = running.end(signal.SIGTERM)
    status = emulator.do("status")
    emulator.end()
    return seen | {"left": _is_running(running.pid), "status": status}


def stopped(network, other):
    """Another client ends fsn-master."""
    emulator = Emulator(network)
    running = Running(network)
    running.client.request("shutdown")
    out, err = running.process.communicate()
    emulator.end()
    return {"code": running.process.returncode, "out": out, "err": err}


def _is_running(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def own_lines(network, *options):
    """Start fsn-master by hand; return it with a function that reads its own lines."""
    subprocess.run([*FSN, "plan", network, "-o", "n.fsnplan"], check=True, capture_output=True)
    words = ["n.fsnplan", "--interface", "near", "--socket", "s", "--policy", "other", *options]
    with open("lines", "wb") as lines:
        master = subprocess.Popen([find_master(), *words], stderr=lines)
    return master, lambda: Path("lines").read_text("utf-8")


def lost_bus(network, _other):
    """Every SubDevice goes at once and stays away for some seconds of cycles."""
    emulator = Emulator(network)
    master, lines = own_lines(network, "--wait", "30s")
    wait_for("a bus", lambda: "ready: every SubDevice is in OP" in lines())
    emulator.end()
    wait_for("its loss", lambda: "the bus is lost" in lines())
    with Client("s") as client:
        wait_for("lost", lambda: client.snapshot().cycle.statistics.lost_frames > 3000)
    master.terminate()
    master.wait()
    return {"lines": lines()}


def missing_one(network, _other):
    """The last SubDevice never comes; fsn-master tries until its time is over."""
    emulator = Emulator(network)
    emulator.do("break drive_2")
    master, lines = own_lines(network, "--wait", "4s")
    code = master.wait()
    emulator.end()
    return {"lines": lines(), "code": code}


def parameters(network, other):
    """The devices run with other parameters than the plan; fsn-master shall be strict about it."""
    emulator = Emulator(other)
    master, lines = own_lines(network, "--wait", "30s", "--require-observed")
    wait_for("Data", lambda: " -> failsafe data" in lines() or " -> process data" in lines())
    with Client("s") as client:
        wait_for("Data", lambda: all(c.state.in_data for c in client.connections()))
    answers = {
        name: subprocess.run([*FSN, *words], capture_output=True, text=True, check=False)
        for name, words in {
            "verify": ["acceptance", "verify", "--accepted", network, "--socket", "s"],
            "monitor": ["monitor", "--socket", "s", "--once"],
        }.items()
    }
    master.terminate()
    code = master.wait()
    emulator.end()
    return {
        "lines": lines(),
        "code": code,
        "answers": {name: [done.returncode, done.stdout] for name, done in answers.items()},
    }


CASES = {
    f.__name__: f
    for f in (
        comes_up,
        lost_bus,
        missing_one,
        parameters,
        silent,
        small,
        swapped_at_start,
        wrong,
        unplug,
        in_the_cycle,
        gap,
        incident,
        ring,
        kill_tool,
        kill_master,
        interrupt,
        stopped,
    )
} | {f"fault {name}": fault(name) for name in FAULTS}


def main():
    network, other, *more = [*sys.argv[2:4], *[None] * (4 - len(sys.argv)), *sys.argv[4:]]
    sys.stdout.write(json.dumps(CASES[sys.argv[1]](network, other, *more)) + "\n")


if __name__ == "__main__":
    main()
