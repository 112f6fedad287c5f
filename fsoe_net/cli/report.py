"""``fsoe-net report``: the configuration with its evidence as HTML, PDF, Markdown or JSON."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fsoe_net import __version__
from fsoe_net.cli.diff import read_side
from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import FILE, master_options, master_socket, output_option
from fsoe_net.cli.output import print_diagnostics
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_target, write_whole
from fsoe_net.diag import Diagnostic, Severity, sort_diagnostics, summary
from fsoe_net.errors import InputError
from fsoe_net.load import Collector, LoadOptions, load_protocol, open_file
from fsoe_net.model import Protocol, Resolution, SourceFile
from fsoe_net.plan import MAGIC, Fingerprint, Plan, compile_plan, decode_plan, fingerprint_of
from fsoe_net.project.check import Checked, check_files, library_of, whole_network
from fsoe_net.project.known import Record, read_record
from fsoe_net.report import (
    FORMATS,
    Against,
    Document,
    Evidence,
    GivenPlan,
    GivenRecord,
    LiveEvidence,
    ReportInputs,
    Side,
    Tried,
    ask_live,
    compare,
    longest_round_trips,
    make_document,
    pdf_library,
    read_evidence,
    report_pdf,
    side_of_network,
    side_of_plan,
    steps_again,
    tried_of,
)
from fsoe_net.rules import check_scan, check_timing
from fsoe_net.timing import Budget, make_budget

if TYPE_CHECKING:
    from fsoe_net.run import RunResult

__all__ = ["command", "read_protocol", "since"]

_EPILOG = """\b
Examples:
  fsoe-net report network.yaml -o report.html
  fsoe-net report network.yaml --scenario scenario.yaml -o report.html
  fsoe-net report network.yaml --evidence scan.json --evidence run.json -o report.html
  fsoe-net report network.yaml --protocol protocol.yaml -o report.html
  fsoe-net report network.yaml --accepted acceptance.yaml -o report.html

