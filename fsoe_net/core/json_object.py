"""A JSON object written by another program: types and ranges of its values are checked."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fsoe_net.errors import IncidentError

_MOST = (1 << 64) - 1
_MOST_ROWS = 100_000
_TEXT = 4096


def clean(text: str, most: int = _TEXT) -> str:
    """Return a text printable on one line, without control characters or lone surrogates."""
    if len(text) <= most and text.isprintable():
        return text
    kept = "".join(
        c if c == " " or unicodedata.category(c)[0] != "C" else "\N{REPLACEMENT CHARACTER}"
        for c in text[:most]
    )
    return kept if len(text) <= most else f"{kept}..."


class JsonObject:
    """The values of one JSON object, and its location. Absent or null values are 0 or empty.

    Args:
        row: The object.
        name: Name of the file.
        line: Line in it, from 1.
        path: Keys that lead to the object, for messages.
    """

    def __init__(self, row: Mapping[str, Any], name: str, line: int, path: str = "") -> None:
        self._row = row
        self._at = name, line
        self._path = path

    def bad(self, key: str, reason: str) -> Exception:
        """Return the error for a value; the caller raises it."""
        return IncidentError(f"{self._path}{key} {reason}", *self._at)

    def has(self, key: str) -> bool:
        """Whether the key has a value other than null."""
        return self._row.get(key) is not None

    def whole(self, key: str, *, missing: int | None = None) -> int:
        """Return an integer from 0 to 2^64 - 1.

        Raises:
            IncidentError: The value is not such an integer, or it is absent and ``missing`` is
                ``None``.
        """
        value = self._row.get(key)
        if value is None and missing is not None:
            return missing
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= _MOST:
            raise self.bad(key, "is missing" if value is None else "must be a non-negative integer")
        return value

    def count(self, key: str) -> int:
        """Return a non-negative integer; 0 if absent."""
        return self.whole(key, missing=0)

    def empty(self) -> JsonObject:
        """Return an object without values at the same location; all its values may be absent."""
        return JsonObject({}, *self._at, self._path)

    def optional(self, key: str) -> int | None:
        """Return a non-negative integer, or ``None`` if it is absent or null."""
        return self.whole(key) if self.has(key) else None

    def flag(self, key: str) -> bool:
        """Return a boolean; false if absent."""
        value = self._row.get(key, False)
        if not isinstance(value, bool):
            raise self.bad(key, "is neither true nor false")
        return value

    def text(self, key: str, *, most: int | None = None) -> str:
        """Return a text; empty if absent or null. With ``most`` it is made printable."""
        value = self._row.get(key)
        if value is None:
            return ""
        if not isinstance(value, str):
            raise self.bad(key, "is not a text")
        return value if most is None else clean(value, most)

    def label(self, key: str) -> str:
        """Return a printable text."""
        return self.text(key, most=_TEXT)

    def numbers(self, key: str) -> tuple[int, ...]:
        """Return a list of non-negative integers; empty if absent or null."""
        rows = self._list(key)
        for value in rows:
            if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= _MOST:
                raise self.bad(key, "contains a value that is not an integer")
        return tuple(rows)

    def words(self, key: str, known: Sequence[str]) -> tuple[str, ...]:
        """Return the known words in a list; empty if absent or null."""
        rows = self._list(key)
        return tuple(word for word in known if word in rows)

    def pairs(self, key: str) -> tuple[tuple[int, int], ...]:
        """Return a list of pairs of non-negative integers."""
        found = []
        for row in self._list(key):
            good = isinstance(row, list) and len(row) == 2
            if not good or any(type(n) is not int or not 0 <= n <= _MOST for n in row):
                raise self.bad(key, "contains a value that is not a pair of numbers")
            found.append((row[0], row[1]))
        return tuple(found)

    def child(self, key: str) -> JsonObject:
        """Return an object; an empty one if absent or null."""
        value = self._row.get(key)
        if value is None:
            value = {}
        if not isinstance(value, dict):
            raise self.bad(key, "is not an object")
        return type(self)(value, *self._at, f"{self._path}{key}.")

    def children(self, key: str) -> Iterator[JsonObject]:
        """Yield the objects of a list; none if absent or null."""
        for number, value in enumerate(self._list(key)):
            if not isinstance(value, dict):
                raise self.bad(f"{key}[{number}]", "is not an object")
            yield type(self)(value, *self._at, f"{self._path}{key}[{number}].")

    def plain(self) -> dict[str, str]:
        """Return numbers and texts as printable texts; other values are omitted."""
        return {
            clean(key, 64): clean(str(value), 256)
            for key, value in self._row.items()
            if isinstance(value, str | int)
        }

    def _list(self, key: str) -> list[Any]:
        value = self._row.get(key)
        if value is None:
            return []
        if not isinstance(value, list):
            raise self.bad(key, "is not a list")
        if len(value) > _MOST_ROWS:
            raise self.bad(key, f"has more than {_MOST_ROWS} entries")
        return value


class ReplyObject(JsonObject):
    """The values of a reply of a running program; each value that is read is required.

    Texts are unchanged; code that prints them must make them printable.
    """

    def __init__(
        self, row: Mapping[str, Any], name: str = "reply", line: int = 0, path: str = ""
    ) -> None:
        super().__init__(row, name, line, path)

    def bad(self, key: str, reason: str) -> Exception:
        """Return the error for a value."""
        return ValueError(f"{self._path}{key} {reason}")

    def count(self, key: str) -> int:
        """Return a non-negative integer."""
        return self.whole(key)

    def label(self, key: str) -> str:
        """Return a text."""
        if key not in self._row:
            raise self.bad(key, "is missing")
        return self.text(key)

    def flag(self, key: str) -> bool:
        """Return a boolean."""
        if key not in self._row:
            raise self.bad(key, "is missing")
        return super().flag(key)

    def _list(self, key: str) -> list[Any]:
        if key not in self._row:
            raise self.bad(key, "is missing")
        return super()._list(key)
