"""How scripts/coverage holds folders to their baseline."""

from __future__ import annotations

from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "scripts" / "coverage"
BASELINE = {
    "slack": {"real_time": 0.3, "others": 0.1},
    "real_time": ["fsoe_net/run"],
    "folders": {
        "fsoe_net/run": {"branches": 90.0, "lines": 95.0},
        "fsoe_net/plan": {"branches": 90.0, "lines": 95.0},
    },
}


@pytest.fixture(scope="module")
def script():
    loader = SourceFileLoader("scripts_coverage", str(SCRIPT))
    module = module_from_spec(spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("folder", "branches", "lines", "said"),
    [
        ("fsoe_net/plan", 90.0, 95.0, []),
        ("fsoe_net/plan", 89.9, 94.9, []),
        ("fsoe_net/plan", 89.8, 99.0, ["fsoe_net/plan: 89.8 % of branches, 90.0 % before"]),
        ("fsoe_net/run", 89.7, 94.7, []),
        ("fsoe_net/run", 95.0, 94.6, ["fsoe_net/run: 94.6 % of lines, 95.0 % before"]),
    ],
)
def test_a_folder_may_be_below_by_the_slack_only(script, folder, branches, lines, said):
    assert script.below(folder, {"branches": branches, "lines": lines}, BASELINE) == said


def test_a_new_folder_needs_its_figures(script):
    (said,) = script.below("fsoe_net/new", {"branches": 100.0, "lines": 100.0}, BASELINE)
    assert said == "fsoe_net/new: not in coverage.yaml; scripts/coverage report --raise adds it"


def test_percent_are_never_rounded_up(script):
    counts = script.Counts(lines=1000, lines_hit=999, branches=3000, branches_hit=2999)
    assert script.percent(counts) == {"branches": 99.9, "lines": 99.9}
    assert script.percent(script.Counts(lines=10, lines_hit=9)) == {"lines": 90.0}  # no branches


def test_a_file_counts_for_its_folder(script):
    assert script.folder_of("master_core/src/plan/prove_copies.c", 3) == "master_core/src/plan"
    assert script.folder_of("master_core/src/backends/soem/find.c", 3) == "master_core/src/backends"
    assert script.folder_of("fsoe_net/live/console/console.py", 2) == "fsoe_net/live"
