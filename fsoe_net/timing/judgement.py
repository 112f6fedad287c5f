"""Result for a required time or sum, as data; the texts for people are separate."""

from __future__ import annotations

import enum

_ROUNDING_MS = 1e-6  # a nanosecond: what sums of decimal fractions are off is a million times less


def exceeds(one: float, other: float) -> bool:
    """Whether a time in ms is longer than another, not only by the rounding of floating point.

    12.6 + 19.4 + ... may come out as 243.60000000000002 where 243.6 is allowed.
    """
    return one - other > _ROUNDING_MS


class Judgement(enum.Enum):
    """A value compared with its requirement; none of the results means that it is sufficient."""

    WITHIN = "within"
    ABOVE = "above"
    UNVERIFIED = "unverified"  # within, but one of its values is not verified
    MISSING = "missing"  # not judged: something is not stated
    NONE = "none"  # no requirement


class WatchdogJudgement(enum.Enum):
    """A configured watchdog compared with its admissible interval."""

    WITHIN = "within"
    EMPTY = "empty"  # no watchdog fits
    BELOW = "below"  # it may end without a fault
    ABOVE = "above"  # the required reaction time is not kept
    UNLIMITED = "unlimited"  # not below the least; no reaction time is required
    UNSTATED = "unstated"
    NO_TIMES = "no times"
