"""A test that hangs is ended, and its report tells where: threads, processes and what they said."""

import os
import re
import subprocess
import sys

import pytest
from tied import tied
from weekly import first
from wires import ROOT, TESTS

_CHILD = """
import sys, time
print("so far", file=sys.stderr, flush=True)
print("here", flush=True)
time.sleep(9999)
"""
_HANGS = f"""
import subprocess, sys, threading, time
from tied import tied

def waits_for_ever():
    time.sleep(9999)

def test_of_a_program():
    child = subprocess.Popen(tied(sys.executable, "-c", {_CHILD!r}), stdout=subprocess.PIPE,
                             stderr=subprocess.PIPE)
    child.stdout.readline()
    threading.Thread(target=waits_for_ever, daemon=True).start()
    child.wait()

def test_after_it():
    pass
"""
# As code in C that never comes back.
_DEAF = """
import signal, time

def test_that_hears_nothing():
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
    time.sleep(9999)
"""


def _pytest(tmp_path, text, *options):
    (tmp_path / "test_hangs.py").write_text(text)
    return subprocess.run(
        tied(
            sys.executable, "-m", "pytest", "-p", "stuck", "-p", "no:cacheprovider", *options, "."
        ),
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": f"{ROOT}:{TESTS}"},
    )


@pytest.mark.parametrize("workers", [(), ("-n", "1")], ids=["alone", "beside others"])
def test_a_test_that_hangs_fails_and_reports_where(tmp_path, workers):
    done = _pytest(tmp_path, _HANGS, "-o", "timeout=2", *workers)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "1 failed, 1 passed" in done.stdout
    assert "Timeout (>2.0s) from pytest-timeout." in done.stdout
    stacks, _, processes = done.stdout.partition("- Captured processes of the test call -")
    assert "in waits_for_ever" in stacks.partition("- Captured stacks of all threads call -")[2]
    child = re.search(
        r"^\d+: .*\n.*\n.*\n.*\ntime\.sleep\(9999\)\n  thread \d+ S .*$", processes, re.MULTILINE
    )
    assert child, done.stdout
    said = processes[child.end() :].splitlines()[1:5]
    assert said[0] == "  | so far"
    assert said[1] == "  | Fatal Python error: Aborted"
    assert re.fullmatch(r"  \| Current thread 0x\w+ \(most recent call first\):", said[3])


@pytest.mark.parametrize("workers", first(1, [("-n", "1"), ()]), ids=["beside others", "alone"])
def test_code_that_serves_no_signal_is_ended_too(tmp_path, workers):
    # Longer than a worker needs to begin: pytest itself waits twice as long for its first word.
    limits = ["-o", "timeout=40", "-o", "faulthandler_timeout=8"]
    done = _pytest(tmp_path, _DEAF, *limits, "-o", "faulthandler_exit_on_timeout=true", *workers)
    assert done.returncode == 1
    assert "Timeout (0:00:08)!" in done.stderr
    assert "in test_that_hears_nothing" in done.stderr


def test_workers_that_are_silent_end_with_pytest(tmp_path):
    done = _pytest(tmp_path, _DEAF, "-o", "faulthandler_timeout=5", "-n", "1")
    assert done.returncode == 1
    assert "Timeout (0:00:10)!" in done.stderr
    assert "xdist" in done.stderr.partition("most recent call first")[2]
