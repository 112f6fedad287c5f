"""A document as lines: every word, number, source and picture in it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields
from typing import Any

from fsoe_net.document.model import (
    Bullets,
    Column,
    Document,
    Heading,
    Lines,
    Number,
    Paragraph,
    Part,
    Picture,
    Style,
    Table,
    Text,
    Verdict,
)


def _item(item: Any) -> str:
    if isinstance(item, Number):
        return f"{item.text} {item.unit} <{item.value!r}, {item.source}>"
    if isinstance(item, Verdict):
        return f"[{item.level.value}] {item.word}"
    assert isinstance(item, Text)
    return item.text if item.style is Style.PLAIN else f"{{{item.style.value}}} {item.text}"


def _row(items: tuple[Any, ...]) -> str:
    return " / ".join(map(_item, items))


def _column(column: Column) -> str:
    facts = [f"{f.name} {getattr(column, f.name)}" for f in fields(column)[1:]]
    changed = [x for x, f in zip(facts, fields(column)[1:], strict=True)
               if getattr(column, f.name) != f.default]  # fmt: skip
    return " ".join([column.title, *changed])


def _part(part: Part) -> Iterator[str]:
    if isinstance(part, Heading):
        yield f"## {part.text}"
    elif isinstance(part, Paragraph):
        yield f"{'note: ' if part.note else ''}{_row(part.items)}"
    elif isinstance(part, Bullets):
        yield from (f"- {_row(row)}" for row in part.rows)
    elif isinstance(part, Lines):
        yield from (f"  {line}" for line in part.lines)
    elif isinstance(part, Table):
        yield f"table {part.name}: " + " | ".join(map(_column, part.columns))
        yield from ("  | " + " | ".join(map(_row, row)) for row in part.rows)
        yield f"  {part.remark}"
    elif isinstance(part, Picture):
        yield f"picture {part.title}: {part.words} wide {part.wide}"
        yield from (f"  {line}" for line in part.lines)
        yield from (
            f"  {line}" for line in (part.svg + part.narrow).replace("><", ">\n<").split("\n")
        )


def _lines(document: Document) -> Iterator[str]:
    """Yield everything that a document holds."""
    for field in fields(document):
        value = getattr(document, field.name)
        if field.name in ("title_block", "lead"):
            for part in value if isinstance(value, tuple) else (value,):
                yield from _part(part)
        elif field.name == "sections":
            for section in value:
                yield f"# {section.key}: {section.title}"
                for part in section.parts:
                    yield from _part(part)
        elif field.name == "points":
            yield from (f"point of {title}: {p.kind.value}: {p.text}" for title, p in value)
        elif field.name == "verdict":
            yield f"verdict: {'none' if value is None else _item(value)}"
        elif field.name not in ("findings", "against"):
            yield f"{field.name}: {value}"


def told(*parts: Any) -> str:
    """Return documents, JSON and texts as one text."""
    lines: list[str] = []
    for part in parts:
        if isinstance(part, Document):
            lines += _lines(part)
        elif isinstance(part, str):
            lines += part.replace("><", ">\n<").split("\n")
        elif isinstance(part, Part):
            lines += _part(part)
        else:
            lines += json.dumps(part, indent=1, ensure_ascii=False).split("\n")
    return "\n".join(line.rstrip() for line in lines) + "\n"
