"""FSoE frames on the wire: commands, sizes, CRCs.

Rules are numbered as in ``docs/explanation/fsoe-engine.md`` (the *protocol notes*). They come from
comparing independent implementations, not from ETG.5100, and are not conformance tested.
"""

from __future__ import annotations

import enum
import struct
from dataclasses import dataclass

import crcmod

from fsoe_net.errors import PduSizeError

__all__ = [
    "SAFE_SIZES",
    "Command",
    "Pdu",
    "ResetCode",
    "block_crc",
    "decode_pdu",
    "describe_pdu",
    "encode_pdu",
    "frame_crcs",
    "frame_length",
    "is_frame_length",
    "reset_code_text",
    "safe_data_length",
    "sra_crc",
]

SAFE_SIZES: frozenset[int] = frozenset({1, *range(2, 127, 2)})

_crc16 = crcmod.mkCrcFun(0x139B7, initCrc=0, rev=False, xorOut=0)
_HEAD = struct.Struct("<HHHB")
_WORD = struct.Struct("<H")


class Command(enum.IntEnum):
    """First byte of a frame (§1)."""

    RESET = 0x2A
    SESSION = 0x4E
    CONNECTION = 0x64
    PARAMETER = 0x52
    PROCESS_DATA = 0x36
    FAIL_SAFE_DATA = 0x08


class ResetCode(enum.IntEnum):
    """First data byte of a Reset frame (§7)."""

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


def reset_code_text(code: int) -> str:
    """Return what a reset code means, for people."""
    if code >= 0x80:
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


def is_frame_length(size_bytes: int) -> bool:
    """Whether an FSoE frame can have this length: 6, 7, 11, 15 … 255."""
    return size_bytes == 6 or (7 <= size_bytes <= 255 and size_bytes % 4 == 3)


def safe_data_length(pdu_bytes: int) -> int:
    """Return how many safe data bytes a frame of this length carries.

    Byte    0     1..2     3..4      ...     n-2..n-1
          +-----+--------+--------+-------+----------+
          | cmd | data 0 | CRC 0  |  ...  | conn ID  |
          +-----+--------+--------+-------+----------+

    Raises:
        PduSizeError: No FSoE frame has this length.
    """
    if not is_frame_length(pdu_bytes):
        raise PduSizeError(f"{pdu_bytes} bytes; FSoE frames have 6, 7, 11, 15 … 255")
    return 1 if pdu_bytes == 6 else (pdu_bytes - 3) // 2


def block_crc(
    old: int, connection_id: int, sequence: int, command: int, block: int, data: bytes
) -> int:
    """Return the CRC-16 of one block (§2).

    Args:
        old: CRC_0 of the frame before, of either direction; 0 after a Reset.
        connection_id: Value of the frame's own ConnID field.
        sequence: Sequence number, 1 … 65535.
        command: Command byte.
        block: Number of the block, from 0; block 0 does not feed its number.
        data: Two safe data bytes, or one when the frame carries only one.
    """
    head = _HEAD.pack(old, connection_id, sequence, command)
    number = _WORD.pack(block) if block else b""
    crc: int = _crc16(head + number + data + b"\0\0\0")
    return crc


def frame_crcs(
    old: int, connection_id: int, sequence: int, command: int, data: bytes
) -> tuple[int, ...]:
    """Return the CRCs of all blocks of a frame; they share ``old`` and ``sequence``."""
    return tuple(
        block_crc(old, connection_id, sequence, command, n, data[2 * n : 2 * n + 2])
        for n in range((len(data) + 1) // 2)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Pdu:
    """One frame taken apart. ``command`` may be a value that no `Command` has."""

    command: int
    safe_data: bytes
    crcs: tuple[int, ...]
    connection_id: int


def encode_pdu(pdu: Pdu) -> bytes:
    """Return the bytes of a frame.

    Raises:
        PduSizeError: No FSoE frame carries this many safe data bytes.
    """
    data = pdu.safe_data
    frame_length(len(data))
    parts = [bytes((pdu.command,))]
    for number, crc in enumerate(pdu.crcs):
        parts.append(data[2 * number : 2 * number + 2])
        parts.append(_WORD.pack(crc))
    parts.append(_WORD.pack(pdu.connection_id))
    return b"".join(parts)


def decode_pdu(frame: bytes) -> Pdu:
    """Take a frame apart; CRCs are not checked.

    Raises:
        PduSizeError: No FSoE frame has this length.
    """
    size = safe_data_length(len(frame))
    step = 1 if size == 1 else 2
    data = bytearray()
    crcs = []
    at = 1
    for _ in range((size + 1) // 2):
        data += frame[at : at + step]
        crcs.append(frame[at + step] | frame[at + step + 1] << 8)
        at += step + 2
    return Pdu(
        command=frame[0],
        safe_data=bytes(data),
        crcs=tuple(crcs),
        connection_id=frame[at] | frame[at + 1] << 8,
    )


def describe_pdu(pdu: Pdu) -> str:
    """Return a frame as one line, e.g. ``ProcessData 0f ConnID 10 CRC 6b2e``."""
    try:
        name = Command(pdu.command).name.title().replace("_", "")
    except ValueError:
        name = f"command 0x{pdu.command:02x}"
    if pdu.command == Command.RESET:
        name += f"({pdu.safe_data[0]}: {reset_code_text(pdu.safe_data[0])})"
    crcs = " ".join(f"{c:04x}" for c in pdu.crcs)
    return f"{name} {pdu.safe_data.hex(' ')} ConnID {pdu.connection_id} CRC {crcs}"


_sra = crcmod.mkCrcFun(0x1814141AB, initCrc=0, rev=False, xorOut=0)


def sra_crc(data: bytes, start: int = 0) -> int:
    """Return the SRA CRC-32 over parameters (§12), which is sent as the first application bytes.

    Args:
        data: Parameter bytes, low byte of each value first.
        start: Result of the bytes before, to continue.
    """
    crc: int = _sra(data, start)
    return crc
