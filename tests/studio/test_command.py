"""``fsoe-net studio`` as a person starts and ends it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from cli.tool import fsn
from studio.server_rig import Browser
from tied import tied

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_it_prints_an_address_and_ends_quietly(end: signal.Signals, tmp_path: Path) -> None:
    command = tied(sys.executable, "-m", "fsoe_net.cli", "studio", ".", "--no-browser")
    with subprocess.Popen(
        command,
        cwd=EXAMPLES / "estop",
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=dict(os.environ, TMPDIR=str(tmp_path)),
    ) as process:
        first = process.stdout.readline()
        assert first.startswith("./network.yaml: open http://127.0.0.1:")
        assert "only what was saved is in the file" in process.stdout.readline()
        browser = Browser(first.split()[-1])
        browser.enter()
        assert browser.ask("/api/state")[0] == 200
        assert browser.give("bus.xml", b"<bus/>")[0] == 200
        assert len(list(tmp_path.iterdir())) == 1
        with browser.events() as told:  # a page that is open is in nobody's way
            assert told.readline() == b"data: 1\n"
            process.send_signal(end)
            rest, wrong = process.communicate()
    assert (rest, wrong) == ("", "")
    assert list(tmp_path.iterdir()) == []  # files that were given are gone with it
    assert process.returncode in ((0,) if end == signal.SIGINT else (0, -signal.SIGTERM))


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    done = fsn("studio", "nothing.yaml", cwd=tmp_path)
    assert done.returncode == 1
    assert "error[FSN101]: cannot read" in done.stderr
    (tmp_path / "network.yaml").write_bytes(b"\xff")
    done = fsn("studio", cwd=tmp_path)
    assert done.returncode == 1
    assert "network.yaml is not UTF-8 text" in done.stderr


def test_a_folder_without_a_network_begins_one(tmp_path: Path) -> None:
    command = tied(sys.executable, "-m", "fsoe_net.cli", "studio", "--no-browser")
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as process:
        browser = Browser(process.stdout.readline().split()[-1])
        browser.enter()
        state = browser.json("/api/state")
        process.send_signal(signal.SIGINT)
        process.communicate()
    assert (state["is_new"], state["saved"], state["subdevices"]) == (True, False, [])
    assert state["name"] == tmp_path.name
    assert list(tmp_path.iterdir()) == []


def test_the_demo_runs_an_emulated_cell_in_a_copy(tmp_path: Path) -> None:
    command = tied(sys.executable, "-m", "fsoe_net.cli", "demo", "--no-browser")
    env = dict(os.environ, TMPDIR=str(tmp_path))
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=env) as process:
        assert process.stdout is not None
        first, second = process.stdout.readline(), process.stdout.readline()
        try:
            browser = Browser(first.split()[-1].removesuffix("#live"))
            browser.enter()
            status, _, answer = browser.ask("/api/live")
        finally:
            process.send_signal(signal.SIGINT)
    assert process.returncode == 0
    assert first.startswith("e-stop cell, emulated: open http://127.0.0.1:")
    assert first.endswith("#live\n")
    assert (status, bool(json.loads(answer)["run"])) == (200, True)
    (folder,) = tmp_path.glob("fsoe-net-demo-*/estop")
    assert str(folder) in second
    original = EXAMPLES / "estop" / "network.yaml"
    assert (folder / "network.yaml").read_bytes() == original.read_bytes()
