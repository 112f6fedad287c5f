"""What reports, pages and pictures say where there is nothing, little, or something rare."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as Facts
from typing import Any

import pytest
from incident.rig import read
from live.watched_master import WatchedMaster
from networks import example, write_big_network
from report.made import TIMED, inputs_of
from scans import scan_of
from test_record.filled import DONE, fresh_record, timed

from fsoe_net.campaign.trials import EXHAUSTIVE
from fsoe_net.capture.lua import lua_dissector
from fsoe_net.capture.names import Naming
from fsoe_net.compare.changed_subdevices import changed_subdevices
from fsoe_net.core.snapshot import Histogram
from fsoe_net.document.model import (
    Paragraph,
    Picture,
    Table,
)
from fsoe_net.document.write_html import _section, document_html
from fsoe_net.document.write_markdown import _table
from fsoe_net.document.write_terminal import document_text
from fsoe_net.errors import InputError
from fsoe_net.incident.incident_facts import facts_of
from fsoe_net.incident.incident_window import Wrong, _wrong
from fsoe_net.live.control_values import StandbyStatus
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.safety import SafetyFunction
from fsoe_net.model.test_record import StepOutcome
from fsoe_net.plan.compile import compile_plan
from fsoe_net.report import campaign, cycle_times
from fsoe_net.report.compose import compose_report
from fsoe_net.report.evidence import ask_live, longest_round_trips, read_evidence
from fsoe_net.report.incident_document import incident_document
from fsoe_net.report.model import ReportSection
from fsoe_net.report.section_evidence import bus_evidence
from fsoe_net.report.steps_to_repeat import _functions_over
from fsoe_net.report.svg import _box, _byte_row, _free_line
from fsoe_net.report.test_record_document import render_test_record

# -- incidents -------------------------------------------------------------------------------------

NOTHING = "Nothing wrong is seen in what was recorded."
NO_CAUSE = (
    "No known cause fits the evidence well, so none is named. Keep this file; look at the frames "
    "and events below, and at the diagnosis of the devices."
)


@pytest.mark.parametrize(("kind", "nothing"), [("request", NOTHING), ("left_data", NO_CAUSE)])
def test_an_incident_without_a_cause(kind: str, nothing: str, tmp_path: Path):
    path = tmp_path / "x.fsnincident"
    head = {"incident": 1, "trigger": {"kind": kind, "cycle": 0, "now_ns": 1, "text": ""}}
    path.write_text(json.dumps(head) + '\n{"end":true,"cycles":0}\n', "utf-8")
    facts = facts_of(read(path))
    assert facts.nothing == nothing
    assert facts.remarks[-1] == "the file holds no layout: the frames cannot be shown"
    document = incident_document(facts, "0")
    assert document_text(document, width=None).splitlines()[:7] == [
        facts.title,
        "No cause is named",
        "",
        facts.sentence,
        "bus unknown · plan without a name",
        *(f"note: {remark}" for remark in facts.remarks),
    ]
    assert [s.title for s in document.sections] == ["Likely cause", "What this page is not"]
    assert f"<h2>Likely cause</h2><p>{nothing}</p></section>" in document_html(document)


def test_errors_in_a_slice_of_time():
    words = [_wrong(*row, 1000) for row in ((1, 1, 0), (1, 0, 0), (0, 0, 1001), (0, 0, 1000))]
    assert words == [Wrong.LOST, Wrong.SHORT, Wrong.LATE, Wrong.NOTHING]


# -- campaigns -------------------------------------------------------------------------------------


def row(**changes: Any) -> Any:
    facts = {
        "name": "loss", "collisions": 0, "exposed_collisions": 0, "expected": 0.25, "tolerated": 0,
        "most_tolerated": 0, "rate_ok": True, "wrongly_accepted": 0, "wrong_reactions": 0,
        "interval": None, "injected": 9, "detected": 9, "latency_sum_ns": 0, "latency_max_ns": 0,
        "failed": 0, "latency_max_share": 0,
    }  # fmt: skip
    return Facts(**facts | changes)


@pytest.mark.parametrize(
    ("rows", "interrupted", "verdict"),
    [
        ([row()], False, "passed: nothing wrongly accepted, every reaction right"),
        ([row()], True, "incomplete: nothing wrongly accepted so far"),
        (
            [row(wrongly_accepted=2, wrong_reactions=1), row(tolerated=3), row(rate_ok=False)],
            True,
            "FAILED: 2 wrongly accepted, 1 wrong reactions, more tolerated than the catalogue "
            "allows, collisions are not as many as the CRC allows",
        ),
    ],
)
def test_the_verdict_of_a_campaign(rows: list[Any], interrupted: bool, verdict: str):
    result: Any = Facts(classes=rows, interrupted=interrupted)
    assert campaign._verdict(result).word == verdict


def test_collisions_of_a_campaign():
    assert campaign._rate_note(row(name=EXHAUSTIVE, collisions=2)) == (
        f"{EXHAUSTIVE}: 2 collisions where the code allows none"
    )
    shown = campaign._cells(row(collisions=5, exposed_collisions=3, interval=(1, 4)))
    assert {"5 (3 of them counted)", "1..4"} <= set(shown)


# -- times -----------------------------------------------------------------------------------------


def test_times_that_were_not_measured():
    empty = Histogram(
        count=0, min_ns=0, sum_ns=0, p50_ns=0, p99_ns=0, p999_ns=0, max_ns=0, buckets=()
    )
    statistics: Any = Facts(histograms={"work": empty})
    assert cycle_times.times_table(statistics).rows == ()
    assert cycle_times.timing_bars(empty) == []


@pytest.mark.parametrize(
    ("ns", "text"),
    [(999, "999 ns"), (1_500, "1.5 us"), (2_000_000, "2 ms"), (3_000_000_000, "3 s")],
)
def test_a_time_for_people(ns: int, text: str):
    assert cycle_times._time(ns) == text


# -- pages -----------------------------------------------------------------------------------------


def test_small_pictures_are_next_to_each_other():
    small, wide = (Picture(title=t, words=t, svg=f"<svg>{t}</svg>", wide=t == "w") for t in "sw")
    shown = _section(1, ReportSection(key="k", title="T", parts=(small, wide, small), points=()))
    assert shown.count('<div class="pictures">') == 2
    assert shown.index("<svg>s</svg>") < shown.index("<svg>w</svg>")


def test_a_table_without_rows_is_none():
    assert _table(Table(name="t", columns=(), rows=())) == ["none", ""]


def test_a_test_record_with_failed_and_disputed_steps():
    test_record, _ = fresh_record(timed())
    first, second, *rest = test_record.steps
    failed = replace(DONE, outcome=StepOutcome.NOT_AS_EXPECTED, remark="it <stayed> on")
    steps = (replace(first, machine=failed), replace(second, machine=DONE), *rest)
    page = document_html(render_test_record(replace(test_record, steps=steps), version="0"))
    assert "<p><b>4 of 6 steps open at the machine, 1 not as expected.</b></p>" in page
    assert '<span class="muted">it &lt;stayed&gt; on</span>' in page


# -- what a change touches -------------------------------------------------------------------------


def test_another_cycle_touches_all():
    plan = compile_plan(example("estop"))
    assert changed_subdevices(plan, plan) == frozenset()
    assert changed_subdevices(plan, replace(plan, cycle_ns=plan.cycle_ns + 1)) is None
    plan = compile_plan(example("two-buses"))
    cell, drives = plan.buses
    slower = replace(plan, buses=(cell, drives._replace(cycle_ns=4_000_000)))
    assert changed_subdevices(plan, slower) is None


def test_a_group_elsewhere_touches_all_and_a_new_bus_the_subdevice_on_it():
    plan = compile_plan(example("tool-exchange"))
    first, second = plan.groups
    moved = replace(plan, groups=(first._replace(place="other"), second))
    assert changed_subdevices(plan, moved) is None
    plan = compile_plan(example("two-buses"))
    cell, drives = plan.buses
    longer = cell._replace(subdevice_count=4)
    shorter = drives._replace(first_subdevice=4, subdevice_count=1)
    assert changed_subdevices(plan, replace(plan, buses=(longer, shorter))) == {"drive_1"}


def test_a_function_that_names_no_subdevice_is_always_touched():
    resolution = timed()
    (function,) = resolution.network.safety_functions

    def over(name: str, *functions: SafetyFunction) -> set[str]:
        network = replace(resolution.network, safety_functions=functions)
        return _functions_over({name}, replace(resolution, network=network))

    nameless = replace(function, name="none", elements=())
    assert over("io", function, nameless) == {"estop", "none"}
    assert over("nobody", function, nameless) == {"none"}


# -- evidence --------------------------------------------------------------------------------------


def points(**more: Any) -> list[str]:
    return [p.text for p in bus_evidence(inputs_of(TIMED, **more)).points]


@pytest.mark.shows("R13")
def test_a_running_emulated_bus_is_not_evidence(tmp_path_factory: pytest.TempPathFactory):
    master = WatchedMaster(tmp_path_factory.mktemp("m") / "s")
    try:
        live = ask_live(str(master.path))
    finally:
        master.close()
    inputs = inputs_of(TIMED)
    assert inputs.plan is not None
    own = hashlib.sha256(inputs.plan.to_bytes()).hexdigest()
    status = replace(live.status, backend="emulated", plan_sha256=own, accepted=True)
    emulated = replace(live, status=status)
    assert points(live=emulated) == [
        "no evidence of the machine: give --evidence scan.json or --interface IF"
    ]
    assert longest_round_trips((), emulated) == {}
    (seen,) = longest_round_trips((), live).values()
    assert seen > 0
    assert points(live=live) == [
        "the running fsn-master has another plan",
        "the running fsn-master holds no accepted plan",
        "identities and mappings were not read back: a scan.json has them",
    ]
    assert points(live=live, plan=None)[0] == "the running fsn-master has another plan"


@pytest.mark.parametrize("held", [False, True])
def test_a_standby_is_named(held: bool, tmp_path_factory: pytest.TempPathFactory):
    master = WatchedMaster(tmp_path_factory.mktemp("m") / "s")
    try:
        live = ask_live(str(master.path))
    finally:
        master.close()
    status = replace(live.status, standby=StandbyStatus(pid=4711, held=held))
    parts = bus_evidence(inputs_of(TIMED, live=replace(live, status=status))).parts
    said = str(next(p for p in parts if isinstance(p, Paragraph)))
    follows = "; a standby follows, process 4711"
    assert f"{follows}{', held: it takes nothing over' if held else ''}'" in said


def test_a_scan_of_devices_in_error_without_fsoe(tmp_path: Path):
    document = scan_of(example("estop"))
    for sub in document["subdevices"]:
        sub |= {"fsoe": None, "sms": [], "al_status": 0x12, "problems": ["SII: not read"]}
    path = tmp_path / "scan.json"
    path.write_text(json.dumps(document), "utf-8")
    block = bus_evidence(inputs_of(TIMED, evidence=(read_evidence(str(path)),)))
    tables = [p for p in block.parts if isinstance(p, Table)]
    assert [t.name for t in tables] == ["evidence files", f"scan {path}"]
    state = tables[1].rows[0][-1]
    assert [getattr(i, "word", None) or i.text for i in state] == [  # type: ignore[union-attr]
        "PREOP", "AL error flag", "AL status code 0x0000", "SII: not read",
    ]  # fmt: skip
    path.write_text(json.dumps(document | {"scan": 7}), "utf-8")
    with pytest.raises(InputError) as refused:
        read_evidence(str(path))
    assert refused.value.message == f"{path} is a damaged scan"


# -- names -----------------------------------------------------------------------------------------


def without_ids(resolution: Resolution) -> Resolution:
    rows = tuple(
        replace(c, facts=None if c.facts is None else replace(c.facts, connection_id=None))
        for c in resolution.connections
    )
    return replace(resolution, connections=rows)


def test_a_connection_whose_id_no_one_states():
    resolution = without_ids(example("estop"))
    text = lua_dissector(resolution, compile_plan(resolution))
    connection = text.partition("local CONNECTIONS = {")[2].partition("signals")[0]
    assert "id = " not in connection
    naming = Naming(resolution)
    (only,) = naming.connections
    assert naming.find(77, only.frame_bytes) is only
    assert naming.find(77, (31, 31)) is None


def test_frames_that_have_no_place_in_a_plan():
    """A plan of other SubDevices: nothing is watched at addresses that are not theirs."""
    text = lua_dissector(example("estop"), compile_plan(example("el6910")))
    assert "places = {}" in text
    assert "address = " not in text.partition("local CONNECTIONS = {")[2].partition("\n\n")[0]


def test_subdevices_without_a_copy_are_left_out_of_a_large_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("fsoe_net.report.section_network._MOST_PLAIN", 20)
    document = compose_report(inputs_of(write_big_network(tmp_path, 33, 20)))
    parts = next(b.parts for b in document.sections if b.key == "architecture")
    (picture,) = [p for p in parts if isinstance(p, Picture)]
    assert ">22 SubDevices without a copy</text>" in picture.svg
    table = next(p for p in parts if isinstance(p, Table) and p.name == "subdevices")
    assert len(table.rows) == 11
    assert table.remark.endswith(" 22 SubDevices without FSoE are not listed.")


def test_a_connection_of_a_box_is_shortened_beyond_28_letters():
    plan = compile_plan(example("el6910"))

    def shown(line: str) -> str:
        return _box(plan, 0, (0, 0), False, False, line)

    assert f">{'x' * 28}</text>" in shown("x" * 28)
    assert f">{'x' * 27}…</text>" in shown("x" * 29)


def test_names_in_a_picture_may_touch_and_not_overlap():
    assert _free_line(10, 90, 8, [(0, 90, 12)]) == 90
    assert _free_line(9.9, 90, 8, [(0, 90, 12)]) != 90


@pytest.mark.parametrize(("byte", "first", "last"), [(3, 0, 1), (4, 1, 1), (57, 1, 1), (58, 1, 0)])
def test_the_ends_of_a_row_of_bytes_are_named_where_there_is_room(byte: int, first: int, last: int):
    plan = compile_plan(example("estop"))
    plan = replace(plan, sync_managers=(plan.sync_managers[0]._replace(bits=8 * 64),))
    shown = _byte_row(plan, 0, byte, 1, "from", 0, "red")
    assert (shown.count(">0</text>"), shown.count(">63</text>")) == (first, last)
    assert shown.count(f">{byte}</text>") == 1
