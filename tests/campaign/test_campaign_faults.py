"""What each fault does to an image, and what the catalogue draws."""

import math
import random
from collections import Counter
from itertools import combinations

import pytest
from campaign.lossy_links import DRAWN, make_config, make_link
from changed import compare
from fsoe.devices import watches_changes

from fsoe_net.campaign.bit_errors import code_distance, error_sets
from fsoe_net.campaign.channel import Way
from fsoe_net.campaign.clean_run import RunSource
from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.campaign.faults import (
    Alternate,
    Early,
    Flip,
    Freeze,
    Late,
    Slip,
    Swap,
    Torn,
    compose,
    shortened,
)
from fsoe_net.campaign.injection import CRC_CHANCE, ForeignFrames
from fsoe_net.campaign.judge import FAILURES, TrialOutcome
from fsoe_net.campaign.trials import CampaignConfig, Trials, run_trials, trial_count
from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.pdu import Command, decode_pdu, frame_length


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
        (Slip(**SPAN, shift=-2, filler=b"xyz"), b"xy\1\2\3\4\5"),
        (Slip(**SPAN, shift=99, filler=b"q"), b"q" * 7),
        (Alternate(**SPAN, frame=b"abcdefg"), b"abcdefg"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_fault_shows_the_expected_image_and_ends(fault, shown):
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


def test_changes_of_state_are_announced_in_advance():
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
    foreign, rng = ForeignFrames(link, 1), random.Random(2)
    walker = RunSource(link, 1)
    walk = walker.walk(0)
    assert walk.startup[0].frame[0] == Command.RESET
    for name in DRAWN:
        for _ in range(300 if name != "parameters" else 0):
            scene = walker.scene(0, rng)
            made = CATALOGUE[name].make(rng, scene, foreign, 0)
            assert made is None or made.faults
    for name in ("bit_errors", "parameters"):
        with pytest.raises(ConfigError, match="not drawn"):
            CATALOGUE[name].make(rng, scene, foreign, 0)


def test_constant_data_find_an_end_whose_watchdog_wants_new_data():
    """It leaves Data in a healthy run, in one trial of four; data that change hide it."""
    work = Trials(make_config(6, 6, sub_factory=watches_changes), "late_cycle")
    failed = [n for n in range(32) if work.run(n)[1].verdict in FAILURES]
    assert len(failed) >= 4
    assert {n % 4 for n in failed} == {1}


def test_frames_of_a_run_with_constant_data_differ_in_their_crcs_alone():
    walk = RunSource(make_link(2, 4), 1).walk(1)
    for way in Way:
        frames = walk.frames[way][-40:]
        assert len(set(frames)) == 40
        assert {decode_pdu(frame)[:2] for frame in frames} == {decode_pdu(frames[0])[:2]}
        assert frames[0][0] == Command.PROCESS_DATA


def test_an_older_frame_of_constant_data_has_no_chance_to_fit():
    """Only the frame that is due has the CRCs that are due, so no probability is stated."""
    for name in ("repetition", "incorrect_sequence", "stale_copy"):
        work = Trials(make_config(2, 2), name)
        cases = [(n, work.case(n)) for n in range(400)]
        chances = {(n % 4 == 1 and case.scene.in_data, case.injection.chance) for n, case in cases}
        assert chances == {(True, None), (False, CRC_CHANCE)}


@pytest.mark.parametrize("way", Way)
def test_an_edge_is_within_1_percent_of_the_watchdog(way):
    """Before it the frame is accepted; at the end and after it the receiver sends Reset 5."""
    work, sides = Trials(make_config(2, 2), "watchdog_edge"), set()
    for number in range(200):
        case = work.case(number)
        channel, (freeze, early) = case.scene.channel, case.injection.faults
        if freeze.way is not way:
            continue
        due_ns = channel.answered_ns[way] + case.link.watchdog_ns
        by_ns = freeze.until * channel.cycle_ns - early.early_ns - due_ns
        assert abs(by_ns) <= case.link.watchdog_ns // 100
        assert early.start == freeze.until
        assert 0 <= early.early_ns < channel.cycle_ns
        _, found = work.run(number)
        late = by_ns >= 0
        assert found.verdict is (TrialOutcome.DETECTED if late else TrialOutcome.TOLERATED)
        assert found.code == (5 if late else None)
        sides.add((by_ns > 0) - (by_ns < 0))
    assert sides == {-1, 0, 1}


def test_a_bus_cycle_that_comes_early_stays_early():
    channel = _channel()
    start = channel.cycle + 3
    channel.faults = (Early(way=Way.TO_SUB, start=start, until=start, early_ns=400_000),)
    channel.run(2)
    before = channel.now_ns
    channel.run(1)
    assert channel.now_ns - before == channel.cycle_ns - 400_000
    channel.run(5)
    assert channel.now_ns == channel.cycle * channel.cycle_ns - 400_000


def test_forged_frames_change_each_byte_of_the_connection_id_alone_and_count_one_on():
    work = Trials(make_config(2, 2), "forged")
    right, changed, ahead = 0xABCD, set(), Counter()
    for number in range(1500):
        case = work.case(number)
        forge = case.injection.faults[0]
        if forge.connection_id is not None and case.scene.frame[-2:] == b"\xcd\xab":
            mask = forge.connection_id ^ right
            assert mask
            changed.add((mask & 0xFF > 0, mask >> 8 > 0))
        ahead[forge.ahead, forge.turned > 0] += 1
    assert changed == {(True, False), (False, True), (True, True)}
    assert ahead[1, False] > 30
    assert ahead[1, True] > 30


# ------------------------------------------------------------------------------------ bit errors


@pytest.mark.parametrize("data_bytes", [1, 2])
def test_distance_of_the_code(data_bytes):
    assert code_distance(data_bytes) == 6


@pytest.mark.uncounted
def test_bit_errors_are_all_different_and_complete():
    link = make_link(1, 2)
    sets = error_sets((link, link))
    rows = [(row.way, row.mask(n)) for row in sets for n in range(row.count)]
    count = trial_count(CampaignConfig(links=(link, link)), "bit_errors", 5)
    assert count == len(rows)
    assert trial_count(CampaignConfig(links=(link,)), "loss", 5) == 5
    to_sub = [mask for way, mask in rows if way is Way.TO_SUB]
    blocks = {mask for mask in to_sub if 0 < mask >> 8 < 1 << 24 and mask & 0xFF == 0}
    assert len(blocks) == sum(math.comb(24, weight) for weight in range(1, 6))
    pairs = {1 << a | 1 << b for a, b in combinations(range(48), 2)}
    assert pairs <= set(to_sub)
    assert {1 << a for a in range(48)} <= set(to_sub)
    assert all(mask < 1 << 8 * frame_length(link.sizes[way]) for way, mask in rows)


def test_the_first_and_last_bit_errors_of_each_kind():
    """Patterns within a block first, then those of one and two bits anywhere."""
    rows = []
    for sizes in ((1, 1), (1, 4), (4, 6)):
        for row in error_sets((make_link(*sizes),)):
            what = f"{sizes} {row.way.name}"
            rows.append((what, f"{row.count} {row.bits} {row.blocks}"))
            for number in (0, 1, 2, row.count - 2, row.count - 1):
                rows.append((f"{what} {number}", f"{row.mask(number):x}"))
    compare(__file__, "bit errors", rows)


def test_bit_errors_of_frames_that_share_a_code_are_tried_once():
    """Twelve connections of twelve sizes take little longer than one: 2^24 patterns have one code.

    A block of one safe byte has 24 bits, one of two has 32; both have distance 6.
    """
    sizes = ((1, 1), (2, 2), (4, 4), (6, 6), (8, 8), (8, 12), (2, 4), (1, 2), (4, 8), (14, 14))
    links = tuple(make_link(*pair) for pair in (*sizes, (6, 10), (12, 30)))
    blocks = [2 * sum(math.comb(bits, n) for n in range(1, 6)) for bits in (24, 32)]
    frames = [
        {6 if n == 1 else 2 * n + 3 for n in (link.sizes[way] for link in links)} for way in Way
    ]
    pairs = sum(8 * size + math.comb(8 * size, 2) for way in frames for size in way)
    config = CampaignConfig(links=links)
    assert trial_count(config, "bit_errors", 0) == sum(blocks) + pairs
    rows = error_sets(links)
    assert {(row.way, row.bits) for row in rows if row.blocks} == {
        (way, bits) for way in Way for bits in (24, 32)
    }


def test_a_torn_copy_holds_the_frame_that_became_visible_last():
    channel = _channel()
    while channel.sent[Way.TO_SUB][-1][0] != channel.cycle:
        channel.turn()
    image = b"\1\2\3\4\5\6\7"
    torn = Torn(way=Way.TO_SUB, start=channel.cycle, until=channel.cycle + 1, head_bytes=3)
    assert torn.apply(channel, image) == image[:3] + channel.newest(Way.TO_SUB)[3:]


def test_long_frames_take_the_patterns_in_turn():
    link = make_link(6, 6)
    row = error_sets((link,))[0]
    hit = {(row.mask(n).bit_length() - 9) // 32 for n in range(500, 800)}
    assert hit == {0, 1, 2}
    with pytest.raises(ConfigError, match="not so many"):
        Trials(CampaignConfig(links=(link,)), "bit_errors").case(10**9)


def test_bit_errors_within_the_distance_are_all_found():
    config = make_config(1, 1)
    count = trial_count(config, "bit_errors", 0)
    for first in (0, count // 2 - 500, count - 1000):
        result = run_trials(config, "bit_errors", range(first, first + 1000))
        assert result.detected == 1000
        assert result.passed
        assert result.interval == (0, 0)


def test_bits_that_turn_a_frame_into_the_one_seen_last_are_drawn_elsewhere():
    """The same bytes again are not an event: no end can notice them."""
    (lane, *_), number, way = Trials(make_config(1, 1), "bit_errors")._lanes, 5, Way.TO_MAIN
    first = lane.flip(number, way, 1 << 9).scene
    mask = int.from_bytes(first.frame, "little") ^ int.from_bytes(
        first.channel.shown(way), "little"
    )
    second = lane.flip(number, way, mask)
    (flip,) = second.injection.faults
    assert flip.apply(second.scene.channel, second.scene.frame) != second.scene.channel.shown(way)


def test_a_collision_of_bit_errors_is_a_failure():
    result = run_trials(make_config(1, 1), "bit_errors", range(1))
    result.collisions = 1
    assert not result.rate_ok
    assert not result.passed
