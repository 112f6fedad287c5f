"""The fault model of §10.2, each fault at every cycle of a run, in both directions.

Whatever happens, neither application sees valid data which its peer did not send lately, and the
connection comes back by itself.
"""

import random

import pytest
from fsoe.channel import (
    TO_MAIN,
    TO_SUB,
    Channel,
    WrongData,
    delay,
    flip,
    insert,
    lose,
    masquerade,
    reflect,
    repeat,
)
from fsoe.pair import CONNECTION_ID, Bench, is_reset, last_reset, make_sub, parts, right

from fsoe_net.fsoe import Chain, Command, EventKind, State, reset_frame

CYCLES = 44  # the start-up takes 16 of them
RECOVERY = 150

FAULTS = {
    **{f"flip byte {n}": (lambda way, n=n: flip(n, n % 8), 1) for n in range(11)},
    "flip for three cycles": (lambda way: flip(1, 4), 3),
    "flip for thirty cycles": (lambda way: flip(4, 7), 30),
    "lose one": (lose, 1),
    "lose five": (lose, 5),
    "lose for almost T": (lose, 17),
    "lose for T": (lose, 20),
    "lose for two T": (lose, 40),
    "delay by three": (lambda way: delay(way, 3), 10),
    "delay by more than T": (lambda way: delay(way, 25), 30),
    "repeat the one before": (lambda way: repeat(way, 1), 1),
    "repeat the third before": (lambda way: repeat(way, 3), 1),
    "repeat the reset": (lambda way: repeat(way, 0, Command.RESET), 1),
    "repeat the session": (lambda way: repeat(way, 0, Command.SESSION), 1),
    "repeat the connection": (lambda way: repeat(way, 0, Command.CONNECTION), 1),
    "repeat the first data": (lambda way: repeat(way, 0, Command.PROCESS_DATA), 1),
    "insert foreign data": (lambda way: insert(way, 77, 40), 1),
    "insert foreign start-up": (lambda way: insert(way, 77, 9), 2),
    "insert data of equal ConnID": (lambda way: insert(way, CONNECTION_ID, 40), 1),
    "masquerade zeros": (lambda way: masquerade("zeros", way, 0), 1),
    "masquerade ones": (lambda way: masquerade("ones", way, 0), 1),
    "masquerade random": (lambda way: masquerade("random", way, 7), 5),
    "reflect": (reflect, 1),
    "reflect long": (reflect, 25),
}


@pytest.mark.parametrize("sizes", [(2, 2), (6, 4)], ids=str)
@pytest.mark.parametrize("way", [TO_SUB, TO_MAIN])
@pytest.mark.parametrize("name", FAULTS)
def test_fault_at_every_cycle(name, way, sizes):
    make, duration = FAULTS[name]
    for at in range(CYCLES):
        channel = Channel(*sizes, seed=at)
        channel.run(at, None, way)
        channel.run(duration, make(way), way)
        for _ in range(RECOVERY):
            if channel.cycle > at + duration + 4 and channel.healthy():
                break
            channel.one()
        assert channel.healthy(), f"fault at cycle {at}"
        channel.run(20, None, way)
        assert channel.healthy(), f"fault at cycle {at}"


def test_the_judge_sees_wrong_data():
    """The test above can fail: an end that checks nothing is caught."""
    channel = Channel()
    channel.run(30, None, TO_SUB)
    channel.sub._chain = _Gullible()
    with pytest.raises(WrongData):
        channel.run(4, flip(1, 6), TO_SUB)
    channel = Channel()
    channel.run(30, None, TO_SUB)
    channel.main._watchdog_ns = channel.sub._watchdog_ns = 10**18
    with pytest.raises(WrongData):
        channel.run(60, lose(TO_SUB), TO_SUB)


class _Gullible(Chain):
    def receive(self, pdu):
        super().receive(pdu)
        return True


