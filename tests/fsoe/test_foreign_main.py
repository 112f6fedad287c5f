"""A third party's main talks to our sub: optional, only when `fsoe_master` is installed.

Its licence is non-commercial, so it is never a dependency; only its public interface is used. It
draws session ids and measures its watchdog itself; the watchdog is long enough never to matter.
"""

import pytest
from fsoe.foreign import ForeignMain, load
from fsoe.pair import ADDRESS, last_reset, make_sub
from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.fsoe.crc import sra_crc
from fsoe_net.fsoe.event import EventKind, State
from fsoe_net.fsoe.pdu import Command, ResetCode, decode_pdu

foreign = load()
START_UP = [
    Command.RESET,
    Command.SESSION,
    Command.CONNECTION,
    Command.PARAMETER,
    Command.FAIL_SAFE_DATA,
]
ENOUGH = 400  # cycles for two start-ups, byte by byte, with application parameters
SIZES = [
    (1, 1),
    (1, 2),
    (2, 1),
    (1, 16),
    (16, 1),
    (2, 2),
    (4, 2),
    (2, 6),
    (6, 4),
    (14, 6),
    (16, 16),
]


class Pair:
    """Their main and our sub without delay; time stands still, so no watchdog of ours expires."""

    def __init__(self, main: ForeignMain, sub):
        self.main, self.sub = main, sub
        self.answers: list[bytes] = []
        main.handler.start()

    def cycle(self, count=1):
        for _ in range(count):
            answer = self.sub.step(0, bytes(self.main.handler.get_request()))
            if answer is not None:
                self.answers.append(answer)
                self.main.handler.set_reply(answer)

    def to_data(self):
        for _ in range(ENOUGH):
            if self.sub.state is State.DATA and self.main.handler.state is foreign.StateData:
                return
            self.cycle()
        raise AssertionError(f"their {self.main.handler.state}, our {self.sub.state}")

    def exchange(self, out: bytes, inn: bytes):
        """Both applications enable and send; both must see what the other sent."""
        self.main.set_outputs(out)
        self.main.handler.set_fail_safe(False)
        self.sub.set_safe_data(inn)
        self.sub.enable = True
        self.cycle(4)
        assert self.sub.data_valid
        assert self.sub.received_safe_data == out
        assert self.main.inputs() == inn


@pytest.fixture
def make_pair():
    """Pairs; each main of the package runs a thread that must be ended."""
    made = []

    def make(out=2, inn=2, parameters=(), address=ADDRESS, **changes):
        app = b"".join(value.to_bytes(size, "little") for value, size in parameters)
        made.append(ForeignMain(foreign, out, inn, parameters, address))
        return Pair(made[-1], make_sub(out, inn, app, **changes))

    yield make
    for main in made:
        main.handler.delete()


def pattern(size: int, seed: int) -> bytes:
    return bytes((seed + 37 * n) & 0xFF for n in range(size))


@pytest.mark.shows("R17")
@pytest.mark.parametrize("sizes", SIZES, ids=str)
def test_data_flow_both_ways(make_pair, sizes):
    pair = make_pair(*sizes)
    pair.to_data()
    seen = [decode_pdu(answer).command for answer in pair.answers]
    assert list(dict.fromkeys(seen)) == START_UP
    assert not pair.sub.data_valid
    for seed in (0x11, 0x9C, 0x9C):
        pair.exchange(pattern(sizes[0], seed), pattern(sizes[1], seed + 3))
    pair.cycle(2000)
    pair.exchange(pattern(sizes[0], 5), pattern(sizes[1], 6))
    pair.main.handler.set_fail_safe(True)
    pair.cycle(2)
    assert not pair.sub.data_valid
    assert not any(pair.sub.received_safe_data)


WORDS = [0x1234, 0xFFFF, 0, 7]
SRA = sra_crc(b"".join(word.to_bytes(2, "little") for word in WORDS))
PARAMETERS = {
    "none": [],
    "one byte": [(0xA5, 1)],
    "three words": [(0x0102, 2), (0x0304, 2), (0, 2)],
    "SRA CRC first": [(SRA, 4), *((word, 2) for word in WORDS)],
}


@pytest.mark.parametrize("sizes", [(1, 1), (2, 6), (14, 4), (16, 16)], ids=str)
@pytest.mark.parametrize("name", PARAMETERS)
def test_application_parameters_reach_the_sub(make_pair, sizes, name):
    told = []
    pair = make_pair(*sizes, PARAMETERS[name], verify=lambda given: told.append(given) or 0)
    pair.to_data()
    pair.exchange(pattern(sizes[0], 1), pattern(sizes[1], 2))
    app = b"".join(value.to_bytes(size, "little") for value, size in PARAMETERS[name])
    assert [(given.watchdog_ms, given.app_parameters) for given in told] == [(30_000, app)]
    if name == "SRA CRC first":
        assert sra_crc(app[4:]) == int.from_bytes(app[:4], "little")


@given(st.lists(st.integers(0, 0xFFFF), max_size=40))
def test_sra_crc_is_that_of_the_foreign_main(words):
    ours = sra_crc(b"".join(word.to_bytes(2, "little") for word in words))
    assert ours == foreign.calculate_sra_crc(words)


@pytest.mark.parametrize("sizes", [(1, 1), (2, 2), (14, 6)], ids=str)
@pytest.mark.parametrize("who", ["their main", "our sub", "our sub, power cycle"])
def test_connection_recovers_from_a_reset(make_pair, sizes, who):
    pair = make_pair(*sizes)
    pair.to_data()
    pair.exchange(pattern(sizes[0], 1), pattern(sizes[1], 2))
    pair.sub.take_events()
    if who == "their main":
        pair.main.handler.reset()
        pair.cycle()
        assert last_reset(pair.sub)[0] is EventKind.RESET_BY_PEER
    elif who == "our sub":
        pair.sub.request_reset()
        pair.cycle()
        assert pair.answers[-1][:2] == bytes((Command.RESET, 0))
    else:
        pair.sub.power_cycle()
        pair.cycle()
    assert pair.sub.state is not State.DATA
    assert not pair.sub.data_valid
    assert not any(pair.sub.received_safe_data)
    pair.to_data()
    assert not pair.sub.data_valid  # both applications must enable again
    pair.exchange(pattern(sizes[0], 3), pattern(sizes[1], 4))


@pytest.mark.shows("R17")
@pytest.mark.parametrize("sizes", [(1, 1), (2, 4), (16, 16)], ids=str)
def test_a_wrong_address_never_comes_to_data(make_pair, sizes):
    pair = make_pair(*sizes, address=ADDRESS + 1)
    for _ in range(ENOUGH):
        pair.cycle()
        assert pair.sub.state in (State.RESET, State.SESSION, State.CONNECTION)
    local = [e.code for e in pair.sub.take_events() if e.kind is EventKind.RESET_LOCAL]
    assert ResetCode.ADDRESS in local
    sent = [answer[:2] for answer in pair.answers]
    assert bytes((Command.RESET, ResetCode.ADDRESS)) in sent
    assert not {Command.PARAMETER, Command.FAIL_SAFE_DATA} & {frame[0] for frame in sent}
