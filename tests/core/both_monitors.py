"""The monitor in C and the one in Python, given the same frames."""

from __future__ import annotations

import zlib
from dataclasses import asdict, dataclass

from fsoe_net.core.monitor import Monitor
from fsoe_net.fsoe.observed import CrcVerdict
from fsoe_net.fsoe.parameters import NOT_OBSERVED, FsoeParameters
from fsoe_net.fsoe.pdu import Command, Pdu, decode_pdu
from fsoe_net.self_test.monitor import PythonMonitor

_CONNECTION_BYTES = 4
_HEAD_BYTES = 6
_COMMUNICATION_BYTES = 2
TO_SUB, TO_MAIN = 0, 1


class Both:
    """Feeds both monitors and compares all they know."""

    def __init__(self, out, inn):
        self.python, self.c = CountingMonitor(out, inn), Monitor(out, inn)
        self.now_ns = 0
        self.seen = []

    def frame(self, direction, data):
        self.now_ns += 1_000_000
        verdict = self.python.frame(direction, data, self.now_ns)
        assert self.c.frame(direction, data, self.now_ns) is verdict
        for way in (TO_SUB, TO_MAIN):
            counts = asdict(self.python.counts(way))
            assert counts.items() <= asdict(self.c.counts(way)).items()
            assert self.c.sequence(way) == self.python.sequence(way)
        assert (self.c.state, self.c.gaps) == (self.python.state, self.python.gaps)
        assert self.c.parameters == self.python.parameters
        self.seen.append(verdict)
        return verdict


@dataclass(slots=True, kw_only=True)
class Counts:
    """One direction of a connection, observed.

    Attributes:
        frames: New frames: any byte differs from the one before.
        right: Of these, frames whose CRCs fit the chain.
        wrong: Of these, frames with a CRC that does not fit.
        unchecked: Of these, frames seen while the chain was not known.
        resets: How often a Reset followed another command.
        command: First byte of the last frame.
        connection_id: Last two bytes of the last frame.
        reset_code: Code in the last Reset.
        last_new_ns: Time of the last new frame.
    """

    frames: int = 0
    right: int = 0
    wrong: int = 0
    unchecked: int = 0
    resets: int = 0
    command: int = 0
    connection_id: int = 0
    reset_code: int = 0
    last_new_ns: int = 0


class CountingMonitor(PythonMonitor):
    """Also counts frames, and puts the parameters of the main together."""

    def __init__(self, out: int, inn: int) -> None:
        super().__init__(out, inn)
        self._counts = Counts(), Counts()
        self._list = ParameterList(min(out, inn))

    @property
    def parameters(self) -> FsoeParameters:
        return self._list.parameters

    def counts(self, direction: int) -> Counts:
        return self._counts[direction]

    def frame(self, direction: int, data: bytes, now_ns: int) -> CrcVerdict:
        verdict = super().frame(direction, data, now_ns)
        if verdict is CrcVerdict.SAME:
            return verdict
        pdu, counts = decode_pdu(data), self._counts[direction]
        _count(counts, pdu, now_ns)
        counts.right += verdict is CrcVerdict.RIGHT
        counts.wrong += verdict is CrcVerdict.WRONG
        counts.unchecked += verdict is CrcVerdict.UNCHECKED
        if direction == TO_SUB:
            right = verdict is CrcVerdict.RIGHT
            self._list.frame(pdu.command, pdu.safe_data, right=right)
        return verdict


def _count(counts: Counts, pdu: Pdu, now_ns: int) -> None:
    counts.frames += 1
    counts.last_new_ns = now_ns
    if pdu.command == Command.RESET:
        # One Reset may be several frames in a row; only the first counts, and none of a start.
        counts.resets += counts.frames > 1 and counts.command != Command.RESET
        counts.reset_code = pdu.safe_data[0]
    counts.command = pdu.command
    counts.connection_id = pdu.connection_id


class ParameterList:
    """Puts the parameters of a start-up together, from chunks of the shorter safe data.

    Only frames count that fit the chain, from the Session on; a Reset leaves what is known.
    """

    def __init__(self, chunk_bytes: int) -> None:
        self.parameters = NOT_OBSERVED
        self._chunk = chunk_bytes
        self._command = 0  # of the frames of the list; 0: the start-up is not followed
        self._sent = bytearray()

    def frame(self, command: int, safe_data: bytes, *, right: bool) -> None:
        """Take a new frame of the main.

        Args:
            command: First byte of the frame.
            safe_data: Its data.
            right: Whether its CRCs fit the chain.
        """
        if command == Command.RESET:
            self._command = 0
        elif command == Command.SESSION:
            self.parameters = NOT_OBSERVED
            self._command = command if right else 0
        elif command in (Command.CONNECTION, Command.PARAMETER):
            if right and self._is_next(command):
                self._take(command, safe_data)
            else:
                self._forget()
        elif self._command in (Command.PARAMETER, Command.PROCESS_DATA):
            self._command = Command.PROCESS_DATA  # Data, independent of what follows
        else:
            self._forget()

    def _forget(self) -> None:
        self._command = 0
        self.parameters = NOT_OBSERVED

    def _is_next(self, command: int) -> bool:
        """Whether the frame is one of the same list, or the first one of the next."""
        if command == self._command:
            return True
        if command == Command.CONNECTION:
            return self._command == Command.SESSION
        return self._command == Command.CONNECTION and len(self._sent) >= _CONNECTION_BYTES

    def _take(self, command: int, safe_data: bytes) -> None:
        if command != self._command:
            self._command, self._sent = command, bytearray()
        sent = self._sent
        if len(sent) < _HEAD_BYTES or len(sent) < _HEAD_BYTES + _word(sent, 4):
            sent += safe_data[: self._chunk]  # bytes after the list are padding
        if command == Command.CONNECTION:
            if len(sent) >= _CONNECTION_BYTES:
                self.parameters = FsoeParameters(
                    connection_id=_word(sent, 0), address=_word(sent, 2)
                )
            return
        if len(sent) < _HEAD_BYTES or len(sent) - _HEAD_BYTES < _word(sent, 4):
            return
        if _word(sent, 0) == _COMMUNICATION_BYTES:
            app = bytes(sent[_HEAD_BYTES : _HEAD_BYTES + _word(sent, 4)])
            self.parameters = FsoeParameters(
                connection_id=self.parameters.connection_id,
                address=self.parameters.address,
                watchdog_ms=_word(sent, 2),
                app_bytes=len(app),
                app_crc=zlib.crc32(app),
            )


def _word(data: bytearray, at: int) -> int:
    return int.from_bytes(data[at : at + 2], "little")
