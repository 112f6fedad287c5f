"""Writes the entries of a person at the machine into a test record without losing data.

An entry includes the values that the person saw in the file: if they have changed in the meantime,
nothing is written. A correction keeps the earlier entry in the remark. Other text entered by
people, including comments, is preserved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.diag.printable import first_control
from fsoe_net.errors import InputError
from fsoe_net.formats.own.test_record import load_test_record
from fsoe_net.formats.shared.files import Collector, read_source, read_unchanged, replaced_files
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.model.test_record import DeviceEntry, StepOutcome, TestRecord, TestStep
from fsoe_net.project.edit import EditedText

Fields = Mapping[str, str]

_STEP = ("result", "measured_ms", "remark", "by", "date")
_DEVICE = ("firmware", "serial", "safety_project_crc")
_MOST_CHARACTERS = 4000
_RESULTS = ("", *(outcome.value for outcome in StepOutcome))


class Conflict(InputError):
    """The file has changed since the person saw it.

    Attributes:
        present: Its current content.
    """

    def __init__(self, present: Fields) -> None:
        super().__init__("another person has entered something else meanwhile")
        self.present = present


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineEntry:
    """Values entered by a person.

    Attributes:
        step: Id of a step; empty for data read at a SubDevice.
        subdevice: Its name.
        before: The values in the file when the person began.
        now: The values.
    """

    step: str = ""
    subdevice: str = ""
    before: Fields
    now: Fields


def step_fields(step: TestStep) -> dict[str, str]:
    """Return the column of the machine as texts; empty if not filled in."""
    machine = step.machine
    return {
        "result": "" if machine.outcome is None else machine.outcome.value,
        "measured_ms": "" if machine.measured_ms is None else _ms(machine.measured_ms),
        "remark": machine.remark,
        "by": machine.by,
        "date": machine.date,
    }


def device_fields(device: DeviceEntry) -> dict[str, str]:
    """Return the data read at a SubDevice; the CRC is read only for a MainInstance."""
    values = {key: getattr(device, key) for key in _DEVICE}
    return {key: value for key, value in values.items() if value is not None}


def enter(path: str, entry: MachineEntry) -> dict[str, str]:
    """Write an entry into a test record; an identical entry changes nothing.

    Returns:
        The resulting values in the file.

    Raises:
        Conflict: Another entry was made in the meantime.
        InputError: The file is not a test record, or cannot contain the entry; with the reason.
        EnvironmentFault: The file cannot be written; the existing content is unchanged.
    """
    source, data = read_source(path)
    test_record = _test_record(path, data)
    present = _present(test_record, entry)
    before, now = (_taken(fields, present) for fields in (entry.before, entry.now))
    if entry.step:
        now = _kept(before, now)
    # The same entry twice usually results from a lost answer, and is not a conflict.
    if present == now:
        return now
    # Compared with the values that the person saw: an entry of another person must not be
    # overwritten.
    if present != before:
        raise Conflict(present)
    edited = EditedText(data.decode("utf-8-sig"), path)
    row = _row(edited.document, entry)
    for key, text in now.items():
        # Only changed values are written, so that comments and quotes of others are preserved.
        if text != present[key]:
            row[key] = _number(text) if key == "measured_ms" and text else text
    new = edited.text.encode("utf-8")
    # Read back: text that YAML would change must not be written.
    written = _present(_test_record(path, new), entry)
    if written != now:
        raise InputError(f"{path} cannot hold this entry; write it into the file by hand")
    # The file may have changed since it was read.
    read_unchanged(path, source.sha256, next_step="enter it again")
    write_whole(path, new, overwrite=True)
    return now


def _test_record(path: str, data: bytes) -> TestRecord:
    out = Collector()
    with replaced_files({path: data}):
        test_record = load_test_record(path, out)
    if test_record is None:
        first = next(d for d in out.diagnostics if d.level is Severity.ERROR)
        raise InputError(f"not entered: {first.message}; {first.hint}", out.diagnostics)
    return test_record


def _present(test_record: TestRecord, entry: MachineEntry) -> dict[str, str]:
    for step in test_record.machine_steps:
        if entry.step and step.id == entry.step:
            return step_fields(step)
    for device in test_record.devices:
        if not entry.step and device.subdevice == entry.subdevice:
            return device_fields(device)
    raise InputError("not entered: the test record has no such step or row")


def _taken(fields: Fields, present: Fields) -> dict[str, str]:
    """Return the existing values of a row, each on one line."""
    found = {}
    for key in present:
        # Each value is on one line, because people also read the file.
        text = " ".join(str(fields.get(key, "")).split())
        if len(text) > _MOST_CHARACTERS or first_control(text):
            raise InputError(
                f"not entered: {key} is longer than {_MOST_CHARACTERS} characters, or has one in "
                "it that does not print"
            )
        found[key] = text
    if "result" in found:
        if found["result"] not in _RESULTS:
            raise InputError(f"not entered: result is one of {', '.join(_RESULTS[1:])}")
        found["measured_ms"] = _measured(found["measured_ms"])
    return found


def _measured(text: str) -> str:
    if not text:
        return ""
    try:
        return _ms(float(text.replace(",", ".")))
    except (ValueError, OverflowError) as exc:
        raise InputError(f"not entered: {text!r} is not a time in ms, such as 61.5") from exc


def _ms(value: float) -> str:
    return f"{value:.10g}"


def _number(text: str) -> float | int:
    return int(text) if text.isdecimal() else float(text)


def _kept(before: Fields, now: dict[str, str]) -> dict[str, str]:
    """Return an entry with the corrected one in its remark."""
    if not before["result"] or now == before:
        return now
    measured = f"{before['measured_ms']} ms" if before["measured_ms"] else ""
    # An existing remark is not repeated with each correction.
    remark = "" if before["remark"] in now["remark"] else before["remark"]
    parts = (before["result"], measured, remark, before["by"], before["date"])
    text = f"before: {', '.join(part for part in parts if part)}"
    return now | {"remark": f"{now['remark']}; {text}" if now["remark"] else text}


def _row(document: Any, entry: MachineEntry) -> Any:
    """Return the map of the file for an entry."""
    if not entry.step:
        return next(r for r in document["devices"] if str(r["subdevice"]) == entry.subdevice)
    row = next(r for r in document["steps"] if str(r["id"]) == entry.step)
    if not row.get("machine"):
        row["machine"] = dict.fromkeys(_STEP, "")
    return row["machine"]
