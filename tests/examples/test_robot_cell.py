"""The robot cell as it is started by `make robot-cell`: an e-stop while both axes move."""

import csv
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from networks import EXAMPLES
from uncounted import not_counted
from wires import missing

from fsoe_net.errors import FsnError
from fsoe_net.run.master import find_master

CELL = EXAMPLES / "robot-cell"
REQUIRED = "live" in os.environ.get("FSN_REQUIRE", "").split(",")
ATTEMPTS = 3  # of a real-time run beside other work


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the folder of a run, and what it printed."""
    why = missing()
    try:
        find_master()
    except FsnError as fault:
        why = str(fault)
    if why:
        (pytest.fail if REQUIRED else pytest.skip)(why)
    said = []
    for _ in range(ATTEMPTS):
        folder = tmp_path_factory.mktemp("cell")
        command = [sys.executable, CELL / "cell.py", folder]
        with not_counted():  # counting makes the emulated drives too slow for real time
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            return folder, done.stdout
        said.append(done.stdout + done.stderr)
        # What must never be, however busy the machine is, is never tried again.
        for never in ("moved before the restart", "frames sent that are not"):
            assert not [x for x in done.stdout.splitlines() if x.startswith("FAIL") and never in x]
    pytest.fail("\n".join(said))


def test_the_e_stop_takes_the_torque_and_nothing_moves_until_the_restart(played):
    lines = [line for line in played[1].splitlines() if line.startswith(("ok", "FAIL"))]
    assert len(lines) == 7
    assert all(line.startswith("ok") for line in lines)


def test_every_frame_of_every_cycle_is_the_one_that_came(played):
    with (played[0] / "motion.csv").open() as file:
        rows = [[float(word) for word in row] for row in csv.reader(file)]
    assert len(rows) > 1000
    assert {row[1] for row in rows} == {0.0}


def test_the_picture_shows_both_axes_and_all_states(played):
    root = ElementTree.parse(played[0] / "robot-cell.svg").getroot()
    texts = {"".join(node.itertext()) for node in root.iter("{http://www.w3.org/2000/svg}text")}
    for text in ("Position, rev", "Velocity, rev/s", "Torque, N·m", "axis_1", "axis_2"):
        assert text in texts
    assert {"Operation enabled", "Quick stop active", "Switch on disabled"} <= texts
    assert {"ProcessData", "FailSafeData", "e-stop", "released", "reset", "start"} <= texts
