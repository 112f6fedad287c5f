"""The difference of two descriptions as a document."""

from __future__ import annotations

from fsoe_net.compare.diff import Difference
from fsoe_net.compare.diff_side import Side
from fsoe_net.compare.diff_types import ChangeKind
from fsoe_net.diag.words import counted
from fsoe_net.document.model import Document, Level, Verdict, words

_LEVELS = {ChangeKind.ADDED: Level.CLEAR, ChangeKind.REMOVED: Level.ERROR}


def diff_document(a: Side, b: Side, difference: Difference) -> Document:
    """Return the result of `fsoe-net diff` for two sides."""
    rows: list[str | Verdict] = [
        f"{name}: {side.path} ({side.format}), {counted(len(side.subdevices), 'SubDevice')}"
        for name, side in (("A", a), ("B", b))
    ]
    rows += [Verdict(str(c), _LEVELS.get(c.kind, Level.WARNING)) for c in difference.changes]
    rows += [f"not compared: {text}" for text in difference.not_compared]
    count = len(difference.changes)
    rows.append(counted(count, "difference") if count else "no difference")
    return Document(lead=tuple(words(row) for row in rows))
