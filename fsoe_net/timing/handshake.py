"""Response times that count the handshake of FSoE and what each watchdog really allows.

FSoE is half duplex: an end sends its safe data only in answer to a frame of the other end, and it
starts its watchdog anew with each frame it answers. The printed formulas
(`fsoe_net.timing.formulas`) leave out two consequences, and schedules within the times of the
parts exceed them:

- A value that has just missed its turn waits a whole round trip until the connection asks again.
- A connection that breaks while it carries the old value starts its watchdog once more. One that is
  late up to its watchdog and is lost then does so twice: this is one fault, and it is judged.

Derivation, worked example and the search that tries these bounds: docs/explanation/timing.md.
Every part is a task that reads at the start of a cycle, writes at its end and looks at its watchdog
at the start, as `fsoe_net.fsoe` does; a cycle lasts at most the time of the part. All times in ms.
"""

from __future__ import annotations

from fsoe_net.timing.formulas import PartTimes, round_trip_input, round_trip_output

__all__ = [
    "besides_input",
    "besides_output",
    "besides_shared",
    "broken",
    "broken_input",
    "broken_output",
    "disturbed_both",
    "disturbed_input",
    "disturbed_output",
    "disturbed_shared",
    "polled_error_free",
]


def polled_error_free(t: PartTimes) -> float:
    """Return the longest response while nothing fails, waits for the turn counted."""
    return _around(t, _polled_in(t), _polled_out(t))


def besides_input(t: PartTimes) -> float:
    """Return what `disturbed_input` counts besides two watchdogs."""
    return _around(t, 2 * t.logic, _polled_out(t))


def besides_output(t: PartTimes) -> float:
    """Return what `disturbed_output` counts besides two watchdogs."""
    return _around(t, _polled_in(t), 2 * t.output)


def besides_shared(t: PartTimes) -> float:
    """Return what `disturbed_shared` counts besides three watchdogs."""
    return _around(t, 0.0, 2 * max(t.input, t.output))


def broken_input(t: PartTimes, watchdog: float) -> float:
    """Return the longest response when the connection to the input device breaks for good.

    Args:
        t: Times of the parts.
        watchdog: Watchdog of that connection on the slowest clock, ms.
    """
    there = watchdog + t.input + t.transfer_in + 3 * t.logic
    return max(polled_error_free(t), _around(t, there, _polled_out(t)))


def broken_output(t: PartTimes, watchdog: float) -> float:
    """Return the longest response when the connection to the output device breaks for good.

    Args:
        t: Times of the parts.
        watchdog: Watchdog of that connection on the slowest clock, ms.
    """
    back = watchdog + t.logic + t.transfer_out + 3 * t.output
    return max(polled_error_free(t), _around(t, _polled_in(t), back))


def broken(t: PartTimes, watchdog_in: float | None, watchdog_out: float | None) -> float:
    """Return the longest response with at most one connection broken for good.

    Args:
        t: Times of the parts.
        watchdog_in: Watchdog of the connection to the input device on the slowest clock, ms;
            ``None``: input and logic are one SubDevice.
        watchdog_out: The same of the output device.
    """
    found = [polled_error_free(t)]
    if watchdog_in is not None:
        found.append(broken_input(t, watchdog_in))
    if watchdog_out is not None:
        found.append(broken_output(t, watchdog_out))
    return max(found)


def disturbed_input(t: PartTimes, watchdog: float) -> float:
    """Return the longest response when the input device's connection is late and lost at will.

    The worst is late up to its watchdog with the old value, and lost from then on.

    Args:
        t: Times of the parts.
        watchdog: Watchdog of that connection on the slowest clock, ms.
    """
    return _around(t, _disturbed_in(t, watchdog), _polled_out(t))


def disturbed_output(t: PartTimes, watchdog: float) -> float:
    """Return the longest response when the output device's connection is late and lost at will.

    Args:
        t: Times of the parts.
        watchdog: Watchdog of that connection on the slowest clock, ms.
    """
    return _around(t, _polled_in(t), _disturbed_out(t, watchdog))


def disturbed_shared(t: PartTimes, watchdog: float) -> float:
    """Return the longest response when one connection carries both ways, late and lost at will.

    The device samples the old value; each of its next three frames waits for an answer, at most its
    watchdog: the new value goes out with the first, the logic may have just missed its own turn
    with the second, the third answer has the decision or does not come.

    Args:
        t: Times of the parts.
        watchdog: Watchdog of that connection on the slowest clock, ms.
    """
    return max(polled_error_free(t), 3 * watchdog + besides_shared(t))


def disturbed_both(t: PartTimes, watchdog_in: float, watchdog_out: float) -> float:
    """Return the longest response whatever the bus does to both connections.

    Args:
        t: Times of the parts.
        watchdog_in: Watchdog of the connection to the input device on the slowest clock, ms.
        watchdog_out: The same of the connection to the output device, ms.
    """
    return _around(t, _disturbed_in(t, watchdog_in), _disturbed_out(t, watchdog_out))


def _around(t: PartTimes, there: float, back: float) -> float:
    """Return the response: sensor, input to logic, logic to output, actuator."""
    return 2 * t.sensor + there + back + 2 * t.actuator


def _polled_in(t: PartTimes) -> float:
    if not t.cycles_in:
        return 2 * t.input + 2 * t.logic  # one SubDevice: no connection, no turn
    return round_trip_input(t) + t.input + t.transfer_in + 2 * t.logic


def _polled_out(t: PartTimes) -> float:
    if not t.cycles_out:
        return 2 * t.logic + 2 * t.output
    return round_trip_output(t) + t.logic + t.transfer_out + 2 * t.output


def _disturbed_in(t: PartTimes, watchdog: float) -> float:
    if not t.cycles_in:
        return _polled_in(t)
    return max(_polled_in(t), 2 * watchdog + 2 * t.logic)


def _disturbed_out(t: PartTimes, watchdog: float) -> float:
    if not t.cycles_out:
        return _polled_out(t)
    return max(_polled_out(t), 2 * watchdog + 2 * t.output)
