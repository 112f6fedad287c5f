"""``fsoe-net verify``: is this network, plan or running core what was accepted?"""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterator
from dataclasses import dataclass

import click

from fsoe_net.cli.inputs import reference_options
from fsoe_net.cli.options import FILE, master_options, master_socket
from fsoe_net.cli.terminal import echo
from fsoe_net.diag.words import counted
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.options import LoadOptions
from fsoe_net.plan.model import Plan
from fsoe_net.project.known import Known, read_known
from fsoe_net.report.diff import compare
from fsoe_net.report.diff_read import side_of_plan
from fsoe_net.report.diff_side import Side

__all__ = ["command"]

_SHOWN_LINES = 20
_EPILOG = """\b
Examples:
  fsoe-net verify network.yaml --accepted acceptance.yaml
  fsoe-net verify machine.fsnplan --accepted accepted/network.yaml
  fsoe-net verify --interface eth1 --accepted accepted.json

Exit codes: 0 same, 1 differs or a file cannot be used, 2 wrong use, 3 nobody answers on the socket.

The same fingerprint says that the configuration is the accepted one, not that it is right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Compared:
    """One thing held against the accepted one: sections that differ, and how."""

    known: Known
    note: str
    sections: tuple[str, ...]
    lines: tuple[str, ...]

    @property
    def same(self) -> bool:
        return not self.sections


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
@click.option(
    "--format", "fmt", type=click.Choice(["text", "json"]), default="text", show_default=True
)
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
    given = None
    if files:
        given = read_known(files, loading)
    rows = [] if given is None else [_compare(wanted, given, "")]
    if address is not None:
        rows.append(_live(wanted, address))
    if fmt == "json":
        _print_json(wanted, rows)
    else:
        _print_text(wanted, rows)
    ctx.exit(0 if all(row.same for row in rows) else 1)


def _live(wanted: Known, socket: str) -> _Compared:
    """Ask the core; a bus cycle that is not the one its plan states counts as another section."""
    from fsoe_net.run.client import Client
    from fsoe_net.run.in_use import fingerprint_in_use

    with Client(socket) as client:
        status = client.status()
    told = fingerprint_in_use(status)
    if told is None:
        raise EnvironmentFault(
            f"{socket}: this fsn-master tells no fingerprint; install a newer one"
        )
    note = f"fsn-master {status.version}, cycle {status.cycle_ns / 1e6:g} ms"
    return _compare(wanted, Known(path=socket, fingerprint=told), note)


def _compare(wanted: Known, given: Known, note: str) -> _Compared:
    sections = wanted.fingerprint.changed(given.fingerprint)
    lines = tuple(_difference(wanted, given, sections)) if sections else ()
    return _Compared(known=given, note=note, sections=sections, lines=lines)


def _difference(wanted: Known, given: Known, sections: tuple[str, ...]) -> Iterator[str]:
    """Yield the difference by meaning; then, for what it says nothing about, lines of the text."""
    told = False
    if wanted.plan is not None and given.plan is not None:
        # The names of the files are no difference.
        sides = (_side(wanted.plan, wanted), _side(given.plan, given))
        for change in compare(*sides).changes:
            told = True
            yield str(change)
    hidden = ""
    for name in sections:
        before, after = wanted.section_text(name), given.section_text(name)
        if before is None or after is None:
            hidden = wanted.path if before is None else given.path
        elif not told or name in ("devices", "process_data"):
            yield from _changed_lines(name, before, after)
    if hidden:
        yield f"of {hidden} only hashes are known: two networks or plans show what changed"


def _side(plan: Plan, known: Known) -> Side:
    return side_of_plan(plan, "", known.functions)


def _changed_lines(name: str, before: str, after: str) -> Iterator[str]:
    a, b = before.splitlines(), after.splitlines()
    while a and b and a[0] == b[0]:  # long sections differ in a few places
        a, b = a[1:], b[1:]
    while a and b and a[-1] == b[-1]:
        a, b = a[:-1], b[:-1]
    if len(a) + len(b) > 20_000:
        yield (
            f"{name}: {counted(len(a), 'line')} became {len(b)}; `fingerprint --text "
            f"{name}` prints them"
        )
        return
    changed = [line for line in difflib.ndiff(a, b) if line[:1] in "+-"]
    for line in changed[:_SHOWN_LINES]:
        yield f"{name} {line[0]} {line[2:]}"
    if len(changed) > _SHOWN_LINES:
        yield (
            f"{name}: {counted(len(changed) - _SHOWN_LINES, 'more line')}; `fingerprint "
            f"--text` prints them"
        )


def _print_text(wanted: Known, rows: list[_Compared]) -> None:
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


def _print_json(wanted: Known, rows: list[_Compared]) -> None:
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
