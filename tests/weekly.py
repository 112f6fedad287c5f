"""Tests that the weekly run adds: `scripts/test` leaves out what has the marker ``weekly``.

Such a test goes further where others have been: more values of a list whose first ones are in every
run, a search through all states, a whole build for one more version of ROS.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import pytest

_WEEKLY = bool(os.environ.get("FSN_WEEKLY"))


def examples(count: int) -> int:
    """Return how many examples Hypothesis draws: a third of those of the weekly run."""
    return count if _WEEKLY else -(-count // 3)


def first(count: int, values: Iterable[object]) -> list[Any]:
    """Return values of one parameter: the first ones in every run, the others in the weekly one."""
    rows = list(values)
    later = [pytest.param(value, marks=pytest.mark.weekly) for value in rows[count:]]
    return [*rows[:count], *later]
