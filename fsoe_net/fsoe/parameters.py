"""Parameters of a connection as its main sends them in Connection and Parameter (§4)."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Protocol

from fsoe_net.fsoe.pdu import Command

STATED_PARAMETERS = ("connection_id", "address", "watchdog_ms", "app_parameters")
"""Those that a plan states; their order is that of the bits in the C core."""
_TEXTS = {
    "connection_id": "connection ID",
    "address": "FSoE address",
    "watchdog_ms": "watchdog",
    "app_parameters": "application parameters",
}
MOST_APP_BYTES = 4096
"""Application parameters that a plan can state; proving a hostile one takes no longer for them."""
_CONNECTION_BYTES = 4
_HEAD_BYTES = 6
_COMMUNICATION_BYTES = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeParameters:
    """What a main has sent in its last start-up; ``None``: not observed.

    Attributes:
        connection_id: In the data of the Connection frames.
        address: FSoE address of the sub.
        watchdog_ms: Watchdog of the connection.
        app_bytes: Length of the application parameters.
        app_crc: Their CRC-32 (IEEE 802.3).
    """

    connection_id: int | None = None
    address: int | None = None
    watchdog_ms: int | None = None
    app_bytes: int | None = None
    app_crc: int | None = None

    def text(self, name: str) -> str | None:
        """Return the value of one of `STATED_PARAMETERS` with its unit; ``None``: not known."""
        if name == "app_parameters":
            size = self.app_bytes
            return None if size is None else f"{size} bytes, CRC-32 0x{self.app_crc:08x}"
        value = getattr(self, name)
        if value is None:
            return None
        return f"{value} ms" if name == "watchdog_ms" else str(value)

    def to_json(self) -> dict[str, int | None]:
        """Return the stable JSON form."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


NOT_OBSERVED = FsoeParameters()


def differences(
    differs: Iterable[str], configured: FsoeParameters, observed: FsoeParameters
) -> tuple[str, ...]:
    """Return the differences, such as ``watchdog 4000 ms, 400 ms in the plan``.

    Args:
        differs: Names of parameters.
        configured: Parameters of the plan.
        observed: Observed parameters; empty if the start-up was not observed.
    """
    rows = []
    for name in differs:
        stated, there = configured.text(name), observed.text(name)
        planned = f", {stated} in the plan" if stated else ""
        if there is None:
            there = "not known now, another than planned at an earlier start-up"
        rows.append(f"{_TEXTS[name]} {there}{planned}")
    return tuple(rows)


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


class SeenParameters(Protocol):
    """A connection with the parameters of the plan and those that were observed."""

    @property
    def configured(self) -> FsoeParameters:
        """Parameters of the plan."""

    @property
    def observed(self) -> FsoeParameters:
        """Parameters that the MainInstance sent in its last start-up."""

    @property
    def differs(self) -> tuple[str, ...]:
        """Names of the parameters that differ."""
