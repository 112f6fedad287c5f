"""Commands for the console itself: waiting, scripts, the lease, help."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.errors import ConsoleError
from fsoe_net.live.console.command import CommandContext, CommandForm, table, usage
from fsoe_net.live.console.names import number, seconds

_MOST_LEASE_MS = 600_000


class ConsoleEnd(Exception):
    """Leave the console."""


def _wait(context: CommandContext, words: Sequence[str]) -> None:
    if len(words) != 1:
        raise usage("wait", FLOW_COMMANDS["wait"].usage)
    context.sleep(seconds(words[0]))


def _run(context: CommandContext, words: Sequence[str]) -> None:
    if len(words) != 1:
        raise usage("run", FLOW_COMMANDS["run"].usage)
    context.run_file(words[0])


def _echo(context: CommandContext, words: Sequence[str]) -> None:
    context.out(" ".join(words))


def _on_error(context: CommandContext, words: Sequence[str]) -> None:
    if words not in (["stop"], ["continue"]):
        raise usage("on-error", FLOW_COMMANDS["on-error"].usage)
    context.stops_on_error = words == ["stop"]


def _lease(context: CommandContext, words: Sequence[str]) -> None:
    if len(words) != 1:
        raise usage("lease", FLOW_COMMANDS["lease"].usage)
    given = context.link.lease(number(words[0], "lease in ms", _MOST_LEASE_MS))
    context.out(f"lease {given} ms" if given else "lease without an end")


def _help(context: CommandContext, words: Sequence[str]) -> None:
    known = context.commands()
    if not words:
        for line in table([(name, form.about) for name, form in known.items()]):
            context.out(line)
        context.out("help COMMAND explains one. Part of the black channel: no safety function.")
        return
    form = known.get(words[0])
    if form is None:
        raise ConsoleError(f"unknown command {words[0]}; help lists them", is_usage=True)
    context.out(f"{words[0]} {form.usage}".rstrip())
    context.out(f"  {form.about}")
    context.out(f"  example: {form.example}")


def _quit(context: CommandContext, words: Sequence[str]) -> None:
    raise ConsoleEnd


FLOW_COMMANDS = {
    "wait": CommandForm("TIME", "wait", "wait 500ms", _wait),
    "run": CommandForm("SCRIPT", "run the commands of a file", "run look.fsn", _run),
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
