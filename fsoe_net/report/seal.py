"""The fingerprint that a report prints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fsoe_net.plan import Plan, fingerprint_of

__all__ = ["Seal", "seal_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Seal:
    """A fingerprint. ``sections`` are hashes by name; ``of`` says what they were made from."""

    whole: str
    short: str
    of: str
    sections: Mapping[str, str] = field(default_factory=dict)

    def changed(self, other: Seal) -> tuple[str, ...]:
        """Return the names of the sections that differ."""
        names = dict.fromkeys((*self.sections, *other.sections))
        return tuple(n for n in names if self.sections.get(n) != other.sections.get(n))


def seal_of(plan: Plan) -> Seal:
    """Return the fingerprint of a plan."""
    found = fingerprint_of(plan)
    return Seal(
        whole=found.whole,
        short=found.short,
        of="canonical text of everything safety-relevant in the plan",
        sections=found.sections,
    )
