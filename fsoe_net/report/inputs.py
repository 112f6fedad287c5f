"""What a report is made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.model.acceptance import Acceptance, CheckedSignature, JustifiedFinding
from fsoe_net.model.network import SourceFile
from fsoe_net.model.protocol import DeviceEntry, StepKind
from fsoe_net.model.resolve import Resolution
from fsoe_net.plan.fingerprint import Fingerprint
from fsoe_net.plan.model import Plan
from fsoe_net.report.diff import Difference
from fsoe_net.report.evidence import Evidence, LiveEvidence
from fsoe_net.report.self_test_result import SelfTestResult
from fsoe_net.timing.budget import Budget

if TYPE_CHECKING:
    from fsoe_net.run.result import Run

__all__ = [
    "Against",
    "GivenPlan",
    "GivenRecord",
    "ReportInputs",
    "Signatures",
    "TestStep",
    "Tried",
]


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
class TestStep:
    """One step of a test protocol. Results are words, empty for none; times in ms.

    Attributes:
        kind: What it tries.
        subject: Safety function, connection, SubDevice or class of faults.
        what: What to do.
        expected: What shall happen.
        limit_ms: Longest time allowed.
        limit_source: Where that comes from.
        emulated: What came of it on the emulated bus; no evidence for a machine.
        live: What a running ``fsn-master`` showed.
        machine: What a person wrote down at the machine.
        who: Who that was, and when.
        is_open: Whether it still waits for a person.
        is_failed: Whether it went otherwise than expected.
        is_disputed: Whether a person saw what was expected, and a program did not.
        at_machine: Whether a person tries it at the machine.
    """

    __test__ = False

    kind: StepKind = StepKind.TRIGGER
    subject: str = ""
    what: str
    expected: str
    limit_ms: float | None = None
    limit_source: str = ""
    emulated: str = ""
    emulated_ms: float | None = None
    live: str = ""
    live_ms: float | None = None
    machine: str = ""
    machine_ms: float | None = None
    who: str = ""
    is_open: bool = True
    is_failed: bool = False
    is_disputed: bool = False
    at_machine: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A test protocol: its file, the plan it was made for, its steps, what was read at devices.

    ``notes``: line and words of what is wrong or unfinished; ``fits``: whether its results can be
    taken for this network.
    """

    source: SourceFile
    plan_sha256: str
    steps: tuple[TestStep, ...]
    devices: tuple[DeviceEntry, ...] = ()
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
