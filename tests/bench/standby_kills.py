"""Kills, freezes and stops the `fsn-master` that drives a bus, again and again.

Call: ``standby_kills.py TIMES [SEED]``, as root in a network namespace of its own
(``scripts/rig/standby-kills`` makes it). A standby takes over
each time, and the next one is started.  The wire itself shows who sends, and how long nobody does.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import random
import signal
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import NamedTuple

from live.live_rig import Emulator, wait_for
from live.takeover_rig import Program, Wire, connect, left_data, make_plan, wait_for_data

NETWORK = str(Path(__file__).parents[2] / "examples" / "el6910" / "network.yaml")
WATCHDOG_MS = 50.0  # those that a connection is to survive have at least so much
WAYS = ("kill", "stop", "stop and thaw", "freeze of the cyclic thread")
RT_PRIORITY = 40  # field of proc_pid_stat(5)
PTRACE_SEIZE, PTRACE_INTERRUPT, WALL = 0x4206, 0x4207, 0x40000000


class Clock(threading.Thread):
    """Only watches the clock: a stall of the machine is no fault of a standby."""

    def __init__(self):
        super().__init__(daemon=True)
        self.stalls = []
        self.ends = False

    def run(self):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(90))
        before = time.monotonic()
        while not self.ends:
            time.sleep(0.001)
            now = time.monotonic()
            if now - before > 0.005:
                self.stalls.append((before, now))
            before = now

    def longest_ms(self, begin, end):
        return max([0.0, *((b - a) * 1e3 for a, b in self.stalls if b >= begin and a <= end)])


def cyclic_thread(pid):
    """The one thread of a process that has a real-time priority."""
    for task in os.listdir(f"/proc/{pid}/task"):
        fields = Path(f"/proc/{pid}/task/{task}/stat").read_text().rpartition(")")[2].split()
        if int(fields[RT_PRIORITY - 3]) > 0:
            return int(task)
    sys.exit("no thread has a real-time priority: this needs root")


def freeze(task):
    """Stop one thread for good; whoever stops it has to take notice of its end."""
    libc = ctypes.CDLL(None, use_errno=True)
    for request in (PTRACE_SEIZE, PTRACE_INTERRUPT):
        libc.ptrace(request, task, None, None)
    with contextlib.suppress(ChildProcessError):
        while os.WIFSTOPPED(os.waitpid(task, WALL)[1]):
            pass


def thaw(pid):
    with contextlib.suppress(OSError):
        os.kill(pid, signal.SIGCONT)


def hurt(program, way, chance):
    time.sleep(chance.uniform(0, 0.01))  # anywhere in a cycle
    if way == "kill":
        os.kill(program.pid, signal.SIGKILL)
    elif way == "stop":
        os.kill(program.pid, signal.SIGSTOP)
    elif way == "stop and thaw":
        os.kill(program.pid, signal.SIGSTOP)
        # Anywhere between the moment when it is missed and long after.
        threading.Timer(chance.uniform(0.0, 0.04), thaw, [program.pid]).start()
    else:
        threading.Thread(target=freeze, args=[cyclic_thread(program.pid)], daemon=True).start()


class Round(NamedTuple):
    """One take-over: how it began, and what of it did not go as it should."""

    way: str
    begin_s: float
    end_s: float
    fault: str


def devices():
    """Above all that is tried here: their watchdogs do not wait for it."""
    cpu = str(max(os.sched_getaffinity(0)))
    return Emulator(NETWORK, "--priority", "91", "--cpu", cpu, before=["chrt", "-f", "10"])


def kills(times, seed):
    """Return a round for each take-over, and the wire."""
    chance = random.Random(seed)  # to repeat a run
    make_plan(NETWORK)
    emulator, wire = devices(), Wire()
    driving = [Program("0", "--wait", "30s")]
    try:
        wait_for_data(wait_for("the socket", connect))
        rounds = [one_round(number, driving, chance) for number in range(1, times + 1)]
        driving[-1].end()
    finally:
        for program in driving:
            program.process.kill()
        emulator.end()
        wire.end()
    return rounds, wire


def one_round(number, driving, chance):
    """Let a standby follow, end the one that drives the bus, and see what becomes of it."""
    standby, former = Program(str(number), "--standby"), driving[-1]
    driving.append(standby)
    standby.wait_for("follows process")
    time.sleep(chance.uniform(0.02, 0.1))
    way, begin_s = chance.choice(WAYS), time.monotonic()
    hurt(former, way, chance)
    wait_for_end(standby, former, way)
    former.process.kill()
    former.process.wait()
    driving.remove(former)
    standby.wait_for("ready: every SubDevice is in OP")
    with wait_for("the socket", connect) as client:
        wait_for_data(client)
        returned = sum(s.returns for s in client.subdevices())
    left = left_data(standby.lines())
    former.log.unlink()
    fault = left[0] if left else f"{returned} returns" if returned else ""
    return Round(way, begin_s, time.monotonic(), fault)


def wait_for_end(standby, program, way):
    """Wait for a take-over; what thawed in time is not missed, and is stopped again for good."""
    until = time.monotonic() + 1.0
    while "took the bus over" not in standby.lines():
        if way == "stop and thaw" and time.monotonic() > until:
            os.kill(program.pid, signal.SIGSTOP)
            until += 1e9
        time.sleep(0.005)
        if standby.process.poll() is not None:
            sys.exit(f"the standby has ended: {standby.lines()}")


def main():
    times = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    clock = Clock()
    clock.start()
    with tempfile.TemporaryDirectory(prefix="fsn-") as folder:
        os.chdir(folder)
        rounds, wire = kills(times, seed)
        os.chdir("/")
    clock.ends = True
    sys.exit(judge(rounds, wire.seen(), clock))


def judge(rounds, seen, clock):
    faults, gaps = 0, seen["gaps"]
    for number, found in enumerate(rounds, 1):
        stall_ms = clock.longest_ms(found.begin_s, found.end_s)
        if found.fault:
            explained = stall_ms > WATCHDOG_MS
            faults += not explained
            what = "the machine stood still for" if explained else "not explained; longest stall"
            print(
                f"take-over {number}, {found.way}, gap {gaps[number - 1]:.1f}: {found.fault}; "
                f"{what} {stall_ms:.0f} ms"
            )
    mixed = (seen["changes"], seen["senders"]) != (len(rounds), len(rounds) + 1)
    ways = ", ".join(f"{sum(r.way == way for r in rounds)} {way}" for way in WAYS)
    print(f"{len(rounds)} take-overs ({ways}), no frame of two mixed: {not mixed}")
    print(
        f"gap on the wire in cycles of 1 ms: median {statistics.median(gaps):.1f}, "
        f"99 % {sorted(gaps)[len(gaps) * 99 // 100]:.1f}, largest {max(gaps):.1f}; "
        f"longest stall of the machine {clock.longest_ms(0, float('inf')):.0f} ms"
    )
    print(f"connections that left Data without such a stall: {faults}")
    return 1 if faults or mixed else 0


if __name__ == "__main__":
    main()
