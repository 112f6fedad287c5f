"""Output of ``fsoe-net acceptance verify``."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict

from fsoe_net.acceptance.signatures import SignedRecord
from fsoe_net.acceptance.verify import Comparison
from fsoe_net.cli.terminal import echo, show
from fsoe_net.document.model import Document, Level, Part, Verdict, words
from fsoe_net.project.known import Known


def _signed(signed: SignedRecord) -> Iterator[Part]:
    for row in signed.signatures:
        yield words(f"{row.role} {row.name}, {row.date}: signed, {row.key}")
    for refusal in signed.refusals:
        yield words(Verdict("NOT as signed: ", Level.ERROR), refusal.what)
        yield words(f"  next: {refusal.fix}")


def _compared(row: Comparison) -> Iterator[Part]:
    verdict = Verdict("the same", Level.CLEAR)
    if not row.same:
        verdict = Verdict(f"DIFFERS in {', '.join(row.sections)}", Level.ERROR)
    note = f" ({row.note})" if row.note else ""
    yield words(f"{row.known.fingerprint.short}  {row.known.name}{note}: ", verdict)
    for line in row.lines:
        yield words(f"  {line}")


def print_text(wanted: Known, rows: Sequence[Comparison], signed: SignedRecord | None) -> None:
    """Print the signatures, then each comparison."""
    parts = [] if signed is None else list(_signed(signed))
    parts.append(words(f"{wanted.fingerprint.short}  accepted: {wanted.path}"))
    for row in rows:
        parts += _compared(row)
    show(Document(lead=tuple(parts)))


def print_json(wanted: Known, rows: Sequence[Comparison], signed: SignedRecord | None) -> None:
    """Print the comparisons as one JSON document."""
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
