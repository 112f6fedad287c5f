"""Any order of frames, faults, times and orders: Hypothesis looks for the one that breaks an end.

The judge of a single end does not ask the engine whether a frame was right; it knows how the frame
was made. It keeps what a full start-up consists of, and lets safe data be valid only after one.
"""

import math
import struct

from fsoe.pair import (
    ADDRESS,
    CONNECTION_ID,
    WATCHDOG_NS,
    Bench,
    counted,
    make_main,
    make_sub,
    right,
)
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from weekly import examples

from fsoe_net.fsoe.chain import reset_frame
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import Command, frame_length
from fsoe_net.fsoe.sub_instance import SubInstance

SIZES = st.sampled_from([(1, 1), (2, 2), (1, 2), (6, 4), (4, 14)])
APPS = st.sampled_from([b"", b"\x01", b"\x01\x02\x03\x04\x05"])
FULL = {Command.SESSION, Command.CONNECTION, Command.PARAMETER}
DATA_COMMANDS = (Command.PROCESS_DATA, Command.FAIL_SAFE_DATA)
BYTES = st.integers(0, 255)
FOREIGN: dict[tuple, list[bytes]] = {}


def foreign_frames(sizes) -> list[bytes]:
    """Frames of another connection with the same sizes, from its first Reset into Data."""
    if sizes not in FOREIGN:
        bench = Bench(
            *sizes,
            main=make_main(*sizes, ids=counted(0x7171), connection_id=77),
            sub=make_sub(*sizes, ids=counted(0x5353)),
        ).to_data()
        for _ in range(3):
            bench.main.enable = bench.sub.enable = True
            bench.cycle()
        FOREIGN[sizes] = bench.log
    return FOREIGN[sizes]


