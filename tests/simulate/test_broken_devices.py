"""`fsoe-net campaign` with devices, modules and disks that break: one sentence each."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from live.children import none_left
from networks import EXAMPLES, example

from fsoe_net.campaign.trials import CampaignConfig
from fsoe_net.cli import campaign as command_module
from fsoe_net.cli import campaign_output
from fsoe_net.cli.main import main
from fsoe_net.errors import EnvironmentFault
from fsoe_net.simulate import campaign as campaign_module
from fsoe_net.simulate.campaign import campaign_links, run_campaign

NETWORK = str(EXAMPLES / "estop" / "network.yaml")
TESTS = Path(__file__).parents[1]
BROKEN = "fsoe.broken_devices"


@pytest.fixture
def fsn(monkeypatch, capfd):
    def call(*arguments):
        monkeypatch.setattr(
            sys, "argv", ["fsoe-net", "campaign", NETWORK, "--faults", "loss", *arguments]
        )
        with pytest.raises(SystemExit) as caught:
            main()
        out, err = capfd.readouterr()
        return caught.value.code, out, err

    return call


def program(*arguments):
    """Run the command in a process of its own, as only that has workers and a real end."""
    return subprocess.run(
        [sys.executable, "-m", "fsoe_net.cli", "campaign", NETWORK, "--faults", "loss", *arguments],
        env=os.environ | {"PYTHONPATH": str(TESTS)},
        capture_output=True,
        text=True,
        check=False,
    )


BREAKS = {
    "exits": r"step\(\) raised SystemExit\(\) \(broken_devices\.py, line \d+\)",
    "exits_later": r"step\(\) raised SystemExit\(\)",
    "returns_text": r"step\(\) returned 'hallo', not bytes or None",
    "returns_number": r"step\(\) returned 42, not bytes or None",
    "returns_nothing": r"step\(\) returned a frame of 0 bytes \(b''\); its frames have 6",
    "returns_long": r"step\(\) returned a frame of 5000 bytes \(0{50}\.\.\.\); its",
    "returns_short": r"step\(\) returned a frame of 5 bytes",
    "returns_odd": r"step\(\) returned a _Odd, not bytes or None",
    "takes_nothing": r"step\(\) raised TypeError\(.*takes 1 positional",
    "data_none": r"received_safe_data is None, not bytes",
    "data_text": r"received_safe_data is '00', not bytes",
    "data_long": r"received_safe_data has 100 bytes \(0{50}\.\.\.\) while data_valid",
    "valid_text": r"data_valid is 'yes', not True or False",
    "valid_two": r"data_valid is 2, not True or False",
    "valid_raises": r"lacks data_valid",
    "cycle_raises": r"power_cycle\(\) raised RuntimeError\('no\\npower'\)",
    "watchdog_text": r"watchdog_remaining_ns\(\) returned 'soon', not a whole number or None",
    "watchdog_raises": r"watchdog_remaining_ns\(\) raised KeyError\('dog'\)",
    "refuses_data": r"set_safe_data\(\) raised ValueError\('x+\.\.\.",
    "refuses_enable": r"setting enable raised AttributeError",
    "refuses_snapshot": r"snapshot\(\) raised TypeError\('cannot pickle'\)",
    "exiting_factory": r"the factory raised SystemExit\('bye'\)",
}


@pytest.mark.parametrize("name", BREAKS)
def test_devices_that_break(fsn, name):
    code, out, err = fsn("--sub", f"{BROKEN}:{name}", "--cycles", "20")
    assert (code, out) == (3, "")
    assert re.match(rf"error: {BROKEN}:{name}: .*{BREAKS[name]}", err), err
    assert err.count("\n") == 1
    assert len(err) < 400


@pytest.mark.parametrize("name", ["exits", "dies"])
def test_a_device_that_ends_another_process(name):
    done = program("--sub", f"{BROKEN}:{name}", "--jobs", "2", "--cycles", "20")
    assert (done.returncode, done.stdout) == (3, "")
    said = {"exits": rf"{BROKEN}:exits: step\(\) raised SystemExit", "dies": "a process .* died"}
    assert re.match(f"error: {said[name]}", done.stderr), done.stderr


def test_fitting_values_of_other_types_are_taken(fsn):
    right = fsn("--sub", "fsoe.devices:strange_sub", "--cycles", "20", "--format", "json")
    other = fsn("--sub", f"{BROKEN}:right_in_other_types", "--cycles", "20", "--format", "json")
    assert right[0] == other[0] == 0
    assert right[1] == other[1]


@pytest.mark.parametrize(
    ("text", "code", "said"),
    [
        (
            "def (",
            1,
            r"mod\w+:S: module 'mod\w+' is not valid Python: invalid syntax \(mod\w+\.py, line 1",
        ),
        ("import nothing_of_this_name", 1, "cannot be imported .*nothing_of_this_name"),
        ("1 / 0", 3, r"importing mod\w+ raised ZeroDivisionError\(.*\) \(mod\w+\.py, line 1\)"),
        (
            "import ctypes\nctypes.CDLL('./libnone.so')",
            3,
            r"importing mod\w+ raised OSError\(.*libnone.*\) \(mod\w+\.py, line 2\)",
        ),
        (
            "import sys\nsys.exit()",
            3,
            r"importing mod\w+ raised SystemExit\(\) \(mod\w+\.py, line 2",
        ),
        (
            "def __getattr__(name):\n    1 / 0",
            3,
            "reading S of the module raised ZeroDivisionError",
        ),
        ("x = 1", 1, "has no 'S'"),
        ("S = 'x' * 999", 1, r"S is 'x+\.\.\. and cannot be called"),
        ("def S(): pass", 1, r"is not a factory: .*takes \(\)"),
        ("def S(a, b): pass", 1, r"is not a factory: .*takes \(a, b\)"),
        ("S = range", 3, "the factory raised TypeError"),
    ],
)
@pytest.mark.parametrize("side", ["--sub", "--main"])
def test_modules_that_break(fsn, tmp_path, monkeypatch, request, text, code, said, side):
    name = f"mod{abs(hash(request.node.name))}"
    (tmp_path / f"{name}.py").write_text(text, "utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    found, out, err = fsn(side, f"{name}:S", "--cycles", "20")
    assert (found, out) == (code, "")
    assert re.match(f"error: .*{said}", err), err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "name", ["nix", "nix:", ":nix", "nix:nix", ".nix:nix", "os:getcwd", "os:nix"]
)
def test_names_of_no_factory(fsn, name):
    code, out, err = fsn("--sub", name)
    assert (code, out) == (1, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_output_of_a_device_is_not_in_the_report(jobs):
    done = program(
        *("--sub", f"{BROKEN}:talks", "--jobs", jobs, "--cycles", "40", "--format", "json")
    )
    assert done.returncode == 0, done.stderr[-300:]
    assert json.loads(done.stdout)["passed"]
    assert "NOISE of python" in done.stderr
    assert "NOISE of C" in done.stderr


# ------------------------------------------------------------------------------------- the disk


@pytest.fixture
def no_campaign(monkeypatch):
    def never(*_args, **_kwargs):
        raise AssertionError("begun though its result cannot be written")

    monkeypatch.setattr(command_module, "run_campaign", never)


@pytest.mark.usefixtures("no_campaign")
@pytest.mark.parametrize("option", ["-o", "--save-dir"])
def test_places_are_tried_before_the_campaign(fsn, tmp_path, option):
    (tmp_path / "file").touch()
    place = str(tmp_path / "file" / "x")
    code, out, err = fsn(option, place)
    assert (code, out) == (3, "")
    assert place in err


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
def test_a_report_that_cannot_be_written_is_printed(fsn):
    code, out, err = fsn("-o", "/dev/full", "--cycles", "20")
    assert code == 3
    assert "\npassed: nothing wrongly accepted, every reaction right\n" in out
    assert "No space left" in err
    assert "report written" not in err


@pytest.mark.parametrize("error", [OSError(28, "No space left"), EnvironmentFault("it broke")])
def test_recordings_that_cannot_be_written_leave_the_report(fsn, tmp_path, monkeypatch, error):
    def full(*_args):
        raise error

    monkeypatch.setattr(campaign_output, "save_failures", full)
    code, out, err = fsn("--save-dir", str(tmp_path / "new"), "--cycles", "20")
    assert code == 3
    assert "passed: nothing wrongly accepted" in out
    assert err.endswith(("No space left\n", "it broke\n"))


# ----------------------------------------------------------------------------------- the progress


def test_progress_is_reported_within_a_piece_of_work(monkeypatch):
    monkeypatch.setattr(campaign_module, "_SHOWN_EVERY_S", 0)
    seen = []
    config = CampaignConfig(links=campaign_links(example("estop")))
    run_campaign(config, ("loss",), 30, jobs=1, on_progress=lambda *row: seen.append(row))
    assert seen == [(done, 30, "loss") for done in range(1, 31)]


def test_progress_is_reported_within_the_pieces_of_other_processes(monkeypatch):
    monkeypatch.setattr(campaign_module, "_SHOWN_EVERY_S", 0.001)
    seen = []
    config = CampaignConfig(links=campaign_links(example("estop")))
    run_campaign(config, ("loss",), 3000, jobs=2, on_progress=lambda *row: seen.append(row[0]))
    assert len(seen) > 1  # it is one piece
    assert seen == sorted(set(seen))
    assert seen[-1] == 3000
    assert none_left()


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("loss,loss", "'loss' is named twice; say it once"),
        ("loss+delay,delay+loss", "'delay+loss' is named twice; say it once"),
        ("loss+loss", "'loss+loss' names a class twice"),
    ],
)
def test_a_class_is_named_once(fsn, names, said):
    code, _, err = fsn("--faults", names)
    assert code == 2
    assert said in " ".join(err.split())
