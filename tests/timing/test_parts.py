"""Budgets in which both directions differ, so that nothing can stand in for its counterpart."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from changed import figures
from signal_path.path import Parts
from timing.made_budget import (
    FUNCTION,
    Maker,
    budget_of,
    watchdogs,
    with_watchdogs,
)

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.own.library import builtin_library
from fsoe_net.model.library import Library, LibraryFigure
from fsoe_net.model.safety import ElementKind
from fsoe_net.rules.timing import check_timing
from fsoe_net.timing.budget import make_budget
from fsoe_net.timing.formulas import (
    PartTimes,
    SignalWay,
    beckhoff_typical,
    error_free,
    round_trip,
    worst_case_input,
    worst_case_output,
)
from fsoe_net.timing.handshake import (
    broken_input,
    broken_output,
    disturbed_both,
    disturbed_input,
    disturbed_output,
    polled_error_free,
)
from fsoe_net.timing.judgement import Judgement, WatchdogJudgement
from fsoe_net.timing.pfh import PfhSum
from fsoe_net.timing.reaction import ResponseCase, reaction_of

pytestmark = pytest.mark.usefixtures("budgets_recorded")

UNEQUAL = Parts(
    sensor=5, input=4, logic=2, output=3, actuator=20, cycle=1, cycles_in=2, cycles_out=3
)


def test_each_direction_has_its_own_transfer() -> None:
    t = UNEQUAL.times(100, 100)
    (there,), (back,) = t.inputs, t.outputs
    assert error_free(t) == 10 + 8 + 2 + 4 + 4 + 3 + 6 + 40
    assert worst_case_input(t, 100) == 10 + 100 + 4 + 3 + 6 + 40
    assert worst_case_output(t, 100) == 10 + 8 + 2 + 4 + 4 + 100 + 40
    # The healthy ways: (8 + 4 + 4) + 4 + 2 + 4 there, (6 + 4 + 6) + 2 + 3 + 6 back.
    assert broken_input(t, there) == 10 + (100 + 4 + 2 + 6) + 27 + 40
    assert broken_output(t, back) == 10 + 26 + (100 + 2 + 3 + 9) + 40
    assert reaction_of(t).broken == 190
    alone = replace(UNEQUAL, cycles_in=0).times(watchdog_out=100)
    assert reaction_of(alone).broken == 10 + 12 + (100 + 2 + 3 + 9) + 40
    alone = replace(UNEQUAL, cycles_out=0).times(watchdog_in=100)
    assert reaction_of(alone).broken == 10 + (100 + 4 + 2 + 6) + 10 + 40


def test_each_direction_is_disturbed_by_itself() -> None:
    # A connection that is lost at will takes two watchdogs, the other one its healthy way.
    t = UNEQUAL.times(100, 90)
    (there,), (back,) = t.inputs, t.outputs
    assert disturbed_input(t, there) == 10 + (2 * 100 + 4) + 27 + 40
    assert disturbed_output(t, back) == 10 + 26 + (2 * 90 + 6) + 40
    assert disturbed_both(t) == 10 + (2 * 100 + 4) + (2 * 90 + 6) + 40
    # A watchdog shorter than the healthy way counts no less than that.
    t = UNEQUAL.times(1, 1)
    assert disturbed_both(t) == polled_error_free(t) == 10 + 26 + 27 + 40


def test_each_direction_between_two_buses_has_its_own_transfer() -> None:
    """From a bus of 4 ms to the first, of 1 ms: 4 + 4 + 1; back: 1 + 1 + 4."""
    there = SignalWay(
        connection="in", device=4, logic=2, to_logic=9, from_logic=6, cycle=4, watchdog=90
    )
    back = SignalWay(
        connection="out", device=3, logic=2, to_logic=9, from_logic=6, cycle=4, watchdog=80
    )
    t = PartTimes(inputs=(there,), outputs=(back,))
    assert (round_trip(there), round_trip(back)) == (8 + 15 + 4, 6 + 15 + 4)
    assert error_free(t) == (8 + 9 + 4) + (4 + 6 + 6)
    polled_in, polled_out = 27 + 4 + 9 + 4, 25 + 2 + 6 + 6
    assert polled_error_free(t) == polled_in + polled_out
    assert broken_input(t, there) == (90 + 4 + 9 + 6) + polled_out
    assert broken_output(t, back) == polled_in + (80 + 2 + 6 + 9)


def test_the_longest_way_of_several_counts_for_each_formula() -> None:
    """Each way has its own times: the greatest of each never meet in one that is not there."""
    near = SignalWay(
        connection="near", device=9, logic=2, to_logic=2, from_logic=2, cycle=1, watchdog=30
    )
    far = SignalWay(
        connection="far", device=1, logic=2, to_logic=9, from_logic=6, cycle=4, watchdog=70
    )
    local = SignalWay(device=5, logic=2)
    t = PartTimes(inputs=(near, far), outputs=(far, near, local))
    assert error_free(t) == max(18 + 2 + 4, 2 + 9 + 4) + max(4 + 2 + 18, 4 + 6 + 2, 4 + 10)
    trips = round_trip(near), round_trip(far)
    assert trips == (18 + 4 + 4, 2 + 15 + 4)
    polled_in = max(26 + 9 + 2 + 4, 21 + 1 + 9 + 4)
    polled_out = max(21 + 2 + 6 + 2, 26 + 2 + 2 + 18, 14)
    assert (polled_in, polled_out) == (41, 48)
    reaction = reaction_of(t)
    late = {case.way: (case.connection, case.ms) for case in reaction.late}
    assert late == {
        "no fault": ("", 89),
        "input": ("far", (2 * 70 + 4) + 48),
        "output": ("far", 41 + (2 * 70 + 2)),
        "both ways": ("far", 3 * 70 + 2),
    }
    assert reaction.broken == max(70 + 1 + 9 + 6 + 48, 30 + 9 + 2 + 6 + 48, 41 + 70 + 2 + 6 + 3)
    assert reaction.disturbed == (2 * 70 + 4) + (2 * 70 + 2)
    assert (reaction.watchdog_in, reaction.watchdog_out) == (70, 70)


def test_the_longest_watchdog_need_not_decide() -> None:
    """20 ms more of the watchdog count less than 45 ms more of the device."""
    slow = SignalWay(connection="slow", device=50, logic=2, to_logic=2, from_logic=2, watchdog=150)
    long = SignalWay(connection="long", device=5, logic=2, to_logic=2, from_logic=2, watchdog=170)
    there = SignalWay(connection="in", device=4, logic=2, to_logic=2, from_logic=2, watchdog=100)
    decides = reaction_of(PartTimes(inputs=(there,), outputs=(long, slow))).decides
    # 16 + 4 + 2 + 4 in, then out 2 * 150 + 2 * 50; with 2 * 170 + 2 * 5 it would be 376.
    assert decides == ResponseCase(way="output", connection="slow", ms=26 + 400)


def test_beckhoff_counts_three_cycles_for_each_connection_that_is_there() -> None:
    parts = Parts(sensor=5, input=4, logic=2, output=3, actuator=20, cycle=4)
    for there, back, cycles in ((2, 2, 6), (0, 2, 3), (2, 0, 3), (0, 0, 0)):
        t = replace(parts, cycles_in=there, cycles_out=back).times()
        assert beckhoff_typical(t) == 34 + cycles * 4


def test_sensor_and_actuator_may_take_no_time_and_never_less() -> None:
    way = SignalWay(device=0, logic=0)
    t = PartTimes(inputs=(way,), outputs=(way,))
    assert (t.sensor, t.actuator) == (0, 0)
    for wrong in ({"sensor": -1.0}, {"actuator": -1.0}):
        with pytest.raises(ValueError, match="not negative"):
            PartTimes(inputs=(way,), outputs=(way,), **wrong)


def test_output_and_logic_in_one_subdevice(resolution_of: Maker) -> None:
    (row,) = budget_of(resolution_of(FUNCTION.replace("sub: el2904", "sub: el6910"))).functions
    assert row.reaction is not None
    assert row.reaction.error_free == 10 + 8 + 2 + 4 + 4 + 6 + 40
    assert (row.reaction.worst_output, row.reaction.worst_beckhoff) == (None, 120)
    assert row.reaction.disturbed == 10 + (200 + 4) + (4 + 6) + 40
    assert row.pfh.fsoe == 1e-9
    (row,) = budget_of(resolution_of(FUNCTION.replace("sub: el1904", "sub: el6910"))).functions
    assert row.reaction is not None
    assert row.reaction.disturbed == 10 + (8 + 4) + (200 + 6) + 40
    assert row.pfh.fsoe == 1e-9
    one = FUNCTION.replace("sub: el1904", "sub: el6910").replace("sub: el2904", "sub: el6910")
    (row,) = budget_of(resolution_of(one)).functions
    assert row.reaction is not None
    assert (row.reaction.worst_beckhoff, row.reaction.disturbed) == (20, 10 + 12 + 10 + 40)
    assert row.pfh.fsoe == 0


@pytest.mark.parametrize(("number", "sub"), [(1, "el1904"), (2, "el2904")])
def test_one_watchdog_that_is_missing_is_enough(
    resolution_of: Maker, number: int, sub: str
) -> None:
    gone = (f"connection_id: {number}, watchdog_ms: 100", f"connection_id: {number}")
    budget = budget_of(resolution_of(network=gone))
    (row,) = budget.functions
    name = next(c.connection.name for c in budget.connections if c.connection.sub.name == sub)
    assert row.unstated == (f"the watchdog of {name} is not stated",)
    assert (row.reaction, row.judgement) == (None, Judgement.MISSING)


def test_another_cycle_scales_every_transfer(resolution_of: Maker) -> None:
    (row,) = budget_of(resolution_of()).functions
    assert row.times is not None
    times = row.times.with_ways(lambda way: way.scaled(4))
    assert error_free(times) == 88
    assert {(w.to_logic, w.from_logic, w.cycle) for w in times.inputs} == {(8, 8, 4)}


def test_of_parallel_inputs_the_longest_watchdog_and_time_count(resolution_of: Maker) -> None:
    text = FUNCTION + "      - {kind: input, sub: drive_1, time_ms: 1, source: manual}\n"
    short = ("connection_id: 3, watchdog_ms: 100", "connection_id: 3, watchdog_ms: 50")
    (row,) = budget_of(resolution_of(text, network=short)).functions
    assert row.reaction is not None
    assert (row.reaction.watchdog_in, row.reaction.watchdog_out) == (100, 100)
    assert row.reaction.error_free == 76


@pytest.mark.parametrize(("required", "found"), [(142, Judgement.WITHIN), (141.9, Judgement.ABOVE)])
def test_exactly_the_required_time_is_within(
    resolution_of: Maker, required: float, found: Judgement
) -> None:
    # Watchdogs of 30 ms: late, then lost 60 + 82; ETG.5100 30 + 68; Beckhoff 30 + 30 + 20.
    (row,) = budget_of(resolution_of(*with_watchdogs(required, 30, 30))).functions
    assert row.reaction is not None
    assert (row.reaction.decides.ms, row.reaction.printed, row.judgement) == (142, 98, found)


def test_rounding_of_floating_point_is_not_a_finding(resolution_of: Maker) -> None:
    # 2 * 5 + (3 * 3.4 + 6 + 4 * 0.3) + 2 * 100 + 6 + 2 * 0.1 ms are 233.6 ms, more as floats.
    functions, network = with_watchdogs(233.6, 100, 100)
    for old, new in (("4,", "3.4,"), ("2,", "0.3,"), ("20,", "0.1,")):
        assert functions.count(f"time_ms: {old}") == 1
        functions = functions.replace(f"time_ms: {old}", f"time_ms: {new}")
    resolution = resolution_of(functions, network)
    budget = budget_of(resolution)
    (row,) = budget.functions
    assert row.reaction is not None
    assert row.reaction.decides.ms == pytest.approx(233.6)
    assert row.reaction.decides.ms > 233.6  # else this example shows nothing
    assert row.judgement is Judgement.WITHIN
    codes = [d.code for d in check_timing(resolution.network, budget)]
    assert not {"FSN604", "FSN611"} & set(codes)


def test_a_margin_needs_a_watchdog_and_times(resolution_of: Maker) -> None:
    rows = watchdogs(resolution_of())
    assert (rows["drive_1"].margin, rows["drive_1"].lost_frames) == (None, None)
    resolution = resolution_of(network=("connection_id: 1, watchdog_ms: 100", "connection_id: 1"))
    one = watchdogs(resolution)["el1904"]
    assert (one.least is None, one.margin, one.lost_frames) == (False, None, None)
    # A measurement stands alone where times are missing; one of nothing has no margin.
    name = next(c.name for c in resolution.connections if c.sub.name == "drive_1")
    for ms, margin, lost in ((10.0, pytest.approx(100 / 12), 89), (0.0, None, 99)):
        row = watchdogs(resolution, measured={name: ms})["drive_1"]
        assert (row.margin, row.lost_frames) == (margin, lost)


def test_an_interval_of_one_value_is_not_empty(resolution_of: Maker) -> None:
    # 1.2 * 20 ms as measured, and (126 - 78) / 2 ms with the handshake counted
    resolution = resolution_of(*with_watchdogs(126, 24, 17))
    name = next(c.name for c in resolution.connections if c.sub.name == "el1904")
    one = watchdogs(resolution, measured={name: 20.0})["el1904"]
    assert one.least is not None
    assert one.handshake is not None
    assert (one.least.ms, one.handshake.ms) == (24, 24)
    assert (one.empty, one.judgement) == (False, WatchdogJudgement.WITHIN)
    one = watchdogs(resolution, measured={name: 16.0})["el1904"]
    assert one.least is not None
    assert "measured" not in one.least.why


def test_the_output_by_etg_alone(resolution_of: Maker) -> None:
    # 105 - 68 by ETG.5100, 105 - 20 - 20 by Beckhoff
    two = watchdogs(resolution_of(*with_watchdogs(105, 20, 17)))["el2904"]
    assert two.printed is not None
    assert two.printed.ms == 37
    # The watchdog of the input is open: Beckhoff's sum says nothing then.
    gone = ("connection_id: 1, watchdog_ms: 100", "connection_id: 1")
    two = watchdogs(resolution_of(network=gone))["el2904"]
    assert two.printed is not None
    assert (two.printed.ms, "ETG.5100" in two.printed.why) == (232, True)


def test_two_safety_pdus_in_four_cycles(resolution_of: Maker) -> None:
    rows = watchdogs(resolution_of(), cycle=4.0)
    assert rows["el1904"].spdus_per_hour == 2 * 3_600_000 / 16
    assert [rows[n].functions for n in ("el1904", "el2904")] == [("estop",), ("estop",)]


# -- elements -------------------------------------------------------------------------------------


def test_figures_of_the_library_are_taken_by_name(resolution_of: Maker) -> None:
    figures = (("pfh_per_hour", 3e-9), ("input_ms", 4.5), ("output_ms", 9.0))
    whole = builtin_library()
    device = whole.find(2, 0x07703052)
    assert device is not None
    device = replace(
        device,
        sources={"sheet": "sheet 7"},
        figures=tuple(LibraryFigure(name=n, value=v, source="sheet") for n, v in figures),
    )
    bare = FUNCTION.replace("time_ms: 4, pfh_per_hour: 1.11e-9, source: manual", 'manual: "3.0.0"')
    library = Library(devices=(device,))
    (row,) = make_budget(resolution_of(bare), library).functions
    element = row.parts.rows[1]
    assert (element.time.value, element.pfh.value) == (4.5, 3e-9)
    assert element.time.source == "device library: sheet 7; confirmed by manual 3.0.0"
    assert (element.time.answered_for, element.pfh.answered_for) == (True, True)
    (row,) = make_budget(resolution_of(bare.replace('manual: "3.0.0",', "")), library).functions
    element = row.parts.rows[1]
    assert element.time.source == "device library: sheet 7"
    assert (element.time.answered_for, row.parts.unverified) == (False, ("el1904",))


def test_a_time_that_is_missing_is_zero_and_unverified(resolution_of: Maker) -> None:
    (row,) = budget_of(resolution_of(FUNCTION.replace("time_ms: 4, ", ""))).functions
    assert row.parts.slowest(ElementKind.INPUT) == 0
    assert not row.parts.rows[1].time.answered_for
    assert row.parts.unverified == ()
    (sensor,) = re.findall(r" +- {kind: sensor,.*\n.*\n", FUNCTION)
    (row,) = budget_of(resolution_of(FUNCTION.replace(sensor, ""))).functions
    assert row.parts.slowest(ElementKind.SENSOR) == 0


def test_one_of_two_logics_is_enough_to_be_joined(resolution_of: Maker) -> None:
    text = FUNCTION + "      - {kind: logic, sub: drive_2, time_ms: 1, source: manual}\n"
    (row,) = budget_of(resolution_of(text)).functions
    assert row.parts.apart == ()
    assert [c.sub.name for c in row.parts.to_input] == ["el1904"]


# -- PFH ------------------------------------------------------------------------------------------


@pytest.mark.shows("R11")
@pytest.mark.parametrize(
    ("required", "limit"),
    [
        # ISO 13849-1 table 2, IEC 62061 table 3
        ("{pl: a}", 1e-4),
        ("{pl: b}", 1e-5),
        ("{pl: c}", 3e-6),
        ("{pl: d}", 1e-6),
        ("{pl: e}", 1e-7),
        ("{sil: 1}", 1e-5),
        ("{sil: 2}", 1e-6),
        ("{sil: 3}", 1e-7),
        ("{pl: c, sil: 2}", 1e-6),
        ("{pl: e, sil: 1}", 1e-7),
    ],
)
def test_the_limit_of_each_level(resolution_of: Maker, required: str, limit: float) -> None:
    (row,) = budget_of(resolution_of(FUNCTION.replace("{pl: d}", required))).functions
    assert row.pfh.limit == limit


@pytest.mark.shows("R11")
def test_a_sum_that_reaches_the_limit_is_above_it() -> None:
    for total, found in ((1e-6, Judgement.ABOVE), (9.99e-7, Judgement.WITHIN)):
        pfh = PfhSum(total=total, fsoe=0.0, limit=1e-6, missing=(), unverified=())
        assert pfh.judgement is found


# -- rules ----------------------------------------------------------------------------------------


def test_a_network_without_safety_functions_has_no_findings(resolution_of: Maker) -> None:
    resolution = resolution_of("")
    assert check_timing(resolution.network, budget_of(resolution)) == []


@pytest.mark.parametrize(("required", "count"), [("", 0), ("required: {pl: d}", 1)])
def test_a_pfh_is_asked_for_only_with_a_level(
    resolution_of: Maker, required: str, count: int
) -> None:
    text = FUNCTION.replace("required: {pl: d}", required).replace("pfh_per_hour: 1.11e-9, ", "")
    resolution = resolution_of(text)
    found = check_timing(resolution.network, budget_of(resolution))
    words = [figures(d.message) for d in found if d.code == "FSN606"]
    assert words == ["el1904"] * count


def test_apart_and_unstated_are_two_findings_that_do_not_mix(resolution_of: Maker) -> None:
    text = FUNCTION.replace("logic, sub: el6910", "logic, sub: drive_1")
    resolution = resolution_of(text.replace("time_ms: 4, ", ""))
    found = check_timing(resolution.network, budget_of(resolution))
    assert [figures(d.message) for d in found if d.code == "FSN605"] == [
        "el1904 drive_1",
        "el2904 drive_1",
    ]
    assert [d for d in found if d.code == "FSN606"] == []


@pytest.mark.parametrize(
    ("required", "first", "second", "words"),
    [
        # 75 + 62 by ETG.5100, 75 + 30 + 20 by Beckhoff; late, then lost 2 * 75 + 78
        (130, 75, 30, "228 el6910-el1904 130 137 ETG.5100"),
        (219.9, 100, 100, "282 el6910-el2904 219.9 220"),
        # 90 + 62 and 90 + 42 + 20
        (151, 90, 42, "258 el6910-el1904 151 152 ETG.5100"),
    ],
)
def test_the_school_that_takes_longer_is_named(
    resolution_of: Maker, required: float, first: int, second: int, words: str
) -> None:
    resolution = resolution_of(*with_watchdogs(required, first, second))
    found = check_timing(resolution.network, budget_of(resolution))
    assert [figures(d.message) for d in found if d.code == "FSN604"] == [words]


@pytest.mark.shows("R10")
@pytest.mark.parametrize(
    ("first", "level"),
    [
        (24, None),
        (23, Severity.WARNING),
        (20, Severity.WARNING),
        (19, Severity.ERROR),
    ],
)
def test_a_watchdog_shorter_than_the_round_trip_is_an_error(
    resolution_of: Maker, first: int, level: Severity | None
) -> None:
    # 20 ms as measured, 24 ms with the reserve
    resolution = resolution_of(*with_watchdogs(230, first, 100))
    name = next(c.name for c in resolution.connections if c.sub.name == "el1904")
    found = check_timing(resolution.network, budget_of(resolution, measured={name: 20.0}))
    assert [d.level for d in found if d.code == "FSN602"] == ([] if level is None else [level])


@pytest.mark.parametrize(("required", "left"), [(85, ""), (86, "24"), (87, "25")])
def test_an_empty_interval_names_what_the_printed_formulas_leave(
    resolution_of: Maker, required: float, left: str
) -> None:
    # 24 ms at least, as measured; at most required - 62 by ETG.5100 and required - 86 counted
    resolution = resolution_of(*with_watchdogs(required, 24, 17))
    name = next(c.name for c in resolution.connections if c.sub.name == "el1904")
    found = check_timing(resolution.network, budget_of(resolution, measured={name: 20.0}))
    hint = next(d.hint or "" for d in found if d.code == "FSN603" and name in d.message)
    assert figures(hint) == left


@pytest.mark.parametrize(
    ("sub", "hint"), [("el190", "el1904"), ("valve", "el6910 el1904 el2904 drive_1 drive_2")]
)
def test_an_element_that_is_not_a_subdevice(resolution_of: Maker, sub: str, hint: str) -> None:
    resolution = resolution_of(FUNCTION.replace("sub: el1904", f"sub: {sub}"))
    found = check_timing(resolution.network, budget_of(resolution))
    (wrong,) = [d for d in found if d.code == "FSN605"]
    assert figures(wrong.hint or "") == hint


def test_a_case_states_when_it_takes_that_long() -> None:
    late = " is late up to its watchdog"
    assert [
        ResponseCase(way=way, connection=name, ms=1.0).words
        for way, name in [
            ("no fault", ""),
            ("Beckhoff", ""),
            ("input", "a-b"),
            ("both ways", "a-b"),
        ]
    ] == [
        "values wait for their turn",
        "counted as Beckhoff prints it",
        f"a-b{late} and then lost",
        f"a-b{late} both ways and then lost",
    ]
