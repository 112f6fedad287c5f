"""The adversary: random schedules, corners, and hill climbing from the worst one so far."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

from signal_path.path import (
    Genes,
    Parts,
    Setup,
    as_printed_beckhoff,
    as_printed_error_free,
    as_printed_input,
    as_printed_output,
    response,
    round_trips,
)

from fsoe_net.timing import formulas, handshake
from fsoe_net.timing.formulas import SignalWay

GENES = 64

# The worked table of docs/explanation/timing.md.
PARTS = Parts(sensor=5, input=4, logic=2, output=3, actuator=20, cycle=1)
WORKED = Setup(parts=PARTS, watchdog_in=100, watchdog_out=100, drift=0.01)


@dataclass(frozen=True, slots=True)
class Attack:
    """A bound, and how a schedule is tried against it."""

    name: str
    bound: Callable[[Setup], float]
    trial: Callable[[Setup, Genes], float]


@dataclass(frozen=True, slots=True)
class Found:
    """The worst schedule of a search: its response, the bound, both in ms."""

    name: str
    worst: float
    bound: float
    genes: tuple[float, ...]

    @property
    def share(self) -> float:
        """How much of the bound was reached."""
        return self.worst / self.bound


def _there(s: Setup) -> SignalWay:
    return s.times.inputs[0]


def _back(s: Setup) -> SignalWay:
    return s.times.outputs[0]


# Formulas as printed, schedules restricted to what they leave out.
PRINTED = (
    Attack("error_free", lambda s: formulas.error_free(s.times), as_printed_error_free),
    Attack(
        "worst_case_input",
        lambda s: formulas.worst_case_input(s.times, _there(s).watchdog),
        as_printed_input,
    ),
    Attack(
        "worst_case_output",
        lambda s: formulas.worst_case_output(s.times, _back(s).watchdog),
        as_printed_output,
    ),
    Attack(
        "beckhoff_worst_case",
        lambda s: formulas.beckhoff_worst_case(
            _there(s).watchdog, _back(s).watchdog, s.times.actuator
        ),
        as_printed_beckhoff,
    ),
)

# The handshake of FSoE, nothing restricted.
_FSOE = (
    Attack(
        "round_trip_input",
        lambda s: formulas.round_trip(_there(s)),
        lambda s, g: round_trips(s, g)[0],
    ),
    Attack(
        "round_trip_output",
        lambda s: formulas.round_trip(_back(s)),
        lambda s, g: round_trips(s, g)[1],
    ),
    Attack(
        "polled_error_free",
        lambda s: handshake.polled_error_free(s.times),
        lambda s, g: response(s, g, "none", "none"),
    ),
    Attack(
        "broken_input",
        lambda s: handshake.broken_input(s.times, _there(s)),
        lambda s, g: response(s, g, "breaks", "none"),
    ),
    Attack(
        "broken_output",
        lambda s: handshake.broken_output(s.times, _back(s)),
        lambda s, g: response(s, g, "none", "breaks"),
    ),
    Attack(
        "disturbed_input",
        lambda s: handshake.disturbed_input(s.times, _there(s)),
        lambda s, g: response(s, g, "any", "none"),
    ),
    Attack(
        "disturbed_output",
        lambda s: handshake.disturbed_output(s.times, _back(s)),
        lambda s, g: response(s, g, "none", "any"),
    ),
    Attack(
        "disturbed_both",
        lambda s: handshake.disturbed_both(s.times),
        lambda s, g: response(s, g, "any", "any"),
    ),
)

LOST = 20
_LOST = tuple(
    Attack(
        f"round_trip_{side}, {LOST} bus cycles lost",
        lambda s, way=way: formulas.round_trip(way(s)) + LOST * s.parts.cycle,
        lambda s, g, at=at: round_trips(s, g, LOST)[at],
    )
    for at, (side, way) in enumerate((("input", _there), ("output", _back)))
)
HANDSHAKE = (*_FSOE, *_LOST)

# Printed formulas against the handshake: these are exceeded (docs/explanation/timing.md).
EXCEEDED = (
    Attack("error_free", PRINTED[0].bound, _FSOE[2].trial),
    Attack("worst_case_input", PRINTED[1].bound, _FSOE[3].trial),
    Attack("worst_case_output", PRINTED[2].bound, _FSOE[4].trial),
    Attack("beckhoff_worst_case", PRINTED[3].bound, _FSOE[7].trial),
)


def attack(what: Attack, setup: Setup, schedules: int, seed: int) -> Found:
    """Return the worst of so many schedules; the same for the same seed."""
    rng = random.Random(f"{what.name} {seed}")
    draw, bound, trial = rng.random, what.bound(setup), what.trial
    best, worst = [1.0] * GENES, 0.0
    for number in range(schedules):
        style = number % 4
        if style == 0:
            genes = [draw() for _ in range(GENES)]
        elif style == 1:  # corners
            genes = [float(draw() < 0.5) for _ in range(GENES)]
        else:  # a few changes to the worst one
            genes = best.copy()
            for _ in range(1 + int(draw() * 4)):
                at, kind = int(draw() * GENES), draw()
                nudged = min(1.0, max(0.0, genes[at] + 0.1 * (draw() - 0.5)))
                genes[at] = nudged if kind < 0.3 else draw() if kind < 0.6 else round(draw())
        found = trial(setup, Genes(genes))
        if found >= worst:  # sideways too: plateaus are crossed
            best, worst = genes, found
    return Found(what.name, worst, bound, tuple(best))
