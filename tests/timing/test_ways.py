"""Networks with several ways: each connection has the times of its own device and buses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from changed import figures
from networks import PLAIN

from fsoe_net.document.write_terminal import document_text
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.library import Library
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.report.budget import budget_document, budget_json, budget_picture
from fsoe_net.rules.check import check
from fsoe_net.rules.timing import check_timing
from fsoe_net.timing.budget import Budget, make_budget
from fsoe_net.timing.judgement import Judgement
from fsoe_net.timing.reaction import reaction_of
from fsoe_net.timing.transit import transfer_time
from fsoe_net.timing.watchdogs import WatchdogBudget

# Logic and contactors on a bus of 1 ms, input terminal and drive on one of 2 ms.
NETWORK = """\
version: 1
buses:
  - name: cell
    cycle_us: 1000
    subdevices:
      - {name: el6910, position: 1, config: devices/el6910.yaml}
      - {name: el2904, position: 3, config: devices/el2904.yaml}
  - name: far
    cycle_us: 2000
    subdevices:
      - {name: el1904, position: 0, config: devices/el1904.yaml}
      - {name: drive_1, position: 1, config: devices/circulo.yaml}
nets:
  - name: n
    safety_master: el6910
    transfers: []
    connections:
      - {main: el6910, slot: 0, sub: el1904, watchdog_ms: 100}
      - {main: el6910, slot: 1, sub: el2904, watchdog_ms: 25}
      - {main: el6910, slot: 2, sub: drive_1, watchdog_ms: 80}
safety_functions:
  - name: estop
    required_reaction_ms: 400
    elements:
      - {kind: sensor, name: ES1, time_ms: 5, source: sheet 1}
      - {kind: input, sub: el1904, time_ms: 4, source: sheet 1}
      - {kind: logic, sub: el6910, time_ms: 3, source: sheet 1}
      - {kind: output, sub: el2904, time_ms: 3, source: sheet 1}
      - {kind: output, sub: drive_1, time_ms: 8, source: sheet 1}
      - {kind: actuator, name: K1, time_ms: 20, source: sheet 1}
