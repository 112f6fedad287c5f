"""The house: small rooms, and promises about them that a reader can rely on."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from collections import Counter
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
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


def test_time_is_an_argument_below_simulate():
    of_a_machine = {"intervention_log", "live"}
    layers = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    below = "|".join(layers["contracts"][0]["layers"]).partition("fsoe_net.simulate")[2]
    packages = set(re.findall(r"fsoe_net\.(\w+)", below)) - of_a_machine
    assert {"campaign", "core", "fsoe", "rules"} <= packages
    for path in MODULES:
        if path.relative_to(ROOT / "fsoe_net").parts[0] in packages:
            text = path.read_text("utf-8")
            assert not re.search(r"^\s*(import time|from time|import datetime)", text, re.M), path


def test_modules_stay_readable():
    long = {str(p): n for p in MODULES if (n := len(p.read_text("utf-8").splitlines())) > 500}
    assert long == {}


def test_each_package_states_what_belongs_in_it():
    """A format is a folder that `formats` describes; the package itself is the public API."""
    packages = [p for p in MODULES if p.name == "__init__.py" and p.parent != ROOT / "fsoe_net"]
    texts = {p: " ".join(p.read_text("utf-8").split()) for p in packages}
    others = {p: text for p, text in texts.items() if "FORMAT = " not in text}
    assert len(others) > 30
    for path, text in others.items():
        assert "Add here: " in text, path
        assert "Do not add: " in text, path


def test_a_command_keeps_options_and_printing():
    """What it does is below the commands; what it prints at length is beside it."""
    texts = {p: p.read_text("utf-8") for p in (ROOT / "fsoe_net" / "cli").glob("*.py")}
    commands = {p.stem for p, text in texts.items() if "\ndef command(" in text}
    assert {"check", "run", "init"} <= commands
    for path, text in texts.items():
        if path.stem in commands:
            assert len(text.splitlines()) <= 150, path
        used = set(re.findall(r"fsoe_net\.cli\.(\w+)", text)) & commands
        assert path.stem == "main" or not used - {path.stem}, path


def test_a_class_name_has_one_meaning():
    """Of public names; what is private is read in its own module only."""
    names = Counter(
        name
        for path in MODULES
        for name in re.findall(r"^class ([A-Za-z]\w*)", path.read_text("utf-8"), re.MULTILINE)
    )
    assert [name for name, count in names.items() if count > 1] == []


def test_parts_of_a_network_are_known_by_their_number():
    """A dict that is keyed by id() forgets what the key was, and keeps nothing alive."""
    users = {p.name for p in MODULES if re.search(r"\bid\(", p.read_text("utf-8"))}
    # Where identity is meant: same_devices, and maps and lists that a person edits in place.
    assert users == {"bus.py", "changed_text.py", "yaml_parts.py"}


def test_no_test_imports_another():
    """What several tests need is a helper, which says in its name what it is."""
    imports = re.compile(r"^\s*from (?:(?!fsoe_net)\w+\.)?test_\w+ import .*", re.M)
    found = [
        f"{path.name}: {line.strip()}"
        for path in (ROOT / "tests").rglob("*.py")
        for line in imports.findall(path.read_text("utf-8"))
    ]
    assert found == []


def test_types_of_connections_only_get_fewer():
    """An enum of their states is not one of them, nor the one that programs of users get."""
    texts = [p.read_text("utf-8") for p in MODULES if p.name != "parts.py"]
    names = [
        name
        for text in texts
        for name in re.findall(r"^class (\w*Connection\w*)\b(?!\(enum)", text, re.M)
    ]
    assert len(names) <= 12, names


CHECK = """
import sys
known = set(sys.modules)
from fsoe_net.cli.main import main
sys.argv = ["fsoe-net", "check", "examples/estop/network.yaml"]
try:
    main()
finally:
    print(*sorted({*sys.modules} - known))
"""
NOT_NEEDED = {
    *("fsoe_net.core", "fsoe_net.live", "rich", "xacro", "cffi"),
    # Only for several files, for findings, for files of other tools.
    *("fsoe_net.project.references", "fsoe_net.project.findings", "fsoe_net.formats.recognise"),
    *("fsoe_net.compare", "fsoe_net.plan", "fsoe_net.document", "fsoe_net.report"),
    *(
        "xml",
        "pathlib",
        "urllib",
        "logging",
        "subprocess",
        "tempfile",
        "socket",
        "importlib.metadata",
    ),
}


def test_check_imports_only_what_it_needs():
    done = subprocess.run(
        [sys.executable, "-c", CHECK], capture_output=True, text=True, check=True, cwd=ROOT
    )
    imported = set(done.stdout.splitlines()[-1].split())
    assert "fsoe_net.rules.check" in imported
    assert not imported & NOT_NEEDED
    formats = {name.split(".")[2] for name in imported if name.startswith("fsoe_net.formats.")}
    assert formats == {"own", "registry", "shared"}


COLLECTED = """
import gc, sys
from fsoe_net.cli import start
sys.argv = ["fsoe-net", "check", "examples/estop/network.yaml"]
before = gc.get_stats()[0]["collections"]
try:
    start()
