"""Tables for terminals of any width: a narrow one has fewer columns, never half a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult

__all__ = ["Column", "FittedTable"]

_GAP = 2  # cells between two columns
_WRAPPED = 24  # cells that a column of sentences needs at least


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of a `FittedTable`.

    Attributes:
        head: Its head.
        rank: Columns of the highest rank are left out first; those of 0 never.
        is_number: Stands at the right.
        wraps: Holds sentences, which may take several lines.
    """

    head: str
    rank: int
    is_number: bool = False
    wraps: bool = False


class FittedTable:
    """A table as wide as its columns need; what does not fit is left out, and named below.

    Args:
        columns: From left to right.
        rows: Cells, in the markup of rich.
        title: Line above it.
    """

    def __init__(
        self, columns: Sequence[Column], rows: Sequence[Sequence[str]], *, title: str = ""
    ) -> None:
        self._columns = columns
        self._rows = rows
        self._title = title

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the table for this width."""
        from rich import box
        from rich.table import Table
        from rich.text import Text

        shown = self._fitting(options.max_width)
        table = Table(
            title=self._title or None,
            title_justify="left",
            box=box.SIMPLE_HEAD,
            pad_edge=False,
            padding=(0, 1),
        )
        for n in shown:
            column = self._columns[n]
            table.add_column(
                column.head,
                justify="right" if column.is_number else "left",
                no_wrap=column.rank > 0 and not column.wraps,
                overflow="fold",
            )
        for row in self._rows:
            table.add_row(*(row[n] for n in shown))
        yield table
        left = [c.head for n, c in enumerate(self._columns) if n not in shown]
        if left:
            yield Text(f"too narrow for: {', '.join(left)}", style="dim")

    def _fitting(self, width: int) -> list[int]:
        """Return the columns that fit, by their number."""
        shown = list(range(len(self._columns)))
        needs = [self._need(n) for n in shown]
        while sum(needs[n] + _GAP for n in shown) > width:
            last = max(shown, key=lambda n: self._columns[n].rank)
            if self._columns[last].rank == 0:
                break
            shown.remove(last)
        return shown

    def _need(self, number: int) -> int:
        from rich.text import Text

        column = self._columns[number]
        cells = [column.head, *(row[number] for row in self._rows)]
        need = max(Text.from_markup(c).cell_len for c in cells)
        return min(need, max(_WRAPPED, len(column.head))) if column.wraps else need
