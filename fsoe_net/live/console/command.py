"""A command of the console, and its context."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from fsoe_net.document.model import Column, Document, Table, cell
from fsoe_net.document.write_terminal import document_text
from fsoe_net.errors import ConsoleError
from fsoe_net.live.console.leased_client import LeasedClient
from fsoe_net.live.console.names import SymbolNames


class CommandContext(Protocol):
    """Services of the console for commands."""

    link: LeasedClient
    mine: set[str]
    stops_on_error: bool

    def out(self, text: str) -> None:
        """Print a line of the answer."""

    def note(self, text: str) -> None:
        """Print a note on standard error, separate from the answer."""

    def names(self) -> SymbolNames:
        """Return the symbols of the plan."""

    def forget(self) -> None:
        """Discard the symbols; they are requested again when needed."""

    def events(self) -> list[dict[str, Any]]:
        """Return the events since the last call."""

    def run_file(self, path: str) -> None:
        """Run a script."""

    def commands(self) -> Mapping[str, CommandForm]:
        """Return every command by name."""

    def sleep(self, wait_s: float) -> None:
        """Wait; Ctrl-C and a lost connection end it."""


@dataclass(frozen=True, slots=True)
class CommandForm:
    """A command: its usage after the name, one line of help, an example, its function."""

    usage: str
    about: str
    example: str
    do: Callable[[CommandContext, Sequence[str]], None]


def usage(name: str, form: str) -> ConsoleError:
    """Return the usage error of a command."""
    return ConsoleError(f"usage: {name} {form}".rstrip(), is_usage=True)


def options(words: Sequence[str], *known: str) -> tuple[list[str], set[str]]:
    """Split words into arguments and options.

    Raises:
        ConsoleError: Unknown option.
    """
    given = {w for w in words if w.startswith("--")}
    wrong = sorted(given - set(known))
    if wrong:
        hint = f"; here is {' '.join(known)}" if known else ""
        raise ConsoleError(f"unknown option {wrong[0]}{hint}", is_usage=True)
    return [w for w in words if w not in given], given


def table(rows: Sequence[Sequence[str]], *head: str) -> list[str]:
    """Return rows as lines with even columns."""
    if not rows:
        return []
    columns = tuple(Column(title) for title in head or [""] * len(rows[0]))
    cells = tuple(tuple(cell(text) for text in row) for row in rows)
    return document_text(Document(lead=(Table(columns=columns, rows=cells),))).splitlines()
