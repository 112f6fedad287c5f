"""The fault model of §10.2, each fault at every cycle of a run, in both directions.

Whatever happens, neither application sees valid data which its peer did not send lately, and the
connection comes back by itself.
"""

import random
from dataclasses import dataclass, replace

import pytest
from campaign.lossy_links import make_link
from fsoe.pair import CONNECTION_ID, Bench, is_reset, last_reset, make_sub, parts, right
from weekly import first

from fsoe_net.campaign.channel import BACK, Way
from fsoe_net.campaign.faults import Alternate, Flip, Freeze, Late, Slip, Swap, Torn
from fsoe_net.fsoe.chain import Chain, reset_frame
from fsoe_net.fsoe.event import EventKind, State
from fsoe_net.fsoe.pdu import Command, frame_length

TO_SUB, TO_MAIN = Way.TO_SUB, Way.TO_MAIN
CYCLES = 44  # the start-up takes 16 of them
RECOVERY = 150
WATCHDOG_CYCLES = 20
MAX_AGE_CYCLES = WATCHDOG_CYCLES + 6  # and the way there and back, and the application's cycle


class WrongData(AssertionError):
    """Valid safe data which the other end never sent, or sent too long ago."""


class Run:
    """A channel whose applications look at every byte they are given."""

    def __init__(self, *sizes, seed=0, watchdog_ms=WATCHDOG_CYCLES, connection_id=None):
        link = make_link(*(sizes or (2, 2)), watchdog_ms=watchdog_ms)
        if connection_id is not None:
            link = replace(link, main=replace(link.main, connection_id=connection_id))
        self.channel = link.channel(seed)
        self.main, self.sub = self.channel.main, self.channel.sub
        self.valid_turns = 0

    @property
    def cycle(self):
        return self.channel.cycle

    def run(self, cycles):
        for _ in range(2 * cycles):
            way, cycle = self.channel.way, self.channel.cycle
            self.channel.turn()
            self._judge(self.channel.ends[way], way, cycle)

    def _judge(self, end, way, cycle):
        data = end.received_safe_data
        if not end.data_valid:
            if any(data) or (end.state is not State.DATA and end.enable):
                raise WrongData(f"cycle {cycle}: not valid, but {data.hex()}")
            return
        application = self.channel.application
        ages = range(MAX_AGE_CYCLES + 1)
        if data not in (application.at(way, cycle - age, len(data))[0] for age in ages):
            raise WrongData(f"cycle {cycle}: valid data {data.hex()} were not sent lately")
        self.valid_turns += 1

    def put(self, make, way, duration):
        """Let a fault act from now on."""
        start = self.channel.cycle
        fault = make(self, {"way": way, "start": start, "until": start + duration})
        self.channel.faults = () if fault is None else (fault,)
        self.run(duration)
        self.channel.faults = ()

    def frames(self, way):
        return [frame for visible, frame in self.channel.sent[way] if visible <= self.cycle]

    def healthy(self):
        return self.main.data_valid and self.sub.data_valid


@dataclass(frozen=True, kw_only=True)
class Reflect:
    """An end gets its own frames back."""

    way: Way
    start: int
    until: int

    def apply(self, channel, image):
        frame = channel.image(BACK[self.way], channel.cycle)
        return image if frame is None or image is None or len(frame) != len(image) else frame

    def next_change(self, channel):
        return channel.cycle


def flip(byte, bit):
    return lambda run, span: Flip(**span, mask=1 << 8 * byte + bit)


def lose(run, span):
    return Freeze(**span)


def delay(cycles):
    return lambda run, span: Late(**span, cycles=cycles)


def repeat(nth, command=None):
    def make(run, span):
        frames = [f for f in run.frames(span["way"]) if command in (None, f[0])]
        if command is not None:
            frames = frames[:1]
        return Swap(**span, frame=frames[-1 - nth]) if len(frames) > nth else None

    return make


def insert(connection_id, cycles):
    def make(run, span):
        other = Run(*run.channel.sizes, seed=5, connection_id=connection_id)
        other.run(cycles)
        return Swap(**span, frame=other.channel.newest(span["way"]))

    return make


def masquerade(kind):
    def make(run, span):
        size, rng = frame_length(run.channel.sizes[span["way"]]), random.Random(7)
        made = {
            "zeros": bytes(size),
            "ones": b"\xff" * size,
            "random": bytes((rng.choice(list(Command)),)) + rng.randbytes(size - 1),
        }
        return Swap(**span, frame=made[kind])

    return make


