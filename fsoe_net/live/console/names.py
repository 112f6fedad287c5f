"""Notation for names, values, times and objects in the console."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterable, Iterator, Sequence

from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.errors import ConsoleError
from fsoe_net.live.control_values import Symbol, Value
from fsoe_net.model.symbols import directed_names
from fsoe_net.model.times import time_ns

_MOST_S = 7 * 24 * 3600.0
_WORDS = {"true": True, "on": True, "false": False, "off": False}
_MOST_TO_TELL = 12
_MOST_NAMES = 200  # a request is limited to 256 words and 8192 bytes
_MOST_BYTES = 7_000


class SymbolNames:
    """The symbols of the plan and their notation.

    ``drive_1.0x6040:00``, ``drive_1.0x6040`` if it has only one subindex, ``drive_*.0x6040:00``;
    ``all.0x6040`` for each SubDevice; ``drive_1`` or ``all`` for everything. A word selects inputs
    and outputs of that name; the prefix ``in:`` or ``out:`` restricts it.
    """

    def __init__(self, symbols: Sequence[Symbol]) -> None:
        self.symbols = tuple(symbols)
        self.subdevices = tuple(dict.fromkeys(s.subdevice for s in symbols))
        labels = directed_names([(s.is_output, s.name) for s in symbols])
        self._labels = {(s.is_output, s.name): n for s, n in zip(symbols, labels, strict=True)}

    @property
    def labels(self) -> list[str]:
        """A unique name for each symbol."""
        return list(self._labels.values())

    def label(self, symbol: Symbol) -> str:
        """Return the name of a symbol, with ``in:`` or ``out:`` if two symbols share it."""
        return self._labels[symbol.is_output, symbol.name]

    def some(self, text: str) -> list[Symbol]:
        """Return the symbols that a word selects, in plan order.

        Raises:
            ConsoleError: The word selects nothing.
        """
        side, word = _split(text)
        symbols = [s for s in self.symbols if side is None or s.is_output is side]
        if word == "all":
            return symbols
        if word in self.subdevices:
            return [s for s in symbols if s.subdevice == word]
        pattern = "*." + word.removeprefix("all.") if word.startswith("all.") else word
        # Patterns are compared in lower case, as are exact names.
        if any(c in pattern for c in "*?["):
            found = _like(pattern.lower(), symbols)
            if not found:
                raise ConsoleError(f"no {_noun(side)} is called like {word}; list shows them")
            return found
        found = _match(word, symbols)
        if not found:
            raise ConsoleError(f"no {_noun(side)} is called {word}{self._hint(word, symbols)}")
        return found

    def outputs(self, text: str) -> list[str]:
        """Return the names of the outputs that a word selects; errors as in `some`."""
        symbols = self.some(text)
        outputs = [s.name for s in symbols if s.is_output]
        if not outputs:
            if len(symbols) == 1:
                raise ConsoleError(f"{symbols[0].name} is an input and cannot be set")
            raise ConsoleError(f"{text} selects inputs only; list shows the outputs")
        return outputs

    def outputs_of(self, scope: str, entry: str) -> list[str]:
        """Return the outputs ``SUBDEVICE.ENTRY``; for ``all``, of each SubDevice with it."""
        scopes = self.subdevices if scope == "all" else (scope,)
        outputs = [s for s in self.symbols if s.is_output]
        names = [s.name for one in scopes for s in _match(f"{one}.{entry}", outputs)]
        # An empty selection is an error: `set all.x 1` with a typing error must not succeed
        # silently.
        if not names:
            owner = "no SubDevice has an" if scope == "all" else f"{scope} has no"
            entries = list(dict.fromkeys(s.entry for s in outputs if scope in ("all", s.subdevice)))
            hint = _nearest(entry, entries) or "; list shows the names"
            raise ConsoleError(f"{owner} output {entry}{hint}")
        return names

    def _hint(self, text: str, symbols: Sequence[Symbol]) -> str:
        owner, _, entry = text.partition(".")
        of_owner = [s for s in symbols if s.subdevice == owner]
        if not of_owner or not entry:
            known = [*(s.name for s in symbols), *self.subdevices]
            return _nearest(text, known) or "; list shows the names"
        # a named entry has no known index, and another index would be a wrong guess
        by_index = entry.lower().startswith("0x") and any("0x" not in s.entry for s in of_owner)
        names = list(dict.fromkeys(s.entry for s in of_owner))
        near = "" if by_index else _nearest(entry, names, before=f"{owner}.")
        more = f" and {len(names) - _MOST_TO_TELL} more" if len(names) > _MOST_TO_TELL else ""
        return near or f"; {owner} has {', '.join(names[:_MOST_TO_TELL])}{more}"


def _split(text: str) -> tuple[bool | None, str]:
    """Return whether a word selects outputs (``out:``) or inputs (``in:``), and the rest."""
    side = {"in": False, "out": True}.get(text.partition(":")[0])
    return side, text if side is None else text.partition(":")[2]


def _noun(side: bool | None) -> str:
    return {None: "input or output", True: "output", False: "input"}[side]


def _match(text: str, symbols: Sequence[Symbol]) -> list[Symbol]:
    """Return the symbols with this name, or with this index if each side has only one."""
    low = text.lower()
    # From strict to tolerant: an exact name must never be hidden by one that differs only in case.
    for matches in (
        [s for s in symbols if s.name == text],
        [s for s in symbols if s.name.lower() == low],
        [s for s in symbols if s.name.lower().rpartition(":")[0] == low],
    ):
        sides = [s.is_output for s in matches]
        if matches:
            # Two matches on one side are ambiguous: a value must never be written on a guess.
            return matches if len(set(sides)) == len(sides) else []
    return []


def _like(pattern: str, symbols: Sequence[Symbol]) -> list[Symbol]:
    """Return the symbols that match a pattern; without a subindex, those of the index."""
    names = [(s, s.name.lower()) for s in symbols]
    whole = [s for s, name in names if fnmatch.fnmatchcase(name, pattern)]
    return whole or [s for s, n in names if fnmatch.fnmatchcase(n.rpartition(":")[0], pattern)]


def _nearest(text: str, names: Sequence[str], before: str = "") -> str:
    close = [f"{before}{name}" for name in guesses(text, names)]
    return f"; did you mean {one_of(close)}?" if close else ""


def batches(names: Iterable[str]) -> Iterator[list[str]]:
    """Yield names in batches that fit into one request."""
    portion: list[str] = []
    size = 0
    for name in names:
        # The limits are those of a request line of fsn-master.
        if portion and (len(portion) >= _MOST_NAMES or size + len(name) > _MOST_BYTES):
            yield portion
            portion, size = [], 0
        portion.append(name)
        size += len(name.encode()) + 4
    if portion:
        yield portion


def number(text: str, what: str, most: int | None = None) -> int:
    """Return a non-negative integer, decimal or with ``0x``, ``0o`` or ``0b``.

    Raises:
        ConsoleError: The text is not a number, or the number is negative or more than ``most``.
    """
    try:
        # `int` needs quadratic time for long texts; 64 bits and a prefix fit in 66 characters.
        found = int(text, 0) if len(text) <= 66 else -1
    except ValueError:
        raise ConsoleError(f"{text!r} is no {what}; write 12 or 0x0c", is_usage=True) from None
    if found < 0 or (most is not None and found > most):
        limit = "" if most is None else f" to {most}"
        raise ConsoleError(f"{text[:24]}: a {what} is a number from 0{limit}", is_usage=True)
    return found


def seconds(text: str) -> float:
    """Return a time in seconds.

    Raises:
        ConsoleError: The text is not a time, or the time is more than a week.
    """
    ns = time_ns(text)
    if ns is None:
        raise ConsoleError(f"{text[:24]!r} is not a time; write 500us, 20ms or 2s", is_usage=True)
    found = ns / 1e9
    if found > _MOST_S:
        raise ConsoleError(f"{text} is more than a week", is_usage=True)
    return found


def object_address(text: str) -> tuple[int, int]:
    """Return index and subindex of ``0x6041:00``; the subindex is hexadecimal, as in names.

    Raises:
        ConsoleError: Not a valid object.
    """
    index, colon, sub = text.partition(":")
    found = number(index, "index", 0xFFFF)
    if not colon:
        return found, 0
    if not re.fullmatch(r"[0-9A-Fa-f]{1,2}", sub):
        raise ConsoleError(
            f"{sub[:24]!r} is not a subindex; hexadecimal as in 0x1c12:0a", is_usage=True
        )
    return found, int(sub, 16)


def shown(value: Value, symbol: Symbol | None = None) -> str:
    """Return a value as text; unsigned values and bits also in hexadecimal."""
    if value is None:
        return "no number"
    # Before the test for float and int: in Python a `bool` is an `int`.
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.10g}"
    if symbol is not None and symbol.kind in ("unsigned", "bits") and symbol.bits > 4:
        return f"{value}  {value:#0{2 + (symbol.bits + 3) // 4}x}"
    return str(value)