class EndMachine(RuleBasedStateMachine):
    """One end alone; the test is its peer, its application and its clock."""

    def __init__(self):
        super().__init__()
        self.end = None

    def start(self, sizes, app, running):
        self.sizes, self.app = sizes, app
        self.end = self.make(sizes, app)
        self.now_ns = 0
        self.sent_ns = 0  # of the frame sent last
        self.image: bytes | None = None
        self.history: list[bytes] = []
        self.heard: set[int] = set()  # commands taken since the last event that ends a connection
        # Such an event is certain to be noticed in the next call; a main begins with a Reset.
        self.ending = isinstance(self.end, MainInstance)
        if running:
            self.come_to_data(bytes(range(1, 15)))

    def make(self, sizes, app):
        raise NotImplementedError

    def good_text(self, command) -> bytes:
        raise NotImplementedError

    def good_command(self) -> Command:
        raise NotImplementedError

    def good(self, data=b"", command=None) -> bytes:
        """The frame this end waits for, as an undisturbed peer would send it."""
        command = command or self.good_command()
        if command == Command.RESET:
            return reset_frame(0, self.end._receives)
        if command in DATA_COMMANDS:
            size = self.end._receives if command == Command.PROCESS_DATA else 0
            return right(self.end, command, data[:size])
        return right(self.end, command, self.good_text(command))

    def feed(self, frame: bytes | None, *, good: bool = False):
        """One call with this image, and what may be seen of the end before and after it."""
        end, size = self.end, frame_length(self.end._receives)
        was_data, was_valid, enabled = end.state is State.DATA, end.data_valid, end.enable
        taken = frame is not None and len(frame) == size and frame != self.seen()
        watched = was_data or isinstance(end, MainInstance)
        expired = watched and self.now_ns - self.sent_ns >= WATCHDOG_NS
        ends = self.ending or expired or (taken and not good)
        answer = end.step(self.now_ns, frame)
        self.ending = False
        if answer is not None:
            self.sent_ns = self.now_ns
            assert len(answer) == frame_length(end._sends)
            assert answer[0] != Command.PROCESS_DATA or enabled
            assert (answer[0] in DATA_COMMANDS) == (end.state is State.DATA)
        assert len(end.take_events()) <= 1
        if ends:
            self.heard.clear()
            if was_data:
                assert end.state is not State.DATA
                assert not end.enable
        if taken and not expired:
            self.history.append(frame)
            # A sub takes any first Session frame of a main, also an old one; it has then heard it.
            opened = frame[0] == Command.SESSION and end.state is State.SESSION
            if (good and not ends) or (opened and isinstance(end, SubInstance)):
                self.heard.add(frame[0])
        if was_data and not ends:
            assert end.state is State.DATA
            assert end.data_valid == (frame[0] == Command.PROCESS_DATA if taken else was_valid)
            if taken and end.data_valid:
                assert end.received_safe_data == self.sent_data

    def seen(self) -> bytes:
        """The bytes looked at last; those of calls in which the watchdog spoke were not."""
        return self.end._seen

    def good_frame(self, data):
        self.sent_data = data[: self.end._receives]
        self.image = self.good(self.sent_data)
        self.feed(self.image, good=True)

    @rule(
        count=st.integers(1, 30), data=st.binary(min_size=14, max_size=14), gap=st.integers(0, 19)
    )
    def good_frames(self, count, data, gap):
        for n in range(count):
            self.now_ns += gap * 1_000_000 // count
            self.good_frame(bytes((data[0] ^ n,)) + data[1:])

    @rule(data=st.binary(min_size=14, max_size=14))
    def come_to_data(self, data):
        """Good frames until ProcessData came through: else a machine is in Data too seldom."""
        for _ in range(60):
            if self.end.state is State.RESET:
                self.now_ns += WATCHDOG_NS  # the answering Reset may have been seen already
            self.good_frame(data)
            if self.end.data_valid:
                return
        raise AssertionError(f"60 good frames lead to {self.end.state}")

    @rule(data=st.binary(min_size=14, max_size=14))
    def good_frame_after_the_watchdog(self, data):
        """§8: at T the watchdog speaks first, whatever waits."""
        self.now_ns = max(self.now_ns, self.sent_ns + WATCHDOG_NS)
        self.image = self.good(data)
        self.feed(self.image, good=True)

    @rule()
    def fail_safe_frame(self):
        command = self.good_command()
        if command == Command.PROCESS_DATA:
            self.image = self.good(command=Command.FAIL_SAFE_DATA)
            self.feed(self.image, good=True)

    @rule(offset_ns=st.sampled_from([-1, 0, 1]))
    def to_the_watchdog(self, offset_ns):
        """Silence until just before, at, or just after T after the frame sent last."""
        self.now_ns = max(self.now_ns, self.sent_ns + WATCHDOG_NS + offset_ns)
        self.feed(self.image if self.image == self.seen() else None)

    @rule(step_ns=st.integers(0, 3 * WATCHDOG_NS))
    def silence(self, step_ns):
        self.now_ns += step_ns
        self.feed(None)

    @rule(at=st.integers(0, 60), bit=st.integers(0, 7), data=st.binary(min_size=14, max_size=14))
    def corrupted(self, at, bit, data):
        frame = bytearray(self.good(data))
        frame[at % len(frame)] ^= 1 << bit
        self.other(bytes(frame))

    @rule(back=st.integers(1, 40))
    def replayed(self, back):
        if self.history:
            self.other(self.history[-min(back, len(self.history))])

    @rule(n=st.integers(0, 200))
    def of_another_connection(self, n):
        frames = foreign_frames(self.sizes)
        self.other(frames[n % len(frames)])

    @rule(connection_id=st.sampled_from([0, 1, CONNECTION_ID ^ 0x8000]))
    def with_another_connection_id(self, connection_id):
        """Right in the chain but for its ConnID; Session frames may have any (§4)."""
        command = self.good_command()
        if command not in (Command.RESET, Command.SESSION):
            text = self.good_text(command) if command not in DATA_COMMANDS else b""
            self.other(right(self.end, command, text, connection_id))

    @rule(raw=st.binary(max_size=40))
    def random_bytes(self, raw):
        self.other(raw)

    @rule(command=st.sampled_from(list(Command)), raw=st.binary(min_size=31, max_size=31))
    def random_frame(self, command, raw):
        self.other(bytes((command,)) + raw[: frame_length(self.end._receives) - 1])

    def other(self, frame: bytes):
        self.image = frame
        self.feed(frame, good=frame == self.good())

    @rule()
    def local_reset(self):
        self.end.request_reset()
        self.ending = True
        self.feed(self.image)

    @rule(on=st.booleans())
    def enable(self, on):
        self.end.enable = on

    @rule(data=st.binary(min_size=14, max_size=14))
    def set_safe_data(self, data):
        self.end.set_safe_data(data[: self.end._sends])

    @rule()
    def power_cycle(self):
        self.end.power_cycle()
        self.heard.clear()

    @invariant()
    def safe_data_only_after_a_full_start_up(self):
        if self.end is None:
            return
        end = self.end
        if end.data_valid or any(end.received_safe_data):
            assert end.state is State.DATA
            assert end.data_valid
            assert self.heard >= FULL | {Command.PROCESS_DATA}
        remaining_ns = end.watchdog_remaining_ns(self.now_ns)
        assert remaining_ns is None or 0 <= remaining_ns <= WATCHDOG_NS


