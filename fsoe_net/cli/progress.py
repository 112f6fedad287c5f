"""A progress bar for long operations."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from fsoe_net.cli.terminal import is_screen, terminal
from fsoe_net.simulate.campaign import Progress


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
