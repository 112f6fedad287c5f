"""FSoE MainInstance: the table of §5, rows tried from top to bottom."""

from __future__ import annotations

import struct
from collections.abc import Callable

from fsoe_net.fsoe.config import MainConfig
from fsoe_net.fsoe.event import EventKind, State
from fsoe_net.fsoe.instance import Instance
from fsoe_net.fsoe.pdu import Command, Pdu, ResetCode

_KNOWN = frozenset(Command)
_ALLOWED = {
    State.SESSION: frozenset({Command.SESSION}),
    State.CONNECTION: frozenset({Command.CONNECTION}),
    State.PARAMETER: frozenset({Command.PARAMETER}),
    State.DATA: frozenset({Command.PROCESS_DATA, Command.FAIL_SAFE_DATA}),
}
_STARTUP_COMMAND = {
    State.SESSION: Command.SESSION,
    State.CONNECTION: Command.CONNECTION,
    State.PARAMETER: Command.PARAMETER,
}


class MainInstance(Instance):
    """The end that opens the connection, in a safety logic.

    Args:
        config: Addresses, sizes, watchdog, parameters.
        session_ids: Source of 16-bit session ids, one call per session: random live, counted in
            tests.
    """

    def __init__(self, config: MainConfig, *, session_ids: Callable[[], int]) -> None:
        self.config = config
        super().__init__(
            sends=config.safe_out_bytes, receives=config.safe_in_bytes, session_ids=session_ids
        )

    def _power_up(self) -> None:
        super()._power_up()
        self._watchdog_ns = self.config.watchdog_ms * 1_000_000
        self._payload = b""  # data that the current state must send to the SubInstance
        self._chunk = b""  # the part of it that was sent last
        self._sent_bytes = 0
        self._reset_requested = True  # the first call sends a Reset before anything is read

    def step(self, now_ns: int, received: bytes | None) -> bytes | None:  # noqa: D102 - inherited
        self._now_ns = now_ns
        if self._reset_requested:  # row 1
            self._reset_requested = False
            return self._fail(ResetCode.LOCAL)
        if self._watchdog_expired():  # §8: before the frame is looked at
            if self.state is State.RESET:
                return self._start_session()  # row 2
            return self._fail(ResetCode.WATCHDOG)  # row 3
        pdu = self._new_frame(received)
        if pdu is None:
            return None  # row 4
        if pdu.command == Command.RESET:
            return self._on_reset(pdu)  # rows 5, 6
        if self.state is State.RESET:
            return self._reset(ResetCode.LOCAL)  # row 5.1: the watchdog keeps running
        code = self._error(pdu)
        if code is not None:
            return self._fail(code)  # rows 7 … 10
        if not self._chain.receive(pdu):
            return self._on_wrong_crc()  # rows 11, 12
        return self._on_right(pdu)  # rows 13 … 20

    def _on_reset(self, pdu: Pdu) -> bytes:
        """Rows 5 and 6: any code, ConnID and CRC (§14); answered by a Session, never a Reset."""
        code = pdu.safe_data[0]
        if self.state is State.RESET:
            return self._start_session(code=code)  # row 5; §9: does not clear the enable
        self._clear_safe_data()
        return self._start_session(EventKind.RESET_BY_PEER, code)  # row 6

    def _error(self, pdu: Pdu) -> ResetCode | None:
        """Rows 7 … 10: their order decides which code applies to a frame with several errors."""
        if pdu.command not in _KNOWN:
            return ResetCode.UNKNOWN_COMMAND  # row 7
        if pdu.command not in _ALLOWED[self.state]:
            return ResetCode.COMMAND  # row 8
        if self.state is State.SESSION:
            return None  # §4: the ConnID field of Session frames is not checked
        if pdu.connection_id != self.connection_id:
            return ResetCode.CONNECTION_ID  # row 9
        if self.state is not State.DATA and not pdu.safe_data.startswith(self._chunk):
            return ResetCode.ECHO  # row 10; §4: padding is not compared
        return None

    def _on_wrong_crc(self) -> bytes | None:
        if self.state is State.SESSION and self._sent_bytes <= self._chunk_bytes:
            # Row 11. §11.2, §16: send nothing, keep the chain and the watchdog unchanged; the reply
            # to the previous session must not disturb this one.
            return None
        return self._fail(ResetCode.CRC)  # row 12

    def _on_right(self, pdu: Pdu) -> bytes:
        if self.state is State.DATA:
            self._take_data(pdu)  # rows 19, 20
            return self._watched(self._send_data())
        if self._sent_bytes < len(self._payload):
            return self._next_chunk()  # rows 13, 15, 17
        if self.state is State.SESSION:
            return self._start_connection()  # row 14
        if self.state is State.CONNECTION:
            return self._start_parameter()  # row 16
        self._enter(State.DATA)  # row 18
        return self._watched(self._send_data())

    def _start_session(self, kind: EventKind = EventKind.STATE, code: int = 0) -> bytes:
        self._chain.clear()
        self.connection_id = 0
        self._enter(State.SESSION, kind, code)
        return self._begin(self._draw_session_id())

    def _start_connection(self) -> bytes:
        """Byte    0..1      2..3: ConnID and FSoE address."""
        self.connection_id = self.config.connection_id
        self._enter(State.CONNECTION)
        return self._begin(struct.pack("<HH", self.connection_id, self.config.address))

    def _start_parameter(self) -> bytes:
        """Send the watchdog and the application parameters (§4).

        Byte    0..1    2..3        4..5    6 ...
              +-------+-----------+-------+------------------------+
              |   2   | watchdog  |   a   | a application bytes    |
              +-------+-----------+-------+------------------------+
        """
        app = self.config.app_parameters
        self._enter(State.PARAMETER)
        return self._begin(struct.pack("<HHH", 2, self.config.watchdog_ms, len(app)) + app)

    def _begin(self, payload: bytes) -> bytes:
        self._payload, self._sent_bytes = payload, 0
        return self._next_chunk()

    def _next_chunk(self) -> bytes:
        start = self._sent_bytes
        self._sent_bytes += self._chunk_bytes
        self._chunk = self._payload[start : self._sent_bytes]
        return self._watched(self._send(_STARTUP_COMMAND[self.state], self._chunk))

    def _fail(self, code: ResetCode) -> bytes:
        return self._watched(self._reset(code))

    def _watched(self, frame: bytes) -> bytes:
        """§8: every frame sent restarts the watchdog, except the repeated Reset of row 5.1."""
        self._watchdog_start_ns = self._now_ns
        return frame
