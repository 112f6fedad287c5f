"""What is due by a state table, and where an end does otherwise."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.fsoe.pdu import decode_pdu, describe, is_frame_length

_LONG = 120  # characters of a frame in a message


def frame_text(frame: bytes | None) -> str:
    """Return a frame for a message, a long one cut."""
    if frame is None:
        return "nothing"
    text = describe(decode_pdu(frame)) if is_frame_length(len(frame)) else frame.hex()
    return text if len(text) <= _LONG else f"{text[:_LONG]}... ({len(frame)} bytes)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Departure:
    """Where an end does otherwise than its table.

    Attributes:
        text: What it did, and what was due.
        accepted: Whether it went on with a frame that it must refuse.
    """

    text: str
    accepted: bool = False


@dataclass(frozen=True, slots=True)
class Due:
    """What an end has to do in a call.

    Attributes:
        codes: Codes of the Reset that is due; empty when it has to go on.
        commands: Commands it goes on with; empty when a Reset or nothing is due.
        data: First safe data of that frame, where they are known.
        may: Codes with which it may refuse instead of going on.
    """

    codes: tuple[int, ...] = ()
    commands: tuple[int, ...] = ()
    data: bytes = b""
    may: tuple[int, ...] = ()
