"""The report of a network: its content, gathered from files and a live bus."""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fsoe_net.acceptance.signatures import check_signatures
from fsoe_net.acceptance.ssh_signatures import SshSigners
from fsoe_net.compare.bus_scan import check_scan
from fsoe_net.compare.diff import compare
from fsoe_net.compare.read import read_side
from fsoe_net.compare.sides import Side, side_of_network, side_of_plan
from fsoe_net.diag.diagnostic import Diagnostic, Severity, sort_diagnostics
from fsoe_net.document.write_pdf import document_pdf
from fsoe_net.errors import InputError
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.files import read_source
from fsoe_net.formats.shared.limits import MAX_LARGE_BYTES
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.model.network import SourceFile
from fsoe_net.model.resolve import Resolution
from fsoe_net.plan.codec import MAGIC, decode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import Fingerprint, fingerprint_of
from fsoe_net.plan.model import Plan
from fsoe_net.project.check import Checked, library_of, whole_network
from fsoe_net.project.installed import installed_files
from fsoe_net.project.known import AcceptedRecord
from fsoe_net.project.simulate import prepare
from fsoe_net.report.compose import compose_report
from fsoe_net.report.evidence import Evidence, LiveEvidence, longest_round_trips
from fsoe_net.report.formats import FORMATS
from fsoe_net.report.inputs import (
    Against,
    GivenPlan,
    GivenRecord,
    ReportInputs,
    Signatures,
    Tried,
)
from fsoe_net.report.model import ReportDocument
from fsoe_net.report.self_test_result import SelfTestResult, read_self_test
from fsoe_net.report.steps_to_repeat import steps_to_repeat
from fsoe_net.rules.timing import check_timing
from fsoe_net.timing.budget import Budget, make_budget
from fsoe_net.version import __version__

if TYPE_CHECKING:
    from fsoe_net.live.result import Run

