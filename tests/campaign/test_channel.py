"""The channel: delays, held images, going back, idle time."""

import random
from itertools import pairwise

import pytest
from campaign.lossy_links import make_link
from fsoe.devices import strange_main, strange_sub, strange_sub_that_takes_data
from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.campaign.channel import BACK, Application, Channel, SessionIds, Way, set_sequence
from fsoe_net.campaign.clean_run import RunSource
from fsoe_net.campaign.faults import Freeze
from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.event import State

SIZES = [(1, 1), (1, 6), (2, 2), (6, 4), (14, 2), (126, 126)]


def _trace(channel, turns):
    return [(channel.cycle, channel.way, *channel.turn()) for _ in range(turns)]


@pytest.mark.parametrize("sizes", SIZES, ids=str)
@pytest.mark.parametrize("delay", [(1, 1), (3, 1), (2, 5)], ids=str)
def test_comes_to_data_and_carries_the_data(sizes, delay):
    channel = make_link(*sizes, watchdog_ms=50, delay=delay).channel(3)
    seen = [set(), set()]
    for _ in range(800):
        way = channel.way
        channel.turn()
        end = channel.ends[way]
        if end.data_valid:
            seen[way].add(end.received_safe_data)
            cycle = channel.cycle
            sent = {channel.application.at(way, cycle - n, sizes[way])[0] for n in range(40)}
            assert end.received_safe_data in sent
    assert channel.main.state is channel.sub.state is State.DATA
    assert min(map(len, seen)) > 20


@given(st.integers(0, 400), st.integers(1, 60), st.sampled_from(SIZES[:4]))
@pytest.mark.uncounted
def test_going_back_repeats_everything(before, after, sizes):
    channel = make_link(*sizes).channel(9)
    for _ in range(before):
        channel.turn()
    state = channel.snapshot()
    first = _trace(channel, after)
    channel.restore(state)
    assert _trace(channel, after) == first
    channel.main.request_reset()
    channel.run(40)
    channel.restore(state)
    assert _trace(channel, after) == first


def test_a_snapshot_shares_nothing_that_moves():
    channel = make_link(1, 1, app=b"12345").channel(1)
    for _ in range(400):
        state = channel.snapshot()
        ends = [dict(vars(end)) for end in channel.ends]
        chains = [end._chain.copy() for end in channel.ends]
        told = bytes(channel.sub._told)
        events = [list(end._events) for end in channel.ends]
        channel.turn()
        channel.restore(state)
        assert [end._chain for end in channel.ends] == chains
        assert [list(end._events) for end in channel.ends] == events
        assert bytes(channel.sub._told) == told
        for end, before in zip(channel.ends, ends, strict=True):
            plain = {k: v for k, v in before.items() if k not in ("_chain", "_events", "_told")}
            assert {k: vars(end)[k] for k in plain} == plain
        channel.turn()


@pytest.mark.parametrize("way", list(Way))
@pytest.mark.parametrize("number", [1, 2, 65530, 65535])
def test_sequence_numbers_can_be_set_anywhere(way, number):
    channel = make_link().channel(2)
    channel.run(40)
    while True:
        now = channel.way
        if channel.turn()[1] is not None and now is way:
            break
    set_sequence(channel, way, number)
    before = [end._chain.rx_sequence for end in channel.ends]
    channel.run(60)
    assert channel.main.state is channel.sub.state is State.DATA
    assert [end._chain.rx_sequence for end in channel.ends] != before


def test_sequence_numbers_stay_while_a_frame_is_under_way():
    channel = make_link().channel(2)
    channel.run(40)
    while True:
        way = channel.way
        if channel.turn()[1] is not None:
            break
    with pytest.raises(ConfigError, match="under way"):
        set_sequence(channel, BACK[way], 100)
    foreign = make_link(sub_factory=strange_sub).channel(1)
    with pytest.raises(ConfigError, match="our own"):
        set_sequence(foreign, Way.TO_SUB, 100)


def test_idle_time_left_out_changes_nothing():
    def run(skip):
        channel = make_link(watchdog_ms=500).channel(4)
        channel.run(60)
        channel.faults = ()
        for rows in channel.sent:  # all that was sent is lost
            rows[:] = [(visible, frame) for visible, frame in rows if visible < channel.cycle]
        out, turns = [], 0
        while channel.cycle < 700:
            out += [row for row in _trace(channel, 2) if row[3] is not None]
            turns += 1
            if skip:
                channel.skip_idle()
        return out, turns

    (slow, many), (quick, few) = run(skip=False), run(skip=True)
    assert [row for row in quick if row[0] < 650] == [row for row in slow if row[0] < 650]
    assert few < many / 2


