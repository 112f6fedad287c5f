"""Tests that are broken off leave no process, no namespace and no interface behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import uuid
from pathlib import Path

import pytest
from tied import tied
from wires import ROOT, TESTS, missing

# One of each kind of what tests start; all inherit the mark in their environment.
_TESTS = """
import contextlib, subprocess, sys
from pathlib import Path

import pytest
from cli.tool import fsn
from master.rig import running
from tied import tied
from wires import run_inside

HERE = Path(__file__).parent


@pytest.mark.parametrize("number", [1, 2])
def test_it(number):
    assert fsn("--version").returncode == 0
    subprocess.Popen(tied(sys.executable, "-c", "import time; time.sleep(600)"))
    with running():
        (HERE / f"begun{number}").touch()
        run_inside("sleep", "600")
"""


def marked(mark: str) -> list[str]:
    """Return the processes with a mark in their environment, with what they are."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if mark.encode() in (folder / "environ").read_bytes():
                words = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                found.append(f"{folder.name}: {words}")
        except OSError:
            continue
    return found


@pytest.mark.parametrize(
    ("number", "workers"),
    [(signal.SIGINT, 0), (signal.SIGTERM, 0), (signal.SIGKILL, 0), (signal.SIGKILL, 2)],
)
def test_nothing_is_left(number: signal.Signals, workers: int, tmp_path: Path):
    if missing():
        pytest.skip(missing())
    (tmp_path / "test_it.py").write_text(_TESTS, "utf-8")
    mark = f"FSN_MARK={uuid.uuid4()}"
    before = set(os.listdir("/sys/class/net"))
    options = ["-q", "-p", "no:cacheprovider", "-n", str(workers)]
    options += ["-c", str(ROOT / "pyproject.toml")]
    process = subprocess.Popen(
        tied(sys.executable, "-m", "pytest", *options, f"--rootdir={tmp_path}", str(tmp_path)),
        env=os.environ | dict([mark.split("=")]) | {"PYTHONPATH": f"{ROOT}:{TESTS}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        while len(list(tmp_path.glob("begun*"))) < max(1, workers):
            if process.poll() is not None:
                out = process.communicate()[0]
                if "skipped" in out:
                    pytest.skip(out)
                pytest.fail(out)
            time.sleep(0.05)
        assert len(marked(mark)) > 3
        process.send_signal(number)
        process.wait()
        while marked(mark):  # the time-out of the suite ends what stays, and says what it is
            time.sleep(0.05)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    assert set(os.listdir("/sys/class/net")) == before
