"""Campaigns: every class on our own ends, ends with one thing forgotten, numbers that add up."""

import math
import random
from itertools import combinations

import pytest
from fsoe.devices import (
    ignores_address,
    ignores_crc,
    ignores_sequence,
    ignores_watchdog,
    strange_main,
    strange_sub,
    strange_sub_that_takes_data,
)
from fsoe.links import make_link

from fsoe_net.errors import ConfigError
from fsoe_net.fsoe import Chain, Command, decode_pdu, frame_length
from fsoe_net.fsoe.campaign import trials as campaign_module
from fsoe_net.fsoe.campaign.channel import Way
from fsoe_net.fsoe.campaign.fault_classes import (
    CATALOGUE,
    Injection,
    Strangers,
    bit_error,
    bit_error_count,
    code_distance,
)
from fsoe_net.fsoe.campaign.faults import (
    Alternate,
    Flip,
    Freeze,
    Late,
    Slip,
    Swap,
    Torn,
    compose,
    shortened,
)
from fsoe_net.fsoe.campaign.judge import Outcome, judge
from fsoe_net.fsoe.campaign.shrink import shrink
from fsoe_net.fsoe.campaign.statistics import count_interval
from fsoe_net.fsoe.campaign.trials import CampaignConfig, Trials, merge, run_trials, trial_count
from fsoe_net.fsoe.campaign.walk import Link, Walker
from fsoe_net.fsoe.campaign.witness import Witness, collision
from fsoe_net.fsoe.recording.replay import replay

DRAWN = [name for name in CATALOGUE if name != "bit_errors"]
SIZES = [(1, 1), (2, 2), (6, 4), (1, 14)]


def _config(*sizes, seed=1, **changes) -> CampaignConfig:
    return CampaignConfig(links=(make_link(*(sizes or (2, 2)), **changes),), seed=seed)


def _counts(result):
    return result.detected, result.tolerated, result.collisions, result.wrongly_accepted


@pytest.mark.parametrize("sizes", SIZES, ids=str)
@pytest.mark.parametrize("name", DRAWN)
def test_our_ends_withstand_every_class(name, sizes):
    result = run_trials(_config(*sizes), name, range(400))
    assert result.wrongly_accepted == 0, result.failures
    assert sum(_counts(result)) == result.injected == 400
    assert sum(result.codes.values()) == result.detected
    assert result.passed
    if name == "late_cycle":
        assert result.tolerated == 400
    elif name == "torn_copy" and sizes == (1, 1):
        assert result.detected > 150  # the frame before differs little
    else:
        assert result.detected > 300


@pytest.mark.parametrize("changes", [{"delay": (2, 3)}, {"app": b"\1\2\3", "cycle_ns": 250_000}])
@pytest.mark.parametrize("name", DRAWN)
def test_other_cycles_delays_and_parameters(name, changes):
    assert run_trials(_config(2, 6, watchdog_ms=30, **changes), name, range(120)).passed


def test_faults_that_happen_together():
    result = run_trials(_config(), "loss+corruption+double_writer", range(200))
    assert result.passed
    assert result.injected == 200
    assert result.interval is None
    for bad in ("loss+", "nothing", "loss+bit_errors", ""):
        with pytest.raises(ConfigError, match="no class"):
            run_trials(_config(), bad, range(1))


def test_the_watchdog_is_the_limit():
    late = run_trials(_config(), "delay", range(600))
    assert 0.9 < late.latency_max_share <= 1
    result = run_trials(_config(), "loss", range(600))
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
        config = _config(sub_factory=device)
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


def test_results_that_do_not_belong_together():
    with pytest.raises(ConfigError, match="one class"):
        merge([run_trials(_config(), name, range(1)) for name in ("loss", "delay")])
    with pytest.raises(ConfigError, match="one class"):
        merge([])
    with pytest.raises(ConfigError, match="at least one connection"):
        CampaignConfig(links=())


# ------------------------------------------------------------------ ends with something forgotten


@pytest.mark.parametrize(
    ("device", "name", "text"),
    [
        (ignores_crc, "corruption", "accepted"),
        (ignores_crc, "bit_errors", "accepted"),
        (ignores_sequence, "repetition", "accepted"),
        (ignores_sequence, "stale_copy", "accepted"),
        (ignores_watchdog, "delay", "still valid after 21 ms"),
        (ignores_watchdog, "loss", "still valid after 21 ms"),
    ],
)
def test_what_a_device_forgot_is_found(device, name, text):
    result = run_trials(_config(sub_factory=device), name, range(300))
    assert result.wrongly_accepted > 50
    assert not result.passed
    assert len(result.failures) == 5
    assert all(text in failure.reason for failure in result.failures)
    assert result.failures[0].trial < result.failures[-1].trial < 300


