"""The console: runs lines and scripts against one ``fsn-master``."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.errors import ConsoleError, ControlRefused, EnvironmentFault
from fsoe_net.live.console.command import CommandForm
from fsoe_net.live.console.commands_bus import BUS_COMMANDS, event_line
from fsoe_net.live.console.commands_device import DEVICE_COMMANDS
from fsoe_net.live.console.commands_flow import FLOW_COMMANDS
from fsoe_net.live.console.commands_values import VALUE_COMMANDS
from fsoe_net.live.console.leased_client import LeasedClient
from fsoe_net.live.console.names import SymbolNames
from fsoe_net.live.console.script import ConsoleCommand, ScriptError, parse

COMMANDS: Mapping[str, CommandForm] = (
    BUS_COMMANDS | VALUE_COMMANDS | DEVICE_COMMANDS | FLOW_COMMANDS
)
_DEEPEST = 16
_SLICE_S = 0.1
_END_S = 1.0
_MOST_EVENTS = 1_000
_MOST_SCRIPT_BYTES = 4 << 20


class _Located(ConsoleError):
    """A failure whose message already contains its location."""


class Console:
    """State of a console; prints through two functions.

    Args:
        link: The connection.
        out: Prints a line of an answer.
        note: Prints a line that is not part of an answer.
        notes_level: Events printed without a command: ``warning`` for this level and above,
            ``fallback`` for outputs of this console that fell back.
    """

    def __init__(
        self,
        link: LeasedClient,
        out: Callable[[str], None],
        note: Callable[[str], None],
        *,
        notes_level: str = "fallback",
    ) -> None:
        self.link = link
        self.mine: set[str] = set()
        self.stops_on_error = True
        self.failures = 0
        self._out = out
        self._note = note
        self._notes_level = notes_level
        self._names: SymbolNames | None = None
        self._events: deque[dict[str, Any]] = deque(maxlen=_MOST_EVENTS)
        self._directories: list[Path] = [Path()]
        self._client_number = link.client_number
        link.subscribe(True)

    def out(self, text: str) -> None:
        """Print a line of the answer."""
        self._out(text)

    def note(self, text: str) -> None:
        """Print a note, separate from the answer."""
        self._note(text)

    def names(self) -> SymbolNames:
        """Return the symbols of the plan."""
        if self._names is None:
            self._names = SymbolNames(self.link.call(lambda client: client.symbols()))
        return self._names

    def forget(self) -> None:
        """Discard the symbols; they are requested again when needed."""
        self._names = None

    def commands(self) -> Mapping[str, CommandForm]:
        """Return every command by name."""
        return COMMANDS

    def events(self) -> list[dict[str, Any]]:
        """Return the events since the last call."""
        self.tell()
        found = list(self._events)
        self._events.clear()
        return found

    def tell(self) -> None:
        """Report events between commands: a lost connection, outputs that fell back."""
        if self.link.client_number != self._client_number:  # another connection: all fell back
            self._client_number = self.link.client_number
            self.mine.clear()
        while self.link.notices:
            self.forget()  # another plan may be loaded by now
            self.note(self.link.notices.popleft())
        for event in self.link.events():
            self._events.append(event)
            kind = event.get("event")
            # Arm events and edges are answers to commands of this user and are shown anyway.
            loud = event.get("level") in ("warning", "error") and kind not in ("arm", "edge")
            if kind == "fallback" and (mine := self.mine & set(event.get("outputs", ()))):
                # Reported once, because they are no longer outputs of this console.
                self.mine -= mine
                self.note(f"{event_line(event)}: {' '.join(sorted(mine))}")
            elif loud and self._notes_level == "warning":
                self.note(event_line(event))

    def sleep(self, wait_s: float) -> None:
        """Wait; a lost connection ends it.

        Raises:
            EnvironmentFault: The connection broke.
        """
        until = time.monotonic() + wait_s
        while (left := until - time.monotonic()) > 0:
            time.sleep(min(_SLICE_S, left))
            self.link.call(lambda _: None)  # reports a broken connection; collects events
        self.tell()

    def owned(self) -> list[str]:
        """Return the outputs of this console; if the server does not answer, those it has set."""
        me = self.link.client_number
        try:
            symbols = self.link.call(lambda client: client.symbols(), wait_s=_END_S)
        except (ControlRefused, EnvironmentFault):
            return sorted(self.mine)
        return [s.name for s in symbols if s.client == me]

    def run_line(self, text: str) -> None:
        """Run the commands of a line at the prompt; the first failure ends the line.

        Raises:
            ConsoleError: A command failed.
            EnvironmentFault: A command was refused, or the server does not answer.
        """
        for command in parse(text):
            self._do(command)

    def run_script(self, text: str, name: str, *, first_line: int = 1) -> None:
        """Run a script, or a part of it that starts at a given line.

        If any command is unknown, none is executed.

        Raises:
            ConsoleError: A command failed; the message begins with name, line and column.
            EnvironmentFault: The server no longer answers.
        """
        try:
            commands = parse(text)
            # All commands are checked before the first one runs: a typing error in line 40 must not
            # leave a bus partly set.
            self._check(commands)
        except ScriptError as exc:
            raise self._at(name, exc.line + first_line - 1, exc.column, exc) from exc
        for command in commands:
            line = command.line + first_line - 1
            try:
                self._do(command)
            except _Located as exc:
                self._failed(exc)
            except ScriptError as exc:
                self._failed(self._at(name, line, exc.column, exc))
            except (ConsoleError, ControlRefused) as exc:
                self._failed(self._at(name, line, command.column, exc))
            # The server no longer answers, so the remaining commands cannot run.
            except EnvironmentFault as exc:
                raise EnvironmentFault(f"{name}:{line}:{command.column}: {exc}") from exc

    def run_file(self, path: str) -> None:
        """Run a script of a file; a path in a script is relative to that script.

        Raises:
            ConsoleError: The file cannot be read, or as in `run_script`.
        """
        found = self._directories[-1] / path
        try:
            # A device file or a dump given by mistake must not fill the memory.
            if found.stat().st_size > _MOST_SCRIPT_BYTES:
                raise ConsoleError(f"{found} is too long for a script: more than 4 MiB")
            text = found.read_text("utf-8")
        except OSError as exc:
            raise ConsoleError(f"{found}: {exc.strerror or exc}") from exc
        except UnicodeDecodeError as exc:
            raise ConsoleError(f"{found} is not UTF-8 text") from exc
        # A script that runs itself would otherwise end in a stack overflow.
        if len(self._directories) > _DEEPEST:
            raise ConsoleError(f"{path}: more than {_DEEPEST} scripts inside each other")
        self._directories.append(found.parent)
        try:
            self.run_script(text, str(found))
        finally:
            self._directories.pop()

    def _failed(self, error: ConsoleError) -> None:
        self.failures += 1
        if self.stops_on_error:
            raise error
        self.note(f"error: {error}")

    @staticmethod
    def _at(name: str, line: int, column: int, error: Exception) -> _Located:
        is_usage = isinstance(error, ScriptError)
        return _Located(f"{name}:{line}:{column}: {error}", is_usage=is_usage)

    def _check(self, commands: Sequence[ConsoleCommand]) -> None:
        """Reject a script with an unknown command.

        Raises:
            ScriptError: At the first unknown command.
        """
        for command in commands:
            if command.name not in COMMANDS:
                raise _unknown(command)

    def _do(self, command: ConsoleCommand) -> None:
        form = COMMANDS.get(command.name)
        if form is None:
            raise _unknown(command)
        form.do(self, list(command.words[1:]))
        self.tell()


def _unknown(command: ConsoleCommand) -> ScriptError:
    close = guesses(command.name, sorted(COMMANDS), cutoff=0.5)
    hint = f"did you mean {one_of(close)}?" if close else "help lists them"
    message = f"unknown command {command.name}; {hint}"
    return ScriptError(message, command.line, command.column)
