"""What may stand at a place of a line of the console."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.live.console.names import SymbolNames
from fsoe_net.live.control_values import BusState

_CONNECTION_STATES = ["Data", *(s.value for s in ConnectionState if not s.in_data)]
_WORDS = {
    "events": ["on", "off", "for"],
    "on-error": ["stop", "continue"],
    "start": ["for"],
    "stop": ["for"],
    "restart": ["for"],
}
_TYPES = ["bool", *(f"{s}int{n}" for s in ("", "u") for n in (8, 16, 32, 64))]
_TYPES += ["real32", "real64", "string", "hex"]


def complete(
    before: str,
    word: str,
    names: SymbolNames,
    *,
    commands: Sequence[str],
    macros: Mapping[str, str],
) -> list[str]:
    """Return what the word may become.

    Args:
        before: The line up to the word.
        word: What is written of it.
        names: Symbols of the plan.
        commands: Names of the commands.
        macros: What ``let`` has defined.
    """
    words = before.rpartition(";")[2].split()
    found = [*commands, *macros] if not words else _behind(words, word, names, macros, commands)
    return sorted({text for text in found if text.startswith(word)})


def _behind(
    words: list[str],
    word: str,
    names: SymbolNames,
    macros: Mapping[str, str],
    commands: Sequence[str],
) -> list[str]:
    name = words[0]
    subdevices = list(names.subdevices)
    if name == "help":
        return [*commands, *macros]
    if name in _WORDS:
        return _WORDS[name]
    if name in ("state", "sii", "alias", "history"):
        return [*subdevices, "all"] if name == "state" else subdevices
    if name == "sdo":
        rows = [["read", "write"], subdevices, [], _TYPES]
        return rows[len(words) - 1] if len(words) <= len(rows) else []
    if name in ("wait", "expect"):
        return _condition(words, names)
    if name == "set":
        return _set(words, names)
    if name == "arm":
        return [s.name for s in names.symbols if s.restart_relevant]
    more = ["every", "for"] if name == "watch" and len(words) > 1 else []
    return [*names.labels, *subdevices, "all", "--typed", *more]


def _set(words: list[str], names: SymbolNames) -> list[str]:
    scope = next((w for w in reversed(words[1:]) if w == "all" or w in names.subdevices), "")
    outputs = [s for s in names.symbols if s.is_output]
    if not scope:
        return [*(s.name for s in outputs), *names.subdevices, "all", "--typed"]
    return [s.entry for s in outputs if scope in ("all", s.subdevice)]


def _condition(words: list[str], names: SymbolNames) -> list[str]:
    if words == ["wait"]:
        return ["until"]
    rest = words[2:] if words[0] == "wait" else words[1:]
    if not rest:
        return ["connection", "state", *names.labels]
    if rest[0] == "state":
        return [str(state) for state in BusState] if len(rest) == 1 else ["for"]
    if rest[0] == "connection":
        return [["all"], ["in"], _CONNECTION_STATES, ["for"]][min(len(rest) - 1, 3)]
    return ["for", "==", "!=", "&"]
