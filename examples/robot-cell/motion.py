"""Moves both axes of the robot cell in the cycle of fsn-master: motion.py SOCKET [RECORD.csv].

The start button enables the axes and starts the motion. When a drive stops by itself, as with STO
and SS1, or anything else stops an axis, the program stops both and waits for the start button:
nothing moves again by itself. Part of the black channel: no safety function.
"""

import contextlib
import csv
import math
import os
import signal
import sys
from collections.abc import Callable

import fsoe_net
from fsoe_net import ControlRefused

COUNTS_PER_REV = 65536
START = "el1008.start"
# Of each axis: revolutions to the far end of its motion, seconds there and back.
MOTION = {"axis_1": (8.0, 2.0), "axis_2": (4.0, 1.6)}
MAX_STEP = 1200  # counts in a cycle of 1 ms: 18 rev/s
MISSES = 100  # Python may be late; then the drives hold their last target


class Program:
    """What happens in each cycle.

    Args:
        realtime: The cycle; the outputs of both axes are ours.
        say: Takes what people may want to know.
    """

    def __init__(self, realtime, say: Callable[[str], None]) -> None:
        self._realtime, self._say = realtime, say
        self.axes = {name: realtime.axis(name, max_step=MAX_STEP) for name in MOTION}
        self._phase = "waiting"
        self._was_pressed = True
        self._passed_s = 0.0
        self._origins: dict[str, int] = {}

    def step(self) -> None:
        """Take one cycle; call it between wait and send."""
        pressed = bool(self._realtime[START])
        if pressed and not self._was_pressed and self._phase == "waiting":
            self._start()
        self._was_pressed = pressed
        enabled = [axis.enabled for axis in self.axes.values()]
        if self._phase == "enabling" and all(enabled):
            # The motion begins where each axis stands, at rest.
            self._origins = {name: axis.target_position for name, axis in self.axes.items()}
            self._passed_s = 0.0
            self._go("moving")
        elif (self._phase == "moving" and not all(enabled)) or (
            self._phase == "enabling" and self._is_stuck()
        ):
            self._stop()
        if self._phase == "moving":
            self._move()
        for axis in self.axes.values():
            axis.step()

    def _start(self) -> None:
        try:
            for axis in self.axes.values():
                axis.enable()
        except ControlRefused as fault:
            self._say(f"not started: {fault}")
            self._stop()
        else:
            self._go("enabling")

    def _is_stuck(self) -> bool:
        return any(axis.phase.name not in ("ENABLING", "ENABLED") for axis in self.axes.values())

    def _stop(self) -> None:
        """Stop the other axis by its ramp; without voltage it would coast."""
        for name, axis in self.axes.items():
            self._say(f"{name}: {axis.phase.name.lower().replace('_', ' ')}")
            if axis.phase.name in ("ENABLING", "ENABLED"):
                axis.quick_stop()
        self._go("waiting")

    def _move(self) -> None:
        """One cycle further, however late this program is: a target never leaps after a pause."""
        self._passed_s += self._realtime.cycle_ns / 1e9
        for name, (revolutions, period_s) in MOTION.items():
            way = (1 - math.cos(2 * math.pi * self._passed_s / period_s)) / 2
            target = self._origins[name] + round(way * revolutions * COUNTS_PER_REV)
            self.axes[name].set_position(target)

    def _go(self, phase: str) -> None:
        self._phase = phase
        self._say(phase)


def frames_that_differ(image: memoryview, copies) -> int:
    """Return how many FSoE frames among the outputs are not those that came in this cycle."""
    return sum(
        image[c.destination_byte : c.destination_byte + c.size_bytes]
        != image[c.source_byte : c.source_byte + c.size_bytes]
        for c in copies
    )


def be_real_time() -> None:
    """Take real-time priority below that of fsn-master (80), where it is permitted."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))


def main(path: str, record: str | None) -> None:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    be_real_time()
    with fsoe_net.connect(path) as client:
        copies = client.layout().copies
    rows: list[list[float]] = []
    try:
        with fsoe_net.connect(path) as client, client.realtime("axis_*", misses=MISSES) as cycle:
            program = Program(cycle, lambda text: print(text, flush=True))
            while True:
                now = cycle.wait()
                program.step()
                cycle.send()
                row = [now.now_ns / 1e9, frames_that_differ(cycle.image, copies), now.skipped]
                for axis in program.axes.values():
                    row += [axis.position, axis.velocity, axis.torque, axis.statusword]
                rows.append(row)
    finally:
        if record is not None:
            with open(record, "w", newline="", encoding="ascii") as file:
                csv.writer(file).writerows(rows)


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 3:
        sys.exit("usage: motion.py SOCKET [RECORD.csv]")
    try:
        main(sys.argv[1], sys.argv[2] if len(sys.argv) == 3 else None)
    except fsoe_net.FsnError as fault:
        sys.exit(str(fault))
    except KeyboardInterrupt:
        sys.exit(130)
