"""Unique names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence


class Names:
    """Names in use; the cost is linear even if all requests are for the same name.

    Args:
        taken: Names in use.
        between: Separator of a name and its number.
    """

    def __init__(self, taken: Iterable[str] = (), between: str = "_") -> None:
        self._taken = set(taken)
        self._between = between
        self._next: dict[str, int] = {}

    def add(self, *wanted: str) -> str:
        """Add the first free name, or else the last one with a number appended, from 2 on."""
        free = next((name for name in wanted if name not in self._taken), None)
        name = wanted[-1] if free is None else free
        if free is None:
            number = self._next.get(name, 2)
            while f"{name}{self._between}{number}" in self._taken:
                number += 1
            self._next[name] = number + 1
            name += f"{self._between}{number}"
        self._taken.add(name)
        return name


def numbered(wanted: Sequence[str]) -> tuple[str, ...]:
    """Return a name for each request; equal requests get a number, from 1 on."""
    total, seen, names = Counter(wanted), Counter[str](), Names()
    found = []
    for name in wanted:
        seen[name] += 1
        found.append(names.add(f"{name}_{seen[name]}" if total[name] > 1 else name))
    return tuple(found)
