"""Grounds of a sign-off, made without the command line."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

from report.made import TIMED, inputs_of

from fsoe_net.acceptance.sign_off import Grounds, sign_off
from fsoe_net.acceptance.signed_report import SignedReport, read_signed_report
from fsoe_net.model.acceptance import Acceptance, SignedBy
from fsoe_net.model.network import SourceFile
from fsoe_net.model.test_record import AtMachine, StepKind, StepOutcome, TestRecord, TestStep
from fsoe_net.plan.fingerprint import fingerprint_of
from fsoe_net.report.formats import render_report
from fsoe_net.report.inputs import Tried
from fsoe_net.test_record.steps import make_test_record

DAY = "2026-11-21"


def done(step: TestStep, **more: object) -> TestStep:
    """Return the step as a person filled it in."""
    values = {
        "outcome": StepOutcome.AS_EXPECTED,
        "measured_ms": 20.0,
        "by": "A. Meier",
        "date": DAY,
    }
    return replace(step, machine=AtMachine(**{**values, **more}))


def filled(test_record: TestRecord) -> TestRecord:
    """Do all but the faults at the machine, and read what is to be read there."""
    return replace(
        test_record,
        made=DAY,
        devices=tuple(
            replace(
                d,
                firmware="03",
                serial="4711",
                safety_project_crc=None if d.safety_project_crc is None else "0x8F1C",
            )
            for d in test_record.devices
        ),
        steps=tuple(s if s.kind is StepKind.FAULT else done(s) for s in test_record.steps),
    )


def grounds_of(path: Path = TIMED, **more: object) -> Grounds:
    """Return grounds with nothing against them."""
    inputs = inputs_of(path)
    resolution, plan = inputs.resolution, inputs.plan
    assert resolution is not None
    assert plan is not None
    asked = make_test_record(resolution, plan.to_bytes(), fingerprint=fingerprint_of(plan).whole)
    values = {
        "version": "0",
        "resolution": resolution,
        "plan": plan,
        "report": signed_report(report_with(path)),
        "diagnostics": inputs.diagnostics,
        "test_record": filled(asked),
        "test_record_source": source("test-record.yaml"),
        "author": SignedBy(name="A. Meier", date=DAY, competence="maker of the cell"),
        "verifier": SignedBy(name="B. Kaya", date=DAY, competence="safety engineer"),
        "equipment": ("oscilloscope 4711",),
        "environment": "hall 3",
    }
    return Grounds(**{**values, **more})


def source(path: str) -> SourceFile:
    return SourceFile(path=path, sha256="0" * 64)


def signed_report(data: bytes) -> SignedReport:
    """Return the report with this JSON form, and a page beside it."""
    page = b"<html>" + b" ".join(re.findall(rb"[0-9a-f]{64}", data))
    return read_signed_report([(source("r.html"), page), (source("r.json"), data)])


def report_with(path: Path = TIMED, **more: object) -> bytes:
    """Return the report in JSON, changed at its top level; it has evidence of the machine."""
    inputs = inputs_of(path)
    assert inputs.resolution is not None
    test_record = filled(make_test_record(inputs.resolution, b""))
    tried = Tried(source=source("test-record.yaml"), test_record=test_record)
    form = json.loads(render_report(replace(inputs, tried=tried), "json"))
    return json.dumps({**form, "of_machine": True, **more}).encode()


def record_of(path: Path = TIMED) -> Acceptance:
    record, refusals = sign_off(grounds_of(path))
    assert record is not None, refusals
    return record
