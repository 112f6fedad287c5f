"""A test record as a document to print and fill in."""

from __future__ import annotations

from fsoe_net.diag.words import counted
from fsoe_net.document.model import (
    BLANK,
    Cell,
    Column,
    Document,
    Item,
    Level,
    Number,
    Table,
    Text,
    Verdict,
    cell,
    code,
    muted,
    strong,
    words,
)
from fsoe_net.model.test_record import (
    EMULATED_NOTE,
    DeviceEntry,
    StepOutcome,
    StepResult,
    TestRecord,
    TestStep,
)
from fsoe_net.plan.fingerprint import short_code

_COLUMNS = (
    Column("Step", share=11),
    Column("What to do", share=14),
    Column("Expected", share=17),
    Column(EMULATED_NOTE, share=13),
    Column("LIVE, seen by fsn-master", share=7),
    Column("MACHINE: result, time, remark", share=27),
    Column("Who, when", share=11),
)
_READ = ("SubDevice", "Firmware", "Serial number", "CRC of the safety project")
_NOTE = (
    "The EtherCAT MainDevice is part of the black channel and takes no part in the safety "
    f"function. This tool is not certified. A test on emulated devices is {EMULATED_NOTE}; it "
    "closes no step. The safety manuals of the devices prevail."
)


def render_test_record(test_record: TestRecord, *, version: str) -> Document:
    """Return the document; the same test record gives the same document.

    Args:
        test_record: The test record to print.
        version: Version of fsoe-net.
    """
    p = test_record
    count = f"{len(p.open_steps)} of {counted(len(p.machine_steps), 'step')} open at the machine"
    if p.failed_steps:
        count += f", {len(p.failed_steps)} not as expected"
    # Listed separately: a person and a program disagree, which needs a decision, not a test.
    if p.disputed_steps:
        count += f", {len(p.disputed_steps)} as expected by hand and not by program"
    lead = [words(_NOTE, note=True), words("Plan ", code(p.plan_sha256))]
    if p.fingerprint:
        lead.append(words("Fingerprint ", code(p.fingerprint)))
    rows = tuple(_row(step) for step in p.steps)
    return Document(
        title=f"Test record of {p.network}",
        subtitle=p.project,
        version=version,
        seal=short_code(p.fingerprint) if p.fingerprint else "not known",
        lead=(
            *lead,
            words(strong(f"{count}.")),
            Table(name="steps", columns=_COLUMNS, rows=rows),
            Table(
                name="read at the devices",
                columns=tuple(Column(h) for h in _READ),
                rows=tuple(_device(device) for device in p.devices),
            ),
        ),
        landscape=True,
    )


def _device(device: DeviceEntry) -> tuple[Cell, ...]:
    project = device.safety_project_crc
    return (
        cell(strong(device.subdevice)),
        _written(device.firmware),
        _written(device.serial),
        cell(muted("no MainInstance")) if project is None else _written(project),
    )


def _written(text: str) -> Cell:
    return cell(text) if text else BLANK


def _row(step: TestStep) -> tuple[Cell, ...]:
    who = " ".join(part for part in (step.machine.by, step.machine.date) if part)
    expected = cell(step.expected)
    if step.limit_ms is not None:
        expected = cell(*expected, f"within {step.limit_ms:g} ms", muted(f"({step.limit_source})"))
    return (
        cell(strong(step.id)),
        cell(step.what),
        expected,
        _seen(step.emulated),
        _seen(step.live),
        _machine(step),
        cell(who) if who or not step.kind.at_machine else BLANK,
    )


def _seen(seen: StepResult | None) -> Cell:
    if seen is None:
        return ()
    remark = "; ".join(text for text in (seen.time_is, seen.remark) if text)
    return _result(seen.outcome, seen.measured_ms, remark)


def _machine(step: TestStep) -> Cell:
    if not step.kind.at_machine:
        return cell(muted("not tried at the machine"))
    machine = step.machine
    late = cell(Verdict("later than allowed", Level.ERROR)) if step.is_late else ()
    return (*late, *_result(machine.outcome, machine.measured_ms, machine.remark)) or BLANK


def _result(outcome: StepOutcome | None, measured_ms: float | None, remark: str) -> Cell:
    items: list[Item] = []
    if outcome is StepOutcome.NOT_AS_EXPECTED:
        items.append(Verdict(outcome.value, Level.ERROR))
    elif outcome is not None:
        items.append(Text(outcome.value))
    if measured_ms is not None:
        text = f"{measured_ms:g}"
        items.append(Number(value=measured_ms, text=text, unit="ms", source=""))
    if remark:
        items.append(muted(remark))
    return tuple(items)