def test_a_device_that_answers_to_any_address():
    config = _config(sub_factory=ignores_address)
    result = run_trials(config, "addressing", range(400))
    assert 4 < result.wrongly_accepted < 30
    assert all("does not belong" in failure.reason for failure in result.failures)
    small = shrink(Trials(config, "addressing").case(result.failures[0].trial))
    first = replay(small.lines).differences[0]
    assert first.got.startswith("2a06")
    assert 6 in run_trials(_config(), "addressing", range(400)).codes


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
    result = run_trials(_config(**factories), name, range(40))
    assert result.wrongly_accepted == 0, result.failures
    assert result.injected == 40


def test_valid_data_which_nobody_sent():
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

    found = run_trials(_config(sub_factory=Invents), "late_cycle", range(40))
    assert "were not sent" in found.failures[0].reason
    found = run_trials(_config(sub_factory=KeepsValid), "corruption", range(40))
    assert "after the end has left state Data" in found.failures[0].reason


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

    result = run_trials(_config(sub_factory=Peeks), "corruption", range(60))
    assert any("without an answer" in failure.reason for failure in result.failures)


# ------------------------------------------------------------------------------- true collisions


def _scene_in_data(link: Link, number: int = 0):
    walker, rng = Walker(link, 1), random.Random(number)
    return walker.scene(number, rng, data_to=Way(number % 2))


def _colliding(scene, rng):
    """The frame with other data, and the CRC its receiver wants for them."""
    end = scene.channel.ends[scene.way]
    chain = Chain(last=end._chain.last, own=end._chain.peer, tx_sequence=end._chain.rx_sequence)
    pdu = decode_pdu(scene.frame)
    return chain.send(Command.PROCESS_DATA, rng.randbytes(len(pdu.safe_data)), pdu.connection_id)


@pytest.mark.parametrize("sizes", SIZES, ids=str)
def test_a_true_collision_is_shown_to_be_one(sizes):
    link, rng = make_link(*sizes), random.Random(5)
    for number in range(30):
        scene = _scene_in_data(link, number)
        frame = _colliding(scene, rng)
        start = scene.channel.cycle
        swap = Swap(way=scene.way, start=start, until=start + 1, frame=frame)
        finding = judge(scene, Injection(faults=(swap,), chance=2**-16), link.watchdog_ns)
        wanted = Outcome.TOLERATED if frame == scene.frame else Outcome.COLLISION
        assert finding.verdict is wanted, finding.reason
        assert finding.exposed is (wanted is Outcome.COLLISION)


def test_a_collision_is_none_with_another_conn_id_or_command():
    scene = _scene_in_data(make_link())
    chain = scene.channel.ends[scene.way]._chain
    frame = _colliding(scene, random.Random(1))
    proof = collision(chain, "sub", frame, scene.frame)
    assert (proof.old_crc, proof.sequence) == (chain.last, chain.rx_sequence)
    other = bytes((Command.PARAMETER,)) + frame[1:]
    assert not collision(chain, "sub", other, scene.frame)
    assert not collision(chain, "sub", frame[:-2] + b"\1\1", scene.frame)
    assert not collision(chain, "sub", frame + bytes(4), scene.frame)
    assert not collision(chain, "sub", frame[:1] + b"\0\0" + frame[3:], scene.frame)


@pytest.mark.parametrize("sizes", [(1, 1), (2, 2), (1, 6)], ids=str)
def test_the_witness_follows_the_chain_from_outside(sizes):
    channel = make_link(*sizes).channel(4)
    for n in range(400):
        if n == 150:
            channel.main.request_reset()
        if n == 250:
            channel.sub.request_reset()
        channel.turn()
        for way in Way:
            witness = Witness(
                channel.base[way], is_main=way is Way.TO_MAIN, exchanges=channel.exchanges[way]
            )
            assert witness.chain == channel.ends[way]._chain


def test_the_witness_does_not_explain_what_does_not_fit():
    channel = make_link().channel(4)
    channel.run(40)
    rows = channel.exchanges[Way.TO_SUB]
    seen, sent = rows[-1]
    for wrong in ((seen[:1] + b"\x55" + seen[2:], sent), (seen, sent[:1] + b"\x55" + sent[2:])):
        assert Witness(Chain(), is_main=False, exchanges=[*rows[:-1], wrong]).chain is None
    assert Witness(Chain(), is_main=False, exchanges=[(None, sent), *rows]).chain is None


