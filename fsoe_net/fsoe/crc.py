"""CRCs of FSoE: the CRC-16 of every data block (§2) and the CRC-32 over parameters (§12).

Section numbers in this package are those of the protocol notes,
``docs/explanation/fsoe-engine.md``.
"""

from __future__ import annotations

import struct

import crcmod

_POLYNOMIAL = 0x139B7
_crc16 = crcmod.mkCrcFun(_POLYNOMIAL, initCrc=0, rev=False, xorOut=0)
_crc32 = crcmod.mkCrcFun(0x1814141AB, initCrc=0, rev=False, xorOut=0)
_HEAD = struct.Struct("<HHHB")
_ZEROS = b"\0\0\0"
_NUMBERS = tuple(struct.pack("<H", n) if n else b"" for n in range(63))


def block_crc(
    old: int, connection_id: int, sequence: int, command: int, block: int, data: bytes
) -> int:
    """Return the CRC-16 of one block (§2), calculated over these bytes.

    Byte    0..1    2..3      4..5      6      7..8      9..10     11..13
          +-------+--------+---------+-----+----------+--------+------------+
          |  old  | ConnID | sequence| cmd |  block   |  data  |  00 00 00  |
          +-------+--------+---------+-----+----------+--------+------------+
                                             not for
                                             block 0

    Args:
        old: CRC_0 of the previous frame in either direction; 0 after a Reset.
        connection_id: Value of the frame's own ConnID field.
        sequence: Sequence number, 1 … 65535.
        command: Command byte.
        block: Number of the block, 0 … 62.
        data: Two safe data bytes, or one if the frame carries only one.
    """
    head = _HEAD.pack(old, connection_id, sequence, command)
    crc: int = _crc16(head + _NUMBERS[block] + data + _ZEROS)
    return crc


# A CRC that starts from 0 is linear: the CRC of a block is that of its head followed by zeros, XOR
# that of its number followed by zeros, XOR that of its data; the last two come from tables.
_LOW = tuple(_crc16(bytes((value, 0)) + _ZEROS) for value in range(256))
_HIGH = tuple(_crc16(bytes((value,)) + _ZEROS) for value in range(256))
_HEAD_ONE, _HEAD_TWO = struct.Struct("<HHHB4x"), struct.Struct("<HHHB5x")
_NUMBER = tuple(_crc16(number + bytes(5)) for number in _NUMBERS)


def frame_crcs(
    old: int, connection_id: int, sequence: int, command: int, data: bytes
) -> tuple[int, ...]:
    """Return the CRCs of all blocks of a frame; same as `block_crc` for each, but faster."""
    if len(data) == 1:
        head: int = _crc16(_HEAD_ONE.pack(old, connection_id, sequence, command))
        return (head ^ _HIGH[data[0]],)
    head = _crc16(_HEAD_TWO.pack(old, connection_id, sequence, command))
    crcs = [head ^ _LOW[data[0]] ^ _HIGH[data[1]]]
    if len(data) > 2:
        head = _crc16(b"\0\0", head)  # the numbers of the blocks after the first
        for block in range(1, len(data) // 2):
            low, high = data[2 * block], data[2 * block + 1]
            crcs.append(head ^ _NUMBER[block] ^ _LOW[low] ^ _HIGH[high])
    return tuple(crcs)


def solve_sequence(old: int, connection_id: int, command: int, data: bytes, crc: int) -> int:
    """Return the one sequence number with which block 0 has this CRC; 0 is never used by FSoE.

    The number enters the CRC through its two bytes; after that the register is only shifted. The
    remainder without the rest of the block, shifted back, is the number, low byte first.

    Args:
        old: CRC_0 of the previous frame.
        connection_id: Value of the frame's own ConnID field.
        command: Command byte.
        data: Safe data of the frame.
        crc: CRC_0 of the frame.
    """
    rest = crc ^ frame_crcs(old, connection_id, 0, command, data)[0]
    bytes_behind = 1 + min(len(data), 2) + len(_ZEROS)
    for _ in range(16 + 8 * bytes_behind):
        rest = (rest ^ _POLYNOMIAL) >> 1 if rest & 1 else rest >> 1
    return (rest & 0xFF) << 8 | rest >> 8


def sra_crc(data: bytes, start: int = 0) -> int:
    """Return the SRA CRC-32 over parameters (§12), sent as the first four application bytes.

    Args:
        data: Parameter bytes, low byte of each value first.
        start: Result for the preceding bytes, to continue; 0 to begin.
    """
    crc: int = _crc32(data, start)
    return crc
