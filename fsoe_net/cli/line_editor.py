"""A line editor with completion and history, if Python has readline."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from fsoe_net.errors import FsnError
from fsoe_net.live.console.completion import complete
from fsoe_net.live.console.console import COMMANDS, Console

_HISTORY_LINES = 2_000


@contextlib.contextmanager
def line_editor(console: Console) -> Iterator[None]:
    """Give `input` completion and a history file, if Python has readline."""
    try:
        import readline
    except ImportError:
        yield
        return
    found: list[str] = []

    def completer(word: str, state: int) -> str | None:
        nonlocal found
        # Readline calls with increasing states; the list is made once per word.
        if state == 0:
            before = readline.get_line_buffer()[: readline.get_begidx()]
            try:
                names = console.names()
                found = complete(before, word, names, list(COMMANDS))
            except FsnError:
                found = []
        return f"{found[state]} " if state < len(found) else None

    readline.set_completer(completer)
    # Without the dot: `drive_1.0x6040` is one word.
    readline.set_completer_delims(" \t\n;=")
    readline.parse_and_bind("tab: complete")
    readline.set_history_length(_HISTORY_LINES)
    path = _history_file()
    if path is not None:
        with contextlib.suppress(OSError):
            readline.read_history_file(path)
    try:
        yield
    finally:
        if path is not None:
            with contextlib.suppress(OSError):
                readline.write_history_file(path)
                # The history contains names and values of a machine.
                path.chmod(0o600)


def _history_file() -> Path | None:
    """Return the history file, private to this user, or ``None`` if there is no place for it."""
    state = os.environ.get("XDG_STATE_HOME", "")
    base = Path(state) if os.path.isabs(state) else Path("~/.local/state").expanduser()
    path = base / "fsoe-net" / "console_history"
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        os.close(os.open(path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600))
        path.chmod(0o600)
    except (OSError, RuntimeError):
        return None
    return path
