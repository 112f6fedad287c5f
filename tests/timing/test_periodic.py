"""The bounds against a simulation written apart from them: tasks are periodic, nobody plays tricks.

Derivation: docs/explanation/timing.md, which states the shares that are reached here.
"""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from timing.periodic import response

from fsoe_net.timing.formulas import (
    PartTimes,
    error_free,
    round_trip_input,
    round_trip_output,
    watchdog_input,
    worst_case_input,
    worst_case_output,
)
from fsoe_net.timing.handshake import (
    broken,
    disturbed_input,
    disturbed_output,
    disturbed_shared,
    polled_error_free,
)

PARTS = PartTimes(input=4, logic=2, output=3, cycle=1)
WATCHDOG = 100.0
# What is wrong with a run, the bound that must hold, and how much of it is reached at least.
CASES = [
    ("nothing", {}, lambda t, _: polled_error_free(t), 0.80),
    ("input late, then lost", {"faulty": "in"}, disturbed_input, 0.92),
    ("output late, then lost", {"faulty": "out"}, disturbed_output, 0.86),
    ("both ways late, then lost", {"faulty": "in", "shared": True}, disturbed_shared, 0.98),
]
NAMES = [row[0] for row in CASES]


def longest(times: PartTimes, watchdog: float, runs: int, **how: object) -> float:
    """Return the longest response of so many runs, ms; half of them with tasks of full length."""
    rng = random.Random(f"{times} {watchdog} {how}")
    cycles = {
        "input": round(times.input * 1000),
        "logic": round(times.logic * 1000),
        "output": round(times.output * 1000),
        "bus": round(times.cycle * 1000),
        "k": times.cycles_in,
    }
    dogs = (round(watchdog * 1000),) * 2
    found = (response(rng, cycles, dogs, whole=n % 2 == 0, **how) for n in range(runs))  # type: ignore[arg-type]
    return max(found) / 1000


@pytest.mark.shows("R9")
@pytest.mark.parametrize(("name", "how", "bound", "share"), CASES, ids=NAMES)
def test_no_run_exceeds_the_bound_and_some_come_near(
    name: str, how: dict[str, object], bound, share: float
) -> None:
    found, most = longest(PARTS, WATCHDOG, 600, **how), bound(PARTS, WATCHDOG)
    assert share * most <= found <= most, f"{name}: {found} ms of {most} ms"


@pytest.mark.parametrize(("cycle", "k"), [(0.25, 2), (4.0, 3)])
@pytest.mark.parametrize(("name", "how", "bound", "share"), CASES, ids=NAMES)
def test_no_other_cycle_exceeds_it(
    name: str, how: dict[str, object], bound, share: float, cycle: float, k: int
) -> None:
    times = replace(PARTS, cycle=cycle, cycles_in=k, cycles_out=k)
    watchdog = max(40.0, 1.2 * watchdog_input(times))
    found, most = longest(times, watchdog, 60, **how), bound(times, watchdog)
    assert 0.5 * most < found <= most, f"{name}: {found} ms of {most} ms"


@pytest.mark.parametrize(
    ("printed", "how"),
    [
        (error_free(PARTS), {}),
        (worst_case_input(PARTS, WATCHDOG), {"faulty": "in"}),
        (worst_case_output(PARTS, WATCHDOG), {"faulty": "out"}),
        (2 * WATCHDOG, {"faulty": "in", "shared": True}),
    ],
)
def test_periodic_tasks_exceed_what_is_printed(printed: float, how: dict[str, object]) -> None:
    """Nobody has to choose when a task runs; the documentation says so."""
    rng = random.Random(7)
    cycles = {"input": 4000, "logic": 2000, "output": 3000, "bus": 1000, "k": 2}
    found = max(
        response(rng, cycles, (100_000, 100_000), whole=True, **how)  # type: ignore[arg-type]
        for _ in range(200)
    )
    assert found / 1000 > 1.2 * printed


@pytest.mark.shows("R9")
def test_the_case_of_a_late_connection_covers_what_is_printed() -> None:
    """Nothing printed is longer while the watchdogs are no shorter than their round trips."""
    rng = random.Random(1)
    for _ in range(2000):
        value = [rng.choice([0.0, rng.random(), 50 * rng.random()]) for _ in range(7)]
        cycles = {"cycles_in": rng.randrange(4), "cycles_out": rng.randrange(4)}
        t = PartTimes(
            sensor=value[0],
            input=value[1],
            logic=value[2],
            output=value[3],
            actuator=value[4],
            cycle=0.1 + value[5],
            **cycles,
        )
        there = round_trip_input(t) + 100 * rng.random() if t.cycles_in else None
        back = round_trip_output(t) + 100 * rng.random() if t.cycles_out else None
        cases = [polled_error_free(t)]
        printed = [error_free(t), broken(t, there, back)]
        if there is not None:
            cases.append(disturbed_input(t, there))
            printed.append(worst_case_input(t, there))
        if back is not None:
            cases.append(disturbed_output(t, back))
            printed.append(worst_case_output(t, back))
        printed.append((there or 0.0) + (back or 0.0) + t.actuator)
        assert max(cases) >= max(printed) - 1e-9, t