finally:
    print(gc.get_stats()[0]["collections"] - before, gc.get_freeze_count())
"""


def test_the_collector_searches_modules_neither_at_the_start_nor_at_the_exit():
    done = subprocess.run(
        [sys.executable, "-c", COLLECTED], capture_output=True, text=True, check=True, cwd=ROOT
    )
    collections, frozen = map(int, done.stdout.splitlines()[-1].split())
    assert collections < 5
    assert frozen > 10_000


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


ARROWS = {
    "rt/cycle.c": ('#include "core/core_internal.h"', "rt must not use core: core/core_internal.h"),
    "plan/plan.c": (
        "int f(void) { return fsn_core_free(); }",
        "plan must not use core: fsn_core_free",
    ),
    "control/base/json.c": (
        '#include "control/requests/client.h"',
        "control/base must not use control/requests: control/requests/client.h",
    ),
    "new.c": ("int f(void);", "in no room"),
}


@pytest.mark.parametrize("path", ARROWS)
def test_an_arrow_upward_in_the_c_core_is_refused(path, tmp_path):
    line, refusal = ARROWS[path]
    files = {"core/core.c": "void fsn_core_free(struct fsn_core *core) {\n}", path: line}
    for name, text in files.items():
        (tmp_path / "src" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "src" / name).write_text(text)
    command = [sys.executable, str(ROOT / "scripts" / "arrows"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, f"{path}: {refusal}\n")


def test_records_of_the_c_core_and_the_page_follow_their_table(tmp_path):
    table = Path("fsoe_net/plan/records.py")
    for name in ("scripts/plan-records", table, "docs/reference/plan-format.md"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text((ROOT / name).read_text("utf-8"), "utf-8")
    header = tmp_path / "master_core" / "src" / "plan" / "records.h"
    header.parent.mkdir(parents=True)
    header.write_text((ROOT / "master_core/src/plan/records.h").read_text("utf-8"), "utf-8")

    def check(*words: str) -> tuple[int, str]:
        command = [sys.executable, str(tmp_path / "scripts" / "plan-records"), *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return done.returncode, done.stderr

    assert check("--check") == (0, "")
    text = (tmp_path / table).read_text("utf-8")
    (tmp_path / table).write_text(text.replace("u32    first_sm ", "u16    first_sm ", 1), "utf-8")
    stale = "master_core/src/plan/records.h, docs/reference/plan-format.md is not current"
    assert check("--check") == (1, f"run scripts/plan-records: {stale}\n")
    assert check() == check("--check") == (0, "")
    assert "X(subdevice, u16, first_sm, 24)" in header.read_text("utf-8")


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


SMALL = '''\
"""A text."""
LIMIT: int = 2
def f(a: int, b: int) -> str:
    if a < b and not b:
        store(a + 1)
    return a
def alike(a: int) -> int:
    return a  # mutants: the name says it
'''
CHANGED = {
    "LIMIT: int = 3",
    "    if a <= b and not b:",
    "    if a < b or not b:",
    "    if a < b and b:",
    "    if not (a < b and not b):",
    "        store(a - 1)",
    "        store(a + 2)",
    "        pass",
    "    return None",
}


def test_mutants_change_what_a_test_can_notice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("tree_sitter_python", reason="the extra mutation is not installed")
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    loader = SourceFileLoader("mutate", str(ROOT / "scripts" / "mutate"))
    mutate = module_from_spec(spec_from_loader("mutate", loader))
    monkeypatch.setitem(sys.modules, "mutate", mutate)
    loader.exec_module(mutate)
    monkeypatch.setattr(mutate.copy, "ROOT", tmp_path)
    (tmp_path / "one.py").write_text(SMALL, "utf-8")
    (tmp_path / "two.c").write_text("int f(int a) {\n    if (a < 4) {\n        g(a);\n    }\n}\n")
    found = mutate.changes(["one.py", "two.c"], 1)
    assert found == mutate.changes(["one.py", "two.c"], 1) != mutate.changes(["one.py", "two.c"], 2)
    lines: dict[str, set[str]] = {"one.py": set(), "two.c": set()}
    for c in found:
        source = (tmp_path / c.path).read_text("utf-8")
        text = source[: c.start] + c.text + source[c.end :]
        lines[c.path].add(text.splitlines()[c.line() - 1])
    assert lines["one.py"] == CHANGED
    assert lines["two.c"] == {
        "    if (a <= 4) {", "    if (a < 5) {", "    if (!(a < 4)) {", "        ;",
    }  # fmt: skip
