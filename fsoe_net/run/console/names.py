"""What users write for names, values, times and objects, and what it stands for."""

from __future__ import annotations

import difflib
import fnmatch
import re
from collections.abc import Iterable, Iterator, Sequence

from fsoe_net.errors import ConsoleError
from fsoe_net.model.times import time_ns
from fsoe_net.run.control_values import Symbol, Value

__all__ = ["SymbolNames", "batches", "number", "object_address", "seconds", "shown", "value_of"]

_MOST_S = 7 * 24 * 3600.0
_WORDS = {"true": True, "on": True, "false": False, "off": False}
_MOST_TO_TELL = 12
_MOST_NAMES = 200  # of 256 words and 8192 bytes of a request
_MOST_BYTES = 7_000


class SymbolNames:
    """The symbols of the plan and the ways to write them.

    ``drive_1.0x6040:00``, ``drive_1.0x6040`` when it has one subindex only, ``drive_1.velocity``
    (the driver's interface), ``drive_*.0x6040:00``; ``all.0x6040`` of each SubDevice; ``drive_1``
    or ``all`` for everything.
    """

    def __init__(self, symbols: Sequence[Symbol]) -> None:
        self.symbols = tuple(symbols)
        self.by_name = {s.name: s for s in symbols}
        self.subdevices = tuple(dict.fromkeys(s.subdevice for s in symbols))

    def some(self, text: str) -> list[str]:
        """Return the names a word stands for, in plan order.

        Raises:
            ConsoleError: It stands for nothing.
        """
        if text == "all":
            return [s.name for s in self.symbols]
        if text in self.subdevices:
            return [s.name for s in self.symbols if s.subdevice == text]
        pattern = "*." + text.removeprefix("all.") if text.startswith("all.") else text
        if any(c in pattern for c in "*?["):
            found = _like(pattern.lower(), [s.name for s in self.symbols])
            if not found:
                raise ConsoleError(f"no input or output is called like {text}; list shows them")
            return found
        return [self.one(text)]

    def one(self, text: str) -> str:
        """Return the name a word stands for; raises as `some`."""
        found = self._match(text, self.symbols)
        if found is None:
            raise ConsoleError(f"no input or output is called {text}{self._hint(text)}")
        return found

    def proper(self, name: str) -> str:
        """Return the name `symbols` has for one that may be of a driver's interface."""
        outputs = (s for s in self.symbols if s.is_output and s.interface)
        return next((s.name for s in outputs if f"{s.subdevice}.{s.interface}" == name), name)

    def outputs_of(self, scope: str, entry: str) -> list[str]:
        """Return the outputs ``SUBDEVICE.ENTRY``; for ``all``, of each SubDevice that has it."""
        scopes = self.subdevices if scope == "all" else (scope,)
        outputs = [s for s in self.symbols if s.is_output]
        found = [self._match(f"{one}.{entry}", outputs) for one in scopes]
        names = [name for name in found if name is not None]
        if not names:
            owner = "no SubDevice has an" if scope == "all" else f"{scope} has no"
            entries = list(dict.fromkeys(s.entry for s in outputs if scope in ("all", s.subdevice)))
            hint = _nearest(entry, entries) or "; list shows the names"
            raise ConsoleError(f"{owner} output {entry}{hint}")
        return names

    def _match(self, text: str, symbols: Sequence[Symbol]) -> str | None:
        """Return the one symbol of this name, of this interface, or of this index."""
        low = text.lower()
        for exact in (text, low):
            if exact in self.by_name and self.by_name[exact] in symbols:
                return exact
        found = [s.name for s in symbols if s.name.lower() == low]
        found = found or [s.name for s in symbols if s.name.lower().rpartition(":")[0] == low]
        if not found and any(
            s.interface and f"{s.subdevice}.{s.interface}" == text for s in symbols
        ):
            return text  # the server knows it by this name too
        return found[0] if len(found) == 1 else None

    def _hint(self, text: str) -> str:
        owner, _, entry = text.partition(".")
        of_owner = [s for s in self.symbols if s.subdevice == owner]
        if not of_owner or not entry:
            return _nearest(text, [*self.by_name, *self.subdevices]) or "; list shows the names"
        # an entry with a name is not known by its index: another index would be a wrong guess
        by_index = entry.lower().startswith("0x") and any("0x" not in s.entry for s in of_owner)
        near = "" if by_index else _nearest(text, [s.name for s in of_owner])
        names = list(dict.fromkeys(s.entry for s in of_owner))
        more = f" and {len(names) - _MOST_TO_TELL} more" if len(names) > _MOST_TO_TELL else ""
        return near or f"; {owner} has {', '.join(names[:_MOST_TO_TELL])}{more}"


def _like(pattern: str, names: Sequence[str]) -> list[str]:
    """Return the names of a pattern; without a subindex in it, those of the index."""
    whole = [n for n in names if fnmatch.fnmatchcase(n.lower(), pattern)]
    return whole or [n for n in names if fnmatch.fnmatchcase(n.lower().rpartition(":")[0], pattern)]


def _nearest(text: str, names: Sequence[str]) -> str:
    close = difflib.get_close_matches(text, names, n=1, cutoff=0.6)
    return f"; did you mean {close[0]}?" if close else ""


def batches(names: Iterable[str]) -> Iterator[list[str]]:
    """Yield names in portions that one request can hold."""
    portion: list[str] = []
    size = 0
    for name in names:
        if portion and (len(portion) >= _MOST_NAMES or size + len(name) > _MOST_BYTES):
            yield portion
            portion, size = [], 0
        portion.append(name)
        size += len(name.encode()) + 4
    if portion:
        yield portion


def number(text: str, what: str, most: int | None = None) -> int:
    """Return a whole number, decimal or ``0x`` ``0o`` ``0b``.

    Raises:
        ConsoleError: It is not a number, or is negative or more than ``most``.
    """
    try:
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
        ConsoleError: It is not a time, or more than a week.
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
        ConsoleError: It is no object.
    """
    index, colon, sub = text.partition(":")
    found = number(index, "index", 0xFFFF)
    if not colon:
        return found, 0
    if not re.fullmatch(r"[0-9A-Fa-f]{1,2}", sub):
        raise ConsoleError(
            f"{sub[:24]!r} is no subindex; hexadecimal as in 0x1c12:0a", is_usage=True
        )
    return found, int(sub, 16)


def value_of(text: str) -> Value:
    """Return a value of a condition.

    Raises:
        ConsoleError: It is not a value of this type.
    """
    if text in _WORDS:
        return _WORDS[text]
    try:
        return int(text, 0)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        raise ConsoleError(
            f"{text[:40]!r} is no value; write 12, 0x0c, 1.5 or true", is_usage=True
        ) from None


def shown(value: Value, symbol: Symbol | None = None) -> str:
    """Return a value for people; whole numbers without a sign in hexadecimal too."""
    if value is None:
        return "no number"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.10g}"
    if symbol is not None and symbol.kind in ("unsigned", "bits") and symbol.bits > 4:
        return f"{value}  {value:#0{2 + (symbol.bits + 3) // 4}x}"
    return str(value)
