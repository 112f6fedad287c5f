"""``fsoe-net verify``: is this network, plan or running core what was accepted?"""

from __future__ import annotations

import json

import click

from fsoe_net.cli.inputs import reference_options
from fsoe_net.cli.options import FILE, format_option, master_options, master_socket
from fsoe_net.cli.terminal import echo
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.project.known import Known, read_known
from fsoe_net.project.verify import Comparison, compare_known, compare_running

__all__ = ["command"]

_EPILOG = """\b
Examples:
  fsoe-net verify network.yaml --accepted acceptance.yaml
  fsoe-net verify machine.fsnplan --accepted accepted/network.yaml
  fsoe-net verify --interface eth1 --accepted accepted.json

Exit codes: 0 same, 1 differs or a file cannot be used, 2 wrong use, 3 nobody answers on the socket.

The same fingerprint says that the configuration is the accepted one, not that it is right."""


@click.command("verify", epilog=_EPILOG)
@click.argument("files", nargs=-1, type=FILE)
@reference_options
@click.option(
    "--accepted",
    type=FILE,
    metavar="FILE",
    required=True,
    help="What was accepted: acceptance record, fingerprint (JSON), plan or network.",
)
@master_options
@format_option
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    accepted: str,
    socket: str | None,
    interface: str | None,
    fmt: str,
) -> None:
    """Compare a network, a plan or a running core with what was accepted.

    FILES: a .fsnplan, a fingerprint, or a network as for `fsoe-net check`. A running core makes its
    fingerprint from the tables it has loaded; its bus cycle is that which it really uses.
    """
    live = socket is not None or interface is not None
    if not files and not live:
        raise click.UsageError("name a network or plan, --socket PATH or --interface IF to compare")
    address = master_socket(socket, interface) if live else None
    wanted = read_known((accepted,), loading)
    rows = [compare_known(wanted, read_known(files, loading))] if files else []
    if address is not None:
        rows.append(compare_running(wanted, address))
    if fmt == "json":
        _print_json(wanted, rows)
    else:
        _print_text(wanted, rows)
    ctx.exit(0 if all(row.same for row in rows) else 1)


def _print_text(wanted: Known, rows: list[Comparison]) -> None:
    echo(f"{wanted.fingerprint.short}  accepted: {wanted.path}")
    for row in rows:
        verdict = "the same" if row.same else f"DIFFERS in {', '.join(row.sections)}"
        note = f" ({row.note})" if row.note else ""
        colour = "green" if row.same else "red"
        text = f"{row.known.fingerprint.short}  {row.known.path}{note}: "
        echo(text, nl=False)
        echo(verdict, fg=colour)
        for line in row.lines:
            echo(f"  {line}")


def _print_json(wanted: Known, rows: list[Comparison]) -> None:
    document = {
        "same": all(row.same for row in rows),
        "accepted": {"path": wanted.path, **wanted.fingerprint.to_json()},
        "compared": [
            {
                "path": row.known.path,
                "note": row.note,
                "same": row.same,
                "changed": list(row.sections),
                "differences": list(row.lines),
                **row.known.fingerprint.to_json(),
            }
            for row in rows
        ],
    }
    echo(json.dumps(document, indent=2, ensure_ascii=False))
