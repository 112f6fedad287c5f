"""The only way to standard output and standard error: text cannot control the terminal."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

import click

from fsoe_net.diag.printable import printable

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType

    from fsoe_net.document.model import Document


def echo(text: str = "", *, err: bool = False, nl: bool = True) -> None:
    """Print a text; its content cannot control the terminal.

    Args:
        text: Lines of any origin; names in them come from files, devices and the network.
        err: Print to standard error.
        nl: End with a line break.
    """
    click.echo(printable(text, keep="\n\t"), err=err, nl=nl)


def show(document: Document, *, width: int | None = None, err: bool = False) -> None:
    """Print a document: in the width of the terminal, otherwise with all columns.

    Args:
        document: The document to print.
        width: Width of running text in cells if this is not a terminal; ``None`` for whole
            paragraphs.
        err: Print to standard error.
    """
    from fsoe_net.document.write_terminal import TerminalView, document_text

    console = terminal(err=err)
    if console.is_terminal:
        console.print(TerminalView(document), crop=False)
    else:
        echo(document_text(document, width=width), err=err, nl=False)


def is_screen(*, err: bool = False) -> bool:
    """Return whether output can be replaced in place; false with ``TERM=dumb``.

    Args:
        err: For standard error.
    """
    stream = sys.stderr if err else sys.stdout
    return stream.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")


def terminal(*, err: bool = False) -> Console:
    """Return a console of rich that prints texts like `echo`.

    Args:
        err: For standard error.
    """
    from rich.console import Console
    from rich.segment import Segment

    class _Console(Console):
        def render(
            self, renderable: RenderableType, options: ConsoleOptions | None = None
        ) -> Iterable[Segment]:
            for segment in super().render(renderable, options):
                text = segment.text if segment.control else printable(segment.text, keep="\n")
                yield Segment(text, segment.style, segment.control)

    return _Console(stderr=err, highlight=False)
