"""Commands of the console for inputs and outputs."""

from __future__ import annotations

import time
from collections.abc import Sequence

from fsoe_net.errors import ConsoleError, ControlRefused
from fsoe_net.live.client import Client
from fsoe_net.live.console.command import CommandContext, CommandForm, options, table, usage
from fsoe_net.live.console.names import SymbolNames, batches, number, seconds, shown
from fsoe_net.live.control_values import Symbol, Value, Values, WatchedCycle

_POLL_S = 0.1
_WATCH_S = 0.1
_MOST_EVERY = 1_000_000
_UNREAD = "-"


def _list(context: CommandContext, words: Sequence[str]) -> None:
    words, given = options(words, "--typed")
    if len(words) > 1:
        raise usage("list", VALUE_COMMANDS["list"].usage)
    context.forget()  # owners change
    names = context.names()
    chosen = names.some(words[0]) if words else list(names.symbols)
    values = _values(context, chosen, typed=bool(given), may_fail=True)
    rows = [
        (
            names.label(symbol),
            *_row(symbol, values.get(symbol, _UNREAD), context.link.client_number),
        )
        for symbol in chosen
    ]
    for line in table(rows, "NAME", "TYPE", "VALUE", "OWNER", "NOTE"):
        context.out(line)


def _row(symbol: Symbol, value: str, me: int) -> tuple[str, ...]:
    if not symbol.is_output:
        owner = "input"
    elif not symbol.open:
        owner = "copy or FSoE"
    elif symbol.client is None:
        owner = "free"
    else:
        owner = "you" if symbol.client == me else f"client {symbol.client}"
    note = "restart relevant" if symbol.restart_relevant else ""
    kind = symbol.kind if symbol.kind == "bool" else f"{symbol.kind}{symbol.bits}"
    return kind, value, owner, note


def _values(
    context: CommandContext, symbols: Sequence[Symbol], *, typed: bool, may_fail: bool = False
) -> dict[Symbol, str]:
    """Return values as text; those of one request are from one cycle."""
    inputs: dict[str, Value] = {}
    outputs: dict[str, Value] = {}
    # A request is limited in names and bytes; each batch is from one cycle.
    for portion in batches(dict.fromkeys(s.name for s in symbols)):

        def job(client: Client, names: list[str] = portion) -> Values:
            return client.get(*names, typed=typed)

        try:
            values = context.link.call(job)
        except ControlRefused:
            # `list` shows the names even if the bus is stopped and has no values.
            if not may_fail:
                raise
        else:
            inputs |= values.inputs
            outputs |= values.outputs
    sides = {False: inputs, True: outputs}
    return {
        s: shown(sides[s.is_output][s.name], s) for s in symbols if s.name in sides[s.is_output]
    }


def _get(context: CommandContext, words: Sequence[str]) -> None:
    words, given = options(words, "--typed")
    if not words:
        raise usage("get", VALUE_COMMANDS["get"].usage)
    names = context.names()
    chosen = list(dict.fromkeys(symbol for word in words for symbol in names.some(word)))
    values = _values(context, chosen, typed=bool(given))
    for line in table([(names.label(symbol), text) for symbol, text in values.items()]):
        context.out(line)


def _set(context: CommandContext, words: Sequence[str]) -> None:
    words, given = options(words, "--typed")
    names = context.names()
    values = _pairs(names, words)
    if not values:
        raise usage("set", VALUE_COMMANDS["set"].usage)
    done = context.link.call(lambda client: client.set(values, typed=bool(given)))
    context.mine.update(values)
    context.out(f"{done} set: {' '.join(values)}" if done <= 8 else f"{done} outputs set")


def _pairs(names: SymbolNames, words: Sequence[str]) -> dict[str, str]:
    """Return names and values; ``all`` or a SubDevice is followed by its entries."""
    values: dict[str, str] = {}
    scope = ""
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if word == "all" or word in names.subdevices:
            scope = word
            # The scope applies until the next one: `set drive_1 a 1 b 2` sets two entries of
            # drive_1.
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
    return names.outputs_of(scope, name) if scope else names.outputs(name)


def _arm(context: CommandContext, words: Sequence[str]) -> None:
    if len(words) != 1:
        raise usage("arm", VALUE_COMMANDS["arm"].usage)
    names = context.names().outputs(words[0])
    if len(names) > 1:
        raise ConsoleError(f"{words[0]} selects several outputs; arm one", is_usage=True)
    (name,) = names
    for_ms = context.link.call(lambda client: client.arm(name))
    context.out(f"{name} may change once within {for_ms / 1000:g} s")


def _watch(context: CommandContext, words: Sequence[str]) -> None:
    words, given = options(words, "--typed")
    words, every, for_s = _watch_words(context, words)
    if not words:
        raise usage("watch", VALUE_COMMANDS["watch"].usage)
    known = context.names()
    symbols = list(dict.fromkeys(symbol for word in words for symbol in known.some(word)))
    names = dict.fromkeys(symbol.name for symbol in symbols)
    until = None if for_s is None else time.monotonic() + for_s
    typed = bool(given)
    try:
        context.link.call(lambda client: client.watch_on(*names, every=every, typed=typed))
        while until is None or time.monotonic() < until:
            left = _POLL_S if until is None else min(_POLL_S, until - time.monotonic())
            # Short waits, so that Ctrl-C can end the command between two of them.
            for seen in context.link.call(lambda client, s=left: client.watched(max(0.0, s))):  # type: ignore[misc]
                _print_cycle(context, seen, {known.label(s): s for s in symbols})
    finally:
        # In `finally` and without waiting for an answer: the server stops sending even after a
        # cancellation.
        context.link.post(lambda client: client.watch_off())


def _watch_words(
    context: CommandContext, words: Sequence[str]
) -> tuple[list[str], int, float | None]:
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
    # A person needs some tenths of a second to read a row; each cycle would flood the terminal.
    if every == 0:
        cycle_ns = context.link.call(lambda client: client.status().cycle_ns)
        every = max(1, round(_WATCH_S * 1e9 / max(1, cycle_ns)))
    return rest, every, for_s


def _print_cycle(context: CommandContext, seen: WatchedCycle, symbols: dict[str, Symbol]) -> None:
    if seen.skipped:
        context.out(f"… {seen.skipped} left out: this client or the recorder was too slow")
    values = "  ".join(
        f"{label} = {shown(seen.side(symbol.is_output).get(symbol.name))}"
        for label, symbol in symbols.items()
    )
    context.out(f"cycle {seen.cycle}  {values}")


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
        "write outputs, all of one line in one cycle; after a SubDevice or `all`, its entries",
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
