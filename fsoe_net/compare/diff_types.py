"""One difference, as data."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

from fsoe_net.diag.words import listed

Fact = int | str | None
_T = TypeVar("_T")


class ChangeKind(enum.StrEnum):
    """What happened to an item."""

    ADDED = "added"
    REMOVED = "removed"
    EXCHANGED = "exchanged"
    MOVED = "moved"
    CHANGED = "changed"


class ChangeArea(enum.StrEnum):
    """The area of a change; the value is the word in documents."""

    NETWORK = "network"
    SUBDEVICE = "subdevice"
    SYNC_MANAGER = "sync_manager"
    FRAME = "frame"
    ENTRIES = "entries"
    SDO = "sdo"
    COPY = "copy"
    CONNECTION = "connection"
    SAFETY_FUNCTION = "safety_function"


_MARK = {ChangeKind.ADDED: "+", ChangeKind.REMOVED: "-"}


@dataclass(frozen=True, slots=True)
class Change:
    """One difference.

    Attributes:
        kind: Kind of change.
        area: Area of the change.
        where: SubDevice, sync manager, copy or connection, named as in A.
        what: The changed fact; empty for an item added or removed as a whole.
        before: In A.
        after: In B.
        entries: Addresses of the entries that changed together.
        subdevices: Names of the SubDevices concerned, in A and in B; for a copy or a connection
            those of its ends. An empty name: a SubDevice without a name, or an unknown one.
    """

    kind: ChangeKind
    area: ChangeArea
    where: str
    what: str = ""
    before: Fact = None
    after: Fact = None
    entries: tuple[str, ...] = ()
    subdevices: tuple[str, ...] = ()

    @property
    def listed_entries(self) -> str:
        """The first entries, and the number of further ones."""
        return listed(self.entries, 6)

    def __str__(self) -> str:
        """Return it as one line: ``~ connection a - b changed: watchdog 100 ms -> 120 ms``."""
        area = self.area.replace("_", " ")
        mark = _MARK.get(self.kind, "~")
        text = " ".join(w for w in (mark, area, self.where, self.kind) if w)
        if self.entries:
            text += f": {self.listed_entries}"
        value = self._value()
        if self.what and value:
            return f"{text}: {self.what} {value}"
        return f"{text}: {value}" if value else text

    def _value(self) -> str:
        both = (self.before, self.after)
        if self.kind in _MARK:
            stated = self.after if self.before is None else self.before
            return "" if both == (None, None) else str(stated)
        if self.kind is ChangeKind.MOVED and self.before is None:
            return str(self.after)
        return " -> ".join(_fact_text(fact) for fact in both)


def _fact_text(fact: Fact) -> str:
    if fact is None:
        return "not stated"
    return "empty" if fact == "" else str(fact)


def changed_part(
    area: ChangeArea,
    where: str,
    old: _T | None,
    new: _T | None,
    text: Callable[[_T], Fact],
    what: str = "",
    subdevices: tuple[str, ...] = (),
) -> Change:
    """Return the change of a part that is ``None`` on a side without it.

    ``text`` returns the value of the part in words.
    """
    before = None if old is None else text(old)
    after = None if new is None else text(new)
    kind = ChangeKind.CHANGED
    if old is None or new is None:
        kind = ChangeKind.ADDED if old is None else ChangeKind.REMOVED
    return Change(kind, area, where, what, before, after, (), subdevices)


def changed_facts(
    area: ChangeArea,
    where: str,
    *facts: tuple[str, Fact, Fact],
    whole: bool = False,
    subdevices: tuple[str, ...] = (),
) -> Iterator[Change]:
    """Yield a change for each fact whose values differ.

    Args:
        area: Area of the changes.
        where: Part that has these facts.
        facts: Name of each fact, its value in A and in B.
        whole: ``None`` means *not set*; otherwise it means *not stated* and is not compared.
        subdevices: Names of the SubDevices concerned.
    """
    for what, before, after in facts:
        if before != after and (whole or None not in (before, after)):
            yield Change(ChangeKind.CHANGED, area, where, what, before, after, (), subdevices)


def size_text(bits: int | None) -> str | None:
    """Return a length in bytes, or in bits if it is not a multiple of 8."""
    if bits is None:
        return None
    return f"{bits} bits" if bits % 8 else f"{bits // 8} bytes"
