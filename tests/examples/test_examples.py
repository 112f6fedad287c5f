"""The examples are what the README says they are."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import EXAMPLES, example, resolved

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.plan.compile import compile_plan
from fsoe_net.project.check import check_files

BROKEN = sorted(EXAMPLES.glob("broken/*.yaml"))


@pytest.mark.shows("R6")
@pytest.mark.parametrize("path", BROKEN, ids=lambda p: p.stem)
def test_broken_example_gives_the_recorded_output(path: Path):
    done = fsn("check", path.name, cwd=path.parent)
    assert done.returncode == 1
    assert done.stdout == path.with_suffix(".txt").read_text("utf-8")


def test_there_are_ten_broken_examples():
    assert len(BROKEN) == 10


@pytest.mark.shows("R6")
@pytest.mark.parametrize(
    "name",
    [
        "estop/network.yaml",
        "estop/estop.urdf.xacro",
        "el6910/network.yaml",
        "two-buses/network.yaml",
        "tool-exchange/network.yaml",
        "legs/network.yaml",
    ],
)
def test_good_examples_are_clean(name: str):
    found = check_files([str(EXAMPLES / name)]).diagnostics
    assert [d for d in found if d.level is not Severity.INFO] == []


def test_urdf_and_network_file_give_the_same_plan():
    urdf = resolved(EXAMPLES / "estop" / "estop.urdf.xacro")
    assert compile_plan(urdf).to_bytes() == compile_plan(example("estop")).to_bytes()


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
def test_the_unit_gives_what_it_needs_and_no_more():
    """Exposure of at most 2.0 of 10, by the measure of systemd."""
    unit = EXAMPLES / "fsn-master.service"
    call = ["systemd-analyze", "security", "--offline=true", "--threshold=20", str(unit)]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def system_calls(group: str) -> set[str]:
    """Return the system calls of a group, as systemd lists them."""
    call = ["systemd-analyze", "syscall-filter", group]
    done = subprocess.run(call, capture_output=True, text=True, check=True)
    words = {line.strip() for line in done.stdout.splitlines()[1:]}
    nested = {word for word in words if word.startswith("@")}
    return (words - nested).union(*map(system_calls, nested))


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
def test_the_unit_permits_the_system_calls_of_fsn_master():
    """A call outside of the filter of the unit would end the process."""
    source = (EXAMPLES.parent / "master_core/app/base/confine.c").read_text("utf-8")
    needed = set(re.findall(r"\bSYS_(\w+)", source))
    permitted: set[str] = set()
    unit = (EXAMPLES / "fsn-master.service").read_text("utf-8")
    for line in re.findall(r"(?m)^SystemCallFilter=(.*)$", unit):
        for word in line.removeprefix("~").split():
            calls = system_calls(word) if word.startswith("@") else {word}
            permitted = permitted - calls if line.startswith("~") else permitted | calls
    assert {"capset", "seccomp", "sendto"} <= needed
    assert needed - permitted == {"bpf"}  # for --xdp, by lines that this page adds to the unit
    page = (EXAMPLES.parent / "docs/howto/run-live.md").read_text("utf-8")
    assert "\nSystemCallFilter=bpf\n" in page
