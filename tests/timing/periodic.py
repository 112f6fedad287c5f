"""A small event simulation of a safety function with strictly periodic tasks, in microseconds.

Written apart from the product and from `signal_path`: nobody chooses here when a task runs. Each
task has one period and one phase for the whole run, the bus too. A demand comes once; one
connection may deliver frames late or lose them from then on. Sensor and actuator take no time.

    device I     samples its input, sends the sample in answer to the logic
    logic        holds a MainInstance for each connection
    device O     acts on what it accepts; with one connection it is device I
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

NEVER = 10**15
SAFE = "safe"  # reset or expired: as good as a demand


@dataclass(slots=True)
class Task:
    """Runs at phase, phase + period, ...; what it reads at a start it writes at the next."""

    period: int
    phase: int

    def last_start_before(self, time: int) -> int:
        return self.phase + (time - 1 - self.phase) // self.period * self.period


@dataclass(slots=True)
class End:
    """One end of a connection: answers each new frame, starts its watchdog with each answer."""

    task: Task
    watchdog: int
    started: int = 0
    dead: bool = False
    inbox: deque[tuple[int, bool | str]] = field(default_factory=deque)


Policy = Callable[[int, End], int]  # normal delivery and receiver -> delivery


@dataclass(slots=True)
class Run:
    """One run; `bus` is its period, `k` the bus cycles of a frame."""

    bus: Task
    k: int
    demand: int = NEVER
    late: dict[str, Policy] = field(default_factory=dict)

    def send(self, name: str, to: End, written: int, value: bool | str) -> None:
        first = self.bus.phase - (self.bus.phase - written) // self.bus.period * self.bus.period
        arrives = first + (self.k - 1) * self.bus.period
        if written >= self.demand and name in self.late:
            arrives = self.late[name](arrives, to)
        if to.inbox:
            arrives = max(arrives, to.inbox[-1][0])
        to.inbox.append((arrives, value))

    def step(self, name: str, end: End, to: End, now: int, value: bool) -> bool | str | None:
        """Run one end at the start of its task; return what it accepted."""
        if end.dead:
            return None
        if now - end.started >= end.watchdog:
            end.dead = True
            self.send(name, to, now + end.task.period, SAFE)
            return SAFE
        if not end.inbox or end.inbox[0][0] > now:
            return None
        _, seen = end.inbox.popleft()
        if seen == SAFE:
            end.dead = True
            return SAFE
        end.started = now
        self.send(name, to, now + end.task.period, value)
        return seen


def response(
    rng: random.Random,
    times: dict[str, int],
    watchdogs: tuple[int, int],
    *,
    faulty: str = "",
    shared: bool = False,
    whole: bool = False,
) -> int:
    """Return the time from a demand until the output acts, in microseconds.

    Args:
        rng: Chooses periods, phases, when the demand comes and what happens to frames.
        times: Longest cycles of ``input``, ``logic``, ``output`` and ``bus``; ``k``.
        watchdogs: Of the connections to input and output.
        faulty: ``in`` or ``out``, the connection that is late and lost; else none.
        shared: One connection and one device for both ways; ``faulty`` is ``in`` then.
        whole: Every task takes the whole of its time, as one with a fixed cycle does.
    """

    def task(longest: int) -> Task:
        period = longest if whole else max(50, int(longest * rng.random()))
        return Task(period, rng.randrange(period))

    logic, device_in = task(times["logic"]), task(times["input"])
    device_out = device_in if shared else task(times["output"])
    there = (End(logic, watchdogs[0]), End(device_in, watchdogs[0]))
    back = there if shared else (End(logic, watchdogs[1]), End(device_out, watchdogs[1]))
    run = Run(Task(times["bus"], rng.randrange(times["bus"])), times["k"])
    if not shared:
        run.send("out", back[1], 0, False)
    run.send("in", there[1], 0, False)
    if faulty:
        run.late[faulty] = _policy(rng)
    missed = rng.random() < 0.8  # the demand comes just after a sample that is sent
    wait = 0 if missed else rng.randrange(2 * times["logic"])
    return _until_safe(run, there, back, rng.randrange(3, 6), wait)


def _until_safe(
    run: Run, there: tuple[End, End], back: tuple[End, End], answers: int, wait: int
) -> int:
    """Run until the output acts; the demand comes `wait` after so many answers of the input."""
    (main_in, sub_in), (main_out, sub_out) = there, back
    logic, device_in, device_out = main_in.task, sub_in.task, sub_out.task
    decided = NEVER
    at = {id(t): (t.phase, t) for t in (device_in, logic, device_out)}
    while True:
        now, who = min(at.values(), key=lambda entry: entry[0])
        at[id(who)] = now + who.period, who
        if who is device_in:
            if sub_in.inbox and sub_in.inbox[0][0] <= now:
                answers -= 1
                if answers == 0:
                    run.demand = now + wait
            acts = run.step("in", sub_in, main_in, now, now > run.demand)
        elif who is logic:
            # What was decided in the cycles before goes out; with one connection on it, too.
            seen = run.step("in", main_in, sub_in, now, decided <= now)
            if seen in (True, SAFE):
                decided = min(decided, now + who.period)
            if back is not there:
                run.step("out", main_out, sub_out, now, decided <= now)
        else:
            acts = run.step("out", sub_out, main_out, now, False)
        if who is device_out and acts in (True, SAFE):
            return now + who.period - run.demand


def _policy(rng: random.Random) -> Policy:
    """Return what happens to frames: some late up to the watchdog, then lost or as ever."""
    left = rng.randrange(7)
    lost = rng.random() < 0.7
    loose = rng.random() < 0.2

    def deliver(normal: int, to: End) -> int:
        nonlocal left
        left -= 1
        latest = max(normal, to.task.last_start_before(to.started + to.watchdog))
        if left >= 0:
            return rng.randint(normal, latest) if loose else latest
        return NEVER if lost else normal

    return deliver
