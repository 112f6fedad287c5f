"""What is said about a required time or sum, as data; words for people stand beside it."""

from __future__ import annotations

import enum

__all__ = ["Judgement", "WatchdogJudgement"]


class Judgement(enum.Enum):
    """How a value stands to what is required of it; none of them says that it is good enough."""

    WITHIN = "within"
    ABOVE = "above"
    PRINTED_ONLY = "printed only"  # within as vendors print it, above with the handshake counted
    UNVERIFIED = "unverified"  # within, but nobody answers for a value of it
    MISSING = "missing"  # not judged: something is not stated
    NONE = "none"  # nothing is required


class WatchdogJudgement(enum.Enum):
    """How a configured watchdog stands to its admissible interval."""

    WITHIN = "within"
    EMPTY = "empty"  # no watchdog fits
    BELOW = "below"  # it may end without a fault
    ABOVE = "above"  # the required reaction time is not kept
    PRINTED_ONLY = "printed only"  # within as vendors print it, above with the handshake counted
    UNLIMITED = "unlimited"  # not below the least; no reaction time is required
    UNSTATED = "unstated"
    NO_TIMES = "no times"
