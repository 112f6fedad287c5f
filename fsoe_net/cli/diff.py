"""``fsoe-net diff``: compare two descriptions or plans."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from fsoe_net.cli.inputs import master_option, reference_options
from fsoe_net.cli.options import NETWORK_FILE, format_option
from fsoe_net.cli.terminal import echo, show
from fsoe_net.compare.diff import Difference, compare, diff_document
from fsoe_net.compare.read import read_side
from fsoe_net.compare.sides import Side
from fsoe_net.formats.own.options import LoadOptions

_EPILOG = """\b
Examples:
  fsoe-net diff old/network.yaml new/network.yaml
  fsoe-net diff machine.fsnplan network.yaml
  fsoe-net diff network.yaml machine.eni.xml --format json
  fsoe-net diff before/scan.json after/scan.json -q

A and B: network YAML, URDF or xacro, .fsnplan, scan.json, ENI, ESI, SII, output of the ethercat
tool or of slaveinfo -map, linuxcnc-ethercat XML, TwinSAFE export, TwinCAT project,
acceptance record. The type is recognised by content.

Exit codes: 0 same, 1 differs or a file cannot be used, 2 usage error."""


@click.command("diff", epilog=_EPILOG)
@click.argument("a", type=NETWORK_FILE)
@click.argument("b", type=NETWORK_FILE)
@reference_options
@master_option
@click.option("-q", "--quiet", is_flag=True, help="Print nothing; only set the exit code.")
@format_option
@click.pass_context
def command(
    ctx: click.Context,
    a: str,
    b: str,
    loading: LoadOptions,
    quiet: bool,
    fmt: str,
) -> None:
    """Compare two descriptions or plans of a bus by meaning.

    Comments, key order and names that do not affect the bus are ignored. Offsets, devices, sizes,
    addresses and watchdogs are compared.
    """
    left, right = read_side(a, loading), read_side(b, loading)
    difference = compare(left, right)
    if fmt == "json" and not quiet:
        _print_json(left, right, difference)
    elif not quiet:
        show(diff_document(left, right, difference))
    ctx.exit(0 if difference.same else 1)


def _print_json(a: Side, b: Side, difference: Difference) -> None:
    document = {
        "same": difference.same,
        "a": {"path": a.path, "format": a.format},
        "b": {"path": b.path, "format": b.format},
        "changes": [asdict(c) | {"what": c.what or None} for c in difference.changes],
        "not_compared": list(difference.not_compared),
    }
    echo(json.dumps(document, indent=2, ensure_ascii=False))
