"""Emulated drives of a scenario: motor, load, limits, and the safe outputs that act on them."""

from __future__ import annotations

from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.numbers import read_float
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, SeqNode
from fsoe_net.model.drives import DriveSetup

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


def read_drives(node: Node | None, out: Collector) -> dict[str, DriveSetup]:
    """Read the section ``drives`` of a scenario: axes by name.

    Args:
        node: Its value.
        out: Takes FSN111 and FSN113.
    """
    if not isinstance(node, MapNode):
        return {}  # the schema has spoken, here and below
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
