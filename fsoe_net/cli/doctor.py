"""``fsoe-net doctor``: what on this machine disturbs a real-time cycle, and what fixes it."""

from __future__ import annotations

import json

import click

from fsoe_net.cli.options import INTERFACE, format_option
from fsoe_net.cli.terminal import echo, show
from fsoe_net.diag.words import counted
from fsoe_net.document.model import (
    Column,
    Document,
    Level,
    Lines,
    Part,
    Table,
    Verdict,
    cell,
    words,
)
from fsoe_net.errors import EnvironmentFault
from fsoe_net.host.doctor import Examination, examine
from fsoe_net.host.finding import MachineFinding, MachineLevel
from fsoe_net.host.seam import Host, Unreadable
from fsoe_net.version import __version__

_EPILOG = """\b
Examples:
  fsoe-net doctor
  fsoe-net doctor --interface eth1
  fsoe-net doctor --interface eth1 --format json > host.json
  fsoe-net doctor --self-test
  fsoe-net doctor --self-test --format json > self-test.json

Nothing is changed. As root it can check more. The self-test opens no interface. It shows that this
copy works as released on this machine, not that a network is safe.

Exit codes: 0 no warning or error, or every part of the self-test passed; 1 otherwise (do not use an
installation whose self-test fails); 2 usage error; 3 not Linux or no /proc."""

_LEVELS = {
    MachineLevel.GOOD: Level.CLEAR,
    MachineLevel.NOTE: Level.NOTE,
    MachineLevel.WARNING: Level.WARNING,
    MachineLevel.BAD: Level.ERROR,
    MachineLevel.UNKNOWN: Level.OPEN,
}


@click.command("doctor", epilog=_EPILOG)
@click.option(
    "--interface", type=INTERFACE, metavar="IF", help="Also check the network interface of the bus."
)
@click.option(
    "--self-test",
    "is_self_test",
    is_flag=True,
    help="Instead test this installation with known results: reference networks, recorded runs, "
    "formulas, the C core, fsn-master.",
)
@format_option
@click.pass_context
def command(ctx: click.Context, interface: str | None, is_self_test: bool, fmt: str) -> None:
    """Check this machine for real-time EtherCAT, or test this installation.

    Each finding explains why it matters for FSoE, the command that fixes it, and how to make the
    fix permanent.
    """
    if is_self_test:
        if interface is not None:
            raise click.UsageError("--self-test opens no interface: leave out --interface")
        from fsoe_net.cli.self_test import print_self_test

        ctx.exit(print_self_test(fmt))
    try:
        found = examine(Host(), interface=interface, program=_program())
    except Unreadable as exc:
        raise EnvironmentFault(f"this machine cannot be looked at: {exc}") from exc
    if fmt == "json":
        echo(json.dumps(found.to_json(__version__), indent=2, ensure_ascii=False))
    else:
        show(_document(found))
    ctx.exit(0 if found.healthy else 1)


def _program() -> str | None:
    from fsoe_net.live.master import find_master  # late: `doctor` works without the compiled core

    try:
        return find_master()
    except EnvironmentFault:
        return None


def _document(found: Examination) -> Document:
    rows = tuple(
        (cell(Verdict(f.level.value, _LEVELS[f.level])), cell(f.name), cell(f.text))
        for f in found.findings
    )
    columns = (Column(""), Column("check"), Column("found", wraps=True))
    parts: list[Part] = [Table(columns=columns, rows=rows)]
    for level in (MachineLevel.BAD, MachineLevel.WARNING, MachineLevel.NOTE):
        for f in found.findings:
            if f.level is level:
                parts += _advice(f)
    parts.append(words(_verdict(found)))
    title = f"Linux {found.release} · {counted(found.cpus, 'CPU')}"
    return Document(title=title, lead=tuple(parts))


def _advice(finding: MachineFinding) -> list[Part]:
    """Return the advice for a finding; commands stay on one line so that they can be copied."""
    head = Verdict(f"{finding.level.value}[{finding.name}]", _LEVELS[finding.level])
    # Commands stay on one line, so that they can be copied.
    commands = [
        f"  {f'{word}:' if n == 0 else '':5} {text}"
        for word, texts in (("now", finding.now), ("keep", finding.keep))
        for n, text in enumerate(texts)
    ]
    parts: list[Part] = [words(head, f": {finding.text}")]
    if finding.why:
        parts.append(words(f"why: {finding.why}"))
    return [*parts, Lines(tuple(commands))] if commands else parts


def _verdict(found: Examination) -> str:
    parts = [
        counted(n, word) if word != "unknown" else f"{n} not known"
        for level, word in (
            (MachineLevel.BAD, "bad finding"),
            (MachineLevel.WARNING, "warning"),
            (MachineLevel.NOTE, "note"),
            (MachineLevel.UNKNOWN, "unknown"),
        )
        if (n := found.count(level))
    ]
    counts = ", ".join(parts) or "nothing to fix"
    more = "" if found.interface else "; --interface IF looks at the one of the bus too"
    return f"{counts}{more}"
