"""Helper processes that end when the process that started them does, however that ends."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

# By their paths: a test may run its command with another PATH, or with none of the system's.
_SETPRIV = shutil.which("setpriv")
_TIE = [_SETPRIV, "--pdeathsig", "KILL"] if _SETPRIV else []
# The parent may have gone before the kernel was asked.
_IF_THERE = ["/bin/sh", "-c", '[ "$PPID" = "$0" ] && exec "$@"']


def tied(*command: str | Path, parent: int = 0) -> list[str]:
    """Return how a command is run so that the kernel kills it when its parent has gone.

    Args:
        command: it and its arguments.
        parent: process that runs it; 0: this one.
    """
    return [*_TIE, *_IF_THERE, str(parent or os.getpid()), *map(str, command)]
