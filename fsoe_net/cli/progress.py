"""A progress bar, and the elapsed time, of long operations; only on a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

from fsoe_net.cli.terminal import is_screen, terminal
from fsoe_net.diag.printable import printable
from fsoe_net.simulate.campaign import Progress

_QUIET_S = 1.0


@contextmanager
def progress_bar(first: str) -> Iterator[Progress | None]:
    """Show a bar on a terminal, on standard error, so that it never mixes with the report."""
    if not is_screen(err=True):
        yield None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    # The clock continues by itself, even while a slow device starts up.
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Bar(*columns, console=terminal(err=True), transient=True, redirect_stdout=False) as bar:
        task = bar.add_task(first, total=None)

        def show(done: int, total: int, name: str) -> None:
            bar.update(task, completed=done, total=total, description=name)

        yield show


@contextmanager
def elapsed_time(doing: str) -> Iterator[None]:
    """Show the elapsed time of an operation that prints nothing, if it takes more than a second.

    Args:
        doing: The operation in words.
    """
    if not is_screen(err=True):
        yield
        return
    from rich.progress import Progress as Bar
    from rich.progress import TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description}", markup=False), TimeElapsedColumn()
    bar = Bar(*columns, console=terminal(err=True), transient=True, redirect_stdout=False)
    bar.add_task(printable(doing))  # before its width is measured
    begin = Timer(_QUIET_S, bar.start)
    begin.start()
    try:
        yield
    finally:
        begin.cancel()
        begin.join()  # it may have begun to draw
        bar.stop()
