"""Differences that a replay found, with explanations for people."""

from __future__ import annotations

from dataclasses import dataclass, fields

from fsoe_net.campaign.recording.model import Answer
from fsoe_net.fsoe.pdu import (
    decode_pdu,
    describe,
    is_frame_length,
    reset_code_text,
    safe_data_length,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """One call of one end: the recorded answer and ours.

    Attributes:
        time_us: Time of the call.
        received: Input image, of any length; ``None`` when nothing was delivered.
        state_before: Our state before the call.
        expected: Recorded answer.
        got: Our answer.
    """

    time_us: int
    received: bytes | None
    state_before: str
    expected: Answer
    got: Answer


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingDifference:
    """One value in which our end and the recorded one differ.

    Attributes:
        line: Line of the recording, from 1.
        step: Step number of the line in the recording.
        side: ``main``, ``sub`` or, for cycles that are recorded only as a hash, ``both``.
        field: ``frame``, ``state``, ``reset by``, ``reset code``, ``valid``, ``data``, ``hash``.
        expected: Recorded value; a frame with its meaning.
        got: Our value.
        call: The whole call; ``None`` for a hash.
    """

    line: int
    step: int
    side: str
    field: str
    expected: str
    got: str
    call: Compared | None = None

    def __str__(self) -> str:
        return (
            f"step {self.step} {self.side} {self.field}: expected {self.expected}, got {self.got}"
        )


def differing(expected: Answer, got: Answer) -> list[str]:
    """Return the names of the values in which two answers differ.

    If an end reports no state, only frame, validity and data are compared.
    """
    names = ["frame", "valid", "data"]
    if expected.state is not None:
        names = [field.name for field in fields(Answer)]
    return [name for name in names if getattr(expected, name) != getattr(got, name)]


def value_text(answer: Answer, name: str) -> str:
    """Return one value of an answer as text."""
    value = getattr(answer, name)
    if name == "frame":
        return frame_text(value)
    return value.hex(" ") if isinstance(value, bytes) else str(value)


def frame_text(frame: bytes | None) -> str:
    """Return a frame in hex with its meaning; it may have any length."""
    if frame is None:
        return "no frame"
    if not is_frame_length(len(frame)):
        shown = frame.hex() if len(frame) <= 255 else f"{frame[:32].hex()}..."
        return f"{shown} ({len(frame)} bytes: no FSoE frame)"
    return f"{frame.hex()} ({describe(decode_pdu(frame))})"


def byte_names(length: int) -> list[str]:
    """Return the meaning of each byte of a frame of this length, e.g. ``CRC 0 low``."""
    names = ["command"]
    size = safe_data_length(length)
    for block in range((size + 1) // 2):
        names += [f"data {n}" for n in range(2 * block, min(2 * block + 2, size))]
        names += [f"CRC {block} low", f"CRC {block} high"]
    return [*names, "ConnID low", "ConnID high"]


def _byte_rows(expected: bytes | None, got: bytes | None) -> list[tuple[int, str]]:
    """Return position and meaning of each byte that differs between two frames."""
    if expected is None or got is None or len(expected) != len(got):
        return []
    names = byte_names(len(expected))
    return [
        (n, f"{n} ({names[n]}): {a:02x}, got {b:02x}")
        for n, (a, b) in enumerate(zip(expected, got, strict=True))
        if a != b
    ]


def differing_bytes(call: Compared) -> list[int]:
    """Return the positions, from 0, at which the frames of a call differ."""
    return [n for n, _ in _byte_rows(call.expected.frame, call.got.frame)]


def _reset_text(answer: Answer) -> str:
    if answer.reset_by == "none":
        return "no reset"
    code = answer.reset_code
    meaning = "no code" if code is None else f"code {code}: {reset_code_text(code)}"
    return f"reset by {answer.reset_by}, {meaning}"


def _answer_text(answer: Answer) -> str:
    data = "valid" if answer.valid else "not valid"
    shown = f"{answer.state}, {_reset_text(answer)}"
    if answer.state is None:
        shown = "state not shown"
    return f"{shown}, data {answer.data.hex(' ')} {data}"


def explain(difference: RecordingDifference) -> list[str]:
    """Return lines that describe a difference to a person."""
    call = difference.call
    if call is None:
        return [
            f"step {difference.step}: the cycles in lockstep after it give other frames",
            f"  expected SHA-256  {difference.expected}",
            f"  got SHA-256       {difference.got}",
        ]
    lines = [
        f"step {difference.step}, {call.time_us / 1000:g} ms, {difference.side}: "
        f"{difference.field} differs",
        f"  received        {frame_text(call.received)}",
        f"  expected frame  {frame_text(call.expected.frame)}",
        f"  got frame       {frame_text(call.got.frame)}",
    ]
    rows = _byte_rows(call.expected.frame, call.got.frame)
    if rows:
        lines.append("  bytes           " + "; ".join(text for _, text in rows))
    return [
        *lines,
        f"  state before    {call.state_before}",
        f"  expected after  {_answer_text(call.expected)}",
        f"  got after       {_answer_text(call.got)}",
    ]
