"""What is found in a network, or between it and other files, when one place of a file changes."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import changed
import pytest
from cases_file import DIAGNOSTICS
from networks import PLAIN

from fsoe_net.formats.own.scan import load_scan
from fsoe_net.project.check import check_files
from fsoe_net.rules.runtime import Runtime

BASE, ROBOT = DIAGNOSTICS / "base", PLAIN / "el6910"
# Name: folder, the file that changes, the network, what it is compared with, the runtime.
CASES = {
    "network": (BASE, "network.yaml", "network.yaml", (), "fsn"),
    "io": (BASE, "devices/ek1914.yaml", "network.yaml", (), "fsn"),
    "logic": (BASE, "devices/el6910.yaml", "network.yaml", (), "fsn"),
    "urdf": (BASE, "robot.urdf", "robot.urdf", (), "ros2-2025"),
    "drive": (BASE, "devices/drive.yaml", "robot.urdf", (), "ros2-newest"),
    "transfers": (BASE, "transfers.yaml", "robot.urdf", (), "lcec"),
    "robot": (ROBOT, "network.yaml", "network.yaml", (), "lcec"),
    "timed": (BASE, "timed.yaml", "timed.yaml", (), "fsn"),
    "safety": (BASE, "safety.xml", "network.yaml", ("safety.xml",), "fsn"),
    "eni": (BASE, "bus.eni.xml", "network.yaml", ("bus.eni.xml",), "fsn"),
    "lcec": (BASE, "lcec.xml", "network.yaml", ("lcec.xml",), "fsn"),
    "esi": (BASE, "coupler.xml", "network.yaml", ("coupler.xml",), "fsn"),
    "pdos": (BASE, "pdos.txt", "network.yaml", ("pdos.txt",), "fsn"),
    "slaves": (BASE, "slaves.txt", "network.yaml", ("slaves.txt",), "fsn"),
    "scan": (BASE, "scan.json", "network.yaml", ("scan.json",), "fsn"),
}

# Of the long ones the numbers are enough here; readers have tests of their own.
NUMBERS_ONLY = {"eni", "scan", "drive"}
WAYS = [(n, way) for n in CASES for way in changed.WAYS if way == "more" or n not in NUMBERS_ONLY]
WAYS += [(n, "others") for n in ("network", "io", "transfers", "robot", "timed")]


@pytest.mark.weekly
@pytest.mark.shows("R6")
@pytest.mark.parametrize(("name", "way"), WAYS)
def test_each_change(name: str, way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder, file, network, others, runtime = CASES[name]
    shutil.copytree(folder, tmp_path / "case")
    monkeypatch.chdir(tmp_path / "case")

    def results() -> Iterator[tuple[str, str]]:
        for change, text in getattr(changed, way)(Path(file).read_text("utf-8")):
            Path(file).write_text(text, "utf-8")
            yield change, _found(network, others, Runtime(runtime))

    changed.count(__file__, f"{name}-{way}", results())


def _found(network: str, others: tuple[str, ...], runtime: Runtime) -> str:
    files, scan = [network, *(o for o in others if o != "scan.json")], None
    if "scan.json" in others:
        scan, damage = load_scan("scan.json")
        if scan is None:
            return changed.findings(damage)
    return changed.findings(
        check_files(files, runtime=runtime, scan=scan, compared=True).diagnostics
    )
