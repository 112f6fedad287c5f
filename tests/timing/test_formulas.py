"""The printed tables of the sources, to the printed digit."""

from __future__ import annotations

import math

import pytest

from fsoe_net.self_test.formulas import timing
from fsoe_net.timing.formulas import SignalWay, beckhoff_worst_case, lost_frames_survived


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


@pytest.mark.parametrize("wrong", [-1.0, math.nan, math.inf])
@pytest.mark.parametrize(
    "field", ["device", "logic", "to_logic", "from_logic", "cycle", "watchdog"]
)
def test_a_way_refuses_what_is_not_a_time(field: str, wrong: float) -> None:
    with pytest.raises(ValueError, match=f"times are finite and not negative: .*{wrong}"):
        SignalWay(**{"device": 4.0, "logic": 2.0, field: wrong})
