"""What ``fsoe-net verify`` prints."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict

from fsoe_net.cli.terminal import echo
from fsoe_net.diag.printable import printable
from fsoe_net.project.known import Known
from fsoe_net.project.signatures import SignedRecord
from fsoe_net.project.verify import Comparison

__all__ = ["print_json", "print_text"]


def _print_signed(signed: SignedRecord) -> None:
    for row in signed.signatures:
        echo(printable(f"{row.role} {row.name}, {row.date}: signed, {row.key}"))
    for refusal in signed.refusals:
        echo("NOT as signed: ", fg="red", nl=False)
        echo(printable(refusal.what))
        echo(printable(f"  next: {refusal.fix}"))


def print_text(wanted: Known, rows: Sequence[Comparison], signed: SignedRecord | None) -> None:
    """Print each comparison, and the signatures before."""
    if signed is not None:
        _print_signed(signed)
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


def print_json(wanted: Known, rows: Sequence[Comparison], signed: SignedRecord | None) -> None:
    """Print the same as one document."""
    document: dict[str, object] = {
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
    if signed is not None:
        document["signatures"] = [asdict(row) for row in signed.signatures]
        document["not_as_signed"] = [asdict(row) for row in signed.refusals]
    echo(json.dumps(document, indent=2, ensure_ascii=False))
