"""An event simulation of a safety function over one bus or several, in nanoseconds.

Written apart from the product and from `signal_path`, after the observed FSoE protocol and after
the order in which the core moves process images. Nothing here imports a formula.

    device I     answers each new frame of the logic with a sample of its input
    logic        a MainInstance for each connection, and a program that sees what they accept
    device O     acts on what it accepts; with one connection it is device I

Devices are tasks: they read at the start of a cycle and write at its end. A cycle of a bus gets
the inputs that its frame before has fetched, exchanges images with other buses, copies, and sends
a frame that writes outputs and fetches inputs. A task either has one period for the whole run, or
each of its cycles lasts what the choices of the run say. Sensor and actuator take no time.
"""

from __future__ import annotations

import enum
import itertools
import random
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

MS = 1_000_000
NEVER = 1 << 62
TOLERANCE = 1e-4  # by which the clock of a bus may be faster than those of the devices


class Fault(enum.Enum):
    """What happens to one connection, from the demand on or soon after it."""

    NONE = "none"
    BREAKS = "breaks"  # no frame arrives any more
    LATE = "late"  # some frames arrive just before the watchdog ends, then none, or all


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """A safety function on its buses; times in ms.

    Attributes:
        cycles: Of each bus, the first leads.
        where: Numbers of the buses of input device, logic and output device.
        times: Longest cycles of input device, logic and output device.
        watchdogs: Of the connections to the input device and to the output device.
        shared: One device and one connection for both ways.
    """

    cycles: tuple[float, ...]
    where: tuple[int, int, int] = (0, 0, 0)
    times: tuple[float, float, float]
    watchdogs: tuple[float, float] = (1e6, 1e6)
    shared: bool = False


class Frame(NamedTuple):
    """A frame of one end; a number of its own stands for sequence number and CRC."""

    number: int
    demand: bool  # the safe data ask for the safe state
    reset: bool


NOTHING = Frame(0, demand=False, reset=False)


@dataclass(slots=True)
class Register:
    """Process data of one end in its SubDevice: written by one side, taken by the other."""

    bus: int
    arrivals: deque[tuple[int, Frame, bool]] = field(default_factory=deque)
    shown: Frame = NOTHING
    writing: deque[tuple[int, Frame]] = field(default_factory=deque)
    written: Frame = NOTHING

    def read(self, now: int, *, is_last_chance: bool) -> Frame:
        """Return the newest frame that has arrived; a held one not before the last chance."""
        while self.arrivals and self.arrivals[0][0] <= now:
            if self.arrivals[0][2] and not is_last_chance:
                break
            self.shown = self.arrivals.popleft()[1]
        return self.shown

    def fetch(self, now: int) -> Frame:
        """Return what the device has written whole."""
        while self.writing and self.writing[0][0] <= now:
            self.written = self.writing.popleft()[1]
        return self.written


@dataclass(slots=True)
class End:
    """A MainInstance or SubInstance in Data: answers each new frame, restarts its watchdog then."""

    register: Register
    watchdog: int
    started: int = NEVER  # not yet
    dead: bool = False
    seen: int = 0
    sent: int = 0
    longest: int = 0  # time between two restarts

    def send(self, at: int, *, demand: bool, reset: bool = False) -> None:
        self.sent += 1
        self.register.writing.append((at, Frame(self.sent, demand, reset)))

    def step(self, now: int, ends: int, *, demand: bool) -> bool | None:
        """Run one cycle; return whether it accepts a demand, ``None`` when it accepts nothing."""
        if self.dead:
            return None
        if now - self.started >= self.watchdog:
            self.dead = True
            self.send(ends, demand=True, reset=True)
            return True
        is_last = ends - self.started >= self.watchdog
        frame = self.register.read(now, is_last_chance=is_last)
        if frame.number == self.seen:
            return None
        self.seen = frame.number
        if frame.reset:
            self.dead = True
            return True
        if self.started < NEVER:
            self.longest = max(self.longest, now - self.started)
        self.started = now
        self.send(ends, demand=demand)
        return frame.demand