def test_collisions_come_as_often_as_they_should(monkeypatch):
    """With a CRC cut to its low 8 bits, one fault in 256 passes, and each is shown."""
    from fsoe_net.fsoe import chain as chain_module
    from fsoe_net.fsoe import crc
    from fsoe_net.fsoe.campaign import fault_classes, witness

    def short(*args):
        return tuple(value & 0xFF for value in crc.frame_crcs(*args))

    def short_block(*args):
        return crc.block_crc(*args) & 0xFF

    for module in (chain_module, witness, fault_classes):
        for name, value in (("frame_crcs", short), ("block_crc", short_block)):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, value)
    monkeypatch.setattr("fsoe_net.fsoe.instance.frame_crcs", short)
    result = run_trials(_config(), "repetition", range(6000))
    assert result.wrongly_accepted == 0
    low, high = count_interval(result.exposed / 256)
    assert low <= result.exposed_collisions <= high
    assert not result.rate_ok  # more than 2^-16 allows
    assert result.collisions >= result.exposed_collisions
    assert len(result.shown) == min(100, result.collisions)
    for row in result.shown:
        pdu, proof = decode_pdu(row.proof.frame), row.proof
        assert proof.frame != proof.right
        key = (proof.old_crc, pdu.connection_id, proof.sequence, pdu.command)
        assert short_block(*key, 0, pdu.safe_data) == pdu.crcs[0]


def test_the_seventeenth_bit_of_a_million():
    """What 10^6 faults are held to."""
    assert count_interval(10**6 / 65536) == (6, 26)


# ------------------------------------------------------------------------------------ statistics


@pytest.mark.parametrize("mean", [0.001, 0.1, 1, 3.3, 15.26, 200, 5000])
def test_interval_of_counts(mean):
    def below(n):  # P(X < n)
        return sum(math.exp(k * math.log(mean) - mean - math.lgamma(k + 1)) for k in range(n))

    low, high = count_interval(mean)
    assert below(low) <= 0.005 < below(low + 1)
    assert 1 - below(high + 1) <= 0.005 + 1e-12
    assert high == math.ceil(mean) or 1 - below(high) > 0.005
    assert count_interval(0) == (0, 0)


# ------------------------------------------------------------------------------------ bit errors


@pytest.mark.parametrize("data_bytes", [1, 2])
def test_distance_of_the_code(data_bytes):
    assert code_distance(data_bytes) == 6


def test_bit_errors_are_all_different_and_complete():
    link = make_link(1, 2)
    count = bit_error_count(link)
    assert trial_count(CampaignConfig(links=(link, link)), "bit_errors", 5) == count
    assert trial_count(CampaignConfig(links=(link,)), "loss", 5) == 5
    rows = [bit_error(link, n) for n in range(count)]
    to_sub = [mask for way, mask in rows if way is Way.TO_SUB]
    blocks = {mask for mask in to_sub if 0 < mask >> 8 < 1 << 24 and mask & 0xFF == 0}
    wanted = sum(math.comb(24, weight) for weight in range(1, 6))
    assert len(blocks) == wanted
    pairs = {1 << a | 1 << b for a, b in combinations(range(48), 2)}
    assert pairs <= set(to_sub)
    assert {1 << a for a in range(48)} <= set(to_sub)
    assert all(mask < 1 << 8 * frame_length(link.sizes[way]) for way, mask in rows)


