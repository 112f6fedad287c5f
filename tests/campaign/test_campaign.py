"""Campaigns: every class on our own ends, ends with one thing forgotten, numbers that add up."""

from collections import Counter
from dataclasses import replace

import pytest
from campaign.lossy_links import DRAWN, SIZES, make_config, make_link
from fsoe.devices import (
    ignores_address,
    ignores_crc,
    ignores_sequence,
    ignores_watchdog,
    main_ignores_crc,
    strange_main,
    strange_sub,
    strange_sub_that_takes_data,
)
from weekly import first

from fsoe_net.campaign import trials as campaign_module
from fsoe_net.campaign.clean_run import TrialConnection
from fsoe_net.campaign.collision_proof import Collision
from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.campaign.recording.replay import replay
from fsoe_net.campaign.shrink import shrink
from fsoe_net.campaign.trials import (
    _SUMS,
    CampaignConfig,
    ClassResult,
    Failure,
    Shown,
    Trials,
    class_names,
    merge,
    run_trials,
    trial_count,
)
from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import Command, decode_pdu


def _counts(result):
    return result.detected, result.tolerated, result.collisions, result.failed


@pytest.mark.shows("R19")
@pytest.mark.parametrize("sizes", first(1, SIZES), ids=str)
@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.uncounted
def test_our_ends_withstand_every_class(name, sizes):
    result = run_trials(make_config(*sizes), name, range(400))
    assert result.failed == 0, result.failures
    assert sum(_counts(result)) == result.injected == 400
    assert sum(result.codes.values()) == result.detected
    assert result.passed
    if name == "late_cycle":
        assert result.tolerated == 400
    elif name == "torn_copy" and sizes == (1, 1):
        assert result.detected > 150  # the frame before differs little
    else:
        assert result.detected >= 400 - result.most_tolerated


@pytest.mark.parametrize("changes", [{"delay": (2, 3)}, {"app": b"\1\2\3", "cycle_ns": 250_000}])
@pytest.mark.parametrize("name", DRAWN)
def test_other_cycles_delays_and_parameters(name, changes):
    assert run_trials(make_config(2, 6, watchdog_ms=30, **changes), name, range(120)).passed


def test_faults_that_happen_together():
    result = run_trials(make_config(), "loss+corruption+double_writer", range(200))
    assert result.passed
    assert result.injected == 200
    assert result.interval is None
    for bad in ("loss+", "nothing", "loss+bit_errors", ""):
        with pytest.raises(ConfigError, match="not a class"):
            run_trials(make_config(), bad, range(1))


def test_the_watchdog_is_the_limit():
    late = run_trials(make_config(), "delay", range(600))
    assert 0.9 < late.latency_max_share <= 1
    result = run_trials(make_config(), "loss", range(600))
    assert set(result.codes) <= {5, -1}
    assert 0.9 < result.latency_max_share <= 1
    assert result.latency_max_ns <= 20_000_000
    assert result.tolerated > 20  # the short ones


def test_trials_depend_on_nothing_but_their_number():
    links = make_link(2, 2), make_link(1, 6)
    config = CampaignConfig(links=links, seed=4)
    whole = run_trials(config, "masquerade", range(300))
    parts = [run_trials(config, "masquerade", range(a, a + 100)) for a in (200, 0, 100)]
    assert merge(parts) == whole
    reseeded = run_trials(CampaignConfig(links=links, seed=5), "masquerade", range(300))
    assert reseeded != whole
    work = Trials(config, "insertion")
    forward = [work.run(n)[1] for n in range(40)]
    backward = [work.run(n)[1] for n in reversed(range(40))][::-1]
    assert forward == backward


def test_foreign_ends_repeat_their_trials_too():
    for device in (ignores_crc, strange_sub):
        config = make_config(sub_factory=device)
        backward = [Trials(config, "insertion").run(n)[1] for n in (2500, 1100, 3)]
        work = Trials(config, "insertion")
        assert [work.run(n)[1] for n in (3, 1100, 2500)] == backward[::-1]


def test_trials_are_dealt_out_to_the_connections():
    links = tuple(make_link(2, size) for size in (2, 4, 6))
    work = Trials(CampaignConfig(links=links), "loss")
    order = list(work.order(range(5, 20)))
    assert sorted(order) == list(range(5, 20))
    assert [work.case(n).link for n in (0, 1, 2, 3)] == [*links, links[0]]
    seen = [n % 3 for n in order]
    assert seen == sorted(seen)


def test_parts_are_put_together():
    proof = Collision(end="sub", frame=b"\1", right=b"\2", old_crc=3, sequence=4)
    parts = [
        ClassResult(
            name="loss",
            **{key: n * 10 + k for k, key in enumerate(_SUMS)},
            codes=Counter({5: n, -1: 1}),
            latency_min_ns=None if n == 2 else 100 * n,
            latency_max_ns=1000 - n,
            latency_max_share=0.1 * n,
            expected=0.1 * n,
            failures=[Failure(trial=9 * k - n, link="a", reason=f"r{n}{k}") for k in range(2)],
            shown=[Shown(trial=9 - n, link="a", proof=proof)],
        )
        for n in (1, 2, 3)
    ]
    made = merge(parts)
    assert made == merge(parts[::-1])
    assert [getattr(made, key) for key in _SUMS] == [60 + 3 * k for k in range(len(_SUMS))]
    assert made.codes == Counter({5: 6, -1: 3})
    assert (made.latency_min_ns, made.latency_max_ns) == (100, 999)
    assert made.latency_max_share == pytest.approx(0.3)
    assert made.expected == pytest.approx(0.6)
    assert [f.trial for f in made.failures] == [-3, -2, -1, 6, 7]
    assert [one.trial for one in made.shown] == [6, 7, 8]


