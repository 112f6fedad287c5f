"""Tests that reach nothing of their own are not counted: counting makes them several times slower.

A marker, ``uncounted``, for tests that only compute, much, and `not_counted` for a part of one:
neither their lines count where ``scripts/coverage`` runs them, nor those of the programs that they
start.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import pytest

_START = "COVERAGE_PROCESS_START"


@contextlib.contextmanager
def not_counted() -> Iterator[None]:
    """Stop counting for a block."""
    counter = None
    if _START in os.environ:
        from coverage import Coverage

        counter = Coverage.current()
    if counter is None:
        yield
        return
    start = os.environ.pop(_START)
    counter.stop()
    try:
        yield
    finally:
        counter.start()
        os.environ[_START] = start


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Stop counting while a marked test runs."""
    marked = item.get_closest_marker("uncounted") is not None
    with not_counted() if marked else contextlib.nullcontext():
        return (yield)
