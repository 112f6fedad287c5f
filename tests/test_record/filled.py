"""Test records of the networks that tests have."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.model.test_record import AtMachine, StepKind, StepOutcome, TestRecord, TestStep
from fsoe_net.plan.compile import compile_plan
from fsoe_net.test_record.steps import make_test_record

TIMED = Path(__file__).parents[1] / "diagnostics" / "base" / "timed.yaml"
DONE = AtMachine(
    outcome=StepOutcome.AS_EXPECTED, measured_ms=61.5, by="A. Person", date="2026-11-21"
)


def timed() -> Resolution:
    network = load_network([TIMED]).network
    assert network is not None
    return resolve(network)


def fresh_record(resolution: Resolution) -> tuple[TestRecord, bytes]:
    plan = compile_plan(resolution).to_bytes()
    return make_test_record(resolution, plan), plan


def only(test_record: TestRecord, *kinds: StepKind) -> TestRecord:
    return replace(test_record, steps=tuple(s for s in test_record.steps if s.kind in kinds))


def by_id(test_record: TestRecord) -> dict[str, TestStep]:
    return {step.id: step for step in test_record.steps}
