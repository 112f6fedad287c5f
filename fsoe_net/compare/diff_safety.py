"""What differs between the safety functions of two sides."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fsoe_net.compare.diff_types import Change, ChangeArea, ChangeKind, Fact
from fsoe_net.model.names import Names
from fsoe_net.model.safety import SafetyElement, SafetyFunction


def compare_functions(a: Sequence[SafetyFunction], b: Sequence[SafetyFunction]) -> list[Change]:
    """Compare safety functions by name, and their elements in the order of the signal."""
    left = {f.name: f for f in a}
    right = {f.name: f for f in b}
    changes = [
        Change(kind=kind, area=ChangeArea.SAFETY_FUNCTION, where=name)
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
    facts: dict[str, tuple[Fact | float, Fact | float]] = {
        "trigger": (a.trigger, b.trigger),
        "reaction": (a.reaction, b.reaction),
        "reset": (a.reset, b.reset),
        "modes": (a.modes, b.modes),
        "required_reaction_ms": (a.required_reaction_ms, b.required_reaction_ms),
        "required pl": (a.pl or None, b.pl or None),
        "required sil": (a.sil, b.sil),
    }
    for what, (before, after) in facts.items():
        if before != after:
            yield _changed(a.name, what, before, after)
    old, new = _elements(a), _elements(b)
    if list(old) != list(new):
        yield _changed(a.name, "elements", ", ".join(old), ", ".join(new))
    for name, one in old.items():
        if name in new:
            yield from _element(a.name, name, one, new[name])


def _elements(function: SafetyFunction) -> dict[str, SafetyElement]:
    """Return the elements by name; a duplicate name gets its number."""
    names, elements = Names(between=" no. "), function.elements
    return {names.add(f"{e.kind.value} {e.sub or e.name}"): e for e in elements}


def _element(function: str, name: str, a: SafetyElement, b: SafetyElement) -> Iterator[Change]:
    for what, before, after in (
        ("name", a.name, b.name),
        ("time_ms", a.time_ms, b.time_ms),
        ("pfh_per_hour", a.pfh_per_hour, b.pfh_per_hour),
        ("zero_because", a.zero_because, b.zero_because),
        ("claimed pl", a.pl or None, b.pl or None),
        ("claimed sil", a.sil, b.sil),
        ("category", a.category or None, b.category or None),
        ("mission_years", a.mission_years, b.mission_years),
        ("source", a.source, b.source),
        ("manual", a.manual, b.manual),
        ("safe bits", _bits(a), _bits(b)),
    ):
        if before != after:
            yield _changed(function, f"{name}: {what}", before, after)


def _bits(element: SafetyElement) -> Fact:
    """Return the safe bits of an element in words, ``None`` when none is stated."""
    words = (
        f"{'' if b.slot is None else f'slot {b.slot} '}bit {b.bit} {b.name}" for b in element.bits
    )
    return ", ".join(words) or None


def _changed(where: str, what: str, before: Fact | float, after: Fact | float) -> Change:
    return Change(
        kind=ChangeKind.CHANGED,
        area=ChangeArea.SAFETY_FUNCTION,
        where=where,
        what=what,
        before=_fact(before),
        after=_fact(after),
    )


def _fact(value: Fact | float) -> Fact:
    return f"{value:g}" if isinstance(value, float) else value
