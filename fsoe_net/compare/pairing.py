"""Pairs the rows of two sides by keys, and compares values that FSoE connections state."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, TypeVar

_A = TypeVar("_A")
_B = TypeVar("_B")


def pair_by(
    key: Callable[[Any], Hashable | None],
    left: dict[int, _A],
    right: dict[int, _B],
    *,
    unique: bool = False,
    fits: Callable[[_A, _B], bool] | None = None,
) -> list[tuple[int, int]]:
    """Pair rows that have the same key, in their order, and remove them from both sides.

    Args:
        key: Returns the key of a row; a row whose key is ``None`` has no partner.
        left: Rows of the first side by number.
        right: Rows of the second side by number.
        unique: Pair only rows whose key is unique on both sides.
        fits: Whether two rows with the same key can be partners; default: all.
    """
    waiting: dict[Hashable, deque[int]] = {}
    for other, partner in right.items():
        waiting.setdefault(key(partner), deque()).append(other)
    counts = Counter(key(row) for row in left.values())
    pairs = []
    for number, row in list(left.items()):
        known = key(row)
        if known is None or known not in waiting:
            continue
        free = waiting[known]
        if unique and (len(free) > 1 or counts[known] > 1):
            continue
        taken = next((n for n in free if fits is None or fits(row, right[n])), None)
        if taken is not None:
            free.remove(taken)
            pairs.append((number, taken))
            del left[number], right[taken]
    return pairs


def attributes(*names: str) -> Callable[[Any], Hashable | None]:
    """Return a function for the key of these attributes; ``None`` if a row lacks one of them."""

    def key(row: Any) -> Hashable | None:
        values = tuple(getattr(row, name) for name in names)
        return None if None in values else values

    return key


@dataclass(frozen=True, slots=True)
class Value:
    """One value of a connection.

    Attributes:
        key: Its key in a network file.
        what: Its name in messages.
        unit: Unit after the number.
        code: Finding if a device has another value.
        tag: Its name in a TwinSAFE export.
    """

    key: str
    what: str
    unit: str
    code: str
    tag: str


VALUES = (
    Value("address", "FSoE address", "", "FSN508", "SAddress"),
    Value("connection_id", "connection ID", "", "FSN509", "ConId"),
    Value("watchdog_ms", "FSoE watchdog", " ms", "FSN510", "SWatchdog"),
)


def differing(value: Value, a: object, b: object) -> tuple[int, int] | None:
    """Return the values of two connections if both state one and they differ, else ``None``."""
    mine, other = getattr(a, value.key), getattr(b, value.key)
    return None if None in (mine, other) or mine == other else (mine, other)


def pair_connections(
    left: dict[int, _A], right: dict[int, _B], fits: Callable[[_A, _B], bool] | None = None
) -> list[tuple[int, int]]:
    """Pair by address and connection ID, then by one of the two; see `pair_by`."""
    pairs = []
    for keys in (("address", "connection_id"), ("address",), ("connection_id",)):
        pairs += pair_by(attributes(*keys), left, right, fits=fits)
    return pairs
