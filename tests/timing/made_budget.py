"""Safety functions and budgets."""

from __future__ import annotations

from collections.abc import Callable

from changed import whole as value_of
from networks import PLAIN

from fsoe_net.model.library import Library
from fsoe_net.model.resolve import Resolution
from fsoe_net.timing.budget import Budget, make_budget
from fsoe_net.timing.reaction import FunctionBudget
from fsoe_net.timing.watchdogs import WatchdogBudget

EXAMPLE = PLAIN / "el6910" / "network.yaml"
NONE = Library(devices=())

# T_S 5, T_I 4, T_L 2, T_O 3, T_A 20 ms; watchdogs 100 ms; cycle 1 ms, copied in the same cycle
FUNCTION = """\
safety_functions:
  - name: estop
    required_reaction_ms: 300
    required: {pl: d}
    elements:
      - {kind: sensor, name: ES1, time_ms: 5, pfh_per_hour: 1.0e-8, source: sheet,
         claim: {pl: d}}
      - {kind: input, sub: el1904, time_ms: 4, pfh_per_hour: 1.11e-9, source: manual,
         claim: {pl: d}}
      - {kind: logic, sub: el6910, time_ms: 2, pfh_per_hour: 1.03e-9, source: manual,
         claim: {pl: d}}
      - {kind: output, sub: el2904, time_ms: 3, pfh_per_hour: 1.25e-9, source: manual,
         claim: {pl: d}}
      - {kind: actuator, name: K1, time_ms: 20, pfh_per_hour: 0, source: sheet,
         zero_because: part of el2904}
"""


Maker = Callable[..., Resolution]


def budget_of(resolution: Resolution, **more: object) -> Budget:
    return make_budget(resolution, NONE, **more)  # type: ignore[arg-type]


NAMED_ELSEWHERE = {"connection", "function", "parts", "times"}


def whole(one: WatchdogBudget | FunctionBudget) -> list[str]:
    """Return all that a part of a budget says: fields and properties, each with its name."""
    names = {n for n in dir(one) if not n.startswith("_")} - NAMED_ELSEWHERE
    lines = [f"{n}: {value_of(getattr(one, n))}" for n in sorted(names)]
    if isinstance(one, WatchdogBudget):
        return [f"{one.connection.name}: {line}" for line in lines]
    rows = [f"{r.element.name}: {value_of((r.time, r.pfh))}" for r in one.parts.rows]
    return [f"{one.function.name}: {line}" for line in [*lines, *rows]]


def watchdogs(resolution: Resolution, **more: object) -> dict[str, WatchdogBudget]:
    return {c.connection.sub.name: c for c in budget_of(resolution, **more).connections}


def with_watchdogs(required: float, first: int, second: int) -> tuple[str, tuple[str, str]]:
    """Return what asks for a time, and the watchdogs of el1904 and el2904."""
    old = "connection_id: 1, watchdog_ms: 100}\n      - {main: el6910, sub: el2904, address: 102, "
    new = old.replace("100}", f"{first}}}") + f"connection_id: 2, watchdog_ms: {second}"
    text = FUNCTION.replace("required_reaction_ms: 300", f"required_reaction_ms: {required}")
    return text, (old + "connection_id: 2, watchdog_ms: 100", new)