FAULTS = {
    **{f"flip byte {n}": (flip(n, n % 8), 1) for n in range(11)},
    "flip for three cycles": (flip(1, 4), 3),
    "flip for thirty cycles": (flip(4, 7), 30),
    "lose one": (lose, 1),
    "lose five": (lose, 5),
    "lose for almost T": (lose, 17),
    "lose for T": (lose, 20),
    "lose for two T": (lose, 40),
    "delay by three": (delay(3), 10),
    "delay by more than T": (delay(25), 30),
    "repeat the one before": (repeat(1), 1),
    "repeat the third before": (repeat(3), 1),
    "repeat the reset": (repeat(0, Command.RESET), 1),
    "repeat the session": (repeat(0, Command.SESSION), 1),
    "repeat the connection": (repeat(0, Command.CONNECTION), 1),
    "repeat the first data": (repeat(0, Command.FAIL_SAFE_DATA), 1),
    "insert foreign data": (insert(77, 40), 1),
    "insert foreign start-up": (insert(77, 9), 2),
    "insert data of equal ConnID": (insert(CONNECTION_ID, 40), 1),
    "masquerade zeros": (masquerade("zeros"), 1),
    "masquerade ones": (masquerade("ones"), 1),
    "masquerade random": (masquerade("random"), 5),
    "reflect": (lambda run, span: Reflect(**span), 1),
    "reflect long": (lambda run, span: Reflect(**span), 25),
    "torn": (lambda run, span: Torn(**span, head_bytes=3), 1),
    "slip": (lambda run, span: Slip(**span, shift=1, filler=b"\x36"), 2),
    "two writers": (lambda run, span: Alternate(**span, frame=run.channel.newest(TO_SUB)), 9),
}


@pytest.mark.shows("R19")
@pytest.mark.parametrize("sizes", first(1, [(6, 4), (2, 2)]), ids=str)
@pytest.mark.parametrize("way", list(Way), ids=str)
@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.uncounted
def test_fault_at_every_cycle(name, way, sizes):
    make, duration = FAULTS[name]
    for at in range(1, CYCLES):
        run = Run(*sizes, seed=at)
        run.run(at)
        run.put(make, way, duration)
        for _ in range(RECOVERY):
            if run.cycle > at + duration + 4 and run.healthy():
                break
            run.run(1)
        assert run.healthy(), f"fault at cycle {at}"


def test_the_judge_sees_wrong_data():
    """The test above can fail: an end that checks nothing is caught."""
    run = Run()
    run.run(30)
    run.sub._chain = _Gullible()
    with pytest.raises(WrongData):
        run.put(flip(1, 6), TO_SUB, 8)
    run = Run()
    run.run(30)
    run.main._watchdog_ns = run.sub._watchdog_ns = 10**18
    with pytest.raises(WrongData):
        run.put(lose, TO_SUB, 60)


class _Gullible(Chain):
    def receive(self, pdu):
        super().receive(pdu)
        return True


@pytest.mark.uncounted
def test_random_faults_for_long():
    rng = random.Random(11)
    valid = 0
    for seed in range(30):
        run = Run(seed=seed)
        for _ in range(40):
            make, duration = rng.choice(list(FAULTS.values()))
            run.run(rng.randrange(1, 40))
            run.put(make, rng.choice(list(Way)), duration)
        for _ in range(RECOVERY):
            run.run(1)
            if run.healthy():
                break
        assert run.healthy()
        valid += run.valid_turns
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


def _survives_loss(way: Way, frozen: int, start: int) -> bool:
    run = Run()
    run.run(start)
    run.main.take_events()
    run.sub.take_events()
    run.put(lose, way, frozen)
    run.run(5)
    codes = {e.code for end in (run.main, run.sub) for e in end.take_events()}
    assert not codes or 5 in codes
    assert (run.main.state is State.DATA) is (not codes)
    return not codes


@pytest.mark.parametrize("way", list(Way), ids=str)
@pytest.mark.parametrize(("frozen", "phases"), [(16, 2), (17, 2), (18, 1), (19, 0), (30, 0)])
def test_loss_up_to_the_watchdog_is_harmless(way, frozen, phases):
    """§10.1: two bus cycles of 1 ms per FSoE cycle, T = 20 ms; 18 depends on the moment."""
    assert sum(_survives_loss(way, frozen, start) for start in (30, 31)) == phases


def test_two_connections_crossed_in_data():
    first, second = Run(seed=1), Run(seed=2, connection_id=0x1111)
    for run in (first, second):
        run.run(30)
        run.sub.take_events()
        run.main.take_events()
    assert is_reset(first.sub.step(30_000_000, second.channel.newest(TO_SUB)), 3)
    assert is_reset(first.main.step(30_000_000, second.channel.newest(TO_MAIN)), 3)


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
    run = Run(watchdog_ms=100)
    run.run(40)
    run.put(flip(3, 2), TO_SUB, 1)
    start = run.cycle
    run.run(1)
    while run.main.state is not State.DATA or run.sub.state is not State.DATA:
        run.run(1)
    assert run.cycle - start < 30


def test_right_frames_are_needed_for_the_helpers():
    """`right` builds what an end accepts, so a refused frame was refused for its fault."""
    bench = _in_data()
    frame = right(bench.sub, Command.PROCESS_DATA, b"\1\2")
    assert bench.sub.step(0, frame)[0] == Command.PROCESS_DATA
    assert bench.sub.received_safe_data == b"\1\2"
