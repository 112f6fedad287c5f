"""Helper processes that end when the process that started them does, however that ends."""

from __future__ import annotations

import shutil
from pathlib import Path

_TIE = ["setpriv", "--pdeathsig", "KILL"] if shutil.which("setpriv") else []


def tied(*command: str | Path) -> list[str]:
    """Return how a command is run so that the kernel kills it when its parent has gone."""
    return [*_TIE, *map(str, command)]
