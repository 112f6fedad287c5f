"""A real browser, and what the tests of the page need beside the library."""

from __future__ import annotations

import importlib
import os
import shutil
from types import ModuleType

import pytest

CHROMIUM = shutil.which("chromium")
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
REQUIRED = "browser" in os.environ.get("FSN_REQUIRE", "").split(",")


def needed(module: str, extra: str) -> ModuleType:
    """Return a module; absent it skips, but fails where FSN_REQUIRE names ``browser``."""
    if REQUIRED:
        return importlib.import_module(module)
    return pytest.importorskip(module, reason=f"needs fsoe-net[{extra}]")
