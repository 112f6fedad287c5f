"""Test protocols of the networks that tests have."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fsoe_net.formats.own.network import load_network
from fsoe_net.model.protocol import AtMachine, Protocol, ProtocolStep, StepKind, StepOutcome
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.plan.compile import compile_plan
from fsoe_net.test_record.steps import make_protocol

TIMED = Path(__file__).parents[1] / "diagnostics" / "base" / "timed.yaml"
DONE = AtMachine(
    outcome=StepOutcome.AS_EXPECTED, measured_ms=61.5, by="A. Person", date="2026-11-21"
)


def timed() -> Resolution:
    network = load_network([TIMED]).network
    assert network is not None
    return resolve(network)


def protocol_of(resolution: Resolution) -> tuple[Protocol, bytes]:
    plan = compile_plan(resolution).to_bytes()
    return make_protocol(resolution, plan), plan


def only(protocol: Protocol, *kinds: StepKind) -> Protocol:
    return replace(protocol, steps=tuple(s for s in protocol.steps if s.kind in kinds))


def by_id(protocol: Protocol) -> dict[str, ProtocolStep]:
    return {step.id: step for step in protocol.steps}