"""

Maker = Callable[..., Resolution]


@pytest.fixture
def resolution_of(tmp_path: Path) -> Maker:
    def make(*changes: tuple[str, str]) -> Resolution:
        text = NETWORK
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        path = tmp_path / "network.yaml"
        path.write_text(text.replace("devices/", f"{PLAIN}/el6910/devices/"), "utf-8")
        loaded = load_network([path])
        assert loaded.network is not None, loaded.diagnostics
        return resolve(loaded.network)

    return make


def budget_of(resolution: Resolution, **more: object) -> Budget:
    return make_budget(resolution, Library(devices=()), **more)  # type: ignore[arg-type]


def rows_of(budget: Budget) -> dict[str, WatchdogBudget]:
    return {row.connection.sub.name: row for row in budget.connections}


@pytest.mark.shows("R9")
def test_each_connection_counts_its_own_device_and_buses(resolution_of: Maker) -> None:
    resolution = resolution_of()
    budget = budget_of(resolution)
    rows = rows_of(budget)
    # From the far bus 2 + 2 + 1, to it 1 + 1 + 2; on the first 2 and 2. By hand: reference.yaml.
    trips = {name: row.round_trip for name, row in rows.items()}
    assert trips == {"el1904": 8 + 9 + 6, "el2904": 6 + 4 + 6, "drive_1": 16 + 9 + 6}
    least = {name: row.least.ms for name, row in rows.items() if row.least is not None}
    assert least == pytest.approx({"el1904": 27.6, "el2904": 19.2, "drive_1": 37.2})
    assert {n: (r.lost_frames, r.cycle) for n, r in rows.items()} == {
        "el1904": (38, 2),
        "el2904": (8, 1),
        "drive_1": (24, 2),
    }
    # 400 less 10 + 40, less the rest of the way: 2 * 3 + 54 in, 38 + 2 * 3 and 38 + 2 * 8 out.
    most = {name: row.handshake.ms for name, row in rows.items() if row.handshake is not None}
    assert most == {"el1904": 145, "el2904": 153, "drive_1": 148}
    codes = [d.code for d in check_timing(resolution.network, budget)]
    assert not {"FSN602", "FSN603"} & set(codes)


@pytest.mark.shows("R9")
@pytest.mark.parametrize(("watchdog", "count"), [(20, 0), (19, 1), (15, 1)])
def test_a_watchdog_next_to_the_logic_needs_its_own_round_trip(
    resolution_of: Maker, watchdog: int, count: int
) -> None:
    resolution = resolution_of(("watchdog_ms: 25", f"watchdog_ms: {watchdog}"))
    found = check_timing(resolution.network, budget_of(resolution))
    messages = [figures(d.message) for d in found if d.code == "FSN602"]
    assert messages == [f"{watchdog} el6910-el2904 19.2 1.2 16"] * count


def test_the_longest_ways_count_for_the_response(resolution_of: Maker) -> None:
    (row,) = budget_of(resolution_of()).functions
    assert row.reaction is not None
    assert (row.reaction.error_free, row.reaction.polled) == (95, 142)
    late = {case.way: (case.connection, case.ms) for case in row.reaction.late}
    assert late["input"] == ("el6910-el1904", 310)
    assert late["output"] == ("el6910-drive_1", 264)
    assert row.reaction.broken == 222
    # Beckhoff: three cycles of the slowest bus on each way.
    assert row.reaction.typical == 5 + (4 + 3 * 2) + 3 + (3 * 2 + 8) + 20
    assert row.reaction.worst_output == 10 + (8 + 5 + 6) + 6 + 80 + 40
    # A long watchdog of the contactors decides with their own 3 ms, not with those of the drive.
    (row,) = budget_of(resolution_of(("watchdog_ms: 25", "watchdog_ms: 150"))).functions
    assert row.reaction is not None
    late = {case.way: (case.connection, case.ms) for case in row.reaction.late}
    assert late["output"] == ("el6910-el2904", 10 + 38 + 2 * 150 + 2 * 3 + 40)


def test_another_cycle_counts_for_every_bus(resolution_of: Maker) -> None:
    rows = rows_of(budget_of(resolution_of(), cycle=4.0))
    assert rows["el2904"].round_trip == 6 + 2 * 8 + 6
    assert rows["drive_1"].round_trip == 16 + 2 * 12 + 6
    rows = rows_of(budget_of(resolution_of(), copy_cycles=3))
    # A copy one cycle later costs the longest cycle on the way, in each direction.
    assert rows["el2904"].round_trip == 6 + 2 * 3 + 6
    assert rows["drive_1"].round_trip == 16 + (5 + 2) + (4 + 2) + 6


@pytest.mark.parametrize(
    ("cycles", "k", "ms"),
    [
        ((1.0,), 2, 2),
        ((1.0,), 3, 3),
        ((4.0, 1.0), 2, 4 + 4 + 1),
        ((1.0, 4.0), 2, 1 + 1 + 4),
        ((4.0, 1.0, 2.0), 2, 4 + 4 + 1 + 2),
        ((4.0, 1.0, 2.0), 3, 4 + 4 + 1 + 2 + 4),
    ],
)
def test_a_transfer_waits_for_each_bus(cycles: tuple[float, ...], k: int, ms: float) -> None:
    assert transfer_time(cycles, k) == ms


def test_the_rate_of_safety_pdus_is_the_highest(resolution_of: Maker) -> None:
    """Ends that answer at once: two cycles of the bus of each end, and two safety PDUs."""
    rows = rows_of(budget_of(resolution_of()))
    assert rows["el2904"].spdus_per_hour == 2 * 3_600_000 / 4
    assert rows["drive_1"].spdus_per_hour == 2 * 3_600_000 / (2 * 1 + 2 * 2)


def test_a_bus_without_a_cycle_leaves_only_its_own_connections_open(resolution_of: Maker) -> None:
    resolution = resolution_of(("    cycle_us: 2000\n", ""))
    budget = budget_of(resolution)
    assert bus_findings(resolution) == []
    rows = rows_of(budget)
    assert (rows["el2904"].cycle, rows["drive_1"].cycle) == (1, None)
    assert (rows["drive_1"].lost_frames, rows["drive_1"].spdus_per_hour) == (None, None)
    (row,) = budget.functions
    assert row.unstated == ("the bus cycle is not stated",)
    assert row.judgement is Judgement.MISSING


def test_all_buses_scale_together(resolution_of: Maker) -> None:
    """As the picture draws them: at twice the cycle of the first, each bus has twice its own."""
    (row,) = budget_of(resolution_of()).functions
    assert row.times is not None
    twice = [("cycle_us: 2000", "cycle_us: 4000"), ("cycle_us: 1000", "cycle_us: 2000")]
    (slow,) = budget_of(resolution_of(*twice)).functions
    assert reaction_of(row.times.with_ways(lambda way: way.scaled(2))) == slow.reaction


def test_text_and_picture_state_which_buses_count(resolution_of: Maker) -> None:
    budget = budget_of(resolution_of())
    text = document_text(budget_document(budget), width=None)
    assert text.startswith(
        "bus cycle 1 ms (cell), 2 ms (far), 2 bus cycles per direction, one more of each bus that "
        "takes a frame over, clocks exact"
    )
    picture = budget_picture(budget, "t")
    assert "estop: over the bus cycle of cell, ms, all buses in proportion" in picture
    assert "estop: over the longest watchdog, ms, all in proportion" in picture
    rows = {c["name"]: c for c in budget_json(budget)["connections"]}
    assert rows["el6910-el2904"]["round_trip_ms"] == 16
    assert rows["el6910-el2904"]["lost_cycles_survived"] == 8


# -- elements without a way of their own ----------------------------------------------------------


def test_an_element_without_a_subdevice_counts_on_every_way(resolution_of: Maker) -> None:
    slow = "      - {kind: output, name: relays, time_ms: 5, source: sheet 1}\n"
    budget = budget_of(
        resolution_of(("      - {kind: actuator", f"{slow}      - {{kind: actuator"))
    )
    rows = rows_of(budget)
    assert rows["el2904"].round_trip == 2 * 5 + 4 + 6
    assert rows["drive_1"].round_trip == 16 + 9 + 6
    assert rows["el1904"].round_trip == 8 + 9 + 6


def test_an_output_of_the_logic_is_one_way_more(resolution_of: Maker) -> None:
    own = "      - {kind: output, sub: el6910, time_ms: 60, source: sheet 1}\n"
    (row,) = budget_of(resolution_of(("      - {kind: act", f"{own}      - {{kind: act"))).functions
    assert row.times is not None
    assert [(w.connection, w.device) for w in row.times.outputs] == [
        ("el6910-el2904", 3),
        ("el6910-drive_1", 8),
        ("", 60),
    ]
    assert row.reaction is not None
    assert row.reaction.polled == 10 + 38 + (6 + 120) + 40


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ("logic, sub: el6910", "logic, name: logic"),
            "not judged: the logic names no SubDevice; write sub: with its name",
        ),
        (
            ("output, sub: drive_1", "output, sub: drive_7"),
            "not judged: drive_7 is not a SubDevice of this network",
        ),
    ],
)
def test_a_function_without_a_signal_path_is_not_judged(
    resolution_of: Maker, change: tuple[str, str], words: str
) -> None:
    (row,) = budget_of(resolution_of(change)).functions
    assert row.verdict.startswith(words)


def test_an_input_of_the_logic_has_no_connection(resolution_of: Maker) -> None:
    (row,) = budget_of(resolution_of(("input, sub: el1904", "input, sub: el6910"))).functions
    assert row.reaction is not None
    assert row.reaction.watchdog_in is None
    assert row.reaction.decides.ms == 10 + (8 + 6) + (2 * 80 + 2 * 8) + 40


@pytest.mark.shows("R9")
def test_a_way_through_two_logics_is_not_judged(resolution_of: Maker) -> None:
    """The connection between the logics would be missing from the response."""
    resolution = resolution_of(("output, sub: el2904", "logic, sub: drive_1"))
    budget = budget_of(resolution)
    (row,) = budget.functions
    assert (row.parts.apart, row.reaction) == ((), None)
    assert row.missing == (
        "el1904 and drive_1 have different logics; a way through several logics is not worked out",
    )
    assert "FSN606" in [d.code for d in check_timing(resolution.network, budget)]


# -- FSN601: bus cycles alone ---------------------------------------------------------------------


def bus_findings(resolution: Resolution) -> list[str]:
    return [figures(d.message) for d in check(resolution) if d.code == "FSN601"]


@pytest.mark.parametrize(("watchdog", "count"), [(40, 0), (31, 1)])
def test_a_watchdog_across_counts_two_cycles_of_each_end(
    resolution_of: Maker, watchdog: int, count: int
) -> None:
    """2 * (1 + 10) + 10 ms; seven cycles of 10 ms would be 70."""
    resolution = resolution_of(
        ("cycle_us: 2000", "cycle_us: 10000"), ("watchdog_ms: 80", f"watchdog_ms: {watchdog}")
    )
    assert bus_findings(resolution) == ["31 32 1 10"] * count


@pytest.mark.parametrize(("cycle", "count"), [(32, 0), (33, 1)])
def test_without_watchdogs_the_slowest_connection_counts(
    resolution_of: Maker, cycle: int, count: int
) -> None:
    unstated = [(f", watchdog_ms: {ms}", "") for ms in (100, 25, 80)]
    resolution = resolution_of(("cycle_us: 2000", f"cycle_us: {1000 * cycle}"), *unstated)
    assert bus_findings(resolution) == ["100 101 1 33"] * count
