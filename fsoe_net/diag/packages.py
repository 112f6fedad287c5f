"""How to install the packages of an extra into this installation of fsoe-net."""

from __future__ import annotations

import importlib.util
import re
import shlex
import sys
import sysconfig
from importlib import metadata
from pathlib import Path

_OF_EXTRA = re.compile(r"extra\s*==\s*['\"]([\w-]+)['\"]")


def missing_package(who: str, name: str | None, extra: str) -> str:
    """Return the message for a package that cannot be imported, with the command that installs it.

    The command names the packages that the metadata of this installation lists for the extra: it
    works for a source tree, a wheel and a virtual environment alike, and does not need fsoe-net in
    the package index.

    Args:
        who: The part that needs the package, e.g. a command.
        name: The module that could not be imported.
        extra: The extra of ``pyproject.toml`` that lists it.
    """
    top = (name or extra).partition(".")[0]
    try:
        rows = metadata.requires("fsoe-net") or []
    except metadata.PackageNotFoundError:  # a source tree that was never installed
        rows = []
    wanted = [
        row.partition(";")[0].strip()
        for row in rows
        if (found := _OF_EXTRA.search(row)) and found[1] == extra
    ]
    if _is_of_the_distribution():
        return (
            f"{who} needs {top}, which is not installed; install {', '.join(wanted or [top])} from "
            "your distribution, or fsoe-net with it in a virtual environment"
        )
    pip = [sys.executable, "-m", "pip", "install"]
    # Environments made by uv have no pip.
    if importlib.util.find_spec("pip") is None:
        pip = ["uv", "pip", "install", "--python", sys.executable]
    return f"{who} needs {top}, which is not installed; {shlex.join([*pip, *(wanted or [top])])}"


def _is_of_the_distribution() -> bool:
    """Whether pip must not change this Python: PEP 668."""
    mark = Path(sysconfig.get_path("stdlib"), "EXTERNALLY-MANAGED")
    return sys.prefix == sys.base_prefix and mark.exists()
