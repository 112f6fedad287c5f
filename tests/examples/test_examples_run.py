"""The examples: no finding at all, and their scenarios pass in virtual time and live."""

from pathlib import Path

import pytest
from live.support import EXAMPLES, needs_core, run, session_of

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import resolve
from fsoe_net.plan.compile import compile_plan
from fsoe_net.project.check import check_files
from fsoe_net.simulate.session import run_live

IN_DATA = {"data_failsafe", "data_process"}
FOLDERS = ["estop", "el6910", "two-buses", "tool-exchange", "robot-cell"]
INPUTS = [
    ["estop/network.yaml"],
    ["estop/estop.urdf.xacro", "estop/transfers.yaml"],
    ["estop/estop.urdf.xacro"],
    ["el6910/network.yaml"],
    ["robot-cell/robot.urdf.xacro", "robot-cell/controllers.yaml"],
]


def test_every_example_is_tested():
    found = {p.name for p in EXAMPLES.iterdir() if p.is_dir()}
    # The others have tests of their own.
    assert found == {*FOLDERS, "broken", "clients", "fleet", "legs"}


@pytest.mark.parametrize("files", INPUTS, ids=" + ".join)
def test_no_error_and_no_warning(files: list[str]):
    found = check_files([str(EXAMPLES / file) for file in files]).diagnostics
    assert [f"{d.span} {d.code}" for d in found if d.level is not Severity.INFO] == []


@pytest.mark.shows("R1")
@pytest.mark.parametrize(
    ("folder", "robot"), [("estop", "estop.urdf.xacro"), ("robot-cell", "robot.urdf.xacro")]
)
def test_both_forms_of_an_example_move_the_same_bytes(folder: str, robot: str):
    def copies(*files: str) -> list[tuple[str, str, int]]:
        network = load_network([EXAMPLES / folder / f for f in files]).network
        assert network is not None
        resolution = resolve(network)
        compile_plan(resolution)
        return [
            (str(t.transfer.source), str(t.transfer.destination), t.transfer.size_bytes)
            for t in resolution.transfers
        ]

    assert copies("network.yaml") == copies(robot, "transfers.yaml")


@pytest.mark.uncounted
@needs_core
@pytest.mark.parametrize("name", FOLDERS)
def test_scenario_passes_in_virtual_time(name: str):
    result = run(EXAMPLES / name, EXAMPLES / name / "scenario.yaml")
    assert [f"{v.place}: {v.text}; {v.seen}" for v in result.verdicts if not v.held] == []
    assert len(result.verdicts) == 8
    assert result.events_lost == 0


@needs_core
@pytest.mark.parametrize("name", FOLDERS)
def test_scenario_runs_live(name: str):
    """A loaded machine may stop for longer than the watchdog: the end counts, not the moments."""
    for _ in range(3):
        session = session_of(EXAMPLES / name, EXAMPLES / name / "scenario.yaml")
        result = run_live(session, session.duration_ns)
        due = {c.state for c in result.connections if session.is_due(c.name)}
        if due <= IN_DATA:
            break
    assert due <= IN_DATA
    assert all(c.time_to_data_ms is not None for c in result.connections)
    assert len(result.verdicts) == 8


@pytest.mark.parametrize("name", FOLDERS)
def test_readme_names_files_that_exist(name: str):
    import re

    folder: Path = EXAMPLES / name
    text = (folder / "README.md").read_text("utf-8")
    named = re.findall(r"examples/[\w./-]+\.(?:yaml|xacro)", text)
    assert named
    assert [n for n in named if not (EXAMPLES.parent / n).is_file()] == []
