"""A failed test prints a command that fails in the same way."""

import os
import shlex
import subprocess
import sys

import pytest
from weekly import first
from wires import ROOT, TESTS

_FAILS = """
from hypothesis import given, settings, strategies as st

@given(st.binary())
@settings(database=None)
def test_fails(data):
    with open("drawn", "a") as file:
        print(data, file=file)
    assert len(data) < 5
"""


@pytest.mark.parametrize("workers", first(1, [("-n", "1"), ()]), ids=["beside others", "alone"])
def test_drawings_are_repeated(tmp_path, workers):
    (tmp_path / "test_it.py").write_text(_FAILS)
    drawn = tmp_path / "drawn"

    def run(*words):
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "repeat", *words],
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": f"{ROOT}:{TESTS}"},
        )
        assert done.returncode == 1, done.stdout + done.stderr
        text = drawn.read_text()
        drawn.unlink()
        return text, done.stdout.splitlines()

    first, said = run(*workers)
    told = said[next(n for n, line in enumerate(said) if " to repeat it -" in line) + 1]
    assert told.startswith("python -m pytest test_it.py::test_fails --hypothesis-seed=")
    assert run(*shlex.split(told)[3:])[0] == first
