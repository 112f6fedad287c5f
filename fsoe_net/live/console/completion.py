"""Completion of a word in a line of the console."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.live.console.names import SymbolNames

_WORDS = {
    "events": ["on", "off", "for"],
    "on-error": ["stop", "continue"],
    "start": ["for"],
    "stop": ["for"],
    "restart": ["for"],
}
_TYPES = ["bool", *(f"{s}int{n}" for s in ("", "u") for n in (8, 16, 32, 64))]
_TYPES += ["real32", "real64", "string", "hex"]


def complete(before: str, word: str, names: SymbolNames, commands: Sequence[str]) -> list[str]:
    """Return the completions of a word.

    Args:
        before: The line up to the word.
        word: The part already typed.
        names: Symbols of the plan.
        commands: Names of the commands.
    """
    words = before.rpartition(";")[2].split()
    found = commands if not words else _behind(words, names, commands)
    return sorted({text for text in found if text.startswith(word)})


def _behind(words: list[str], names: SymbolNames, commands: Sequence[str]) -> Sequence[str]:
    name = words[0]
    subdevices = list(names.subdevices)
    if name == "help":
        return commands
    if name in _WORDS:
        return _WORDS[name]
    if name in ("state", "sii", "alias", "history"):
        return [*subdevices, "all"] if name == "state" else subdevices
    if name == "sdo":
        rows = [["read", "write"], subdevices, [], _TYPES]
        return rows[len(words) - 1] if len(words) <= len(rows) else []
    if name == "set":
        return _set(words, names)
    if name == "arm":
        return [s.name for s in names.symbols if s.restart_relevant]
    more = ["every", "for"] if name == "watch" and len(words) > 1 else []
    return [*names.labels, *subdevices, "all", "--typed", *more]


def _set(words: list[str], names: SymbolNames) -> list[str]:
    # The nearest scope applies, as in `set` itself.
    scope = next((w for w in reversed(words[1:]) if w == "all" or w in names.subdevices), "")
    outputs = [s for s in names.symbols if s.is_output]
    # Without a scope, whole names are possible; with one, only the entries of its SubDevices.
    if not scope:
        return [*(s.name for s in outputs), *names.subdevices, "all", "--typed"]
    return [s.entry for s in outputs if scope in ("all", s.subdevice)]
