"""Steps of a test record, and what the emulated bus fills in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from live.support import ESTOP, needs_core, resolution_of
from test_record.filled import TIMED, by_id, fresh_record, only, timed

from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.model.safety import ElementKind, SafeBit
from fsoe_net.model.test_record import StepKind, StepOutcome, StepResult
from fsoe_net.test_record import virtual
from fsoe_net.test_record.virtual import run_tests_virtual


def test_steps_of_functions_connections_devices_and_faults() -> None:
    test_record, _ = fresh_record(timed())
    ids = list(by_id(test_record))
    assert ids[:6] == [
        "start-up logic-io",
        "start-up logic-io2",
        "trigger estop",
        "loss io",
        "loss io2",
        "loss logic",
    ]
    assert ids[6:] == [f"fault {name}" for name in CATALOGUE]
    assert by_id(test_record)["loss io"].expected == (
        "logic-io leaves Data; the outputs of the logic go off and stay off when io is back, "
        "until a reset is pressed."
    )
    trigger = by_id(test_record)["trigger estop"]
    assert "ES1 is pressed" in trigger.what
    assert "K1 opens" in trigger.expected
    assert trigger.limit_ms == 300
    assert test_record.open_steps == test_record.machine_steps == test_record.steps[:6]
    assert test_record.failed_steps == ()


def test_the_trigger_names_the_safe_bits_to_watch() -> None:
    resolution = timed()
    (estop,) = resolution.network.safety_functions
    bits = {
        ElementKind.INPUT: (SafeBit(bit=0, name="ES1 A"), SafeBit(bit=1, name="ES1 B")),
        ElementKind.OUTPUT: (SafeBit(bit=0, name="K1"),),
    }
    elements = tuple(replace(e, bits=bits.get(e.kind, ())) for e in estop.elements)
    network = replace(resolution.network, safety_functions=(replace(estop, elements=elements),))
    before = by_id(fresh_record(resolution)[0])["trigger estop"]
    now = by_id(fresh_record(replace(resolution, network=network))[0])["trigger estop"]
    assert now.what == before.what + (
        " Safe bits to watch: ES1 A is bit 0 of the frame from io; ES1 B is bit 1 of the frame "
        "from io; K1 is bit 0 of the frame to io2."
    )
    assert now.expected == before.expected


@pytest.mark.uncounted
@pytest.mark.shows("R13")
@needs_core
def test_the_emulated_bus_measures_and_closes_no_step() -> None:
    resolution = timed()
    empty, plan = fresh_record(resolution)
    wanted = only(empty, StepKind.START_UP, StepKind.TRIGGER, StepKind.LOSS)
    done = run_tests_virtual(wanted, resolution, plan)
    assert [s.emulated.outcome for s in done.steps if s.emulated] == [StepOutcome.AS_EXPECTED] * 6
    steps = by_id(done)
    times = {name: s.emulated.measured_ms for name, s in steps.items() if s.emulated}
    said = {name: s.emulated.time_is for name, s in steps.items() if s.emulated}
    assert "from safe inputs 0 to safe outputs 0" in said["trigger estop"]
    assert "from the last bus cycle with it" in said["loss io"]
    assert all("to the bus cycle of 1 ms" in text for text in said.values())
    assert 0 < (times["trigger estop"] or 0) < 20  # two handshakes of a few bus cycles
    assert 100 <= (times["loss io"] or 0) <= 110  # its watchdog is 100 ms
    assert len(done.open_steps) == len(wanted.open_steps) == len(wanted.steps)
    assert not any(step.is_done for step in done.steps)
    assert all(not s.machine.filled and s.live is None for s in done.steps)
    assert run_tests_virtual(wanted, resolution, plan) == done


@needs_core
def test_a_reaction_that_comes_too_late_is_said() -> None:
    resolution = timed()
    empty, plan = fresh_record(resolution)
    trigger = replace(by_id(empty)["trigger estop"], limit_ms=1.0)
    (step,) = run_tests_virtual(replace(empty, steps=(trigger,)), resolution, plan).steps
    assert step.emulated is not None
    assert step.emulated.outcome is StepOutcome.NOT_AS_EXPECTED
    assert step.emulated.remark.startswith("later than 1 ms")


@needs_core
def test_faults_are_counted_per_class() -> None:
    resolution = resolution_of(ESTOP)
    empty, plan = fresh_record(resolution)
    wanted = [s for s in empty.steps if s.subject in ("delay", "repetition", "masquerade")]
    done = run_tests_virtual(replace(empty, steps=tuple(wanted)), resolution, plan, faults=20)
    for step in done.steps:
        assert step.emulated is not None
        assert step.emulated.outcome is StepOutcome.AS_EXPECTED
        assert step.emulated.remark.startswith("20 faults: ")
        assert "0 wrongly accepted" in step.emulated.remark


@needs_core
def test_a_function_without_emulated_inputs_stays_open_with_the_reason() -> None:
    network = load_network([TIMED]).network
    assert network is not None
    (function,) = network.safety_functions
    elements = tuple(replace(e, sub="logic") if e.sub == "io" else e for e in function.elements)
    network = replace(network, safety_functions=(replace(function, elements=elements),))
    resolution = resolve(network)
    empty, plan = fresh_record(resolution)
    (step,) = run_tests_virtual(only(empty, StepKind.TRIGGER), resolution, plan).steps
    assert step.emulated is not None
    assert step.emulated.outcome is StepOutcome.NOT_RUN
    assert "no emulated safe input bits" in step.emulated.remark


@needs_core
def test_steps_are_reported_as_they_begin() -> None:
    resolution = timed()
    empty, plan = fresh_record(resolution)
    told: list[str] = []
    wanted = only(empty, StepKind.START_UP)
    run_tests_virtual(wanted, resolution, plan, on_step=told.append)
    assert told == ["start-up logic-io", "start-up logic-io2"]


def _emulated(resolution: Resolution | None = None, *kinds: StepKind) -> dict[str, str]:
    """Return outcome and remark of each step, on the emulated bus."""
    resolution = resolution or timed()
    empty, plan = fresh_record(resolution)
    kinds = kinds or (StepKind.START_UP, StepKind.TRIGGER, StepKind.LOSS)
    steps = run_tests_virtual(only(empty, *kinds), resolution, plan).steps
    return {
        s.id: f"{s.emulated.outcome.value if s.emulated.outcome else None}: {s.emulated.remark}"
        for s in steps
        if s.emulated
    }


START_UPS = ("start-up logic-io", "start-up logic-io2")
REACTIONS = ("trigger estop", "loss io", "loss io2", "loss logic")


@needs_core
def test_connections_that_never_reach_data(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(virtual, "_PATIENCE_NS", 1_000_000)
    assert _emulated() == dict.fromkeys(
        START_UPS, "not as expected: never reached Data"
    ) | dict.fromkeys(REACTIONS, "not run: not all connections reached Data")


@needs_core
def test_outputs_that_are_never_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(virtual, "_on", lambda *_: ["a", "b", "c", "d"])
    assert _emulated() == dict.fromkeys(
        START_UPS, "not as expected: an output was on before a reset"
    ) | dict.fromkeys(REACTIONS, "not as expected: still on: a, b, c")


@needs_core
def test_outputs_that_are_never_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(virtual, "_on", lambda *_: [])
    found = _emulated(None, StepKind.TRIGGER, StepKind.LOSS)
    assert found == dict.fromkeys(REACTIONS, "not run: none of its outputs was on")


def test_an_output_that_comes_on_again(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = iter((["a"], [], ["a"]))
    monkeypatch.setattr(virtual, "_cycles", lambda *_: iter((9_000_000, 10_000_000, 11_000_000)))
    monkeypatch.setattr(virtual, "_on", lambda *_: next(seen))
    emulation = SimpleNamespace(_time_is=lambda words: words)
    found = virtual._Emulation._reaction(
        emulation,  # type: ignore[arg-type]
        SimpleNamespace(cycle_ns=1_000_000),  # type: ignore[arg-type]
        ["a"],
        act_ns=10_000_000,
        end_ns=20_000_000,
    )
    assert found == StepResult(
        outcome=StepOutcome.NOT_AS_EXPECTED,
        measured_ms=0.0,
        time_is="until it went off",
        remark="a came on again without a reset",
    )


@needs_core
def test_a_loss_of_what_is_copied_and_safe_of_nothing(tmp_path: Path) -> None:
    """One SubDevice carries standard data only, another one nothing that is copied."""
    text = TIMED.read_text("utf-8").replace("devices/", f"{TIMED.parent}/devices/")
    rows = "".join(
        f"  - {{name: {name}, position: {n}, config: {TIMED.parent}/devices/ek1914.yaml}}\n"
        for n, name in enumerate(("other", "idle"), 3)
    )
    text = text.replace("nets:\n", f"{rows}nets:\n", 1)
    text = text.replace("in: {ec_module: io, index: 0x6010", "in: {ec_module: other, index: 0x6010")
    path = tmp_path / "network.yaml"
    path.write_text(text, "utf-8")
    network = load_network([path]).network
    assert network is not None
    found = _emulated(resolve(network), StepKind.LOSS)
    assert found["loss other"] == "as expected: 2 of 2 connections in Data without it"
    resolution = resolve(network)
    empty, plan = fresh_record(resolution)
    nobody = replace(by_id(empty)["loss other"], subject="nobody")
    (step,) = run_tests_virtual(replace(empty, steps=(nobody,)), resolution, plan).steps
    assert step.emulated is not None
    assert step.emulated.remark == "nobody carries no process data that is copied"
