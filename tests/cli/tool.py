"""Runs the command line as a user does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def fsn(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [sys.executable, "-m", "fsoe_net.cli", *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        check=False,
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done
