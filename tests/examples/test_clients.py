"""The example clients do what they say, with warnings as errors."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from master import rig
from networks import EXAMPLES

from fsoe_net.testing.fake_master import FakeMaster

CLIENTS = EXAMPLES / "clients"
WARNINGS = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wpedantic", "-Wconversion", "-Wshadow"]


def run(*command: object) -> subprocess.CompletedProcess[str]:
    words = [str(word) for word in command]
    return subprocess.run(words, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def ask(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    path = tmp_path_factory.mktemp("ask") / "ask"
    done = run(compiler, *WARNINGS, "-o", path, CLIENTS / "ask.c")
    assert (done.returncode, done.stderr) == (0, "")
    return path


def test_client_in_c(ask: Path):
    with FakeMaster() as master:
        master.refuse["arm"] = {"text": "no"}
        done = run(ask, master.path, "events on", "set drive_1.0x6040:00=6", "arm x", "restart")
    assert done.returncode == 1
    found = [line.strip("{}").partition(",")[0] for line in done.stdout.splitlines()]
    assert found == ['"ok":true', '"ok":true', '"ok":false', '"ok":true']
    assert run(ask, "/no/such", "hello").returncode == 3
    assert run(ask).returncode == 2


def test_client_in_c_with_long_replies(ask: Path):
    with FakeMaster() as master:
        master.symbols *= 300
        done = run(ask, master.path, "symbols", "get drive_1.0x6041:00")
    assert done.returncode == 0
    first, second = done.stdout.splitlines()
    assert len(first) > 1 << 17
    assert second.endswith('{"drive_1.0x6041:00":39},"outputs":{}}')


def test_client_in_c_with_fsn_master(ask: Path):
    with rig.running() as master:
        done = run(ask, master.path, "hello", "set drive_1.0x6040:00=6", "nix")
    assert done.returncode == 1
    assert done.stdout.splitlines()[1] == '{"ok":true,"set":1}'


def test_client_in_python():
    with FakeMaster() as master:
        done = run(sys.executable, CLIENTS / "watch_state.py", master.path, "drive_1.0x6040:00")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "running: 5 cycles of 1 ms",
        "c1: data_process",
        "drive_1.0x6040:00 = 1",
        "cycle 10: 1, 0 left out",
        "cycle 20: 1, 0 left out",
        "cycle 50: 1, 2 left out",
    ]
    done = run(sys.executable, CLIENTS / "watch_state.py", "/no/such")
    assert done.returncode == 1
    assert "is fsn-master running" in done.stderr
