"""Entries of a PDO on two sides, for rules that compare."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import Entry, Pdo
from fsoe_net.rules.context import few


@dataclass(frozen=True, slots=True)
class Item:
    """An entry for comparison: adjacent padding is one entry."""

    index: int
    subindex: int
    bits: int
    span: Span

    @property
    def key(self) -> tuple[int, int, int]:
        """The values that must match."""
        return (self.index, self.subindex, self.bits)

    def __str__(self) -> str:
        bits = counted(self.bits, "bit")
        return (
            f"0x{self.index:04x}:{self.subindex:02x} with {bits}"
            if self.index
            else (f"{bits} of padding")
        )


def items_of(entries: Sequence[Entry]) -> list[Item]:
    """Return entries with adjacent padding combined."""
    items: list[Item] = []
    for e in entries:
        # Tools split padding in different ways; only its length matters.
        if e.index == 0 and items and items[-1].index == 0:
            items[-1] = replace(items[-1], bits=items[-1].bits + e.bits)
        else:
            items.append(Item(e.index, e.subindex if e.index else 0, e.bits, e.span))
    return items


def first_difference(pdo: Pdo, there: Sequence[Entry]) -> tuple[int, Span, str, str] | None:
    """Return number, place and both sides of the first differing entry."""
    ours, theirs = items_of(pdo.entries), items_of(there)
    # The longer list decides: a missing entry is a difference.
    for number in range(max(len(ours), len(theirs))):
        mine = ours[number] if number < len(ours) else None
        other = theirs[number] if number < len(theirs) else None
        if mine is None or other is None or mine.key != other.key:
            span = mine.span if mine is not None else pdo.span
            return number + 1, span, str(mine or "not there"), str(other or "not there")
    return None


def listed(indices: list[int]) -> str:
    """Return ``0x1600, 0x1601``."""
    return few([f"0x{i:04x}" for i in indices], 8) or "no PDO"


def assignment_words(ours: list[int], theirs: list[int]) -> str:
    """Describe the difference of two PDO assignments; begins with a blank or comma."""
    # The same PDOs in another order need another correction.
    if sorted(ours) == sorted(theirs):
        return ", in another order"
    less = [i for i in ours if i not in theirs]
    more = [i for i in theirs if i not in ours]
    parts = []
    if less:
        parts.append(f"without {listed(less)}")
    if more:
        parts.append(f"with {listed(more)} besides")
    return f" ({', '.join(parts)})" if parts else ""
