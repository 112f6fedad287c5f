"""Recordings of runs with faults replay without a difference; failing cases are made small."""

import json
import random
from types import SimpleNamespace

import pytest
from campaign.lossy_links import make_link
from changed import compare
from fsoe.devices import (
    ignores_crc,
    ignores_sequence,
    ignores_watchdog,
    strange_main,
    strange_sub,
    strange_sub_that_takes_data,
)

from fsoe_net.campaign.channel import Way
from fsoe_net.campaign.clean_run import Scene
from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.campaign.faults import Flip, Freeze, Swap
from fsoe_net.campaign.injection import ForeignFrames
from fsoe_net.campaign.recorder import Recorder
from fsoe_net.campaign.recording.replay import replay
from fsoe_net.campaign.shrink import (
    _earlier,
    _fewer_bits,
    _fewer_faults,
    _Point,
    _same_age,
    _shorter,
    shrink,
)
from fsoe_net.campaign.trials import CampaignConfig, Trials, run_trials

DRAWN = [name for name in CATALOGUE if name != "bit_errors"]


def _same(recorder, cycles):
    result = replay(recorder.lines())
    assert not result.differences, str(result.differences[0])
    assert result.compared >= 2 * cycles
    return result


@pytest.mark.parametrize("sizes", [(1, 1), (2, 2), (1, 6), (14, 4)], ids=str)
def test_a_clean_run_replays(sizes):
    recorder = Recorder(make_link(*sizes, app=b"\1\2\3"), 3)
    recorder.channel.run(150)
    assert recorder.channel.main.data_valid
    _same(recorder, 150)


RECORDED = {
    "ours": make_link(),
    "ours of other sizes": make_link(4, 1, app=b"\1\2\3", cycle_ns=1_500, delay=(2, 3)),
    "a device that forgot": make_link(sub_factory=ignores_crc),
    "strange sub": make_link(1, 2, sub_factory=strange_sub),
    "strange main": make_link(main_factory=strange_main),
}


@pytest.mark.weekly
@pytest.mark.parametrize("name", RECORDED)
def test_each_change_between_lines_of_a_recording(name):
    recorder = Recorder(RECORDED[name], 3)
    channel = recorder.channel
    channel.run(30)
    channel.faults = (Flip(way=Way.TO_MAIN, start=40, until=41, mask=1 << 12),)
    channel.run(50)
    channel.turn()
    rows = [(f"line {n}", line) for n, line in enumerate(recorder.lines("what it is"), 1)]
    compare(__file__, f"recorded {name}", rows)


