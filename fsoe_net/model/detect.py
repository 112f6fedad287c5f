"""Rates how certain it is that process data are an FSoE frame, as a number and in words.

`find_blocks` decides by the layout of the objects alone, as plans require. Files of other tools
also have names and unfinished mappings, and a person must decide about the doubtful ones. This
module therefore rates the same structure:

    place of the CRCs and the connection ID     40 command, CRCs and connection ID on one index 30
    (15 if one CRC is on a neighbour) index where frames of the profiles are       15   (0x6xxx,
    0x7xxx, 0xE6xx, 0xE7xx) safe data on objects of their own             5 names that speak of FSoE
    10   (-40 when there are names and none does)

From `SURE` on, a frame may be used without asking. A length alone is never sufficient, because
ordinary process data of six bytes are common. Names alone are not sufficient either: they may be
empty, translated or swapped.
"""

from __future__ import annotations

import re

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Entry, Pdo, SyncManager
from fsoe_net.model.layout import (
    FsoeBlock,
    Placed,
    find_blocks,
    frames_at,
)

SURE = 80
_MOST_LIKELY = 70  # highest score of a frame with a CRC on another index
_LEAST = 50
_MAX_ENTRIES = 20_000

_FSOE = re.compile(r"f\W?s\W?o\W?e|safety|twinsafe", re.IGNORECASE)
_COMMAND = re.compile(r"\bcmd|command", re.IGNORECASE)
_CRC = re.compile(r"crc", re.IGNORECASE)
_CONNECTION = re.compile(r"conn", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeGuess:
    """A frame with the evidence for and against it.

    Attributes:
        block: Position, length and command.
        score: 0 … 100, see the module docstring.
        reasons: Observations, in words.
        doubts: Deviations, in words.
    """

    block: FsoeBlock
    score: int
    reasons: tuple[str, ...]
    doubts: tuple[str, ...]

    @property
    def sure(self) -> bool:
        """Whether it may be used without asking."""
        return self.score >= SURE


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeNearMiss:
    """Process data that are named like a frame but are not one, and the reasons, in words."""

    pdo: Pdo
    why: str


def detect_fsoe(placed: tuple[Placed, ...], sm: SyncManager) -> tuple[FsoeGuess, ...]:
    """Find and score the frames of a sync manager.

    Args:
        placed: Its entries, see `place_entries` and `SmLayout.placed`.
        sm: The sync manager.

    Returns:
        Frames by ascending offset; they do not overlap.
    """
    # Files of unknown origin: the search time grows with the square of the entries.
    if len(placed) > _MAX_ENTRIES:
        return ()
    starts = {p.bit_offset: n for n, p in enumerate(placed)}
    blocks = find_blocks(placed, sm)
    taken = [(8 * b.byte_offset, 8 * b.end_byte) for b in blocks]
    guesses = [_weigh(placed, starts, block, one_index=not block.likely) for block in blocks]
    # Only gaps between sure frames: a doubtful frame must not overlap one.
    for command in placed:
        if any(low <= command.bit_offset < high for low, high in taken):
            continue
        # A frame cannot continue into the next one.
        room = next((low for low, _ in sorted(taken) if low > command.bit_offset), None)
        end = placed[-1].end_bit if room is None else room
        guess = _by_names(placed, starts, command, sm, end)
        if guess is not None:
            guesses.append(guess)
            taken.append((8 * guess.block.byte_offset, 8 * guess.block.end_byte))
    # A weak guess with a supporting structure is kept, so that a person decides.
    found = (g for g in guesses if g.score >= _LEAST or not g.block.likely)
    return tuple(sorted(found, key=lambda g: g.block.byte_offset))


def near_misses(placed: tuple[Placed, ...], sm: SyncManager) -> tuple[FsoeNearMiss, ...]:
    """Report PDOs that mention CRC and connection ID but contain no frame, with the error.

    Args:
        placed: The entries of a sync manager.
        sm: The sync manager.
    """
    held = [(8 * g.block.byte_offset, 8 * g.block.end_byte) for g in detect_fsoe(placed, sm)]
    found: list[FsoeNearMiss] = []
    # Names without structure: an unfinished mapping that a person must complete.
    for pdo, rows in _by_pdo(placed):
        inside = any(low <= r.bit_offset < high for r in rows for low, high in held)
        has_crc = any(_CRC.search(r.entry.name) for r in rows)
        has_id = any(_CONNECTION.search(r.entry.name) for r in rows)
        if not inside and has_crc and has_id:
            found.append(FsoeNearMiss(pdo=pdo, why=_why_not(rows)))
    return tuple(found)


def _by_pdo(placed: tuple[Placed, ...]) -> list[tuple[Pdo, list[Placed]]]:
    groups: list[tuple[Pdo, list[Placed]]] = []
    for row in placed:
        if not groups or groups[-1][0] is not row.pdo:
            groups.append((row.pdo, []))
        groups[-1][1].append(row)
    return groups


def _why_not(rows: list[Placed]) -> str:
    """Return the first deviation from the frame that the names suggest.

    Some of the entries are named as CRCs.
    """
    base = next((r for r in rows if r.entry.bits == 8 and not r.entry.is_gap), None)
    if base is None:
        return "no command of 8 bits was found"
    if base.bit_offset % 8:
        return f"its command {base.entry.address} starts at bit {base.bit_offset}, inside a byte"
    crcs = [r for r in rows if _CRC.search(r.entry.name)]
    for number, row in enumerate(crcs):
        # A single CRC follows one byte of safe data, or two bytes like all others.
        wanted = [24 + 32 * number] if len(crcs) > 1 else [16, 24]
        wrong = _wrong_crc(row, number, row.bit_offset - base.bit_offset, wanted)
        if wrong:
            return wrong
    words = {r.bit_offset for r in rows if r.entry.bits == 16 and not r.entry.is_gap}
    if crcs[-1].end_bit not in words:
        return "no connection ID of 16 bits follows the last CRC"
    return "its command, CRCs and connection ID do not belong together"


def _wrong_crc(row: Placed, number: int, bits: int, wanted: list[int]) -> str:
    what = f"CRC {number} ({row.entry.address})"
    if row.entry.bits != 16:
        return f"{what} has {row.entry.bits} bits instead of 16"
    if bits not in wanted:
        places = " or ".join(map(str, wanted))
        return f"{what} starts {bits} bits after the command instead of {places}"
    return ""


def _weigh(
    placed: tuple[Placed, ...],
    starts: dict[int, int],
    block: FsoeBlock,
    *,
    one_index: bool,
) -> FsoeGuess:
    command = placed[starts[8 * block.byte_offset]]
    end_bit = 8 * block.end_byte
    # The longest interpretation of the frame: a shorter one would count CRCs as data.
    words = max(frames_at(placed, starts, command, end_bit), key=len)
    index = command.entry.index
    score, most = 40, 100
    reasons = [
        f"{block.frame_bytes} bytes from byte {block.byte_offset}: a command, "
        f"{block.safe_bytes} safe bytes, {len(words) - 1} CRC and a connection ID at their places"
    ]
    doubts: list[str] = []
    others = [w.entry for w in words if w.entry.index != index]
    # One index for all is typical of the profile; neighbours occur in some mappings.
    if one_index:
        score += 30
        reasons.append(f"command, CRC and connection ID are on object 0x{index:04x}")
    else:
        near = len(others) == 1 and abs(others[0].index - index) <= 0x0F
        score += 15 if near else 0
        most = _MOST_LIKELY
        places = ", ".join(e.address for e in others[:4])
        doubts.append(f"not on the object of the command 0x{index:04x}: {places}")
    if _is_usual(index):
        score += 15
    else:
        doubts.append(f"object 0x{index:04x} is outside 0x6000 … 0x7fff and 0xe600 … 0xe7ff")
    inside = _inside(placed, command, words, block)
    # Padding alone is written by a tool before a safety project exists.
    if any(not e.is_gap for e in inside):
        score += 5
        reasons.append("the safe data are on objects of their own")
    else:
        doubts.append("the safe data are nothing but padding")
    points, texts = _names(command, [w.entry for w in words], inside)
    score += points
    (reasons if points > 0 else doubts).extend(texts)
    return FsoeGuess(
        block=block,
        score=max(0, min(score, most)),
        reasons=tuple(reasons),
        doubts=tuple(doubts),
    )


def _is_usual(index: int) -> bool:
    return 0x6000 <= index <= 0x7FFF or 0xE600 <= index <= 0xE7FF


def _inside(
    placed: tuple[Placed, ...], command: Placed, words: tuple[Placed, ...], block: FsoeBlock
) -> list[Entry]:
    checks = {w.bit_offset for w in words}
    low, high = command.bit_offset, 8 * block.end_byte
    return [p.entry for p in placed if low < p.bit_offset < high and p.bit_offset not in checks]


def _names(command: Placed, words: list[Entry], inside: list[Entry]) -> tuple[int, list[str]]:
    """Return the score of the names, and their meaning."""
    checks = [w.name for w in words]
    named = [n for n in (command.entry.name, *checks) if n]
    if not named:
        return 0, []
    every = [command.pdo.name, *named, *(e.name for e in inside)]
    # Names are written by people, so they support a decision but do not make it.
    speaking = [n for n in checks if _CRC.search(n) or _CONNECTION.search(n)]
    speaking += [n for n in every if _FSOE.search(n)]
    # A lone name "command" is usual for FSoE.
    if len(named) == 1 and _COMMAND.search(named[0]):
        speaking.append(named[0])
    if speaking:
        return 10, [f"names mention FSoE, such as {speaking[0][:40]!r}"]
    # Names about other subjects are strong evidence against a frame.
    return -40, [f"no name mentions FSoE, CRC or connection: {', '.join(named[:3])[:80]}"]


def _by_names(
    placed: tuple[Placed, ...],
    starts: dict[int, int],
    command: Placed,
    sm: SyncManager,
    end_bit: int,
) -> FsoeGuess | None:
    """Return a frame by its positions if its indices differ but its names support it."""
    entry = command.entry
    # Objects below 0x2000 are data types and communication (ETG.1000.6), never process data.
    if entry.bits != 8 or entry.is_gap or command.bit_offset % 8 or entry.index < 0x2000:
        return None
    best: FsoeGuess | None = None
    for words in frames_at(placed, starts, command, end_bit):
        names = [w.entry.name for w in words]
        if not any(_CRC.search(n) for n in names) or not any(_CONNECTION.search(n) for n in names):
            continue
        block = FsoeBlock(
            byte_offset=command.bit_offset // 8,
            frame_bytes=(words[-1].end_bit - command.bit_offset) // 8,
            command=entry,
            direction=sm.direction,
            sm_index=sm.index,
            likely=True,
        )
        # Shorter frames are found first; the longest one counts.
        best = _weigh(placed, starts, block, one_index=False)
    return best
