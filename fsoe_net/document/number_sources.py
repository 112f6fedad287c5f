"""Marks for the sources of the numbers of a table, one per column if all its numbers share it."""

from __future__ import annotations

from fsoe_net.document.model import Number, Table

_LETTERS = "abcdefghijklmnopqrstuvwxyz"


class Sources:
    """Sources of one table.

    Attributes:
        legend: Mark and source, in the order of appearance.
    """

    def __init__(self, table: Table) -> None:
        per_column: dict[int, list[str]] = {}
        names: dict[str, str] = {}
        for row in table.rows:
            for n, cell in enumerate(row):
                for item in cell:
                    if isinstance(item, Number) and item.source:
                        names.setdefault(item.source, _mark(len(names)))
                        found = per_column.setdefault(n, [])
                        if item.source not in found:
                            found.append(item.source)
        self._names = names
        self._single = {n: s[0] for n, s in per_column.items() if len(s) == 1}
        self.legend = tuple((mark, source) for source, mark in names.items())

    def head(self, column: int) -> str:
        """Return the mark at the head of a column; empty if its cells have their own marks."""
        return _raised(self._names[self._single[column]]) if column in self._single else ""

    def mark(self, number: Number, column: int) -> str:
        """Return the mark after a number; empty if the head of its column has it."""
        if column in self._single or not number.source:
            return ""
        return _raised(self._names[number.source])


def _mark(count: int) -> str:
    rest, letter = divmod(count, len(_LETTERS))
    return (_mark(rest - 1) if rest else "") + _LETTERS[letter]


def _raised(mark: str) -> str:
    return f" ({mark})"
