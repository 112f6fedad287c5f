"""Shell scripts that apply the fixes of an examination, and that undo them."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.diag.printable import printable
from fsoe_net.host.doctor import Examination
from fsoe_net.host.finding import MachineFinding, MachineFix

_BEGIN = """#!/bin/sh
# {title} on Linux {release}. Read it, stop fsn-master, then run it as root.
code=0"""


def fix_script(found: Examination) -> str:
    """Return the script that applies the fixes which can be undone."""
    return _script(found, "Settings for a real-time cycle", undo=False)


def undo_script(found: Examination) -> str:
    """Return the script that restores the values which were read."""
    return _script(found, "The settings before the script of fsoe-net doctor --fix", undo=True)


def _script(found: Examination, title: str, *, undo: bool) -> str:
    fixes = [(f, f.fix) for f in found.findings if f.fix is not None]
    lines = [_BEGIN.format(title=title, release=printable(found.release))]
    for finding, fix in reversed(fixes) if undo else fixes:
        lines += ["", *_comments(finding), *_commands(fix, undo=undo)]
    return "\n".join([*lines, "", 'exit "$code"', ""])


def _comments(finding: MachineFinding) -> Iterator[str]:
    yield f"# {finding.name}: {printable(finding.text)}"
    yield f"# {printable(finding.why)}"


def _commands(fix: MachineFix, *, undo: bool) -> Iterator[str]:
    # A setting that fails does not keep the others from being made.
    yield from (f"{command} || code=1" for command in (fix.undo if undo else fix.do))
    if fix.boot:
        change = f"remove {fix.boot} from" if undo else f"add {fix.boot} to"
        yield f"# By hand: {change} GRUB_CMDLINE_LINUX in /etc/default/grub; update-grub; reboot."
