"""Bounds of networks of one bus and several against a simulation that was written apart from them.

Each case is a whole network: the bounds are what `make_budget` works out for it. Derivation, and
the shares that are reached here: docs/explanation/timing.md.
"""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest
from networks import PLAIN
from signal_path.path import Parts
from timing.event_simulation import Fault, Run, Setup, search
from weekly import first

from fsoe_net.formats.own.network import load_network
from fsoe_net.model.library import Library
from fsoe_net.model.resolve import resolve
from fsoe_net.timing.budget import Budget, make_budget
from fsoe_net.timing.formulas import PartTimes, round_trip
from fsoe_net.timing.handshake import broken_input, broken_output, polled_error_free
from fsoe_net.timing.reaction import Reaction, reaction_of

pytestmark = pytest.mark.uncounted

DEVICES = PLAIN / "el6910" / "devices"
RUNS = 240
# Cycle of each bus, the bus of input, logic and output, and their times in ms.
FAST = {
    "one bus, 0.25 ms": ((0.25,), (0, 0, 0), (4, 2, 3)),
    "one bus, 1 ms": ((1,), (0, 0, 0), (4, 2, 3)),
    "one bus, 4 ms": ((4,), (0, 0, 0), (4, 2, 3)),
    "input on another bus": ((1, 4), (1, 0, 0), (4, 2, 3)),
    "output on another bus": ((1, 2), (0, 0, 1), (4, 4, 8)),
    "both on another bus": ((1, 4), (1, 0, 1), (4, 2, 3)),
    "contactors with the logic": ((0.5, 5), (1, 0, 0), (4, 4, 3)),
    "two buses of one cycle": ((2, 2), (1, 0, 0), (4, 2, 3)),
    "logic on another bus": ((1, 2), (0, 1, 0), (4, 2, 3)),
    "between further buses": ((1, 2, 4), (1, 2, 2), (4, 2, 3)),
}
# A bus whose cycle is longer than twice the times of the devices: whole cycles pass, see the page.
SLOW = {
    "one bus, 10 ms": ((10,), (0, 0, 0), (4, 2, 3)),
    "input on a bus of 10 ms": ((1, 10), (1, 0, 0), (4, 2, 3)),
    "both on a bus of 10 ms": ((1, 10), (1, 0, 1), (4, 2, 3)),
}
CASES = FAST | SLOW


def setup_of(name: str, watchdog: int, *, shared: bool = False) -> Setup:
    """Return a case; watchdogs in ms, the output has 10 ms more."""
    cycles, where, times = CASES[name]
    dogs = (watchdog, watchdog if shared else watchdog + 10)
    if shared:
        times = (times[0], times[1], times[0])
    return Setup(cycles=cycles, where=where, times=times, watchdogs=dogs, shared=shared)


def budget_of(setup: Setup, folder: Path) -> Budget:
    """Return the budget of the network that a setup describes."""
    names = ["drive_1", "el6910", "drive_1"] if setup.shared else ["el1904", "el6910", "el2904"]
    on = dict(zip(names, setup.where, strict=True)) | {
        f"spare_{n}": n for n in range(len(setup.cycles))
    }
    devices = {n: "circulo" if n[:5] in ("drive", "spare") else n for n in on}
    lines = ["version: 1", "buses:"]
    for number, cycle in enumerate(setup.cycles):
        lines += [f"- name: b{number}", f"  cycle_us: {1000 * cycle:g}", "  subdevices:"]
        here = [n for n in on if on[n] == number]
        lines += [
            f"  - {{name: {n}, position: {at}, config: {DEVICES / devices[n]}.yaml}}"
            for at, n in enumerate(here)
        ]
    if len(setup.cycles) == 1:
        lines = [*lines[:1], f"cycle_us: {1000 * setup.cycles[0]:g}", "subdevices:", *lines[5:]]
    slots = {"el1904": 0, "el2904": 1, "drive_1": 2}
    lines += [
        "nets:",
        "- name: net",
        "  safety_master: el6910",
        "  transfers: []",
        "  connections:",
    ]
    lines += [
        f"  - {{main: el6910, slot: {slots[sub]}, sub: {sub}, watchdog_ms: {dog}}}"
        for sub, dog in dict(zip(names[::2], setup.watchdogs, strict=True)).items()
    ]
    lines += ["safety_functions:", "- name: f", "  elements:", "  - {kind: sensor, time_ms: 0}"]
    for kind, sub, ms in zip(("input", "logic", "output"), names, setup.times, strict=True):
        lines.append(f"  - {{kind: {kind}, sub: {sub}, time_ms: {ms}}}")
    lines.append("  - {kind: actuator, time_ms: 0}")
    path = folder / "network.yaml"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    loaded = load_network([path])
    assert loaded.network is not None, loaded.diagnostics
    return make_budget(resolve(loaded.network), Library(devices=()))


