"""``fsoe-net console``: a prompt, or a script, for a running ``fsn-master``."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable

import click

from fsoe_net.cli.line_editor import line_editor
from fsoe_net.cli.options import FILE, Time, master_options, master_socket
from fsoe_net.cli.terminal import echo
from fsoe_net.errors import ConsoleError, FsnError
from fsoe_net.live.console.commands_flow import ConsoleEnd
from fsoe_net.live.console.console import Console
from fsoe_net.live.console.leased_client import LeasedClient

_PROMPT = "fsn> "
_EPILOG = """\b
Examples:
  fsoe-net console --interface eth1
  fsoe-net console --socket /tmp/fsn.sock -c "state; get drive_1"
  fsoe-net console --interface eth1 --run look.fsn
  echo "start; connections" | fsoe-net console --interface eth1

`help` at the prompt lists the commands. Outputs keep their values while the console or script runs
and return to their stop values when it ends.

Exit codes: 0 done, 1 a command failed, 2 usage error, 3 no fsn-master answers.

Part of the black channel: no safety function, not certified; stop is not an emergency stop."""


@click.command("console", epilog=_EPILOG)
@master_options
@click.option("--run", "script", type=FILE, metavar="SCRIPT", help="Run this script and exit.")
@click.option("-c", "text", metavar="COMMANDS", help="Run these commands and exit.")
@click.option(
    "--lease",
    "lease_ns",
    type=Time("0s", "10min"),
    metavar="TIME",
    help="Outputs return to their stop values after this time without a request. 0: never.",
)
def command(
    socket: str | None,
    interface: str | None,
    script: str | None,
    text: str | None,
    lease_ns: int | None,
) -> int:
    """Start, stop, watch and set a running fsn-master, interactively or from a list of commands."""
    path = master_socket(socket, interface)
    if script is not None and text is not None:
        raise click.UsageError("--run and -c exclude each other")
    # A prompt needs a person; a script reads from the pipe.
    at_prompt = script is None and text is None and sys.stdin.isatty()
    lease_ms = None if lease_ns is None else lease_ns // 1_000_000
    # At a prompt a restart of fsn-master is normal; a script must stop there.
    link = LeasedClient(path, lease_ms=lease_ms, reconnect=at_prompt)
    try:
        # A script has its own output; a person needs the warnings.
        level = "warning" if at_prompt else "fallback"
        console = Console(link, _out, _note, notes_level=level)
        if at_prompt:
            return _prompt(console)
        if script is not None:
            return _unattended(console, lambda: console.run_file(script))
        if text is not None:
            return _unattended(console, lambda: console.run_script(text, "-c"))
        return _unattended(console, lambda: _standard_input(console))
    finally:
        link.close()


def _out(text: str) -> None:
    echo(text)


def _note(text: str) -> None:
    echo(text, err=True)


def _standard_input(console: Console) -> None:
    """Run lines as they arrive; values that were set stay leased between lines."""
    for number, raw in enumerate(sys.stdin.buffer, 1):
        try:
            line = raw.decode("utf-8")
        except UnicodeDecodeError as exc:
            raise ConsoleError(f"stdin:{number}: no UTF-8 text", is_usage=True) from exc
        console.run_script(line.rstrip("\n"), "stdin", first_line=number)


def _unattended(console: Console, run: Callable[[], None]) -> int:
    """Run a script and return the exit code; print which outputs fall back at its end."""
    code = 0
    try:
        with contextlib.suppress(ConsoleEnd):
            run()
    except ConsoleError as exc:
        echo(f"error: {exc}", err=True)
        code = 2 if exc.is_usage else 1
    finally:
        _say_fallback(console)
    return code or int(console.failures > 0)


def _say_fallback(console: Console) -> None:
    owned = console.owned()
    if owned:
        few = " ".join(owned[:8]) + (" …" if len(owned) > 8 else "")
        fall = "1 output falls" if len(owned) == 1 else f"{len(owned)} outputs fall"
        echo(f"this is the end: {fall} back to stop values: {few}", err=True)


def _prompt(console: Console) -> int:
    status = console.link.call(lambda client: client.status())
    where = status.interface or status.backend
    echo(f"fsn-master on {where}: {status.state}. help lists commands, quit leaves.")
    with line_editor(console):
        while True:
            try:
                console.tell()
                console.run_line(input(_PROMPT))
            except (EOFError, ConsoleEnd):
                break
            # Ctrl-C drops the line, as in a shell; Ctrl-D leaves.
            except KeyboardInterrupt:
                echo()
            except UnicodeDecodeError:
                echo("error: that was not UTF-8 text", err=True)
            except FsnError as exc:
                echo(f"error: {exc}", err=True)
    _say_fallback(console)
    return 0
