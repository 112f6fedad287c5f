"""The one way to standard output and standard error: nothing in a text acts on the terminal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import click

from fsoe_net.diag.printable import printable

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType

__all__ = ["echo", "terminal"]


def echo(
    text: str = "", *, err: bool = False, nl: bool = True, fg: str | None = None, bold: bool = False
) -> None:
    """Print a text; whatever it holds, nothing in it acts on the terminal.

    Args:
        text: Lines of any origin; names in them come from files, devices and the network.
        err: Print to standard error.
        nl: End with a line break.
        fg: Colour on a terminal, as `click.style` names them.
        bold: Bold on a terminal.
    """
    shown = printable(text, keep="\n\t")
    click.echo(
        click.style(shown, fg=fg, bold=bold or None) if fg or bold else shown, err=err, nl=nl
    )


def terminal(*, err: bool = False, width: int | None = None) -> Console:
    """Return a console of rich that shows texts as `echo` does.

    Args:
        err: For standard error.
        width: Columns where the output is not a terminal.
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

    console = _Console(stderr=err, highlight=False)
    if width is not None and not console.is_terminal:
        return _Console(stderr=err, highlight=False, width=width)
    return console