def reaction_in(budget: Budget) -> tuple[PartTimes, Reaction]:
    """Return times and response times of its only function."""
    (row,) = budget.functions
    assert row.times is not None
    assert row.reaction is not None, row.missing
    return row.times, row.reaction


def some_choices(rng: random.Random) -> list[float]:
    """Return the choices of a run."""
    return [rng.random() for _ in range(80)]


def least_share(name: str) -> float:
    """Return how much of a bound the simulation reaches at least."""
    return 0.8 if name in FAST else 0.65


@pytest.mark.shows("R9")
@pytest.mark.parametrize("name", first(3, CASES))
@pytest.mark.parametrize(
    ("fault", "faulty"),
    [(Fault.NONE, "in"), *((f, way) for f in (Fault.BREAKS, Fault.LATE) for way in ("in", "out"))],
)
def test_no_run_exceeds_the_bound_and_some_come_near(
    name: str, fault: Fault, faulty: str, tmp_path: Path
) -> None:
    setup = setup_of(name, watchdog=60)
    times, reaction = reaction_in(budget_of(setup, tmp_path))
    late = {case.way: case.ms for case in reaction.late}
    bound = {
        (Fault.NONE, "in"): reaction.polled,
        (Fault.BREAKS, "in"): broken_input(times, times.inputs[0]),
        (Fault.BREAKS, "out"): broken_output(times, times.outputs[0]),
        (Fault.LATE, "in"): late["input"],
        (Fault.LATE, "out"): late["output"],
    }[fault, faulty]
    near = least_share(name) * bound
    found = search(setup, RUNS, fault, faulty=faulty, enough=near)
    assert near <= found <= bound, f"{found} ms of {bound} ms"


@pytest.mark.shows("R9")
@pytest.mark.parametrize("name", [n for n in CASES if CASES[n][1][0] == CASES[n][1][2]])
@pytest.mark.parametrize("fault", [Fault.NONE, Fault.LATE])
def test_one_connection_both_ways_keeps_its_bound(name: str, fault: Fault, tmp_path: Path) -> None:
    setup = setup_of(name, watchdog=60, shared=True)
    _, reaction = reaction_in(budget_of(setup, tmp_path))
    late = {case.way: case.ms for case in reaction.late}
    bound = reaction.polled if fault is Fault.NONE else late["both ways"]
    near = least_share(name) * bound
    found = search(setup, RUNS, fault, enough=near)
    assert near <= found <= bound, f"{found} ms of {bound} ms"


@pytest.mark.shows("R9")
@pytest.mark.parametrize("name", first(4, CASES))
def test_a_healthy_connection_keeps_its_least_watchdog(name: str, tmp_path: Path) -> None:
    """Each connection by itself: the one next to the logic does not wait for a far bus."""
    setup = setup_of(name, watchdog=10_000)
    times, _ = reaction_in(budget_of(setup, tmp_path))
    trips = [round_trip(way) for way in (*times.inputs, *times.outputs)]
    rng, found = random.Random(name), [0.0, 0.0]
    for _ in range(100):
        ends = Run(setup, some_choices(rng)).healthy(400)
        found = [max(found[0], *ends[:2]), max(found[1], *ends[2:])]
    for longest, most in zip(found, trips, strict=True):
        assert (0.85 if name in FAST else 0.75) * most <= longest <= most
    # As long as the round trip, and no frame lost: it does not end.
    tight = replace(setup, watchdogs=(trips[0], trips[1]))
    for _ in range(30):
        assert max(Run(tight, some_choices(rng)).healthy(400)) < 1e6


