"""SPIN goes through every state of the models of a take-over, in master_core/model.

No two MainDevices ever send process data at once, and after two troubles the bus comes back.
Without one of the rules a violation must be found: otherwise the model would prove nothing.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from master.rig import ROOT

MODELS = ROOT / "master_core" / "model"
PAGE = (ROOT / "docs/explanation/standby.md").read_text("utf-8")


def run(folder: Path, *command: str | Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout


def explored(folder: Path, model: str, *defined: str) -> tuple[int, int]:
    """Return the number of violations and of states of a model; TROUBLES: also of endless runs."""
    run(folder, "spin", "-a", *(f"-D{name}" for name in defined), MODELS / f"{model}.pml")
    fair = "TROUBLES=2" in defined
    kind, search = ("-DNFAIR=4", ["-a", "-f"]) if fair else ("-DSAFETY", [])
    run(folder, "cc", "-O2", kind, "-w", "-o", "pan", "pan.c")
    said = run(folder, "./pan", *search, "-m1000000", "-n")
    violations = int(re.search(r"errors: (\d+)", said)[1])
    unfinished = re.search("max search depth too small|out of memory|Search not completed", said)
    assert violations or not unfinished, said
    return violations, int(float(re.search(r"(\S+) states, stored", said)[1]))


@pytest.fixture(scope="module", autouse=True)
def spin() -> None:
    if shutil.which("spin") is None or shutil.which("cc") is None:
        required = "spin" in os.environ.get("FSN_REQUIRE", "").split(",")
        (pytest.fail if required else pytest.skip)("SPIN is not installed: apt install spin")


@pytest.mark.weekly
@pytest.mark.parametrize(
    ("model", "defined"), [("one_pc", ()), ("one_pc", ("TROUBLES=2",)), ("two_pcs", ())]
)
def test_the_rules_hold_in_every_state(tmp_path, model, defined):
    violations, states = explored(tmp_path, model, *defined)
    assert violations == 0
    assert f"{states:,}".replace(",", " ") in " ".join(PAGE.split())


@pytest.mark.weekly
@pytest.mark.parametrize(
    ("model", "defined"),
    [
        *(("one_pc", (rule,)) for rule in ("NO_WAIT", "BY_CONNECTION", "LOCK_ONLY", "BY_LISTENER")),
        ("one_pc", ("NO_PERSON", "TROUBLES=2")),
        ("two_pcs", ("LEASE",)),
    ],
)
def test_without_a_rule_a_violation_is_found(tmp_path, model, defined):
    assert explored(tmp_path, model, *defined)[0] > 0
    assert f"`{defined[0]}`" in PAGE
