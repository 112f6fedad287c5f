"""Differences between the safety functions of two sides."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fsoe_net.compare.diff_types import (
    Change,
    ChangeArea,
    ChangeKind,
    Fact,
    changed_facts,
)
from fsoe_net.model.names import Names
from fsoe_net.model.safety import SafeBit, SafetyElement, SafetyFunction

# Name of each fact, and its attribute.
_FUNCTION = {key: key for key in ("trigger", "reaction", "reset", "modes", "required_reaction_ms")}
_FUNCTION |= {"required pl": "pl", "required sil": "sil"}
_ELEMENT = {key: key for key in ("name", "time_ms", "pfh_per_hour", "zero_because")}
_ELEMENT |= {"claimed pl": "pl", "claimed sil": "sil"}
_ELEMENT |= {key: key for key in ("category", "mission_years", "source", "manual")}
_ELEMENT |= {"safe bits": "bits"}
_EMPTY_IS_NONE = frozenset({"pl", "category", "bits"})


def compare_functions(a: Sequence[SafetyFunction], b: Sequence[SafetyFunction]) -> list[Change]:
    """Compare safety functions by name, and their elements in the order of the signal."""
    left, right = ({f.name: f for f in side} for side in (a, b))
    changes = [
        Change(kind, ChangeArea.SAFETY_FUNCTION, name)
        for kind, names, others in (
            (ChangeKind.REMOVED, left, right),
            (ChangeKind.ADDED, right, left),
        )
        for name in names
        if name not in others
    ]
    for name, old in left.items():
        if name in right:
            changes += _function(old, right[name])
    return changes


def _function(a: SafetyFunction, b: SafetyFunction) -> Iterator[Change]:
    yield from _changed(a.name, "", _FUNCTION, a, b)
    old, new = _elements(a), _elements(b)
    if list(old) != list(new):
        names = ", ".join(old), ", ".join(new)
        yield from changed_facts(ChangeArea.SAFETY_FUNCTION, a.name, ("elements", *names))
    for name, one in old.items():
        if name in new:
            yield from _changed(a.name, f"{name}: ", _ELEMENT, one, new[name])


def _elements(function: SafetyFunction) -> dict[str, SafetyElement]:
    """Return the elements by name; a duplicate name gets its number."""
    names, elements = Names(between=" no. "), function.elements
    return {names.add(f"{e.kind.value} {e.sub or e.name}"): e for e in elements}


def _changed(
    where: str, prefix: str, attributes: Mapping[str, str], a: object, b: object
) -> Iterator[Change]:
    for what, key in attributes.items():
        before, after = getattr(a, key), getattr(b, key)
        if before != after:  # compared before rounding makes their texts equal
            kind, area = ChangeKind.CHANGED, ChangeArea.SAFETY_FUNCTION
            facts = _fact(key, before), _fact(key, after)
            yield Change(kind, area, where, prefix + what, *facts)


def _fact(key: str, value: Any) -> Fact:
    if not value and key in _EMPTY_IS_NONE:
        return None
    if key == "bits":
        return ", ".join(_safe_bit(bit) for bit in value)
    return f"{value:g}" if isinstance(value, float) else value


def _safe_bit(bit: SafeBit) -> str:
    slot = "" if bit.slot is None else f"slot {bit.slot} "
    return f"{slot}bit {bit.bit} {bit.name}"
