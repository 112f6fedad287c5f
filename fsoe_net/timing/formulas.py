"""Watchdogs and response times of a safety function, by the formulas that vendors print.

Two methods exist and do not agree. Both are given; whoever uses them says which one counts.

- ETG.5100 chapter 9.3, as printed by Lenze (i750 reference manual, pages 159 and 160): every part
  may have just missed its event, so its time counts twice; one failure at a time.
- Beckhoff (manuals of EL2904, EL6900, EK1914, EP1957): the worst case is two watchdogs and the
  actuator; the typical case counts each part once and three bus cycles per direction.

Neither method counts the handshake of FSoE: `error_free`, `worst_case_input`, `worst_case_output`
and `beckhoff_worst_case` hold under assumptions that their docstrings name and that schedules
within the times of the parts break. What holds without them: `fsoe_net.timing.handshake`.

All times are in milliseconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = [
    "RESERVE",
    "PartTimes",
    "beckhoff_typical",
    "beckhoff_worst_case",
    "error_free",
    "lost_frames_survived",
    "round_trip_input",
    "round_trip_output",
    "watchdog_input",
    "watchdog_output",
    "worst_case_input",
    "worst_case_output",
]

RESERVE = 1.2  # the 20 % that ETG.5100 adds to the round trip
_WATCHDOG_STEP_MS = 1.0  # FSoE watchdogs are whole milliseconds; the last one may just have begun


@dataclass(frozen=True, slots=True, kw_only=True)
class PartTimes:
    """Processing times of the parts of a safety function, in ms, and the bus between them.

    Attributes:
        sensor: T_S, from the event to the input terminal.
        input: T_I, of the SubDevice that reads the sensor.
        logic: T_L, of the safety logic.
        output: T_O, of the SubDevice that drives the actuator.
        actuator: T_A, until the machine is in the requested state.
        cycle: T_Com, the EtherCAT cycle.
        cycles_in: Bus cycles a frame needs from the input to the logic, the k of the sources: 2
            when it is copied in the cycle in which it arrived, 3 when one cycle later; 0 when both
            are one SubDevice.
        cycles_out: The same from the logic to the output.
    """

    sensor: float = 0.0
    input: float
    logic: float
    output: float
    actuator: float = 0.0
    cycle: float
    cycles_in: int = 2
    cycles_out: int = 2

    def __post_init__(self) -> None:
        """Refuse what is no time.

        Raises:
            ValueError: A time or count is negative or not finite, or the cycle is 0.
        """
        times = (self.sensor, self.input, self.logic, self.output, self.actuator, self.cycle)
        if any(not math.isfinite(t) or t < 0 for t in times) or self.cycle == 0:
            raise ValueError(f"times are finite and not negative, the cycle is not 0: {times}")
        if self.cycles_in < 0 or self.cycles_out < 0:
            raise ValueError(f"bus cycles are not negative: {self.cycles_in}, {self.cycles_out}")

    @property
    def transfer_in(self) -> float:
        """Time of a frame between input and logic, k times T_Com, ms."""
        return self.cycles_in * self.cycle

    @property
    def transfer_out(self) -> float:
        """Time of a frame between logic and output, k times T_Com, ms."""
        return self.cycles_out * self.cycle


def round_trip_input(t: PartTimes) -> float:
    """Return the longest time between two frames of a healthy connection to an input device."""
    return 2 * t.input + 2 * t.transfer_in + 2 * t.logic


def round_trip_output(t: PartTimes) -> float:
    """Return the longest time between two frames of a healthy connection to an output device."""
    return 2 * t.transfer_out + 2 * t.logic + 2 * t.output


def watchdog_input(t: PartTimes) -> float:
    """Return T_WD_In, the least watchdog of a connection to an input device (ETG.5100 9.3).

    A SubDevice with inputs and outputs takes the larger of this and `watchdog_output`.
    """
    return round_trip_input(t) * RESERVE


def watchdog_output(t: PartTimes) -> float:
    """Return T_WD_Out, the least watchdog of a connection to an output device (ETG.5100 9.3)."""
    return round_trip_output(t) * RESERVE


def error_free(t: PartTimes) -> float:
    """Return T_SFR, the longest response while nothing fails (ETG.5100 9.3).

    Assumes that a value is sent in the next cycle of the part that has it. FSoE is
    polled: `polled_error_free`.
    """
    return (
        2 * t.sensor
        + 2 * t.input
        + t.transfer_in
        + 2 * t.logic
        + 2 * t.logic
        + t.transfer_out
        + 2 * t.output
        + 2 * t.actuator
    )


def worst_case_input(t: PartTimes, watchdog: float) -> float:
    """Return the longest response when the connection to the input device fails (ETG.5100 9.3).

    Assumes as `error_free`, and that nothing was accepted on that connection after the event, and
    that a watchdog acts when it ends, not in the next cycle of its task: `broken_input`.

    Args:
        t: Times of the parts.
        watchdog: Watchdog of that connection, ms.
    """
    return 2 * t.sensor + watchdog + 2 * t.logic + t.transfer_out + 2 * t.output + 2 * t.actuator


def worst_case_output(t: PartTimes, watchdog: float) -> float:
    """Return the longest response when the connection to the output device fails (ETG.5100 9.3).

    Assumes as `worst_case_input`, here that the output device accepted nothing after the logic had
    decided: `broken_output`.

    Args:
        t: Times of the parts.
        watchdog: Watchdog of that connection, ms.
    """
    return (
        2 * t.sensor
        + 2 * t.input
        + t.transfer_in
        + 2 * t.logic
        + 2 * t.logic
        + watchdog
        + 2 * t.actuator
    )


def beckhoff_typical(t: PartTimes) -> float:
    """Return the typical response as Beckhoff prints it: each part once, 3 cycles per direction.

    The factor of 3 is Beckhoff's and holds for a copy in the same cycle or in the next.
    """
    there = 3 * t.cycle if t.cycles_in else 0.0
    back = 3 * t.cycle if t.cycles_out else 0.0
    return t.sensor + t.input + there + t.logic + back + t.output + t.actuator


def beckhoff_worst_case(watchdog_in: float, watchdog_out: float, actuator: float) -> float:
    """Return the longest response as Beckhoff prints it: both connections fail, one after another.

    Assumes as `worst_case_input` and `worst_case_output`, and that sensor and logic take no time
    and the actuator one T_A: `disturbed_both`.

    Args:
        watchdog_in: Watchdog of the connection to the input device, ms.
        watchdog_out: Watchdog of the connection to the output device, ms.
        actuator: T_A, ms.
    """
    return watchdog_in + watchdog_out + actuator


def lost_frames_survived(watchdog: float, round_trip: float, cycle: float) -> int:
    """Return how many bus cycles in a row may be lost before the watchdog of a connection ends.

    The watchdog counts whole milliseconds, so one of them is not counted on. Where the quotient is
    a whole number, floating point may give one less, never one more than there is: 86.6 / 0.1 is
    865.

    Args:
        watchdog: Configured watchdog, ms.
        round_trip: `round_trip_input` or `round_trip_output`, ms.
        cycle: T_Com, ms.
    """
    return max(0, math.floor((watchdog - round_trip - _WATCHDOG_STEP_MS) / cycle))
