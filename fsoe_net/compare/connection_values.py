"""The values of FSoE connections that two sides state, and which connection is which."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from fsoe_net.compare.pairing import attributes, pair_by

_A = TypeVar("_A")
_B = TypeVar("_B")


@dataclass(frozen=True, slots=True)
class Value:
    """One value of a connection.

    Attributes:
        key: Its key in a network file.
        what: Its name in messages.
        unit: Unit after the number.
        code: Finding when a device has another value.
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
    """Return what two connections have for a value, ``None`` unless both state it and differ."""
    mine, other = getattr(a, value.key), getattr(b, value.key)
    return None if None in (mine, other) or mine == other else (mine, other)


def pair_connections(
    left: dict[int, _A], right: dict[int, _B], fits: Callable[[_A, _B], bool] | None = None
) -> list[tuple[int, int]]:
    """Pair by address and connection ID, then by one of them; see `pair_by`."""
    pairs = []
    for keys in (("address", "connection_id"), ("address",), ("connection_id",)):
        pairs += pair_by(attributes(*keys), left, right, fits=fits)
    return pairs