class MainDevice:
    """Process images of all buses; registers 2n and 2n + 1 are the ends of a connection."""

    def __init__(self, registers: Sequence[Register]) -> None:
        self.registers = registers
        self.fails = NEVER  # from then on
        self.faulty: set[int] = set()  # registers of the connection that is late or breaks
        self.late, self.is_lost_then = 0, True
        self.burst = (0, NEVER, NEVER)  # bus, first and last time
        count = len(registers)
        self._fetched = [NOTHING] * count  # by the frame that is on its way
        self._inputs = [NOTHING] * count
        self._lead = [NOTHING] * count  # image of the first bus: inputs of all
        self._up = [NOTHING] * count
        self._down = [NOTHING] * count
        self._delivered = [0] * count
        buses = range(1 + max(r.bus for r in registers))
        self._on = [[n for n, r in enumerate(registers) if r.bus == bus] for bus in buses]
        self._off_lead = [n for n, r in enumerate(registers) if r.bus]
        self._peers = [n ^ 1 for n in range(count)]

    def cycle(self, bus: int, now: int) -> list[int]:
        """Receive, exchange, copy and send on one bus; return registers with a new frame."""
        if bus >= len(self._on):
            return []
        own = self._on[bus]
        outputs = self._further(own) if bus else self._leading(own)
        of, first, last = self.burst
        if of == bus and first <= now <= last:
            return []  # this frame gets lost; the process data stay as they were
        for n in own:
            self._fetched[n] = self.registers[n].fetch(now)
        fresh = [n for n in own if outputs[n].number != self._delivered[n]]
        return [n for n in fresh if self._deliver(n, outputs[n], now)]

    def _leading(self, own: Sequence[int]) -> Sequence[Frame]:
        """The first bus takes the newest inputs of the others, copies, and gives outputs."""
        for n in own:
            self._lead[n] = self._fetched[n]
        for n in self._off_lead:
            self._lead[n] = self._up[n]
        outputs = [self._lead[n] for n in self._peers]
        self._down = outputs
        return outputs

    def _further(self, own: Sequence[int]) -> Sequence[Frame]:
        """Another bus gives its inputs, takes the newest outputs, and copies inside itself."""
        outputs = list(self._down)
        for n in own:
            self._up[n] = self._inputs[n] = self._fetched[n]
        for n in own:
            if self.registers[n ^ 1].bus == self.registers[n].bus:
                outputs[n] = self._inputs[n ^ 1]
        return outputs

    def _deliver(self, n: int, frame: Frame, now: int) -> bool:
        self._delivered[n] = frame.number
        is_held = False
        if n in self.faulty and now > self.fails:
            is_held = self.late > 0
            if not is_held and self.is_lost_then:
                return False
            self.late -= 1
        self.registers[n].arrivals.append((now, frame, is_held))
        return True


@dataclass(slots=True)
class Task:
    """What serves one end: cycles one after the other, each at most as long as the longest."""

    end: End
    longest: int
    starts: int  # of the next cycle
    writes: bool = False  # the cycle that runs writes a frame at its end


