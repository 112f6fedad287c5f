"""Budgets of a network whose numbers were worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from changed import figures
from timing.made_budget import (
    FUNCTION,
    NONE,
    Maker,
    budget_of,
    watchdogs,
    with_watchdogs,
)

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.document.model import outward
from fsoe_net.document.write_terminal import document_text
from fsoe_net.formats.own.library import builtin_library
from fsoe_net.report.budget import budget_document
from fsoe_net.rules.timing import check_timing
from fsoe_net.timing.budget import make_budget
from fsoe_net.timing.elements import Apart
from fsoe_net.timing.judgement import Judgement, WatchdogJudgement

pytestmark = pytest.mark.usefixtures("budgets_recorded")


def test_a_function_by_both_methods(resolution_of: Maker) -> None:
    budget = budget_of(resolution_of())
    (row,) = budget.functions
    assert row.reaction is not None
    assert row.reaction.error_free == 76
    assert row.reaction.typical == 5 + 4 + 3 + 2 + 3 + 3 + 20
    assert row.reaction.worst_input == 10 + 100 + 4 + 2 + 6 + 40
    assert row.reaction.worst_output == 10 + 8 + 2 + 8 + 100 + 40
    assert row.reaction.worst_beckhoff == 220
    assert (row.reaction.worst_etg, row.reaction.printed) == (168, 220)
    assert (row.reaction.polled, row.reaction.broken, row.reaction.disturbed) == (100, 189, 460)
    late = {c.way: (c.connection, c.ms) for c in row.reaction.late}
    assert late == {
        "no fault": ("", 100),
        "input": ("el6910-el1904", 10 + 2 * 100 + 4 + 24 + 40),
        "output": ("el6910-el2904", 10 + 26 + 2 * 100 + 6 + 40),
    }
    assert row.verdict == (
        "within the required reaction time: at most 282 ms when el6910-el2904 is late up to its "
        "watchdog and then lost"
    )
    assert row.pfh.total == pytest.approx(1e-8 + 4.39e-9)
    assert row.pfh.verdict.startswith("PFH sum within the limit; category")


def test_each_watchdog_has_its_interval(resolution_of: Maker) -> None:
    budget = budget_of(resolution_of())
    rows = {c.connection.sub.name: c for c in budget.connections}
    one, two = rows["el1904"], rows["el2904"]
    assert (one.round_trip, two.round_trip) == (16, 14)
    assert one.least is not None
    assert one.least.ms == pytest.approx(19.2)
    assert two.least is not None
    assert two.least.ms == pytest.approx(16.8)
    # 300 - 100 - 20 by Beckhoff is stricter than 300 - 62 and 300 - 68 by ETG.5100.
    assert one.printed is not None
    assert (one.printed.ms, "Beckhoff" in one.printed.why) == (180, True)
    assert one.printed == two.printed
    # Half of 300 less 2 * 5 + 2 * 2 + 24 + 2 * 20, and less 2 * 5 + 26 + 2 * 3 + 2 * 20.
    assert one.handshake is not None
    assert two.handshake is not None
    assert (one.handshake.ms, two.handshake.ms) == (111, 109)
    assert (one.greatest, two.greatest) == (one.handshake, two.handshake)
    assert one.handshake.why == (
        "estop: 300 ms required, 78 ms besides the watchdog, which counts twice (late, then lost; "
        "FSoE handshake counted)"
    )
    assert one.judgement is WatchdogJudgement.WITHIN
    assert one.margin == pytest.approx(100 / 19.2)
    assert (one.lost_frames, two.lost_frames) == (83, 85)
    assert one.spdus_per_hour == 1.8e6
    assert rows["drive_1"].least is None
    assert rows["drive_1"].functions == ()
    assert rows["drive_1"].judgement is WatchdogJudgement.NO_TIMES


@pytest.mark.shows("R10")
def test_a_watchdog_that_only_the_printed_formulas_allow_is_too_long(
    resolution_of: Maker,
) -> None:
    # el1904: Beckhoff leaves 180 - 40 - 20, ETG.5100 180 - 62, the handshake (180 - 78) / 2.
    resolution = resolution_of(*with_watchdogs(180, 52, 40))
    rows = watchdogs(resolution)
    one, two = rows["el1904"], rows["el2904"]
    assert one.printed is not None
    assert one.handshake is not None
    assert (one.printed.ms, one.handshake.ms) == (118, 51)
    assert one.greatest == one.handshake
    assert one.judgement is WatchdogJudgement.ABOVE
    assert two.printed is not None
    assert two.handshake is not None
    assert (two.printed.ms, two.handshake.ms) == (180 - 52 - 20, (180 - 82) / 2)
    assert two.judgement is WatchdogJudgement.WITHIN
    (row,) = budget_of(resolution).functions
    assert row.judgement is Judgement.ABOVE
    found = check_timing(resolution.network, budget_of(resolution))
    assert [figures(d.message) for d in found if d.code == "FSN611"] == [
        "182 el6910-el1904 180 114 ETG.5100"
    ]
    rows = watchdogs(resolution_of(*with_watchdogs(180, 51, 40)))
    assert rows["el1904"].judgement is WatchdogJudgement.WITHIN


@pytest.mark.shows("R10")
def test_an_interval_that_the_handshake_empties_is_an_error(resolution_of: Maker) -> None:
    # (116 - 78) / 2 = 19 is less than 1.2 * 16 = 19.2; ETG.5100 alone would leave 116 - 62 = 54.
    resolution = resolution_of(*with_watchdogs(116, 20, 17))
    one = watchdogs(resolution)["el1904"]
    assert one.printed is not None
    assert one.greatest is not None
    assert (one.printed.ms, one.greatest.ms) == (54, 19)
    assert (one.empty, one.judgement) == (True, WatchdogJudgement.EMPTY)
    found = check_timing(resolution.network, budget_of(resolution))
    assert [d.code for d in found] == ["FSN603", "FSN610", "FSN610"]
    assert figures(found[0].message).split()[-3:] == ["19", "116", "78"]
    assert figures(found[0].hint or "") == "54"
    # Two milliseconds more are a value: 20 ms.
    rows = watchdogs(resolution_of(*with_watchdogs(118, 20, 17)))
    assert [rows[n].judgement for n in ("el1904", "el2904")] == [WatchdogJudgement.WITHIN] * 2


def test_one_connection_there_and_back_counts_twice(resolution_of: Maker) -> None:
    # Beckhoff: 2 * watchdog + 20 within 300; what is configured is no bound of itself.
    text = FUNCTION.replace("sub: el2904", "sub: el1904")
    one = watchdogs(resolution_of(text))["el1904"]
    assert one.printed is not None
    assert one.printed.ms == 140
    assert one.handshake is not None
    # Three times with 2 * 5 + 2 * 4 + 2 * 20 besides, the longer time of the two parts.
    assert one.handshake.ms == pytest.approx((300 - 58) / 3)
    assert "58 ms besides the watchdog, which counts three times" in one.handshake.why
    (row,) = budget_of(resolution_of(text)).functions
    assert row.reaction is not None
    assert row.reaction.decides.ms == 358
    assert row.verdict == (
        "above the required reaction time: 358 ms when el6910-el1904 is late up to its watchdog "
        "both ways and then lost"
    )
    assert "20 ms besides the watchdog, which counts twice" in one.printed.why
    # Besides, a second output device with 100 ms: 200 - 100 - 20 is the smaller.
    more = text + "      - {kind: output, sub: el2904, time_ms: 3, source: manual}\n"
    rows = watchdogs(resolution_of(more.replace("300", "200")))
    assert rows["el1904"].printed is not None
    assert rows["el1904"].printed.ms == 80
    assert rows["el2904"].printed is not None
    assert rows["el2904"].printed.ms == 80


@pytest.mark.parametrize(
    ("required", "first", "found"),
    [
        ("300", 100, WatchdogJudgement.WITHIN),
        ("300", 19, WatchdogJudgement.BELOW),
        ("278", 100, WatchdogJudgement.WITHIN),
        ("277.9", 100, WatchdogJudgement.ABOVE),
        ("219.9", 100, WatchdogJudgement.ABOVE),
        ("", 100, WatchdogJudgement.UNLIMITED),
    ],
)
def test_a_configured_watchdog_against_its_interval(
    resolution_of: Maker, required: str, first: int, found: WatchdogJudgement
) -> None:
    text, network = with_watchdogs(0, first, 100)
    line = f"required_reaction_ms: {required}" if required else ""
    resolution = resolution_of(text.replace("required_reaction_ms: 0", line), network=network)
    assert watchdogs(resolution)["el1904"].judgement is found


def test_a_watchdog_that_is_not_stated_has_an_interval(resolution_of: Maker) -> None:
    rows = watchdogs(resolution_of(network=("watchdog_ms: 100}", "slot: 0}")))
    one = rows["el1904"]
    assert one.judgement is WatchdogJudgement.UNSTATED
    assert one.greatest is not None
    # Beckhoff's other watchdog is open: (300 - 78) / 2 remains, ETG.5100 would leave 300 - 62.
    assert one.greatest.ms == 111


def test_an_empty_interval_is_reported(resolution_of: Maker) -> None:
    text = FUNCTION.replace("required_reaction_ms: 300", "required_reaction_ms: 130")
    budget = budget_of(resolution_of(text))
    one = next(c for c in budget.connections if c.connection.sub.name == "el1904")
    assert one.greatest is not None
    assert one.greatest.ms == 10
    assert one.empty
    assert budget.functions[0].verdict == (
        "above the required reaction time: 282 ms when el6910-el2904 is late up to its watchdog "
        "and then lost"
    )


@pytest.mark.shows("R9")
def test_a_measurement_only_makes_it_worse(resolution_of: Maker) -> None:
    resolution = resolution_of()
    name = next(c.name for c in resolution.connections if c.sub.name == "el1904")
    better = budget_of(resolution, measured={name: 2.0})
    worse = budget_of(resolution, measured={name: 30.0})
    rows = [next(c for c in b.connections if c.connection.name == name) for b in (better, worse)]
    assert [r.round_trip for r in rows] == [16, 30]
    least = rows[1].least
    assert least is not None
    assert least.ms == 36
    assert "measured" in least.why


def test_a_slow_clock_makes_watchdogs_longer(resolution_of: Maker) -> None:
    budget = budget_of(resolution_of(), drift=0.01)
    assert (budget.cycle, budget.copy_cycles, budget.drift) == (1.0, 2, 0.01)
    (row,) = budget.functions
    assert row.reaction is not None
    assert row.reaction.worst_beckhoff == pytest.approx(222)
    one = watchdogs(resolution_of(), drift=0.01)["el1904"]
    assert one.printed is not None
    assert one.handshake is not None
    assert one.printed.ms == pytest.approx((300 - 101 - 20) / 1.01)
    assert one.handshake.ms == pytest.approx(111 / 1.01)


def test_a_copy_one_cycle_later(resolution_of: Maker) -> None:
    (row,) = budget_of(resolution_of(), copy_cycles=3).functions
    assert row.reaction is not None
    assert row.reaction.error_free == 78


@pytest.mark.shows("R10", "R11")
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("sub: el1904, time_ms: 4,", "sub: el1904,", "the time of input el1904 is not stated"),
        ("{kind: sensor, name: ES1,", "{kind: actuator, name: K2,", "no sensor is stated"),
        ("logic, sub: el6910", "logic, sub: drive_1", "no FSoE connection joins el1904"),
    ],
)
def test_a_missing_value_is_never_zero(
    resolution_of: Maker, old: str, new: str, words: str
) -> None:
    (row,) = budget_of(resolution_of(FUNCTION.replace(old, new))).functions
    assert row.reaction is None
    assert words in row.verdict
    assert row.verdict.startswith("not judged")


@pytest.mark.shows("R10")
def test_without_a_watchdog_or_cycle_there_is_not_a_verdict(resolution_of: Maker) -> None:
    (row,) = budget_of(resolution_of(network=("watchdog_ms: 100}", "slot: 0}"))).functions
    assert "the watchdog of" in row.verdict
    resolution = resolution_of()
    nowhere = replace(resolution, network=replace(resolution.network, cycle_ns=None))
    (row,) = budget_of(nowhere).functions
    assert "the bus cycle is not stated" in row.verdict
    (row,) = budget_of(nowhere, cycle=4.0).functions
    assert row.reaction is not None
    assert row.reaction.error_free == 88


@pytest.mark.shows("R10")
def test_values_of_the_library_pass_only_with_a_manual(resolution_of: Maker) -> None:
    bare = FUNCTION.replace("pfh_per_hour: 1.11e-9, source: manual", "source: manual")
    (row,) = make_budget(resolution_of(bare), builtin_library()).functions
    assert row.pfh.total == pytest.approx(1e-8 + 4.39e-9)
    assert "not judged: unverified PFH of el1904" in row.pfh.verdict
    assert "not judged: unverified: el1904" in row.verdict
    read = bare.replace("time_ms: 4, source: manual", 'time_ms: 4, source: m, manual: "3.0.0"')
    (row,) = make_budget(resolution_of(read), builtin_library()).functions
    assert row.pfh.verdict.startswith("PFH sum within the limit")


@pytest.mark.shows("R11")
def test_sums_above_the_limit(resolution_of: Maker) -> None:
    text = FUNCTION.replace("pfh_per_hour: 1.0e-8", "pfh_per_hour: 1.0e-6")
    (row,) = budget_of(resolution_of(text)).functions
    assert row.pfh.verdict.startswith("PFH sum above the limit")


@pytest.mark.parametrize(
    ("old", "new", "reaction", "pfh"),
    [
        ("", "", Judgement.WITHIN, Judgement.WITHIN),
        # The connection of the output late up to its watchdog and then lost takes 282 ms.
        ("required_reaction_ms: 300", "required_reaction_ms: 282", Judgement.WITHIN, None),
        ("required_reaction_ms: 300", "required_reaction_ms: 281.9", Judgement.ABOVE, None),
        ("    required_reaction_ms: 300\n", "", Judgement.NONE, Judgement.WITHIN),
        ("    required: {pl: d}\n", "", Judgement.WITHIN, Judgement.NONE),
        ("time_ms: 4, ", "", Judgement.MISSING, Judgement.WITHIN),
        ("pfh_per_hour: 1.11e-9, ", "", Judgement.WITHIN, Judgement.MISSING),
        ("1.25e-9, source: manual", "1.25e-9", Judgement.UNVERIFIED, Judgement.UNVERIFIED),
        ("1.25e-9, source: manual", "1.25e-9, source: '-'", *(Judgement.UNVERIFIED,) * 2),
        ("1.25e-9, source: manual", "1.25e-9, source: T.B.D.", *(Judgement.UNVERIFIED,) * 2),
        ("1.25e-9, source: manual", "1.25e-9, source: Guess", *(Judgement.UNVERIFIED,) * 2),
        ("1.25e-9, source: manual", "1.25e-9, source: '0'", *(Judgement.UNVERIFIED,) * 2),
        # 1.0e-6 is no longer below the limit of PL d, whoever answers for it.
        ("1.0e-8, source: sheet", "1.0e-6", Judgement.UNVERIFIED, Judgement.ABOVE),
    ],
)
def test_a_judgement_is_data_and_its_words_follow(
    resolution_of: Maker, old: str, new: str, reaction: Judgement, pfh: Judgement | None
) -> None:
    (row,) = budget_of(resolution_of(FUNCTION.replace(old, new))).functions
    assert row.judgement is reaction
    assert pfh in (None, row.pfh.judgement)
    for found, words in ((row.judgement, row.verdict), (row.pfh.judgement, row.pfh.verdict)):
        start = {Judgement.WITHIN: "within", Judgement.ABOVE: "above", Judgement.NONE: "no "}
        assert start.get(found, "not judged: ") in words


def test_times_within_the_printed_formulas_only_are_above(resolution_of: Maker) -> None:
    # Watchdogs of 30 ms: ETG.5100 98 ms, Beckhoff 80 ms; one late, then lost: 142 ms.
    text = FUNCTION.replace("required_reaction_ms: 300", "required_reaction_ms: 110")
    budget = budget_of(resolution_of(text, network=("watchdog_ms: 100", "watchdog_ms: 30")))
    (row,) = budget.functions
    assert row.judgement is Judgement.ABOVE
    assert row.verdict.startswith("above the required reaction time: 142 ms when el6910-el2904")


def test_ends_that_no_connection_joins_are_apart(resolution_of: Maker) -> None:
    text = FUNCTION.replace("logic, sub: el6910", "logic, sub: drive_1")
    (row,) = budget_of(resolution_of(text)).functions
    assert row.parts.apart == (
        Apart(end="el1904", logic=("drive_1",)),
        Apart(end="el2904", logic=("drive_1",)),
    )
    assert row.unstated == ()
    assert row.missing == (
        "no FSoE connection joins el1904 and drive_1",
        "no FSoE connection joins el2904 and drive_1",
    )
    assert (row.times, row.judgement) == (None, Judgement.MISSING)


def test_input_and_logic_in_one_subdevice(resolution_of: Maker) -> None:
    text = FUNCTION.replace("sub: el1904", "sub: el6910")
    (row,) = budget_of(resolution_of(text)).functions
    assert row.reaction is not None
    assert row.reaction.error_free == 74
    assert row.reaction.worst_input is None
    assert row.reaction.worst_beckhoff == 120


@pytest.mark.shows("R9")
def test_bounds_are_shown_on_their_safe_side(resolution_of: Maker):
    """A greatest watchdog of 179.98 ms is no 180.0 ms, and 62.04 ms are no 62.0 ms."""
    functions = FUNCTION.replace("time_ms: 20", "time_ms: 20.02")
    budget = make_budget(resolution_of(functions), NONE)
    text = document_text(budget_document(budget), width=None)
    row = next(c for c in budget.connections if c.printed is not None)
    assert row.printed is not None
    shown = float(text.split("at most ", 1)[1].split(" ms")[0])
    assert 0 < row.printed.ms - shown < 0.1
    (function,) = budget.functions
    assert function.reaction is not None
    shown = float(text.split("error-free ", 1)[1].split(" ms")[0])
    assert 0 < shown - function.reaction.error_free < 0.1
    assert outward(222.60000000000002, 1, up=True) == outward(222.6, 1, up=False) == 222.6
    assert (outward(49.996, up=False), outward(49.991, up=True)) == (49.99, 50.0)


def test_safe_outputs_that_no_function_switches_are_to_be_justified(resolution_of: Maker) -> None:
    def found(functions: str) -> dict[str, tuple[Severity, str]]:
        resolution = resolution_of(functions)
        lines = Path(resolution.network.span.file).read_text().splitlines()
        rows = [
            d for d in check_timing(resolution.network, budget_of(resolution)) if d.code == "FSN610"
        ]
        names = [lines[d.span.line - 1].partition("sub: ")[2].partition(",")[0] for d in rows]
        return {n: (d.level, figures(d.message)) for n, d in zip(names, rows, strict=True)}

    unused = (Severity.WARNING, "el6910-drive_1")
    assert found(FUNCTION).keys() == {"drive_1", "drive_2"}
    assert found(FUNCTION)["drive_1"] == unused
    # The safe data to el1904 is padding: it has inputs alone.
    others = FUNCTION.replace("kind: input, sub: el1904", "kind: input, sub: el2904")
    others = others.replace("kind: output, sub: el2904", "kind: output, sub: drive_1")
    assert found(others) == {
        "drive_2": (Severity.WARNING, "el6910-drive_2"),
        "el1904": (Severity.INFO, "el6910-el1904"),
    }
