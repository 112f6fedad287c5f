"""``fsoe-net diff``: compare two descriptions or plans."""

from __future__ import annotations

import json

import click

from fsoe_net.cli.inputs import reference_options
from fsoe_net.cli.options import FILE
from fsoe_net.cli.terminal import echo
from fsoe_net.diag import Severity, counted
from fsoe_net.errors import InputError
from fsoe_net.load import (
    LoadOptions,
)
from fsoe_net.project.compare import read_side
from fsoe_net.report import (
    Change,
    Difference,
    Side,
    compare,
)

__all__ = ["change_line", "command"]

_SHOWN_ENTRIES = 6
_MARK = {"added": "+", "removed": "-"}
_COLOUR = {"added": "green", "removed": "red"}
_EPILOG = """\b
Examples:
  fsoe-net diff old/network.yaml new/network.yaml
  fsoe-net diff machine.fsnplan network.yaml
  fsoe-net diff network.yaml machine.eni.xml --format json
  fsoe-net diff before/scan.json after/scan.json -q

A and B: network YAML, URDF or xacro, .fsnplan, scan.json, ENI, ESI, SII, output of the ethercat
tool or of slaveinfo -map, linuxcnc-ethercat XML, TwinSAFE export, TwinCAT project,
acceptance record; known by content.

Exit codes: 0 same, 1 differs or a file cannot be used, 2 wrong use."""


@click.command("diff", epilog=_EPILOG)
@click.argument("a", type=FILE)
@click.argument("b", type=FILE)
@reference_options
@click.option("-q", "--quiet", is_flag=True, help="Print nothing; only the exit code tells.")
@click.option(
    "--format", "fmt", type=click.Choice(["text", "json"]), default="text", show_default=True
)
@click.pass_context
def command(
    ctx: click.Context,
    a: str,
    b: str,
    loading: LoadOptions,
    quiet: bool,
    fmt: str,
) -> None:
    """Compare two descriptions or plans of a bus, by meaning.

    Comments, order of keys and names that do not matter to a bus are no difference; moved offsets,
    other devices, sizes, addresses and watchdogs are.
    """
    sides = []
    for path in (a, b):
        side, found = read_side(path, loading)
        if side is None:
            errors = [d for d in found if d.level is Severity.ERROR]
            raise InputError(f"{path} cannot be compared", errors)
        sides.append(side)
    difference = compare(sides[0], sides[1])
    if not quiet:
        show = _print_json if fmt == "json" else _print_text
        show(sides[0], sides[1], difference)
    ctx.exit(0 if difference.same else 1)


def _print_text(a: Side, b: Side, difference: Difference) -> None:
    echo(f"A: {a.path} ({a.format}), {counted(len(a.subdevices), 'SubDevice')}")
    echo(f"B: {b.path} ({b.format}), {counted(len(b.subdevices), 'SubDevice')}")
    for change in difference.changes:
        echo(change_line(change), fg=_COLOUR.get(change.kind, "yellow"))
    for words in difference.not_compared:
        echo(f"not compared: {words}")
    count = len(difference.changes)
    echo(counted(count, "difference") if count else "no difference")


def change_line(change: Change) -> str:
    """Return a change as one line: ``~ connection a - b changed: watchdog 100 ms -> 120 ms``."""
    area = change.area.replace("_", " ")
    mark = _MARK.get(change.kind, "~")
    text = " ".join(w for w in (mark, area, change.where, change.kind) if w)
    if change.entries:
        shown = ", ".join(change.entries[:_SHOWN_ENTRIES])
        more = len(change.entries) - _SHOWN_ENTRIES
        text += f": {shown}" + (f" and {more} more" if more > 0 else "")
    value = _value(change)
    if change.what and value:
        return f"{text}: {change.what} {value}"
    return f"{text}: {value}" if value else text


def _value(change: Change) -> str:
    before, after = change.before, change.after
    if change.kind in ("added", "removed"):
        return str(after if before is None else before) if (before, after) != (None, None) else ""
    if change.kind == "moved" and before is None:
        return f"{after}"
    words = ["not stated" if v is None else "empty" if v == "" else str(v) for v in (before, after)]
    return " -> ".join(words)


def _print_json(a: Side, b: Side, difference: Difference) -> None:
    document = {
        "same": difference.same,
        "a": {"path": a.path, "format": a.format},
        "b": {"path": b.path, "format": b.format},
        "changes": [
            {
                "kind": c.kind,
                "area": c.area,
                "where": c.where,
                "what": c.what or None,
                "before": c.before,
                "after": c.after,
                "entries": list(c.entries),
            }
            for c in difference.changes
        ],
        "not_compared": list(difference.not_compared),
    }
    echo(json.dumps(document, indent=2, ensure_ascii=False))
