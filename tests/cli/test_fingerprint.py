"""`fsoe-net plan` and `fsoe-net acceptance verify` as a user and as CI call them."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import EXAMPLES, PLAIN

ESTOP = str(PLAIN / "estop" / "network.yaml")
SHORT = "7EA0 38E0 BA83 86E1"
FUNCTION = "safety_functions:\n  - {name: f, elements: [{kind: input, sub: ek1914, time_ms: 4}]}\n"


@pytest.fixture
def accepted(tmp_path: Path) -> str:
    file = tmp_path / "accepted.json"
    done = fsn("plan", ESTOP, "--format", "json")
    assert (done.returncode, done.stderr) == (0, "not written; -o FILE writes it\n")
    file.write_text(done.stdout, "utf-8")
    return str(file)


@pytest.fixture
def other(tmp_path: Path) -> Path:
    folder = shutil.copytree(PLAIN / "estop", tmp_path / "estop")
    return Path(folder) / "network.yaml"


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text("utf-8")
    assert old in text
    file.write_text(text.replace(old, new), "utf-8")


def test_network_and_plan_have_the_same(tmp_path: Path) -> None:
    plan = str(tmp_path / "estop.fsnplan")
    made = fsn("plan", ESTOP, "-o", plan)
    assert made.stdout.endswith(f"fingerprint {SHORT}\n")
    of_network, of_plan = fsn("plan", ESTOP), fsn("plan", "--show", plan)
    assert of_network.stdout == of_plan.stdout
    assert f"fingerprint {SHORT}" in of_plan.stdout


@pytest.mark.parametrize("section", ["devices", "safety_functions"])
def test_the_text_of_a_section_has_its_hash(section: str) -> None:
    document = json.loads(fsn("plan", ESTOP, "--format", "json").stdout)["fingerprint"]
    text = fsn("plan", ESTOP, "--canonical", section).stdout
    assert hashlib.sha256(text.encode()).hexdigest() == document["sections"][section]
    assert document["short"] == SHORT


def test_a_plan_does_not_hold_the_text_of_safety_functions(tmp_path: Path, other: Path) -> None:
    other.write_text(other.read_text("utf-8") + FUNCTION, "utf-8")
    plan = str(tmp_path / "estop.fsnplan")
    assert fsn("plan", str(other), "-o", plan).returncode == 0
    devices = ("--canonical", "devices")
    assert fsn("plan", plan, *devices).stdout == fsn("plan", str(other), *devices).stdout
    done = fsn("plan", plan, "--canonical", "safety_functions")
    assert done.returncode == 1
    assert "name the files of the network" in done.stderr


@pytest.mark.shows("R4")
def test_same_is_0(tmp_path: Path, accepted: str, other: Path) -> None:
    edit(other, "version: 1", "# a comment\nversion: 1")
    plan = str(tmp_path / "estop.fsnplan")
    assert fsn("plan", ESTOP, "-o", plan).returncode == 0
    for what in (str(other), plan, accepted):
        for wanted in (accepted, plan, ESTOP):
            done = fsn("acceptance", "verify", what, "--accepted", wanted)
            assert (done.returncode, done.stderr) == (0, "")
            assert done.stdout.count(SHORT) == 2
            assert done.stdout.endswith("the same\n")


@pytest.mark.shows("R4")
def test_a_difference_is_1_with_sections_and_meaning(accepted: str, other: Path) -> None:
    edit(other, "watchdog_ms: 100", "watchdog_ms: 120")
    done = fsn("acceptance", "verify", str(other), "--accepted", ESTOP)
    assert done.returncode == 1
    assert "DIFFERS in connections\n" in done.stdout
    assert "watchdog_ms 100 -> 120" in done.stdout
    done = fsn("acceptance", "verify", str(other), "--accepted", accepted)
    assert done.returncode == 1
    assert f"of {accepted} only hashes are known" in done.stdout


def test_a_safety_function_that_came_is_reported(other: Path) -> None:
    other.write_text(other.read_text("utf-8") + FUNCTION, "utf-8")
    done = fsn("acceptance", "verify", str(other), "--accepted", ESTOP, "--format", "json")
    assert done.returncode == 1
    document = json.loads(done.stdout)
    (row,) = document["compared"]
    assert (document["same"], row["same"]) == (False, False)
    assert row["changed"] == ["safety_functions"]
    assert [line.split()[:3] for line in row["differences"]] == [["+", "safety", "function"]]


def test_unreadable_input_exits_with_1(tmp_path: Path, accepted: str) -> None:
    document = json.loads(Path(accepted).read_text("utf-8"))
    document["fingerprint"]["sections"]["cycle"] = "00" * 32
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(document), "utf-8")
    deep = tmp_path / "deep.json"
    deep.write_text("{" + "[" * 100_000, "utf-8")
    broken = str(PLAIN / "broken" / "04_size.yaml")
    for what, wanted, words in [
        (ESTOP, str(changed), "does not fit the sections"),
        (ESTOP, str(deep), "no JSON document"),
        (ESTOP, "nowhere.json", "no such file"),
        (broken, accepted, "error"),
    ]:
        done = fsn("acceptance", "verify", what, "--accepted", wanted)
        assert done.returncode == 1, done
        assert words in done.stderr
    assert fsn("acceptance", "verify", "--accepted", accepted).returncode == 2
    assert (
        fsn("acceptance", "verify", "--accepted", accepted, "--socket", "/nowhere").returncode == 3
    )


def test_the_same_network_as_urdf_with_transfers_in_another_file_is_the_same(accepted: str) -> None:
    urdf = str(PLAIN / "estop" / "estop.urdf.xacro")
    done = fsn("acceptance", "verify", urdf, "--accepted", accepted)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_readme_shows_the_plan_and_the_fingerprint_of_today(tmp_path: Path):
    done = fsn(
        "plan", str(EXAMPLES / "estop" / "network.yaml"), "-o", "estop.fsnplan", cwd=tmp_path
    )
    page = (EXAMPLES.parent / "README.md").read_text("utf-8")
    assert f"\n{done.stdout.strip()}\n" in page
