"""What `--help`, an empty command line and the shell offer."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import EXAMPLES

from fsoe_net.cli.main import cli


def test_help_names_each_command_once():
    text = fsn("--help").stdout
    groups: dict[str, list[str]] = {}
    for block in text.split("\n\n"):
        title, *rows = block.splitlines()
        if title.endswith(":") and not title.startswith((" ", "Options", "Examples")):
            groups[title[:-1]] = re.findall(r"^  ([a-z0-9-]+) ", "\n".join(rows), re.MULTILINE)
    assert sorted(c for names in groups.values() for c in names) == sorted(cli.list_commands(None))


def test_check_takes_the_network_of_the_folder(tmp_path: Path):
    done = fsn("check", cwd=EXAMPLES / "estop")
    assert done.returncode == 0
    assert "estop: no findings, 2 SubDevices" in done.stdout
    done = fsn("check", cwd=tmp_path)
    assert done.returncode == 2
    assert "name a network; there is no network.yaml in this folder" in done.stderr
    (tmp_path / "network.yaml").mkdir()
    assert fsn("check", cwd=tmp_path).returncode == 2


# What takes a network, with what else the command needs.
OF_A_NETWORK = {
    "check": "",
    "plan": "",
    "convert": "-o {out}/bus.h --to c",
    "run": "--virtual-time --duration 1s",
    "timing": "",
    "test-record": "-o {out}/test-record.yaml",
    "report": "-o {out}/report.html",
    "acceptance verify": "--accepted {folder}/network.yaml",
    "campaign": "--faults loss --cycles 100",
}


@pytest.mark.parametrize("command", OF_A_NETWORK)
def test_each_command_takes_the_network_of_the_folder_or_of_one_that_is_named(
    command: str, tmp_path: Path
):
    folder = EXAMPLES / "estop"
    more = OF_A_NETWORK[command].format(out=tmp_path, folder=folder).split()
    words = command.split()
    inside = fsn(*words, *more, cwd=folder)
    assert inside.returncode == 0, inside.stderr
    named = fsn(*words, str(folder), *more, *["--overwrite"] * ("-o" in more), cwd=tmp_path)
    assert named.returncode == 0, named.stderr
    assert fsn(*words, *more, cwd=tmp_path).returncode == 2


def test_other_words_for_help_version_and_commands():
    assert fsn("help").stdout == fsn("--help").stdout
    assert fsn("help", "plan").stdout == fsn("plan", "--help").stdout
    assert fsn("version").stdout == fsn("--version").stdout
    assert fsn("validate", "--help").stdout == fsn("check", "--help").stdout
    assert fsn("gui", "--help").stdout == fsn("studio", "--help").stdout
    assert "Did you mean 'acceptance verify'?" in fsn("verify").stderr


@pytest.mark.parametrize("env", [{"NO_COLOR": "1"}, {"TERM": "dumb"}, {}])
def test_colours_are_left_out_where_they_are_not_wanted(env: dict[str, str], tmp_path: Path):
    (tmp_path / "network.yaml").write_text("nets: 3\n")
    base = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "TERM")}
    near, far = os.openpty()
    done = subprocess.run(
        [sys.executable, "-m", "fsoe_net.cli", "check", str(tmp_path)],
        stdin=subprocess.DEVNULL,
        stdout=far,
        stderr=far,
        env=base | {"TERM": "xterm"} | env,
        check=False,
    )
    os.close(far)
    said = b""
    with contextlib.suppress(OSError):
        while part := os.read(near, 4096):
            said += part
    os.close(near)
    assert done.returncode == 1
    assert b"FSN" in said
    assert (b"\x1b[" in said) == (not env)


def test_a_name_is_shown_whole_in_a_locale_without_utf_8(tmp_path: Path):
    folder = tmp_path / "Zelle ä"
    folder.mkdir()
    env = dict(os.environ, LC_ALL="C", PYTHONUTF8="0")
    done = subprocess.run(
        [sys.executable, "-m", "fsoe_net.cli", "check", str(folder / "n.yaml")],
        env=env,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 1
    assert f"{folder}/n.yaml: error[FSN101]".encode() in done.stdout


def test_ctrl_c_while_the_tool_is_loaded(tmp_path: Path):
    (tmp_path / "click.py").write_text("import time\nprint(flush=True)\ntime.sleep(60)\n")
    with subprocess.Popen(
        [sys.executable, "-m", "fsoe_net.cli", "check"],
        env=dict(os.environ, PYTHONPATH=str(tmp_path)),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert process.communicate() == (b"", b"interrupted\n")
    assert process.returncode == 130


def test_a_file_system_that_is_read_only_is_named():
    mounts = 'mount --bind . . && mount -o remount,bind,ro . && cd . && exec "$@"'
    apart = ["unshare", "--map-root-user", "--mount", "sh", "-c", mounts, "sh"]
    if subprocess.run([*apart, "true"], check=False, capture_output=True).returncode:
        pytest.skip("no name spaces for mounts here")
    call = [sys.executable, "-m", "fsoe_net.cli", "plan", "-o", f"{EXAMPLES}/estop/x.fsnplan"]
    done = subprocess.run(
        [*apart, *call],
        cwd=EXAMPLES / "estop",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 3
    assert "x.fsnplan: the file system is read-only\n" in done.stderr


def completed(words: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", "from fsoe_net.cli.main import cli; cli(prog_name='fsoe-net')"],
        env=os.environ
        | {
            "_FSOE_NET_COMPLETE": "bash_complete",
            "COMP_WORDS": words,
            "COMP_CWORD": str(len(words.split(" ")) - 1),
        },
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


@pytest.mark.parametrize(
    "words",
    [
        "fsoe-net doctor --interface ",
        "fsoe-net run n.yaml --interface ",
        "fsoe-net run n.yaml --redundant ",
        "fsoe-net emulate n.yaml --interface ",
        "fsoe-net monitor --interface ",
        "fsoe-net check --interface ",
        "fsoe-net scan --interface ",
        "fsoe-net init --interface ",
        "fsoe-net acceptance verify --interface ",
    ],
)
def test_names_of_interfaces_are_completed(words: str):
    names = sorted(name for _, name in socket.if_nameindex() if name != "lo")
    assert completed(words) == [f"plain,{name}" for name in names]


def test_files_folders_and_codes_are_completed():
    assert completed("fsoe-net check net") == ["file,net"]
    assert completed("fsoe-net scan -o b") == ["dir,b"]
    assert "plain,FSN203" in completed("fsoe-net explain FSN20")