class MainMachine(EndMachine):
    @initialize(sizes=SIZES, app=APPS, running=st.booleans())
    def power_up(self, sizes, app, running):
        self.start(sizes, app, running)

    def make(self, sizes, app):
        return make_main(*sizes, app)

    def good_command(self):
        return {
            State.RESET: Command.RESET,
            State.SESSION: Command.SESSION,
            State.CONNECTION: Command.CONNECTION,
            State.PARAMETER: Command.PARAMETER,
            State.DATA: Command.PROCESS_DATA,
        }[self.end.state]

    def good_text(self, command):
        chunk = self.end._chunk
        return b"\x44\x33"[: len(chunk)] if command == Command.SESSION else chunk


class SubMachine(EndMachine):
    @initialize(sizes=SIZES, app=APPS, running=st.booleans())
    def power_up(self, sizes, app, running):
        self.start(sizes, app, running)

    def make(self, sizes, app):
        return make_sub(*sizes, app)

    def good_command(self):
        end, told = self.end, len(self.end._told)
        if end.state is State.RESET:
            return Command.SESSION
        if end.state is State.SESSION:
            return Command.CONNECTION if end._session_complete() else Command.SESSION
        if end.state is State.CONNECTION:
            return Command.CONNECTION if told < 4 else Command.PARAMETER
        if end.state is State.PARAMETER and told < 6 + len(self.app):
            return Command.PARAMETER
        return Command.PROCESS_DATA

    def good(self, data=b"", command=None):
        fresh = self.end.state is State.RESET and command is None
        if not fresh:
            frame = super().good(data, command)
            if self.end.state is State.SESSION and (command or self.good_command()) == (
                Command.CONNECTION
            ):
                return right(self.end, Command.CONNECTION, self.good_text(0x64), CONNECTION_ID)
            return frame
        bench = Bench(*self.sizes, main=make_main(*self.sizes, ids=counted(len(self.history))))
        bench.until(lambda: bench.main.state is State.SESSION)
        return bench.log[-1]

    def good_text(self, command):
        """The chunk after those told so far (§4)."""
        end, chunk = self.end, self.end._chunk_bytes
        if command == Command.SESSION:
            return b"\x22\x11"[end._session_sent_bytes :][:chunk]
        text = struct.pack("<HH", CONNECTION_ID, ADDRESS)
        first = State.SESSION
        if command == Command.PARAMETER:
            watchdog_ms = WATCHDOG_NS // 1_000_000
            text = struct.pack("<HHH", 2, watchdog_ms, len(self.app)) + self.app
            first = State.CONNECTION
        at = 0 if end.state is first else len(end._told)
        return text[at : at + chunk]


