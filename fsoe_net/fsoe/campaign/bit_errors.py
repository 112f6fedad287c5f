"""Every bit error of few bits, by number."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from math import comb

from fsoe_net.fsoe.campaign.channel import Way
from fsoe_net.fsoe.campaign.walk import TrialConnection
from fsoe_net.fsoe.crc import block_crc
from fsoe_net.fsoe.pdu import frame_length

__all__ = ["bit_error", "bit_error_count", "block_bits", "block_count", "code_distance"]


def block_count(size_bytes: int) -> int:
    """Return how many blocks of data and CRC a frame of this size has."""
    return 1 if size_bytes == 6 else (size_bytes - 3) // 4


def block_bits(size_bytes: int) -> int:
    """Return how many bits a block of a frame of this size has."""
    return 24 if size_bytes == 6 else 32


@cache
def code_distance(data_bytes: int) -> int:
    """Return the fewest bits of a block, data and CRC, that can turn without being noticed.

    The CRC is linear: an error of the data goes unnoticed with exactly one error of the CRC, its
    own CRC. All errors of the data are tried.

    Args:
        data_bytes: Safe data bytes in the block, 1 or 2.
    """
    return min(
        data.bit_count() + block_crc(0, 0, 0, 0, 0, data.to_bytes(data_bytes, "little")).bit_count()
        for data in range(1, 1 << 8 * data_bytes)
    )


@cache
def _patterns(bits: int, most: int) -> tuple[int, ...]:
    """Return all numbers of ``bits`` bits with 1 … ``most`` of them set."""
    return tuple(
        sum(1 << bit for bit in chosen)
        for weight in range(1, most + 1)
        for chosen in combinations(range(bits), weight)
    )


_FEW_BLOCKS = 2


def _way_count(size: int) -> tuple[int, int]:
    """Return how many patterns lie within blocks and how many anywhere in a frame."""
    bits, blocks = block_bits(size), block_count(size)
    most = code_distance(1 if size == 6 else 2) - 1
    one = sum(comb(bits, weight) for weight in range(1, most + 1))
    return one * (blocks if blocks <= _FEW_BLOCKS else 1), 8 * size + comb(8 * size, 2)


def bit_error_count(link: TrialConnection) -> int:
    """Return how many bit errors there are: see `bit_error`."""
    return sum(sum(_way_count(frame_length(size))) for size in link.sizes)


def bit_error(link: TrialConnection, number: int) -> tuple[Way, int]:
    """Return direction and mask of bit error ``number``, see `Flip`.

    First all patterns of fewer bits than `code_distance` within a block: in each of one or two
    blocks, in turn in those of a longer frame, as the code is the same in all. Then all patterns
    of one and two bits anywhere in the frame.
    """
    way = Way.TO_SUB
    size = frame_length(link.sizes[way])
    if number >= sum(_way_count(size)):
        number -= sum(_way_count(size))
        way = Way.TO_MAIN
        size = frame_length(link.sizes[way])
    within, _ = _way_count(size)
    if number >= within:
        return way, _patterns(8 * size, 2)[number - within]
    bits, blocks = block_bits(size), block_count(size)
    patterns = _patterns(bits, code_distance(1 if size == 6 else 2) - 1)
    block = number // len(patterns) if blocks <= _FEW_BLOCKS else number % blocks
    return way, patterns[number % len(patterns)] << (8 + bits * block)
