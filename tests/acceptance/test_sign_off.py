"""What a sign-off asks for, one ground after the other taken away."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from acceptance.signed import DAY, done, grounds_of, record_of, report_with, signed_report, source
from report.made import BASE, TIMED

from fsoe_net.acceptance.sign_off import Grounds, Reason, sign_off
from fsoe_net.acceptance.signed_report import read_signed_report
from fsoe_net.diag.diagnostic import Diagnostic, Span
from fsoe_net.errors import InputError
from fsoe_net.model.acceptance import Intervention, SignedBy
from fsoe_net.model.test_record import AtMachine, StepKind, StepOutcome, StepResult
from fsoe_net.model.written import names_a_person, same_person
from fsoe_net.plan.fingerprint import fingerprint_of


def refused(grounds: Grounds) -> list[str]:
    record, refusals = sign_off(grounds)
    assert (record is None) == bool(refusals)
    for one in refusals:
        assert one.fix
        # What is to be justified is named as in the refusal.
        for subject in re.findall(r'--justify "(?:\S+ )*(\w+).*?=reason', one.fix):
            assert subject in one.what
    return [r.what for r in refusals]


def with_step(grounds: Grounds, kind: StepKind, **machine: object) -> Grounds:
    """Return the grounds with the first step of a kind filled in otherwise."""
    first = next(s for s in grounds.test_record.steps if s.kind is kind)
    steps = tuple(done(s, **machine) if s is first else s for s in grounds.test_record.steps)
    return replace(grounds, test_record=replace(grounds.test_record, steps=steps))


@pytest.mark.shows("R14")
def test_a_record_names_its_evidence() -> None:
    grounds = grounds_of()
    record, refusals = sign_off(grounds)
    assert refusals == ()
    assert record is not None
    assert record.whole == fingerprint_of(grounds.plan).whole
    assert record.plan == grounds.plan.to_bytes()
    assert record.steps_left_out == ()
    assert record.steps == 6
    assert [s.path for s in record.inputs] == [s.path for s in grounds.resolution.network.sources]
    assert record.open_points > 0
    assert record.assumptions > 0
    assert record.replaces is None


def test_persons_equipment_and_environment_are_stated() -> None:
    author = SignedBy(name="A. Meier", date="2026-11-21")
    verifier = SignedBy(name="B. Kaya", date="2026-11-21", competence=" . ")
    grounds = grounds_of(author=author, verifier=verifier, equipment=(), environment="-")
    assert refused(grounds) == [
        "the competence of the author is not stated",
        "the competence of the verifier is not stated",
        "no test equipment is stated",
        "the environment of the tests is not stated",
    ]


@pytest.mark.shows("R14")
@pytest.mark.parametrize("name", ["A. Meier", "a meier", "  A.  MEIER ", "\uff21. Meier"])
def test_author_and_verifier_are_different_persons(name: str) -> None:
    grounds = grounds_of(verifier=SignedBy(name=name, date="2026-11-21", competence="x1"))
    assert refused(grounds) == [f"author and verifier are one person: {name}"]


def test_names_that_differ_are_two_people() -> None:
    assert not same_person("A. Meier", "B. Meier")
    assert not same_person("Meier, A.", "A. Meier")  # an order of names is no proof of one person
    assert not same_person("A. Meier <a@x>", "B. Kaya <b@x>")
    assert same_person("A. Meier <a@x>", "A. Meier <b@x>")
    assert same_person("A. Meier <a@x>", "B. Kaya <A@x>")
    assert not names_a_person("A <ab@x>")
    assert refused(grounds_of(author=SignedBy(name=" ", date="2026-11-21", competence="x1"))) == [
        "the author has no name"
    ]


def test_a_report_of_something_else_is_none() -> None:
    other = report_with(fingerprint={"short": "x", "whole": "ab" * 32})
    grounds = grounds_of(report=signed_report(other))
    assert refused(grounds)[0].startswith("the report is not of this configuration")
    none = grounds_of(report=signed_report(report_with(fingerprint=None)))
    assert "begins with none" in refused(none)[0]


def test_the_page_is_of_the_same_configuration() -> None:
    whole = fingerprint_of(grounds_of().plan).whole.encode()
    json_form = (source("r.json"), report_with())
    for page, wanted in (
        (b"<html>" + whole + b" " + b"0" * 64, []),
        (b"<html>" + whole, ["r.html does not show test-record.yaml as it is now"]),
        (b"%PDF-1.7 packed", []),
        (b"<html>", ["r.html does not hold the fingerprint of the report in JSON"]),
    ):
        report = read_signed_report([(source("r.html"), page), json_form])
        assert refused(grounds_of(report=report)) == wanted


@pytest.mark.parametrize("data", [b"<html>", b"{}", b"{", b'{"a":' * 99_999, b'{"findings": 3}'])
def test_no_report_is_reported(data: bytes) -> None:
    with pytest.raises(InputError, match=r"r\.json"):
        read_signed_report([(source("r.json"), data)])


def test_two_reports_are_one_too_many() -> None:
    with pytest.raises(InputError, match="more than one report"):
        read_signed_report([(source("a.json"), b"{}"), (source("b.json"), b"{}")])


@pytest.mark.parametrize("severity", ["Warning", "", "none", 1])
def test_a_finding_of_no_known_weight_is_not_a_report(severity: object) -> None:
    data = report_with(findings=[{**_row("info"), "severity": severity}])
    with pytest.raises(InputError, match=r"r\.json"):
        signed_report(data)


def test_a_place_out_of_all_numbers_is_not_a_report() -> None:
    data = report_with(findings=[{**_row("info"), "line": float("inf")}])
    with pytest.raises(InputError, match=r"r\.json"):
        signed_report(data)


def test_people_sign_a_page() -> None:
    alone = read_signed_report([(source("r.json"), report_with())])
    assert refused(grounds_of(report=alone)) == [
        "the files contain no page of the report, which people sign"
    ]


def test_the_report_shows_the_test_record_of_now() -> None:
    now = replace(source("test-record.yaml"), sha256="1" * 64)
    assert refused(grounds_of(test_record_source=now)) == [
        "r.json does not show test-record.yaml as it is now",
        "r.html does not show test-record.yaml as it is now",
    ]


@pytest.mark.parametrize("name", ["...", "\u200b", "-"])
def test_a_person_has_a_name(name: str) -> None:
    (found,) = refused(grounds_of(author=SignedBy(name=name, date="2026-11-21", competence="x1")))
    assert found == "the author has no name"


@pytest.mark.parametrize("name", ["A. Kaya\u200b", "A.\nKaya", "\u202eA. Kaya", "A.\x1b[31mKaya"])
def test_a_name_holds_nothing_unseen(name: str) -> None:
    (found,) = refused(grounds_of(author=SignedBy(name=name, date="2026-11-21", competence="x1")))
    assert found.startswith("the name of the author contains invisible characters")


def test_signing_needs_the_last_step() -> None:
    day = SignedBy(name="B. Kaya", date="2026-11-20", competence="x1")
    found = refused(grounds_of(verifier=day))
    assert len(found) == 6
    assert "done on 2026-11-21, after the day of the signatures, 2026-11-20" in found[0]


@pytest.mark.parametrize("by", ["  ", "\u200b", "\t"])
def test_spaces_sign_no_step(by: str) -> None:
    (found,) = refused(with_step(grounds_of(), StepKind.TRIGGER, by=by))
    assert found.endswith("open at the machine")


def test_the_reason_of_a_step_goes_before_that_of_all() -> None:
    each = [Reason(subject=s, reason=s, by="B. Kaya") for s in ("loss *", "loss io2", "loss io")]
    grounds = grounds_of(reasons=each)
    steps = tuple(
        replace(s, machine=AtMachine()) if s.kind is StepKind.LOSS else s
        for s in grounds.test_record.steps
    )
    record, refusals = sign_off(
        replace(grounds, test_record=replace(grounds.test_record, steps=steps))
    )
    assert record is not None, refusals
    assert [s.reason for s in record.steps_left_out] == ["loss io", "loss io2", "loss *"]


def test_two_reasons_for_one_are_one_too_many() -> None:
    twice = [Reason(subject="loss *", reason=r, by="B. Kaya") for r in "ab"]
    found = refused(with_step(grounds_of(reasons=twice), StepKind.LOSS, outcome=None))
    assert found == ["--justify loss * is there 2 times"]


def _row(severity: str) -> dict[str, object]:
    row = {"code": "FSN607", "severity": severity, "message": "says so", "file": "cells/a.yaml"}
    return {**row, "line": 7, "column": 3}


def _with_finding(severity: str, *reasons: Reason) -> Grounds:
    report = signed_report(report_with(findings=[_row(severity)]))
    return grounds_of(report=report, reasons=reasons)


@pytest.mark.shows("R14")
def test_an_error_cannot_be_justified() -> None:
    reason = Reason(subject="FSN607@a.yaml:7", reason="we know", by="B. Kaya")
    assert "FSN607 at cells/a.yaml:7:3: says so" in refused(_with_finding("error", reason))


@pytest.mark.parametrize("place", ["a.yaml:7", "a.yaml:7:3", "cells/a.yaml:7", "cells/a.yaml:7:3"])
def test_a_warning_is_let_pass_by_name(place: str) -> None:
    reason = Reason(subject=f"FSN607@{place}", reason="sheet read", by="C. Okoro")
    record, refusals = sign_off(_with_finding("warning", reason))
    assert refusals == ()
    assert record is not None
    (row,) = record.findings
    assert (row.code, row.place, row.message) == ("FSN607", "cells/a.yaml:7:3", "says so")
    assert (row.reason, row.by) == ("sheet read", "C. Okoro")
    assert record.justification("FSN607", "says so") is row
    assert record.justification("FSN607", "says more") is None


def test_a_warning_that_is_there_twice_is_let_pass_once() -> None:
    report = signed_report(report_with(findings=[_row("warning")] * 2))
    reason = Reason(subject="FSN607@a.yaml:7", reason="sheet read", by="C. Okoro")
    record, refusals = sign_off(grounds_of(report=report, reasons=(reason,)))
    assert record is not None, refusals
    assert [row.code for row in record.findings] == ["FSN607"]


@pytest.mark.parametrize("subject", ["FSN607@a.yaml:8", "FSN608@a.yaml:7", "FSN607", "FSN607@"])
def test_another_place_is_another_warning(subject: str) -> None:
    found = refused(_with_finding("warning", Reason(subject=subject, reason="x", by="Yi")))
    assert found == [
        "FSN607 at cells/a.yaml:7:3 is not justified: says so",
        f"--justify {subject}: no warning or open step has this name",
    ]


def test_a_report_with_something_against_it_is_not_signed() -> None:
    verdict = {"type": "verdict", "level": "error", "word": "no findings, but 1 verdict against it"}
    report = signed_report(report_with(verdict=verdict))
    assert refused(grounds_of(report=report)) == [
        "the report states: no findings, but 1 verdict against it"
    ]


def test_notes_need_no_person() -> None:
    assert refused(_with_finding("info")) == []


@pytest.mark.shows("R12", "R14")
@pytest.mark.parametrize("rows", [[_row("info")], [_row("warning")]], ids=["note", "once"])
def test_a_report_that_was_thinned_out_is_seen(rows: list[dict[str, object]]) -> None:
    found = Diagnostic(code="FSN607", message="says so", span=Span("cells/a.yaml", 7, 3))
    reason = Reason(subject="FSN607@a.yaml:7", reason="known", by="B. Kaya")
    report = signed_report(report_with(findings=rows))
    told = refused(grounds_of(diagnostics=[found, found], report=report, reasons=[reason]))
    assert "FSN607 at cells/a.yaml:7:3 is not in the report: says so" in told


def test_limits_of_the_report_are_stated() -> None:
    late = Diagnostic(code="FSN607", message="since yesterday", span=Span("a.yaml", 7, 3))
    reason = Reason(subject="FSN607@a.yaml:7", reason="known", by="B. Kaya")
    found = refused(grounds_of(diagnostics=[late], reasons=[reason]))
    assert found[0] == "FSN607 at a.yaml:7:3 is not in the report: since yesterday"


@pytest.mark.parametrize("kind", [StepKind.START_UP, StepKind.TRIGGER, StepKind.LOSS])
@pytest.mark.parametrize(
    "machine",
    [{"outcome": None}, {"outcome": StepOutcome.NOT_RUN}, {"by": ""}, {"date": ""}],
    ids=str,
)
def test_a_step_that_was_not_done_is_open(kind: StepKind, machine: dict[str, object]) -> None:
    (found,) = refused(with_step(grounds_of(), kind, **machine))
    assert found.endswith("open at the machine")


def test_only_a_loss_may_be_left_out() -> None:
    ids = {StepKind.TRIGGER: "trigger estop", StepKind.START_UP: "start-up logic-io"}
    for kind in (StepKind.LOSS, *ids):
        word = "loss" if kind is StepKind.LOSS else ids[kind].partition(" ")[0]
        reasons = [Reason(subject=f"{word} *", reason="no plug", by="B. Kaya")]
        grounds = with_step(grounds_of(reasons=reasons), kind, outcome=None)
        record, refusals = sign_off(grounds)
        if kind is StepKind.LOSS:
            assert record is not None
            (row,) = record.steps_left_out
            assert (row.step, row.reason, row.by) == ("loss io", "no plug", "B. Kaya")
        else:
            assert refusals[0].what == f"step {ids[kind]} at : open at the machine"


@pytest.mark.shows("R14")
def test_a_failed_step_cannot_be_justified() -> None:
    for kind in (StepKind.TRIGGER, StepKind.LOSS):
        name = "loss *" if kind is StepKind.LOSS else "trigger estop"
        reasons = [Reason(subject=name, reason="never mind", by="B. Kaya")]
        grounds = with_step(grounds_of(reasons=reasons), kind, outcome=StepOutcome.NOT_AS_EXPECTED)
        assert "not as expected at the machine" in refused(grounds)[0]


@pytest.mark.shows("R13")
def test_an_emulated_failure_counts_and_an_emulated_pass_does_not() -> None:
    grounds = grounds_of()
    bad, good = (
        StepResult(outcome=o) for o in (StepOutcome.NOT_AS_EXPECTED, StepOutcome.AS_EXPECTED)
    )
    for column in ("emulated", "live"):
        steps = tuple(replace(s, **{column: bad}) for s in grounds.test_record.steps)
        failing = replace(grounds, test_record=replace(grounds.test_record, steps=steps))
        assert len(refused(failing)) == len(steps)
        steps = tuple(
            replace(s, machine=AtMachine(), **{column: good}) for s in grounds.test_record.steps
        )
        alone = replace(grounds, test_record=replace(grounds.test_record, steps=steps))
        assert "step trigger estop at : open at the machine" in refused(alone)


def test_a_reaction_is_measured_and_within_its_limit() -> None:
    limit = next(s.limit_ms for s in grounds_of().test_record.steps if s.kind is StepKind.TRIGGER)
    assert limit is not None
    assert refused(with_step(grounds_of(), StepKind.TRIGGER, measured_ms=limit)) == []
    (late,) = refused(with_step(grounds_of(), StepKind.TRIGGER, measured_ms=limit + 0.1))
    assert "300.1 ms at the machine, 300 ms allowed" in late
    (none,) = refused(with_step(grounds_of(), StepKind.TRIGGER, measured_ms=None))
    assert "no time measured" in none


@pytest.mark.shows("R14")
@pytest.mark.parametrize(
    ("measured", "doubt"),
    [
        (2.0, None),
        (1.9, "1.9 ms at the machine; the bus alone takes two cycles, 2 ms"),
        (0, "0 ms at the machine; the bus alone takes two cycles, 2 ms"),
        (42.0, None),
        (42.1, "42.1 ms at the machine; by the stated times it is 42 ms at most without a fault"),
    ],
)
def test_a_time_that_is_hard_to_believe_needs_a_reason(measured: float, doubt: str | None) -> None:
    grounds = with_step(
        grounds_of(longest_ms={"estop": 42.0, "another": 1.0}),
        StepKind.TRIGGER,
        measured_ms=measured,
    )
    assert refused(grounds) == ([] if doubt is None else [f"step trigger estop at : {doubt}"])
    reason = Reason(subject="trigger estop", reason="slow camera", by="B. Kaya")
    record, refusals = sign_off(replace(grounds, reasons=[reason]))
    if doubt is not None:
        assert record is not None, refusals
        assert [s.step for s in record.steps_left_out] == ["trigger estop"]


def test_absent_parts_are_not_tested() -> None:
    grounds = with_step(grounds_of(), StepKind.TRIGGER, date="2026-11-20")
    early = (
        "step trigger estop at : done on 2026-11-20, before this configuration existed: 2026-11-21"
    )
    assert refused(grounds) == [early]
    assert refused(with_step(grounds, StepKind.TRIGGER, date="2026-11-20", measured_ms=0)) == [
        f"{early}; 0 ms at the machine; the bus alone takes two cycles, 2 ms"
    ]
    reason = Reason(subject="trigger estop", reason="the same tables, renamed", by="B. Kaya")
    record, refusals = sign_off(replace(grounds, reasons=[reason]))
    assert record is not None, refusals
    assert [s.step for s in record.steps_left_out] == ["trigger estop"]
    unknown = replace(grounds_of(), test_record=replace(grounds_of().test_record, made=""))
    assert refused(unknown) == [
        "test-record.yaml does not say since when there is this configuration"
    ]


def with_logic(text: str) -> Grounds:
    """Return the grounds with something else for firmware and project of the MainInstance."""
    grounds = grounds_of()
    *others, logic = grounds.test_record.devices
    assert (logic.subdevice, logic.safety_project_crc) == ("logic", "0x8F1C")
    logic = replace(logic, firmware=text, safety_project_crc=text)
    return replace(grounds, test_record=replace(grounds.test_record, devices=(*others, logic)))


@pytest.mark.parametrize(
    "text", ["", " ", "-", "?", "0", "0x0000", "n/a", "Not applicable.", "TBD", "xxx", "\u200b"]
)
def test_an_unread_device_needs_a_reason(text: str) -> None:
    grounds = with_logic(text)
    assert refused(grounds) == [
        "firmware logic at : it was not read at the machine",
        "safety_project_crc logic at : it was not read at the machine",
    ]
    reasons = [
        Reason(subject="firmware *", reason="no display", by="B. Kaya"),
        Reason(subject="safety_project_crc logic", reason="fixed function", by="B. Kaya"),
    ]
    record, refusals = sign_off(replace(grounds, reasons=reasons))
    assert record is not None, refusals
    assert [(s.step, s.reason) for s in record.steps_left_out] == [
        ("firmware logic", "no display"),
        ("safety_project_crc logic", "fixed function"),
    ]


@pytest.mark.parametrize("text", ["03", "1.0", "not applicable: fixed function", "0x0001"])
def test_an_answer_is_taken(text: str) -> None:
    assert refused(with_logic(text)) == []


def test_a_report_without_the_machine_needs_a_reason() -> None:
    grounds = grounds_of(report=signed_report(report_with(of_machine=False)))
    assert refused(grounds) == ["the report has no evidence of the machine"]
    reason = Reason(subject="bus evidence", reason="no access to the bus", by="B. Kaya")
    record, refusals = sign_off(replace(grounds, reasons=[reason]))
    assert record is not None, refusals
    assert [s.step for s in record.steps_left_out] == ["bus evidence"]


def test_a_doubtful_time_does_not_close_an_open_step() -> None:
    grounds = with_step(grounds_of(), StepKind.TRIGGER, measured_ms=0, outcome=None)
    reason = Reason(subject="trigger estop", reason="slow camera", by="B. Kaya")
    assert "step trigger estop at : open at the machine" in refused(
        replace(grounds, reasons=[reason])
    )


def test_one_letter_is_not_a_person() -> None:
    grounds = with_step(grounds_of(), StepKind.TRIGGER, by="A")
    grounds = replace(
        grounds,
        author=SignedBy(name="A.", date=DAY),
        reasons=[Reason(subject="loss *", reason="soldered in", by="B")],
    )
    assert [text for text in refused(grounds) if text.endswith("not a person")] == [
        "the author is 'A.': that is not a person",
        "--justify loss * is by 'B': that is not a person",
        "step trigger estop at : done by 'A', which is not a person",
    ]


@pytest.mark.shows("R14")
def test_the_test_record_is_whole_and_of_this_configuration() -> None:
    grounds = grounds_of()
    wrong = [
        Diagnostic(code="FSN161", message="a step is missing", span=Span("p.yaml", 1, 1), hint="x"),
        Diagnostic(code="FSN160", message="not signed", span=Span("p.yaml", 9, 1)),
    ]
    found = refused(replace(grounds, test_record_findings=wrong))
    assert found == ["FSN161 at p.yaml:1:1: a step is missing"]
    other = replace(grounds.test_record, fingerprint="ab" * 32, steps=())
    assert refused(replace(grounds, test_record=other)) == [
        "test-record.yaml is the test record of another configuration"
    ]
    found = refused(replace(grounds, test_record=other, test_record_findings=wrong))
    assert found == ["FSN161 at p.yaml:1:1: a step is missing"]


def test_a_change_is_explained_and_history_is_kept(tmp_path: Path) -> None:
    before = record_of()
    text = TIMED.read_text("utf-8").replace("devices/", f"{BASE}/devices/")
    path = tmp_path / "timed.yaml"
    path.write_text(text.replace("connection_id: 11", "connection_id: 12"), "utf-8")
    old = source("acceptance.yaml")
    now = grounds_of(path, before=before, before_source=old, again=["loss io2"])
    (found,) = refused(now)
    assert "the change is not stated" in found
    first = Intervention(what="new drive", by="C. Okoro", date="2026-11-22")
    record, _ = sign_off(replace(now, interventions=[first]))
    assert record is not None
    assert record.replaces is not None
    assert (record.replaces.source, record.replaces.whole) == (old, before.whole)
    again, _ = sign_off(grounds_of(path, before=record, before_source=old))
    assert again is not None  # the same configuration needs no word
    assert again.interventions == (first,)


def test_steps_that_a_change_does_not_touch_may_rest_on_the_record_before() -> None:
    reasons = [Reason(subject="trigger estop", reason="not touched", by="B. Kaya")]
    more = {"before": record_of(), "before_source": source("a.yaml"), "reasons": reasons}
    untouched = grounds_of(again=["start-up logic-io"], **more)
    record, _ = sign_off(with_step(untouched, StepKind.TRIGGER, outcome=None))
    assert record is not None
    assert "trigger estop" in [s.step for s in record.steps_left_out]
    touched = grounds_of(again=["trigger estop"], **more)
    assert "open at the machine" in refused(with_step(touched, StepKind.TRIGGER, outcome=None))[0]