class PairMachine(RuleBasedStateMachine):
    """Both ends over held images with delay; the channel loses, damages, repeats and swaps."""

    def __init__(self):
        super().__init__()
        self.ends = []

    @initialize(
        sizes=SIZES,
        app=APPS,
        delays=st.tuples(st.integers(1, 3), st.integers(1, 3)),
        running=st.booleans(),
    )
    def power_up(self, sizes, app, delays, running):
        self.sizes = sizes
        self.ends = [make_main(*sizes, app), make_sub(*sizes, app)]
        # What lay in the image to the sub, and in that to the main, in every cycle so far.
        self.held: list[list[bytes | None]] = [[None], [None]]
        self.delays = delays
        self.wants = [True, True]
        self.given = [{bytes(size)} for size in sizes]
        self.counter = 0
        chunk = min(sizes)
        exchanges = 2 + math.ceil(2 / chunk) + math.ceil(4 / chunk)
        self.exchanges = exchanges + math.ceil((6 + len(app)) / chunk)
        if running:
            self.recovers()

    @property
    def recovery_cycles(self) -> int:
        """One watchdog for what was lost, then a start-up (§4).

        Two exchanges more: what lay in the images when the faults stopped may end the first
        attempt by another Reset, as §10 says.
        """
        round_trip = sum(self.delays)
        return WATCHDOG_NS // 1_000_000 + 1 + (self.exchanges + 2) * round_trip

    def cycle(self, lost=(False, False), frames=(None, None)):
        """One millisecond; ``lost`` keeps the old image, ``frames`` puts others in their place."""
        self.counter += 1
        for n, end in enumerate(self.ends):
            end.enable = self.wants[n] and end.state is State.DATA
            peer_images = self.held[1 - n]
            image = peer_images[max(0, len(peer_images) - self.delays[1 - n])]
            if frames[n] is not None:
                image = frames[n]
            answer = end.step(self.counter * 1_000_000, None if lost[n] else image)
            self.held[n].append(self.held[n][-1] if answer is None else answer)

    @rule(count=st.integers(1, 60))
    def run(self, count):
        for _ in range(count):
            self.cycle()

    @rule(
        main=st.booleans(), sub=st.booleans(), count=st.sampled_from([1, 2, 5, 18, 19, 20, 21, 45])
    )
    def lose(self, main, sub, count):
        for _ in range(count):
            self.cycle(lost=(main, sub))

    def put(self, to: int, frame: bytes | None):
        self.cycle(frames=(frame, None) if to == 0 else (None, frame))

    @rule(to=st.integers(0, 1), at=st.integers(0, 60), bit=st.integers(0, 7))
    def corrupt(self, to, at, bit):
        frame = self.held[1 - to][-1]
        if frame is not None:
            bad = bytearray(frame)
            bad[at % len(bad)] ^= 1 << bit
            self.put(to, bytes(bad))

    @rule(to=st.integers(0, 1), back=st.integers(1, 60))
    def replay(self, to, back):
        images = self.held[1 - to]
        self.put(to, images[max(0, len(images) - back)])

    @rule(to=st.integers(0, 1))
    def reflect(self, to):
        self.put(to, self.held[to][-1])

    @rule(to=st.integers(0, 1), n=st.integers(0, 200))
    def of_another_connection(self, to, n):
        frames = foreign_frames(self.sizes)
        self.put(to, frames[n % len(frames)])

    @rule(to=st.integers(0, 1), raw=st.binary(max_size=40))
    def random_bytes(self, to, raw):
        self.put(to, raw)

    @rule(n=st.integers(0, 1))
    def local_reset(self, n):
        self.ends[n].request_reset()
        self.cycle()

    @rule(n=st.integers(0, 1))
    def power_cycle(self, n):
        self.ends[n].power_cycle()
        self.cycle()

    @rule(n=st.integers(0, 1), on=st.booleans())
    def enable(self, n, on):
        self.wants[n] = on
        self.cycle()

    @rule(n=st.integers(0, 1), data=st.binary(min_size=14, max_size=14))
    def set_safe_data(self, n, data):
        data = data[: self.sizes[n]]
        self.given[n].add(data)
        self.ends[n].set_safe_data(data)
        self.cycle()

    @rule()
    def recovers(self):
        """When the faults stop both are back in Data, and what they want comes through."""
        for cycle in range(self.recovery_cycles):
            if cycle and all(end.state is State.DATA for end in self.ends):
                break
            self.cycle()
        settle = 3 * sum(self.delays)
        for _ in range(settle):
            self.cycle()
        for n, end in enumerate(self.ends):
            assert end.state is State.DATA
            assert end.data_valid == self.wants[1 - n]
            if end.data_valid:
                assert end.received_safe_data == self.ends[1 - n]._tx_safe

    def teardown(self):
        if self.ends:
            self.recovers()

    @invariant()
    def only_what_the_peer_gave(self):
        for n, end in enumerate(self.ends):
            if end.data_valid:
                assert end.state is State.DATA
                assert end.received_safe_data in self.given[1 - n]
            else:
                assert not any(end.received_safe_data)


FEW = settings(max_examples=examples(60), stateful_step_count=40)
TestMain = MainMachine.TestCase
TestMain.settings = FEW
TestSub = SubMachine.TestCase
TestSub.settings = FEW
TestPair = PairMachine.TestCase
TestPair.settings = FEW
