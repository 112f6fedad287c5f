"""Observations of a connection: its state, the direction of a frame, the verdict on the CRCs.

The members of each enum have the order of the numbers in the C core, from 0.
"""

from __future__ import annotations

import enum


class CrcVerdict(enum.StrEnum):
    """Verdict on the CRCs of one frame; the value is the word in documents."""

    SAME = "same"
    """The frame repeats the bytes of the previous one, so it is not an event (§10)."""
    RIGHT = "right"
    """Every CRC matches the chain."""
    WRONG = "wrong"
    """A CRC does not match."""
    UNCHECKED = "unchecked"
    """The chain is not yet known, or frames were missed."""


class FrameDirection(enum.IntEnum):
    """Direction of a frame; also the index of everything stored per direction."""

    TO_SUB = 0
    """From the MainInstance to the SubInstance."""
    TO_MAIN = 1
    """From the SubInstance to the MainInstance."""

    def __str__(self) -> str:
        """Return the word in documents: ``main_to_sub`` or ``sub_to_main``."""
        return ("main_to_sub", "sub_to_main")[self]

    __format__ = enum.Enum.__format__


class ConnectionState(enum.StrEnum):
    """State of a connection; the value is the word in documents.

    On the wire it follows from the commands of both directions; the lagging end decides.
    """

    SILENT = "silent"
    """No frame in at least one direction."""
    RESET = "reset"
    SESSION = "session"
    CONNECTION = "connection"
    PARAMETER = "parameter"
    DATA_FAILSAFE = "data_failsafe"
    """Data, with FailSafeData in at least one direction."""
    DATA_PROCESS = "data_process"
    """Data, with ProcessData in both directions."""
    UNKNOWN = "unknown"
    """The commands do not belong to a state."""

    @classmethod
    def from_event(cls, word: str) -> ConnectionState:
        """Return the state for a word of ``fsn-master``; `UNKNOWN` for an unrecognised word."""
        return _OF_EVENTS.get(word, cls.UNKNOWN)

    @property
    def event_word(self) -> str:
        """The word of ``fsn-master`` in events and incident files, such as ``process data``."""
        return _EVENT_WORDS.get(self, self.value)

    @property
    def text(self) -> str:
        """The state for people, such as ``Data · ProcessData``."""
        return _TEXTS.get(self, self.value.capitalize())

    @property
    def in_data(self) -> bool:
        """Whether it is Data, with ProcessData or FailSafeData."""
        return self in _TEXTS


_EVENT_WORDS = {
    ConnectionState.DATA_FAILSAFE: "failsafe data",
    ConnectionState.DATA_PROCESS: "process data",
}
_OF_EVENTS = {state.event_word: state for state in ConnectionState}
_TEXTS = {
    ConnectionState.DATA_FAILSAFE: "Data · FailSafeData",
    ConnectionState.DATA_PROCESS: "Data · ProcessData",
}
