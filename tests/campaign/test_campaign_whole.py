"""Campaigns as a whole: which faults are drawn, what becomes of each, and all that is counted.

A trial depends on connections, class, seed and number only, so what was read once stays.
"""

from __future__ import annotations

import pytest
from campaign.lossy_links import make_link
from changed import compare, whole
from fsoe.devices import strange_sub

from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.campaign.trials import CampaignConfig, Case, Trials, run_trials

SMALL = make_link(1, 1)
LARGE = make_link(2, 6, app=b"\1\2\3", delay=(2, 3), watchdog_ms=30)
CONFIG = CampaignConfig(links=(SMALL, LARGE), seed=3)
NAMES = [*CATALOGUE, "loss+corruption+double_writer", "delay+insertion"]


def drawn(case: Case) -> str:
    """Return the fault of a case."""
    one = case.injection
    words = [w for w in ("patient", "signed", "stays", "miswired", "former") if getattr(one, w)]
    words += [str(one.application)] if one.application is not None else []
    return f"{case.link.name}, chance {one.chance}, {' '.join(words)}: {one.faults}"


@pytest.mark.parametrize("name", NAMES)
def test_each_fault_and_what_becomes_of_it(name: str) -> None:
    work = Trials(CONFIG, name)
    rows = []
    for number in range(8):
        case, found = work.run(number)
        rows.append((f"{number}", f"{drawn(case)}\n{whole(found)}"))
    compare(__file__, f"tried {name}", rows)


@pytest.mark.weekly
@pytest.mark.parametrize("name", NAMES)
def test_each_change_that_is_drawn(name: str) -> None:
    """Points and faults of many runs; a foreign end is brought to a point by a run of its own."""
    foreign = CampaignConfig(links=(make_link(1, 2, sub_factory=strange_sub),), seed=5)
    numbers = {CONFIG: range(0, 30_000, 331), foreign: range(0, 9_000, 2200)}
    rows = []
    for config, chosen in numbers.items():
        work = Trials(config, name)
        for number in chosen:
            case = work.case(number)
            scene = case.scene
            place = (scene.channel.cycle, scene.way, scene.frame.hex(), scene.in_data, scene.index)
            times = (scene.watchdog_cycles, scene.startup_cycles, len(scene.frames))
            rows.append((f"{case.link.name} {number}", f"{place} {times} {drawn(case)}"))
    compare(__file__, f"drawn {name}", rows)


@pytest.mark.uncounted
@pytest.mark.parametrize("name", NAMES)
def test_all_that_is_counted(name: str) -> None:
    done: list[int] = []
    result = run_trials(CONFIG, name, range(150), done.append)
    assert done == list(range(150))
    judged = (result.interval, result.rate_ok, result.most_tolerated, result.failed, result.passed)
    compare(__file__, f"counted {name}", [("result", whole(result)), ("judged", whole(judged))])
