"""Watchdogs and response times of a safety function, by formulas printed by vendors.

Two methods exist and do not agree. Both are provided; the user decides which one counts.

- ETG.5100 chapter 9.3, as printed by Lenze (i750 reference manual, pages 159 and 160): every part
  may have just missed its event, so its time counts twice; one failure at a time.
- Beckhoff (manuals of EL2904, EL6900, EK1914, EP1957): the worst case is two watchdogs and the
  actuator; the typical case counts each part once and three bus cycles per direction.

Neither method includes the handshake of FSoE: `error_free`, `worst_case_input`, `worst_case_output`
and `beckhoff_worst_case` are valid under the assumptions in their docstrings. Possible schedules
within the times of the parts violate these assumptions. For bounds without them, see
`fsoe_net.timing.handshake`.

The sources print formulas for one input device and one output device. A function with several has
one `SignalWay` for each, with its own times. Its longest response uses the longest way in and the
longest way out.

All times are in milliseconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from fsoe_net.dataclass import dataclass

RESERVE = 1.2  # the 20 % that ETG.5100 adds to the round trip
_WATCHDOG_STEP_MS = 1.0  # FSoE watchdogs are whole milliseconds; the last one may have just begun


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalWay:
    """Times between the logic and one input or output device, ms.

    Attributes:
        device: T_I or T_O of the device.
        logic: T_L.
        connection: Name of the FSoE connection; empty if device and logic are one SubDevice, then
            all following values are 0.
        to_logic: Longest transfer of a frame to the logic, k times T_Com on one bus.
        from_logic: Same from the logic to the device.
        cycle: T_Com; if the way crosses buses, the longest bus cycle on it.
        watchdog: T_WD on the slowest clock; 0 if not stated. Used only for responses with a
            failure.
    """

    device: float
    logic: float
    connection: str = ""
    to_logic: float = 0.0
    from_logic: float = 0.0
    cycle: float = 0.0
    watchdog: float = 0.0

    def __post_init__(self) -> None:
        """Check the times.

        Raises:
            ValueError: A time is negative or not finite.
        """
        times = (self.device, self.logic, self.to_logic, self.from_logic, self.cycle, self.watchdog)
        _refuse(*times)

    def scaled(self, factor: float) -> SignalWay:
        """Return the way with all its bus cycles multiplied by a factor."""
        to_logic, from_logic = factor * self.to_logic, factor * self.from_logic
        return replace(self, to_logic=to_logic, from_logic=from_logic, cycle=factor * self.cycle)


@dataclass(frozen=True, slots=True, kw_only=True)
class PartTimes:
    """Times of the parts of a safety function, ms.

    Attributes:
        sensor: T_S, from the event to the input terminal.
        inputs: Ways from the input devices to the logic, at least one.
        outputs: Ways from the logic to the output devices, at least one.
        actuator: T_A, until the machine has reached the requested state.
    """

    sensor: float = 0.0
    inputs: tuple[SignalWay, ...]
    outputs: tuple[SignalWay, ...]
    actuator: float = 0.0

    def __post_init__(self) -> None:
        """Check the times.

        Raises:
            ValueError: A time is negative or not finite.
        """
        _refuse(self.sensor, self.actuator)

    @property
    def inputs_by_bus(self) -> tuple[SignalWay, ...]:
        """Input ways with a connection."""
        return tuple(w for w in self.inputs if w.connection)

    @property
    def outputs_by_bus(self) -> tuple[SignalWay, ...]:
        """Output ways with a connection."""
        return tuple(w for w in self.outputs if w.connection)

    def with_ways(self, change: Callable[[SignalWay], SignalWay]) -> PartTimes:
        """Return the times with every way changed."""
        inputs, outputs = tuple(map(change, self.inputs)), tuple(map(change, self.outputs))
        return replace(self, inputs=inputs, outputs=outputs)


def _refuse(*times: float) -> None:
    if any(not math.isfinite(t) or t < 0 for t in times):
        raise ValueError(f"times are finite and not negative: {times}")


def round_trip(way: SignalWay) -> float:
    """Return the longest time between two frames of a connection without faults."""
    return 2 * way.device + way.to_logic + way.from_logic + 2 * way.logic


def least_watchdog(way: SignalWay) -> float:
    """Return T_WD_In or T_WD_Out, the minimum watchdog of a connection (ETG.5100 9.3).

    A SubDevice with inputs and outputs uses the larger of both.
    """
    return round_trip(way) * RESERVE


def longest_in(t: PartTimes) -> float:
    """Return the longest way in: each part has just missed the value, then needs its time."""
    return max(2 * w.device + w.to_logic + 2 * w.logic for w in t.inputs)


def longest_out(t: PartTimes) -> float:
    """Return the longest way out, calculated like `longest_in`."""
    return max(2 * w.logic + w.from_logic + 2 * w.device for w in t.outputs)


def error_free(t: PartTimes) -> float:
    """Return T_SFR, the longest response without a failure (ETG.5100 9.3).

    Assumes that a part sends a value in its next cycle. FSoE is polled, however: see
    `polled_error_free`.
    """
    return 2 * t.sensor + longest_in(t) + longest_out(t) + 2 * t.actuator


def worst_case_input(t: PartTimes, watchdog: float) -> float:
    """Return the longest response if the connection to an input device fails (ETG.5100 9.3).

    Has the assumptions of `error_free`. It also assumes that nothing was accepted on that
    connection after the event, and that a watchdog acts when it expires, not in the next cycle of
    its task. For the response without these assumptions, see `broken_input`.

    Args:
        t: Times of the parts.
        watchdog: Watchdog of that connection, ms.
    """
    return 2 * t.sensor + watchdog + longest_out(t) + 2 * t.actuator


def worst_case_output(t: PartTimes, watchdog: float) -> float:
    """Return the longest response if the connection to an output device fails (ETG.5100 9.3).

    Has the assumptions of `worst_case_input`, here that the output device accepted nothing after
    the decision of the logic. For the response without them, see `broken_output`.

    Args:
        t: Times of the parts.
        watchdog: Watchdog of that connection, ms.
    """
    logic = max(w.logic for w in t.outputs)
    return 2 * t.sensor + longest_in(t) + 2 * logic + watchdog + 2 * t.actuator


def beckhoff_typical(t: PartTimes) -> float:
    """Return the typical response by Beckhoff: each part once, 3 cycles per direction.

    The factor of 3 is from Beckhoff and is valid for a copy in the same cycle or in the next.
    """
    there = max(w.device + 3 * w.cycle for w in t.inputs)
    back = max(3 * w.cycle + w.device for w in t.outputs)
    logic = max(w.logic for w in (*t.inputs, *t.outputs))
    return t.sensor + there + logic + back + t.actuator


def beckhoff_worst_case(watchdog_in: float, watchdog_out: float, actuator: float) -> float:
    """Return the longest response by Beckhoff: both connections fail, one after another.

    Has the assumptions of `worst_case_input` and `worst_case_output`. It also assumes that sensor
    and logic take no time and the actuator one T_A. For the response without them, see
    `disturbed_both`.

    Args:
        watchdog_in: Watchdog of the connection to the input device, ms.
        watchdog_out: Watchdog of the connection to the output device, ms.
        actuator: T_A, ms.
    """
    return watchdog_in + watchdog_out + actuator


def lost_frames_survived(watchdog: float, round_trip: float, cycle: float) -> int:
    """Return how many consecutive bus cycles may be lost before the watchdog expires.

    The watchdog counts whole milliseconds, so one millisecond is subtracted. If the quotient is an
    integer, floating point may return one less, but never one more: 86.6 / 0.1 is 865.

    Args:
        watchdog: Configured watchdog, ms.
        round_trip: Result of `round_trip`, ms.
        cycle: T_Com, ms; if the way crosses buses, the longest cycle on it.
    """
    return max(0, math.floor((watchdog - round_trip - _WATCHDOG_STEP_MS) / cycle))
