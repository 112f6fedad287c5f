"""Result for a required time or sum, as data; the texts for people are separate."""

from __future__ import annotations

import enum

_ROUNDING_MS = 1e-6  # a nanosecond; errors of sums of decimal fractions are a million times smaller


def exceeds(one: float, other: float) -> bool:
    """Whether a time in ms is longer than another, beyond floating-point rounding.

    12.6 + 19.4 + ... may result in 243.60000000000002 if 243.6 is allowed.
    """
    return one - other > _ROUNDING_MS


class Judgement(enum.Enum):
    """A value compared with its requirement; none of the results means that it is sufficient."""

    WITHIN = "within"
    ABOVE = "above"
    UNVERIFIED = "unverified"  # within, but one of its values is unverified
    MISSING = "missing"  # not judged because a value is not stated
    NONE = "none"  # no requirement


class WatchdogJudgement(enum.Enum):
    """A configured watchdog compared with its admissible interval."""

    WITHIN = "within"
    EMPTY = "empty"  # no watchdog fits
    BELOW = "below"  # it may expire without a fault
    ABOVE = "above"  # the required reaction time is exceeded
    UNLIMITED = "unlimited"  # not below the minimum; no reaction time is required
    UNSTATED = "unstated"
    NO_TIMES = "no times"
