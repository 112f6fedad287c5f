"""The commands of a page of the documentation, as a shell in a folder runs them."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

from master.rig import killed_at_the_end, program, when_it_listens
from patience import PATIENCE_S
from tied import tied


def page_commands(page: str) -> list[str]:
    """Return the lines of the console blocks of a page that begin with a prompt."""
    blocks = re.findall(r"^```console\n(.*?)^```", page, re.M | re.S)
    lines = [line for block in blocks for line in block.splitlines()]
    return [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]


class Session:
    """A shell: programs that end, and with `` &`` programs that run next to it."""

    def __init__(self, folder: Path, domain: int, stack: ExitStack) -> None:
        self.folder, self._stack = folder, stack
        programs = str(Path(sys.executable).parent)
        self._env = os.environ | {
            "PATH": f"{Path(program()).parent}:{programs}:{os.environ['PATH']}",
            "ROS_DOMAIN_ID": str(domain),
        }
        self.beside: dict[str, subprocess.Popen[str]] = {}

    def run(self, line: str) -> str:
        words = shlex.split(line.removesuffix(" &"))
        if line.endswith(" &"):
            self._begin(words)
            return ""
        done = subprocess.run(
            words, cwd=self.folder, env=self._env, capture_output=True, text=True,
            check=False, timeout=PATIENCE_S,
        )  # fmt: skip
        assert done.returncode == 0, (line, done.stdout, done.stderr)
        return done.stdout + done.stderr

    def _begin(self, words: list[str]) -> None:
        """Start a program of the page, and wait until it serves."""
        process = subprocess.Popen(
            tied(*words), cwd=self.folder, env=self._env, stdout=subprocess.PIPE, text=True
        )
        self.beside[words[0]] = self._stack.enter_context(killed_at_the_end(process))
        if words[0] == "fsn-master":
            here = Path.cwd()
            os.chdir(self.folder)  # the path of a socket must be short
            try:
                when_it_listens(Path(words[words.index("--socket") + 1]), process).close()
            finally:
                os.chdir(here)
        else:
            assert process.stdout is not None
            assert process.stdout.readline().startswith("domain ")
