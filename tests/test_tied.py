"""Helpers of tests leave nothing behind when the tests themselves are killed."""

import os
import select
import signal
import subprocess
import sys

import pytest
from patience import PATIENCE_S
from tied import tied
from wires import ROOT, TESTS, attempts, missing

# A session of its own, as fsn-master has: no signal of a terminal reaches it.
_CHILD = """
import os, sys, time
from patience import PATIENCE_S
os.setsid()
fifo = open(sys.argv[1], "w")
print("here", file=fifo, flush=True)
time.sleep(600)
"""


def test_it_does_not_begin_where_its_parent_has_gone_before():
    here = tied(sys.executable, "-c", "print('here')")
    assert subprocess.run(here, capture_output=True, check=True).stdout == b"here\n"
    gone = tied(sys.executable, "-c", "print('here')", parent=os.getppid())
    assert subprocess.run(gone, capture_output=True, check=False).stdout == b""


def test_a_command_begins_where_path_holds_no_shell(tmp_path):
    here = tied(sys.executable, "-c", "print('here')")
    done = subprocess.run(here, env={"PATH": str(tmp_path)}, capture_output=True, check=True)
    assert done.stdout == b"here\n"


@pytest.mark.parametrize(
    "start",
    [
        "from tied import tied; subprocess.run(tied(*words))",
        "from wires import run_inside; run_inside(*words)",
    ],
    ids=["a process", "a namespace"],
)
def test_a_helper_ends_with_the_one_that_started_it(start, tmp_path):
    if "wires" in start and missing():
        pytest.skip(missing())
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    words = [sys.executable, "-c", _CHILD, str(fifo)]
    parent = subprocess.Popen(
        tied(sys.executable, "-c", f"import subprocess; words = {words!r}; {start}"),
        env=os.environ | {"PYTHONPATH": f"{ROOT}:{TESTS}"},
    )
    with open(fifo, encoding="utf-8") as heard:  # waits for the child to open it
        assert heard.readline() == "here\n"
        parent.send_signal(signal.SIGKILL)
        parent.wait()
        assert select.select([heard], [], [], PATIENCE_S)[0]
        assert heard.readline() == ""  # the child, who held the other end, is gone


def test_an_attempt_finds_the_folder_as_the_first_did(tmp_path):
    (tmp_path / "given").touch()
    for _ in attempts(tmp_path, 3):
        assert [path.name for path in tmp_path.iterdir()] == ["given"]
        (tmp_path / "file").touch()
        (tmp_path / "folder").mkdir()
        (tmp_path / "folder" / "file").touch()
    assert (tmp_path / "folder" / "file").exists()  # of the last one, for a person to read
