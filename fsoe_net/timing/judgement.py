"""What is said about a required time or sum, as data; words for people stand beside it."""

from __future__ import annotations

import enum

__all__ = ["Judgement"]


class Judgement(enum.Enum):
    """How a value stands to what is required of it; none of them says that it is good enough."""

    WITHIN = "within"
    ABOVE = "above"
    PRINTED_ONLY = "printed only"  # within as vendors print it, above with the handshake counted
    UNVERIFIED = "unverified"  # within, but nobody answers for a value of it
    MISSING = "missing"  # not judged: something is not stated
    NONE = "none"  # nothing is required
