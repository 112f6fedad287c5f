"""``fsoe-net plan``: compile a network to a `.fsnplan`, or show one."""

from __future__ import annotations

import json

import click

from fsoe_net.cli.inputs import LOADING, input_options
from fsoe_net.cli.options import format_option, output_option, refuse_others
from fsoe_net.cli.output import print_diagnostics
from fsoe_net.cli.terminal import echo, show
from fsoe_net.cli.write import check_target
from fsoe_net.diag.diagnostic import Severity
from fsoe_net.diag.pause import without_collector
from fsoe_net.diag.words import counted
from fsoe_net.errors import InputError
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.write_files import STDOUT, write_whole
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import SECTIONS, fingerprint_of
from fsoe_net.plan.image import igh_text
from fsoe_net.plan.model import Plan
from fsoe_net.plan.show import plan_document, plan_json
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.project.known import read_known

_EPILOG = """\b
Examples:
  fsoe-net plan network.yaml -o machine.fsnplan
  fsoe-net plan --show machine.fsnplan
  fsoe-net plan --show machine.fsnplan --image igh
  fsoe-net plan network.yaml --format json > accepted.json
  fsoe-net plan network.yaml --canonical copies | sha256sum

The plan shows the fingerprint of everything safety-relevant. It shows that two configurations are
the same, not that one is correct; `fsoe-net acceptance verify` compares it."""


@click.command("plan", epilog=_EPILOG)
@input_options
@output_option("Plan file to write.")
@click.option("--show", is_flag=True, help="Print a plan file.")
@click.option(
    "--image",
    type=click.Choice(["igh"]),
    help="Show the absolute position of each byte in the process image of this MainDevice.",
)
@click.option(
    "--canonical",
    "section",
    type=click.Choice(SECTIONS),
    help="Print the text of a section of the fingerprint. Its SHA-256 is the hash of the section.",
)
@format_option
@click.pass_context
@without_collector
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    output: str | None,
    overwrite: bool,
    show: bool,
    image: str | None,
    section: str | None,
    fmt: str,
) -> None:
    """Compile a network to a copy plan, or show a plan.

    FILES as for `fsoe-net check`. If the network has an error, nothing is written. Warnings are
    printed. Without -o the plan is only shown.
    """
    if section is not None:
        refuse_others(ctx, "--canonical", "section", *LOADING)
        echo(_canonical(files, loading, section), nl=False)
        return
    if output and (show or image or fmt != "text"):
        raise click.UsageError("-o writes a plan file: leave out --show, --image and --format")
    if show:
        _show(_read(files), image, fmt)
        return
    check_target(output, overwrite=overwrite, stdout=True)
    plan = _compile(files, loading)
    if output is None:
        _show(plan, image, fmt)
        echo("not written; -o FILE writes it", err=True)
        return
    data = plan.to_bytes()
    write_whole(output, data, overwrite=overwrite)
    echo(
        f"{output}: {len(data)} bytes, {counted(len(plan.copies), 'copy')}, "
        f"{counted(len(plan.connections), 'connection')}, "
        f"fingerprint {fingerprint_of(plan).short}",
        # The plan itself may be on standard output.
        err=output == STDOUT,
    )


def _compile(files: tuple[str, ...], loading: LoadOptions) -> Plan:
    """Return the plan of a network; the network itself is freed before the plan is encoded."""
    checked = check_files(files, loading)
    resolution = whole_network(checked, "no plan written")
    warnings = [d for d in checked.diagnostics if d.level is Severity.WARNING]
    # A plan is written despite warnings, so the warnings must be visible.
    print_diagnostics(warnings, err=True)
    return compile_plan(resolution)


def _read(files: tuple[str, ...]) -> Plan:
    if len(files) != 1:
        raise click.UsageError("--show takes one plan file")
    return Plan.load(files[0])


def _canonical(files: tuple[str, ...], loading: LoadOptions, name: str) -> str:
    """Return the canonical text of a section of a network, a plan or an acceptance record."""
    known = read_known(files, loading)
    text = known.section_text(name)
    if text is None:
        raise InputError(
            f"{known.path} holds only the hash of {name}; name the files of the network"
        )
    return text


def _show(plan: Plan, image: str | None, fmt: str) -> None:
    if fmt == "json":
        echo(json.dumps(plan_json(plan), indent=2, ensure_ascii=False))
    elif image == "igh":
        echo(igh_text(plan))
    else:
        show(plan_document(plan))
