"""Test protocols as the report shows them."""

from __future__ import annotations

from fsoe_net.model.network import SourceFile
from fsoe_net.model.protocol import AtMachine, Protocol, ProtocolStep, StepResult
from fsoe_net.report.inputs import TestStep, Tried

__all__ = ["tried_of"]


def tried_of(source: SourceFile, protocol: Protocol) -> Tried:
    """Return the steps of a protocol."""
    return Tried(
        source=source,
        plan_sha256=protocol.plan_sha256,
        steps=tuple(_step(s) for s in protocol.steps),
        devices=protocol.devices,
    )


def _step(s: ProtocolStep) -> TestStep:
    machine = s.machine
    return TestStep(
        kind=s.kind,
        subject=s.subject,
        what=s.what,
        expected=s.expected,
        limit_ms=s.limit_ms,
        limit_source=s.limit_source,
        emulated=_words(s.emulated),
        emulated_ms=None if s.emulated is None else s.emulated.measured_ms,
        live=_words(s.live),
        live_ms=None if s.live is None else s.live.measured_ms,
        machine=_words(machine),
        machine_ms=machine.measured_ms,
        who=", ".join(w for w in (machine.by, machine.date) if w),
        is_open=s.is_open,
        is_failed=s.is_failed,
        is_disputed=s.is_disputed,
        at_machine=s.kind.at_machine,
    )


def _words(seen: StepResult | AtMachine | None) -> str:
    if seen is None or seen.outcome is None:
        return ""
    said = [getattr(seen, "time_is", ""), seen.remark]
    words = "; ".join(text for text in said if text)
    return f"{seen.outcome.value}: {words}" if words else str(seen.outcome.value)
