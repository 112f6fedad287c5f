"""Test records as files: what people write is checked, kept, and closes a step or does not."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from test_record.filled import DONE, by_id, fresh_record, timed

from fsoe_net.document.write_html import document_html
from fsoe_net.errors import InputError
from fsoe_net.formats.own.json_schema import read_schema
from fsoe_net.formats.own.test_record import load_test_record
from fsoe_net.formats.own.write_test_record import write_test_record
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.test_record import EMULATED_NOTE, StepOutcome, StepResult, TestRecord
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import fingerprint_of
from fsoe_net.report.test_record_document import render_test_record
from fsoe_net.test_record.steps import compare_test_record, keep_machine, make_test_record


def test_the_file_is_read_back_as_it_was(tmp_path: Path) -> None:
    test_record, _ = fresh_record(timed())
    first = replace(test_record.steps[0], machine=DONE)
    test_record = replace(test_record, steps=(first, *test_record.steps[1:]))
    path = tmp_path / "test-record.yaml"
    text = write_test_record(test_record)
    path.write_text(text, "utf-8")
    out = Collector()
    assert load_test_record(path, out) == test_record
    assert out.diagnostics == []
    assert EMULATED_NOTE in text
    jsonschema.validate(yaml.safe_load(text), read_schema("test-record"))
    assert test_record.steps[0] not in test_record.open_steps
    assert test_record.steps[0].is_done


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("kind: trigger", "kind: triggered", "triggered"),
        ("result: ''", "result: fine", "fine"),
        ("limit_ms: 300.0", "limit_ms: soon", "soon"),
        ("limit_ms: 300.0", "limit_ms: -1", "-1"),
        ("id: loss io2", "id: loss io", "twice"),
        ("emulated: null", "emulatd: null", "emulatd"),
        ("date: ''", "date: 21.11.2026", "such as 2026-11-21"),
        ("date: ''", "date: 2026-02-30", "is not a date"),
        ("    measured_ms: ''", "    measured_ms: 61,5", "61,5"),
        ("made: ''", "made: 2026-02-30", "made: '2026-02-30' is not a date"),
        ("firmware: ''", "firmwear: ''", "firmwear"),
        ("    remark: ''", "    result: as expected\n    remark: ''", "'result' is given twice"),
    ],
)
def test_mistakes_of_people_are_located(
    before: str, after: str, words: str, tmp_path: Path
) -> None:
    test_record, _ = fresh_record(timed())
    text = write_test_record(test_record)
    assert before in text
    path = tmp_path / "test-record.yaml"
    path.write_text(text.replace(before, after, 1), "utf-8")
    out = Collector()
    assert load_test_record(path, out) is None
    found = out.diagnostics[0]
    assert words in f"{found.message} {found.hint}"
    assert found.span.line > 4


def test_readings_of_devices_are_kept_and_required() -> None:
    empty, _ = fresh_record(timed())
    old = replace(
        empty,
        made="2026-11-20",
        devices=tuple(replace(d, firmware="03") for d in empty.devices),
    )
    assert keep_machine(replace(empty, made="2026-11-23"), old) == old
    with pytest.raises(InputError, match="results at the machine of another plan"):
        keep_machine(replace(empty, plan_sha256="1" * 64), old)
    *others, logic = old.devices
    for devices, words in (
        (others, "logic is missing among the devices to read"),
        (
            [*others, replace(logic, safety_project_crc=None)],
            "logic has a MainInstance, and no safety_project_crc to read",
        ),
    ):
        cut, out = replace(old, devices=tuple(devices)), Collector()
        compare_test_record(cut, empty, out)
        assert [d.message for d in out.diagnostics] == [words]
        kept = keep_machine(empty, cut).devices[-1]
        assert (kept.subdevice, kept.safety_project_crc) == ("logic", "")


def test_a_date_and_a_number_by_hand_are_read(tmp_path: Path) -> None:
    test_record, _ = fresh_record(timed())
    text = write_test_record(test_record)
    text = text.replace(
        "    result: ''\n    measured_ms: ''", "    result: as expected\n    measured_ms: 61.5", 1
    )
    text = text.replace("by: ''", "by: A. Person", 1).replace("date: ''", "date: 2026-11-21", 1)
    path = tmp_path / "test-record.yaml"
    path.write_text(text, "utf-8")
    out = Collector()
    read = load_test_record(path, out)
    assert out.diagnostics == []
    assert read is not None
    assert read.steps[0].machine == DONE


def written(tmp_path: Path, **machine: object) -> tuple[Collector, TestRecord | None]:
    """Return what is read when people have written into one step, and nothing else."""
    test_record, _ = fresh_record(timed())
    document = yaml.safe_load(write_test_record(test_record))
    for step in document["steps"]:
        if step["id"] == machine.get("step", "trigger estop"):
            step["machine"] = {k: v for k, v in machine.items() if k != "step"}
    path = tmp_path / "test-record.yaml"
    path.write_text(yaml.safe_dump(document, sort_keys=False), "utf-8")
    out = Collector()
    return out, load_test_record(path, out)


@pytest.mark.parametrize(
    ("machine", "missing"),
    [
        ({"result": "as expected"}, "by and date not filled in"),
        ({"result": "as expected", "by": "A. Person"}, ": date not filled in"),
        ({"by": "A. Person", "date": "2026-11-21"}, ": result not filled in"),
        ({"measured_ms": 61.5}, "result and by and date"),
    ],
)
def test_an_unfinished_entry_is_named_and_stays_open(
    machine: dict[str, Any], missing: str, tmp_path: Path
) -> None:
    out, read = written(tmp_path, **machine)
    (found,) = out.diagnostics
    assert (found.code, found.span.line > 4) == ("FSN160", True)
    assert missing in found.message
    assert "2026-11-21" in (found.hint or "")
    assert read is not None
    assert by_id(read)["trigger estop"].is_open


SIGNED = {"result": "as expected", "by": "A. Person", "date": "2026-11-21"}


def test_a_time_above_the_limit_is_not_as_expected(tmp_path: Path) -> None:
    out, read = written(tmp_path, **SIGNED, measured_ms=301)
    assert read is None
    assert "301 ms is longer than the limit of 300 ms" in out.diagnostics[0].message
    out, read = written(tmp_path, **{**SIGNED, "result": "not as expected"}, measured_ms=231)
    assert read is not None
    assert out.diagnostics == []
    assert [step.id for step in read.failed_steps] == ["trigger estop"]


def test_a_step_on_the_emulated_bus_only_takes_no_entry_at_the_machine(tmp_path: Path) -> None:
    out, read = written(tmp_path, **SIGNED, step="fault delay")
    assert read is None
    assert "emulated bus only" in out.diagnostics[0].message


def test_a_test_record_is_held_against_the_files() -> None:
    resolution = timed()
    plan = compile_plan(resolution)
    whole = fingerprint_of(plan).whole
    fresh = make_test_record(resolution, plan.to_bytes(), fingerprint=whole)

    def said(given: TestRecord) -> list[str]:
        out = Collector()
        compare_test_record(given, fresh, out)
        assert all(d.code == "FSN161" and d.hint for d in out.diagnostics)
        return [d.message for d in out.diagnostics]

    assert said(fresh) == []
    assert said(replace(fresh, plan_sha256="0" * 64)) == []  # the fingerprint counts
    first, *others = fresh.steps
    assert said(replace(fresh, steps=tuple(others))) == [
        f"step {first.id} of these files is missing"
    ]
    strange = replace(first, id="loss other")
    assert said(replace(fresh, steps=(*fresh.steps, strange))) == [
        "step loss other is not one of these files"
    ]
    trigger = by_id(fresh)["trigger estop"]
    wide = replace(trigger, limit_ms=900.0)
    steps = tuple(wide if step is trigger else step for step in fresh.steps)
    assert said(replace(fresh, steps=steps)) == [
        "step trigger estop: limit_ms is not what these files give"
    ]
    (words,) = said(replace(fresh, fingerprint="0" * 64))
    assert words.startswith("made for another configuration (0000 0000 0000 0000)")


def test_a_step_stays_open_without_name_and_date() -> None:
    test_record, _ = fresh_record(timed())
    step = test_record.steps[0]
    assert not replace(step, machine=DONE).is_open
    assert replace(step, machine=replace(DONE, by="")).is_open
    assert replace(step, machine=replace(DONE, date="")).is_open
    assert replace(step, machine=replace(DONE, outcome=StepOutcome.NOT_RUN)).is_open
    assert replace(step, machine=replace(DONE, outcome=None)).is_open


FINE = StepResult(outcome=StepOutcome.AS_EXPECTED, measured_ms=5.0)
WRONG = replace(FINE, outcome=StepOutcome.NOT_AS_EXPECTED)


@pytest.mark.shows("R13")
def test_a_result_of_a_program_closes_no_step() -> None:
    test_record, _ = fresh_record(timed())
    seen = replace(
        test_record, steps=tuple(replace(s, emulated=FINE, live=FINE) for s in test_record.steps)
    )
    assert seen.open_steps == seen.machine_steps
    assert not any(step.is_done for step in seen.steps)


def test_a_step_that_failed_is_never_done() -> None:
    test_record, _ = fresh_record(timed())
    trigger = by_id(test_record)["trigger estop"]
    fine = replace(trigger, machine=DONE)
    assert fine.is_done
    failed = replace(trigger, machine=replace(DONE, outcome=StepOutcome.NOT_AS_EXPECTED))
    assert (failed.is_open, failed.is_failed, failed.is_done) == (False, True, False)
    unsigned = replace(failed, machine=replace(failed.machine, by=""))
    assert (unsigned.is_open, unsigned.is_failed) == (True, True)
    late = replace(trigger, machine=replace(DONE, measured_ms=300.1))
    assert (late.is_late, late.is_failed, late.is_done) == (True, True, False)
    assert replace(test_record, steps=(fine, failed, late)).failed_steps == (failed, late)
    disputed = replace(fine, live=WRONG)
    assert disputed.is_done
    both = replace(test_record, steps=(fine, disputed))
    assert both.disputed_steps == (disputed,)
    assert "1 as expected by hand and not by program" in page_of(both)
    assert "not by program" not in page_of(replace(both, steps=(fine,)))


def page_of(test_record: TestRecord) -> str:
    return document_html(render_test_record(test_record, version="0"))


def test_a_class_of_faults_is_not_tried_at_the_machine() -> None:
    test_record, _ = fresh_record(timed())
    fault = by_id(test_record)["fault delay"]
    for step in (fault, replace(fault, emulated=FINE), replace(fault, machine=DONE)):
        assert (step.is_open, step.is_done, step.is_failed) == (False, False, False)
    assert replace(fault, emulated=WRONG, machine=DONE).is_failed


def test_entries_of_people_are_kept_or_nothing_is_written() -> None:
    fresh, _ = fresh_record(timed())
    written = replace(fresh, steps=(replace(fresh.steps[0], machine=DONE), *fresh.steps[1:]))
    assert keep_machine(fresh, written) == written
    with pytest.raises(InputError, match="of another plan"):
        keep_machine(replace(fresh, plan_sha256="0" * 64), written)
    with pytest.raises(InputError, match="no longer exist"):
        keep_machine(replace(fresh, steps=fresh.steps[1:]), written)
    changed = replace(fresh.steps[0], expected="something else")
    with pytest.raises(InputError, match="asks for something else"):
        keep_machine(replace(fresh, steps=(changed, *fresh.steps[1:])), written)
    empty = replace(written, steps=fresh.steps, plan_sha256="0" * 64)
    assert keep_machine(fresh, empty) == fresh


def test_the_page_names_what_is_emulated_and_leaves_room() -> None:
    test_record, _ = fresh_record(timed())
    strange = replace(test_record.steps[0], subject="<b>", what="a & b")
    page = page_of(replace(test_record, steps=(strange,)))
    assert EMULATED_NOTE in page
    assert "MACHINE" in page
    assert "1 of 1 step open" in page
    assert "a &amp; b" in page


# -- live -----------------------------------------------------------------------------------------


def test_the_schema_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(read_schema("test-record"))
    assert json.dumps(read_schema("test-record")).count("description") > 20