def test_bit_errors_go_to_the_first_connection_with_such_a_frame():
    links = tuple(replace(make_link(*s), name=n) for n, s in (("a", (1, 1)), ("b", (1, 1))))
    config = CampaignConfig(links=(*links, make_link(1, 2)))
    count = trial_count(config, "bit_errors", 0)
    work = Trials(config, "bit_errors")
    assert [work.case(n).link.name for n in (0, count - 1)] == ["a", "link 1x2"]
    assert list(work.order(range(3, 6))) == [3, 4, 5]


def test_names_of_classes():
    assert class_names("all") == tuple(CATALOGUE)
    assert class_names("loss, delay+torn_copy,delay") == ("loss", "delay+torn_copy", "delay")
    for bad in ("", "los", "xyz", "all,loss", "loss,loss", "loss+loss", "bit_errors+loss"):
        with pytest.raises(ValueError, match=r"^.{9}"):
            class_names(bad)
    with pytest.raises(ValueError, match="named twice"):
        class_names("loss+delay,delay+loss")


def test_results_that_do_not_belong_together():
    with pytest.raises(ConfigError, match="one class"):
        merge([run_trials(make_config(), name, range(1)) for name in ("loss", "delay")])
    with pytest.raises(ConfigError, match="one class"):
        merge([])
    with pytest.raises(ConfigError, match="at least one connection"):
        CampaignConfig(links=())


def test_no_suitable_point(monkeypatch):
    work = Trials(make_config(), "loss")
    monkeypatch.setattr(campaign_module._Lane, "_draw", lambda *_: None)
    with pytest.raises(ConfigError, match="no point of the run"):
        work.case(0)


def test_sizes_of_a_link_must_agree():
    link = make_link(2, 2)
    with pytest.raises(ConfigError, match="differ"):
        TrialConnection(name="x", main=link.main, sub=make_link(2, 4).sub, other=link.other)


# ------------------------------------------------------------------ ends with something forgotten


@pytest.mark.shows("R19")
@pytest.mark.parametrize(
    ("device", "name", "text"),
    [
        (ignores_crc, "corruption", "accepted"),
        (ignores_crc, "bit_errors", "accepted"),
        (main_ignores_crc, "corruption", "accepted"),
        (ignores_sequence, "repetition", "accepted"),
        (ignores_sequence, "stale_copy", "accepted"),
        (ignores_watchdog, "delay", "still valid after 21 ms"),
        (ignores_watchdog, "loss", "still valid after 21 ms"),
    ],
)
def test_an_object_that_a_device_lost_is_found(device, name, text):
    side = "main_factory" if issubclass(device, MainInstance) else "sub_factory"
    result = run_trials(make_config(**{side: device}), name, range(300))
    assert result.failed > 50
    assert not result.passed
    assert len(result.failures) == 5
    assert all(text in failure.reason for failure in result.failures), result.failures
    assert result.failures[0].trial < result.failures[-1].trial < 300


def test_a_device_that_answers_to_any_address():
    config = make_config(sub_factory=ignores_address)
    result = run_trials(config, "addressing", range(400))
    assert 4 < result.wrongly_accepted < 30
    wanted = "Reset 6 (wrong FSoE address) is due"
    assert all(wanted in failure.reason for failure in result.failures)
    small = shrink(Trials(config, "addressing").case(result.failures[0].trial))
    first = replay(small.lines).differences[0]
    assert first.got.startswith("2a06")
    assert 6 in run_trials(make_config(), "addressing", range(400)).codes


@pytest.mark.uncounted
@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.parametrize(
    "factories",
    [
        {"sub_factory": strange_sub},
        {"sub_factory": strange_sub_that_takes_data},
        {"main_factory": strange_main},
    ],
    ids=["sub", "sub with data", "main"],
)
def test_right_strangers_pass(factories, name):
    result = run_trials(make_config(**factories), name, range(40))
    assert result.failed == 0, result.failures
    assert result.injected == 40


def test_valid_data_which_no_one_sent():
    class Invents(strange_sub):
        @property
        def received_safe_data(self):
            data = super().received_safe_data
            return data[:1] + b"\x77" if self.data_valid else data

    class KeepsValid(strange_sub):
        last = b"\0\0"

        @property
        def data_valid(self):
            self.once = getattr(self, "once", False) or super().data_valid
            return self.once

        @property
        def received_safe_data(self):
            self.last = super().received_safe_data if super().data_valid else self.last
            return self.last

    found = run_trials(make_config(sub_factory=Invents), "late_cycle", range(40))
    assert "not those of the frame accepted last" in found.failures[0].reason
    found = run_trials(make_config(sub_factory=KeepsValid), "corruption", range(40))
    assert "after the end has left state Data" in found.failures[0].reason


@pytest.mark.shows("R19")
def test_data_taken_from_a_refused_frame():
    class Peeks(strange_sub):
        data = b"\0\0"

        def step(self, now_ns, received):
            answer = super().step(now_ns, received)
            if received is not None and received[0] == Command.PROCESS_DATA:
                self.data = decode_pdu(received).safe_data
            return None if answer is not None and answer[:2] == b"\x2a\4" else answer

        @property
        def received_safe_data(self):
            return self.data

        @property
        def data_valid(self):
            return any(self.data)

    result = run_trials(make_config(sub_factory=Peeks), "corruption", range(60))
    assert any("without an answer" in failure.reason for failure in result.failures)
