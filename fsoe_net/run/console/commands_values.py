"""Commands of the console for inputs and outputs."""

from __future__ import annotations

import time
from collections.abc import Sequence

from fsoe_net.errors import ConsoleError, ControlRefused
from fsoe_net.run.client import Client
from fsoe_net.run.console.command import CommandForm, Room, options, table, usage
from fsoe_net.run.console.names import SymbolNames, batches, number, seconds, shown
from fsoe_net.run.control_values import Symbol, Value, Values, WatchedCycle

__all__ = ["VALUE_COMMANDS"]

_POLL_S = 0.1
_WATCH_S = 0.1
_MOST_EVERY = 1_000_000


def _list(room: Room, words: Sequence[str]) -> None:
    words, given = options(words, "--typed")
    if len(words) > 1:
        raise usage("list", VALUE_COMMANDS["list"].usage)
    room.forget()  # owners change
    names = room.names()
    chosen = names.some(words[0]) if words else list(names.by_name)
    values = _values(room, chosen, typed=bool(given), may_fail=True)
    rows = [
        _row(names.by_name[n], values, room.keeper.client_number)
        for n in chosen
        if n in names.by_name
    ]
    for line in table(rows, "NAME", "TYPE", "VALUE", "OWNER", "NOTE"):
        room.out(line)


def _row(symbol: Symbol, values: dict[str, Value], me: int) -> tuple[str, ...]:
    value = shown(values[symbol.name], symbol) if symbol.name in values else "-"
    if not symbol.is_output:
        owner = "input"
    elif not symbol.open:
        owner = "copy or FSoE"
    elif symbol.client is None:
        owner = "free"
    else:
        owner = "you" if symbol.client == me else f"client {symbol.client}"
    notes = ["restart relevant"] if symbol.restart_relevant else []
    notes += [f"as {symbol.interface}"] if symbol.interface else []
    kind = symbol.kind if symbol.kind == "bool" else f"{symbol.kind}{symbol.bits}"
    return symbol.name, kind, value, owner, ", ".join(notes)


def _values(
    room: Room, names: Sequence[str], *, typed: bool, may_fail: bool = False
) -> dict[str, Value]:
    """Return values; those of a request are of one cycle."""
    found: dict[str, Value] = {}
    for portion in batches(names):

        def job(client: Client, names: list[str] = portion) -> Values:
            return client.get(*names, typed=typed)

        try:
            found |= room.keeper.call(job).values
        except ControlRefused:
            if not may_fail:
                raise
    return found


def _get(room: Room, words: Sequence[str]) -> None:
    words, given = options(words, "--typed")
    if not words:
        raise usage("get", VALUE_COMMANDS["get"].usage)
    names = room.names()
    chosen = list(dict.fromkeys(name for word in words for name in names.some(word)))
    values = _values(room, chosen, typed=bool(given))
    for line in table([(n, shown(v, names.by_name.get(n))) for n, v in values.items()]):
        room.out(line)


def _set(room: Room, words: Sequence[str]) -> None:
    words, given = options(words, "--typed")
    names = room.names()
    values = _pairs(names, words)
    if not values:
        raise usage("set", VALUE_COMMANDS["set"].usage)
    done = room.keeper.call(lambda client: client.set(values, typed=bool(given)))
    room.mine.update(names.proper(name) for name in values)
    room.out(f"{done} set: {' '.join(values)}" if done <= 8 else f"{done} outputs set")


def _pairs(names: SymbolNames, words: Sequence[str]) -> dict[str, str]:
    """Return names and values; behind ``all`` or a SubDevice stand its entries."""
    values: dict[str, str] = {}
    scope = ""
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if word == "all" or word in names.subdevices:
            scope = word
            continue
        name, equals, value = word.partition("=")
        if not equals:
            if not rest:
                raise ConsoleError(f"{word} gets no value; set NAME VALUE", is_usage=True)
            value = rest.pop(0)
        for one in _targets(names, scope, name):
            values[one] = value
    return values


def _targets(names: SymbolNames, scope: str, name: str) -> list[str]:
    if scope:
        return names.outputs_of(scope, name)
    found = names.some(name)
    if len(found) == 1:
        return found
    outputs = [n for n in found if names.by_name[n].is_output]
    if not outputs:
        raise ConsoleError(f"{name} stands for inputs only; list shows the outputs")
    return outputs


def _arm(room: Room, words: Sequence[str]) -> None:
    if len(words) != 1:
        raise usage("arm", VALUE_COMMANDS["arm"].usage)
    name = room.names().one(words[0])
    for_ms = room.keeper.call(lambda client: client.arm(name))
    room.out(f"{name} may change once within {for_ms / 1000:g} s")


def _watch(room: Room, words: Sequence[str]) -> None:
    words, given = options(words, "--typed")
    words, every, for_s = _watch_words(room, words)
    if not words:
        raise usage("watch", VALUE_COMMANDS["watch"].usage)
    known = room.names()
    names = list(dict.fromkeys(name for word in words for name in known.some(word)))
    until = None if for_s is None else time.monotonic() + for_s
    typed = bool(given)
    try:
        room.keeper.call(lambda client: client.watch_on(*names, every=every, typed=typed))
        while until is None or time.monotonic() < until:
            left = _POLL_S if until is None else min(_POLL_S, until - time.monotonic())
            for seen in room.keeper.call(lambda client, s=left: client.watched(max(0.0, s))):  # type: ignore[misc]
                _tell(room, seen)
    finally:
        room.keeper.post(lambda client: client.watch_off())


def _watch_words(room: Room, words: Sequence[str]) -> tuple[list[str], int, float | None]:
    rest: list[str] = []
    every, for_s = 0, None
    found = list(words)
    while found:
        word = found.pop(0)
        if word in ("every", "for") and found:
            value = found.pop(0)
            if word == "every":
                every = number(value, "number of cycles", _MOST_EVERY)
            else:
                for_s = seconds(value)
        else:
            rest.append(word)
    if every == 0:
        cycle_ns = room.keeper.call(lambda client: client.status().cycle_ns)
        every = max(1, round(_WATCH_S * 1e9 / max(1, cycle_ns)))
    return rest, every, for_s


def _tell(room: Room, seen: WatchedCycle) -> None:
    if seen.skipped:
        room.out(f"… {seen.skipped} left out: this client or the recorder was too slow")
    values = "  ".join(f"{n} = {shown(v)}" for n, v in seen.values.items())
    room.out(f"cycle {seen.cycle}  {values}")


VALUE_COMMANDS = {
    "list": CommandForm(
        "[PATTERN] [--typed]",
        "inputs and outputs: type, value, who writes them, whether one can restart a machine",
        "list drive_1.*",
        _list,
    ),
    "get": CommandForm(
        "NAME…|SUBDEVICE|all [--typed]",
        "values of one cycle; raw, or with factor and offset of the slave YAML",
        "get drive_1.0x6041 drive_2.0x6041",
        _get,
    ),
    "set": CommandForm(
        "[SUBDEVICE|all] NAME VALUE… [--typed]",
        "write outputs, all of one line in one cycle; behind a SubDevice or `all`, its entries",
        "set all 0x6060 8 0x6040 6",
        _set,
    ),
    "arm": CommandForm(
        "NAME",
        "allow one change of an output that can restart a machine",
        "arm el6910.logic_control",
        _arm,
    ),
    "watch": CommandForm(
        "NAME… [every N] [for TIME] [--typed]",
        "values of every N-th cycle until Ctrl-C; without N about ten a second",
        "watch drive_1.0x6064 every 10 for 5s",
        _watch,
    ),
}
