"""The action required by a state table, and deviations of an end from it."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.fsoe.pdu import decode_pdu, describe, is_frame_length

_LONG = 120  # characters of a frame in a message


def frame_text(frame: bytes | None) -> str:
    """Return a frame as text for a message; a long one is truncated."""
    if frame is None:
        return "nothing"
    text = describe(decode_pdu(frame)) if is_frame_length(len(frame)) else frame.hex()
    return text if len(text) <= _LONG else f"{text[:_LONG]}... ({len(frame)} bytes)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Departure:
    """A deviation of an end from its table.

    Attributes:
        text: The actual and the required action.
        accepted: Whether it continued after a frame that it must reject.
    """

    text: str
    accepted: bool = False


@dataclass(frozen=True, slots=True)
class Due:
    """The required action of an end in a call.

    Attributes:
        codes: Codes of the Reset that is due; empty when it must continue.
        commands: Commands with which it continues; empty when a Reset or no action is due.
        data: First safe data of that frame, if known.
        may: Codes with which it may reject the frame instead of continuing.
    """

    codes: tuple[int, ...] = ()
    commands: tuple[int, ...] = ()
    data: bytes = b""
    may: tuple[int, ...] = ()