def test_random_faults_for_long():
    rng = random.Random(11)
    valid = 0
    for seed in range(30):
        channel = Channel(2, 2, seed=seed)
        for _ in range(40):
            way = rng.choice([TO_SUB, TO_MAIN])
            make, duration = rng.choice(list(FAULTS.values()))
            channel.run(rng.randrange(40), None, way)
            channel.run(duration, make(way), way)
        channel.run(RECOVERY, None, TO_SUB)
        assert channel.healthy()
        valid += channel.valid_cycles
    assert valid > 1000


def _in_data() -> Bench:
    bench = Bench().to_data()
    for _ in range(4):
        bench.main.enable = bench.sub.enable = True
        bench.cycle()
    bench.main_turn()  # a good frame for the sub is outstanding
    bench.main.take_events()
    bench.sub.take_events()
    return bench


def _waiting(end_name: str):
    """An end in Data, and the good frame it is about to receive."""
    bench = _in_data()
    if end_name == "sub":
        return bench.sub, bench.to_sub, bench
    bench.sub_turn()
    return bench.main, bench.to_main, bench


@pytest.mark.parametrize("end_name", ["main", "sub"])
@pytest.mark.parametrize(
    ("damage", "code"),
    [
        (lambda f, b, e: b"\x37" + f[1:], 2),
        (lambda f, b, e: b"\x52" + f[1:], 1),
        (lambda f, b, e: b"\x08" + f[1:], 4),
        (lambda f, b, e: f[:1] + bytes((f[1] ^ 1,)) + f[2:], 4),
        (lambda f, b, e: f[:4] + bytes((f[4] ^ 1,)) + f[5:], 4),
        (lambda f, b, e: f[:5] + bytes((f[5] ^ 1,)) + f[6:], 3),
        (lambda f, b, e: _older(b, e, Command.PROCESS_DATA), 4),
        (lambda f, b, e: _older(b, e, Command.CONNECTION), 1),
        (lambda f, b, e: _older(b, e, Command.PARAMETER), 1),
        (lambda f, b, e: bytes(7), 2),
        (lambda f, b, e: b"\xff" * 7, 2),
        (lambda f, b, e: b"\x36\x12\x34\x56\x78\x11\x11", 3),
        (lambda f, b, e: b"\x36\x12\x34\x56\x78\xcd\xab", 4),
        (lambda f, b, e: b.to_main if e is b.sub else b.to_sub, 4),
    ],
    ids=[
        *("command", "command of start-up", "other data command", "data", "crc", "connection id"),
        *("older data", "older connection", "older parameter", "zeros", "ones", "foreign"),
        *("random", "own frame"),
    ],
)
def test_code_of_a_fault_in_data(end_name, damage, code):
    end, frame, bench = _waiting(end_name)
    assert is_reset(end.step(0, damage(frame, bench, end)), code)
    assert last_reset(end) == (EventKind.RESET_LOCAL, code)
    if end is bench.sub:  # §10.2: the good image is then another frame
        assert is_reset(end.step(0, frame), 1)


def _older(bench: Bench, end, command: int) -> bytes:
    mine = bench.log[0::2] if end is bench.sub else bench.log[1::2]
    return next(frame for frame in mine if frame[0] == command)


def test_repeated_reset_and_session_frames_are_valid_for_ever():
    sub, _, bench = _waiting("sub")
    assert sub.step(0, _older(bench, sub, Command.SESSION))[0] == Command.SESSION
    assert sub.state is State.SESSION
    sub, _, bench = _waiting("sub")
    assert sub.step(0, reset_frame(0, 2)) == reset_frame(0, 2)
    main, _, bench = _waiting("main")
    assert main.step(0, _older(bench, main, Command.RESET))[0] == Command.SESSION
    main, _, bench = _waiting("main")
    assert is_reset(main.step(0, _older(bench, main, Command.SESSION)), 1)


