"""Scenario YAML: steps, expectations and emulated drives, each with its place."""

from __future__ import annotations

import os
import re
from dataclasses import replace

from fsoe_net.diag.diagnostic import Diagnostic, Related, Severity, Span, sort_diagnostics
from fsoe_net.formats.own.schema import check_structure
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.numbers import Reader, own_int, read_float, read_int
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, ScalarNode, SeqNode, load_yaml
from fsoe_net.model.drives import DriveSetup
from fsoe_net.model.scenario import Action, Expectation, LogicChoice, Scenario, ScenarioStep

_MOST = 1e9
_POSITIVE = frozenset(
    {"counts_per_rev", "rated_torque_nm", "max_torque_nm", "inertia_kgm2", "max_rpm", "sls_rpm"}
    | {"acceleration_rev_s2", "quick_stop_rev_s2"}
)
_FROM_ZERO = frozenset(
    {"friction_nm", "damping_nms", "following_error_rev", "following_error_ms"}
    | {"ss1_ms", "sls_delay_ms"}
)
_NUMBERS = (_POSITIVE | _FROM_ZERO | {"position_rev"}) - {"sls_rpm"}
_WORD = 0xFFFFFFFF
_HOUR_MS = 3_600_000
# Highest number of each action: frames, then microseconds of DELAY and milliseconds of STALL.
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
    """Return a step with the arguments of its action.

    Args:
        step: Its time and action.
        node: Node of the step.
        values: The value of the action as a map of names to numbers; empty if it is not a map.
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
            return step  # already reported by the schema, here and below
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


_MAX_MS = 7 * 24 * 3600 * 1000.0
_MOST_RESETS = 10**9
_INTEGER = re.compile(r"[+-]?[0-9]+\Z|0[xX][0-9a-fA-F]+\Z")
_ASKED = ("state", "safe_outputs", "outputs", "min_resets", "max_resets", "drives")


def load_scenario(
    path: str | os.PathLike[str],
) -> tuple[Scenario | None, list[Diagnostic]]:
    """Read a scenario file.

    Returns:
        The scenario, or ``None`` if it is invalid, and all findings.
    """
    out = Collector()
    root = load_yaml(path, out)
    if root is None:
        return None, sort_diagnostics(out.diagnostics)
    _check_structure(root, out)
    duration_ms = _ms(root, "duration_s", out, 1000)
    if duration_ms == 0:
        out.add("FSN113", root.at("duration_s"), "duration_s is 0", hint="write 3, or leave it out")
    scenario = Scenario(
        span=root.span,
        fields=_deep_places(root, "initial", "drives"),
        path=os.fspath(path),
        duration_ns=None if duration_ms is None else round(duration_ms * 1e6),
        initial=_values(root, "initial", out),
        logic=_logic(root.get("logic"), out),
        drives=read_drives(root.get("drives"), out),
        steps=tuple(
            # The sort is stable: steps with the same time keep the order of the file.
            sorted(
                (step for node in root.maps("steps") for step in _steps(node, out)),
                key=lambda s: s.at_ns,
            )
        ),
        expectations=tuple(e for n in root.maps("expect") if (e := _expectation(n, out))),
    )
    return scenario, sort_diagnostics(out.diagnostics)


def _check_structure(root: MapNode, out: Collector) -> None:
    """Check keys and types. An unknown key is always an error here.

    In a file of the driver it may be a remark; here it would be an expectation that is never
    checked.
    """
    found = Collector()
    check_structure(root, "scenario", found)
    for item in found.diagnostics:
        if item.code == "FSN109":
            message = f"{item.message}; nothing would come of it"
            item = replace(item, severity=Severity.ERROR, message=message)
        out.diagnostics.append(item)


def _ms(node: MapNode, key: str, out: Collector, factor: float = 1) -> float | None:
    return _time(node.get(key), out, what=key, factor=factor)


def _time(item: Node | None, out: Collector, *, what: str, factor: float = 1) -> float | None:
    """Return a time in milliseconds, or ``None`` with a finding; ``nan`` is not a time either."""
    value = read_float(item, out, what=what)
    if value is None or item is None:
        return None
    if not 0 <= value * factor <= _MAX_MS:
        out.add(
            "FSN113", item.span, f"{what} {value:g} is not a possible time", hint="0 … one week"
        )
        return None
    return value * factor


def _values(node: MapNode, key: str, out: Collector) -> dict[str, int]:
    inner = node.get(key)
    if not isinstance(inner, MapNode):
        return {}
    values: dict[str, int] = {}
    for name, item in inner.pairs.items():
        if not isinstance(item, ScalarNode):
            continue  # already reported by the schema, here and below
        if item.text.lower() in ("true", "on", "false", "off"):
            values[name] = int(item.text.lower() in ("true", "on"))
            continue
        if not _INTEGER.match(item.text):
            continue
        # The type of the entry is not known here, so signed and unsigned 64 bits both pass.
        number = read_int(item, out, what=name, low=-(2**63), high=2**64 - 1, reader=Reader.OWN)
        if number is not None:
            values[name] = number
    return values


def _texts(node: Node | None) -> dict[str, str]:
    pairs = node.pairs if isinstance(node, MapNode) else {}
    return {name: item.text for name, item in pairs.items() if isinstance(item, ScalarNode)}


def _steps(node: MapNode, out: Collector) -> list[ScenarioStep]:
    at_ms = _ms(node, "at_ms", out)
    if at_ms is None:
        return []
    # A step of the file may hold several actions; each becomes a step of the model.
    actions = [a for a in Action if a.value in node.pairs]
    if not actions:
        out.add(
            "FSN110",
            node.span,
            "this step does nothing",
            hint=f"add one of: {', '.join(a.value for a in Action)}",
        )
    steps = (
        ScenarioStep(
            span=node.span,
            fields=_deep_places(node, action.value),
            at_ns=round(at_ms * 1e6),
            action=action,
        )
        for action in actions
    )
    return [with_arguments(s, node, _values(node, s.action.value, out), out) for s in steps]


def _logic(node: Node | None, out: Collector) -> LogicChoice:
    if not isinstance(node, MapNode):
        return LogicChoice()
    delays = node.get("off_delay_ms")
    pairs = delays.pairs if isinstance(delays, MapNode) else {}
    times = {name: _time(item, out, what="off_delay_ms") for name, item in pairs.items()}
    return LogicChoice(
        inputs=node.texts("inputs"),
        outputs=node.texts("outputs"),
        delays_ns={name: round(ms * 1e6) for name, ms in times.items() if ms is not None},
    )


def _deep_places(node: MapNode, *keys: str) -> dict[str, Span]:
    """Return the places of the keys, including names inside maps of values."""
    places = dict(node.places())
    for key in keys:
        inner = node.get(key)
        places |= inner.keys if isinstance(inner, MapNode) else {}
    return places


def _expectation(node: MapNode, out: Collector) -> Expectation | None:
    window = _window(node, out)
    if window is None:
        return None
    outputs = (node.text("outputs") or "").lower()
    expectation = Expectation(
        span=node.span,
        fields=_deep_places(node, "safe_outputs", "drives"),
        from_ns=window[0],
        to_ns=window[1],
        connection=node.text("connection") or "",
        state=node.text("state") or "",
        safe_outputs=_values(node, "safe_outputs", out),
        outputs_on=outputs in ("on", "true") if outputs else None,
        min_resets=own_int(node, "min_resets", _MOST_RESETS, out),
        max_resets=own_int(node, "max_resets", _MOST_RESETS, out),
        drives=_texts(node.get("drives")),
    )
    if not any(key in node.pairs for key in _ASKED):
        out.add(
            "FSN110",
            node.span,
            "this expectation asks for nothing",
            hint=f"add one of: {', '.join(_ASKED)}",
        )
    return expectation


def _window(node: MapNode, out: Collector) -> tuple[int, int] | None:
    """Return the first and last moment, which are equal for ``at_ms``."""
    if "at_ms" in node.pairs and "during_ms" in node.pairs:
        out.add(
            "FSN106",
            node.keys["during_ms"],
            "the time of this expectation is given twice",
            hint="delete at_ms or during_ms",
            related=(Related(span=node.keys["at_ms"], message="at_ms stands here"),),
        )
        return None
    if "during_ms" in node.pairs:
        return _during(node.get("during_ms"), out)
    if "at_ms" not in node.pairs:
        hint = "add at_ms: 500"
        out.add("FSN110", node.span, "an expectation needs at_ms or during_ms", hint=hint)
    at_ms = _ms(node, "at_ms", out)
    return None if at_ms is None else (round(at_ms * 1e6), round(at_ms * 1e6))


def _during(during: Node | None, out: Collector) -> tuple[int, int] | None:
    if not isinstance(during, SeqNode) or len(during.items) != 2:
        return None  # already reported by the schema
    first, last = (_time(item, out, what="during_ms") for item in during.items)
    if first is None or last is None:
        return None
    if first > last:
        out.add(
            "FSN113",
            during.span,
            "during_ms: the end is before the start",
            hint=f"write [{last:g}, {first:g}]",
        )
        return None
    return round(first * 1e6), round(last * 1e6)


def read_drives(node: Node | None, out: Collector) -> dict[str, DriveSetup]:
    """Read the section ``drives`` of a scenario: axes by name.

    Args:
        node: Its value.
        out: Takes FSN111 and FSN113.
    """
    if not isinstance(node, MapNode):
        return {}  # already reported by the schema, here and below
    return {
        name: _setup(item, out) for name, item in node.pairs.items() if isinstance(item, MapNode)
    }


def _setup(node: MapNode, out: Collector) -> DriveSetup:
    default = DriveSetup()
    limits, switch = (_pair(node, key, out) for key in ("limits_rev", "home_switch_rev"))

    def number(key: str) -> float:
        value = _number(key, node.get(key), out)
        return float(getattr(default, key)) if value is None else value

    return DriveSetup(
        span=node.span,
        fields=node.places(),
        **{key: number(key) for key in _NUMBERS},
        limits_rev=limits or default.limits_rev,
        home_switch_rev=switch or default.home_switch_rev,
        sls_rpm=_speeds(node.get("sls_rpm"), out) or default.sls_rpm,
        sto=node.text("sto"),
        ss1=node.text("ss1"),
        sls=node.texts("sls"),
        sto_is_fault=node.truth("sto_is_fault"),
    )


def _number(key: str, item: Node | None, out: Collector) -> float | None:
    value = read_float(item, out, what=key)
    if value is None or item is None:
        return None
    if key in _POSITIVE:
        good, wanted = 0 < value <= _MOST, "more than 0, at most 1e9"
    elif key in _FROM_ZERO:
        good, wanted = 0 <= value <= _MOST, "0 … 1e9"
    else:
        good, wanted = -_MOST <= value <= _MOST, "a number within ±1e9"
    if good:
        return value
    out.add("FSN113", item.span, f"{key} cannot be {value:g}", hint=f"write {wanted}")
    return None


def _pair(node: MapNode, key: str, out: Collector) -> tuple[float, float] | None:
    item = node.get(key)
    if not isinstance(item, SeqNode) or len(item.items) != 2:
        return None
    values = [_number(key, part, out) for part in item.items]
    if values[0] is None or values[1] is None:
        return None
    if values[0] >= values[1]:
        out.add("FSN113", item.span, f"{key} must rise", hint="write [lower, upper]")
        return None
    return values[0], values[1]


def _speeds(item: Node | None, out: Collector) -> tuple[float, ...]:
    parts = item.items if isinstance(item, SeqNode) else ()
    found = [_number("sls_rpm", part, out) for part in parts]
    return tuple(value for value in found if value is not None)
