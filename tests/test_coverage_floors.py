"""How scripts/coverage compares folders with their floors."""

from __future__ import annotations

from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "scripts" / "coverage"
FLOORS = {"fsoe_net/plan": {"lines": 95.0}, "master_core/src/rt": {"lines": 95.0, "branches": 90.0}}
GOOD = {"fsoe_net/plan": {"lines": 95.0}, "master_core/src/rt": {"lines": 95.0, "branches": 90.0}}


@pytest.fixture(scope="module")
def script():
    loader = SourceFileLoader("scripts_coverage", str(SCRIPT))
    module = module_from_spec(spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("found", "low"),
    [
        ({}, []),
        (
            {"fsoe_net/plan": {"lines": 94.9}},
            ["fsoe_net/plan: 94.9 % of lines, at least 95.0 %"],
        ),
        (
            {"master_core/src/rt": {"lines": 99.0, "branches": 89.9}},
            ["master_core/src/rt: 89.9 % of branches, at least 90.0 %"],
        ),
        ({"fsoe_net/new": {"lines": 100.0}}, ["fsoe_net/new: not in coverage.yaml"]),
    ],
)
def test_a_folder_has_its_floor(script, found, low):
    assert script.below(FLOORS, GOOD | found) == low


def test_a_folder_where_nothing_was_counted_is_too_low(script):
    (line,) = script.below(FLOORS, {"master_core/src/rt": FLOORS["master_core/src/rt"]})
    assert line == "fsoe_net/plan: 0 % of lines, at least 95.0 %"


def test_percent_are_never_rounded_up(script):
    counts = {"lines": 1000, "lines_hit": 999, "branches": 3000, "branches_hit": 2999}
    assert script.percent(counts) == {"lines": 99.9, "branches": 99.9}
    assert script.percent({"lines": 10, "lines_hit": 9}) == {"lines": 90.0}  # no branches


def test_a_file_counts_for_its_folder(script):
    assert script.folder_of("master_core/src/plan/prove_copies.c") == "master_core/src/plan"
    assert script.folder_of("master_core/src/backends/soem/find.c") == "master_core/src/backends"
    assert script.folder_of("fsoe_net/live/console/console.py") == "fsoe_net/live"
    assert script.folder_of("fsoe_net/version.py") == "fsoe_net"
