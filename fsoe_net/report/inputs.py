"""Inputs of a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from fsoe_net.compare.diff import Difference
from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.model.acceptance import Acceptance, CheckedSignature, JustifiedFinding
from fsoe_net.model.network import SourceFile
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.test_record import TestRecord
from fsoe_net.plan.fingerprint import Fingerprint
from fsoe_net.plan.model import Plan
from fsoe_net.report.evidence import Evidence, LiveEvidence
from fsoe_net.report.self_test_result import SelfTestResult
from fsoe_net.timing.budget import Budget

if TYPE_CHECKING:
    from fsoe_net.live.result import Run


@dataclass(frozen=True, slots=True, kw_only=True)
class Against:
    """Base of the comparison.

    Attributes:
        source: Its file.
        difference: The differences.
        again: Ids of the test steps to repeat because of them.
        fingerprint: ``None`` if the base is not a plan or record.
    """

    source: SourceFile
    difference: Difference
    again: tuple[str, ...] = ()
    fingerprint: Fingerprint | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenPlan:
    """A plan file that must match this network."""

    source: SourceFile
    plan: Plan


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenRecord:
    """An acceptance record, and whether it is for this exact configuration."""

    source: SourceFile
    record: Acceptance
    fits: bool

    def justification(self, found: Diagnostic) -> JustifiedFinding | None:
        """Return the persons who accept a warning; none in a record of another configuration."""
        if not self.fits or found.level is not Severity.WARNING:
            return None
        return self.record.justification(found.code, found.message)


@dataclass(frozen=True, slots=True, kw_only=True)
class Signatures:
    """Valid signatures of a record, and the objections to the others in words."""

    signatures: tuple[CheckedSignature, ...]
    against: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A test record and its file.

    ``notes``: line and text of each error or unfinished entry; ``fits``: whether its results are
        valid for this network.
    """

    source: SourceFile
    test_record: TestRecord
    notes: tuple[str, ...] = ()
    fits: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportInputs:
    """All possible inputs of a report.

    Attributes:
        name: Name of the network, even if nothing could be read.
        version: Version of fsoe-net.
        diagnostics: All findings.
        resolution: The network; ``None`` if nothing was read.
        plan: The compiled plan; ``None`` if the network does not compile.
        fingerprint: Fingerprint of ``plan``; ``None`` for a network with errors.
        budget: Timing budget of the network.
        references: Other files that the network was compared with.
        run: A run of this plan on the emulated bus.
        scenario: Name of the requested scenario; empty for none.
        evidence: Files about the machine.
        live: Data of a running ``fsn-master``.
        given: The plan file given for comparison.
        against: Base of the change log.
        tried: A test record, or ``None``.
        accepted: An acceptance record, or ``None``.
        signed: Its signatures; ``None`` if they were not checked.
        self_test: Result of a self-test of the tool, or ``None``.
    """

    name: str
    version: str
    diagnostics: Sequence[Diagnostic]
    resolution: Resolution | None
    plan: Plan | None
    fingerprint: Fingerprint | None
    budget: Budget | None
    references: Sequence[SourceFile] = ()
    run: Run | None = None
    scenario: str = ""
    evidence: Sequence[Evidence] = field(default_factory=tuple)
    live: LiveEvidence | None = None
    given: GivenPlan | None = None
    against: Against | None = None
    tried: Tried | None = None
    accepted: GivenRecord | None = None
    signed: Signatures | None = None
    self_test: SelfTestResult | None = None

    def justification(self, found: Diagnostic) -> JustifiedFinding | None:
        """Return the persons who accept a warning in this configuration's acceptance record."""
        return None if self.accepted is None else self.accepted.justification(found)