@pytest.mark.parametrize("name", first(4, CASES))
def test_a_connection_survives_the_lost_cycles_that_are_printed(name: str, tmp_path: Path) -> None:
    setup = setup_of(name, watchdog=100)
    rows = budget_of(setup, tmp_path).connections
    counts = [row.lost_frames for row in rows]
    assert None not in counts
    rng, ended = random.Random(name), [0, 0]
    for bus in range(len(setup.cycles)):
        for more in (0, 8):
            for side, count in enumerate(counts):
                for _ in range(20):
                    run = Run(setup, some_choices(rng))
                    run.lose(bus, (count or 0) + more)
                    is_dead = max(run.healthy(400)[2 * side : 2 * side + 2]) > 1e6
                    assert more or not is_dead, f"bus {bus}: {count} cycles"
                    ended[side] += is_dead
    if min(setup.cycles) >= 1:
        assert min(ended) > 0, "eight more are too many somewhere"


# -- tasks with one period each --------------------------------------------------------------------

PERIODIC = replace(setup_of("one bus, 1 ms", watchdog=100), watchdogs=(100, 100))
BOTH_WAYS = setup_of("one bus, 1 ms", watchdog=100, shared=True)


@pytest.mark.parametrize(
    ("setup", "fault", "faulty", "bound", "printed"),
    [
        # Bounds and printed formulas by hand, without sensor and actuator: the page has them.
        (PERIODIC, Fault.NONE, "in", 50, 26),
        (PERIODIC, Fault.BREAKS, "in", 136, 112),
        (PERIODIC, Fault.BREAKS, "out", 139, 118),
        (PERIODIC, Fault.LATE, "in", 228, 112),
        (PERIODIC, Fault.LATE, "out", 232, 118),
        (BOTH_WAYS, Fault.LATE, "in", 308, 200),
    ],
)
def test_periodic_tasks_exceed_what_is_printed(
    setup: Setup, fault: Fault, faulty: str, bound: float, printed: float
) -> None:
    """The documentation says so: no adversary is needed."""
    found = search(setup, 600, fault, faulty=faulty, is_periodic=True)
    assert 0.8 * bound <= found <= bound
    assert found > printed


def test_a_little_more_device_time_may_cost_a_cycle_of_each_bus() -> None:
    """Why the bound of a slow bus is not taken from the cycles that pass: it would jump."""
    cycles, where = (1, 10), (1, 0, 1)
    short = search(Setup(cycles=cycles, where=where, times=(4.95, 3.4, 4.95)), RUNS)
    longer = search(Setup(cycles=cycles, where=where, times=(5.05, 3.55, 5.05)), RUNS)
    assert longer - short > 15


@pytest.mark.shows("R9")
def test_the_case_of_a_late_connection_covers_what_is_printed() -> None:
    """Nothing printed is longer while the watchdogs are no shorter than their round trips."""
    rng = random.Random(1)
    for _ in range(2000):
        value = [rng.choice([0.0, rng.random(), 50 * rng.random()]) for _ in range(5)]
        parts = Parts(
            sensor=value[0],
            input=value[1],
            logic=value[2],
            output=value[3],
            actuator=value[4],
            cycle=0.1 + rng.random(),
            cycles_in=rng.randrange(4),
            cycles_out=rng.randrange(4),
        )
        t = parts.times()
        trips = [round_trip(way) + 100 * rng.random() for way in (*t.inputs, *t.outputs)]
        reaction = reaction_of(parts.times(*trips))
        assert max(c.ms for c in reaction.late) >= max(reaction.printed, reaction.broken) - 1e-9
        assert reaction.polled == polled_error_free(t)
