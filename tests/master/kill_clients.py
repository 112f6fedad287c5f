"""Clients in the cycle that misbehave, and that are stopped and killed at random moments.

    scripts/rig/realtime-kills [COUNT [SEED]]

Another client goes on in every cycle meanwhile. It looks at the whole process image: nothing in it
is ever written but its own output and the one that the misbehaving client owns.
"""

from __future__ import annotations

import contextlib
import os
import random
import select
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from master import rig
from patience import PATIENCE_S
from tied import tied

import fsoe_net
from fsoe_net.live.client import Client
from fsoe_net.live.realtime import RealTime

MODE = "drive_1.0x6060:00"
STOP = 8
LAMP = "el2904.standard_1"
MISSES = 3
STOPPED = os.WSTOPPED | os.WEXITED | os.WNOHANG | os.WNOWAIT

# Speaks the protocol by hand: what a program may do to the memory is no matter of our library.
VICTIM = """
import mmap, os, socket, struct, sys, time
path, how, name = sys.argv[1:]
s = socket.socket(socket.AF_UNIX)
s.connect(path)
s.sendall(b'realtime 2 any 3 ' + name.encode() + b'\\n')
line, fds, _, _ = socket.recv_fds(s, 65536, 2)
assert line.startswith(b'{"ok":true'), line
m = mmap.mmap(fds[1], 0)
sets_at = struct.unpack_from('<Q', m, 24)[0]
if how == 'holes':
    m.madvise(mmap.MADV_REMOVE)
s.sendall(b'realtime begin\\n')
assert s.recv(4096).startswith(b'{"ok":true')
print(flush=True)
n = 0
while True:
    if how == 'scribble':
        m[:] = os.urandom(len(m))
        m[64:68] = m[68:72]  # as if a set was whole
        continue
    if how == 'holes':
        try:
            m.madvise(mmap.MADV_REMOVE)
            sys.exit('pages were taken out of the memory')
        except OSError:
            pass
    n += 1
    struct.pack_into('<I', m, 64, n)
    struct.pack_into('<QQ', m, sets_at + n % 2 * 16, n, n % 128)
    struct.pack_into('<I', m, 68, n)
    if how == 'run':
        time.sleep(0.0005)
"""
HOW = ("run", "spin", "scribble", "holes")


def rest(realtime: RealTime) -> bytes:
    """Return the process image without the two outputs that are written."""
    image = int.from_bytes(realtime.image, "little")
    for name in (MODE, LAMP):
        symbol = realtime.outputs[name]
        image &= ~((1 << symbol.bits) - 1 << symbol.bit_offset)
    return image.to_bytes(len(realtime.image), "little")


def cycles(realtime: RealTime, count: int, expected: bytes) -> int:
    """Run cycles, and return how many times the other output had not its stop value."""
    moved = 0
    for _ in range(count):
        cycle = realtime.wait(PATIENCE_S)
        assert rest(realtime) == expected
        moved += realtime.sent(MODE) != STOP
        realtime[LAMP] = cycle.cycle & 1
        realtime.send()
    return moved


def one_victim(master: rig.Master, realtime: RealTime, how: str, chance: random.Random) -> int:
    """Let one in, and kill it; return in how many cycles its output was moved."""
    expected = rest(realtime)
    command = tied(sys.executable, "-I", "-S", "-c", VICTIM, master.path, how, MODE)
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            while not select.select([process.stdout], [], [], 0)[0]:
                cycles(realtime, 1, expected)
            assert process.stdout.readline(), "the client was not let in"
            moved = cycles(realtime, chance.randrange(1, 30), expected)
            if chance.randrange(3) == 0:
                process.send_signal(signal.SIGSTOP)
                while not os.waitid(os.P_PID, process.pid, STOPPED):  # it may write once more
                    cycles(realtime, 1, expected)
                cycles(realtime, MISSES + 2, expected)
                assert how == "scribble" or realtime.sent(MODE) == STOP
        finally:
            process.kill()
    for _ in range(10_000):  # the socket ends a moment after the process
        cycles(realtime, 1, expected)
        if realtime.sent(MODE) == STOP:
            return moved
    raise AssertionError("the output of a killed client has not its stop value")


def work_us(client: Client, before: Mapping[str, Any]) -> str:
    """Return how long the cycle has worked since then: median, 99.9 %, and overruns."""
    now, then = client.request("snapshot")["statistics"], before["statistics"]
    counted = Counter(dict(now["work"]["buckets"]))
    counted.subtract(dict(then["work"]["buckets"]))
    total, seen, marks = counted.total(), 0, []
    for floor_ns, times in sorted(counted.items()):
        while len(marks) < 2 and seen + times > total * (0.5, 0.999)[len(marks)]:
            marks.append(f"{floor_ns / 1000:.1f}")
        seen += times
    overruns = now["overruns"] - then["overruns"]
    return f"{' / '.join(marks)} us, {overruns} overruns, {total} cycles"


def kill_clients(count: int, seed: int, say: Callable[[str], object] = str) -> Counter[str]:
    """Kill so many, one after the other; return how many of each kind moved their output."""
    chance = random.Random(seed)
    moved: Counter[str] = Counter()
    # What the cycle works is measured where it has a CPU of its own.
    urgent = ["--policy", "fifo", "--cpu", str((os.cpu_count() or 1) - 1)]
    with (
        rig.running(*(urgent if say is not str else [])) as master,
        fsoe_net.connect(str(master.path)) as client,
    ):
        before = client.status()
        with client.realtime(LAMP, misses=1000) as realtime:
            realtime.wait(PATIENCE_S)
            if say is not str:
                quiet = client.request("snapshot")
                cycles(realtime, 30 * count, rest(realtime))
                say(f"cycle of fsn-master beside one client: {work_us(client, quiet)}")
            quiet = client.request("snapshot")
            for number in range(count):
                how = HOW[number % len(HOW)]
                moved[how] += one_victim(master, realtime, how, chance) > 0
            say(f"and beside {count} that misbehave: {work_us(client, quiet)}")
            counts = realtime.counts()
        after = client.status()
        assert after.cycles > before.cycles
        moved["cycles"] = after.cycles - before.cycles
        moved["overruns"] = after.overruns - before.overruns
        moved["on_time"], moved["late"] = counts.on_time, counts.late
        moved["missed"] = counts.missed
    return moved


if __name__ == "__main__":
    how_many = int(sys.argv[1]) if sys.argv[1:] else 500
    with contextlib.suppress(PermissionError):  # the one that looks on is never late itself
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(10))
    start = int(sys.argv[2]) if sys.argv[2:] else int.from_bytes(os.urandom(4))
    sys.stdout.write(f"{how_many} clients, seed {start}\n")
    counted = kill_clients(how_many, start, lambda line: sys.stdout.write(f"{line}\n"))
    for key, value in counted.items():
        sys.stdout.write(f"  {key}: {value}\n")
