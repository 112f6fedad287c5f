"""A document as one HTML file: no script, light and dark, printable on A4 with a page header."""

from __future__ import annotations

import re
from collections.abc import Sequence

from fsoe_net.document.markup import escape
from fsoe_net.document.model import (
    MARKS,
    Bullets,
    Cell,
    Document,
    Heading,
    Item,
    Lines,
    Number,
    Paragraph,
    Part,
    Picture,
    Section,
    Style,
    Table,
    Verdict,
    section_marks,
)
from fsoe_net.document.number_sources import Sources
from fsoe_net.document.style import STYLE

_LONGEST_WORD = 24


def document_html(document: Document) -> str:
    """Return the document as one self-contained page."""
    d = document
    head = " · ".join(w for w in (f"<b>{escape(d.title)}</b>", escape(d.subtitle)) if w)
    seal = f'<span class="seal">{escape(d.seal)}</span>' if d.seal else ""
    foot = " · ".join(w for w in (f"fsoe-net {escape(d.version)}", escape(d.foot)) if w)
    marks = section_marks(d.sections) if d.numbered else [""] * len(d.sections)
    sections = [_section(mark, s) for mark, s in zip(marks, d.sections, strict=True)]
    body = f"{_first(d)}\n<main>{chr(10).join(sections)}</main>"
    kind = ' class="landscape"' if d.landscape else ""
    title = escape(": ".join(w for w in (d.title, d.subtitle) if w))
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}'
        '</title><meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<style>{STYLE}</style></head><body{kind}>\n"
        # Browsers repeat thead and tfoot on each printed page, so no script is needed for both.
        '<table class="sheet" role="presentation"><thead>'
        f'<tr><td><div class="pagehead"><span>{head}</span>{seal}</div></td></tr></thead>'
        f'<tfoot><tr><td><div class="pagefoot">{foot}</div></td></tr></tfoot><tbody><tr><td>\n'
        f"{body}\n</td></tr></tbody></table>\n</body></html>\n"
    )


def _first(d: Document) -> str:
    made = f"fsoe-net {d.version}" if d.version else ""
    logo = f'<img class="logo" alt="" src="{escape(d.logo)}">' if d.logo else ""
    rows = [
        f"{logo}<h1>{escape(d.title)}</h1>",
        f'<p class="under">{escape(" by ".join(w for w in (d.subtitle, made) if w))}</p>',
    ]
    if d.title_block is not None:
        rows.append(_part(d.title_block))
    if d.verdict is not None:
        rows.append(
            f'<p class="banner {d.verdict.level.value}"><span class="mark">'
            f"{MARKS[d.verdict.level]}</span> {escape(d.verdict.word)}</p>"
        )
    if d.seal:
        rows.append(
            f'<p class="sealbox">Fingerprint <span class="seal">{escape(d.seal)}</span></p>'
        )
    rows += [_part(p, heading="h2") for p in d.lead]
    if d.numbered:
        links = (
            f'<li>{mark} <a href="#{escape(s.key)}">{escape(s.title)}</a></li>'
            for mark, s in zip(section_marks(d.sections), d.sections, strict=True)
        )
        rows.append(f'<nav><h2>Contents</h2><ul class="toc">{"".join(links)}</ul></nav>')
    return f'<header class="first">{"".join(rows)}</header>'


def _section(mark: str, section: Section) -> str:
    parts: list[str] = []
    small: list[str] = []
    for part in section.parts:
        if isinstance(part, Picture) and not part.wide:
            small.append(_part(part))
            continue
        if small:
            parts.append(f'<div class="pictures">{"".join(small)}</div>')
            small = []
        parts.append(_part(part))
    if small:
        parts.append(f'<div class="pictures">{"".join(small)}</div>')
    shown = f'<span class="no">{mark}</span> ' if mark else ""
    head = f"<h2>{shown}{escape(section.title)}</h2>"
    kind = ' class="page"' if section.page else ""
    return f'<section id="{escape(section.key)}"{kind}>{head}{"".join(parts)}</section>'


