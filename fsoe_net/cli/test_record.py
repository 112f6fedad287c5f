"""``fsoe-net test-record``: the steps to test, run where possible, the rest left to people."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import FILE, master_options, master_socket, output_option
from fsoe_net.cli.output import print_diagnostics
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.test_record_output import PersonAtTerminal, print_outcome, print_step
from fsoe_net.cli.write import check_target
from fsoe_net.diag.words import counted
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.model.test_record import TestRecord, TestStep
from fsoe_net.test_record.trial import Trial, read_test_record

_EPILOG = """\b
Examples:
  fsoe-net test-record network.yaml -o test-record.yaml              # empty
  fsoe-net test-record network.yaml --virtual -o test-record.yaml
  fsoe-net test-record network.yaml --live --interface eth1 -o test-record.yaml
  fsoe-net test-record network.yaml --test-record test-record.yaml -o test-record.html

With --overwrite, entries made by people in an existing YAML file are kept. An emulated result is no
evidence for a machine.

Exit codes: 0 all steps that were run gave the expected result, 1 a step did not, or a file is
invalid; 2 usage error; 3 no fsn-master, or no disk."""


@click.command("test-record", epilog=_EPILOG)
@input_options
@click.option("--virtual", is_flag=True, help="Run every step on the emulated bus.")
@click.option(
    "--live",
    is_flag=True,
    help="Test each loss on a running fsn-master. Asks before each one; needs a terminal.",
)
@master_options
@click.option(
    "--cycles",
    type=click.IntRange(1, 10**6),
    default=200,
    show_default=True,
    help="Emulated: number of FSoE cycles with a fault, per class.",
)
@click.option(
    "--test-record", "given", type=FILE, metavar="FILE", help="Existing test record to continue."
)
@output_option("File to write: .yaml to fill in, .html to print.", required=True)
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    virtual: bool,
    live: bool,
    socket: str | None,
    interface: str | None,
    cycles: int,
    given: str | None,
    output: str,
    overwrite: bool,
) -> None:
    """Write the test record of a network and fill in the results of emulated runs.

    Steps: start-up of each connection, trigger of each safety function, loss of each SubDevice,
    each fault class. FILES as for `check`. This program never fills in the machine column.
    """
    if Path(output).suffix not in (".yaml", ".yml", ".html", ".htm"):
        raise click.UsageError(f"-o {output}: write .yaml to fill in, or .html to print")
    if virtual and live:
        raise click.UsageError("--virtual and --live exclude each other; run one after the other")
    if not live and (socket is not None or interface is not None):
        raise click.UsageError("--socket and --interface say which fsn-master --live tries")
    address = master_socket(socket, interface) if live else None
    if live and not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise click.UsageError(
            "--live asks a person at the machine before each step: start it from a terminal"
        )
    check_target(output, overwrite=overwrite)
    trial = Trial.of(files, loading, _before(given, output))
    if virtual:
        trial.run_virtual(faults=cycles, on_step=_note if sys.stderr.isatty() else None)
    if address is not None:
        _live(trial, address, output, overwrite=overwrite)
    trial.save(output, overwrite=overwrite)
    ctx.exit(print_outcome(trial.test_record, output))


def _before(given: str | None, output: str) -> TestRecord | None:
    """Return the record to continue: the one that is given, or that was written before."""
    is_filled_in = Path(output).suffix in (".yaml", ".yml") and Path(output).exists()
    old = given or (output if is_filled_in else None)
    if old is None:
        return None
    _, before, found = read_test_record(old)
    print_diagnostics(found, err=True)
    return before


def _note(text: str) -> None:
    echo(f"  {text}", err=True)


def _live(trial: Trial, socket: str, output: str, *, overwrite: bool) -> None:
    """Run the steps on a running bus; the results are also written if it is interrupted."""
    done = 0

    def on_step(step: TestStep) -> None:
        nonlocal done
        done += 1
        print_step(step)

    try:
        trial.run_live(socket, PersonAtTerminal(), on_step=on_step)
    except (KeyboardInterrupt, click.Abort, EnvironmentFault):
        if done:
            trial.save(output, overwrite=overwrite)
            echo(
                f"\nbroken off: {output} has the {counted(done, 'step')} tried so far; put back "
                "what you took off the bus, go on with the rest by the same command and "
                "--overwrite",
                err=True,
            )
        raise
