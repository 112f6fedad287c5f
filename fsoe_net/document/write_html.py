"""The report as one HTML file: no script, light and dark, prints to A4 with a head on each page."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.document.markup import escape
from fsoe_net.document.model import (
    Block,
    Bullets,
    Cell,
    Document,
    Heading,
    Item,
    Level,
    Number,
    Paragraph,
    Part,
    Picture,
    Style,
    Table,
    Verdict,
)
from fsoe_net.document.number_sources import Sources
from fsoe_net.document.style import STYLE

__all__ = ["report_html"]

_MARKS = {
    Level.CLEAR: "○",
    Level.NOTE: "i",
    Level.OPEN: "?",
    Level.WARNING: "!",
    Level.ERROR: "✕",
}


def report_html(document: Document) -> str:
    """Return the report as one self-contained page."""
    d = document
    title = f"{d.project}: FSoE network {d.network}"
    short = d.short or "NO FINGERPRINT"
    head = (
        f"<b>{escape(d.project)}</b> · FSoE network {escape(d.network)} · "
        f'<span class="seal">{escape(short)}</span>'
    )
    body = [
        _first(d, short),
        *(_block(n, b) for n, b in enumerate(d.blocks, 1)),
    ]
    foot = (
        f"{escape(d.verdict.word)} · black channel configuration, evidence and no certificate · "
        f"fsoe-net {escape(d.version)}"
    )
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}'
        '</title><meta name="viewport" content="width=device-width,initial-scale=1">'
        f'<style>{STYLE}</style></head><body>\n<table class="sheet" role="presentation"><thead>'
        f'<tr><td><div class="pagehead">{head}</div></td></tr></thead><tfoot><tr><td>'
        f'<div class="pagefoot">{foot}</div></td></tr></tfoot><tbody><tr><td>\n'
        f"{chr(10).join(body)}\n</td></tr></tbody></table>\n</body></html>\n"
    )


def _first(d: Document, short: str) -> str:
    level = d.verdict.level.value
    rows = [
        f"<h1>{escape(d.project)}</h1>",
        f'<p class="under">FSoE network {escape(d.network)}: configuration report by fsoe-net '
        f"{escape(d.version)}</p>",
        f'<p class="banner {level}"><span class="mark">{_MARKS[d.verdict.level]}</span> '
        f"{escape(d.verdict.word)}</p>",
        f'<p class="sealbox">Fingerprint <span class="seal">{escape(short)}</span></p>',
        *(_part(p) for p in d.lead),
        '<nav><h3>Blocks</h3><ol class="toc">',
        *(f'<li><a href="#{escape(b.key)}">{escape(b.title)}</a></li>' for b in d.blocks),
        "</ol></nav>",
    ]
    return f'<header class="first">{"".join(rows)}</header>'


def _block(number: int, b: Block) -> str:
    parts: list[str] = []
    small: list[str] = []
    for part in b.parts:
        if isinstance(part, Picture) and not part.wide:
            small.append(_part(part))
            continue
        if small:
            parts.append(f'<div class="pictures">{"".join(small)}</div>')
            small = []
        parts.append(_part(part))
    if small:
        parts.append(f'<div class="pictures">{"".join(small)}</div>')
    head = f'<h2><span class="no">{number}</span> {escape(b.title)}</h2>'
    return f'<section id="{escape(b.key)}">{head}{"".join(parts)}</section>'


def _part(part: Part) -> str:
    if isinstance(part, Heading):
        return f"<h3>{escape(part.text)}</h3>"
    if isinstance(part, Paragraph):
        text = "".join(_item(i) for i in part.items)
        return f'<p class="note">{text}</p>' if part.note else f"<p>{text}</p>"
    if isinstance(part, Bullets):
        rows = "".join(f"<li>{''.join(_item(i) for i in row)}</li>" for row in part.rows)
        return f"<ul>{rows}</ul>"
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
    rows = []
    for row in table.rows:
        cells = []
        for n, (column, cell) in enumerate(zip(table.columns, row, strict=True)):
            label = f' data-head="{escape(column.title + sources.head(n))}"'
            cells.append(f"<td{_numeric(column.number)}{label}>{_cell(cell, sources, n)}</td>")
        rows.append(f"<tr>{''.join(cells)}</tr>")
    blank = any(i for row in table.rows for c in row for i in c if _is_blank(i))
    parts = [
        f'<table class="data{" sign" if blank else ""}"><thead><tr>{heads}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table>"
    ]
    below = []
    if table.remark:
        below.append(escape(table.remark))
    if sources.legend:
        legend = "; ".join(f"<sup>{mark}</sup> {escape(text)}" for mark, text in sources.legend)
        below.append(f"Sources: {legend}.")
    if below:
        parts.append(f'<p class="below">{"<br>".join(below)}</p>')
    return "".join(parts)


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
            f'<span class="v {item.level.value}"><span class="mark">{_MARKS[item.level]}</span> '
            f"{escape(item.word)}</span>"
        )
    if isinstance(item, Number):
        unit = f' <span class="unit">{escape(item.unit)}</span>' if item.unit else ""
        return f'<span class="n" title="{escape(item.source)}">{escape(item.text)}{unit}</span>'
    text = escape(item.text)
    if item.style is Style.CODE:
        return f"<code>{text}</code>"
    if item.style is Style.STRONG:
        return f"<b>{text}</b>"
    if item.style is Style.MUTED:
        return f'<span class="muted">{text}</span>' if text else ""
    return '<span class="blank"></span>' if item.style is Style.BLANK else text
