"""What ``wait until`` and ``expect`` ask: values, states of connections, the state of the bus."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from fsoe_net.errors import ConsoleError, ControlRefused
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.live.client import Client
from fsoe_net.live.console.names import SymbolNames, batches, number, shown, value_of
from fsoe_net.live.control_values import BusState, Symbol, Value

FORMS = "NAME [& MASK] [==|!=|<|<=|>|>=] VALUE, connection NAME|all in STATE, or state STATE"

_COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq,
    "=": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_STATES = {
    **{state.value: (state,) for state in ConnectionState},
    "data": tuple(state for state in ConnectionState if state.in_data),
}


@dataclass(frozen=True, slots=True)
class Condition:
    """Something that holds or not; ``look`` returns whether, and what was seen instead."""

    text: str
    look: Callable[[Client], tuple[bool, str]]


def condition(words: Sequence[str], names: Callable[[], SymbolNames]) -> Condition:
    """Return what these words ask.

    Raises:
        ConsoleError: They ask nothing known.
    """
    typed = "--typed" in words
    words = [w for w in words if w != "--typed"]
    text = " ".join(words)
    if not words:
        raise ConsoleError(f"until what? {FORMS}", is_usage=True)
    if words[0] == "connection" and len(words) == 4 and words[2].lower() == "in":
        return Condition(text, _connection(words[1], words[3]))
    if words[0] == "state" and len(words) == 2:
        return Condition(text, _state(words[1]))
    return Condition(text, _value(words, names, typed))


def _state(text: str) -> Callable[[Client], tuple[bool, str]]:
    if text not in list(BusState):
        states = " ".join(BusState)
        raise ConsoleError(f"{text!r} is no state of fsn-master: {states}", is_usage=True)

    def look(client: Client) -> tuple[bool, str]:
        status = client.status()
        fault = f": {status.fault}" if status.fault else ""
        return status.state == text, f"it is {status.state}{fault}"

    return look


def _connection(name: str, state: str) -> Callable[[Client], tuple[bool, str]]:
    wanted = _STATES.get(state.lower().replace("-", "_"))
    if wanted is None:
        states = " ".join(_STATES)
        raise ConsoleError(f"{state!r} is no state of a connection: {states}", is_usage=True)

    def look(client: Client) -> tuple[bool, str]:
        try:
            rows = client.connections()
        except ControlRefused as exc:
            if not (exc.bus_stopped or exc.busy):
                raise
            return False, str(exc)
        found = [row for row in rows if name in ("all", row.name)]
        if not found:
            known = ", ".join(row.name for row in rows) or "none"
            raise ConsoleError(f"no connection is called {name}; there are: {known}")
        wrong = [r for r in found if r.state not in wanted]
        return not wrong, ", ".join(f"{r.name} is in {r.state}" for r in wrong)

    return look


def _value(
    words: Sequence[str], names: Callable[[], SymbolNames], typed: bool
) -> Callable[[Client], tuple[bool, str]]:
    rest = list(words[1:])
    mask = None
    if len(rest) > 2 and rest[0] == "&":
        mask = number(rest[1], "mask")
        rest = rest[2:]
    sign = rest.pop(0) if rest and rest[0] in _COMPARE else "=="
    if len(rest) != 1:
        raise ConsoleError(f"{' '.join(words)}: no condition; {FORMS}", is_usage=True)
    wanted = value_of(rest[0])
    known = names()
    chosen = known.single(words[0])
    wanted_names = [s.name for s in chosen]

    def look(client: Client) -> tuple[bool, str]:
        sides: dict[bool, dict[str, Value]] = {False: {}, True: {}}
        try:
            for names in batches(wanted_names):
                values = client.get(*names, typed=typed)
                sides[False] |= values.inputs
                sides[True] |= values.outputs
        except ControlRefused as exc:
            if not (exc.bus_stopped or exc.busy):
                raise
            return False, str(exc)
        found = [(s, sides[s.is_output][s.name]) for s in chosen]
        wrong = [(s, value) for s, value in found if not _holds(value, mask, sign, wanted)]
        return not wrong, ", ".join(f"{known.label(s)} is {_plain(v, s)}" for s, v in wrong)

    return look


def _plain(value: Value, symbol: Symbol) -> str:
    return " = ".join(shown(value, symbol).split("  "))


def _holds(value: Value, mask: int | None, sign: str, wanted: Value) -> bool:
    if value is None or (mask is not None and isinstance(value, float)):
        return False
    seen = value if mask is None else int(value) & mask
    return _COMPARE[sign](seen, wanted)
