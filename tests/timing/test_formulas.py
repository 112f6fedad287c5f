"""The printed tables of the sources, to the printed digit."""

from __future__ import annotations

import math

import pytest

from fsoe_net.project.self_test.formulas import timing
from fsoe_net.timing.formulas import PartTimes, beckhoff_worst_case, lost_frames_survived


@pytest.mark.shows("R9")
def test_the_worked_tables() -> None:
    rows = list(timing())
    assert len(rows) > 50
    assert [row for row in rows if row.got != row.expected] == []


@pytest.mark.shows("R9")
def test_the_examples_of_the_manuals() -> None:
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
