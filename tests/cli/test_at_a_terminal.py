"""What commands do when a person sits at the terminal: they ask, show progress and tables."""

from __future__ import annotations

import os
import pty
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from live.watched_master import WatchedMaster
from networks import PLAIN
from tied import tied

BASE = Path(__file__).parents[1] / "diagnostics" / "base"
FSN = [sys.executable, "-m", "fsoe_net.cli"]
CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def at_terminal(*args: object, keys: str = "", cwd: Path, until: str = "") -> tuple[int, str]:
    """Run a command at a terminal of 120 columns; returns its exit code and all it showed.

    Args:
        args: Words of the command.
        keys: What is typed.
        cwd: Its folder.
        until: Ctrl-C is pressed when this is shown.
    """
    ours, theirs = pty.openpty()
    os.write(ours, keys.encode())
    done = subprocess.Popen(
        tied(*FSN, *map(str, args)),
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        cwd=cwd,
        # A program that can be started: nobody says yes to it.
        env=os.environ | {"TERM": "xterm", "COLUMNS": "120", "FSN_MASTER": sys.executable},
    )
    os.close(theirs)
    shown = b""
    while True:
        try:
            piece = os.read(ours, 65536)
        except OSError:  # the other end is closed
            break
        if not piece:
            break
        shown += piece
        if until and until.encode() in shown:
            done.send_signal(signal.SIGINT)
            until = ""
    os.close(ours)
    return done.wait(), CONTROL.sub("", shown.decode().replace("\r\n", "\n"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(BASE, tmp_path / "n"))


def test_a_page_is_set_for_the_terminal(folder: Path):
    code, text = at_terminal("explain", "FSN203", cwd=folder)
    assert code == 0
    assert "FSN203: transfer reads an output" in text
    assert "## Why" not in text  # as on the page of Markdown
    assert "Why it matters" in text


@pytest.mark.parametrize(("answer", "is_written"), [("n", False), ("y", True)])
def test_a_fix_is_asked_for(answer: str, is_written: bool, folder: Path):
    path = folder / "network.yaml"
    good = path.read_text("utf-8")
    bad = good.replace("- size: 6", "- size: 7", 1)
    path.write_text(bad, "utf-8")
    _, text = at_terminal("check", "network.yaml", "--fix", keys=f"{answer}\n", cwd=folder)
    assert "1 finding of 1 would be fixed\nWrite this? [y/N]: " in text
    assert ("written: network.yaml" in text) == is_written
    assert path.read_text("utf-8") == (good if is_written else bad)


@pytest.mark.parametrize(
    ("command", "question"),
    [
        (["scan", "--interface", "no-such-if"], "Go on? [y/N]: "),
        (["install-master", "-o", "fsn-master"], "Fetch and build it? [y/N]: "),
    ],
)
def test_nothing_is_done_without_a_yes(command: list[str], question: str, folder: Path):
    before = sorted(folder.iterdir())
    code, text = at_terminal(*command, keys="n\n", cwd=folder)
    assert question in text
    assert code == 130
    assert sorted(folder.iterdir()) == before


def test_frames_are_typed(folder: Path):
    code, text = at_terminal("decode", keys="4e 01 b6 47 0a 00\n\x04", cwd=folder)
    assert code == 0
    assert "hex of FSoE frames, end with Ctrl-D:" in text
    assert "main > sub  Session" in text


def test_a_run_shows_its_connections_as_it_goes():
    network = PLAIN / "estop"
    _, text = at_terminal("run", "network.yaml", "--duration", "1s", cwd=network)
    # Once meanwhile, once at the end; how far it comes in a second is not asked.
    assert text.count("el1918-ek1914") >= 2
    assert "ConnID" in text


def test_a_campaign_shows_how_far_it_is(folder: Path):
    words = ("campaign", "network.yaml", "--faults", "loss", "--cycles", "50")
    code, text = at_terminal(*words, cwd=folder)
    assert code == 0, text
    assert re.search(r"\rloss ━+ +50/50 ", text)
    assert "\npassed: nothing wrongly accepted, every reaction right\n" in text


def test_a_monitor_shows_and_reports_until_ctrl_c(folder: Path, tmp_path_factory):
    place = tmp_path_factory.mktemp("m")
    master = WatchedMaster(place / "s")
    try:
        code, text = at_terminal("monitor", "--socket", place / "s", cwd=folder, until="wake-up")
    finally:
        master.close()
    assert code == 0, text
    assert "soem on no-such-if · running" in text
