"""`fsoe-net run`: whole outputs and exit codes."""

import importlib.util
import json
import re
import shutil
import sys
from pathlib import Path

import pytest
from live.support import ESTOP, EXAMPLES, ROBOT, needs_core

from fsoe_net.cli.main import main
from fsoe_net.plan.compile import compile_plan
from fsoe_net.version import __version__

NETWORK = str(ESTOP / "network.yaml")


def call(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str):
    """Run a command line; return exit code, standard output and standard error."""
    monkeypatch.setattr(sys, "argv", ["fsoe-net", "run", *arguments])
    with pytest.raises(SystemExit) as caught:
        main()
    out, err = capsys.readouterr()
    return caught.value.code, out, err


@pytest.fixture
def fsn(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    return lambda *arguments: call(monkeypatch, capsys, *arguments)


@needs_core
def test_text_of_a_short_run(fsn):
    code, out, err = fsn(NETWORK, "--virtual-time", "--duration", "0.5")
    assert (code, err) == (0, "")
    assert (
        out
        == """\
       1.0 ms  el1918-ek1914: MainInstance resets: local reset or acknowledgement
       2.0 ms  el1918-ek1914: SubInstance was reset by its peer: local reset or acknowledgement
      27.0 ms  el1918-ek1914: MainInstance: Data
      28.0 ms  el1918-ek1914: SubInstance: Data
     128.0 ms  run: no scenario: reset pressed once, all connections in Data
     128.0 ms  el1918: outputs on

connection     state               ConnID  address  FSoE cycle  to Data  resets
el1918-ek1914  Data · ProcessData       1       14     2.00 ms    28 ms  0

500 bus cycles in 0.5 s (virtual), 0 with incomplete working counter, 0 overruns
"""
    )


INPUTS = """\
version: 1
name: inputs
cycle_us: 1000
subdevices:
  - {name: inputs, position: 0, config: el1008.yaml}
nets: []
"""


@needs_core
@pytest.mark.parametrize("mode", ["--virtual-time", "--duration=0.3"])
def test_a_bus_without_copies_runs(fsn, mode: str, tmp_path: Path):
    shutil.copy(EXAMPLES / "robot-cell" / "devices" / "el1008.yaml", tmp_path)
    (tmp_path / "network.yaml").write_text(INPUTS)
    code, out, err = fsn(str(tmp_path / "network.yaml"), mode, "--duration", "0.3")
    assert (code, err) == (0, "")
    assert "reset" not in out
    found = re.search(r"no FSoE connections\n([0-9]+) bus cycles in 0.3 s .*, 0 with incomp", out)
    assert found is not None
    assert int(found[1]) > 0


@pytest.mark.uncounted
@needs_core
def test_json_is_one_document(fsn):
    scenario = str(ROBOT / "scenario.yaml")
    network = str(ROBOT / "network.yaml")
    code, out, err = fsn(network, "--scenario", scenario, "--virtual-time", "--format", "json")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert (found["tool"], found["version"]) == ("fsoe-net", __version__)
    assert (found["network"], found["mode"], found["result"]) == ("el6910-cell", "virtual", "pass")
    assert len(found["connections"]) == 4


@needs_core
def test_failed_expectation_is_exit_code_1(fsn, tmp_path: Path):
    scenario = tmp_path / "s.yaml"
    scenario.write_text("version: 1\nexpect: [{at_ms: 100, outputs: on}]\n")
    code, out, _ = fsn(NETWORK, "--scenario", str(scenario), "--virtual-time", "--duration", "0.2")
    assert code == 1
    assert out.endswith(
        f"{scenario}:2:10: not observed: at 100 ms: outputs on; outputs of el1918 were off at "
        "100 ms\n0 of 1 expectation held\n"
    )


@needs_core
def test_not_every_connection_in_data_is_exit_code_1(fsn):
    code, out, _ = fsn(NETWORK, "--virtual-time", "--duration", "0.01")
    assert code == 1
    assert out.endswith("not every connection is in Data\n")


@needs_core
def test_own_plan_runs_and_foreign_plan_does_not(fsn, tmp_path: Path):
    from live.support import resolution_of

    for folder in (ESTOP, ROBOT):
        path = tmp_path / f"{folder.name}.fsnplan"
        path.write_bytes(compile_plan(resolution_of(folder)).to_bytes())
    arguments = (NETWORK, "--virtual-time", "--duration", "0.1")
    assert fsn(*arguments, "--plan", str(tmp_path / "estop.fsnplan"))[0] == 0
    code, out, err = fsn(*arguments, "--plan", str(tmp_path / "el6910.fsnplan"))
    assert (code, out) == (1, "")
    assert "was not compiled from these files" in err


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("none.fsnplan", None, "no such file"),
        ("x.fsnplan", b"version: 1\n" * 50, "not a .fsnplan file"),
        ("empty.fsnplan", b"", "too short for a plan"),
    ],
)
def test_file_that_is_not_a_plan(fsn, tmp_path: Path, name: str, data: bytes | None, message: str):
    path = tmp_path / name
    if data is not None:
        path.write_bytes(data)
    code, out, err = fsn(NETWORK, "--virtual-time", "--plan", str(path))
    assert (code, out) == (1, "")
    assert message in err
    assert str(path) in err


def test_network_with_an_error_does_not_start(fsn, tmp_path: Path):
    path = tmp_path / "n.yaml"
    path.write_text("version: 1\nname: x\nsubdevices: []\nnets:\n  - {name: a, transfers: []}\n")
    code, out, err = fsn(str(path), "--virtual-time")
    assert (code, out) == (1, "")
    assert "error[FSN" in err
    assert "nothing started" in err


def test_scenario_with_a_mistake_does_not_start(fsn, tmp_path: Path):
    path = tmp_path / "s.yaml"
    path.write_text("version: 1\nassert: []\n")
    code, out, err = fsn(NETWORK, "--virtual-time", "--scenario", str(path))
    assert (code, out) == (1, "")
    assert f"{path}:2:1: error[FSN109]: unknown key 'assert'" in err


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        (NETWORK, "--duration", "0"),
        (NETWORK, "--duration", "nan"),
        (NETWORK, "--duration", "inf"),
        (NETWORK, "--duration", "soon"),
        (NETWORK, "--device-period", "nan"),
        (NETWORK, "--device-period", "inf"),
        (NETWORK, "--device-period", "0"),
        (NETWORK, "--format", "xml"),
        (NETWORK, "--fast"),
    ],
)
def test_usage_is_exit_code_2(fsn, arguments: tuple[str, ...]):
    code, out, err = fsn(*arguments)
    assert (code, out) == (2, "")
    assert "Error" in err


def test_missing_core_is_exit_code_3(fsn, monkeypatch: pytest.MonkeyPatch):
    from fsoe_net.core import module

    module.compiled.cache_clear()
    monkeypatch.setitem(sys.modules, "fsoe_net.core._core", None)
    monkeypatch.delattr("fsoe_net.core._core", raising=False)
    try:
        code, out, err = fsn(NETWORK, "--virtual-time")
    finally:
        module.compiled.cache_clear()
    assert (code, out) == (3, "")
    assert "the compiled part of fsoe-net is missing" in err


def test_help_has_an_example(fsn):
    code, out, _ = fsn("--help")
    assert code == 0
    assert "fsoe-net run network.yaml --scenario scenario.yaml --virtual-time" in out


def test_the_core_is_where_the_mark_looks():
    """The mark of `run.support` would skip everything if this name went stale."""
    assert importlib.util.find_spec("fsoe_net.core") is not None
