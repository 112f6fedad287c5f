"""``fsoe-net doctor``: what on this machine disturbs a real-time cycle, and what fixes it."""

from __future__ import annotations

import json

import click

from fsoe_net.cli.doctor_output import examination_document
from fsoe_net.cli.options import FILE, INTERFACE, format_option, refuse_others
from fsoe_net.cli.terminal import echo, show
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.shared.write_files import STDOUT, write_whole
from fsoe_net.host.doctor import examine
from fsoe_net.host.scripts import fix_script, undo_script
from fsoe_net.host.seam import Host, Unreadable
from fsoe_net.version import __version__

_EPILOG = """\b
Examples:
  fsoe-net doctor
  fsoe-net doctor --interface eth1
  fsoe-net doctor --interface eth1 --format json > host.json
  fsoe-net doctor --interface eth1 --fix --dry-run --undo undo.sh > fix.sh
  fsoe-net doctor --self-test
  fsoe-net doctor --self-test --format json > self-test.json

Nothing is changed. As root it can check more. The self-test opens no interface. It shows that this
copy works as released on this machine, not that a network is safe.

Exit codes: 0 no warning or error, a script was printed, or every part of the self-test passed; 1
otherwise (do not use an installation whose self-test fails); 2 usage error; 3 not Linux or no
/proc."""


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
@click.option(
    "--fix",
    is_flag=True,
    help="Print a script with the fixes that can be undone: governor, interrupts, coalescing, "
    "kernel command line (as comments). Only with --dry-run.",
)
@click.option("--dry-run", is_flag=True, help="With --fix: print, change nothing.")
@click.option(
    "--undo", type=FILE, metavar="FILE", help="With --fix: new file for the script that undoes it."
)
@format_option
@click.pass_context
def command(
    ctx: click.Context,
    interface: str | None,
    is_self_test: bool,
    fix: bool,
    dry_run: bool,
    undo: str | None,
    fmt: str,
) -> None:
    """Check this machine for real-time EtherCAT, or test this installation.

    Each finding explains why it matters for FSoE, the command that fixes it, and how to make the
    fix permanent.
    """
    _check_fix(ctx, fix, dry_run, undo)
    if is_self_test:
        if interface is not None:
            raise click.UsageError("--self-test opens no interface: leave out --interface")
        from fsoe_net.cli.self_test import print_self_test

        ctx.exit(print_self_test(fmt))
    try:
        found = examine(Host(), interface=interface, program=_program())
    except Unreadable as exc:
        raise EnvironmentFault(f"this machine cannot be looked at: {exc}") from exc
    if fix:
        # The values of now, before a person runs the script.
        if undo is not None:
            write_whole(undo, undo_script(found).encode(), overwrite=False)
        echo(fix_script(found), nl=False)
        return
    if fmt == "json":
        echo(json.dumps(found.to_json(__version__), indent=2, ensure_ascii=False))
    else:
        show(examination_document(found))
    ctx.exit(0 if found.healthy else 1)


def _check_fix(ctx: click.Context, fix: bool, dry_run: bool, undo: str | None) -> None:
    if not fix:
        if dry_run or undo is not None:
            raise click.UsageError("--dry-run and --undo go with --fix")
        return
    refuse_others(ctx, "--fix", "fix", "dry_run", "undo", "interface")
    if not dry_run:
        raise click.UsageError("--fix needs --dry-run: it prints a script, and changes nothing")
    if undo == STDOUT:
        raise click.UsageError("--undo takes a file: standard output has the other script")


def _program() -> str | None:
    from fsoe_net.live.master import find_master  # late: `doctor` works without the compiled core

    try:
        return find_master()
    except EnvironmentFault:
        return None
