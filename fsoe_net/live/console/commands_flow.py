"""Commands of the console that order others: waiting, checks, scripts, macros, help."""

from __future__ import annotations

import time
from collections.abc import Sequence

from fsoe_net.errors import ConsoleError
from fsoe_net.live.console.command import CommandForm, Room, table, usage
from fsoe_net.live.console.conditions import FORMS, condition
from fsoe_net.live.console.names import number, seconds

_UNTIL_S = 10.0
_POLL_S = 0.02
_MOST_LEASE_MS = 600_000


class ConsoleEnd(Exception):
    """The user wants to leave."""


def _wait(room: Room, words: Sequence[str]) -> None:
    if len(words) == 1 and words[0] != "until":
        return room.sleep(seconds(words[0]))
    if not words or words[0] != "until":
        raise usage("wait", FLOW_COMMANDS["wait"].usage)
    rest, limit = list(words[1:]), _UNTIL_S
    if len(rest) > 2 and rest[-2] == "for":
        limit = seconds(rest[-1])
        rest = rest[:-2]
    wanted = condition(rest, room.names)
    until = time.monotonic() + limit
    while True:
        holds, seen = room.keeper.call(wanted.look)
        if holds:
            return None
        if time.monotonic() >= until:
            raise ConsoleError(f"not within {limit:g} s: {wanted.text}; {seen}")
        room.sleep(min(_POLL_S, max(0.0, until - time.monotonic())))


def _expect(room: Room, words: Sequence[str]) -> None:
    wanted = condition(words, room.names)
    holds, seen = room.keeper.call(wanted.look)
    if not holds:
        raise ConsoleError(f"expected {wanted.text}; {seen}")


def _run(room: Room, words: Sequence[str]) -> None:
    if not words:
        raise usage("run", FLOW_COMMANDS["run"].usage)
    room.run_file(words[0], words[1:])


def _echo(room: Room, words: Sequence[str]) -> None:
    room.out(" ".join(words))


def _let(room: Room, words: Sequence[str]) -> None:
    if not words:
        for name, text in room.macros.items():
            room.out(f"let {name} = {text}")
        return
    name, text = words
    if name in room.commands():
        raise ConsoleError(f"{name} is a command; take another name", is_usage=True)
    room.macros[name] = text


def _on_error(room: Room, words: Sequence[str]) -> None:
    if words not in (["stop"], ["continue"]):
        raise usage("on-error", FLOW_COMMANDS["on-error"].usage)
    room.stops_on_error = words == ["stop"]


def _lease(room: Room, words: Sequence[str]) -> None:
    if len(words) != 1:
        raise usage("lease", FLOW_COMMANDS["lease"].usage)
    given = room.keeper.lease(number(words[0], "lease in ms", _MOST_LEASE_MS))
    room.out(f"lease {given} ms" if given else "lease without an end")


def _help(room: Room, words: Sequence[str]) -> None:
    known = room.commands()
    if not words:
        for line in table([(name, form.about) for name, form in known.items()]):
            room.out(line)
        room.out("help COMMAND says more. Part of the black channel: no safety function.")
        return
    form = known.get(words[0])
    if form is None:
        if words[0] in room.macros:
            room.out(f"let {words[0]} = {room.macros[words[0]]}")
            return
        raise ConsoleError(f"there is no command {words[0]}; help lists them", is_usage=True)
    room.out(f"{words[0]} {form.usage}".rstrip())
    room.out(f"  {form.about}")
    room.out(f"  example: {form.example}")


def _quit(room: Room, words: Sequence[str]) -> None:
    raise ConsoleEnd


FLOW_COMMANDS = {
    "wait": CommandForm(
        "TIME | until CONDITION [for TIME]",
        f"wait, or until something holds: {FORMS}; 10 s at most without `for`",
        "wait until connection all in Data for 5s",
        _wait,
    ),
    "expect": CommandForm(
        "CONDITION",
        "a check: fails when the condition does not hold now",
        "expect drive_1.0x6041 & 0x6f == 0x27",
        _expect,
    ),
    "run": CommandForm(
        "SCRIPT [ARGUMENT…]",
        "run a script; $1, $2, … and $* in it are the arguments",
        "run enable.fsn drive_1",
        _run,
    ),
    "let": CommandForm(
        "[NAME = COMMANDS]",
        "a command of your own with $1 … $*, or a word to be written $NAME",
        "let halt = set $1 0x6040 2",
        _let,
    ),
    "echo": CommandForm("TEXT…", "print a text", "echo drive 1 is enabled", _echo),
    "on-error": CommandForm(
        "stop|continue", "what a script does after a failure", "on-error continue", _on_error
    ),
    "lease": CommandForm(
        "MS",
        "how long outputs stay when this console is stuck or killed -9; 0: no limit",
        "lease 500",
        _lease,
    ),
    "help": CommandForm("[COMMAND]", "this list, or one command", "help set", _help),
    "quit": CommandForm("", "leave; what was set falls back to its stop values", "quit", _quit),
}
