"""Whole runs: examples in both kinds of time, faults, determinism, verdicts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from networks import EXAMPLES, example, resolved

from fsoe_net.errors import CoreMissing, InputError
from fsoe_net.live.result import Run
from fsoe_net.project.simulate import prepare
from fsoe_net.simulate.session import Session, run_virtual


def session(name: str, scenario: Path | str | None = None, *, virtual: bool = True) -> Session:
    try:
        return prepare(example(name), None, str(scenario) if scenario else None, virtual=virtual)
    except CoreMissing as exc:
        pytest.skip(str(exc))


def run(name: str, scenario: str, tmp_path: Path) -> Run:
    path = tmp_path / "scenario.yaml"
    path.write_text(scenario, "utf-8")
    made = session(name, path)
    return run_virtual(made, made.duration_ns)


@pytest.mark.uncounted
@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_example_scenarios_hold_in_virtual_time(name: str):
    made = session(name, EXAMPLES / name / "scenario.yaml")
    result = run_virtual(made, made.duration_ns)
    assert [v for v in result.verdicts if not v.held] == []
    assert result.passed
    for connection in result.connections:
        assert connection.state == connection.wire_state


def test_virtual_runs_are_repeatable():
    def document() -> str:
        made = session("el6910", EXAMPLES / "el6910" / "scenario.yaml")
        return json.dumps(run_virtual(made, 1_000_000_000).to_json("x"))

    assert document() == document()


def test_broken_device_ends_in_a_watchdog_reset_and_comes_back(tmp_path: Path):
    result = run(
        "estop",
        """
version: 1
duration_s: 1.5
steps:
  - {at_ms: 300, break: ek1914}
  - {at_ms: 600, heal: ek1914}
expect:
  - {during_ms: [100, 300], state: data}
  - {at_ms: 550, state: reset}
  - {during_ms: [900, 1400], state: data}
""",
        tmp_path,
    )
    assert result.passed, result.verdicts
    assert 5 in [e.code for e in result.events]
    assert result.statistics.wkc_errors == 300


def test_wrong_address_is_shown_with_its_code():
    made = session("estop")
    port = made.network.subs["el1918-ek1914"]
    object.__setattr__(port.instance.config, "address", 99)
    result = run_virtual(made, 500_000_000)
    assert not result.passed
    assert result.connections[0].last_reset_code == 6
    assert "address" in result.connections[0].last_reset_text


def test_failed_expectation_names_what_was_seen_and_where(tmp_path: Path):
    result = run(
        "estop",
        "version: 1\nduration_s: 0.3\nexpect:\n  - {at_ms: 200, outputs: 'on'}\n"
        "  - {at_ms: 900, state: data}\n",
        tmp_path,
    )
    assert not result.passed
    off, late = result.verdicts
    assert off.seen == "outputs of el1918 were off at 200 ms"
    assert off.place.endswith("scenario.yaml:4:5")
    assert late.seen == "the run ended before"


@pytest.mark.parametrize(
    ("scenario", "words"),
    [
        ("version: 1\nsteps: [{at_ms: 1, break: ek1915}]", "write ek1914"),
        ("version: 1\nsteps: [{at_ms: 1, set: {ek1914.0x6001:09: 1}}]", "no input"),
        ("version: 1\nsteps: [{at_ms: 1}]", "does nothing"),
        ("version: 1\nsteps: [{at_ms: soon, press: reset}]", "not a number"),
        ("version: 1\nexpect: [{state: data}]", "at_ms"),
        ("version: 1\nexpect: [{at_ms: 1, state: running}]", "allowed"),
        ("version: 1\nstep: []", "write 'steps'"),
        ("[", "not valid YAML"),
    ],
)
def test_scenario_mistakes_are_located(tmp_path: Path, scenario: str, words: str):
    path = tmp_path / "scenario.yaml"
    path.write_text(scenario, "utf-8")
    with pytest.raises(InputError) as caught:
        session("estop", path)
    text = " ".join(f"{d.span} {d.message} {d.hint}" for d in caught.value.diagnostics)
    assert words in text
    assert "scenario.yaml:" in text


def test_plan_of_another_network_is_refused(tmp_path: Path):
    from fsoe_net.plan.compile import compile_plan

    other = tmp_path / "other.fsnplan"
    other.write_bytes(compile_plan(example("el6910")).to_bytes())
    with pytest.raises(InputError, match="not compiled from these files"):
        prepare(resolved(EXAMPLES / "estop" / "network.yaml"), str(other), None, virtual=True)