class Run:
    """One run; every choice in it is one of `choices`, from 0 to 1, taken in turn and around."""

    def __init__(
        self,
        setup: Setup,
        choices: Sequence[float],
        fault: Fault = Fault.NONE,
        *,
        faulty: str = "in",
        is_periodic: bool = False,
    ) -> None:
        self._take, self._is_periodic = itertools.cycle(choices).__next__, is_periodic
        take = self._take
        on_input, on_logic, on_output = setup.where
        places = [on_logic, on_input] if setup.shared else [on_logic, on_input, on_logic, on_output]
        parts = [1, 0, 1, 2]
        self.ends = [
            End(Register(b), round(setup.watchdogs[n // 2] * MS)) for n, b in enumerate(places)
        ]
        self.is_shared = setup.shared
        self.main_device = MainDevice([end.register for end in self.ends])
        self._periods = [round(c * MS * (1 - TOLERANCE * take())) for c in setup.cycles]
        self._ticks = [int(take() * period) for period in self._periods]
        longest = [round(setup.times[part] * MS) for part in parts]
        self._tasks = [
            Task(end, most, int(take() * most))
            for end, most in zip(self.ends, longest, strict=False)
        ]
        self._answers = 2 + int(take() * 4)
        # The demand comes just after a sample that is sent, or at any time.
        self._wait = 0 if take() < 0.8 else int(take() * 4 * longest[1])
        self._fails_after = int(take() * 3 * sum(longest) + take() * 6 * max(self._periods))
        self._demand = self._decided = NEVER
        for main in self.ends[::2]:
            main.started = int(take() * 60 * MS)
            main.send(main.started + longest[0], demand=False)
        if fault is not Fault.NONE:
            self.main_device.faulty = {0, 1} if faulty == "in" else {2, 3}
        if fault is Fault.LATE:
            self.main_device.late = int(take() * 7)
            self.main_device.is_lost_then = take() < 0.7

    def lose(self, bus: int, cycles: int) -> None:
        """Lose the frames of so many cycles of a bus in a row."""
        period = self._periods[bus]
        first = self._ticks[bus] + int(self._take() * 60) * period
        self.main_device.burst = (bus, first, first + (cycles - 1) * period)

    def response(self) -> float:
        """Return the time from the demand until the output acts, ms."""
        while True:
            acted = self._next()
            if acted is not None:
                return (acted - self._demand) / MS

    def healthy(self, length_ms: float) -> list[float]:
        """Run without a demand; return the longest times between two frames of each end, ms."""
        self._answers = NEVER
        while min(self._ticks) < length_ms * MS:
            self._next()
        return [NEVER if end.dead else end.longest / MS for end in self.ends]

    def _next(self) -> int | None:
        """Run what is due next; return when the output acts on the demand, if it does."""
        now = min(self._ticks)
        bus = self._ticks.index(now)
        starts = [task.starts for task in self._tasks]
        number = starts.index(min(starts))
        task = self._tasks[number]
        if now <= task.starts:
            self._ticks[bus] += self._periods[bus]
            for n in self.main_device.cycle(bus, now):
                self._delay(self._tasks[n], now)
            return None
        now, ends = task.starts, task.starts + self._lasts(task)
        task.starts = ends
        sent = task.end.sent
        accepted = task.end.step(now, ends, demand=self._safe_data(number, now))
        task.writes = task.end.sent > sent
        if number == 0 and accepted:
            self._decided = min(self._decided, ends)
        if number == 1 and task.writes and all(end.seen for end in self.ends):
            self._answers -= 1
            if self._answers == 0:
                self._demand = now + self._wait
                self.main_device.fails = self._demand + self._fails_after
        return ends if accepted and number == len(self.ends) - 1 else None

    def _safe_data(self, number: int, now: int) -> bool:
        """Return what an end sends: a sample, or what the program has decided before."""
        if number == 1:
            return now > self._demand
        return number in (2, 0 if self.is_shared else 2) and self._decided <= now

    def _lasts(self, task: Task) -> int:
        """Return how long a cycle lasts; one that ends with the watchdog is cut just before."""
        if self._is_periodic:
            return task.longest
        left = task.end.started + task.end.watchdog - 1 - task.starts
        return left if 0 < left < task.longest and not task.end.dead else task.longest

    def _delay(self, task: Task, now: int) -> None:
        """A frame arrives: a device that had nothing to do may have begun a cycle just before."""
        end = task.end
        is_idle = len(end.register.arrivals) == 1 and now - end.started <= end.watchdog
        if is_idle and not task.writes and not self._is_periodic:
            share = min(1.0, 1.5 * self._take())
            task.starts = now + max(1, int(share * task.longest) - 1)


def search(
    setup: Setup,
    runs: int,
    fault: Fault = Fault.NONE,
    *,
    faulty: str = "in",
    is_periodic: bool = False,
    enough: float = 0.0,
) -> float:
    """Return the longest response of so many runs, ms.

    A third of the runs are chosen at random; the others change a few choices of the longest so far.

    Args:
        setup: The safety function.
        runs: How many.
        fault: What happens.
        faulty: ``in`` or ``out``: the connection that it happens to.
        is_periodic: Every task has one period, its longest cycle.
        enough: ms; up to three times as many runs come before the longest is as long.
    """
    rng = random.Random(f"{setup} {fault} {faulty} {is_periodic} 1")
    best, longest = [rng.random() for _ in range(80)], 0.0
    for number in range(3 * runs):
        if number >= runs and longest >= enough:
            break
        choices = [rng.random() for _ in best]
        if number % 3:
            choices = best.copy()
            for _ in range(1 + int(rng.random() * 4)):
                at = rng.randrange(14 if rng.random() < 0.5 else len(best))
                near = (choices[at] + (rng.random() - 0.5) * rng.choice((0.1, 0.005))) % 1
                choices[at] = near if rng.random() < 0.6 else rng.random()
        run = Run(setup, choices, fault, faulty=faulty, is_periodic=is_periodic)
        found = run.response()
        if found >= longest:
            best, longest = choices, found
    return longest
