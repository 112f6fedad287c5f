"""``fsoe-net doctor``: what on this machine disturbs a real-time cycle, and what mends it."""

from __future__ import annotations

import json
import textwrap

import click

from fsoe_net import __version__
from fsoe_net.cli.options import INTERFACE, format_option
from fsoe_net.cli.terminal import echo, terminal
from fsoe_net.diag.words import counted
from fsoe_net.errors import EnvironmentFault
from fsoe_net.host.doctor import Examination, examine
from fsoe_net.host.finding import Finding, Level
from fsoe_net.host.seam import Host, Unreadable

__all__ = ["command"]

_EPILOG = """\b
Examples:
  fsoe-net doctor
  fsoe-net doctor --interface eth1
  fsoe-net doctor --interface eth1 --format json > host.json

Nothing is changed. As root it sees more. Exit codes: 0 neither a warning nor worse, 1 there is one,
2 wrong use, 3 no Linux or no /proc."""

_STYLE = {
    Level.GOOD: "green",
    Level.NOTE: "cyan",
    Level.WARNING: "yellow",
    Level.BAD: "bold red",
    Level.UNKNOWN: "dim",
}
_WIDTH = 100


@click.command("doctor", epilog=_EPILOG)
@click.option(
    "--interface", type=INTERFACE, metavar="IF", help="Network interface of the bus: check it too."
)
@format_option
@click.pass_context
def command(ctx: click.Context, interface: str | None, fmt: str) -> None:
    """Check this machine for real-time EtherCAT.

    For each finding: why it matters for FSoE, the command that mends it, and what makes it last.
    """
    try:
        found = examine(Host(), interface=interface, program=_program())
    except Unreadable as exc:
        raise EnvironmentFault(f"this machine cannot be looked at: {exc}") from exc
    if fmt == "json":
        echo(json.dumps(found.to_json(__version__), indent=2, ensure_ascii=False))
    else:
        _print(found)
    ctx.exit(0 if found.healthy else 1)


def _program() -> str | None:
    from fsoe_net.run.master import find_master  # late: `doctor` works without the compiled core

    try:
        return find_master()
    except EnvironmentFault:
        return None


def _print(found: Examination) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    title = f"Linux {found.release} · {counted(found.cpus, 'CPU')}"
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", no_wrap=True)
    table.add_column("check", no_wrap=True)
    table.add_column("found", overflow="fold")
    for f in found.findings:
        table.add_row(Text(f.level.value, style=_STYLE[f.level]), Text(f.name), Text(f.text))
    console = terminal(width=_WIDTH)
    console.print(table)
    for level in (Level.BAD, Level.WARNING, Level.NOTE):
        for f in found.findings:
            if f.level is level:
                console.print(
                    f"{level.value}[{f.name}]:", style=_STYLE[level], end=" ", markup=False
                )
                echo(_advice(f))
    echo(_verdict(found))


def _advice(finding: Finding) -> str:
    """Return what a finding means; commands stay on one line, to be copied."""
    lines = [finding.text]
    lines += textwrap.wrap(
        finding.why, _WIDTH, initial_indent="  why:  ", subsequent_indent=" " * 8
    )
    for word, commands in (("now", finding.now), ("keep", finding.keep)):
        for n, text in enumerate(commands):
            lines.append(f"  {word + ':' if n == 0 else '':5} {text}")
    return "\n".join([*lines, ""])


def _verdict(found: Examination) -> str:
    parts = [
        counted(n, word) if word != "unknown" else f"{n} not known"
        for level, word in (
            (Level.BAD, "bad finding"),
            (Level.WARNING, "warning"),
            (Level.NOTE, "note"),
            (Level.UNKNOWN, "unknown"),
        )
        if (n := found.count(level))
    ]
    counts = ", ".join(parts) or "nothing to mend"
    more = "" if found.interface else "; --interface IF looks at the one of the bus too"
    return f"{counts}{more}"
