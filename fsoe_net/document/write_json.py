"""Parts of a document as JSON: every number with its unit and source."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fsoe_net.document.model import (
    Bullets,
    Heading,
    Item,
    Lines,
    Paragraph,
    Part,
    Section,
    Table,
    Text,
    Verdict,
)


def section_json(number: int, section: Section) -> dict[str, Any]:
    """Return a section; numbers begin at 1 and include appendices."""
    return {
        "number": number,
        "key": section.key,
        "title": section.title,
        "appendix": section.appendix,
        "parts": [part_json(p) for p in section.parts],
    }


def part_json(part: Part) -> dict[str, Any]:
    """Return a part; ``type`` names its type."""
    if isinstance(part, Heading):
        return {"type": "heading", "text": part.text}
    if isinstance(part, Paragraph):
        return {"type": "paragraph", "note": part.note, "items": _items(part.items)}
    if isinstance(part, Bullets):
        return {"type": "list", "rows": [_items(r) for r in part.rows]}
    if isinstance(part, Lines):
        return {"type": "lines", "lines": list(part.lines)}
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
    return [item_json(i) for i in items]


def item_json(item: Item) -> dict[str, Any]:
    """Return a text, a verdict or a number; ``type`` names its type."""
    if isinstance(item, Text):
        return {"type": "text", "style": item.style.value, "text": item.text}
    if isinstance(item, Verdict):
        return {"type": "verdict", "level": item.level.value, "word": item.word}
    return {
        "type": "number",
        "value": item.value,
        "text": item.text,
        "unit": item.unit or None,
        "source": item.source,
    }
