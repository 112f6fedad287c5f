"""FSoE frames on the wire (§1, §7): commands, sizes, decoding and encoding.

Section numbers in this package are those of the protocol notes,
``docs/explanation/fsoe-engine.md``: compared with independent implementations, not checked against
ETG.5100 and not conformance tested.
"""

from __future__ import annotations

import enum
import struct
from typing import NamedTuple

from fsoe_net.diag.words import counted
from fsoe_net.errors import FsoeError, PduSizeError

SAFE_SIZES: frozenset[int] = frozenset({1, *range(2, 127, 2)})
"""Numbers of safe data bytes that an FSoE frame can carry: 1, or even up to 126."""


class Command(enum.IntEnum):
    """First byte of a frame (§1)."""

    RESET = 0x2A
    SESSION = 0x4E
    CONNECTION = 0x64
    PARAMETER = 0x52
    PROCESS_DATA = 0x36
    FAIL_SAFE_DATA = 0x08


class ResetCode(enum.IntEnum):
    """First data byte of a Reset frame (§7); 0x80 … 0xFF are device specific."""

    LOCAL = 0
    COMMAND = 1
    UNKNOWN_COMMAND = 2
    CONNECTION_ID = 3
    CRC = 4
    WATCHDOG = 5
    ADDRESS = 6
    ECHO = 7
    COMM_PARAMETER_LENGTH = 8
    COMM_PARAMETER = 9
    APP_PARAMETER_LENGTH = 10
    APP_PARAMETER = 11


_COMMAND_TEXT = {
    int(command): command.name.title().replace("_", "") for command in Command
}  # 0x36: "ProcessData"

_CODE_TEXT = {
    0: "local reset or acknowledgement",
    1: "command not allowed in this state",
    2: "unknown command",
    3: "wrong connection ID",
    4: "wrong CRC",
    5: "watchdog expired",
    6: "wrong FSoE address",
    7: "echoed data differ",
    8: "wrong length of the communication parameters",
    9: "communication parameters (watchdog) refused",
    10: "wrong length of the application parameters",
    11: "application parameters refused",
}


def command_text(command: int) -> str:
    """Return the name of a command byte, for people."""
    return _COMMAND_TEXT.get(command, f"command 0x{command:02x}")


def reset_code_text(code: int) -> str:
    """Return the meaning of a reset code, for people."""
    if 0x80 <= code <= 0xFF:
        return f"device-specific code 0x{code:02x}"
    return _CODE_TEXT.get(code, f"unknown code {code}")


def frame_length(safe_bytes: int) -> int:
    """Return the length in bytes of a frame that carries this many safe data bytes (§1).

    Raises:
        PduSizeError: Safe data of FSoE have 1, 2, 4 … 126 bytes.
    """
    if safe_bytes not in SAFE_SIZES:
        raise PduSizeError(f"{safe_bytes} safe data bytes; FSoE carries 1, 2, 4, 6 … 126")
    return 6 if safe_bytes == 1 else 2 * safe_bytes + 3


def is_frame_length(n: int) -> bool:
    """Whether an FSoE frame can have this length: 6, 7, 11, 15 … 255 bytes."""
    return n == 6 or (7 <= n <= 255 and n % 4 == 3)


def safe_data_length(pdu_bytes: int) -> int:
    """Return the number of safe data bytes in an FSoE frame of this length.

    Byte    0     1..2     3..4      ...     n-2..n-1
          +-----+--------+--------+-------+----------+
          | cmd | data 0 | CRC 0  |  ...  | conn ID  |
          +-----+--------+--------+-------+----------+

    Args:
        pdu_bytes: Whole frame on the wire, in bytes: 6, or 3 + 4 * k with k >= 1.

    Raises:
        PduSizeError: No FSoE frame has this length.
    """
    if not is_frame_length(pdu_bytes):
        raise _no_frame(pdu_bytes)
    return 1 if pdu_bytes == 6 else pdu_bytes // 2 - 1


