"""``fsoe-net test-protocol``: what to try, run where it can be, the rest left to people."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from fsoe_net import __version__
from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import FILE, master_options, master_socket, output_option
from fsoe_net.cli.output import print_diagnostics
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_target
from fsoe_net.diag.printable import printable
from fsoe_net.diag.words import counted, summary
from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.formats.files import Collector
from fsoe_net.formats.options import LoadOptions
from fsoe_net.formats.protocol import load_protocol
from fsoe_net.model.protocol import EMULATED_NOTE, Outcome, Protocol, ProtocolStep
from fsoe_net.model.resolve import Resolution
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import Fingerprint, fingerprint_of
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.report.protocol_page import protocol_page
from fsoe_net.run.client import Client
from fsoe_net.run.protocol import keep_machine, make_protocol
from fsoe_net.run.protocol_live import run_protocol_live
from fsoe_net.run.protocol_virtual import run_protocol_virtual
from fsoe_net.save.files import write_whole
from fsoe_net.save.protocol import write_protocol

__all__ = ["command"]

_EPILOG = """\b
Examples:
  fsoe-net test-protocol network.yaml -o protocol.yaml              # nothing tried
  fsoe-net test-protocol network.yaml --virtual -o protocol.yaml
  fsoe-net test-protocol network.yaml --live --interface eth1 -o protocol.yaml
  fsoe-net test-protocol network.yaml --protocol protocol.yaml -o protocol.html

A YAML file that is replaced with --overwrite keeps what people wrote into it. An emulated result
is no evidence for a machine.

Exit codes: 0 nothing that was tried went otherwise than expected, 1 a step did, or a file cannot be
used; 2 wrong use; 3 no fsn-master, or no disk."""


@click.command("test-protocol", epilog=_EPILOG)
@input_options
@click.option("--virtual", is_flag=True, help="Try every step on the emulated bus.")
@click.option(
    "--live",
    is_flag=True,
    help="Try each loss on a running fsn-master: asks before each, needs a terminal.",
)
@master_options
@click.option(
    "--cycles",
    type=click.IntRange(1, 10**6),
    default=200,
    show_default=True,
    help="Emulated: FSoE cycles with a fault in them, per class.",
)
@click.option("--protocol", "given", type=FILE, metavar="FILE", help="A protocol to go on with.")
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
    """Write the test protocol of a network; fill in what runs can show.

    Steps: start-up of each connection, trigger of each safety function, loss of each SubDevice,
    each class of faults. FILES as for `check`. The column of the machine is never filled in by
    this program.
    """
    kind = _kind(output)
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
    checked = check_files(files, loading)
    resolution = whole_network(checked, "no protocol")
    if not resolution.connections:
        raise InputError("nothing to try: these files hold no FSoE connection")
    compiled = compile_plan(resolution)
    plan, fingerprint = compiled.to_bytes(), fingerprint_of(compiled)
    protocol = make_protocol(resolution, plan, fingerprint=fingerprint.whole)
    old = given or (output if kind == ".yaml" and Path(output).exists() else None)
    before = None if old is None else _read(old)
    if before is not None:
        protocol = keep_machine(protocol, before)
    if virtual:
        protocol = run_protocol_virtual(
            protocol, resolution, plan, faults=cycles, on_step=_note if _shown() else None
        )
    if address is not None:
        protocol = _live(protocol, resolution, address, fingerprint, output, overwrite=overwrite)
    _write(protocol, output, overwrite=overwrite)
    ctx.exit(_say(protocol, output))


def _write(protocol: Protocol, output: str, *, overwrite: bool) -> None:
    yaml = _kind(output) == ".yaml"
    text = write_protocol(protocol) if yaml else protocol_page(protocol, version=__version__)
    write_whole(output, text.encode("utf-8"), overwrite=overwrite)


def _live(
    protocol: Protocol,
    resolution: Resolution,
    socket: str,
    wanted: Fingerprint,
    output: str,
    *,
    overwrite: bool,
) -> Protocol:
    """Look at a running bus; what was seen is written also when it breaks off."""
    seen: list[Protocol] = []

    def on_step(so_far: Protocol, step: ProtocolStep) -> None:
        seen.append(so_far)
        _tell_step(step)

    try:
        with Client(socket) as client:
            return run_protocol_live(
                protocol, resolution, client, _Person(), fingerprint=wanted, on_step=on_step
            )
    except (KeyboardInterrupt, click.Abort, EnvironmentFault):
        if seen:
            _write(seen[-1], output, overwrite=overwrite)
            echo(
                f"\nbroken off: {output} has the {counted(len(seen), 'step')} looked at so "
                f"far; put back what "
                "you took off the bus, go on with the rest by the same command and --overwrite",
                err=True,
            )
        raise


def _tell_step(step: ProtocolStep) -> None:
    seen = step.live
    if seen is not None:
        time = "" if seen.measured_ms is None else f", {seen.measured_ms:g} ms {seen.time_is}"
        echo(f"  {step.id}: {seen.outcome.value}{time}; {seen.remark}", err=True)


def _kind(output: str) -> str:
    kind = {".yml": ".yaml", ".htm": ".html"}.get(Path(output).suffix, Path(output).suffix)
    if kind not in (".yaml", ".html"):
        raise click.UsageError(f"-o {output}: write .yaml to fill in, or .html to print")
    return kind


def _read(path: str) -> Protocol:
    out = Collector()
    protocol = load_protocol(path, out)
    if protocol is None:
        raise InputError(
            f"{path} cannot be taken as a test protocol, nothing written: "
            f"{summary(out.diagnostics)}",
            out.diagnostics,
        )
    print_diagnostics(out.diagnostics, err=True)
    return protocol


def _shown() -> bool:
    return sys.stderr.isatty()


def _note(text: str) -> None:
    echo(f"  {text}", err=True)


class _Person:
    """The person at the terminal."""

    def guarded(self, step: ProtocolStep) -> bool:
        echo(f"\n{step.id}: {step.what}", err=True)
        echo("Machines may move or stop. Is the area guarded and nobody in it?", err=True)
        answer = click.prompt(
            printable(f"write {step.subject} to go on, Enter to leave this step out"),
            default="",
            show_default=False,
            err=True,
        )
        return str(answer).strip() == step.subject

    def tell(self, text: str) -> None:
        echo(text, err=True)


def _say(protocol: Protocol, output: str) -> int:
    steps = protocol.steps
    wrong = [
        step.id
        for step in steps
        for seen in (step.emulated, step.live)
        if seen is not None and seen.outcome is Outcome.NOT_AS_EXPECTED
    ]
    machine = f"{len(protocol.open_steps)} of {len(protocol.machine_steps)} open at the machine"
    echo(f"{output}: {counted(len(steps), 'step')}, {machine}")
    tried = [s.emulated for s in steps if s.emulated is not None]
    if tried:
        left = sum(seen.outcome is Outcome.NOT_RUN for seen in tried)
        echo(f"{len(tried) - left} tried on the emulated bus, {left} not: {EMULATED_NOTE}")
    for name in dict.fromkeys(wrong):
        echo(f"not as expected: {name}")
    return 1 if wrong else 0
