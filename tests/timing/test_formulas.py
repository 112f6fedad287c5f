"""The printed tables of the sources, to the printed digit."""

from __future__ import annotations

import math

import pytest

from fsoe_net.timing.formulas import (
    PartTimes,
    beckhoff_typical,
    beckhoff_worst_case,
    error_free,
    lost_frames_survived,
    round_trip_input,
    round_trip_output,
    watchdog_input,
    watchdog_output,
    worst_case_input,
    worst_case_output,
)


def parts(cycle: float, k: int) -> PartTimes:
    return PartTimes(
        sensor=5, input=4, logic=2, output=3, actuator=20, cycle=cycle, cycles_in=k, cycles_out=k
    )


# T_Com, k, T_WD_In, T_WD_Out, error-free, worst case In and Out, two watchdogs and actuator,
# margin of 100 ms, cycles that may be lost within 100 ms
TABLE = [
    (0.1, 2, "14.9", "12.5", "72.4", "75.1", "78.7", "49.8", 6.7, 865),
    (1, 2, "19.2", "16.8", "76.0", "81.2", "84.8", "58.4", 5.2, 83),
    (1, 3, "21.6", "19.2", "78.0", "84.6", "88.2", "63.2", 4.6, 81),
    (4, 2, "33.6", "31.2", "88.0", "101.6", "105.2", "87.2", 3.0, 17),
    (10, 2, "62.4", "60.0", "112.0", "142.4", "146.0", "144.8", 1.6, 4),
    (10, 3, "86.4", "84.0", "132.0", "176.4", "180.0", "192.8", 1.16, 2),
]


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row[0]}ms-k{row[1]}")
def test_the_worked_table(row: tuple[float, int, str, str, str, str, str, str, float, int]) -> None:
    cycle, k, wd_in, wd_out, free, wc_in, wc_out, beckhoff, margin, lost = row
    t = parts(cycle, k)
    recommended = max(watchdog_input(t), watchdog_output(t))
    assert f"{watchdog_input(t):.1f}" == wd_in
    assert f"{watchdog_output(t):.1f}" == wd_out
    assert f"{error_free(t):.1f}" == free
    assert f"{worst_case_input(t, watchdog_input(t)):.1f}" == wc_in
    assert f"{worst_case_output(t, watchdog_output(t)):.1f}" == wc_out
    assert f"{beckhoff_worst_case(recommended, recommended, t.actuator):.1f}" == beckhoff
    assert round(100 / recommended, 2 if margin == 1.16 else 1) == margin
    trip = max(round_trip_input(t), round_trip_output(t))
    assert lost_frames_survived(100, trip, cycle) == lost


def test_the_examples_of_the_manuals() -> None:
    t = PartTimes(sensor=5, input=4, logic=10, output=3, actuator=20, cycle=1)
    assert beckhoff_typical(t) == 48
    assert beckhoff_worst_case(15, 15, 20) == 50
    assert beckhoff_worst_case(100, 100, 20) == 220  # left at 100 ms, whatever the cycle


def test_a_watchdog_that_is_too_short_survives_nothing() -> None:
    assert lost_frames_survived(10, 16, 1) == 0


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"input": -1.0}, "(0.0, -1.0, 2.0, 3.0, 0.0, 1.0)"),
        ({"cycle": 0.0}, "(0.0, 4.0, 2.0, 3.0, 0.0, 0.0)"),
        ({"logic": math.nan}, "(0.0, 4.0, nan, 3.0, 0.0, 1.0)"),
        ({"output": math.inf}, "(0.0, 4.0, 2.0, inf, 0.0, 1.0)"),
        ({"sensor": -0.1}, "(-0.1, 4.0, 2.0, 3.0, 0.0, 1.0)"),
        ({"actuator": -0.1}, "(0.0, 4.0, 2.0, 3.0, -0.1, 1.0)"),
        ({"cycles_in": -1}, "-1, 2"),
        ({"cycles_out": -1}, "2, -1"),
    ],
)
def test_what_is_no_time_is_refused(wrong: dict[str, float], told: str) -> None:
    right = {"input": 4.0, "logic": 2.0, "output": 3.0, "cycle": 1.0}
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - the whole text follows
        PartTimes(**{**right, **wrong})  # type: ignore[arg-type]
    counts = min(wrong) in ("cycles_in", "cycles_out")
    words = "times are finite and not negative, the cycle is not 0: "
    assert str(refused.value) == ("bus cycles are not negative: " if counts else words) + told
