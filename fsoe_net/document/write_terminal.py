"""A document for terminals of any width, and as plain text.

A narrow terminal shows fewer columns, never truncated names; plain text has all columns.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from fsoe_net.diag.printable import printable
from fsoe_net.document.model import (
    Bullets,
    Column,
    Document,
    Heading,
    Item,
    Level,
    Lines,
    Number,
    Paragraph,
    Part,
    Style,
    Table,
    Verdict,
    muted,
)

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.text import Text

_GAP = 2  # cells between two columns
_WRAPPED = 24  # minimum width of a column of sentences, in cells
_UNLIMITED = 1_000_000
_TEXT_WIDTH = 100  # of running text, on a wider terminal
_LEVELS = {
    Level.CLEAR: "green",
    Level.NOTE: "cyan",
    Level.OPEN: "yellow",
    Level.WARNING: "yellow",
    Level.ERROR: "red",
}
_RUNNING = (Paragraph, Bullets)
_STYLES = {
    Style.PLAIN: "",
    Style.MUTED: "dim",
    Style.STRONG: "bold",
    Style.CODE: "",
    Style.BLANK: "",
}


class TerminalView:
    """A renderable for `rich`, which can also be updated in place.

    Args:
        document: Texts in it may be of any origin; they cannot control the terminal.
    """

    def __init__(self, document: Document) -> None:
        self._document = document

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the document for this width."""
        from rich.text import Text

        d = self._document
        if d.title:
            yield Text(_safe(d.title), style="bold")
        if d.subtitle:
            yield Text(_safe(d.subtitle), style="dim")
        if d.verdict is not None:
            yield _text((d.verdict,))
        begun = bool(d.title or d.verdict)
        if begun and d.lead:
            yield Text()
        yield from _parts(d.lead, console, options)
        begun |= bool(d.lead)
        for section in d.sections:
            if begun:
                yield Text()
            begun = True
            yield Text(_safe(section.title), style="bold")
            line = min(Text(section.title).cell_len, options.max_width)
            yield Text("─" * line, style="dim")
            yield from _parts(section.parts, console, options)


def document_text(document: Document, *, width: int | None = _TEXT_WIDTH) -> str:
    """Return the document as plain text; each line ends in a line break.

    Args:
        document: Document to write.
        width: Width of running text, ``None`` for whole paragraphs; tables use their natural width.
    """
    from rich.console import Console

    console = Console(file=io.StringIO(), width=width or _UNLIMITED, color_system=None)
    text = "".join(segment.text for segment in console.render(TerminalView(document)))
    return "\n".join(line.rstrip() for line in text.split("\n"))


def _parts(
    parts: Sequence[Part], console: Console, options: ConsoleOptions
) -> Iterator[Text | _FittedTable]:
    """Yield parts, separated by empty lines except between running text and after a heading."""
    from rich.text import Text

    width = min(options.max_width, _TEXT_WIDTH) if console.is_terminal else options.max_width
    before: Part | None = None
    for part in parts:
        follows = isinstance(part, (*_RUNNING, Lines)) and isinstance(before, _RUNNING)
        if before is not None and not follows and not isinstance(before, Heading):
            yield Text()
        yield from _part(part, console, width)
        before = part


def _part(part: Part, console: Console, width: int) -> Iterator[Text | _FittedTable]:
    from rich.text import Text

    if isinstance(part, Heading):
        yield Text(_safe(part.text), style="bold")
    elif isinstance(part, Paragraph):
        yield from _wrapped(part.items, console, width)
    elif isinstance(part, Bullets):
        for row in part.rows:
            yield from _wrapped(row, console, width, first="- ")
    elif isinstance(part, Table):
        yield _FittedTable(part)
        if part.remark:
            yield from _wrapped((muted(part.remark),), console, width)
    else:
        for line in part.lines:
            yield Text(_safe(line), no_wrap=True, overflow="ignore")


def _wrapped(
    items: Sequence[Item], console: Console, width: int, first: str = ""
) -> Iterator[Text]:
    """Yield running text; further lines are indented to the first word."""
    from rich.text import Text

    text = _text(items, between="")
    room = max(width - len(first), 1)
    fits = "\n" not in text.plain and text.cell_len <= room
    for n, line in enumerate([text] if fits else text.wrap(console, room) or [text]):
        yield Text(first if n == 0 else " " * len(first)) + line


def _text(items: Sequence[Item], between: str = "\n") -> Text:
    from rich.text import Text

    return Text(between).join(_item(i) for i in items)


def _item(item: Item) -> Text:
    from rich.text import Text

    if isinstance(item, Verdict):
        return Text(_safe(item.word), style=_LEVELS[item.level])
    if isinstance(item, Number):
        return Text(_safe(f"{item.text} {item.unit}".rstrip()))
    return Text(_safe(item.text), style=_STYLES[item.style])


def _safe(text: str) -> str:
    return printable(text, keep="\n")


class _FittedTable:
    """A table as wide as its columns need; omitted columns are named below it."""

    def __init__(self, table: Table) -> None:
        self._table = table
        self._columns: Sequence[Column] = table.columns
        self._rows = [[_text(c) for c in row] for row in table.rows]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the table for this width."""
        from rich.table import Table as RichTable
        from rich.text import Text

        if not self._rows:
            yield Text("none", style="dim")
            return
        needs = [self._need(n, console) for n in range(len(self._columns))]
        width = options.max_width if console.is_terminal else sum(needs) + _GAP * len(needs)
        shown = self._fitting(needs, width)
        table = RichTable(
            box=None,
            pad_edge=False,
            padding=(0, _GAP, 0, 0),
            show_header=any(c.title for c in self._columns),
            header_style="bold",
        )
        for n in shown:
            column = self._columns[n]
            table.add_column(
                Text(_safe(column.title)),
                justify="right" if column.number else "left",
                no_wrap=column.rank > 0 and not column.wraps,
                overflow="fold",
            )
        for row in self._rows:
            table.add_row(*(row[n] for n in shown))
        # Plain text has all columns, even if they exceed the width of the console.
        yield from console.render(table, options.update(max_width=width))
        left = [c.title for n, c in enumerate(self._columns) if n not in shown]
        if left:
            yield Text(f"too narrow for: {', '.join(left)}", style="dim")

    def _fitting(self, needs: Sequence[int], width: int) -> list[int]:
        """Return the columns that fit, by their number."""
        shown = list(range(len(self._columns)))
        while sum(needs[n] + _GAP for n in shown) - _GAP > width:
            # The least important column goes first; rank 0 is never left out.
            last = max(shown, key=lambda n: self._columns[n].rank)
            if self._columns[last].rank == 0:
                break
            shown.remove(last)
        return shown

    def _need(self, number: int, console: Console) -> int:
        from rich.cells import cell_len

        column = self._columns[number]
        title = cell_len(column.title)
        lines = [line for row in self._rows for line in row[number].plain.split("\n")]
        need = max([title, *map(cell_len, lines)])
        return min(need, max(_WRAPPED, title)) if column.wraps and console.is_terminal else need
