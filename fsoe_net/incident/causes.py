"""Ranks possible causes of an incident; reports if none matches, instead of guessing."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.incident.candidate import Candidate
from fsoe_net.incident.causes_bus import bus_causes
from fsoe_net.incident.causes_fsoe_ends import end_causes
from fsoe_net.incident.causes_places import place_causes
from fsoe_net.incident.causes_start import start_causes
from fsoe_net.incident.evidence import IncidentEvidence

LIKELY = 50
"""Minimum score of a likely cause."""
_SHOWN = 20
_MOST = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdicts:
    """The likely cause, or ``None``; the others that match in part, best first."""

    likely: Candidate | None
    others: tuple[Candidate, ...]


def judge(e: IncidentEvidence) -> Verdicts:
    """Return the causes that match the evidence; each cause once, with its best score."""
    best: dict[str, Candidate] = {}
    for rule in (start_causes, place_causes, bus_causes, end_causes):
        for found in rule(e):
            known = best.get(found.key)
            if known is None or found.score > known.score:
                best[found.key] = found
    # Also sorted by key: equal scores must give the same order in each run.
    rows = sorted(best.values(), key=lambda c: (-c.score, c.key))
    rows = [c for c in rows if c.score >= _SHOWN]
    # Below this score there are several possible causes; calling one likely would mislead.
    likely = rows[0] if rows and rows[0].score >= LIKELY else None
    others = rows[1:] if likely else rows
    return Verdicts(likely=likely, others=tuple(others[:_MOST]))
