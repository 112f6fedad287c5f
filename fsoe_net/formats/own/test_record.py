"""Test records: what ``fsoe-net test-record`` writes and people fill in."""

from __future__ import annotations

import os
import re
from datetime import date

from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.formats.own.schema import check_structure
from fsoe_net.formats.recognise import refuse_other
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.numbers import record_of
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, parse_yaml
from fsoe_net.model.test_record import (
    AtMachine,
    DeviceEntry,
    StepKind,
    StepOutcome,
    StepResult,
    TestRecord,
    TestStep,
)
from fsoe_net.model.written import says_something

_DATE = re.compile(r"(\d{4}-\d\d-\d\d)([T ].*)?")


def check_entry(step: TestStep, out: Collector) -> None:
    """Report missing or invalid entries in the column of the machine.

    Args:
        step: A step as read.
        out: Takes FSN160 and FSN161.
    """
    machine = step.machine
    if not machine.filled:
        return
    if not step.kind.at_machine:
        out.add(
            "FSN161",
            machine.span,
            f"step {step.id} is tried on the emulated bus only, and has an entry at the machine",
            hint="empty it; note tests of your own outside this test record",
        )
        return
    check_date(f"step {step.id}", machine.date, machine.at("date"), out)
    if step.is_late and machine.outcome is StepOutcome.AS_EXPECTED:
        out.add(
            "FSN161",
            machine.at("measured_ms"),
            f"step {step.id}: {machine.measured_ms:g} ms is longer than the limit of "
            f"{step.limit_ms:g} ms, but the entered result is `as expected`",
            hint="write `result: not as expected` and find the cause, or correct the time",
        )
    if missing := _missing(machine):
        out.add(
            "FSN160",
            machine.span,
            f"step {step.id} stays open: {' and '.join(missing)} not filled in",
            hint="write result, by (who was there) and date (such as 2026-11-21)",
        )


def _missing(machine: AtMachine) -> list[str]:
    by, day = says_something(machine.by), says_something(machine.date)
    rows = {"result": machine.outcome, "by": by, "date": day}
    return [key for key, value in rows.items() if not value]


def check_date(what: str, given: str, place: Span, out: Collector) -> None:
    """Report an invalid day as FSN161; an empty one is allowed."""
    text = given.strip()
    if not text:
        return
    match = _DATE.fullmatch(text)
    try:
        if match is None:
            raise ValueError
        date.fromisoformat(match[1])
    except ValueError:
        out.add(
            "FSN161",
            place,
            f"{what}: {text!r} is not a date",
            hint="write year, month and day, such as 2026-11-21",
        )


_NUMBER = re.compile(r"-?\d+(\.\d*)?([eE][+-]?\d{1,3})?")
_MAX_MS = 7 * 24 * 3600 * 1000.0


def load_test_record(path: str | os.PathLike[str], out: Collector) -> TestRecord | None:
    """Read a test record.

    Args:
        path: The file.
        out: Takes FSN101 … FSN116, FSN140, FSN160 and FSN161 with line and column.

    Returns:
        The test record, or ``None`` when it cannot be interpreted.
    """
    before = len(out.diagnostics)  # a key that is given twice counts
    data = read_bytes(path, out)
    file = os.fspath(path)
    if data is None or refuse_other(data, "test-record", file, out):
        return None
    root = parse_yaml(data, file, out)
    if root is None:
        return None
    check_structure(root, "test-record", out)
    if any(d.level is Severity.ERROR for d in out.diagnostics[before:]):
        return None
    steps = tuple(_step(node, out) for node in root.maps("steps"))
    seen: set[str] = set()
    for step in steps:
        if step.id in seen:
            out.add("FSN161", step.span, f"step {step.id} is there twice", hint="keep one of them")
        seen.add(step.id)
        check_entry(step, out)
    made = _text(root, "made")
    check_date("made", made, root.at("made"), out)
    if any(d.level is Severity.ERROR for d in out.diagnostics[before:]):
        return None
    return record_of(
        TestRecord,
        root,
        out,
        devices=tuple(_device(node, out) for node in root.maps("devices")),
        steps=steps,
    )


def _device(node: MapNode, out: Collector) -> DeviceEntry:
    has_project = "safety_project_crc" in node.pairs
    crc = _text(node, "safety_project_crc") if has_project else None
    return record_of(DeviceEntry, node, out, safety_project_crc=crc)


def _text(node: MapNode, key: str) -> str:
    return node.text(key) or ""


def _step(node: MapNode, out: Collector) -> TestStep:
    machine = node.get("machine")
    return record_of(
        TestStep,
        node,
        out,
        kind=StepKind(_text(node, "kind")),
        what=_text(node, "do"),
        expected=_text(node, "expect"),
        limit_ms=_ms(node, "limit_ms", out),
        emulated=_seen(node.get("emulated"), out),
        live=_seen(node.get("live"), out),
        machine=_machine(machine, out) if isinstance(machine, MapNode) else AtMachine(),
    )


def _seen(node: Node | None, out: Collector) -> StepResult | None:
    if not isinstance(node, MapNode):
        return None
    outcome = StepOutcome(_text(node, "result"))
    measured_ms = _ms(node, "measured_ms", out)
    return record_of(StepResult, node, out, outcome=outcome, measured_ms=measured_ms)


def _machine(node: MapNode, out: Collector) -> AtMachine:
    result = _text(node, "result")
    outcome = StepOutcome(result) if result else None
    measured_ms = _ms(node, "measured_ms", out)
    return record_of(AtMachine, node, out, outcome=outcome, measured_ms=measured_ms)


def _ms(node: MapNode, key: str, out: Collector) -> float | None:
    text = (node.text(key) or "").strip()
    if not text:
        return None
    hint = "write a time in ms, 0 or more, such as 61.5"
    if not _NUMBER.fullmatch(text):
        out.add("FSN111", node.at(key), f"{key} {text!r} is not a number", hint=hint)
        return None
    value = float(text)
    if not 0 <= value <= _MAX_MS:
        out.add("FSN113", node.at(key), f"{key} is {value:g}", hint=hint)
        return None
    return value