def _survives_loss(way: str, frozen: int, start: int) -> bool:
    channel = Channel()
    channel.run(start, None, way)
    channel.main.take_events()
    channel.sub.take_events()
    channel.run(frozen, lose(way), way)
    channel.run(5, None, way)
    codes = {e.code for end in (channel.main, channel.sub) for e in end.take_events()}
    assert not codes or 5 in codes
    assert (channel.main.state is State.DATA) is (not codes)
    return not codes


@pytest.mark.parametrize("way", [TO_SUB, TO_MAIN])
@pytest.mark.parametrize(("frozen", "phases"), [(16, 2), (17, 2), (18, 1), (19, 0), (30, 0)])
def test_loss_up_to_the_watchdog_is_harmless(way, frozen, phases):
    """§10.1: two bus cycles of 1 ms per FSoE cycle, T = 20 ms; 18 depends on the moment."""
    assert sum(_survives_loss(way, frozen, start) for start in (30, 31)) == phases


def test_two_connections_crossed_in_data():
    first, second = Channel(seed=1), Channel(seed=2, connection_id=0x1111)
    for channel in (first, second):
        channel.run(30, None, TO_SUB)
        channel.sub.take_events()
        channel.main.take_events()
    assert is_reset(first.sub.step(30_000_000, second.images[TO_SUB][-1]), 3)
    assert is_reset(first.main.step(30_000_000, second.images[TO_MAIN][-1]), 3)


def test_two_connections_crossed_at_start():
    """Session ids do not fit together: the main ignores the replies until its watchdog expires."""
    first, second = Bench(), Bench()
    second.main._session_ids.value = 0x7777
    for bench in (first, second):
        bench.until(lambda bench=bench: bench.sub.state is State.SESSION)
        bench.main.take_events()
    first.to_main, second.to_main = second.to_main, first.to_main
    for bench in (first, second):
        assert bench.main_turn() is None
        bench.now_ns = 20_000_000
        assert is_reset(bench.main_turn(), 5)
        bench.to_data()


def test_one_disturbance_and_a_stale_session_reply():
    """§11.2: the reply to the first of two sessions arrives while the second is outstanding."""
    bench = Bench()
    bench.until(lambda: bench.main.state is State.SESSION)
    stale = bench.sub_turn()
    bench.to_main = reset_frame(1, 2)
    assert bench.main_turn()[0] == Command.SESSION
    chain = bench.main._chain
    bench.to_main = stale
    assert bench.main_turn() is None
    assert chain.rx_sequence == 1
    assert bench.sub_turn()[0] == Command.SESSION
    assert parts(bench.main_turn()).command == Command.CONNECTION
    bench.to_data()


def test_wrong_address_is_retried_for_ever():
    bench = Bench(sub=make_sub(address=0x1235))
    for _ in range(300):
        bench.cycle()
    codes = [e.code for e in bench.main.take_events() if e.kind is EventKind.RESET_BY_PEER]
    assert set(codes) == {6}
    assert len(codes) > 20
    assert bench.sub.state is not State.DATA


def test_recovery_needs_no_dead_time():
    """§11.2: one corrupted frame to the sub costs about one start-up, not a watchdog period."""
    channel = Channel(watchdog_ms=100)
    channel.run(40, None, TO_SUB)
    channel.run(1, flip(3, 2), TO_SUB)
    start = channel.cycle
    channel.one()
    while channel.main.state is not State.DATA or channel.sub.state is not State.DATA:
        channel.one()
    assert channel.cycle - start < 30


def test_right_frames_are_needed_for_the_helpers():
    """`right` builds what an end accepts, so a refused frame was refused for its fault."""
    bench = _in_data()
    frame = right(bench.sub, Command.PROCESS_DATA, b"\1\2")
    assert bench.sub.step(0, frame)[0] == Command.PROCESS_DATA
    assert bench.sub.received_safe_data == b"\1\2"
