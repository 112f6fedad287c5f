"""``fsoe-net report``: the configuration with its evidence as HTML, PDF, Markdown or JSON."""

from __future__ import annotations

from pathlib import Path

import click

from fsoe_net.acceptance.report import REPORT_FORMATS, make_report
from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import (
    FILE,
    master_options,
    named_master,
    output_option,
    read_signers,
    signer_options,
)
from fsoe_net.cli.output import print_diagnostics
from fsoe_net.cli.progress import elapsed_time
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_target
from fsoe_net.document.write_pdf import pdf_library
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.project.check import check_files
from fsoe_net.project.known import read_record
from fsoe_net.report.evidence import ask_live, read_evidence

_EPILOG = """\b
Examples:
  fsoe-net report network.yaml -o report.html
  fsoe-net report network.yaml --scenario scenario.yaml -o report.html
  fsoe-net report network.yaml --evidence scan.json --evidence run.json -o report.html
  fsoe-net report network.yaml --test-record test-record.yaml -o report.html
  fsoe-net report network.yaml --accepted acceptance.yaml --signers allowed -o signed.html

Exit codes: 0 no error; 1 the network has an error (listed first in the report), the run failed, the
test record belongs to another network, or a file is invalid; 2 usage error."""


@click.command("report", epilog=_EPILOG)
@input_options
@output_option("File to write: .html, .md, .json or, with the extra pdf, .pdf.", required=True)
@click.option(
    "--plan", "plan_file", type=FILE, metavar="PLAN", help="Plan file that must match the network."
)
@click.option(
    "--evidence",
    "evidence_files",
    multiple=True,
    type=FILE,
    metavar="FILE",
    help="A scan.json, the result of a run (JSON) or an incident file. Repeatable.",
)
@master_options
@click.option(
    "--scenario",
    "scenario_file",
    type=FILE,
    metavar="FILE",
    help="Run this scenario in virtual time and include the result.",
)
@click.option(
    "--against", type=FILE, metavar="FILE", help="Earlier plan or network for the change log."
)
@click.option(
    "--accepted",
    type=FILE,
    metavar="FILE",
    help="Acceptance record: source of sign-off and justifications, and start of the change log.",
)
@signer_options
@click.option(
    "--test-record", type=FILE, metavar="FILE", help="Filled-in test record of this network."
)
@click.option(
    "--self-test-result",
    "self_test",
    type=FILE,
    metavar="FILE",
    help="Result (JSON) of `fsoe-net doctor --self-test`.",
)
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
    signers: str | None,
    revoked: str | None,
    test_record: str | None,
    self_test: str | None,
) -> None:
    """Write the report of a network: copies, timing, evidence and open points.

    FILES as for `fsoe-net check`. Files that are compared with the network are listed in the
    report. If the network has an error, the report starts with all findings.
    """
    form = Path(output).suffix.lstrip(".").lower()
    # The PDF library is optional; if it is missing, fail before the work.
    if form == "pdf":
        pdf_library()
    elif form not in REPORT_FORMATS:
        raise click.BadParameter(f"{output!r} ends in none of .html, .md, .json, .pdf", ctx)
    if against is not None and accepted is not None:
        raise click.UsageError("--against and --accepted: the change log starts from one of them")
    if signers is not None and accepted is None:
        raise click.UsageError("--signers FILE goes with --accepted RECORD")
    trusted = read_signers(signers, revoked)
    # A report takes evidence and time: the target is checked first.
    check_target(output, overwrite=overwrite)
    address = named_master(socket, interface)
    with elapsed_time(f"writing {output}"):
        report = make_report(
            check_files(files, loading, compared=True),
            evidence=[read_evidence(path) for path in evidence_files],
            live=None if address is None else ask_live(address),
            plan=plan_file,
            scenario=scenario_file,
            against=against,
            accepted=None if accepted is None else read_record(accepted),
            signers=trusted,
            test_record=test_record,
            self_test=self_test,
            loading=loading,
        )
        content = report.render(form)
    print_diagnostics(report.test_record_findings, err=True)
    write_whole(output, content, overwrite=overwrite)
    # The report is also written if there are errors; they are printed here as well.
    print_diagnostics(report.errors, err=True)
    run = report.run
    verdict = "" if run is None else f"; run {'passed' if run.passed else 'FAILED'}"
    if not report.test_record_fits:
        verdict += "; the test record CANNOT BE TAKEN as it is"
    echo(f"{output}: {report.document.verdict.word}{verdict}")
    for title, stands in report.document.against:
        echo(f"  against it: {title}: {stands.word}")
    ctx.exit(int(not report.passed))
