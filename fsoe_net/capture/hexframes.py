"""FSoE frames typed or pasted as hex: one by one, or a conversation of main and sub."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from fsoe_net.core.monitor import Monitor
from fsoe_net.errors import InputError
from fsoe_net.fsoe.chain import before, is_whole
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict
from fsoe_net.fsoe.pdu import (
    Command,
    Pdu,
    decode_pdu,
    frame_length,
    is_frame_length,
    safe_data_length,
)

_MARKS = {"m": 0, "main": 0, "master": 0, ">": 0, "s": 1, "sub": 1, "slave": 1, "<": 1}
_BYTE = re.compile(r"(?:0x)?[0-9a-f]{1,2}", re.IGNORECASE)
_LONG = 60  # characters of a word in a message
_SEPARATORS = str.maketrans("", "", ":-_")


@dataclass(frozen=True, slots=True, kw_only=True)
class HexFrame:
    """One frame as given; ``direction`` is 0 main to sub, 1 sub to main, ``None`` if not stated."""

    data: bytes
    direction: int | None
    place: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowedFrame:
    """One frame and the known facts about it.

    Attributes:
        frame: The frame as given.
        pdu: Its parsed form.
        direction: 0 main to sub, 1 sub to main; assumed when ``frame.direction`` is ``None``.
        verdict: Result of the CRC check, given the preceding frames.
        state: State of the connection after it.
        sequence: Its number in the chain, 0 when unknown.
        lengths: Assumed frame lengths of both directions.
        note: Further remarks when the preceding frames are missing.
    """

    frame: HexFrame
    pdu: Pdu
    direction: int
    verdict: CrcVerdict
    state: ConnectionState
    sequence: int
    lengths: tuple[int, int]
    note: str


def parse_frames(texts: Iterable[tuple[str, str]]) -> Iterator[HexFrame]:
    """Extract frames from text.

    A line contains frames, one word each, or the bytes of one frame as words of two digits. ``m``
    or ``>`` before a frame marks a frame of the main, ``s`` or ``<`` one of the sub. ``#`` begins a
    comment; ``0x``, ``:``, ``-``, ``_`` and commas are ignored.

    Args:
        texts: Place for messages, e.g. ``stdin:3``, and text.

    Raises:
        InputError: A word is not hexadecimal, or its length is invalid for an FSoE frame.
    """
    for number, (place, text) in enumerate(texts):
        if number == 0:
            text = text.removeprefix("\ufeff")  # a byte order mark, as some editors write it
        words = text.partition("#")[0].replace(",", " ").split()
        direction: int | None = None
        single: list[str] = []
        for word in words:
            mark = word.rstrip(":").lower()
            if mark in _MARKS:
                yield from _joined(single, direction, place)
                single, direction = [], _MARKS[mark]
            elif _BYTE.fullmatch(word):
                single.append(word.lower().removeprefix("0x").zfill(2))
            else:
                yield from _joined(single, direction, place)
                single = []
                yield _frame(word, direction, place)
                direction = None
        yield from _joined(single, direction, place)


def _joined(words: list[str], direction: int | None, place: str) -> Iterator[HexFrame]:
    if words:
        yield _frame("".join(words), direction, place)


def _frame(word: str, direction: int | None, place: str) -> HexFrame:
    digits = word.translate(_SEPARATORS).lower().removeprefix("0x")
    try:
        data = bytes.fromhex(digits)
    except ValueError as exc:
        raise InputError(
            f"{place}: {_shown(word)} is neither hex nor a file; a frame is written as "
            "2a0000c42d0000"
        ) from exc
    if not is_frame_length(len(data)):
        raise InputError(
            f"{place}: {_shown(word)} has {len(data)} bytes; FSoE frames have 6, 7, 11, 15 … 255"
        )
    return HexFrame(data=data, direction=direction, place=place)


def _shown(word: str) -> str:
    """Return a word for a message, truncated if long."""
    return repr(word) if len(word) <= _LONG else f"{word[:_LONG]!r}..."


def follow_frames(frames: Iterable[HexFrame]) -> Iterator[FollowedFrame]:
    """Follow frames as one conversation.

    A frame without a direction is taken as an answer to the preceding one: the main begins. When
    the two directions have different lengths, the length decides.

    Raises:
        InputError: The frames have more than two lengths, or two in one direction.
    """
    rows = list(frames)
    lengths = _lengths(rows)
    monitor = Monitor(safe_data_length(lengths[0]), safe_data_length(lengths[1]))
    # A first frame without a direction then belongs to the MainInstance.
    last = 1
    for frame in rows:
        direction = frame.direction
        if direction is None:
            direction = _assumed(frame.data, lengths, last)
        last = direction
        if len(frame.data) != lengths[direction]:
            way = ("main", "sub")[direction]
            raise InputError(
                f"{frame.place}: {frame.data.hex()} has {len(frame.data)} bytes, other frames of "
                f"the {way} have {lengths[direction]}; decode one connection at a time"
            )
        pdu = decode_pdu(frame.data)
        verdict = monitor.frame(direction, frame.data, 0)
        numbered = verdict is CrcVerdict.RIGHT and pdu.command != Command.RESET
        yield FollowedFrame(
            frame=frame,
            pdu=pdu,
            direction=direction,
            verdict=verdict,
            state=monitor.state,
            # The monitor already holds the number of the next frame.
            sequence=before(monitor.sequence(direction)) if numbered else 0,
            lengths=lengths,
            note=_note(pdu) if verdict is CrcVerdict.UNCHECKED else "",
        )


def _note(pdu: Pdu) -> str:
    """Return the facts visible in a single frame."""
    if not is_whole(pdu):
        return "its blocks do not fit each other: damaged"
    if len(pdu.crcs) == 1:
        return "the CRC depends on the frame before, which is missing"
    return "its blocks fit each other; CRC 0 depends on the frame before, which is missing"


def _assumed(data: bytes, lengths: tuple[int, int], last: int) -> int:
    if lengths[0] != lengths[1]:
        return int(len(data) == lengths[1])
    return 1 - last


def _lengths(rows: list[HexFrame]) -> tuple[int, int]:
    """Return the frame lengths of both directions."""
    main = next((len(row.data) for row in rows if row.direction == 0), None)
    sub = next((len(row.data) for row in rows if row.direction == 1), None)
    seen = list(dict.fromkeys(len(row.data) for row in rows)) or [frame_length(2)]
    if main is None:
        main = next((n for n in seen if n != sub), seen[0])
    if sub is None:
        sub = next((n for n in seen if n != main), main)
    return main, sub
