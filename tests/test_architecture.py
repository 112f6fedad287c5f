"""The house: small rooms, and promises about them that a reader can rely on."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MODULES = sorted((ROOT / "fsoe_net").rglob("*.py"))


def test_only_the_core_facade_imports_the_compiled_module():
    users = [p for p in MODULES if re.search(r"import _core\b|_core import", p.read_text("utf-8"))]
    assert [p.name for p in users] == ["module.py"]


def test_only_the_command_line_prints():
    printing = [
        str(p)
        for p in MODULES
        if p.parent.name != "cli" and re.search(r"\bprint\(|sys\.exit\(", p.read_text("utf-8"))
    ]
    assert printing == []


def test_time_is_an_argument_below_run():
    for layer in ("fsoe", "plan", "rules", "emul", "model", "load", "save"):
        for path in (ROOT / "fsoe_net" / layer).glob("*.py"):
            text = path.read_text("utf-8")
            assert not re.search(r"^\s*(import time|from time|import datetime)", text, re.M), path


def test_modules_stay_readable():
    long = {str(p): n for p in MODULES if (n := len(p.read_text("utf-8").splitlines())) > 500}
    assert long == {}


def test_check_needs_neither_compiled_part_nor_heavy_imports():
    code = (
        "import sys, fsoe_net.cli.check\n"
        "bad = {'fsoe_net.core', 'fsoe_net.run', 'rich', 'xacro', 'cffi'} & set(sys.modules)\n"
        "sys.exit(str(bad) if bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_texts_reach_the_terminal_through_one_function():
    """`click.echo` prints what it is given; two writers make each part printable themselves."""
    users = {p.name for p in MODULES if re.search(r"click\.(echo|secho)\(", p.read_text("utf-8"))}
    assert users == {"terminal.py", "output.py", "decode_output.py"}


def test_the_settings_for_an_editor_name_files_that_are_there():
    settings_ = json.loads((ROOT / ".vscode" / "settings.json").read_text("utf-8"))
    for schema, patterns in settings_["yaml.schemas"].items():
        assert (ROOT / schema).is_file()
        for pattern in [patterns] if isinstance(patterns, str) else patterns:
            assert pattern.startswith("**/") or any(ROOT.glob(pattern)), pattern


@pytest.mark.parametrize("kind", ["BOOL", "CHAR", "SHORT", "INT", "LLONG"])
def test_the_cyclic_path_is_not_compiled_where_an_atomic_takes_a_lock(kind, tmp_path):
    core = ROOT / "master_core" / "src"
    for path in (core / "rt").glob("*.[ch]"):
        assert "stdatomic.h" not in path.read_text("utf-8") or path.name == "atomics.h"
    words = ["cc", "-std=c11", "-fsyntax-only", f"-I{core}", f"-I{core.parent / 'include'}"]
    machine = tmp_path / "machine.h"
    for lock_free in (2, 1):
        name = f"ATOMIC_{kind}_LOCK_FREE"
        machine.write_text(f"#include <stdatomic.h>\n#undef {name}\n#define {name} {lock_free}\n")
        done = subprocess.run(
            [*words, "-include", str(machine), str(core / "rt" / "wire.c")],
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode == 0) is (lock_free == 2), done.stderr
    assert " is lock-free" in done.stderr
