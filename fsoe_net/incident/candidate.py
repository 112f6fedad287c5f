"""The result of a rule about causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fsoe_net.fsoe.pdu import reset_code_text
from fsoe_net.incident.causes_table import CAUSES
from fsoe_net.incident.evidence import IncidentEvidence


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A matching cause with its evidence. ``score`` is from 0 to 100, not a probability."""

    key: str
    score: int
    title: str
    looks: str
    measure: str
    change: str
    evidence: tuple[str, ...]


def candidate(
    e: IncidentEvidence, key: str, score: int, *evidence: str, device: str = "", other: str = ""
) -> Candidate:
    """Return a candidate with complete texts.

    Args:
        e: The evidence.
        key: Name of the cause.
        score: Quality of the match.
        evidence: Supporting evidence; empty items are omitted.
        device: Name of the device concerned.
        other: Name of the other device or connection.
    """
    cause = CAUSES[key]
    plan = e.plan
    words = {
        "sub": plan.sub if plan else device or "the SubInstance",
        "main": plan.main if plan else "the MainInstance",
        "name": e.name or "the connection",
        "device": device or "a device",
        "other": other or "another one",
    }
    return Candidate(
        key=key,
        # Never 100: evidence from a recording is not a proof.
        score=min(score, 99),
        title=cause.title.format_map(words),
        looks=cause.looks.format_map(words),
        measure=cause.measure.format_map(words),
        change=cause.change.format_map(words),
        evidence=tuple(line for line in evidence if line),
    )


def any_of(names: Sequence[str]) -> str:
    """Return names joined with "or": `a`, `a or b`, `a, b or c`."""
    head, last = ", ".join(names[:-1]), names[-1]
    return f"{head} or {last}" if head else last


def ms(ns: int | float) -> str:
    """Return a time in milliseconds as text."""
    value = ns / 1e6
    return f"{value:.0f} ms" if value >= 100 else f"{value:.3g} ms"


def code_text(code: int | None) -> str:
    """Return a reset code with its number."""
    return "no code" if code is None else f"code {code}: {reset_code_text(code)}"
