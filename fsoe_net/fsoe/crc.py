"""CRCs of FSoE: the CRC-16 of every data block (§2) and the CRC-32 over parameters (§12).

Section numbers in this package are those of the protocol notes,
``docs/explanation/fsoe-engine.md``.
"""

from __future__ import annotations

import struct

import crcmod

__all__ = ["block_crc", "frame_crcs", "sra_crc"]

_crc16 = crcmod.mkCrcFun(0x139B7, initCrc=0, rev=False, xorOut=0)
_crc32 = crcmod.mkCrcFun(0x1814141AB, initCrc=0, rev=False, xorOut=0)
_HEAD = struct.Struct("<HHHB")
_ZEROS = b"\0\0\0"
_NUMBERS = tuple(struct.pack("<H", n) if n else b"" for n in range(63))


def block_crc(
    old: int, connection_id: int, sequence: int, command: int, block: int, data: bytes
) -> int:
    """Return the CRC-16 of one block (§2), which is fed these bytes:

    Byte    0..1    2..3      4..5      6      7..8      9..10     11..13
          +-------+--------+---------+-----+----------+--------+------------+
          |  old  | ConnID | sequence| cmd |  block   |  data  |  00 00 00  |
          +-------+--------+---------+-----+----------+--------+------------+
                                             not for
                                             block 0

    Args:
        old: CRC_0 of the frame before, of either direction; 0 after a Reset.
        connection_id: Value of the frame's own ConnID field.
        sequence: Sequence number, 1 … 65535.
        command: Command byte.
        block: Number of the block, 0 … 62.
        data: Two safe data bytes, or one when the frame carries only one.
    """
    head = _HEAD.pack(old, connection_id, sequence, command)
    crc: int = _crc16(head + _NUMBERS[block] + data + _ZEROS)
    return crc


def frame_crcs(
    old: int, connection_id: int, sequence: int, command: int, data: bytes
) -> tuple[int, ...]:
    """Return the CRCs of all blocks of a frame.

    The blocks share everything up to the command, so that part is fed only once.
    """
    head = _crc16(_HEAD.pack(old, connection_id, sequence, command))
    if len(data) <= 2:
        return (_crc16(data + _ZEROS, head),)
    return tuple(
        [
            _crc16(_NUMBERS[at >> 1] + data[at : at + 2] + _ZEROS, head)
            for at in range(0, len(data), 2)
        ]
    )


def sra_crc(data: bytes, start: int = 0) -> int:
    """Return the SRA CRC-32 over parameters (§12), sent as the first four application bytes.

    Args:
        data: Parameter bytes, low byte of each value first.
        start: Result for the bytes before these, to continue; 0 to begin.
    """
    crc: int = _crc32(data, start)
    return crc
