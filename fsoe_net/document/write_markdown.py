"""A document as Markdown: tables with marks instead of colours, text instead of pictures."""

from __future__ import annotations

import re
from collections.abc import Sequence

from fsoe_net.diag.printable import printable
from fsoe_net.document.model import (
    MARKS,
    Bullets,
    Document,
    Heading,
    Item,
    Lines,
    Number,
    Paragraph,
    Part,
    Style,
    Table,
    Verdict,
    section_marks,
)
from fsoe_net.document.number_sources import Sources


def document_markdown(document: Document) -> str:
    """Return the document as Markdown text."""
    d = document
    facts = [
        _words(d.subtitle),
        f"fingerprint {_code(d.seal)}" if d.seal else "",
        f"made with fsoe-net {_words(d.version)}" if d.version else "",
    ]
    lines = [f"# {_words(d.title)}", "", ", ".join(fact for fact in facts if fact), ""]
    if d.title_block is not None:
        lines += _part(d.title_block, depth=2)
    if d.verdict is not None:
        lines += [f"**{_inline(d.verdict)}**", ""]
    for part in d.lead:
        lines += _part(part, depth=2)
    for mark, section in zip(section_marks(d.sections), d.sections, strict=True):
        shown = f"{mark} " if d.numbered else ""
        lines += [f"## {shown}{_words(section.title)}", ""]
        for part in section.parts:
            lines += _part(part, depth=3)
    return "\n".join(lines).rstrip("\n") + "\n"


def _part(part: Part, *, depth: int) -> list[str]:
    if isinstance(part, Heading):
        return [f"{'#' * depth} {_words(part.text)}", ""]
    if isinstance(part, Paragraph):
        text = _running(part.items)
        return [f"> {text}" if part.note else text, ""]
    if isinstance(part, Bullets):
        return [*(f"- {_running(row)}" for row in part.rows), ""]
    if isinstance(part, Lines):
        return [*(f"    {printable(line)}" for line in part.lines), ""]
    if isinstance(part, Table):
        return _table(part)
    return [f"*Picture: {_words(part.title)}.* {_words(part.words)}", ""]


def _running(items: Sequence[Item]) -> str:
    """Return running text whose beginning cannot form a heading, a list or a quotation."""
    text = "".join(_inline(i) for i in items)
    return re.sub(r"^(\s*\d*)([-+>.)])", r"\1\\\2", text)


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
    # A vertical bar ends the cell even inside code.
    return "<br>".join(shown).replace("|", "\\|")


def _inline(item: Item) -> str:
    if isinstance(item, Verdict):
        return f"{MARKS[item.level]} {_words(item.word)}"
    if isinstance(item, Number):
        return f"{item.text} {item.unit}".rstrip()
    if item.style is Style.CODE and item.text:
        return _code(item.text)
    if item.style is Style.STRONG:
        text = _words(item.text)
        bare = text.rstrip()  # with a space before them, the closing marks would have no effect
        return f"**{bare}**{text[len(bare) :]}"
    return "____" if item.style is Style.BLANK else _words(item.text)


def _words(text: str) -> str:
    """Return text on one line that Markdown does not interpret."""
    text = printable(text.replace("\n", " "))
    return re.sub(r"[\\`*_<\[#&]", r"\\\g<0>", text)


def _code(text: str) -> str:
    """Return text as code; its fence is longer than any run of backticks in it."""
    text = printable(text.replace("\n", " "))
    if "`" not in text:
        return f"`{text}`"
    fence = "`" * (1 + max(len(row) for row in re.findall("`+", text)))
    return f"{fence} {text} {fence}"
