"""Whole documents: the report of one network word by word, of all others each figure.

`report.txt` is the report of one network with everything that it can be given. Run this file to
write it again, and read the difference: ``PYTHONPATH=tests python tests/report/test_whole.py``. Of
the other documents `changed.txt` has a digest of the figures in their order (`tests/changed.py`).
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from acceptance.signed import DAY, filled, record_of, source
from changed import compare as compare_results
from changed import figures
from described import bus
from incident.rig import Rig, network, read
from incident.seeds import NOTHING
from incident.seeds_bus import late_replies, watchdog_tight
from intervention_log.intervention_logs import a_log, chained, hash_of, written
from live.watched_master import WatchedMaster
from networks import EXAMPLES, example, resolved, write_big_network
from report.lines import told
from report.made import BASE, TIMED, inputs_of, with_mistakes
from report.made_blocks import LOCAL, SPARSE
from scans import scan_of
from test_record.filled import fresh_record, timed

from fsoe_net.campaign.collision_proof import Collision
from fsoe_net.campaign.trials import EXHAUSTIVE, CampaignConfig, ClassResult, Failure, Shown
from fsoe_net.compare.diff import Difference, compare
from fsoe_net.compare.diff_types import Change, ChangeArea, ChangeKind
from fsoe_net.compare.sides import (
    side_of_description,
    side_of_network,
    side_of_plan,
)
from fsoe_net.core.snapshot import Histogram
from fsoe_net.diag.diagnostic import Diagnostic, Span
from fsoe_net.formats.own.library import builtin_library
from fsoe_net.formats.own.scenario import load_scenario
from fsoe_net.incident.evidence_cycles import SlowCycle
from fsoe_net.incident.incident_facts import facts_json, facts_of
from fsoe_net.intervention_log.chain import LogChain, LogFilter
from fsoe_net.intervention_log.document import (
    check_json,
    log_check_document,
    log_document,
    selection_json,
)
from fsoe_net.intervention_log.files import log_files, read_log, select_entries
from fsoe_net.live.result import ExpectationResult
from fsoe_net.model.acceptance import Intervention, JustifiedFinding, JustifiedStep
from fsoe_net.model.test_record import (
    AtMachine,
    StepKind,
    StepOutcome,
    StepResult,
    TestRecord,
    TestStep,
)
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import fingerprint_of
from fsoe_net.report.budget import budget_document, budget_json, budget_picture
from fsoe_net.report.campaign import campaign_document, to_json
from fsoe_net.report.compose import compose_report
from fsoe_net.report.cycle_times import times_table, timing_bars, timing_csv, timing_picture
from fsoe_net.report.device_page import device_json, device_list, device_text
from fsoe_net.report.evidence import ask_live, read_evidence
from fsoe_net.report.incident_document import incident_document
from fsoe_net.report.inputs import Against, GivenPlan, GivenRecord, Tried
from fsoe_net.report.section_record import change_log
from fsoe_net.report.self_test_result import PART_NAMES, read_self_test, self_test_parts
from fsoe_net.report.svg import copy_picture, topology_picture
from fsoe_net.report.test_record_document import render_test_record
from fsoe_net.simulate.campaign import campaign_links, run_campaign
from fsoe_net.simulate.session import Session, counted_session_ids, run_virtual
from fsoe_net.version import __version__

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
REPORT = HERE / "report.txt"
VERSION = re.compile(r'(fsoe-net |version: |"version": ")\d+\.\d+\.\d+')


def report(path: Path, *keys: str, **more: Any) -> str:
    """Return a report, of its blocks those with the keys if there are any."""
    document = compose_report(inputs_of(path, **more))
    kept = tuple(s for s in document.sections if not keys or s.key in keys)
    return told(replace(document, sections=kept))


def changed(**more: Any) -> str:
    """Return the report of `TIMED`, of its blocks those that say something else than without."""
    plain = compose_report(inputs_of(TIMED)).sections
    document = compose_report(inputs_of(TIMED, **more))
    return told(replace(document, sections=tuple(s for s in document.sections if s not in plain)))


def sparse(folder: Path) -> str:
    (folder / "devices").symlink_to(BASE / "devices")
    text = TIMED.read_text("utf-8") + LOCAL
    for find, put in (*SPARSE, ("cycle_us: 1000\n", "")):
        assert find in text
        text = text.replace(find, put)
    path = folder / "sparse.yaml"
    path.write_text(text, "utf-8")
    return report(path, plan=None, fingerprint=None)


def nothing_read(_: Path) -> str:
    found = [Diagnostic(code="FSN101", span=Span("n.yaml"), message="no such file")]
    given = GivenPlan(source=source("p.fsnplan"), plan=compile_plan(timed()))
    return changed(resolution=None, plan=None, fingerprint=None, budget=None,
                   diagnostics=found, scenario="s.yaml",
                   given=given)  # fmt: skip


def mistakes(folder: Path) -> str:
    return report(with_mistakes(folder), fingerprint=None)


def many_findings(_: Path) -> str:
    """One more than the first page lists one by one, of three levels."""
    codes = ("FSN202", "FSN303", "FSN307")
    found = [
        Diagnostic(code=codes[n % 3], span=Span("n.yaml", n, 1), message=f"no. {n}")
        for n in range(1, 16)
    ]
    return told(*compose_report(inputs_of(TIMED, diagnostics=found)).lead)


def with_everything(folder: Path) -> str:
    """Everything that speaks for a network, and a change since the record before."""
    warned = Diagnostic(code="FSN303", span=Span("n.yaml", 3, 1), message="odd address")
    inputs = inputs_of(TIMED, diagnostics=(warned,))
    resolution, plan = inputs.resolution, inputs.plan
    assert resolution is not None
    assert plan is not None
    record = replace(
        record_of(),
        findings=(JustifiedFinding(code=warned.code, place="n.yaml:3:1", message=warned.message,
                                   reason="asked", by="B. Kaya"),),
        steps_left_out=(JustifiedStep(step="loss io", reason="no access", by="A. Meier"),),
        interventions=(Intervention(what="new drive", by="A. Meier", date=DAY),),
    )  # fmt: skip
    scan = folder / "scan.json"
    scan.write_text(json.dumps(scan_of(resolution)), "utf-8")
    before = replace(plan, cycle_ns=2 * plan.cycle_ns)
    difference = compare(side_of_plan(before, "old"), side_of_network(resolution, "now"))
    test_record, _ = fresh_record(resolution)
    return report(
        TIMED,
        diagnostics=(warned,),
        references=(source("bus.eni.xml"),),
        evidence=(read_evidence(str(scan)),),
        given=GivenPlan(source=source("p.fsnplan"), plan=plan),
        against=Against(source=source("old.fsnplan"), difference=difference,
                        again=("loss io", "loss io2"), fingerprint=fingerprint_of(before)),
        tried=Tried(source=source("test-record.yaml"), test_record=filled(test_record)),
        accepted=GivenRecord(source=source("record.yaml"), record=record, fits=True),
    )  # fmt: skip


def of_another_configuration(folder: Path) -> str:
    """Runs in real time, a running bus, a record and a test record, all of another plan."""
    done = emulated_run("estop")
    row = json.loads(json.dumps(done.to_json("0")))
    row["bus"] = {"backend": "soem", "interface": "eth1"}
    row |= {"result": "fail", "expectations": []}
    row["connections"][0]["observed"]["watchdog_ms"] = 4000
    row["connections"][0] |= {
        "resets": 2,
        "last_reset_text": "watchdog",
        "differs": ["watchdog_ms"],
    }
    row["statistics"]["period"] = histogram().to_json()
    unheld = ExpectationResult(place="s.yaml:9", text="io off", held=False, seen="on")
    run, emulated = folder / "run.json", folder / "emulated.json"
    run.write_text(json.dumps(row), "utf-8")
    row["bus"]["backend"] = "emulated"
    emulated.write_text(json.dumps(row), "utf-8")
    incident = folder / "x.fsnincident"
    incident.write_text(made_incident(folder).read_text("utf-8").replace(__version__, "0"), "utf-8")
    master = WatchedMaster(folder / "s")
    try:
        live = ask_live(str(master.path))
    finally:
        master.close()
    steps = (
        TestStep(id="1", kind=StepKind.TRIGGER, subject="", what="press", expected="off",
                     limit_ms=150.0, limit_source="RA",
                     machine=AtMachine(outcome=StepOutcome.NOT_AS_EXPECTED, measured_ms=180.5,
                                       by="A. B.", date="1 May")),
        TestStep(id="2", kind=StepKind.LOSS, subject="", what="pull", expected="off",
                     emulated=StepResult(outcome=StepOutcome.AS_EXPECTED, measured_ms=61.0),
                     live=StepResult(outcome=StepOutcome.NOT_AS_EXPECTED, measured_ms=70.25),
                     machine=AtMachine(outcome=StepOutcome.AS_EXPECTED, by="C", date="2 May")),
        TestStep(id="3", kind=StepKind.FAULT, subject="", what="flip bits", expected="refused"),
        TestStep(id="4", kind=StepKind.START_UP, subject="", what="wait", expected="on"),
    )  # fmt: skip
    own = compile_plan(timed())
    found = fingerprint_of(own)
    other = replace(
        found, sections={**found.sections, "cycle": "0", "devices": "0"}, whole="0" * 64
    )
    return changed(
        evidence=tuple(read_evidence(str(f)) for f in (run, emulated, incident)),
        live=live,
        run=replace(done, verdicts=(*done.verdicts, unheld), passed=False),
        given=GivenPlan(source=source("p.fsnplan"), plan=compile_plan(example("estop"))),
        against=Against(source=source("same.fsnplan"),
                        difference=compare(side_of_plan(own, "a"), side_of_plan(own, "b")),
                        fingerprint=other),
        tried=Tried(source=source("test-record.yaml"),
                    test_record=TestRecord(network="", plan_sha256="", steps=steps),
                    notes=("3: not finished",), fits=False),
        accepted=GivenRecord(source=source("record.yaml"), record=record_of(), fits=False),
    )  # fmt: skip


def emulated_run(name: str) -> Any:
    resolution = example(name)
    scenario, found = load_scenario(str(EXAMPLES / name / "scenario.yaml"))
    assert scenario is not None, found
    session = Session(resolution, compile_plan(resolution).to_bytes(), scenario,
                      session_ids=counted_session_ids())  # fmt: skip
    return run_virtual(session, session.duration_ns)


def made_incident(folder: Path) -> Path:
    folder = folder / "made"
    folder.mkdir()
    rig = Rig(network("estop", folder), folder, steps="  - {at_ms: 300, break: ek1914}\n")
    rig.run(1_500)
    return rig.end()


def incident(folder: Path) -> str:
    facts = facts_of(read(made_incident(folder)))
    return told(incident_document(facts, "0"), facts_json(facts, "0"))


def incidents(folder: Path) -> str:
    """Late replies with times as measured and no watchdog stated; others without a cause."""
    late = read(late_replies(folder))
    assert late.head.counters is not None
    counters = replace(late.head.counters, period=histogram(), work=histogram())
    planned = {n: replace(p, watchdog_ms=None, address=None) for n, p in late.planned.items()}
    trigger = replace(late.head.trigger, now_ns=late.bus.first_ns + 1_000_000)
    late = replace(late, head=replace(late.head, counters=counters), planned=planned)
    moved = replace(late, head=replace(late.head, trigger=trigger), links={})
    slow = SlowCycle(extra_ns=2_500_000, cycle=7, now_ns=late.moment_ns - 1_500_000,
                     late_ns=0, work_ns=40_000, round_ns=90_500)  # fmt: skip
    late = replace(late, bus=replace(late.bus, worst=(slow,)))
    pages = [incident_document(facts_of(e), "0") for e in (late, moved)]
    names = ("refused for an unknown reason", "a SubDevice is missing, none is named")
    for n, make in enumerate((watchdog_tight, *(NOTHING[name] for name in names))):
        place = folder / str(n)
        place.mkdir()
        pages.append(incident_document(facts_of(read(make(place))), "0"))
    return told(*pages)


def budget(path: Path) -> str:
    inputs = inputs_of(path)
    assert inputs.budget is not None
    shown = budget_picture(inputs.budget, "Reaction <times>")
    slow = replace(inputs.budget, drift=0.00125, cycle=None, functions=())
    return told(budget_document(inputs.budget), budget_json(inputs.budget), shown,
                budget_document(slow))  # fmt: skip


def campaign(_: Path) -> str:
    config = CampaignConfig(links=campaign_links(example("estop")))
    result = run_campaign(config, ("loss",), 8, jobs=1)
    proof = Collision(end="sub", frame=b"\1\2", right=b"\1\3", old_crc=0xAB, sequence=7)
    failed = ClassResult(
        name="corruption", injected=90, detected=40, tolerated=30, collisions=5, wrongly_accepted=2,
        wrong_reactions=1, codes=Counter({-1: 20, 1: 15, 3: 5}), latency_min_ns=1_000_000,
        latency_sum_ns=80_000_000, latency_max_ns=4_000_000, latency_max_share=0.04, exposed=50,
        exposed_collisions=4, expected=0.001, shown=[Shown(trial=8, link="a-b", proof=proof)],
        failures=[Failure(trial=3, link="a-b", reason="took it"),
                  Failure(trial=4, link="a-c", reason="did not")],
    )  # fmt: skip
    quiet = ClassResult(name="bit_errors+loss", injected=3, tolerated=3, collisions=2)
    all_bits = ClassResult(name=EXHAUSTIVE, injected=9, detected=9, collisions=1)
    worse = replace(result, classes=(failed, quiet, all_bits), interrupted=True)
    saved = {("corruption", 3): "traces/3.fsntrace"}
    return told(*(f(r, saved) for r in (result, worse) for f in (campaign_document, to_json)))


def histogram() -> Histogram:
    """Times over six octaves; of each of the outer two one alone."""
    rows = ((101, 1), (128, 40), (1_024, 280), (1_040, 20), (1_536, 9), (7_936, 1))
    return Histogram(
        count=351, min_ns=101, sum_ns=400_001, p50_ns=1_039, p99_ns=1_551, p999_ns=7_900,
        max_ns=8_000, buckets=rows,
    )  # fmt: skip


def times(_: Path) -> str:
    statistics = replace(emulated_run("estop").statistics, work=histogram(), period=histogram())
    picture = timing_picture(statistics, "Times <of> a run")
    none = timing_picture(emulated_run("estop").statistics, "Nothing")
    table = times_table(statistics)
    return told(timing_csv(statistics), *timing_bars(histogram()), picture, none, table)


def devices(_: Path) -> str:
    found = list(builtin_library().devices)
    texts = [line for d in found for line in (f"= {d.name}", *device_text(d))]
    return told(device_list(found), *texts, device_json(found[0]))


def filled_page(_: Path) -> str:
    made, _ = fresh_record(timed())
    made = replace(made, project="Press 4")
    return told(
        render_test_record(made, version="0"), render_test_record(filled(made), version="0")
    )


def differences(folder: Path) -> str:
    """What two of them differ in, as lines and as the change log has it."""
    text = TIMED.read_text("utf-8").replace("devices/", f"{BASE}/devices/")
    for find, put in OTHERWISE:
        assert find in text
        text = text.replace(find, put, 1)
    path = folder / "n.yaml"
    path.write_text(text, "utf-8")
    before, after = side_of_network(timed(), "a"), side_of_network(resolved(path), "b")
    nothing = replace(before, functions=None, functions_sha256="")
    one, two = (side_of_description(bus(n)) for n in (1, 2))
    pairs = ((before, after), (after, before), (before, nothing), (nothing, after),
             (before, one), (two, after), (one, two))  # fmt: skip
    lines = []
    for pair in pairs:
        found = compare(*pair)
        lines += [*map(str, found.changes), *map(_repr, found.changes), *found.not_compared, ""]
    six = Change(
        kind=ChangeKind.MOVED, area=ChangeArea.ENTRIES, where="io SM2", entries=tuple("abcdef")
    )
    seven = replace(
        six,
        kind=ChangeKind.ADDED,
        what="bits",
        before=1,
        after=None,
        entries=tuple("abcdefg"),
    )
    rows = (six, seven, replace(seven, kind=ChangeKind.CHANGED, after=""))
    parts = change_log(
        inputs_of(
            TIMED,
            against=Against(
                source=source("old"), difference=Difference(changes=rows, not_compared=("x",))
            ),
        )
    ).parts
    return told(*lines, *map(str, rows), *parts)


def _repr(change: Change) -> str:
    return repr(replace(change, kind=str(change.kind), area=str(change.area)))


OTHERWISE = (
    ("cycle_us: 1000", "cycle_us: 2000"),
    ("position: 1,", "position: 5, alias: 7, revision: 0x120000,"),
    ("connection_id: 10, watchdog_ms: 100", "connection_id: 12"),
    ('app_parameters: "01 00"', 'app_parameters: "02 00"'),
    ("size: 1\n        kind: standard", "size: 2\n        kind: standard"),
    ("name: safety\n", "name: other\n"),
    ("required_reaction_ms: 300", "required_reaction_ms: 301"),
    ("time_ms: 20,", "time_ms: 21,"),
    ("sub: io2, time_ms: 3, pfh_per_hour: 1.25e-9, claim: {pl: d}, source: manual 3.0}",
     "name: relay, time_ms: 3}"),
)  # fmt: skip


def pictures(folder: Path) -> str:
    """Buses with arcs in rows, and with names in the boxes and SubDevices without a copy."""
    arcs, boxes = folder / "arcs", folder / "boxes"
    arcs.mkdir()
    boxes.mkdir()
    plans = [
        compile_plan(resolved(write_big_network(arcs, 8, 14))),
        compile_plan(resolved(write_big_network(boxes, 16, 24))),
    ]
    shown = [topology_picture(p, per_row=n) for p in plans for n in (2, 5)]
    return told(*shown, copy_picture(plans[0], 13))


def logs(folder: Path) -> str:
    """A log that holds, entries of it; then one with more findings than are kept; an empty one."""
    log = a_log(3, 120)
    last = hash_of(log[1][-3])
    log[1].append(chained(log[1][-1], level="error", utc="", text="gone"))
    files = log_files([str(written(folder / "log", log))])
    entries = [select_entries(files, LogFilter(**f)) for f in ({"most": 2}, {"who": "nobody"})]
    checks = [read_log(files, LogChain(last=last))]
    Path(files[1]).write_bytes(b"".join(log[1][::2]))
    checks.append(read_log(files, LogChain()))
    entries.append(select_entries(files, LogFilter(most=1)))
    Path(files[0]).write_bytes(b"")
    checks.append(read_log(files[:1], LogChain()))
    pages = [log_check_document(check, "0") for check in checks]
    return told(*(log_document(e, "0") for e in entries), selection_json(entries[0]),
                *pages, *map(check_json, checks))  # fmt: skip


def self_tests(folder: Path) -> str:
    """Of this build, with a part that was not tried or failed; of another build; of nothing."""
    result = folder / "self-test.json"
    shown: list[Any] = []
    for build, first, others in (
        ("a", "pass", "not tried"),
        ("a", "fail", "pass"),
        ("b", "pass", "pass"),
        ("a", "not tried", "not tried"),
    ):
        found = [first, *(others for _ in PART_NAMES[1:])]
        parts = [
            {"name": name, "result": word} for name, word in zip(PART_NAMES, found, strict=True)
        ]
        document = {"tool": "fsoe-net", "self_test": 1, "version": "1.2", "parts": parts}
        document |= {
            "result": "fail" if "fail" in found else "pass",
            "build": {"sha256": build * 64},
        }
        result.write_text(json.dumps(document), "utf-8")
        told_of, points = self_test_parts(read_self_test(str(result), "a" * 64))
        shown += [*told_of, *map(str, points)]
    return told(*shown)


SHOWN = ("architecture", "connections", "copies", "bus_evidence")
TOLD: dict[str, Callable[[Path], str]] = {
    "four connections": lambda _: report(EXAMPLES / "el6910" / "network.yaml", *SHOWN),
    "sparse": sparse,
    "nothing read": nothing_read,
    "mistakes": mistakes,
    "many findings": many_findings,
    "another configuration": of_another_configuration,
    "incident": incident,
    "incidents": incidents,
    "differences": differences,
    "pictures": pictures,
    "budget": lambda _: budget(TIMED),
    "campaign": campaign,
    "times": times,
    "devices": devices,
    "test_record": filled_page,
    "logs": logs,
    "self-tests": self_tests,
}


def whole(document: Callable[[Path], str], folder: Path) -> str:
    """Return a document without folders and versions."""
    text = document(folder)
    for path in (folder, BASE, ROOT):
        text = text.replace(f"{path}/", "")
    return VERSION.sub(r"\1VERSION", text)


@pytest.mark.parametrize("name", TOLD)
def test_every_figure_of_a_document(name: str, tmp_path: Path) -> None:
    found = figures(whole(TOLD[name], tmp_path)).split()
    compare_results(__file__, name, ((str(n), figure) for n, figure in enumerate(found)))


def test_every_word_of_the_report_of_a_network(tmp_path: Path) -> None:
    assert whole(with_everything, tmp_path) == REPORT.read_text("utf-8")


def _write() -> None:
    with tempfile.TemporaryDirectory() as folder:
        REPORT.write_text(whole(with_everything, Path(folder)), "utf-8")


if __name__ == "__main__":
    sys.exit(_write())
