"""The scripts of `doctor --fix --dry-run`: run against a machine in a folder, then undone."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from cli.tool import fsn
from host.made_up import CPUS, MASTER, MadeUp, good

from fsoe_net.host.doctor import Examination, examine
from fsoe_net.host.scripts import fix_script, undo_script
from fsoe_net.host.seam import Host

GET_COALESCING = 0x0E
HOSTILE = "x' $(touch broken) `touch broken` \\n\ntouch broken"
# As ethtool: changes the parameters that it is given, in a file of two words a line.
ETHTOOL = """#!/bin/sh
[ "$1 $2" = "-C eth1" ] || exit 9
shift 2
while [ $# -gt 0 ]; do sed -i "s/^$1 .*/$1 $2/" "$STATE"; shift 2; done
"""


def governor(cpu: int) -> str:
    return f"{CPUS}/cpu{cpu}/cpufreq/scaling_governor"


def slow_machine(folder: Path) -> MadeUp:
    made = good(folder)
    made.write(
        {
            governor(1): "powersave",
            governor(2): HOSTILE,
            "proc/irq/40/smp_affinity_list": "0-3",
            f"{CPUS}/isolated": "",
            "proc/cmdline": "quiet",
        }
    )
    made.seam.driver[GET_COALESCING] = {1: 50, 5: 20, 10: 1}
    return made


def look(made: MadeUp) -> Examination:
    return examine(Host(made.root, made.seam), interface="eth1", program=MASTER)


def contents(made: MadeUp) -> dict[str, str]:
    files = [governor(n) for n in range(4)] + ["proc/irq/40/smp_affinity_list"]
    return {name: (made.root / name).read_text("utf-8").rstrip("\n") for name in files}


def run(script: str, made: MadeUp, tools: Path) -> int:
    """Run a script whose absolute paths are those of the machine in a folder."""
    for top in ("/sys/", "/proc/"):
        script = script.replace(f"> {top}", f"> {made.root}{top}")
        script = script.replace(f"> '{top}", f"> '{made.root}{top}")
    environment = {"PATH": f"{tools}:{os.environ['PATH']}", "STATE": str(tools / "state")}
    return subprocess.run(["/bin/sh", "-c", script], env=environment, cwd=tools).returncode


def test_the_second_script_restores_what_the_first_one_changed(tmp_path: Path) -> None:
    made, tools = slow_machine(tmp_path / "machine"), tmp_path / "tools"
    tools.mkdir()
    (tools / "ethtool").write_text(ETHTOOL, "utf-8")
    (tools / "ethtool").chmod(0o755)
    driver = "adaptive-rx on\nadaptive-tx off\nrx-usecs 50\ntx-usecs 20\n"
    (tools / "state").write_text(driver, "utf-8")
    before, found = contents(made), look(made)
    assert run(fix_script(found), made, tools) == 0
    assert contents(made) == {
        **{governor(n): "performance" for n in range(4)},
        "proc/irq/40/smp_affinity_list": "3",
    }
    assert (tools / "state").read_text("utf-8") == (
        "adaptive-rx off\nadaptive-tx off\nrx-usecs 0\ntx-usecs 0\n"
    )
    assert run(undo_script(found), made, tools) == 0
    assert contents(made) == before
    assert (tools / "state").read_text("utf-8") == driver
    assert not (tools / "broken").exists()


def test_one_setting_that_fails_keeps_none_of_the_others_back(tmp_path: Path) -> None:
    made = slow_machine(tmp_path / "machine")
    found = look(made)
    made.remove(f"{CPUS}/cpu1/cpufreq")
    (made.root / f"{CPUS}/cpu1/cpufreq").write_text("no folder", "utf-8")
    tools = tmp_path / "tools"
    tools.mkdir()
    assert run(fix_script(found), made, tools) == 1
    assert (made.root / governor(2)).read_text("utf-8") == "performance\n"


def test_the_kernel_command_line_is_left_to_a_person(tmp_path: Path) -> None:
    found = look(slow_machine(tmp_path))
    words = "isolcpus=managed_irq,domain,3 rcu_nocbs=3 irqaffinity=0-2"
    for script, change in ((fix_script(found), "add"), (undo_script(found), "remove")):
        (line,) = [line for line in script.splitlines() if words in line]
        assert line.startswith(f"# By hand: {change} {words} ")


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="shellcheck is not installed")
@pytest.mark.parametrize("make", [good, slow_machine])
def test_shellcheck_finds_nothing(make, tmp_path: Path) -> None:
    found = look(make(tmp_path))
    for script in (fix_script(found), undo_script(found)):
        done = subprocess.run(
            # Texts of the machine are in single quotes because nothing in them may be expanded.
            ["shellcheck", "--exclude", "SC2016", "-"],
            input=script,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout


def test_the_command_prints_one_script_and_writes_the_other(tmp_path: Path) -> None:
    file = tmp_path / "undo.sh"
    arguments = ("doctor", "--fix", "--dry-run", "--undo", str(file))
    first = fsn(*arguments)
    assert first.returncode == 0
    for script in (first.stdout, file.read_text("utf-8")):
        assert script.startswith("#!/bin/sh\n")
        assert script.endswith('exit "$code"\n')
    kept = file.read_bytes()
    second = fsn(*arguments)
    assert (second.returncode, second.stdout, file.read_bytes()) == (1, "", kept)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--fix",), "--fix needs --dry-run"),
        (("--dry-run",), "go with --fix"),
        (("--undo", "x"), "go with --fix"),
        (("--fix", "--dry-run", "--undo", "-"), "--undo takes a file"),
        (("--fix", "--dry-run", "--self-test"), "--self-test does not go with --fix"),
        (("--fix", "--dry-run", "--format", "json"), "--format does not go with --fix"),
    ],
)
def test_options_that_do_not_go_together(arguments: tuple[str, ...], words: str) -> None:
    done = fsn("doctor", *arguments)
    assert done.returncode == 2
    assert words in done.stderr
