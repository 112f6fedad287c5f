"""Response times that include the handshake of FSoE and the actual limit of each watchdog.

FSoE is half duplex: an end sends its safe data only as an answer to a frame of the other end, and
it restarts its watchdog with each frame that it answers. The printed formulas
(`fsoe_net.timing.formulas`) omit two consequences, and possible schedules within the times of the
parts exceed them:

- A value that has just missed its turn waits a whole round trip until the connection polls again. -
A connection that breaks while it carries the old value restarts its watchdog once more. A
connection that is delayed by up to its watchdog and then lost restarts it twice. This is one fault,
and it is the case that is judged.

Derivation, worked example and the search that tests these bounds: docs/explanation/timing.md. Every
part is a task that reads at the start of a cycle, writes at its end and checks its watchdog at the
start, like `fsoe_net.fsoe`; a cycle lasts at most the time of the part. All times in ms.
"""

from __future__ import annotations

from fsoe_net.timing.formulas import PartTimes, SignalWay, longest_in, longest_out, round_trip


def polled_error_free(t: PartTimes) -> float:
    """Return the longest response without a failure, including waits for the turn."""
    return _around(t, _polled_in(t), _polled_out(t))


def besides_input(t: PartTimes, way: SignalWay) -> float:
    """Return the part of `disturbed_input` in addition to two watchdogs."""
    return _around(t, 2 * way.logic, _polled_out(t))


def besides_output(t: PartTimes, way: SignalWay) -> float:
    """Return the part of `disturbed_output` in addition to two watchdogs."""
    return _around(t, _polled_in(t), 2 * way.device)


def besides_shared(t: PartTimes, there: SignalWay, back: SignalWay) -> float:
    """Return the part of `disturbed_shared` in addition to three watchdogs."""
    return _around(t, 0.0, 2 * max(there.device, back.device))


def broken_input(t: PartTimes, way: SignalWay) -> float:
    """Return the longest response if the connection to an input device breaks permanently.

    Args:
        t: Times of the parts.
        way: Way of the connection.
    """
    there = way.watchdog + way.device + way.to_logic + 3 * way.logic
    return max(polled_error_free(t), _around(t, there, _polled_out(t)))


def broken_output(t: PartTimes, way: SignalWay) -> float:
    """Return the longest response if the connection to an output device breaks permanently.

    Args:
        t: Times of the parts.
        way: Way of the connection.
    """
    back = way.watchdog + way.logic + way.from_logic + 3 * way.device
    return max(polled_error_free(t), _around(t, _polled_in(t), back))


def disturbed_input(t: PartTimes, way: SignalWay) -> float:
    """Return the longest response if frames of an input connection are late and lost arbitrarily.

    In the worst case, it is late by up to its watchdog with the old value, and lost afterwards.

    Args:
        t: Times of the parts.
        way: Way of the connection.
    """
    return max(polled_error_free(t), 2 * way.watchdog + besides_input(t, way))


def disturbed_output(t: PartTimes, way: SignalWay) -> float:
    """Return the longest response if frames of an output connection are late and lost arbitrarily.

    Args:
        t: Times of the parts.
        way: Way of the connection.
    """
    return max(polled_error_free(t), 2 * way.watchdog + besides_output(t, way))


def disturbed_shared(t: PartTimes, there: SignalWay, back: SignalWay) -> float:
    """Return the longest response if one connection has both ways, late and lost arbitrarily.

    The device samples the old value. Each of its next three frames waits for an answer, at most for
    its watchdog. The first frame carries the new value. At the second, the logic may have just
    missed its own turn. The third answer carries the decision or does not arrive.

    Args:
        t: Times of the parts.
        there: SignalWay in of the connection.
        back: Its way out.
    """
    return max(polled_error_free(t), 3 * there.watchdog + besides_shared(t, there, back))


def disturbed_both(t: PartTimes) -> float:
    """Return the longest response for any disturbance of one connection in and one out."""
    there = [2 * w.watchdog + 2 * w.logic for w in t.inputs_by_bus]
    back = [2 * w.watchdog + 2 * w.device for w in t.outputs_by_bus]
    return _around(t, max([_polled_in(t), *there]), max([_polled_out(t), *back]))


def shared_ways(t: PartTimes) -> list[tuple[SignalWay, SignalWay]]:
    """Return way in and way out of each connection that has both."""
    back = {w.connection: w for w in t.outputs_by_bus}
    return [(w, back[w.connection]) for w in t.inputs_by_bus if w.connection in back]


def _around(t: PartTimes, there: float, back: float) -> float:
    """Return the response: sensor, input to logic, logic to output, actuator."""
    return 2 * t.sensor + there + back + 2 * t.actuator


def _polled_in(t: PartTimes) -> float:
    by_bus = [round_trip(w) + w.device + w.to_logic + 2 * w.logic for w in t.inputs_by_bus]
    return max([longest_in(t), *by_bus])


def _polled_out(t: PartTimes) -> float:
    by_bus = [round_trip(w) + w.logic + w.from_logic + 2 * w.device for w in t.outputs_by_bus]
    return max([longest_out(t), *by_bus])
