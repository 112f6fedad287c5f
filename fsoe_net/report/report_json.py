"""The report as JSON: the whole document, every number with its unit and source."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from fsoe_net.document.model import (
    Block,
    Bullets,
    Document,
    Heading,
    Item,
    Number,
    Paragraph,
    Part,
    Table,
    Text,
    Verdict,
)

__all__ = ["report_json"]


def report_json(document: Document) -> str:
    """Return the report as JSON text (``schemas/report.schema.json``)."""
    d = document
    found: dict[str, Any] = {
        "format": "fsoe-net report",
        "version": 1,
        "tool": {"name": "fsoe-net", "version": d.version},
        "project": d.project,
        "network": d.network,
        "fingerprint": {"short": d.short, "whole": d.whole} if d.whole else None,
        "verdict": _item(d.verdict),
        "lead": [_part(p) for p in d.lead],
        "blocks": [_block(n, b) for n, b in enumerate(d.blocks, 1)],
        "findings": [f.to_json() for f in d.findings],
        "points": [{"kind": p.kind.value, "block": title, "text": p.text} for title, p in d.points],
    }
    return json.dumps(found, indent=2, ensure_ascii=False) + "\n"


def _block(number: int, b: Block) -> dict[str, Any]:
    return {
        "number": number,
        "key": b.key,
        "title": b.title,
        "parts": [_part(p) for p in b.parts],
    }


def _part(part: Part) -> dict[str, Any]:
    if isinstance(part, Heading):
        return {"type": "heading", "text": part.text}
    if isinstance(part, Paragraph):
        return {"type": "paragraph", "note": part.note, "items": _items(part.items)}
    if isinstance(part, Bullets):
        return {"type": "list", "rows": [_items(r) for r in part.rows]}
    if isinstance(part, Table):
        return {
            "type": "table",
            "name": part.name,
            "columns": [c.title for c in part.columns],
            "rows": [[_items(c) for c in row] for row in part.rows],
            "remark": part.remark or None,
        }
    picture = {"type": "picture", "title": part.title, "words": part.words, "svg": part.svg}
    return picture | ({"narrow": part.narrow} if part.narrow else {})


def _items(items: Sequence[Item]) -> list[dict[str, Any]]:
    return [_item(i) for i in items]


def _item(item: Item) -> dict[str, Any]:
    if isinstance(item, Text):
        return {"type": "text", "style": item.style.value, "text": item.text}
    if isinstance(item, Verdict):
        return {"type": "verdict", "level": item.level.value, "word": item.word}
    return _number(item)


def _number(n: Number) -> dict[str, Any]:
    return {
        "type": "number",
        "value": n.value,
        "text": n.text,
        "unit": n.unit or None,
        "source": n.source,
    }
