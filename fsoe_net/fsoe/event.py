"""States of a connection end, and the events that it reports."""

from __future__ import annotations

import enum

from fsoe_net.dataclass import dataclass


class State(enum.Enum):
    """State of a connection end."""

    RESET = "Reset"
    SESSION = "Session"
    CONNECTION = "Connection"
    PARAMETER = "Parameter"
    DATA = "Data"


class EventKind(enum.Enum):
    """The kind of event, and the end that caused it."""

    STATE = "state"
    """The start-up advanced by one state."""
    RESET_LOCAL = "reset_local"
    """This end sent a Reset on its own initiative."""
    RESET_BY_PEER = "reset_by_peer"
    """The other end sent a Reset; a SubInstance has acknowledged it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """An event worth logging; one step yields at most one.

    Attributes:
        now_ns: Time of the step.
        kind: Kind of event.
        code: Reset code. For kind STATE, the code in the frame that ended state Reset of a
            MainInstance, otherwise 0.
        state_before: State before the step.
        state_after: State after the step.
    """

    now_ns: int
    kind: EventKind
    code: int
    state_before: State
    state_after: State
