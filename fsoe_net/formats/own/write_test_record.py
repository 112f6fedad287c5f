"""Test records as YAML, for people to fill in and for version control."""

from __future__ import annotations

from typing import Any

import yaml

from fsoe_net.formats.own.write_acceptance import values_of
from fsoe_net.model.test_record import (
    EMULATED_NOTE,
    DeviceEntry,
    StepResult,
    TestRecord,
    TestStep,
)

_HEAD = f"""\
# Test record. Column "emulated": {EMULATED_NOTE}.
# Column "live": what a running fsn-master showed. Column "machine" is yours: write into it
#   result: as expected | not as expected | not run, measured_ms, remark, by, date.
# A step stays open until machine has result, by and date. Steps without it (faults) are tried on
#   the emulated bus only. Not certified, no safety function.
# "devices": read them at the machine; where there is none, `not applicable: why`.
"""


def write_test_record(test_record: TestRecord) -> str:
    """Return the text of a test record; the same test record gives the same text."""
    document: dict[str, Any] = {
        "version": 1,
        **values_of(test_record, "network", "project", "plan_sha256", "fingerprint", "made"),
        "emulated_note": EMULATED_NOTE,
        "devices": [_device(device) for device in test_record.devices],
        "steps": [_step(step) for step in test_record.steps],
    }
    body = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=100)
    return _HEAD + str(body)


def _device(device: DeviceEntry) -> dict[str, Any]:
    row = values_of(device, "subdevice", "firmware", "serial", "safety_project_crc")
    return {key: value for key, value in row.items() if value is not None}


def _step(step: TestStep) -> dict[str, Any]:
    row: dict[str, Any] = {
        "id": step.id,
        "kind": step.kind.value,
        "subject": step.subject,
        "do": step.what,
        "expect": step.expected,
        **values_of(step, "limit_ms", "limit_source"),
        "emulated": _seen(step.emulated),
        "live": _seen(step.live),
    }
    machine = step.machine
    if step.kind.at_machine or machine.filled:
        row["machine"] = {
            "result": machine.outcome.value if machine.outcome else "",
            "measured_ms": "" if machine.measured_ms is None else machine.measured_ms,
            **values_of(machine, "remark", "by", "date"),
        }
    return row


def _seen(seen: StepResult | None) -> dict[str, Any] | None:
    if seen is None:
        return None
    return {
        "result": seen.outcome.value,
        **values_of(seen, "measured_ms", "time_is", "remark"),
    }
