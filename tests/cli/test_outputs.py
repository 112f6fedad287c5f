"""Whole outputs of commands, on the files of ``diagnostics/base``.

`outputs.yaml` holds the words of each call, what is changed before (file, text to find, text to put
there), the exit code and all that is printed. Run this file to write it anew, and read the
difference: ``PYTHONPATH=tests python tests/cli/test_outputs.py``.
"""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import tempfile
from pathlib import Path

import pytest
import yaml
from cases_file import write_cases
from cli.tool import fsn

from fsoe_net.version import __version__

HERE = Path(__file__).parent
BASE = HERE.parent / "diagnostics" / "base"
CASES: list[dict] = yaml.safe_load((HERE / "outputs.yaml").read_text("utf-8"))


def printed(case: dict, folder: Path) -> tuple[int, str]:
    """Return the exit code and what is printed, errors behind the rest."""
    shutil.copytree(BASE, folder, dirs_exist_ok=True)
    shutil.copy(folder / "network.yaml", folder / "changed.yaml")
    for file, find, put in case.get("edit", ()):
        text = (folder / file).read_text("utf-8")
        assert find in text, f"{find!r} is not in {file}"
        (folder / file).write_text(text.replace(find, put, 1), "utf-8")
    env = {**os.environ, "COLUMNS": "100"}
    done = fsn(*shlex.split(case["call"]), cwd=folder, env=env)
    return done.returncode, (done.stdout + done.stderr).replace(__version__, "VERSION")


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.get("name") or case["call"])
def test_all_that_is_printed(case: dict, tmp_path: Path):
    assert printed(case, tmp_path) == (case["code"], case["prints"])


def _write() -> None:
    for case in CASES:
        with tempfile.TemporaryDirectory() as folder:
            case["code"], case["prints"] = printed(case, Path(folder))
    write_cases(HERE / "outputs.yaml", CASES, "test_outputs.py")


if __name__ == "__main__":
    sys.exit(_write())