REPORT_FORMATS = (*FORMATS, "pdf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A report, and any reasons against using it.

    Attributes:
        document: Content of the report.
        findings: All findings of the network, sorted.
        run: The run of the scenario, if there was one.
        test_record_findings: Errors that prevent the use of the test record, located.
        test_record_fits: Whether its results are in the report; also true without one.
    """

    document: ReportDocument
    findings: Sequence[Diagnostic]
    run: Run | None
    test_record_findings: Sequence[Diagnostic]
    test_record_fits: bool

    @property
    def errors(self) -> list[Diagnostic]:
        """The errors of the network; the report lists them first."""
        return [d for d in self.findings if d.level is Severity.ERROR]

    @property
    def passed(self) -> bool:
        """Whether the network is free of errors, the run passed and the test record matches it."""
        return not self.errors and self.test_record_fits and (self.run is None or self.run.passed)

    def render(self, form: str) -> bytes:
        """Return the report in one of `REPORT_FORMATS`.

        Raises:
            EnvironmentFault: The extra ``pdf`` is not installed.
            KeyError: Unknown format.
        """
        if form == "pdf":
            return document_pdf(self.document)
        return FORMATS[form](self.document).encode("utf-8")

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the report; its suffix selects the format: .html, .md, .json or .pdf.

        Raises:
            ValueError: Unknown suffix.
            InputError: The file exists and must not be replaced.
            EnvironmentFault: It cannot be written, or the extra ``pdf`` is not installed.
        """
        form = Path(path).suffix.lstrip(".").lower()
        if form not in REPORT_FORMATS:
            raise ValueError(f"{os.fspath(path)!r} ends in none of .html, .md, .json, .pdf")
        write_whole(path, self.render(form), overwrite=overwrite)


def make_report(
    checked: Checked,
    *,
    evidence: Sequence[Evidence] = (),
    live: LiveEvidence | None = None,
    plan: str | None = None,
    scenario: str | None = None,
    against: str | None = None,
    accepted: AcceptedRecord | None = None,
    signers: SshSigners | None = None,
    test_record: str | None = None,
    self_test: str | None = None,
    loading: LoadOptions | None = None,
) -> Report:
    """Make the report of a network; errors come first in it.

    Args:
        checked: The network, compared with other files and the device library.
        evidence: Files with evidence from the machine.
        live: Data of a running ``fsn-master``.
        plan: A plan file that must match the network.
        scenario: A scenario file to run in virtual time.
        against: An earlier plan or network, the base of the change log.
        accepted: An acceptance record, the base of the change log without ``against``.
        signers: Allowed signers of the record; without them its signatures are not checked.
        test_record: A test record file.
        self_test: A file with the result of ``fsoe-net doctor --self-test``.
        loading: How references in ``against`` are followed.

    Raises:
        InputError: The network is missing, or a file cannot be used.
    """
    resolution = _network(checked)
    budget = _budget(resolution, evidence, live)
    found = _findings(checked, resolution, evidence, budget)
    errors = any(d.level is Severity.ERROR for d in found)
    compiled = plan_to_show(resolution, found)
    run = None
    # With errors there is no plan to run.
    if scenario is not None and compiled is not None and not errors:
        run = _run(resolution, scenario)
    # A fingerprint would suggest that the configuration can be accepted.
    fingerprint = None if compiled is None or errors else fingerprint_of(compiled)
    before = None
    # A record also states which steps have been done, which a plan does not.
    if accepted is not None:
        before = since(accepted, resolution, compiled)
    elif against is not None:
        before = _against(against, resolution, compiled, loading or LoadOptions())
    tried: Tried | None = None
    test_record_findings: list[Diagnostic] = []
    if test_record is not None:
        tried, test_record_findings = _tried(test_record, resolution, compiled)
    inputs = ReportInputs(
        name=resolution.network.name,
        version=__version__,
        diagnostics=found,
        resolution=resolution,
        plan=compiled,
        fingerprint=fingerprint,
        budget=budget,
        references=checked.references,
        run=run,
        scenario=scenario or "",
        evidence=tuple(evidence),
        live=live,
        given=_given(plan),
        against=before,
        tried=tried,
        accepted=_accepted(accepted, fingerprint),
        signed=_signed(accepted, signers),
        self_test=_self_test(self_test),
    )
    return Report(
        document=compose_report(inputs),
        findings=found,
        run=run,
        test_record_findings=test_record_findings,
        test_record_fits=tried is None or tried.fits,
    )


def _network(checked: Checked) -> Resolution:
    """Return the network, even if it has errors.

    Raises:
        InputError: The network is missing.
    """
    resolution = checked.resolution
    if resolution is None or not any(d.level is Severity.ERROR for d in checked.diagnostics):
        return whole_network(checked, "no report written")
    return resolution


def _findings(
    checked: Checked, resolution: Resolution, evidence: Sequence[Evidence], budget: Budget
) -> list[Diagnostic]:
    """Return the findings of the files, plus those of scans and measured times."""
    found = list(checked.diagnostics)
    for e in evidence:
        if e.scan is not None:
            found += check_scan(resolution, e.scan)
    if budget.functions:
        found += check_timing(resolution.network, budget, found=found)
    return sort_diagnostics(found)


def _budget(
    resolution: Resolution, evidence: Sequence[Evidence], live: LiveEvidence | None
) -> Budget:
    measured = longest_round_trips(tuple(evidence), live)
    return make_budget(resolution, library_of(resolution.network), measured=measured)


def plan_to_show(resolution: Resolution, found: Sequence[Diagnostic]) -> Plan | None:
    """Return the plan; with errors, only if one can still be made to show its copies."""
    if not any(d.level is Severity.ERROR for d in found):
        return compile_plan(resolution)
    try:
        return compile_plan(resolution)
    # A network with errors may break any assumption of the compiler; the report must not fail.
    except (InputError, LookupError, ValueError, struct.error):
        return None


def _run(resolution: Resolution, scenario: str) -> Run:
    from fsoe_net.simulate.session import run_virtual

    session = prepare(resolution, None, scenario, virtual=True)
    return run_virtual(session, session.duration_ns)


def _self_test(path: str | None) -> SelfTestResult | None:
    if path is None:
        return None
    return read_self_test(path, installed_files().build)


def _given(path: str | None) -> GivenPlan | None:
    if path is None:
        return None
    source, data = read_source(path, most=MAX_LARGE_BYTES)
    if not data.startswith(MAGIC):
        raise InputError(f"{path} is no .fsnplan file; make one with fsoe-net plan FILES -o PLAN")
    return GivenPlan(source=source, plan=decode_plan(data))


def _tried(path: str, resolution: Resolution, plan: Plan | None) -> tuple[Tried, list[Diagnostic]]:
    from fsoe_net.test_record.trial import read_test_record  # slow to load

    source, test_record, found = read_test_record(path, resolution, plan)
    notes = tuple(f"{d.span.line}: {d.message}" for d in found)
    bad = any(d.level is Severity.ERROR for d in found)
    return Tried(source=source, test_record=test_record, notes=notes, fits=not bad), found


def _accepted(found: AcceptedRecord | None, now: Fingerprint | None) -> GivenRecord | None:
    if found is None:
        return None
    fits = now is not None and now.whole == found.fingerprint.whole
    return GivenRecord(source=found.source, record=found.record, fits=fits)


def _signed(accepted: AcceptedRecord | None, signers: SshSigners | None) -> Signatures | None:
    """Return the signatures of a record; none if the record was replaced in the meantime."""
    if accepted is None or signers is None:
        return None
    signed = check_signatures(accepted.source.path, signers)
    against = [f"{r.what}: {r.fix}" for r in signed.refusals]
    if signed.record.source.sha256 != accepted.source.sha256:
        against.append(f"{accepted.source.path} was replaced while the report was made")
    return Signatures(signatures=signed.signatures, against=tuple(against))


def since(found: AcceptedRecord, resolution: Resolution, now: Plan | None) -> Against:
    """Return the changes since a record was signed, and the steps to repeat because of them."""
    before = side_of_plan(found.plan, found.source.path, found.record.safety_functions)
    return _compared(found.source, before, resolution, found.plan, now)


def _against(path: str, resolution: Resolution, now: Plan | None, options: LoadOptions) -> Against:
    source, data = read_source(path, most=MAX_LARGE_BYTES)
    before = read_side(path, options)
    plan = decode_plan(data) if data.startswith(MAGIC) else None
    return _compared(source, before, resolution, plan, now)


def _compared(
    source: SourceFile,
    before: Side,
    resolution: Resolution,
    plan: Plan | None,
    now: Plan | None,
) -> Against:
    from fsoe_net.test_record.steps import make_test_record  # slow to load

    difference = compare(before, side_of_network(resolution, resolution.network.name))
    steps = make_test_record(resolution, b"").steps
    return Against(
        source=source,
        difference=difference,
        again=steps_to_repeat(
            difference.changes,
            resolution,
            steps,
            plans=None if plan is None or now is None else (plan, now),
            functions=before.functions,
        ),
        fingerprint=None if plan is None else fingerprint_of(plan),
    )
