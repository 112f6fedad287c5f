"""Scenario YAML: steps and expectations of a run, every one with its place."""

from __future__ import annotations

import os

from fsoe_net.diag import Diagnostic, Span, sort_diagnostics
from fsoe_net.load.files import Collector
from fsoe_net.load.numbers import Reader, read_float, read_int
from fsoe_net.load.schema import check_structure
from fsoe_net.load.yaml_tree import MapNode, ScalarNode, SeqNode, load_yaml
from fsoe_net.model import Action, Expectation, LogicChoice, Scenario, Step

__all__ = ["load_scenario"]

_MAX_MS = 7 * 24 * 3600 * 1000.0


def load_scenario(
    path: str | os.PathLike[str],
) -> tuple[Scenario | None, list[Diagnostic]]:
    """Read a scenario file.

    Returns:
        The scenario, or ``None`` when it could not be understood, and everything that is wrong.
    """
    out = Collector()
    root = load_yaml(path, out)
    if root is None:
        return None, sort_diagnostics(out.diagnostics)
    check_structure(root, "scenario", out)
    logic = root.get("logic")
    duration_ms = _ms(root, "duration_s", out, 1000)
    scenario = Scenario(
        span=root.span,
        fields=root.places(),
        path=os.fspath(path),
        duration_ns=None if duration_ms is None else round(duration_ms * 1e6),
        initial=_values(root, "initial", out),
        logic=LogicChoice(inputs=_names(logic, "inputs"), outputs=_names(logic, "outputs")),
        steps=tuple(
            sorted(
                (step for node in root.maps("steps") for step in _steps(node, out)),
                key=lambda s: s.at_ns,
            )
        ),
        expectations=tuple(e for n in root.maps("expect") if (e := _expectation(n, out))),
    )
    return scenario, sort_diagnostics(out.diagnostics)


def _ms(node: MapNode, key: str, out: Collector, factor: float = 1) -> float | None:
    value = read_float(node.get(key), out, what=key)
    if value is None:
        return None
    if not 0 <= value * factor <= _MAX_MS:
        out.add("FSN113", node.at(key), f"{key} {value:g} is no possible time", hint="0 … one week")
        return None
    return value * factor


def _values(node: MapNode, key: str, out: Collector) -> dict[str, int]:
    inner = node.get(key)
    if not isinstance(inner, MapNode):
        return {}
    values: dict[str, int] = {}
    for name, item in inner.pairs.items():
        if isinstance(item, ScalarNode) and item.text.lower() in ("true", "on", "false", "off"):
            values[name] = int(item.text.lower() in ("true", "on"))
            continue
        number = read_int(item, out, what=name, low=-(2**63), high=2**64 - 1, reader=Reader.OWN)
        if number is not None:
            values[name] = number
    return values


def _names(node: object, key: str) -> tuple[str, ...] | None:
    if not isinstance(node, MapNode):
        return None
    items = node.get(key)
    if not isinstance(items, SeqNode):
        return None
    return tuple(i.text for i in items.items if isinstance(i, ScalarNode))


def _steps(node: MapNode, out: Collector) -> list[Step]:
    at_ms = _ms(node, "at_ms", out)
    if at_ms is None:
        return []
    actions = [a for a in Action if a.value in node.pairs]
    if not actions:
        out.add(
            "FSN110",
            node.span,
            "this step does nothing",
            hint=f"add one of: {', '.join(a.value for a in Action)}",
        )
    return [
        Step(
            span=node.span,
            fields=_deep_places(node, action.value),
            at_ns=round(at_ms * 1e6),
            action=action,
            target=node.text(action.value) or "",
            values=_values(node, action.value, out),
        )
        for action in actions
    ]


def _deep_places(node: MapNode, key: str) -> dict[str, Span]:
    """Places of the keys, and of the names inside a map of values."""
    inner = node.get(key)
    return node.places() | (inner.keys if isinstance(inner, MapNode) else {})


def _expectation(node: MapNode, out: Collector) -> Expectation | None:
    window = _window(node, out)
    if window is None:
        return None
    outputs = (node.text("outputs") or "").lower()
    expectation = Expectation(
        span=node.span,
        fields=_deep_places(node, "safe_outputs"),
        from_ns=window[0],
        to_ns=window[1],
        connection=node.text("connection") or "",
        state=node.text("state") or "",
        safe_outputs=_values(node, "safe_outputs", out),
        outputs_on=outputs in ("on", "true") if outputs else None,
        min_resets=read_int(
            node.get("min_resets"), out, what="min_resets", low=0, high=10**9, reader=Reader.OWN
        ),
    )
    if not (expectation.state or expectation.safe_outputs or outputs or expectation.min_resets):
        out.add(
            "FSN110",
            node.span,
            "this expectation asks for nothing",
            hint="add state, safe_outputs, outputs or min_resets",
        )
    return expectation


def _window(node: MapNode, out: Collector) -> tuple[int, int] | None:
    during = node.get("during_ms")
    if isinstance(during, SeqNode) and len(during.items) == 2:
        ends = [read_float(item, out, what="during_ms") for item in during.items]
        if None in ends:
            return None
        first, last = (round(e * 1e6) for e in ends if e is not None)
        if not 0 <= first <= last:
            out.add("FSN113", during.span, "during_ms must rise", hint="write [first, last]")
            return None
        return first, last
    at_ms = _ms(node, "at_ms", out)
    if at_ms is None:
        if "at_ms" not in node.pairs and during is None:
            out.add(
                "FSN110",
                node.span,
                "an expectation needs at_ms or during_ms",
                hint="add at_ms: 500",
            )
        return None
    return round(at_ms * 1e6), round(at_ms * 1e6)