def _part(part: Part, *, heading: str = "h3") -> str:
    if isinstance(part, Heading):
        return f"<{heading}>{escape(part.text)}</{heading}>"
    if isinstance(part, Paragraph):
        text = "".join(_item(i) for i in part.items)
        return f'<p class="note">{text}</p>' if part.note else f"<p>{text}</p>"
    if isinstance(part, Bullets):
        rows = "".join(f"<li>{''.join(_item(i) for i in row)}</li>" for row in part.rows)
        return f"<ul>{rows}</ul>"
    if isinstance(part, Lines):
        return f"<pre>{escape(chr(10).join(part.lines))}</pre>"
    if isinstance(part, Table):
        return _table(part)
    narrow = f'<div class="narrow">{part.narrow}</div>' if part.narrow else ""
    return (
        f"<figure>{part.svg}{narrow}<figcaption><b>{escape(part.title)}</b>. {escape(part.words)}"
        "</figcaption></figure>"
    )


def _table(table: Table) -> str:
    if not table.rows:
        return '<p class="muted">none</p>'
    sources = Sources(table)
    heads = "".join(
        f"<th{_numeric(c.number)}>{escape(c.title)}{_raised(sources.head(n))}</th>"
        for n, c in enumerate(table.columns)
    )
    rows = "".join(f"<tr>{_row(table, row, sources)}</tr>" for row in table.rows)
    shares = "".join(f'<col style="width:{c.share}%">' for c in table.columns if c.share)
    kinds = ["data"]
    if any(_is_blank(item) for row in table.rows for cell in row for item in cell):
        kinds.append("sign")
    if shares:
        kinds.append("fixed")
        shares = f"<colgroup>{shares}</colgroup>"
    return (
        f'<table class="{" ".join(kinds)}">{shares}<thead><tr>{heads}</tr></thead>'
        f"<tbody>{rows}</tbody></table>{_below(table, sources)}"
    )


def _row(table: Table, row: Sequence[Cell], sources: Sources) -> str:
    cells = []
    for n, (column, cell) in enumerate(zip(table.columns, row, strict=True)):
        # On a narrow screen the style shows data-head in front of each cell.
        label = f' data-head="{escape(column.title + sources.head(n))}"'
        kinds = ["num"] * column.number + ["hand"] * any(map(_is_blank, cell))
        kind = f' class="{" ".join(kinds)}"' if kinds else ""
        cells.append(f"<td{kind}{label}>{_cell(cell, sources, n)}</td>")
    return "".join(cells)


def _below(table: Table, sources: Sources) -> str:
    below = []
    if table.remark:
        below.append(escape(table.remark))
    if sources.legend:
        legend = "; ".join(f"<sup>{mark}</sup> {escape(text)}" for mark, text in sources.legend)
        below.append(f"Sources: {legend}.")
    return f'<p class="below">{"<br>".join(below)}</p>' if below else ""


def _is_blank(item: Item) -> bool:
    return not isinstance(item, (Number, Verdict)) and item.style is Style.BLANK


def _numeric(number: bool) -> str:
    return ' class="num"' if number else ""


def _raised(mark: str) -> str:
    return f"<sup>{mark.strip(' ()')}</sup>" if mark else ""


def _cell(items: Cell | Sequence[Item], sources: Sources, column: int) -> str:
    rows = []
    for item in items:
        mark = sources.mark(item, column) if isinstance(item, Number) else ""
        text = _item(item) + _raised(mark)
        if text:
            rows.append(f"<div>{text}</div>")
    return "".join(rows)


def _item(item: Item) -> str:
    if isinstance(item, Verdict):
        return (
            f'<span class="v {item.level.value}"><span class="mark">{MARKS[item.level]}</span> '
            f"{_breakable(item.word)}</span>"
        )
    if isinstance(item, Number):
        unit = f' <span class="unit">{escape(item.unit)}</span>' if item.unit else ""
        return f'<span class="n" title="{escape(item.source)}">{escape(item.text)}{unit}</span>'
    if item.style is Style.CODE:
        return f"<code>{escape(item.text)}</code>"
    text = _breakable(item.text)
    if item.style is Style.STRONG:
        return f"<b>{text}</b>"
    if item.style is Style.MUTED:
        return f'<span class="muted">{text}</span>' if text else ""
    return '<span class="blank"></span>' if item.style is Style.BLANK else text


def _breakable(text: str) -> str:
    """Return an escaped text in which a very long word cannot widen a table beyond its page."""
    parts = re.split(rf"(\S{{{_LONGEST_WORD}}})(?=\S)", text)
    return "".join(f"{escape(p)}<wbr>" if n % 2 else escape(p) for n, p in enumerate(parts))
