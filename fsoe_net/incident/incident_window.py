"""The window of an incident in slices, with the errors in each, to be drawn or printed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from fsoe_net.incident.evidence import IncidentEvidence


class Wrong(IntEnum):
    """Type of error in a slice; the worst has the highest number."""

    NOTHING = 0
    LATE = 1
    SHORT = 2
    LOST = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Slice:
    """A part of the window; ``begin`` is its position from 0 to 1."""

    begin: float
    wrong: Wrong


@dataclass(frozen=True, slots=True, kw_only=True)
class IncidentWindow:
    """All slices; ``moment`` is the position of the trigger from 0 to 1."""

    slices: tuple[Slice, ...]
    moment: float


def window_of(e: IncidentEvidence) -> IncidentWindow | None:
    """Return the window in slices, or ``None`` if there is none."""
    bus = e.bus
    span_ns = bus.last_ns - bus.first_ns
    if not bus.timeline or span_ns <= 0:
        return None

    def share(now_ns: int) -> float:
        return min(1.0, max(0.0, (now_ns - bus.first_ns) / span_ns))

    return IncidentWindow(
        slices=tuple(
            Slice(begin=share(start), wrong=_wrong(short, lost, extra_ns, bus.cycle_ns))
            for start, _, short, lost, extra_ns in bus.timeline
        ),
        moment=share(e.moment_ns),
    )


def _wrong(short: int, lost: int, extra_ns: int, cycle_ns: int) -> Wrong:
    if lost:
        return Wrong.LOST
    if short:
        return Wrong.SHORT
    return Wrong.LATE if extra_ns > cycle_ns > 0 else Wrong.NOTHING