def safe_byte_offset(number: int) -> int:
    """Return the byte of a frame that holds this byte of safe data, both from 0 (§1)."""
    return 1 + number // 2 * 4 + number % 2


def _no_frame(pdu_bytes: int) -> PduSizeError:
    return PduSizeError(f"{pdu_bytes} bytes; FSoE frames have 6, 7, 11, 15 … 255")


class Pdu(NamedTuple):
    """A decoded frame; a tuple for speed, because one is made for every frame received.

    Attributes:
        command: Command byte; may be a value outside of `Command`.
        safe_data: 1, 2, 4 … 126 bytes.
        crcs: CRC_0, CRC_1 … as received, right or wrong; one per block.
        connection_id: Last two bytes of the frame.
    """

    command: int
    safe_data: bytes
    crcs: tuple[int, ...]
    connection_id: int

    def encode(self) -> bytes:
        """Return the bytes of the frame.

        Raises:
            PduSizeError: No FSoE frame carries this many safe data bytes or CRCs.
            FsoeError: A field does not fit into its bytes.
        """
        try:
            return assemble(self.command, self.safe_data, self.crcs, self.connection_id)
        except struct.error as exc:
            raise FsoeError(f"a field of {self} does not fit: {exc}") from exc


def _layout(safe_bytes: int) -> struct.Struct:
    """Return the struct: command, then block and CRC alternately, then ConnID."""
    blocks = "1sH" if safe_bytes == 1 else "2sH" * (safe_bytes // 2)
    return struct.Struct(f"<B{blocks}H")


_FRAMES = {frame_length(size): _layout(size) for size in SAFE_SIZES}
_SAFE_DATA = {size: struct.Struct("1s" if size == 1 else "2s" * (size // 2)) for size in SAFE_SIZES}


def assemble(command: int, data: bytes, crcs: tuple[int, ...], connection_id: int) -> bytes:
    """Return the bytes of a frame; the layout is shown in `safe_data_length`."""
    layout = _FRAMES[frame_length(len(data))]
    if len(crcs) != (len(data) + 1) // 2:
        raise PduSizeError(f"{counted(len(crcs), 'CRC')} for {len(data)} safe data bytes")
    if len(crcs) == 1:
        return layout.pack(command, data, *crcs, connection_id)
    in_turn: list[bytes | int] = [0] * (2 * len(crcs))
    in_turn[0::2], in_turn[1::2] = _SAFE_DATA[len(data)].unpack(data), crcs
    return layout.pack(command, *in_turn, connection_id)


def safe_data_of(frame: bytes) -> bytes:
    """Return the safe data of a frame without decoding the rest; the length is not checked."""
    if len(frame) <= 7:
        return frame[1:-4]
    data = bytearray(len(frame) // 2 - 1)
    data[0::2], data[1::2] = frame[1:-2:4], frame[2:-2:4]
    return bytes(data)


def decode_pdu(data: bytes) -> Pdu:
    """Decode a frame; CRCs are not checked.

    Raises:
        PduSizeError: No FSoE frame has this length.
    """
    layout = _FRAMES.get(len(data))
    if layout is None:
        raise _no_frame(len(data))
    command, *in_turn, connection_id = layout.unpack(data)
    return Pdu(
        command=command,
        safe_data=b"".join(in_turn[0::2]),
        crcs=tuple(in_turn[1::2]),
        connection_id=connection_id,
    )


def describe(pdu: Pdu) -> str:
    """Return a frame as one line, e.g. ``ProcessData 0f 00 ConnID 10 CRC 6b2e``."""
    return f"{describe_data(pdu)} CRC {' '.join(f'{crc:04x}' for crc in pdu.crcs)}"


def describe_data(pdu: Pdu) -> str:
    """Return the description without the CRCs."""
    name = command_text(pdu.command)
    if pdu.command == Command.RESET:
        name += f"({pdu.safe_data[0]}: {reset_code_text(pdu.safe_data[0])})"
    return f"{name} {pdu.safe_data.hex(' ')} ConnID {pdu.connection_id}"
