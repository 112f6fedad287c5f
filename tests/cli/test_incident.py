"""`fsoe-net run --incidents` and `fsoe-net log incident` from the command line."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner
from networks import EXAMPLES

from fsoe_net.cli.incident import incident
from fsoe_net.cli.run import command as run
from fsoe_net.errors import EnvironmentFault, IncidentError

ESTOP = EXAMPLES / "estop"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("incidents")
    scenario = ESTOP / "scenario.yaml"
    done = CliRunner().invoke(
        run,
        [
            str(ESTOP / "network.yaml"),
            "--virtual-time",
            f"--scenario={scenario}",
            f"--incidents={folder}",
        ],
    )
    assert done.exit_code == 0, done.output
    (path,) = folder.iterdir()
    assert path.name in done.output
    return path


def test_text_names_cause_and_next_step(file):
    done = CliRunner().invoke(incident, [str(file)])
    assert done.exit_code == 0
    assert "\nLikely cause: ek1914 was gone from the bus for a while" in done.output
    for part in ("Measure: ", "Change: ", "Connections", "Timeline", "Frames of el1918-ek1914"):
        assert f"\n{part}" in done.output
    assert max(map(len, done.output.partition("Connections")[0].splitlines())) <= 100


def test_json_is_whole(file):
    done = CliRunner().invoke(incident, [str(file), "--format=json"])
    found = json.loads(done.output)
    assert found["likely"]["key"] == "device_interrupted"
    assert (found["reset_by"], found["reset_code"]) == ("main", 5)
    assert found["frames"][-1]["changed"]


def test_the_page_needs_nothing_else(file, tmp_path):
    page = tmp_path / "page.html"
    done = CliRunner().invoke(incident, [str(file), "--format=html", "-o", str(page)])
    assert (done.exit_code, done.output) == (0, "")
    text = page.read_text("utf-8")
    assert "<script" not in text
    assert "http" not in text
    assert "</span> Likely cause: ek1914 was gone" in text
    assert "<code>fsoe-net monitor</code>" in text
    assert "`" not in text


def test_another_file_is_refused_with_its_place(tmp_path):
    path = tmp_path / "x"
    path.write_text("hello\n")
    done = CliRunner().invoke(incident, [str(path)])
    assert isinstance(done.exception, IncidentError)
    assert str(done.exception).endswith(
        "x:1: this is not an incident file: no JSON in its first line"
    )


def test_the_folder_is_made_but_none_above_it(tmp_path):
    quick = ["--virtual-time", "--duration=0.05"]
    target = tmp_path / "incidents"
    done = CliRunner().invoke(run, [str(ESTOP / "network.yaml"), *quick, f"--incidents={target}"])
    assert done.exit_code == 0, done.output
    assert target.is_dir()
    target = tmp_path / "typo" / "incidents"
    done = CliRunner().invoke(run, [str(ESTOP / "network.yaml"), *quick, f"--incidents={target}"])
    assert isinstance(done.exception, EnvironmentFault)
    assert str(done.exception).endswith(f"missing folder {tmp_path / 'typo'}")
    assert not target.parent.exists()


def test_a_live_run_writes_in_the_background(tmp_path):
    """Only that a file comes and can be read: how fast the machine is, is not asked."""
    scenario = tmp_path / "s.yaml"
    folder = tmp_path / "incidents"
    folder.mkdir()
    for times in (1, 4, 16):  # a machine that is held up has no connection yet that can break
        steps = f"steps:\n  - {{at_ms: {300 * times}, break: ek1914}}\n"
        scenario.write_text(f"version: 1\nduration_s: {times}\n{steps}")
        done = CliRunner().invoke(
            run,
            [str(ESTOP / "network.yaml"), f"--scenario={scenario}", f"--incidents={folder}"],
        )
        if "incident: " in done.output:
            break
    assert "incident: " in done.output
    (path,) = folder.iterdir()
    told = CliRunner().invoke(incident, [str(path)])
    assert "ek1914" in told.output
