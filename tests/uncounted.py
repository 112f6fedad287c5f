"""Tests that reach nothing of their own are not counted: counting makes them several times slower.

A marker, ``uncounted``, for tests that only compute, much: neither their lines count where
``scripts/coverage`` runs them, nor those of the programs that they start.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

_START = "COVERAGE_PROCESS_START"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Stop counting while a marked test runs."""
    if _START not in os.environ or item.get_closest_marker("uncounted") is None:
        return (yield)
    from coverage import Coverage

    counter = Coverage.current()
    if counter is None:
        return (yield)
    start = os.environ.pop(_START)
    counter.stop()
    try:
        return (yield)
    finally:
        counter.start()
        os.environ[_START] = start
