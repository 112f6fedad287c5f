"""``fsoe-net acceptance verify``: compares a network, plan or running core with the accepted."""

from __future__ import annotations

import os

import click

from fsoe_net.acceptance.signatures import SignedRecord, check_signatures
from fsoe_net.acceptance.verify import compare_known, compare_running
from fsoe_net.cli.inputs import reference_options
from fsoe_net.cli.options import (
    FILE,
    NETWORK,
    NETWORK_FILE,
    format_option,
    master_options,
    named_master,
    read_signers,
    signer_options,
)
from fsoe_net.cli.verify_output import print_json, print_text
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.project.known import Known, known_record, read_known

_EPILOG = """\b
Examples:
  fsoe-net acceptance verify network.yaml --accepted acceptance.yaml
  fsoe-net acceptance verify machine.fsnplan --accepted accepted/network.yaml
  fsoe-net acceptance verify --interface eth1 --accepted accepted.json
  fsoe-net acceptance verify machine.fsnplan --acceptance acceptance.yaml --signers allowed_signers

Exit codes: 0 same, and signed; 1 different, an invalid signature, or an invalid file; 2 usage
error; 3 no answer on the socket, or no ssh-keygen.

An equal fingerprint shows that the configuration is the accepted one, not that it is correct. A
signature shows who agreed, not that the configuration is correct."""


@click.command("verify", epilog=_EPILOG)
@click.argument("files", nargs=-1, type=NETWORK_FILE)
@reference_options
@click.option(
    "--accepted",
    type=NETWORK_FILE,
    metavar="FILE",
    help="Accepted configuration: acceptance record, fingerprint (JSON), plan or network.",
)
@click.option(
    "--acceptance",
    type=FILE,
    metavar="RECORD",
    help="Acceptance record whose signatures and signed files are also checked.",
)
@signer_options
@master_options
@format_option
@click.pass_context
def verify(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    accepted: str | None,
    acceptance: str | None,
    signers: str | None,
    revoked: str | None,
    socket: str | None,
    interface: str | None,
    fmt: str,
) -> None:
    """Compare a network, a plan or a running fsn-master with the accepted configuration.

    FILES: a .fsnplan, a fingerprint, or a network as for `fsoe-net check`. A running fsn-master
    calculates its fingerprint from the tables it has loaded and reports the bus cycle in use.
    """
    address = named_master(socket, interface)
    # In the folder of a network, no file has to be given.
    if not files and address is None and acceptance is None:
        if not os.path.isfile(NETWORK):
            raise click.UsageError(
                "name a network or plan, --socket PATH or --interface IF to compare"
            )
        files = (NETWORK,)
    if (accepted is None) == (acceptance is None):
        raise click.UsageError("give either --accepted FILE or --acceptance RECORD")
    signed = _signed(acceptance, signers, revoked)
    wanted = _wanted(accepted, signed, loading)
    rows = [compare_known(wanted, read_known(files, loading))] if files else []
    if address is not None:
        rows.append(compare_running(wanted, address))
    if fmt == "json":
        print_json(wanted, rows, signed)
    else:
        print_text(wanted, rows, signed)
    # An invalid signature outweighs an equal configuration.
    holds = signed is None or not signed.refusals
    ctx.exit(0 if holds and all(row.same for row in rows) else 1)


def _signed(
    acceptance: str | None, signers: str | None, revoked: str | None
) -> SignedRecord | None:
    """Check the signatures of a record, if one is given."""
    trusted = read_signers(signers, revoked)
    if (acceptance is None) != (trusted is None):
        raise click.UsageError("--acceptance RECORD and --signers FILE belong together")
    if acceptance is None or trusted is None:
        return None
    return check_signatures(acceptance, trusted)


def _wanted(accepted: str | None, signed: SignedRecord | None, loading: LoadOptions) -> Known:
    if signed is not None:
        return known_record(signed.path, signed.record)
    return read_known((accepted or "",), loading)