@pytest.mark.parametrize("turns", [*range(1, 30), 31])
def test_a_start_up_replays(turns):
    recorder = Recorder(make_link(), 8)
    for _ in range(turns):
        recorder.channel.turn()
    _same(recorder, turns // 2)


@pytest.mark.uncounted
@pytest.mark.parametrize("name", [name for name in DRAWN if name != "parameters"])
@pytest.mark.parametrize("cycle", [3, 9, 40])
def test_each_class_of_faults_replays(name, cycle):
    link = make_link(2, 4)
    foreign, rng = ForeignFrames(link, 1), random.Random(cycle)
    recorder = Recorder(link, 5)
    channel = recorder.channel
    channel.run(cycle)
    channel.turn()
    frames = tuple(frame for _, frame in channel.sent[Way.TO_SUB])
    scene = Scene(
        channel=channel,
        way=Way.TO_SUB,
        frame=channel.newest(Way.TO_SUB),
        in_data=cycle > 20,
        frames=frames,
        index=len(frames) - 1,
        watchdog_cycles=20,
    )
    drawn = (CATALOGUE[name].make(rng, scene, foreign, 0) for _ in range(64))
    made = next((one for one in drawn if one is not None), None)
    if made is None:
        pytest.skip("this class has no case at this point of a run")
    channel.faults = made.faults
    channel.run(120)
    _same(recorder, 120)


@pytest.mark.parametrize("sizes", [(1, 2), (2, 2), (6, 1)], ids=str)
@pytest.mark.parametrize(
    "factories",
    [
        {"sub_factory": strange_sub},
        {"sub_factory": strange_sub_that_takes_data},
        {"main_factory": strange_main},
    ],
    ids=["sub", "sub with data", "main"],
)
def test_strangers_that_do_it_right_replay(factories, sizes):
    recorder = Recorder(make_link(*sizes, **factories), 3)
    channel = recorder.channel
    channel.run(60)
    channel.faults = (Flip(way=Way.TO_MAIN, start=60, until=61, mask=1 << 12),)
    channel.run(60)
    _same(recorder, 120)


def test_left_out_cycles_replay():
    recorder = Recorder(make_link(watchdog_ms=300), 3)
    channel = recorder.channel
    channel.run(40)
    channel.faults = (Freeze(way=Way.TO_SUB, start=40, until=900),)
    skipped = 0
    while channel.cycle < 1000:
        channel.run(1)
        skipped += channel.skip_idle()
    assert skipped > 250
    _same(recorder, 140)


def test_a_changed_recording_differs():
    recorder = Recorder(make_link(), 3)
    recorder.channel.run(60)
    lines = list(recorder.lines("what it is"))
    assert json.loads(lines[0])["title"] == "what it is"
    row = json.loads(lines[-1])
    row["safe_outputs"] = "5555"
    assert replay([*lines[:-1], json.dumps(row)]).differences


FORGOTTEN = [
    (ignores_crc, "corruption", Flip, "2a04"),
    (ignores_crc, "masquerade", Flip, "2a04"),
    (ignores_sequence, "repetition", Swap, "2a04"),
    (ignores_watchdog, "loss", Freeze, "2a05"),
    (ignores_watchdog, "loss+corruption", Freeze, "2a05"),
]


@pytest.mark.parametrize(("device", "name", "kind", "ours"), FORGOTTEN)
def test_a_failing_case_is_made_small_and_replays_as_different(device, name, kind, ours):
    config = CampaignConfig(links=(make_link(sub_factory=device),), seed=1)
    failures = run_trials(config, name, range(200)).failures
    small = shrink(Trials(config, name).case(failures[0].trial))
    assert small is not None
    (fault,) = small.faults
    assert isinstance(fault, kind)
    if kind is Flip:
        assert fault.mask.bit_count() == 1
        assert fault.until - fault.start == 1
    first = replay(small.lines).differences[0]
    assert (first.side, first.field) == ("sub", "frame")
    assert first.got.startswith(ours)
    compare(__file__, f"shrunk {device.__name__} {name}", enumerate(small.lines))


class _Fails:
    """Stands for the run of a connection: fails while the faults still do what is needed."""

    def __init__(self, needed, *cycles):
        self.needed = needed
        self.points = [_Point(cycle=n, way=Way.TO_SUB, frame=b"", past=()) for n in cycles]

    def fails(self, faults):
        return bool(faults) and self.needed(faults)


def _flips(*masks, start=10, cycles=8):
    return tuple(
        Flip(way=Way.TO_SUB, start=start + n, until=start + n + cycles, mask=mask)
        for n, mask in enumerate(masks)
    )


def test_how_faults_are_made_smaller():
    """Two faults are needed, of the one two bits and of the other three cycles."""

    def needed(faults):
        masks = {fault.mask & 0b1_0010_0000 for fault in faults}
        long = [fault for fault in faults if fault.until - fault.start >= 3]
        return 0b1_0010_0000 in masks and 0 in masks and bool(long) and faults[0].start >= 4

    bench = _Fails(needed, 1, 3, 4, 6, 9, 12)
    faults = _flips(0x1FF, 0x3F, 0x80, 0x600)
    fewer = _fewer_faults(bench, faults)
    assert fewer == (faults[0], faults[3])
    short = _shorter(bench, fewer)
    assert [fault.until - fault.start for fault in short] == [1, 4]
    assert [fault.mask for fault in _fewer_bits(bench, short)] == [0b1_0010_0000, 0x400]
    earlier = _earlier(bench, short)
    assert [(fault.start, fault.until) for fault in earlier] == [(4, 5), (7, 11)]
    assert _earlier(bench, earlier) == earlier
    assert _earlier(_Fails(needed, 9), earlier) == earlier


def test_a_frame_of_the_same_age():
    """Out of the past of the point where the fault is tried; a frame of no past stays."""
    frames = (b"a", b"b", b"c", b"d", b"e")
    scene = SimpleNamespace(frames=frames, index=3)
    point = SimpleNamespace(past=(b"v", b"w", b"x", b"y"))

    def moved(frame):
        fault = Swap(way=Way.TO_SUB, start=1, until=2, frame=frame)
        return _same_age(fault, scene, point).frame

    assert [moved(frame) for frame in frames] == [b"v", b"w", b"x", b"d", b"e"]
    other = Freeze(way=Way.TO_SUB, start=1, until=2)
    assert _same_age(other, scene, point) is other


def test_the_smallest_case_is_early():
    config = CampaignConfig(links=(make_link(sub_factory=ignores_crc),), seed=1)
    small = [
        shrink(Trials(config, "corruption").case(failure.trial))
        for failure in run_trials(config, "corruption", range(60)).failures
    ]
    starts = {one.faults[0].start for one in small if one.faults[0].way is Way.TO_SUB}
    assert starts == {4}  # the first Session frame once more, with a wrong CRC


def test_a_passing_case_is_not_reduced():
    config = CampaignConfig(links=(make_link(),), seed=1)
    assert shrink(Trials(config, "corruption").case(3)) is None
