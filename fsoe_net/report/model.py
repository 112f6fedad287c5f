"""The report as data: a document that also collects findings and open points."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.document.model import Document, Level, Section, Verdict

LEVELS = {
    Severity.ERROR: Level.ERROR,
    Severity.WARNING: Level.WARNING,
    Severity.INFO: Level.NOTE,
}
"""The display level of each severity."""


class PointKind(enum.Enum):
    """The type of a point for the reader."""

    OPEN = "open"
    ASSUMPTION = "assumption"


@dataclass(frozen=True, slots=True)
class Point:
    """A point that is open, or that is assumed."""

    kind: PointKind
    text: str


def open_point(text: str) -> Point:
    """Return a point that a person must settle."""
    return Point(PointKind.OPEN, text)


def assumption(text: str) -> Point:
    """Return a point that is assumed."""
    return Point(PointKind.ASSUMPTION, text)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportSection(Section):
    """A section of a report, with its open points and assumptions."""

    points: tuple[Point, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportDocument(Document):
    """A complete report; its title is the name of the machine, or else of the network.

    Attributes:
        network: Name of the network.
        whole: The fingerprint, hex; empty without a plan.
        verdict: The verdict at the top.
        points: Open points and assumptions of all sections, each with the title of its section.
        findings: The findings of sections and points as data.
        against: Objections on the first page other than findings, each with the title of its
            section; empty if findings are errors.
        of_machine: Whether it contains data from the machine: a scan, a run, a running bus.
    """

    network: str
    whole: str
    verdict: Verdict
    points: tuple[tuple[str, Point], ...]
    findings: tuple[Diagnostic, ...] = ()
    against: tuple[tuple[str, Verdict], ...] = ()
    of_machine: bool = False
