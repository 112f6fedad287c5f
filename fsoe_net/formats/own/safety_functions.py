"""``safety_functions`` of a network YAML."""

from __future__ import annotations

import math

from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.numbers import own_int, read_float, record_of
from fsoe_net.formats.shared.yaml_tree import MapNode, Node
from fsoe_net.fsoe.pdu import SAFE_SIZES
from fsoe_net.model.safety import ElementKind, SafeBit, SafetyElement, SafetyFunction

_KINDS = {kind.value: kind for kind in ElementKind}
_LEVELS = ("a", "b", "c", "d", "e")
_CATEGORIES = ("B", "1", "2", "3", "4")
_MOST_MS = 3_600_000.0
_MOST_YEARS = 100.0
_MOST_SIL = 3
_MOST_BIT = 8 * max(SAFE_SIZES) - 1
_MOST_SLOT = 65535


def safety_functions_from_yaml(root: MapNode, out: Collector) -> tuple[SafetyFunction, ...]:
    """Return the safety functions of a network file, in its order.

    Args:
        root: The network file; its structure has been checked.
        out: Takes FSN111 for an invalid number, FSN113 for a number outside its range.
    """
    found = (_function(node, out) for node in root.maps("safety_functions"))
    return tuple(f for f in found if f is not None)


def _function(node: MapNode, out: Collector) -> SafetyFunction | None:
    name = node.text("name")
    elements = tuple(
        e for e in (_element(item, out) for item in node.maps("elements")) if e is not None
    )
    level, sil = _level(node.get("required"), "the risk assessment", out)
    reaction_ms = _positive(node, "required_reaction_ms", _MOST_MS, "ms", out)
    if name is None:
        return None
    return record_of(
        SafetyFunction,
        node,
        out,
        elements=elements,
        required_reaction_ms=reaction_ms or None,
        pl=level,
        sil=sil,
    )


def _level(node: Node | None, source: str, out: Collector) -> tuple[str, int | None]:
    """Return PL (or an empty text) and SIL (or ``None``) of a required or claimed level.

    Args:
        node: The value of ``required`` or ``claim``.
        source: Document with the level; a hint never invents one.
        out: Takes FSN113.
    """
    if not isinstance(node, MapNode):
        return "", None
    level = (node.text("pl") or "").lower()
    if level and level not in _LEVELS:
        out.add(
            "FSN113",
            node.at("pl"),
            f"performance level {level!r} is not one of a … e",
            hint=f"write the letter that {source} states",
        )
        level = ""
    sil = own_int(node, "sil", _MOST_SIL, out, low=1)
    return level, sil


def _element(node: MapNode, out: Collector) -> SafetyElement | None:
    kind = _KINDS.get(node.text("kind") or "")
    time_ms = _positive(node, "time_ms", _MOST_MS, "ms", out)
    pfh = _positive(node, "pfh_per_hour", 1.0, "per hour", out)
    level, sil = _level(node.get("claim"), "its manual", out)
    years = _positive(node, "mission_years", _MOST_YEARS, "years", out)
    sub = node.text("sub") or ""
    if kind is None:
        return None  # reported by the schema
    return record_of(
        SafetyElement,
        node,
        out,
        kind=kind,
        name=node.text("name") or sub or kind.value,
        time_ms=time_ms,
        pfh_per_hour=pfh,
        pl=level,
        sil=sil,
        category=_category(node, out),
        mission_years=years or None,
        bits=_bits(node, out),
    )


def _bits(node: MapNode, out: Collector) -> tuple[SafeBit, ...]:
    """Return the safe bits of an element; their order in the file is irrelevant."""
    bits = (_bit(item, out) for item in node.maps("bits"))
    return tuple(
        sorted(
            (b for b in bits if b is not None),
            key=lambda b: (-1 if b.slot is None else b.slot, b.bit),
        )
    )


def _bit(node: MapNode, out: Collector) -> SafeBit | None:
    bit, slot = own_int(node, "bit", _MOST_BIT, out), own_int(node, "slot", _MOST_SLOT, out)
    name = node.text("name")
    if name == "":
        out.add("FSN113", node.at("name"), "name is empty", hint="write what the signal is called")
    if bit is None or not name:
        return None
    return SafeBit(span=node.span, fields=node.places(), bit=bit, name=name, slot=slot)


def _category(node: MapNode, out: Collector) -> str:
    text = (node.text("category") or "").upper()
    if text in ("", *_CATEGORIES):
        return text
    out.add(
        "FSN113",
        node.at("category"),
        f"category {text!r} is not one of B, 1 … 4",
        hint="write the category that its manual states",
    )
    return ""


def _positive(node: MapNode, key: str, most: float, unit: str, out: Collector) -> float | None:
    value = read_float(node.get(key), out, what=key)
    if value is None or (math.isfinite(value) and 0 <= value <= most):
        return value
    out.add(
        "FSN113",
        node.at(key),
        f"{key} {node.text(key)} is outside 0 … {most:g} {unit}",
        hint="write it as its manual states it",
    )
    return None
