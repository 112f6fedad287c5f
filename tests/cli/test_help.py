"""What `--help`, an empty command line and the shell offer."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import EXAMPLES

from fsoe_net.cli.main import cli

ROOT = Path(__file__).parents[2]


def test_help_groups_the_commands_as_readme_does():
    text = fsn("--help").stdout
    groups: dict[str, list[str]] = {}
    for block in text.split("\n\n"):
        title, *rows = block.splitlines()
        if title.endswith(":") and not title.startswith((" ", "Options", "Examples")):
            groups[title[:-1]] = re.findall(r"^  ([a-z0-9-]+) ", "\n".join(rows), re.MULTILINE)
    assert sorted(c for names in groups.values() for c in names) == sorted(cli.list_commands(None))
    sections = re.split(r"^## ", (ROOT / "README.md").read_text("utf-8"), flags=re.MULTILINE)
    titles = [section.partition("\n")[0] for section in sections]
    assert [title for title in titles if title in groups] == list(groups)
    for title, commands in groups.items():
        section = sections[titles.index(title)]
        assert [c for c in commands if f"fsoe-net {c}" not in section] == [], title


def test_check_takes_the_network_of_the_folder(tmp_path: Path):
    done = fsn("check", cwd=EXAMPLES / "estop")
    assert done.returncode == 0
    assert "estop: no findings, 2 SubDevices" in done.stdout
    done = fsn("check", cwd=tmp_path)
    assert done.returncode == 2
    assert "name the files to check; there is no network.yaml in this folder" in done.stderr
    (tmp_path / "network.yaml").mkdir()
    assert fsn("check", cwd=tmp_path).returncode == 2


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
        "fsoe-net verify --interface ",
    ],
)
def test_names_of_interfaces_are_completed(words: str):
    names = sorted(name for _, name in socket.if_nameindex() if name != "lo")
    assert completed(words) == [f"plain,{name}" for name in names]


def test_files_folders_and_codes_are_completed():
    assert completed("fsoe-net check net") == ["file,net"]
    assert completed("fsoe-net scan -o b") == ["dir,b"]
    assert "plain,FSN203" in completed("fsoe-net explain FSN20")
