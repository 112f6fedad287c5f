"""Both ends of a connection on a bench: bring them into a state, feed them crafted frames."""

from __future__ import annotations

from fsoe_net.fsoe.chain import Chain
from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.event import EventKind, State
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import Command, Pdu, decode_pdu
from fsoe_net.fsoe.sub_instance import SubInstance

CONNECTION_ID = 0xABCD
ADDRESS = 0x1234
WATCHDOG_MS = 20
WATCHDOG_NS = WATCHDOG_MS * 1_000_000
RUNNING = (State.SESSION, State.CONNECTION, State.PARAMETER, State.DATA)
COMMAND_OF = {
    State.SESSION: Command.SESSION,
    State.CONNECTION: Command.CONNECTION,
    State.PARAMETER: Command.PARAMETER,
    State.DATA: Command.PROCESS_DATA,
}


class counted:  # noqa: N801 - used like a function
    """Session ids that change with every draw."""

    def __init__(self, first: int = 0x1122, step: int = 0x1357):
        self.value, self.step = first - step, step

    def __call__(self) -> int:
        self.value = (self.value + self.step) & 0xFFFF
        return self.value


def make_main(out=2, inn=2, app=b"", ids=None, **changes) -> MainInstance:
    values = {
        "connection_id": CONNECTION_ID,
        "address": ADDRESS,
        "watchdog_ms": WATCHDOG_MS,
        "safe_out_bytes": out,
        "safe_in_bytes": inn,
        "app_parameters": app,
    }
    return MainInstance(MainConfig(**(values | changes)), session_ids=ids or counted())


def make_sub(out=2, inn=2, app=b"", ids=None, **changes) -> SubInstance:
    values = {
        "address": ADDRESS,
        "safe_out_bytes": out,
        "safe_in_bytes": inn,
        "app_parameter_bytes": len(app),
    }
    return SubInstance(SubConfig(**(values | changes)), session_ids=ids or counted(0x3344))


class Bench:
    """A main and a sub in lockstep; stops where a test wants to interfere."""

    def __init__(self, out=2, inn=2, app=b"", main=None, sub=None):
        self.main = main or make_main(out, inn, app)
        self.sub = sub or make_sub(out, inn, app)
        self.now_ns = 0
        self.to_sub: bytes | None = None
        self.to_main: bytes | None = None
        self.log: list[bytes] = []

    def main_turn(self):
        sent = self.main.step(self.now_ns, self.to_main)
        if sent is not None:
            self.to_sub = sent
            self.log.append(sent)
        return sent

    def sub_turn(self):
        sent = self.sub.step(self.now_ns, self.to_sub)
        if sent is not None:
            self.to_main = sent
            self.log.append(sent)
        return sent

    def cycle(self):
        self.main_turn()
        self.sub_turn()

    def until(self, done, limit=200):
        for _ in range(limit):
            if done():
                return self
            self.main_turn()
            if done():
                return self
            self.sub_turn()
        raise AssertionError("never came there")

    def to_data(self):
        return self.until(
            lambda: self.main.state is State.DATA and self.sub.state is State.DATA, 200_000
        )


def main_in(state: State, chunk: int = 1, out=2, inn=2, app=b"") -> MainInstance:
    """A main which has sent chunk number ``chunk`` of this state and waits for the answer."""
    bench = Bench(out, inn, app)
    size = min(out, inn)
    if state is State.RESET:
        bench.main_turn()
    elif state is State.DATA:
        bench.until(lambda: bench.main.state is state)
    else:
        bench.until(lambda: bench.main.state is state and bench.main._sent_bytes == chunk * size)
    bench.main.take_events()
    return bench.main


def sub_in(state: State, chunk: int = 1, out=2, inn=2, app=b"", **changes) -> SubInstance:
    """A sub which has answered chunk number ``chunk`` of this state."""
    bench = Bench(out, inn, app, sub=make_sub(out, inn, app, **changes))
    sub, size = bench.sub, min(out, inn)
    if state is State.RESET:
        bench.cycle()
    elif state is State.SESSION:
        bench.until(lambda: sub.state is state and sub._session_sent_bytes == chunk * size)
    elif state is State.DATA:
        bench.to_data()
    else:
        bench.until(lambda: sub.state is state and len(sub._told) == chunk * size)
    sub.take_events()
    return sub


def right(end, command, data: bytes, connection_id: int | None = None) -> bytes:
    """A frame whose CRCs this end will find right."""
    chain = Chain(last=end._chain.last, own=end._chain.peer, tx_sequence=end._chain.rx_sequence)
    ident = end.connection_id if connection_id is None else connection_id
    return chain.send(command, data.ljust(end._receives, b"\0"), ident)


def wrong_crc(frame: bytes) -> bytes:
    """The same frame with one bit of its first CRC turned."""
    at = 2 if len(frame) == 6 else 3
    return frame[:at] + bytes((frame[at] ^ 1,)) + frame[at + 1 :]


def is_reset(frame: bytes | None, code: int) -> bool:
    return frame is not None and frame[0] == Command.RESET and frame[1] == code


def last_reset(end) -> tuple[EventKind, int]:
    events = [event for event in end.take_events() if event.kind is not EventKind.STATE]
    assert len(events) == 1
    return events[0].kind, events[0].code


def parts(frame: bytes | None) -> Pdu:
    assert frame is not None
    return decode_pdu(frame)
