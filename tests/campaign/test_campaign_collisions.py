"""Collisions of the CRC are shown to be some, and come as often as they should."""

import math
import random

import pytest
from campaign.lossy_links import SIZES, make_config, make_link
from fsoe.devices import strange_sub

from fsoe_net.campaign.channel import Channel, Way
from fsoe_net.campaign.clean_run import RunSource, Scene, TrialConnection
from fsoe_net.campaign.collision_proof import CollisionProof, collision
from fsoe_net.campaign.faults import Freeze, Swap
from fsoe_net.campaign.injection import Injection
from fsoe_net.campaign.judge import TrialFinding, TrialOutcome, judge
from fsoe_net.campaign.statistics import count_interval
from fsoe_net.campaign.trials import run_trials
from fsoe_net.fsoe.chain import Chain
from fsoe_net.fsoe.pdu import Command, decode_pdu


def _scene_in_data(link: TrialConnection, number: int = 0):
    walker, rng = RunSource(link, 1), random.Random(number)
    return walker.scene(number, rng, data_to=Way(number % 2))


def _colliding(scene, rng):
    """The frame with other data, and the CRC its receiver wants for them."""
    end = scene.channel.ends[scene.way]
    chain = Chain(last=end._chain.last, own=end._chain.peer, tx_sequence=end._chain.rx_sequence)
    pdu = decode_pdu(scene.frame)
    return chain.send(Command.PROCESS_DATA, rng.randbytes(len(pdu.safe_data)), pdu.connection_id)


@pytest.mark.parametrize("sizes", SIZES, ids=str)
@pytest.mark.uncounted
def test_a_true_collision_is_shown_to_be_one(sizes):
    link, rng = make_link(*sizes), random.Random(5)
    for number in range(30):
        scene = _scene_in_data(link, number)
        frame = _colliding(scene, rng)
        start = scene.channel.cycle
        swap = Swap(way=scene.way, start=start, until=start + 1, frame=frame)
        finding = judge(scene, Injection(faults=(swap,), chance=2**-16), link.watchdog_ns)
        wanted = TrialOutcome.TOLERATED if frame == scene.frame else TrialOutcome.COLLISION
        assert finding.verdict is wanted, finding.reason
        assert finding.exposed is (wanted is TrialOutcome.COLLISION)


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
        # Each is followed from its start: not all of the turns in Data, which are alike.
        for way in Way if n < 60 or n % 50 < 12 else ():
            proof = CollisionProof(
                channel.base[way], is_main=way is Way.TO_MAIN, exchanges=channel.exchanges[way]
            )
            assert proof.chain == channel.ends[way]._chain


def test_the_witness_does_not_explain_what_does_not_fit():
    channel = make_link().channel(4)
    channel.run(40)
    rows = channel.exchanges[Way.TO_SUB]
    seen, sent = rows[-1]
    for wrong in ((seen[:1] + b"\x55" + seen[2:], sent), (seen, sent[:1] + b"\x55" + sent[2:])):
        assert CollisionProof(Chain(), is_main=False, exchanges=[*rows[:-1], wrong]).chain is None
    assert CollisionProof(Chain(), is_main=False, exchanges=[(None, sent), *rows]).chain is None


def test_collisions_come_as_often_as_they_should(monkeypatch):
    """With a CRC cut to its low 8 bits, one fault in 256 passes, and each is shown."""
    from fsoe_net.campaign import collision_proof, fault_classes
    from fsoe_net.fsoe import chain as chain_module
    from fsoe_net.fsoe import crc

    def short(*args):
        return tuple(value & 0xFF for value in crc.frame_crcs(*args))

    def short_block(*args):
        return crc.block_crc(*args) & 0xFF

    for module in (chain_module, collision_proof, fault_classes):
        for name, value in (("frame_crcs", short), ("block_crc", short_block)):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, value)
    monkeypatch.setattr("fsoe_net.fsoe.instance.frame_crcs", short)
    uncached = chain_module.reset_frame.__wrapped__
    monkeypatch.setattr("fsoe_net.fsoe.instance.reset_frame", uncached)
    result = run_trials(make_config(seed=2), "repetition", range(6000))
    assert result.wrongly_accepted == 0
    low, high = count_interval(result.exposed / 256)
    assert low <= result.exposed_collisions <= high
    assert not result.rate_ok  # more than 2^-16 allows
    assert result.collisions >= result.exposed_collisions
    assert len(result.shown) == min(100, result.collisions)
    assert {row.link for row in result.shown} == {"link 2x2"}
    assert [row.trial for row in result.shown] == sorted({row.trial for row in result.shown})
    for row in result.shown:
        pdu, proof = decode_pdu(row.proof.frame), row.proof
        assert proof.frame != proof.right
        key = (proof.old_crc, pdu.connection_id, proof.sequence, pdu.command)
        assert short_block(*key, 0, pdu.safe_data) == pdu.crcs[0]


def test_the_seventeenth_bit_of_a_million():
    """What 10^6 faults are held to."""
    assert count_interval(10**6 / 65536) == (6, 26)


def test_ends_that_fall_silent():
    """No table says so, and no data are valid: that is noticed when the time is over."""

    class Silent(strange_sub):
        received_safe_data, data_valid = b"\0\0", False

        def step(self, now_ns, received):
            return None

    link = make_link()
    ends = Silent(link.sub), Silent(link.sub)
    channel = Channel(*ends, sizes=(2, 2))
    channel.cycle = 7
    scene = Scene(
        channel=channel,
        way=Way.TO_SUB,
        frame=b"",
        in_data=False,
        frames=(),
        index=0,
        watchdog_cycles=20,
    )
    fault = Freeze(way=Way.TO_SUB, start=7, until=9)
    found = judge(scene, Injection(faults=(fault,)), link.watchdog_ns)
    assert found == TrialFinding(verdict=TrialOutcome.DETECTED)
    assert channel.cycle == 9 + 3 * 20 + 64


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
