"""FSoE MainInstance: the table of §5, rows tried from top to bottom."""

from __future__ import annotations

from fsoe_net.fsoe.instance import EventKind, Instance, MainConfig, SessionIds, State, is_known
from fsoe_net.fsoe.pdu import Command, Pdu, ResetCode

__all__ = ["MainInstance"]

_COMMANDS = {
    State.SESSION: (Command.SESSION,),
    State.CONNECTION: (Command.CONNECTION,),
    State.PARAMETER: (Command.PARAMETER,),
    State.DATA: (Command.PROCESS_DATA, Command.FAIL_SAFE_DATA),
}
_COMMAND_OF = {
    State.SESSION: Command.SESSION,
    State.CONNECTION: Command.CONNECTION,
    State.PARAMETER: Command.PARAMETER,
}


class MainInstance(Instance):
    """The end that opens the connection, in a safety logic.

    Args:
        config: Addresses, sizes, watchdog, parameters.
        session_ids: Source of session ids: random live, counted in tests.
    """

    def __init__(self, config: MainConfig, *, session_ids: SessionIds) -> None:
        super().__init__(
            sends=config.safe_to_sub, receives=config.safe_to_main, session_ids=session_ids
        )
        self.config = config
        self._watchdog_ns = config.watchdog_ms * 1_000_000
        self._started = False
        self._payload = b""
        self._sent = 0

    def step(self, now_ns: int, received: bytes | None) -> bytes | None:
        """Read at most one frame and send at most one.

        Args:
            now_ns: Monotonic time; never decreases.
            received: Bytes in the input image, ``None`` when nothing was ever delivered.

        Returns:
            The frame to put into the output image, ``None`` to leave the image as it is.
        """
        self._now_ns = now_ns
        if not self._started or self._reset_requested:  # row 1 and power-up
            self._started, self._reset_requested = True, False
            return self._reset_and_watch(ResetCode.LOCAL)
        if self._expired():  # rows 2, 3; §8: before the frame is looked at
            if self.state is State.RESET:
                return self._start_session()
            return self._reset_and_watch(ResetCode.WATCHDOG)
        pdu = self._new_frame(received)
        if pdu is None:  # row 4
            return None
        if self.state is State.RESET:
            return self._in_reset(pdu)
        return self._connected(pdu)

    def watchdog_remaining_ns(self, now_ns: int) -> int | None:
        """Return the time left, or ``None`` before the first step."""
        if self._watchdog_start_ns is None:
            return None
        return max(0, self._watchdog_start_ns + self._watchdog_ns - now_ns)

    def power_cycle(self) -> None:
        """Forget everything, as after switching the device off and on."""
        self.__init__(self.config, session_ids=self._session_ids)  # type: ignore[misc]

    def _expired(self) -> bool:
        start = self._watchdog_start_ns
        return start is not None and self._now_ns - start >= self._watchdog_ns

    def _reset_and_watch(self, code: int) -> bytes:
        self._watchdog_start_ns = self._now_ns
        return self._reset(code)

    def _in_reset(self, pdu: Pdu) -> bytes | None:
        if pdu.command == Command.RESET:  # row 5: any code, ConnID and CRC
            self._log(EventKind.RESET_RECEIVED, pdu.safe_data[0], self.state)
            return self._start_session()
        return self._reset(ResetCode.LOCAL)  # row 5.1: the watchdog keeps running

    def _connected(self, pdu: Pdu) -> bytes | None:
        if pdu.command == Command.RESET:  # row 6
            self._log(EventKind.RESET_RECEIVED, pdu.safe_data[0], self.state)
            self._fail_safe()
            self.enable = False
            return self._start_session()
        code = self._error(pdu)
        if code is not None:
            return self._reset_and_watch(code)
        first_session = self.state is State.SESSION and self._sent <= self._chunk
        if not self._chain.accept(pdu):
            if first_session:  # row 11, §16: send nothing, change nothing, watchdog keeps running
                return None
            return self._reset_and_watch(ResetCode.CRC)  # row 12
        return self._advance(pdu)

    def _error(self, pdu: Pdu) -> int | None:
        """Rows 7 … 10; their order decides which code a frame with several errors gets."""
        if not is_known(pdu.command):
            return ResetCode.UNKNOWN_COMMAND
        if pdu.command not in _COMMANDS[self.state]:
            return ResetCode.COMMAND
        if self.state is State.SESSION:
            return None  # §4: the ConnID field of Session frames is not checked
        if pdu.connection_id != self.connection_id:
            return ResetCode.CONNECTION_ID
        if self.state is not State.DATA:
            chunk = self._payload[max(0, self._sent - self._chunk) : self._sent]
            start = self._sent - self._chunk
            chunk = self._payload[start : self._sent]
            if pdu.safe_data[: len(chunk)] != chunk:
                return ResetCode.ECHO
        return None

    def _advance(self, pdu: Pdu) -> bytes:
        """Rows 13 … 20: a right frame was accepted."""
        if self.state is State.DATA:
            self._take_data(pdu)
            return self._watched(self._send_data())
        if self._sent < len(self._payload):
            return self._next_chunk()
        config = self.config
        if self.state is State.SESSION:
            self.connection_id = config.connection_id
            words = config.connection_id.to_bytes(2, "little")
            return self._begin(State.CONNECTION, words + config.address.to_bytes(2, "little"))
        if self.state is State.CONNECTION:
            parameters = config.app_parameters
            header = b"".join(
                word.to_bytes(2, "little") for word in (2, config.watchdog_ms, len(parameters))
            )
            return self._begin(State.PARAMETER, header + parameters)
        self._enter(State.DATA)
        return self._watched(self._send_data())

    def _start_session(self) -> bytes:
        self._chain.clear()
        self.connection_id = 0
        return self._begin(State.SESSION, self._draw_session_id(0))

    def _begin(self, state: State, payload: bytes) -> bytes:
        self._enter(state)
        self._payload, self._sent = payload, 0
        return self._next_chunk()

    def _next_chunk(self) -> bytes:
        chunk = self._payload[self._sent : self._sent + self._chunk]
        self._sent += self._chunk
        return self._watched(self._send(_COMMAND_OF[self.state], chunk))

    def _watched(self, frame: bytes) -> bytes:
        """Every frame sent restarts the watchdog, except the repeated Reset (§8)."""
        self._watchdog_start_ns = self._now_ns
        return frame
