"""What a report is made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from fsoe_net.compare.diff import Difference
from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.model.acceptance import Acceptance, CheckedSignature, JustifiedFinding
from fsoe_net.model.network import SourceFile
from fsoe_net.model.protocol import Protocol
from fsoe_net.model.resolve import Resolution
from fsoe_net.plan.fingerprint import Fingerprint
from fsoe_net.plan.model import Plan
from fsoe_net.report.evidence import Evidence, LiveEvidence
from fsoe_net.report.self_test_result import SelfTestResult
from fsoe_net.timing.budget import Budget

if TYPE_CHECKING:
    from fsoe_net.live.result import Run


@dataclass(frozen=True, slots=True, kw_only=True)
class Against:
    """What the network is compared with.

    Attributes:
        source: Its file.
        difference: What differs.
        again: Ids of the steps of the test protocol that this calls for.
        fingerprint: ``None`` when it is no plan or record.
    """

    source: SourceFile
    difference: Difference
    again: tuple[str, ...] = ()
    fingerprint: Fingerprint | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenPlan:
    """A plan file that shall be the plan of this network."""

    source: SourceFile
    plan: Plan


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenRecord:
    """An acceptance record, and whether it is of this very configuration."""

    source: SourceFile
    record: Acceptance
    fits: bool

    def justification(self, found: Diagnostic) -> JustifiedFinding | None:
        """Return who answers for a warning; nobody does in a record of another configuration."""
        if not self.fits or found.level is not Severity.WARNING:
            return None
        return self.record.justification(found.code, found.message)


@dataclass(frozen=True, slots=True, kw_only=True)
class Signatures:
    """The signatures beside a record that hold, and in words what is against the others."""

    signatures: tuple[CheckedSignature, ...]
    against: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A test protocol and its file.

    ``notes``: line and words of what is wrong or unfinished; ``fits``: whether its results can be
    taken for this network.
    """

    source: SourceFile
    protocol: Protocol
    notes: tuple[str, ...] = ()
    fits: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportInputs:
    """Everything a report may speak about.

    Attributes:
        name: Of the network, also when nothing could be read.
        version: Of fsoe-net.
        diagnostics: Everything found.
        resolution: The network; ``None`` when nothing was read.
        plan: What was compiled; ``None`` when the network does not compile.
        fingerprint: Of ``plan``; ``None`` for a network with errors.
        budget: Timing budget of the network.
        references: Other files the network was compared with.
        run: A run of this plan on the emulated bus.
        scenario: Name of the scenario that was to be run; empty for none.
        evidence: Files about the machine.
        live: What a running ``fsn-master`` reports.
        given: A plan file that was named.
        against: The state that the change log starts from.
        tried: A test protocol; ``None`` when there is none.
        accepted: An acceptance record; ``None`` when there is none.
        signed: Its signatures; ``None`` when nobody has checked them.
        self_test: What a self-test of the tool gave; ``None`` when there is none.
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
        """Return who answers for a warning in the acceptance record of this configuration."""
        return None if self.accepted is None else self.accepted.justification(found)
