"""All errors of a few bits, numbered."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from math import comb

from fsoe_net.campaign.channel import Way
from fsoe_net.campaign.clean_run import TrialConnection
from fsoe_net.fsoe.crc import block_crc
from fsoe_net.fsoe.pdu import frame_length


def block_count(size_bytes: int) -> int:
    """Return how many blocks of data and CRC a frame of this size has."""
    return 1 if size_bytes == 6 else (size_bytes - 3) // 4


def block_bits(size_bytes: int) -> int:
    """Return how many bits a block of a frame of this size has."""
    return 24 if size_bytes == 6 else 32


@cache
def code_distance(data_bytes: int) -> int:
    """Return the smallest number of bits in a block (data and CRC) that can flip undetected.

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
    """Return all numbers of ``bits`` bits in which 1 … ``most`` bits are set."""
    return tuple(
        sum(1 << bit for bit in chosen)
        for weight in range(1, most + 1)
        for chosen in combinations(range(bits), weight)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorSet:
    """All patterns of a few bits in one direction of a connection.

    Attributes:
        link: The connection to inject them into.
        way: Direction of the frames.
        bits: Bits of a block, or of the whole frame.
        most: Maximum number of bits flipped at once.
        blocks: Blocks that take the patterns in turn; 0 if they may be anywhere in the frame.
    """

    link: TrialConnection
    way: Way
    bits: int
    most: int
    blocks: int

    @property
    def count(self) -> int:
        """Number of patterns."""
        return sum(comb(self.bits, weight) for weight in range(1, self.most + 1))

    def mask(self, number: int) -> int:
        """Return the mask of pattern ``number``, see `Flip`."""
        pattern = _patterns(self.bits, self.most)[number]
        # Blocks follow the command byte.
        return pattern << (8 + self.bits * (number % self.blocks)) if self.blocks else pattern


def error_sets(links: Iterable[TrialConnection]) -> tuple[ErrorSet, ...]:
    """Return every bit error worth testing, each once.

    All blocks of one length and direction have one code, so its patterns of fewer bits than
    `code_distance` are tried once, by the first connection with such a block. The patterns of one
    and two bits anywhere in a frame are tried once per length and direction.
    """
    sets: dict[tuple[Way, int, bool], ErrorSet] = {}
    for link in links:
        for way in Way:
            size = frame_length(link.sizes[way])
            block, frame = block_bits(size), 8 * size
            most = code_distance(1 if size == 6 else 2) - 1
            blocks = block_count(size)
            within = ErrorSet(link=link, way=way, bits=block, most=most, blocks=blocks)
            sets.setdefault((way, block, True), within)
            anywhere = ErrorSet(link=link, way=way, bits=frame, most=2, blocks=0)
            sets.setdefault((way, frame, False), anywhere)
    return tuple(sets.values())
