"""Steps of a scenario: what each action takes."""

from __future__ import annotations

from dataclasses import replace

from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.numbers import Reader, own_int, read_int
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, ScalarNode, SeqNode
from fsoe_net.model.scenario import Action, ScenarioStep

_WORD = 0xFFFFFFFF
_HOUR_MS = 3_600_000
_COUNTS = {
    Action.LOSE: 1_000_000,
    Action.LOSE_EVERY: 1_000_000,
    Action.REPEAT: 1_000_000,
    Action.DELAY: _HOUR_MS * 1000,
    Action.STALL: _HOUR_MS,
}
_FIELDS = {
    Action.WRONG: {"vendor": _WORD, "product": _WORD, "revision": _WORD},
    Action.SDO_ABORT: {"index": 0xFFFF, "sub": 0xFF, "code": _WORD},
}


def with_arguments(
    step: ScenarioStep, node: MapNode, values: dict[str, int], out: Collector
) -> ScenarioStep:
    """Return a step with what its action is given.

    Args:
        step: Its time and action.
        node: Where it stands.
        values: The value of the action as a map of names to numbers, empty when it is not a map.
        out: Takes FSN111 … FSN114 and FSN106.
    """
    action = step.action
    key = action.value
    inner = node.get(key)
    if action in _COUNTS:
        number = read_int(inner, out, what=key, low=0, high=_COUNTS[action], reader=Reader.OWN)
        return replace(step, number=number or 0)
    if action in _FIELDS:
        if not isinstance(inner, MapNode):
            return step  # the schema has spoken, here and below
        numbers = {
            name: number
            for name, high in _FIELDS[action].items()
            if (number := own_int(inner, name, high, out)) is not None
        }
        return replace(step, target=inner.text("subdevice") or "", values=numbers)
    if action is Action.SWAP:
        return _swapped(step, inner, out)
    return replace(step, target=node.text(key) or "", values=values)


def _swapped(step: ScenarioStep, node: Node | None, out: Collector) -> ScenarioStep:
    items = node.items if isinstance(node, SeqNode) else ()
    names = [item.text for item in items if isinstance(item, ScalarNode)]
    first, second = [*names, "", ""][:2]
    if node is not None and len(names) == 2 and first == second:
        out.add("FSN113", node.span, f"{first} is swapped with itself", hint="name two")
    return replace(step, target=first, other=second)