def test_long_frames_take_the_patterns_in_turn():
    link = make_link(6, 6)
    hit = {(bit_error(link, n)[1].bit_length() - 9) // 32 for n in range(500, 800)}
    assert hit == {0, 1, 2}
    with pytest.raises(ConfigError, match="not so many"):
        Trials(CampaignConfig(links=(link,)), "bit_errors").case(10**9)


def test_bit_errors_within_the_distance_are_all_found():
    config = _config(1, 1)
    count = trial_count(config, "bit_errors", 0)
    for first in (0, count // 2 - 500, count - 1000):
        result = run_trials(config, "bit_errors", range(first, first + 1000))
        assert result.detected == 1000
        assert result.passed
        assert result.interval == (0, 0)


def test_a_collision_of_bit_errors_is_a_failure():
    result = run_trials(_config(1, 1), "bit_errors", range(1))
    result.collisions = 1
    assert not result.rate_ok
    assert not result.passed


# ------------------------------------------------------------------------------------ injectors


def _channel(cycles=40):
    channel = make_link().channel(3)
    channel.run(cycles)
    return channel


SPAN = {"way": Way.TO_SUB, "start": 40, "until": 43}


@pytest.mark.parametrize(
    ("fault", "shown"),
    [
        (Flip(**SPAN, mask=0x0100), b"\1\3\3\4\5\6\7"),
        (Swap(**SPAN, frame=b"abcdefg"), b"abcdefg"),
        (Torn(**SPAN, head_bytes=3), None),
        (Slip(**SPAN, shift=2), b"\3\4\5\6\7\0\0"),
        (Slip(**SPAN, shift=-2, beside=b"xyz"), b"xy\1\2\3\4\5"),
        (Slip(**SPAN, shift=99, beside=b"q"), b"q" * 7),
        (Alternate(**SPAN, frame=b"abcdefg"), b"abcdefg"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_injectors(fault, shown):
    channel, image = _channel(), b"\1\2\3\4\5\6\7"
    if shown is None:
        older = channel.image(Way.TO_SUB, 40)
        shown = image[:3] + older[3:]
    assert fault.apply(channel, image) == shown
    channel.cycle = 39
    assert fault.apply(channel, image) == image
    assert fault.next_change(channel) == 40
    channel.cycle = 43
    assert fault.apply(channel, image) == image
    assert fault.next_change(channel) == 43
    channel.cycle = 44
    assert fault.next_change(channel) is None
    assert shortened(fault, 1).until == 41
    assert shortened(fault, 7) is fault


def test_nothing_arrived_yet():
    channel = make_link().channel(3)
    span = {"way": Way.TO_SUB, "start": 0, "until": 9}
    for fault in (Flip(**span, mask=1), Torn(**span, head_bytes=2), Slip(**span, shift=1)):
        assert fault.apply(channel, None) is None
    for fault in (Freeze(**span), Late(**span, cycles=3)):
        assert fault.apply(channel, b"x") is None


def test_loss_and_delay_hold_what_was_there_before():
    channel = _channel()
    before = channel.image(Way.TO_SUB, 39)
    channel.faults = compose(Freeze(**SPAN), ())
    for _ in range(3):
        channel.turn()
        assert channel.turn()[0] == before
    channel.turn()
    assert channel.turn()[0] != before
    channel = _channel()
    late = Late(way=Way.TO_SUB, start=40, until=60, cycles=4)
    channel.faults = compose(late)
    images = []
    for _ in range(14):
        channel.turn()
        images.append(channel.turn()[0])
    for n, image in enumerate(images):
        assert image == channel.image(Way.TO_SUB, max(39, 36 + n))


def test_what_changes_when_is_told_in_advance():
    """`next_change` never comes too late; otherwise idle time would be left out that is none."""
    for fault in (
        Freeze(way=Way.TO_SUB, start=42, until=50),
        Late(way=Way.TO_SUB, start=42, until=60, cycles=7),
        Alternate(way=Way.TO_SUB, start=42, until=50, frame=b"abcdefg"),
        Swap(way=Way.TO_SUB, start=42, until=50, frame=b"abcdefg"),
    ):
        channel = _channel()
        channel.sent[Way.TO_SUB][-1] = (40, channel.newest(Way.TO_SUB))
        last = fault.apply(channel, channel.image(Way.TO_SUB, channel.cycle))
        for cycle in range(41, 70):
            channel.cycle = cycle
            due = fault.next_change(channel)
            image = fault.apply(channel, channel.image(Way.TO_SUB, cycle))
            assert image == last or due == cycle, (fault, cycle)
            last = image


def test_the_catalogue_draws_in_every_corner():
    """No class fails at any point of a run, the very first frames included."""
    link = make_link(1, 1, app=b"ab")
    strangers, rng = Strangers(link, 1), random.Random(2)
    walker = Walker(link, 1)
    walk = walker.walk(0)
    assert walk.startup[0].frame[0] == Command.RESET
    for name in DRAWN:
        for _ in range(300):
            scene = walker.scene(0, rng)
            made = CATALOGUE[name].make(rng, scene, strangers, 0)
            assert made is None or made.faults
    with pytest.raises(ConfigError, match="counted through"):
        CATALOGUE["bit_errors"].make(rng, scene, strangers, 0)


def test_no_suitable_point(monkeypatch):
    work = Trials(_config(), "loss")
    monkeypatch.setattr(campaign_module._Lane, "_draw", lambda *_: None)
    with pytest.raises(ConfigError, match="no point of the run"):
        work.case(0)


def test_sizes_of_a_link_must_agree():
    link = make_link(2, 2)
    with pytest.raises(ConfigError, match="differ"):
        Link(name="x", main=link.main, sub=make_link(2, 4).sub, other=link.other)