def test_how_many_idle_cycles_are_left_out():
    """Up to the watchdog, a change of a fault, or the cycle in which a frame is shown."""
    channel = make_link(watchdog_ms=500, delay=(4, 7)).channel(4)
    skipped = []
    channel.faults = (Freeze(way=Way.TO_SUB, start=300, until=340),)
    while channel.cycle < 900:
        channel.turn()
        assert channel.skip_idle() == 0  # the sub is next
        channel.turn()
        skipped.append((channel.cycle, channel.skip_idle()))
        if channel.cycle > 200:
            for rows in channel.sent:  # all that is sent is lost
                rows[:] = [row for row in rows if row[0] < 200]
    left_out = [row for row in skipped if row[1]]
    assert left_out == [(202, 98), (301, 39), (341, 350), (693, 5), (700, 498)]


def test_an_application_that_takes_its_hands_off():
    """From that cycle on the data go on and the enable stays as it is; before, both change."""
    channel = make_link().channel(4)
    channel.run(30)
    fed = []
    channel._feed = tuple(lambda data, enabled, way=w: fed.append((way, enabled)) for w in Way)
    channel.application = Application(key=4, hands_off_from=40)
    while channel.cycle < 50:
        cycle = channel.cycle
        fed.clear()
        channel.turn()
        assert {enabled is None for _, enabled in fed} <= {cycle >= 40}, cycle


def test_strangers_take_part():
    for factories in (
        {"sub_factory": strange_sub},
        {"main_factory": strange_main},
        {"sub_factory": strange_sub_that_takes_data},
    ):
        channel = make_link(**factories).channel(1)
        channel.run(60)
        assert channel.newest(Way.TO_SUB)[0] in (0x36, 0x08)
        assert channel.skip_idle() == 0  # they do not tell their watchdogs
    channel.run(20)
    assert channel.main.data_valid


def test_an_image_handed_out_in_every_call_is_sent_once():
    class Holds(strange_sub):
        image = None

        def step(self, now_ns, received):
            self.image = super().step(now_ns, received) or self.image
            return self.image

    channel = make_link(sub_factory=Holds).channel(1)
    channel.run(60)
    frames = [frame for _, frame in channel.sent[Way.TO_MAIN]]
    assert len(frames) > 20
    assert all(a != b for a, b in pairwise(frames))


def test_application_data_differ_and_are_sometimes_fail_safe():
    app = Application(key=5, fail_safe_share=4)
    rows = [app.at(Way.TO_SUB, cycle, 6) for cycle in range(400)]
    assert len({data for data, _ in rows}) == 400
    assert 40 < sum(not enabled for _, enabled in rows) < 160
    assert all(Application(fail_safe_share=0).at(Way.TO_SUB, n, 2)[1] for n in range(200))
    assert len(app.at(Way.TO_MAIN, 1, 126)[0]) == 126


def test_session_ids_use_all_bits():
    ids = SessionIds(0)
    drawn = [ids() for _ in range(500)]
    assert len(set(drawn)) > 490
    assert ids.drawn == drawn[-1]


def test_cycle_and_delay_must_be_at_least_one():
    good = make_link().channel(1)
    for changes in ({"cycle_ns": 0}, {"delay_cycles": (0, 1)}):
        with pytest.raises(ConfigError, match="at least 1"):
            Channel(good.main, good.sub, sizes=(2, 2), **changes)


def test_walks_cross_the_wrap():
    walker, crossed = RunSource(make_link(), 1), 0
    for number in range(24):
        walk = walker.walk(number)
        states = [spot.state for spot in walk.data]
        for way in Way:
            numbers = [state[0][way]["_chain"].rx_sequence for state in states]
            crossed += any(b < a for a, b in pairwise(numbers))
    assert crossed > 4


def test_walks_that_never_come_to_data():
    steps = []

    class Dead(strange_sub):
        def step(self, now_ns, received):
            steps.append(now_ns)

    walker = RunSource(make_link(sub_factory=Dead, watchdog_ms=1000, app=b"abc", delay=(2, 3)), 1)
    with pytest.raises(ConfigError, match="does not reach state Data"):
        walker.scene(0, random.Random(1))
    exchanges, slow_cycles = 20 + 3, 20
    assert steps[-1] // 1_000_000 == exchanges * (2 + 3 + slow_cycles) + 5 * 1000


def test_a_watchdog_shorter_than_an_exchange():
    with pytest.raises(ConfigError, match=r"watchdog of 1 ms must exceed .* 2 ms"):
        RunSource(make_link(watchdog_ms=1), 1).scene(0, random.Random(1))


def test_the_longest_start_up_is_waited_for():
    assert RunSource(make_link(1, 1, app=bytes(2000)), 1).scene(0, random.Random(1))
