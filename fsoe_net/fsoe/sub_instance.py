"""FSoE SubInstance: the table of §6, rows tried from top to bottom."""

from __future__ import annotations

from fsoe_net.fsoe.chain import valid_from_start
from fsoe_net.fsoe.instance import (
    EventKind,
    Instance,
    SessionIds,
    State,
    SubConfig,
    is_data,
    is_known,
)
from fsoe_net.fsoe.pdu import Command, Pdu, ResetCode

__all__ = ["SubInstance"]

_COMM_PARAMETER_BYTES = 6
_CONNECTION_BYTES = 4
_SESSION_BYTES = 2


class SubInstance(Instance):
    """The end in a safe input, output or drive.

    Args:
        config: Address, sizes, expected parameters.
        session_ids: Source of session ids: random live, counted in tests.
    """

    def __init__(self, config: SubConfig, *, session_ids: SessionIds) -> None:
        super().__init__(
            sends=config.safe_to_main, receives=config.safe_to_sub, session_ids=session_ids
        )
        self.config = config
        self._watchdog_ns = 0
        self._got = bytearray()
        self._session = b""
        self._session_sent = 0

    def step(self, now_ns: int, received: bytes | None) -> bytes | None:
        """Read at most one frame and send at most one; see `MainInstance.step`."""
        self._now_ns = now_ns
        if self._reset_requested:  # row 1, also while in Reset
            self._reset_requested = False
            return self._reset(ResetCode.LOCAL)
        if self.state is State.DATA and self._expired():  # row 2, before the frame is looked at
            return self._reset(ResetCode.WATCHDOG)
        pdu = self._new_frame(received)
        if pdu is None:  # row 3
            return None
        if not is_known(pdu.command):  # row 7
            return self._reset(ResetCode.UNKNOWN_COMMAND)
        if pdu.command == Command.RESET:
            return self._on_reset(pdu)
        if pdu.command == Command.SESSION:
            return self._on_session(pdu)
        return self._on_other(pdu)

    def watchdog_remaining_ns(self, now_ns: int) -> int | None:
        """Return the time left, or ``None`` outside Data, where it does not run (§8)."""
        if self._watchdog_start_ns is None:
            return None
        return max(0, self._watchdog_start_ns + self._watchdog_ns - now_ns)

    def power_cycle(self) -> None:
        """Forget everything, as after switching the device off and on."""
        self.__init__(self.config, session_ids=self._session_ids)  # type: ignore[misc]

    def _expired(self) -> bool:
        start = self._watchdog_start_ns
        return start is not None and self._now_ns - start >= self._watchdog_ns

    def _reset(self, code: int) -> bytes:
        self._watchdog_start_ns = None
        return super()._reset(code)

    def _on_reset(self, pdu: Pdu) -> bytes:
        if self.state is not State.RESET and not valid_from_start(pdu):
            return self._reset(ResetCode.CRC)  # row 6
        # Rows 4 and 5; in Reset the CRC is not checked.
        self._log(EventKind.RESET_RECEIVED, pdu.safe_data[0], self.state)
        return self._reset(ResetCode.LOCAL)

    def _on_session(self, pdu: Pdu) -> bytes:
        in_session = self.state is State.SESSION
        complete = self._session_sent >= _SESSION_BYTES
        if in_session and not complete and self._chain.accept(pdu):  # row 8
            return self._session_chunk()
        if valid_from_start(pdu):  # row 9; §16: also as the very first frame after power-up
            return self._new_session(pdu)
        if in_session and complete and self._chain.accept(pdu):
            return self._reset(ResetCode.COMMAND)  # row 10
        return self._reset(ResetCode.CRC)  # row 11

    def _new_session(self, pdu: Pdu) -> bytes:
        self._chain.clear()
        self._chain.accept(pdu)
        self._fail_safe()
        self.enable = False
        self._watchdog_start_ns = None
        self.connection_id = 0
        self._session = self._draw_session_id(self._chain.last)
        self._session_sent = 0
        self._enter(State.SESSION)
        return self._session_chunk()

    def _session_chunk(self) -> bytes:
        chunk = self._session[self._session_sent : self._session_sent + self._chunk]
        self._session_sent += self._chunk
        return self._send(Command.SESSION, chunk)

    def _on_other(self, pdu: Pdu) -> bytes:
        """Rows 12 … 23: Connection, Parameter, ProcessData, FailSafeData."""
        if self.state is State.SESSION:
            return self._in_session(pdu)
        if self.state is State.CONNECTION:
            return self._in_connection(pdu)
        if self.state is State.PARAMETER:
            return self._in_parameter(pdu)
        if self.state is State.DATA and is_data(pdu.command):
            return self._data(pdu)  # rows 22, 23
        return self._reset(ResetCode.COMMAND)  # rows 12, 21

    def _in_session(self, pdu: Pdu) -> bytes:
        if pdu.command != Command.CONNECTION or self._session_sent < _SESSION_BYTES:
            return self._reset(ResetCode.COMMAND)  # row 13
        if pdu.connection_id == 0:  # row 14
            return self._reset(ResetCode.CONNECTION_ID)
        if not self._chain.accept(pdu):
            return self._reset(ResetCode.CRC)
        self.connection_id = pdu.connection_id
        self._got = bytearray()
        self._enter(State.CONNECTION)
        return self._echo(pdu, Command.CONNECTION)

    def _in_connection(self, pdu: Pdu) -> bytes:
        complete = len(self._got) >= _CONNECTION_BYTES
        wanted = Command.PARAMETER if complete else Command.CONNECTION
        if pdu.command != wanted:
            return self._reset(ResetCode.COMMAND)  # row 16
        if pdu.connection_id != self.connection_id:  # rows 15, 17
            return self._reset(ResetCode.CONNECTION_ID)
        if not complete:
            return self._checked_echo(pdu, Command.CONNECTION)
        if int.from_bytes(self._got[0:2], "little") != self.connection_id:
            return self._reset(ResetCode.CONNECTION_ID)
        if int.from_bytes(self._got[2:4], "little") != self.config.address:
            return self._reset(ResetCode.ADDRESS)
        if not self._chain.accept(pdu):
            return self._reset(ResetCode.CRC)
        self._got = bytearray()
        self._enter(State.PARAMETER)
        return self._echo(pdu, Command.PARAMETER)

    def _in_parameter(self, pdu: Pdu) -> bytes:
        complete = len(self._got) >= self._parameter_bytes
        if pdu.command == Command.PARAMETER and not complete:  # row 18
            if pdu.connection_id != self.connection_id:
                return self._reset(ResetCode.CONNECTION_ID)
            return self._checked_echo(pdu, Command.PARAMETER)
        if not complete or not is_data(pdu.command):
            return self._reset(ResetCode.COMMAND)  # row 19
        if pdu.connection_id != self.connection_id:  # row 20
            return self._reset(ResetCode.CONNECTION_ID)
        code = self._parameter_verdict()
        if code:
            return self._reset(code)
        return self._data(pdu)

    @property
    def _parameter_bytes(self) -> int:
        return _COMM_PARAMETER_BYTES + self.config.app_parameter_bytes

    def _parameter_verdict(self) -> int:
        """Row 20, in this order: length word, application length, application's verdict."""
        length, watchdog_ms, app_bytes = (
            int.from_bytes(self._got[n : n + 2], "little") for n in (0, 2, 4)
        )
        if length != 2:
            return ResetCode.COMM_PARAMETER_LENGTH
        if app_bytes != self.config.app_parameter_bytes:
            return ResetCode.APP_PARAMETER_LENGTH
        if watchdog_ms == 0:  # §16: some stacks hang on it
            return ResetCode.COMM_PARAMETER
        if self.config.verify is not None:
            parameters = bytes(self._got[_COMM_PARAMETER_BYTES : self._parameter_bytes])
            code = self.config.verify(watchdog_ms, parameters)
            if code:
                known = code in (ResetCode.COMM_PARAMETER, ResetCode.APP_PARAMETER) or code >= 0x80
                return code & 0xFF if known else ResetCode.APP_PARAMETER
        self._watchdog_ns = watchdog_ms * 1_000_000
        return 0

    def _data(self, pdu: Pdu) -> bytes:
        if pdu.connection_id != self.connection_id:
            return self._reset(ResetCode.CONNECTION_ID)
        if not self._chain.accept(pdu):
            return self._reset(ResetCode.CRC)
        self._enter(State.DATA)
        self._take_data(pdu)
        self._watchdog_start_ns = self._now_ns
        return self._send_data()

    def _checked_echo(self, pdu: Pdu, command: Command) -> bytes:
        if not self._chain.accept(pdu):
            return self._reset(ResetCode.CRC)
        return self._echo(pdu, command)

    def _echo(self, pdu: Pdu, command: Command) -> bytes:
        """Return the chunk as received; §4: the first Parameter frame is cut to the expected."""
        chunk = pdu.safe_data[: self._chunk]
        if command is Command.PARAMETER and not self._got:
            kept = chunk[: self._parameter_bytes]
            chunk = kept + bytes(len(chunk) - len(kept))
        self._got += chunk
        return self._send(command, chunk)
