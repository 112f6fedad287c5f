"""The report as Markdown: tables with marks instead of colours, pictures as their words."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.document.model import (
    Bullets,
    Document,
    Heading,
    Item,
    Level,
    Number,
    Paragraph,
    Part,
    Style,
    Table,
    Verdict,
)
from fsoe_net.document.number_sources import Sources

__all__ = ["report_markdown"]

MARKS = {
    Level.CLEAR: "○",
    Level.NOTE: "ⓘ",
    Level.OPEN: "?",
    Level.WARNING: "⚠",
    Level.ERROR: "✖",
}


def report_markdown(document: Document) -> str:
    """Return the report as Markdown text."""
    d = document
    lines = [
        f"# {_words(d.project)}: FSoE configuration report",
        "",
        f"Network {_words(d.network)}, fingerprint `{d.short or 'NO FINGERPRINT'}`, made with "
        f"fsoe-net {d.version}",
        "",
        f"**{_inline(d.verdict)}**",
        "",
    ]
    for part in d.lead:
        lines += _part(part, depth=2)
    for number, block in enumerate(d.blocks, 1):
        lines += [f"## {number} {_words(block.title)}", ""]
        for part in block.parts:
            lines += _part(part, depth=3)
    return "\n".join(lines).rstrip("\n") + "\n"


def _part(part: Part, *, depth: int) -> list[str]:
    if isinstance(part, Heading):
        return [f"{'#' * depth} {_words(part.text)}", ""]
    if isinstance(part, Paragraph):
        text = "".join(_inline(i) for i in part.items)
        return [f"> {text}" if part.note else text, ""]
    if isinstance(part, Bullets):
        return [*(f"- {''.join(_inline(i) for i in row)}" for row in part.rows), ""]
    if isinstance(part, Table):
        return _table(part)
    return [f"*Picture: {_words(part.title)}.* {_words(part.words)}", ""]


def _table(table: Table) -> list[str]:
    if not table.rows:
        return ["none", ""]
    sources = Sources(table)
    heads = [c.title + sources.head(n) for n, c in enumerate(table.columns)]
    lines = [_row(heads), _row(["--:" if c.number else "---" for c in table.columns])]
    lines += [
        _row([_cell(c, sources, n) for n, c in enumerate(row)]).rstrip() for row in table.rows
    ]
    lines.append("")
    if table.remark:
        lines += [_words(table.remark), ""]
    if sources.legend:
        legend = "; ".join(f"{mark} {_words(text)}" for mark, text in sources.legend)
        lines += [f"Sources: {legend}", ""]
    return lines


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cell(items: Sequence[Item], sources: Sources, column: int) -> str:
    shown = []
    for item in items:
        text = _inline(item).replace("\n", " ")
        if not text:
            continue
        if isinstance(item, Number):
            text += sources.mark(item, column)
        shown.append(text)
    return "<br>".join(shown).replace("|", "\\|")


def _inline(item: Item) -> str:
    if isinstance(item, Verdict):
        return f"{MARKS[item.level]} {_words(item.word)}"
    if isinstance(item, Number):
        return f"{item.text} {item.unit}".rstrip()
    if item.style is Style.CODE and item.text:
        return f"`{item.text}`"
    if item.style is Style.STRONG:
        return f"**{_words(item.text)}**"
    return "____" if item.style is Style.BLANK else _words(item.text)


def _words(text: str) -> str:
    """Return text that Markdown takes for text."""
    for mark in "\\`*_<[#":
        text = text.replace(mark, f"\\{mark}")
    return text