Exit codes: 0 no error; 1 the network has an error (the report says so on top), the run failed, or
the test protocol is not of this network, or a file cannot be used; 2 wrong use."""


@click.command("report", epilog=_EPILOG)
@input_options
@output_option("File to write: .html, .md, .json or, with the extra pdf, .pdf.", required=True)
@click.option(
    "--plan", "plan_file", type=FILE, metavar="PLAN", help="Plan file that shall be its plan."
)
@click.option(
    "--evidence",
    "evidence_files",
    multiple=True,
    type=FILE,
    metavar="FILE",
    help="A scan.json, a result of a run (JSON) or an incident file; may be given again.",
)
@master_options
@click.option(
    "--scenario",
    "scenario_file",
    type=FILE,
    metavar="FILE",
    help="Run this scenario in virtual time and put the result into the report.",
)
@click.option(
    "--against",
    type=FILE,
    metavar="FILE",
    help="Earlier plan or network: the change log starts from it.",
)
@click.option(
    "--accepted",
    type=FILE,
    metavar="FILE",
    help="Acceptance record: sign-off, justifications, and the change log starts from it.",
)
@click.option("--protocol", type=FILE, metavar="FILE", help="Test protocol of this network.")
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    output: str,
    overwrite: bool,
    plan_file: str | None,
    evidence_files: tuple[str, ...],
    socket: str | None,
    interface: str | None,
    scenario_file: str | None,
    against: str | None,
    accepted: str | None,
    protocol: str | None,
) -> None:
    """Write the report of a network: what is copied, how late, what is known and what is open.

    FILES as for `fsoe-net check`, also other files to compare with: the report then names them. A
    network with an error gets a report that says so first, with every finding.
    """
    form = Path(output).suffix.lstrip(".").lower()
    if form == "pdf":
        pdf_library()
    elif form not in FORMATS:
        raise click.BadParameter(f"{output!r} ends in none of .html, .md, .json, .pdf", ctx)
    if against is not None and accepted is not None:
        raise click.UsageError("--against and --accepted: the change log starts from one of them")
    check_target(output, overwrite=overwrite)
    named = socket is not None or interface is not None
    address = master_socket(socket, interface) if named else None
    record = None if accepted is None else read_record(accepted)
    checked = check_files(files, loading, compared=True)
    evidence = tuple(read_evidence(path) for path in evidence_files)
    asked = None if address is None else ask_live(address)
    resolution = _network(checked)
    budget = _budget(resolution, evidence, asked)
    found = _findings(checked, resolution, evidence, budget)
    errors = any(d.level is Severity.ERROR for d in found)
    plan = _plan(resolution, errors=errors)
    result = None
    if scenario_file is not None and plan is not None and not errors:
        result = _run(resolution, scenario_file)
    fingerprint = None if plan is None or errors else fingerprint_of(plan)
    before = None if record is None else since(record, resolution, plan)
    if against is not None:
        before = _against(against, resolution, plan, loading)
    inputs = ReportInputs(
        name=resolution.network.name,
        version=__version__,
        diagnostics=found,
        resolution=resolution,
        plan=plan,
        fingerprint=fingerprint,
        budget=budget,
        references=checked.references,
        run=result,
        scenario=scenario_file or "",
        evidence=evidence,
        live=asked,
        given=None if plan_file is None else _given(plan_file),
        against=before,
        tried=None if protocol is None else _tried(protocol, resolution, plan),
        accepted=None if record is None else _accepted(record, fingerprint),
    )
    document = make_document(inputs)
    write_whole(output, _rendered(document, form), overwrite=overwrite)
    verdict = "" if result is None else f"; run {'passed' if result.passed else 'FAILED'}"
    if errors:
        print_diagnostics([d for d in found if d.level is Severity.ERROR], err=True)
    tried = inputs.tried
    misfit = tried is not None and not tried.fits
    if misfit:
        verdict += "; the test protocol CANNOT BE TAKEN as it is"
    echo(f"{output}: {document.verdict.word}{verdict}")
    for title, stands in document.against:
        echo(f"  against it: {title}: {stands.word}")
    ctx.exit(int(errors or misfit or (result is not None and not result.passed)))


def _rendered(document: Document, form: str) -> bytes:
    if form == "pdf":
        return report_pdf(document)
    return FORMATS[form](document).encode("utf-8")


def _network(checked: Checked) -> Resolution:
    """Return the network, also one with errors.

    Raises:
        InputError: There is none to report on.
    """
    resolution = checked.resolution
    if resolution is None or not any(d.level is Severity.ERROR for d in checked.diagnostics):
        return whole_network(checked, "no report written")
    return resolution


def _findings(
    checked: Checked, resolution: Resolution, evidence: Sequence[Evidence], budget: Budget
) -> list[Diagnostic]:
    """Return what the files show, and what scans and measured times show beside them."""
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


def _plan(resolution: Resolution, *, errors: bool) -> Plan | None:
    """Return the plan; with errors only when one can be made all the same, to show its copies."""
    if not errors:
        return compile_plan(resolution)
    try:
        return compile_plan(resolution)
    except (InputError, LookupError, ValueError, struct.error):
        return None


def _run(resolution: Resolution, scenario: str) -> RunResult:
    from fsoe_net.cli.run import prepare
    from fsoe_net.run import run_virtual

    session = prepare(resolution, None, scenario, virtual=True)
    return run_virtual(session, session.duration_ns)


def _source(path: str) -> tuple[SourceFile, bytes]:
    with open_file(path) as stream:
        data = stream.read()
    return SourceFile(path=path, sha256=hashlib.sha256(data).hexdigest()), data


def _given(path: str) -> GivenPlan:
    source, data = _source(path)
    if not data.startswith(MAGIC):
        raise InputError(f"{path} is no .fsnplan file; make one with fsoe-net plan FILES -o PLAN")
    return GivenPlan(source=source, plan=decode_plan(data))


def read_protocol(
    path: str, resolution: Resolution, plan: Plan | None
) -> tuple[SourceFile, Protocol, list[Diagnostic]]:
    """Read a test protocol, and hold it against the network where it has a plan.

    Returns:
        Its file, the protocol, and what keeps its results from being taken.

    Raises:
        InputError: It is none.
    """
    source, _ = _source(path)
    out = Collector()
    protocol = load_protocol(path, out)
    if protocol is None:
        found = summary(out.diagnostics)
        raise InputError(f"{path} cannot be taken as a test protocol: {found}", out.diagnostics)
    if plan is not None:
        from fsoe_net.run import compare_protocol, make_protocol

        whole = fingerprint_of(plan).whole
        fresh = make_protocol(resolution, plan.to_bytes(), fingerprint=whole)
        compare_protocol(protocol, fresh, out)
    return source, protocol, out.diagnostics


def _tried(path: str, resolution: Resolution, plan: Plan | None) -> Tried:
    source, protocol, found = read_protocol(path, resolution, plan)
    print_diagnostics(found, err=True)
    notes = tuple(f"{d.span.line}: {d.message}" for d in found)
    bad = any(d.level is Severity.ERROR for d in found)
    return replace(tried_of(source, protocol), notes=notes, fits=not bad)


def _accepted(found: Record, now: Fingerprint | None) -> GivenRecord:
    fits = now is not None and now.whole == found.fingerprint.whole
    return GivenRecord(source=found.source, record=found.record, fits=fits)


def since(found: Record, resolution: Resolution, now: Plan | None) -> Against:
    """Return what has changed since a record was signed, and which steps that calls for."""
    before = side_of_plan(found.plan, found.source.path, found.record.safety_functions)
    return _compared(found.source, before, resolution, found.plan, now)


def _against(path: str, resolution: Resolution, now: Plan | None, options: LoadOptions) -> Against:
    source, data = _source(path)
    before, found = read_side(path, options)
    if before is None:
        errors = [d for d in found if d.level is Severity.ERROR]
        raise InputError(f"{path} cannot be compared", errors)
    plan = decode_plan(data) if data.startswith(MAGIC) else None
    return _compared(source, before, resolution, plan, now)


def _compared(
    source: SourceFile,
    before: Side,
    resolution: Resolution,
    plan: Plan | None,
    now: Plan | None,
) -> Against:
    from fsoe_net.run import make_protocol  # slow to load, as in read_protocol

    difference = compare(before, side_of_network(resolution, resolution.network.name))
    steps = make_protocol(resolution, b"").steps
    return Against(
        source=source,
        difference=difference,
        again=steps_again(
            difference.changes,
            resolution,
            steps,
            plans=None if plan is None or now is None else (plan, now),
            functions=before.functions,
        ),
        fingerprint=None if plan is None else fingerprint_of(plan),
    )
