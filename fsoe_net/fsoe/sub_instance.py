"""FSoE SubInstance: the table of §6, rows tried from top to bottom."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from fsoe_net.errors import InputError
from fsoe_net.fsoe.chain import fits_start
from fsoe_net.fsoe.config import Parameters, SubConfig
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.instance import Instance
from fsoe_net.fsoe.pdu import Command, Pdu, ResetCode

_KNOWN = frozenset(Command)
_DATA_COMMANDS = frozenset({Command.PROCESS_DATA, Command.FAIL_SAFE_DATA})
_SESSION_BYTES = 2
_CONNECTION_BYTES = 4
_COMM_BYTES = 6


class SubInstance(Instance):
    """The end that answers, in a safe input, output or drive.

    Args:
        config: Address, sizes, expected parameters.
        session_ids: Source of 16-bit session ids, one call per session: random live, counted in
            tests.

    Raises:
        InputError: A subclass overrides a method of the state table.
    """

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        for handler in _HANDLERS.values():
            found = getattr(cls, handler.__name__)
            if found is not handler:
                raise _without_effect(cls, handler.__name__, found)

    def __init__(self, config: SubConfig, *, session_ids: Callable[[], int]) -> None:
        self.config = config
        super().__init__(
            sends=config.safe_in_bytes, receives=config.safe_out_bytes, session_ids=session_ids
        )
        self._parameter_bytes = _COMM_BYTES + config.app_parameter_bytes

    def _power_up(self) -> None:
        super()._power_up()
        self._session_id = b""
        self._session_sent_bytes = 0
        self._told = bytearray()  # Connection or Parameter bytes received so far

    def snapshot(self) -> dict[str, Any]:  # noqa: D102 - inherited
        state = super().snapshot()
        state["_told"] = self._told.copy()
        return state

    def restore(self, state: dict[str, Any]) -> None:  # noqa: D102 - inherited
        super().restore(state)
        self._told = state["_told"].copy()

    def step(self, now_ns: int, received: bytes | None) -> bytes | None:  # noqa: D102 - inherited
        self._now_ns = now_ns
        if self._reset_requested:  # row 1, also while in Reset
            self._reset_requested = False
            return self._reset(ResetCode.LOCAL)
        if self._watchdog_expired():  # row 2; §8: before the frame is looked at
            return self._reset(ResetCode.WATCHDOG)
        pdu = self._new_frame(received)
        if pdu is None:
            return None  # row 3
        if pdu.command == Command.RESET:
            return self._on_reset(pdu)  # rows 4 … 6
        if pdu.command not in _KNOWN:
            return self._reset(ResetCode.UNKNOWN_COMMAND)  # row 7
        if pdu.command == Command.SESSION:
            return self._on_session(pdu)  # rows 8 … 11
        code = _HANDLERS[self.state](self, pdu)  # rows 12 … 21
        if code is not None:
            return self._reset(code)
        if self.state is State.DATA:
            return self._answer_data(pdu)  # rows 22, 23
        return self._echo(pdu)

    def _reset(self, code: int, *, by_peer: int | None = None) -> bytes:
        self._watchdog_start_ns = None  # §8
        return super()._reset(code, by_peer=by_peer)

    def _on_reset(self, pdu: Pdu) -> bytes:
        if self.state is not State.RESET and not fits_start(pdu):
            return self._reset(ResetCode.CRC)  # row 6
        # Rows 4 and 5; §14: in state Reset the CRC is not checked.
        return self._reset(ResetCode.LOCAL, by_peer=pdu.safe_data[0])

    def _on_session(self, pdu: Pdu) -> bytes:
        in_session = self.state is State.SESSION
        if in_session and not self._session_complete() and self._chain.receive(pdu):
            return self._session_chunk()  # row 8
        if fits_start(pdu):
            return self._start_session(pdu)  # row 9; §6, §16: from power-up on
        if in_session and self._chain.receive(pdu):
            return self._reset(ResetCode.COMMAND)  # row 10
        return self._reset(ResetCode.CRC)  # row 11

    def _start_session(self, pdu: Pdu) -> bytes:
        if self.state is not State.RESET:
            self._clear_safe_data()  # §9: the enable survives a Session start out of Reset
        self._chain.clear()
        self._chain.receive(pdu)
        self._watchdog_start_ns = None
        self.connection_id = 0
        self._enter(State.SESSION)
        self._session_id, self._session_sent_bytes = self._draw_session_id(), 0
        return self._session_chunk()

    def _session_chunk(self) -> bytes:
        start = self._session_sent_bytes
        self._session_sent_bytes += self._chunk_bytes
        return self._send(Command.SESSION, self._session_id[start : self._session_sent_bytes])

    def _session_complete(self) -> bool:
        return self._session_sent_bytes >= _SESSION_BYTES

    def _in_reset(self, pdu: Pdu) -> ResetCode | None:
        return ResetCode.COMMAND  # row 12

    def _in_session(self, pdu: Pdu) -> ResetCode | None:
        if pdu.command != Command.CONNECTION or not self._session_complete():
            return ResetCode.COMMAND  # row 13
        if pdu.connection_id == 0:  # row 14
            return ResetCode.CONNECTION_ID
        if not self._chain.receive(pdu):
            return ResetCode.CRC
        self.connection_id = pdu.connection_id
        self._told = bytearray()
        self._enter(State.CONNECTION)
        return None

    def _in_connection(self, pdu: Pdu) -> ResetCode | None:
        complete = len(self._told) >= _CONNECTION_BYTES
        if pdu.command != (Command.PARAMETER if complete else Command.CONNECTION):
            return ResetCode.COMMAND  # row 16
        if pdu.connection_id != self.connection_id:  # rows 15, 17
            return ResetCode.CONNECTION_ID
        if not complete:
            return None if self._chain.receive(pdu) else ResetCode.CRC  # row 15
        connection_id, address = struct.unpack_from("<HH", self._told)
        if connection_id != self.connection_id:  # row 17: rejected one frame late
            return ResetCode.CONNECTION_ID
        if address != self.config.address:
            return ResetCode.ADDRESS
        if not self._chain.receive(pdu):
            return ResetCode.CRC
        self._told = bytearray()
        self._enter(State.PARAMETER)
        return None

    def _in_parameter(self, pdu: Pdu) -> int | None:
        complete = len(self._told) >= self._parameter_bytes
        if complete != (pdu.command in _DATA_COMMANDS) or pdu.command == Command.CONNECTION:
            return ResetCode.COMMAND  # row 19
        if pdu.connection_id != self.connection_id:  # rows 18, 20
            return ResetCode.CONNECTION_ID
        if not complete:
            return None if self._chain.receive(pdu) else ResetCode.CRC  # row 18
        length, watchdog_ms, app_bytes = struct.unpack_from("<HHH", self._told)
        if length != 2:  # row 20
            return ResetCode.COMM_PARAMETER_LENGTH
        if app_bytes != self.config.app_parameter_bytes:
            return ResetCode.APP_PARAMETER_LENGTH
        code = self._verdict(watchdog_ms)
        if code:
            return code
        if not self._chain.receive(pdu):
            return ResetCode.CRC
        self._watchdog_ns = watchdog_ms * 1_000_000
        self._enter(State.DATA)
        return None

    def _verdict(self, watchdog_ms: int) -> int:
        """Return the application's answer to the parameters: 0 or a reset code (§6)."""
        if watchdog_ms == 0:  # §6, §16: rejected here, without asking the application
            return ResetCode.COMM_PARAMETER
        if self.config.verify is None:
            return 0
        app = bytes(self._told[_COMM_BYTES : self._parameter_bytes])
        code = self.config.verify(Parameters(watchdog_ms=watchdog_ms, app_parameters=app))
        if code in (0, ResetCode.COMM_PARAMETER) or 0x80 <= code <= 0xFF:
            return code
        return ResetCode.APP_PARAMETER

    def _in_data(self, pdu: Pdu) -> ResetCode | None:
        if pdu.command not in _DATA_COMMANDS:
            return ResetCode.COMMAND  # row 21
        if pdu.connection_id != self.connection_id:  # rows 22, 23
            return ResetCode.CONNECTION_ID
        return None if self._chain.receive(pdu) else ResetCode.CRC

    def _answer_data(self, pdu: Pdu) -> bytes:
        self._take_data(pdu)
        self._watchdog_start_ns = self._now_ns
        return self._send_data()

    def _echo(self, pdu: Pdu) -> bytes:
        """Return the received chunk, wrong or not, including padding (§4).

        The first Parameter frame is the exception: bytes beyond the expected length are returned as
        0.
        """
        chunk = pdu.safe_data[: self._chunk_bytes]
        if self.state is State.PARAMETER and not self._told:
            chunk = chunk[: self._parameter_bytes].ljust(len(chunk), b"\0")
        self._told += chunk
        return self._send(Command(pdu.command), chunk)


def _without_effect(cls: type, name: str, found: object) -> InputError:
    code = getattr(found, "__code__", None)
    place = f"{code.co_filename}:{code.co_firstlineno}: " if code else ""
    return InputError(
        f"{place}{cls.__qualname__} overrides SubInstance.{name}, but `step` calls "
        f"the methods of the states through a table, so the override has no effect; override `step`"
    )


_HANDLERS: dict[State, Callable[[SubInstance, Pdu], int | None]] = {
    State.RESET: SubInstance._in_reset,
    State.SESSION: SubInstance._in_session,
    State.CONNECTION: SubInstance._in_connection,
    State.PARAMETER: SubInstance._in_parameter,
    State.DATA: SubInstance._in_data,
}
