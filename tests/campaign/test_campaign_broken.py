"""Every broken engine is noticed, and for its own reason; the right ones pass with any seed."""

import re

import pytest
from fsoe.broken_engines import BROKEN, HANDLERS
from networks import example
from weekly import first

from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.campaign.trials import CampaignConfig, ClassResult, run_trials
from fsoe_net.fsoe import sub_instance
from fsoe_net.simulate.campaign import campaign_links

FAULTS = 400


def _config(seed=1):
    return CampaignConfig(links=campaign_links(example("estop")), seed=seed)


@pytest.mark.shows("R19")
@pytest.mark.parametrize("broken", [*BROKEN, *HANDLERS], ids=lambda row: row.what)
@pytest.mark.uncounted
def test_a_broken_engine_is_noticed(broken, monkeypatch):
    if broken.name:
        monkeypatch.setattr(broken.where, broken.name, broken.by)
    else:
        monkeypatch.setitem(sub_instance._HANDLERS, broken.where, broken.by)
    result = run_trials(_config(), broken.shown, range(FAULTS))
    assert not result.passed
    reasons = [failure.reason for failure in result.failures]
    assert any(re.search(broken.reason, reason) for reason in reasons), reasons


@pytest.mark.parametrize("seed", first(1, [1, 2, 3]))
@pytest.mark.parametrize("name", [name for name in CATALOGUE if name != "bit_errors"])
@pytest.mark.uncounted
def test_the_right_ends_pass_with_any_seed(name, seed):
    result = run_trials(_config(seed), name, range(FAULTS))
    assert result.passed, (result.tolerated, result.most_tolerated, result.failures)


def test_an_end_that_drops_wrong_frames_tolerates_too_much():
    """Even when nothing is said against any one reaction, the share gives it away."""
    row = ClassResult(name="corruption", injected=300, detected=184, tolerated=116)
    assert row.most_tolerated < 45
    assert not row.passed
    assert ClassResult(name="corruption", injected=300, detected=293, tolerated=7).passed
