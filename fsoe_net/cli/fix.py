"""Hints with exactly one way to follow them, put into the files: shown first, then written."""

from __future__ import annotations

import difflib
import hashlib
import sys
from collections.abc import Iterable, Sequence

import click

from fsoe_net.cli.terminal import echo
from fsoe_net.diag.diagnostic import Diagnostic, Edit
from fsoe_net.diag.words import counted
from fsoe_net.errors import InputError
from fsoe_net.formats.files import STDIN, Collector, read_bytes
from fsoe_net.formats.patch import patch_yaml
from fsoe_net.model.network import SourceFile
from fsoe_net.save.files import write_all

__all__ = ["apply_fixes"]


def apply_fixes(found: Sequence[Diagnostic], sources: Sequence[SourceFile], *, yes: bool) -> bool:
    """Show what the hints would change, and write it when that is wanted.

    Args:
        found: Findings of the files.
        sources: The files as they were read.
        yes: Do not ask.

    Returns:
        Whether files were written.

    Raises:
        InputError: A file has changed since it was read.
    """
    hashes = {source.path: source.sha256 for source in sources}
    before = {
        path: _unchanged(path, hashes[path])
        for path in dict.fromkeys(e.span.file for d in found for e in d.edits)
        if path in hashes and path != STDIN
    }
    after: dict[str, bytes] = {}
    made: set[Edit] = set()
    for path, data in before.items():
        fitting = [d for d in found if d.edits and all(e.span.file == path for e in d.edits)]
        after[path], edits = _patched(data, path, fitting)
        made |= edits
    changed = {path: data for path, data in after.items() if data != before[path]}
    if not changed:
        echo("nothing to fix: no hint has exactly one way to follow it")
        return False
    for path, data in changed.items():
        echo(_diff(path, before[path], data), nl=False)
    fixed = sum(bool(d.edits) and set(d.edits) <= made for d in found)
    echo(f"{counted(fixed, 'finding')} of {len(found)} would be fixed")
    if not _is_wanted(yes):
        return False
    for path in changed:
        _unchanged(path, hashes[path])  # somebody may have edited it while the question was open
    write_all("", changed, overwrite=True)
    echo(f"written: {', '.join(changed)}")
    return True


def _patched(data: bytes, path: str, found: Iterable[Diagnostic]) -> tuple[bytes, frozenset[Edit]]:
    """Return the file with every finding fixed of which all edits can be made."""
    rows = list(found)
    while True:
        patched, made = patch_yaml(data, path, [e for d in rows for e in d.edits])
        whole = [d for d in rows if set(d.edits) <= made]
        if len(whole) == len(rows):
            return patched, made
        rows = whole


def _unchanged(path: str, sha256: str) -> bytes:
    out = Collector()
    data = read_bytes(path, out)
    if data is None:
        raise InputError(f"nothing written: {path} cannot be read again", out.diagnostics)
    if hashlib.sha256(data).hexdigest() != sha256:
        raise InputError(f"nothing written: {path} has changed since it was read; check it again")
    return data


def _diff(path: str, before: bytes, after: bytes) -> str:
    a, b = (data.decode("utf-8").splitlines() for data in (before, after))
    lines = difflib.unified_diff(a, b, path, f"{path}, fixed", lineterm="")
    return "".join(f"{line}\n" for line in lines)


def _is_wanted(yes: bool) -> bool:
    if yes:
        return True
    if sys.stdin is None or not sys.stdin.isatty():
        echo("not written; --yes writes it")
        return False
    return click.confirm("Write this?", default=False)
