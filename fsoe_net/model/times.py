"""Times as written by people: ``30``, ``30s``, ``500ms``, ``2min``."""

from __future__ import annotations

import re

TIME_UNITS_NS = {
    "ns": 1,
    "us": 1_000,
    "ms": 1_000_000,
    "s": 1_000_000_000,
    "min": 60_000_000_000,
    "h": 3_600_000_000_000,
}
_TIME = re.compile(rf"([0-9]{{1,12}}(?:\.[0-9]{{1,9}})?) ?({'|'.join(TIME_UNITS_NS)})?")


def time_ns(text: str, *, bare_ns: int = 0) -> int | None:
    """Return a time in nanoseconds, or ``None`` if the text is not a time.

    Args:
        text: Number and unit.
        bare_ns: Unit of a number without a unit, in nanoseconds; 0 rejects it.
    """
    match = _TIME.fullmatch(text)
    if match is None:
        return None
    unit_ns = TIME_UNITS_NS[match[2]] if match[2] else bare_ns
    return round(float(match[1]) * unit_ns) if unit_ns else None


def time_text(ns: int) -> str:
    """Return a time in its largest whole unit: ``500ms``, ``168h``."""
    unit = next(u for u in reversed(TIME_UNITS_NS) if ns % TIME_UNITS_NS[u] == 0) if ns else "s"
    return f"{ns // TIME_UNITS_NS[unit]}{unit}"
