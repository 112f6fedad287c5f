"""Requirements of the state tables (§5, §6) on an end, followed from its frames alone.

Deliberately independent of the engine: no table, chain or CRC function of the ends is used, so an
error there is not repeated here. A table receives each call of an end and reports deviations.
"""

from __future__ import annotations

import struct
from typing import Any

from fsoe_net.campaign.collision_proof import block_crcs
from fsoe_net.campaign.departure import Departure, Due, frame_text
from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.pdu import (
    Command,
    Pdu,
    decode_pdu,
    describe,
    frame_length,
    reset_code_text,
)

_RESET, _SESSION = int(Command.RESET), int(Command.SESSION)
_CONNECTION, _PARAMETER = int(Command.CONNECTION), int(Command.PARAMETER)
_PROCESS_DATA = int(Command.PROCESS_DATA)
_DATA = (_PROCESS_DATA, int(Command.FAIL_SAFE_DATA))
_KNOWN = frozenset((_RESET, _SESSION, _CONNECTION, _PARAMETER, *_DATA))
_COMMANDS = {
    State.SESSION: (_SESSION,),
    State.CONNECTION: (_CONNECTION,),
    State.PARAMETER: (_PARAMETER,),
    State.DATA: _DATA,
}
_ID_BYTES, _CONNECTION_BYTES, _COMM_BYTES = 2, 4, 6
_SAME_IDS = {1: 5, 2: 3}  # sessions in a row with one id, by its bytes: by chance once in 2^32
_OWN_CODES = (9, 11, *range(0x80, 0x100))  # a device may reject parameters for reasons of its own


_NOTHING = Due()
_NEW_SESSION = Due((), (_SESSION,))


def _next(sequence: int) -> int:
    return sequence % 0xFFFF + 1


def _fits_start(pdu: Pdu) -> bool:
    return block_crcs(0, 1, pdu) == pdu.crcs


