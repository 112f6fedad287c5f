"""The fingerprint that a report prints."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import fsoe_net.plan
from fsoe_net.plan import Plan

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
    """Return the fingerprint of a plan; of the bytes of its file where there is no other."""
    make: Any = getattr(fsoe_net.plan, "fingerprint_of", None)
    if make is not None:
        found = make(plan)
        return Seal(
            whole=str(found.whole),
            short=str(found.short),
            of="canonical text of everything safety-relevant in the plan",
            sections={str(k): str(v) for k, v in found.sections.items()},
        )
    whole = hashlib.sha256(plan.to_bytes()).hexdigest()
    short = " ".join(whole[n : n + 4].upper() for n in range(0, 16, 4))
    return Seal(whole=whole, short=short, of="bytes of the copy plan")
