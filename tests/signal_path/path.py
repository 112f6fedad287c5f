"""The signal path of a safety function in virtual time, every choice left to an adversary.

    event > sensor > input device > bus > logic > bus > output device > actuator
                     SubInstance    k    Main, Main   k  SubInstance

A part is a task: it reads at the start of a cycle, writes at its end, looks at its watchdog at the
start; its cycles last what the adversary likes, at most the time of the part. A connection is the
handshake of FSoE; frames move in bus cycles of one phase. Times are whole nanoseconds. What this
model says of a connection is checked against MainInstance and SubInstance (`machines`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from fsoe_net.timing.formulas import PartTimes, SignalWay

NEVER = 1 << 62
MS = 1_000_000
BUS_DRIFT = 1e-4  # the clock of the bus may be so much faster than those of the devices

Fault = Literal["none", "breaks", "any"]


class Genes:
    """Choices of the adversary, 0 … 1 each, taken one after the other and around."""

    def __init__(self, values: Sequence[float]) -> None:
        self._values, self._at = values, -1

    def take(self) -> float:
        """Return the next choice."""
        self._at = (self._at + 1) % len(self._values)
        return self._values[self._at]


@dataclass(slots=True)
class End:
    """One end of a connection: a task and its watchdog."""

    task: int
    watchdog: int
    restarted: int = 0  # when the watchdog was started
    frames: list[tuple[int, bool, bool]] = field(default_factory=list)  # delivered, new, Reset
    wait_frame: int = 0
    wait_expiry: int = 0
    dead: bool = False
    starts: list[int] = field(default_factory=list)  # of cycles in which something happens
    sent: list[tuple[int, int]] = field(default_factory=list)  # written, delivered

    @property
    def expiry(self) -> int:
        """When the watchdog ends."""
        return self.restarted + self.watchdog

    def next_start(self) -> int:
        """Return the start of the cycle in which this end does something next."""
        if self.dead:
            return NEVER
        arrival = self.frames[0][0] if self.frames else NEVER
        if arrival < self.expiry:
            return arrival + self.wait_frame
        return self.expiry + self.wait_expiry

    def read(self, now: int) -> tuple[int, bool, bool]:
        """Return the newest frame in the process data; what it replaced was never seen."""
        seen = [f for f in self.frames if f[0] <= now]
        del self.frames[: len(seen)]
        return seen[-1]


@dataclass(slots=True)
class Link:
    """A connection between logic and device, from one frame of the MainInstance on.

    Attributes:
        genes: Choices.
        main: The end in the logic; its cycle at 0 sends the first frame.
        sub: The end in the device.
        cycle: Of the bus, ns.
        k: Bus cycles of a frame at most.
        phase: Of the bus.
        fault: What may happen to frames.
    """

    genes: Genes
    main: End
    sub: End
    cycle: int
    k: int
    phase: int
    fault: Fault
    burst: tuple[int, int] = (NEVER, 0)  # first bus cycle that is lost, and how many in a row
    round_trips: tuple[int, int] = (0, 0)  # longest of main and of sub
    ready: int = 0  # when the new value is there

    def run(self, *, to_main: bool) -> int:
        """Return the time from a new value at one end until the other acts on it or on its loss.

        Args:
            to_main: The value goes from the SubInstance to the MainInstance, else back.
        """
        main, sub, take = self.main, self.sub, self.genes.take
        breaks = int(take() * 8) if self.fault == "breaks" else NEVER
        late = int(take() ** 4 * 2 * (main.task + sub.task + self.k * self.cycle))
        holder, reader = (sub, main) if to_main else (main, sub)
        sub.restarted = -1 - (self.k - 1) * self.cycle
        sub.starts.append(sub.restarted)
        main.starts.append(0)
        self._plan_expiry(main)
        self._plan_expiry(sub)
        known = not to_main
        self.ready = 1 + late
        frames = 1
        self._send(main, sub, 0, (False, False), arrives=breaks > 0)
        while True:
            end, other = (main, sub) if main.next_start() <= sub.next_start() else (sub, main)
            now = end.next_start()
            end.starts.append(now)
            if end is holder and not known:
                known, self.ready = True, now + 1 + late
            if now >= end.expiry:
                if end is reader:
                    return self._acted(end, now)
                end.dead = True
                self._send(end, other, now, (False, True), arrives=frames < breaks)
                frames += 1
                continue
            _, new, reset = end.read(now)
            if end is reader and (new or reset):
                return self._acted(end, now)
            if self.fault == "none":
                self._measure(end, now)
            end.restarted = now
            self._plan_expiry(end)
            carries = end is holder and now >= self.ready
            self._send(end, other, now, (carries, False), arrives=frames < breaks)
            frames += 1

    def _acted(self, end: End, now: int) -> int:
        return now + int(self.genes.take() * end.task) - self.ready

    def _measure(self, end: End, now: int) -> None:
        trip = now - end.restarted
        first, second = self.round_trips
        if end is self.main:
            self.round_trips = max(first, trip), second
        elif len(end.starts) > 2:  # the one before the model began is made up
            self.round_trips = first, max(second, trip)

    def _plan_expiry(self, end: End) -> None:
        end.wait_expiry = int(self.genes.take() * max(0, end.task - 1))

    def _send(self, end: End, to: End, now: int, what: tuple[bool, bool], *, arrives: bool) -> None:
        """Write a frame at the end of the cycle that began now; the bus takes it from there."""
        take = self.genes.take
        written = now + int(take() * end.task)
        to.wait_frame = int(take() * max(0, to.task - 1))
        tick = self.phase - (self.phase - written) // self.cycle * self.cycle
        delivered = self._carried(self._carried(tick) + (self.k - 1) * self.cycle)
        if not arrives:
            delivered = NEVER
        elif self.fault == "any":
            delivered = self._disturb(to, delivered)
        if end.sent:
            delivered = max(delivered, end.sent[-1][1])
        end.sent.append((written, delivered))
        to.frames.append((delivered, *what))

    def _carried(self, tick: int) -> int:
        """Return the bus cycle that really happens: this one, or the first after the burst."""
        first, lost = self.burst
        number = (tick - self.phase) // self.cycle
        return tick + (first + lost - number) * self.cycle if 0 <= number - first < lost else tick

    def _disturb(self, to: End, delivered: int) -> int:
        choice = self.genes.take()
        if choice < 0.4:
            return delivered
        if choice > 0.9:
            return NEVER if choice > 0.95 else delivered
        if choice > 0.65:  # as late as the watchdog allows
            to.wait_frame = 0
            return max(delivered, to.expiry - 1)
        return delivered + int((choice - 0.4) * 6 * to.watchdog)


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """Times of the parts of a safety function on one bus, ms; k bus cycles for each way."""

    sensor: float = 0.0
    input: float
    logic: float
    output: float
    actuator: float = 0.0
    cycle: float
    cycles_in: int = 2
    cycles_out: int = 2

    def times(self, watchdog_in: float = 0.0, watchdog_out: float = 0.0) -> PartTimes:
        """Return them as the formulas take them; no connection where k is 0."""
        there, back = (
            SignalWay(device=device, logic=self.logic)
            if not k
            else SignalWay(
                connection=name,
                device=device,
                logic=self.logic,
                to_logic=k * self.cycle,
                from_logic=k * self.cycle,
                cycle=self.cycle,
                watchdog=watchdog,
            )
            for name, device, k, watchdog in (
                ("in", self.input, self.cycles_in, watchdog_in),
                ("out", self.output, self.cycles_out, watchdog_out),
            )
        )
        return PartTimes(
            sensor=self.sensor, inputs=(there,), outputs=(back,), actuator=self.actuator
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """A safety function under attack; watchdogs as configured, ms; drift as a share."""

    parts: Parts
    watchdog_in: float
    watchdog_out: float
    drift: float = 0.0

    @property
    def times(self) -> PartTimes:
        """As the formulas take them, watchdogs on the slowest clock."""
        slow = 1 + self.drift
        return self.parts.times(self.watchdog_in * slow, self.watchdog_out * slow)


def links(setup: Setup, genes: Genes, fault_in: Fault, fault_out: Fault) -> tuple[Link, Link]:
    """Return both connections of a safety function."""
    t = setup.parts
    cycle = round(t.cycle * MS * (1 - BUS_DRIFT * genes.take()))
    made = []
    for task, watchdog, k, fault in (
        (t.input, setup.watchdog_in, t.cycles_in, fault_in),
        (t.output, setup.watchdog_out, t.cycles_out, fault_out),
    ):
        ends = [
            End(
                task=round(part * MS),
                watchdog=round(watchdog * MS * (1 + setup.drift * genes.take())),
            )
            for part in (t.logic, task)
        ]
        phase = int(genes.take() * cycle)
        made.append(Link(genes, ends[0], ends[1], cycle=cycle, k=k, phase=phase, fault=fault))
    return made[0], made[1]


def response(setup: Setup, genes: Genes, fault_in: Fault, fault_out: Fault) -> float:
    """Return the response of one schedule through both handshakes, ms."""
    there, back = links(setup, genes, fault_in, fault_out)
    t, take = setup.parts, genes.take
    through = there.run(to_main=True) + back.run(to_main=False)
    return through / MS + 2 * t.sensor * take() + 2 * t.actuator * take()


def round_trips(setup: Setup, genes: Genes, lost: int = 0) -> tuple[float, float]:
    """Return the longest times between two frames of both connections, ms.

    Args:
        setup: Times; the watchdogs must be long enough.
        genes: Choices.
        lost: Bus cycles that are lost in a row, once.
    """
    there, back = links(setup, genes, "none", "none")
    for link in (there, back):
        whole = 2 * (link.main.task + link.sub.task + link.k * link.cycle)
        link.burst = int(genes.take() * whole) // link.cycle, lost
    there.run(to_main=True)
    back.run(to_main=False)
    return max(there.round_trips) / MS, max(back.round_trips) / MS


# -- the printed formulas, under what they leave out ----------------------------------------------
# Each end sends in every cycle of its own without being asked; a connection that fails brought its
# last frame before the event; a watchdog acts when it ends, not in the next cycle of the task.


def _there(setup: Setup, genes: Genes) -> float:
    t, take = setup.parts, genes.take
    moved = (t.cycles_in - 1 + take()) * t.cycle
    return t.input * (take() + take()) + moved + t.logic * (take() + take())


def _back(setup: Setup, genes: Genes) -> float:
    t, take = setup.parts, genes.take
    moved = (t.cycles_out - 1 + take()) * t.cycle
    return t.logic * (take() + take()) + moved + t.output * (take() + take())


def _watchdog(ms: float, setup: Setup, genes: Genes) -> float:
    """Return the time until a watchdog ends that was started before."""
    before = setup.parts.cycle * genes.take()
    return ms * (1 + setup.drift * genes.take()) - before


def _ends(setup: Setup, genes: Genes) -> float:
    t, take = setup.parts, genes.take
    return t.sensor * (take() + take()) + t.actuator * (take() + take())


def as_printed_error_free(setup: Setup, genes: Genes) -> float:
    """Return one response without a fault, ms."""
    return _ends(setup, genes) + _there(setup, genes) + _back(setup, genes)


def as_printed_input(setup: Setup, genes: Genes) -> float:
    """Return one response with the connection to the input device already dead, ms."""
    dead = _watchdog(setup.watchdog_in, setup, genes)
    return _ends(setup, genes) + dead + _back(setup, genes)


def as_printed_output(setup: Setup, genes: Genes) -> float:
    """Return one response with the connection to the output device already dead, ms."""
    dead = _watchdog(setup.watchdog_out, setup, genes)
    decided = setup.parts.logic * (genes.take() + genes.take())
    return _ends(setup, genes) + _there(setup, genes) + decided + dead


def as_printed_beckhoff(setup: Setup, genes: Genes) -> float:
    """Return one response with both dead; sensor and logic take no time, the actuator one T_A."""
    one = _watchdog(setup.watchdog_in, setup, genes)
    two = _watchdog(setup.watchdog_out, setup, genes)
    return one + two + setup.times.actuator * genes.take()