class StateTable:
    """The state table of one end; `MainTable` and `SubTable` contain the rows.

    Args:
        sends: Safe data bytes it sends.
        receives: Safe data bytes it receives.
        watchdog_ns: Its watchdog in ns; 0 while unknown.
        grace_ns: Permitted lateness of a watchdog; 0 for ours, which must also follow the decisions
            of §16 where implementations differ.
    """

    def __init__(self, *, sends: int, receives: int, watchdog_ns: int, grace_ns: int) -> None:
        self.sends, self.receives = sends, receives
        self.watchdog_ns, self.grace_ns = watchdog_ns, grace_ns
        self.chunk_bytes = min(sends, receives)
        self.state = State.RESET
        self.connection_id = 0
        self.clear()
        self.seen = bytes(frame_length(receives))
        self.sent: bytes | None = None
        self.start_ns: int | None = None
        self.enabled: bool | None = None  # by the application; None if unknown
        self.valid, self.data = False, bytes(receives)
        self.id_bytes, self.same_ids, self.fresh = 0, 1, False
        self.last_id: bytes | None = None  # the part that the first Session frame contains
        self.blind = False  # the end follows a different rule until the next Reset

    def snapshot(self) -> dict[str, Any]:
        """Return the state, for `restore`."""
        return self.__dict__.copy()  # all values are immutable

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a `snapshot`."""
        self.__dict__.update(state)

    # ------------------------------------------------------------------------------- the chain

    def clear(self) -> None:
        """§3: start values."""
        self.last, self.tx_sequence, self.rx_sequence = 0, 1, 1
        self.own: int | None = None
        self.peer: int | None = None

    def due_sequence(self, pdu: Pdu) -> int:
        """Return the expected number of the next frame, including the collision rule."""
        sequence = self.rx_sequence
        if block_crcs(self.last, sequence, pdu)[0] == self.peer:
            sequence = _next(sequence)
        return sequence

    def _receive(self, pdu: Pdu) -> bool:
        sequence = self.due_sequence(pdu)
        if block_crcs(self.last, sequence, pdu) != pdu.crcs:
            return False
        self.peer = self.last = pdu.crcs[0]
        self.rx_sequence = _next(sequence)
        return True

    def _send(self, pdu: Pdu) -> bool:
        sequence = self.tx_sequence
        crcs = block_crcs(self.last, sequence, pdu)
        if crcs[0] == self.own:
            sequence = _next(sequence)
            crcs = block_crcs(self.last, sequence, pdu)
        self.own = self.last = pdu.crcs[0]
        self.tx_sequence = _next(sequence)
        return crcs == pdu.crcs

    # -------------------------------------------------------------------------------- one call

    def call(self, now_ns: int, received: bytes | None, sent: bytes | None) -> Departure | None:
        """Follow one call of the end.

        Args:
            now_ns: Time of the call.
            received: Image it saw.
            sent: New frame it returned, if any.

        Returns:
            The deviation from the table, if any; later calls are then not judged.
        """
        # Nothing can be required until the next Reset makes the state known.
        if self.blind and (sent is None or sent[0] != _RESET):
            self.seen = received or self.seen
            self.sent = sent or self.sent
            return None
        self.blind = False
        if sent is not None and len(sent) != frame_length(self.sends):
            return Departure(text=f"sends {len(sent)} bytes")
        before = self.sent
        due = self._due(now_ns, received, sent)
        found = self._compare(due, received, None if sent is None else decode_pdu(sent), before)
        self.sent = sent or self.sent
        if sent is not None:
            self._was_sent(now_ns, due, before)
        return found

    def shows(self, *, valid: bool, data: bytes) -> Departure | None:
        """Compare the data passed to the application with the last accepted frame."""
        if self.blind:
            return None
        if valid != self.valid:
            text = "valid without an accepted ProcessData" if valid else "not valid"
            return Departure(text=f"data {text} in state {self.state.value}")
        # Invalid data must also be zero: an application may read them by mistake.
        if not valid and any(data):
            return Departure(text="data that are not valid are not zero")
        if valid and data != self.data:
            return Departure(text="valid data are not those of the frame accepted last")
        return None

    def _due(self, now_ns: int, received: bytes | None, sent: bytes | None) -> Due:
        raise NotImplementedError

    def _was_sent(self, now_ns: int, due: Due, before: bytes | None) -> None:
        """Start the watchdog as the table requires."""

    def _expired(self, now_ns: int, sent: bytes | None) -> bool:
        """§8: expired at exactly T; an end with grace decides for itself near T."""
        if self.start_ns is None:
            return False
        # An end with its own clock decides near the limit; its answer shows the decision.
        over_ns = now_ns - self.start_ns - self.watchdog_ns
        if -self.grace_ns <= over_ns < self.grace_ns:
            if self.state is State.RESET:
                return sent is not None and sent[0] == _SESSION
            return sent is not None and sent[0] == _RESET and sent[1] == 5
        return over_ns >= 0

    def _new(self, received: bytes | None) -> Pdu | None:
        if received is None or len(received) != len(self.seen) or received == self.seen:
            return None
        self.seen = bytes(received)
        return decode_pdu(self.seen)

    def _fail_safe(self) -> None:
        self.valid, self.data = False, bytes(self.receives)
        if self.enabled is not None:
            self.enabled = False

    def _fall(self, *codes: int) -> Due:
        """Enter state Reset."""
        self.clear()
        self._fail_safe()
        self.state, self.connection_id = State.RESET, 0
        return Due(codes)

    def _take(self, pdu: Pdu) -> None:
        self.valid = pdu.command == _PROCESS_DATA
        self.data = pdu.safe_data if self.valid else bytes(self.receives)

    def _compare(
        self, due: Due, received: bytes | None, sent: Pdu | None, before: bytes | None
    ) -> Departure | None:
        if due.commands:
            return self._went_on(due, received, sent)
        if due.codes:
            return self._gave_up(due.codes, received, sent, before)
        if sent is None:
            return None
        if sent.command == _RESET:
            code = sent.safe_data[0]
            return Departure(text=f"Reset {code} ({reset_code_text(code)}) without a cause")
        return Departure(text=f"sends {describe(sent)} though no new frame came", accepted=True)

    def _gave_up(
        self, codes: tuple[int, ...], received: bytes | None, sent: Pdu | None, before: bytes | None
    ) -> Departure | None:
        due = f"Reset {codes[0]} ({reset_code_text(codes[0])}) is due"
        if codes[0] != 5:
            due += f" after {frame_text(received)}"
        if sent is None:
            if before is not None and before[0] == _RESET and before[1] in codes:
                return None  # the same Reset repeated; the image does not change
            return Departure(text=f"sends nothing, {due}")
        if sent.command != _RESET:
            return Departure(text=f"continues with {describe(sent)}, {due}", accepted=True)
        if sent.safe_data[0] not in codes:
            return Departure(text=f"sends Reset {sent.safe_data[0]}, {due}")
        if not _fits_start(sent) or sent.connection_id:
            return Departure(text=f"sends a Reset with another CRC or ConnID: {describe(sent)}")
        return None

    def _went_on(self, due: Due, received: bytes | None, sent: Pdu | None) -> Departure | None:
        names = " or ".join(Command(command).name for command in due.commands)
        after = f"{names} is due after {frame_text(received)}"
        if sent is None:
            return Departure(text=f"sends nothing, {after}")
        if sent.command == _RESET and sent.safe_data[0] in due.may:
            self._fall()
            return None
        if sent.command not in due.commands:
            return Departure(text=f"sends {describe(sent)}, {after}")
        if sent.connection_id != self.connection_id:
            return Departure(text=f"sends ConnID {sent.connection_id}, not {self.connection_id}")
        if not sent.safe_data.startswith(due.data):
            return Departure(text=f"sends {describe(sent)}, the data due are {due.data.hex(' ')}")
        if not self._send(sent):
            return Departure(text=f"sends a wrong CRC or number: {describe(sent)}")
        # ProcessData without release would make data valid that the application has withdrawn.
        if sent.command == _PROCESS_DATA and self.enabled is False:
            return Departure(text="sends ProcessData, its application has not enabled it")
        return self._session_id(sent) if sent.command == _SESSION else None

    def _session_id(self, sent: Pdu) -> Departure | None:
        """§4: a new random id for every Session start."""
        if not self.fresh:
            return None
        self.fresh = False
        session_id = sent.safe_data[: min(self.chunk_bytes, _ID_BYTES)]
        self.same_ids = self.same_ids + 1 if session_id == self.last_id else 1
        self.last_id = session_id
        if self.same_ids < _SAME_IDS[len(session_id)]:
            return None
        return Departure(text=f"{self.same_ids} sessions in a row have the id {session_id.hex()}")


class MainTable(StateTable):
    """§5."""

    def __init__(self, config: MainConfig, *, grace_ns: int) -> None:
        super().__init__(
            sends=config.safe_out_bytes,
            receives=config.safe_in_bytes,
            watchdog_ns=config.watchdog_ms * 1_000_000,
            grace_ns=grace_ns,
        )
        self.config = config
        self.first = True
        self.payload = self.chunk = b""
        self.sent_bytes = 0

    def _due(self, now_ns: int, received: bytes | None, sent: bytes | None) -> Due:
        if self.first:  # row 1
            self.first = False
            return self._fall(0)
        if self._expired(now_ns, sent):  # rows 2, 3
            return self._new_session() if self.state is State.RESET else self._fall(5)
        pdu = self._new(received)
        if pdu is None:
            return _NOTHING  # row 4
        if pdu.command == _RESET:  # rows 5, 6
            if self.state is not State.RESET:
                self._fail_safe()
            return self._new_session()
        if self.state is State.RESET:
            return Due((0,))  # row 5.1
        return self._on_frame(pdu)

    def _on_frame(self, pdu: Pdu) -> Due:
        if pdu.command not in _KNOWN:
            return self._fall(2)  # row 7
        if pdu.command not in _COMMANDS[self.state]:
            return self._fall(1)  # row 8
        if self.state is not State.SESSION:
            if pdu.connection_id != self.connection_id:
                return self._fall(3)  # row 9
            if self.state is not State.DATA and not pdu.safe_data.startswith(self.chunk):
                return self._fall(7)  # row 10
        # The receive chain is last: a frame with a wrong command must not advance it.
        if not self._receive(pdu):
            if self.state is State.SESSION and self.sent_bytes <= self.chunk_bytes:
                self.blind = self.grace_ns > 0  # row 11; §11.2: three implementations, three ways
                return _NOTHING
            return self._fall(4)  # row 12
        return self._on_right(pdu)

    def _on_right(self, pdu: Pdu) -> Due:
        if self.state is State.DATA:  # rows 19, 20
            self._take(pdu)
            return Due((), _DATA)
        if self.sent_bytes < len(self.payload):  # rows 13, 15, 17
            return self._tell()
        config = self.config
        if self.state is State.SESSION:  # row 14
            self.state, self.connection_id = State.CONNECTION, config.connection_id
            self.payload = struct.pack("<HH", config.connection_id, config.address)
        elif self.state is State.CONNECTION:  # row 16
            self.state = State.PARAMETER
            app = config.app_parameters
            self.payload = struct.pack("<HHH", 2, config.watchdog_ms, len(app)) + app
        else:  # row 18
            self.state = State.DATA
            return Due((), _DATA)
        self.sent_bytes = 0
        return self._tell()

    def _tell(self) -> Due:
        at = self.sent_bytes
        self.sent_bytes += self.chunk_bytes
        self.chunk = self.payload[at : self.sent_bytes]
        known = b"" if self.state is State.SESSION else self.chunk
        return Due((), _COMMANDS[self.state], known)

    def _new_session(self) -> Due:
        self.clear()
        self.state, self.connection_id = State.SESSION, 0
        self.payload, self.sent_bytes, self.fresh = bytes(_ID_BYTES), self.chunk_bytes, True
        return _NEW_SESSION

    def _went_on(self, due: Due, received: bytes | None, sent: Pdu | None) -> Departure | None:
        # The same id twice in a row occurs in one of 65536 cases.
        if sent is None and due is _NEW_SESSION and self.sent and self.sent[0] == _SESSION:
            sent = decode_pdu(self.sent)  # the same id by accident: the image does not change
        found = super()._went_on(due, received, sent)
        if found is None and sent is not None and sent.command == _SESSION:
            self.chunk = sent.safe_data[: self.chunk_bytes]
        return found

    def _was_sent(self, now_ns: int, due: Due, before: bytes | None) -> None:
        repeated = self.state is State.RESET and due.codes == (0,) and before is not None
        if not repeated:  # §8: every frame sent, except the repeated Reset
            self.start_ns = now_ns


class SubTable(StateTable):
    """§6."""

    def __init__(self, config: SubConfig, *, grace_ns: int) -> None:
        super().__init__(
            sends=config.safe_in_bytes,
            receives=config.safe_out_bytes,
            watchdog_ns=0,
            grace_ns=grace_ns,
        )
        self.config = config
        self.received = b""
        self.received_watchdog_ns = 0

    def _fall(self, *codes: int) -> Due:
        self.start_ns = None
        return super()._fall(*codes)

    def _due(self, now_ns: int, received: bytes | None, sent: bytes | None) -> Due:
        if self._expired(now_ns, sent):
            return self._fall(5)  # row 2
        pdu = self._new(received)
        if pdu is None:
            return _NOTHING  # row 3
        if pdu.command == _RESET:  # rows 4 … 6
            right = self.state is State.RESET or _fits_start(pdu)
            return self._fall(0 if right else 4)
        if pdu.command not in _KNOWN:
            return self._fall(2)  # row 7
        if pdu.command == _SESSION:
            return self._session(pdu)
        codes = self._refusal(pdu)
        if codes:
            return self._fall(*codes)
        if self.state is not State.DATA:
            return self._echo(pdu)
        self._take(pdu)  # rows 22, 23
        self.start_ns = now_ns
        return Due((), _DATA)

    def _session(self, pdu: Pdu) -> Due:
        inside = self.state is State.SESSION
        # The second half of the session id, where one frame carries one byte.
        if inside and self.id_bytes < _ID_BYTES and self._receive(pdu):  # row 8
            self.id_bytes += self.chunk_bytes
            return _NEW_SESSION
        if _fits_start(pdu):  # row 9
            if self.state is not State.RESET:
                self._fail_safe()
            self.clear()
            self._receive(pdu)
            self.start_ns, self.state, self.connection_id = None, State.SESSION, 0
            self.id_bytes, self.fresh = self.chunk_bytes, True
            return _NEW_SESSION
        return self._fall(1 if inside and self._receive(pdu) else 4)  # rows 10, 11

    def _refusal(self, pdu: Pdu) -> tuple[int, ...]:
        """Rows 12 … 23: the code with which a frame is rejected, or none if it is valid."""
        command, state = pdu.command, self.state
        if state is State.RESET:
            return (1,)  # row 12
        if state is State.SESSION:
            if command != _CONNECTION or self.id_bytes < _ID_BYTES:
                return (1,)  # row 13
            if pdu.connection_id == 0:
                return (3,)  # row 14
        else:
            if command not in self._allowed():
                return (1,)  # rows 16, 19, 21
            if pdu.connection_id != self.connection_id:
                return (3,)  # rows 15, 17, 18, 20, 22
            codes = self._judge_told(command)
            if codes:
                return codes
        if not self._receive(pdu):
            return (4,)
        if state is State.SESSION:
            self.state, self.connection_id, self.received = State.CONNECTION, pdu.connection_id, b""
        elif state is State.CONNECTION and command == _PARAMETER:
            self.state, self.received = State.PARAMETER, b""
        elif state is State.PARAMETER and command in _DATA:
            self.state, self.watchdog_ns = State.DATA, self.received_watchdog_ns
        return ()

    def _allowed(self) -> tuple[int, ...]:
        if self.state is State.CONNECTION:
            return (_PARAMETER,) if len(self.received) >= _CONNECTION_BYTES else (_CONNECTION,)
        if self.state is State.PARAMETER:
            whole = len(self.received) >= _COMM_BYTES + self.config.app_parameter_bytes
            return _DATA if whole else (_PARAMETER,)
        return _DATA

    def _judge_told(self, command: int) -> tuple[int, ...]:
        """Rows 17 and 20: earlier content is judged with the first frame of the next type."""
        if self.state is State.CONNECTION and command == _PARAMETER:
            return self._wrong_connection()
        if self.state is State.PARAMETER and command in _DATA:
            return self._wrong_parameters()
        return ()

    def _wrong_connection(self) -> tuple[int, ...]:
        connection_id, address = struct.unpack_from("<HH", self.received)
        if connection_id != self.connection_id:
            return (3,)
        return (6,) if address != self.config.address else ()

    def _wrong_parameters(self) -> tuple[int, ...]:
        length, watchdog_ms, app_bytes = struct.unpack_from("<HHH", self.received)
        self.received_watchdog_ns = watchdog_ms * 1_000_000
        if length != 2:
            return (8,)
        if app_bytes != self.config.app_parameter_bytes:
            return (10,) if not self.grace_ns else (10, 1)  # §14 item 4
        return (9,) if watchdog_ms == 0 else ()

    def _echo(self, pdu: Pdu) -> Due:
        chunk = pdu.safe_data[: self.chunk_bytes]
        if self.state is State.PARAMETER and not self.received:
            chunk = chunk[: _COMM_BYTES + self.config.app_parameter_bytes]
        self.received += chunk
        return Due((), (pdu.command,), chunk, self._early() if self.grace_ns else ())

    def _early(self) -> tuple[int, ...]:
        """§14 item 4: an end may reject content immediately, and parameters for its own reasons."""
        if self.state is State.PARAMETER:
            whole = len(self.received) >= _COMM_BYTES + self.config.app_parameter_bytes
            return (*_OWN_CODES, *self._wrong_parameters()) if whole else ()
        return self._wrong_connection() if len(self.received) >= _CONNECTION_BYTES else ()
