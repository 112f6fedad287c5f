"""Where real files and recorded runs lie; tests that need them skip with a reason."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("FSN_TEST_DATA", ROOT.parent / "shared" / "data"))


def need(*parts: str) -> Path:
    """Return a data file or folder, or skip the test."""
    path = DATA.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"no data at {path}; set FSN_TEST_DATA")
    return path


def listed(folder: str, pattern: str) -> list[str]:
    """Return the names of data files, for parametrising; a dummy when there are none."""
    found = sorted(p.name for p in DATA.joinpath(folder).glob(pattern))
    return found or ["absent"]
