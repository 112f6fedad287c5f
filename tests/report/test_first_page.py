"""The first page, a page for each safety function, and what acts on what."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from base64 import b64encode
from dataclasses import replace
from html import escape
from pathlib import Path
from xml.etree import ElementTree

import pytest
from networks import example
from report.made import BASE, TIMED, inputs_of
from test_record.filled import fresh_record, timed

from fsoe_net.document.model import Document, Item, Level, Table, Verdict
from fsoe_net.document.write_html import document_html
from fsoe_net.formats.own.library import builtin_library
from fsoe_net.model.acceptance import Acceptance, CheckedSignature, SignedBy
from fsoe_net.model.network import SourceFile
from fsoe_net.model.test_record import AtMachine, StepKind, StepOutcome
from fsoe_net.plan.compile import compile_plan
from fsoe_net.report.compose import compose_report
from fsoe_net.report.formats import render_report
from fsoe_net.report.inputs import GivenRecord, ReportInputs, Signatures, Tried
from fsoe_net.report.svg import topology_picture
from fsoe_net.timing.budget import make_budget

FILE = SourceFile(path="test-record.yaml", sha256="0" * 64)
ROOT = Path(__file__).parents[2]


def words(items: tuple[Item, ...]) -> list[str]:
    return [i.word if isinstance(i, Verdict) else i.text for i in items]


def table(document: Document, name: str) -> Table:
    parts = [*document.lead, *(p for s in document.sections for p in s.parts)]
    return next(p for p in parts if isinstance(p, Table) and p.name == name)


def facts(document: Document, name: str) -> dict[str, list[str]]:
    return {words(what)[0]: words(value) for what, value in table(document, name).rows}


def function_row(inputs: ReportInputs) -> dict[str, list[str]]:
    shown = table(compose_report(inputs), "safety functions")
    return {c.title: words(v) for c, v in zip(shown.columns, shown.rows[0], strict=True)}


def tried(outcome: StepOutcome | None, kind: StepKind | None = None, **more: object) -> Tried:
    """Return the test record of the timed network; those of a kind, or all, have an outcome."""
    machine = AtMachine(outcome=outcome, by="A. Person", date="2026-11-20", **more)
    test_record, _ = fresh_record(timed())
    steps = tuple(
        replace(s, machine=machine) if s.kind.at_machine and kind in (None, s.kind) else s
        for s in test_record.steps
    )
    return Tried(source=FILE, test_record=replace(test_record, steps=steps))


def test_the_first_table_names_what_by_whom_and_what_was_tried() -> None:
    found = facts(compose_report(inputs_of(TIMED)), "what is accepted")
    assert found == {
        "What": ["5 copies per bus cycle for 2 FSoE connections and 1 safety function"],
        "By whom": ["not accepted: no acceptance record"],
        "Signatures": ["none"],
        "Tests at the machine": ["NOT TESTED"],
        "Findings": ["no findings"],
    }


def test_a_function_is_on_the_first_page_with_times_levels_and_tests() -> None:
    row = function_row(inputs_of(TIMED))
    assert row["Safety function"] == ["SF1 estop"]
    assert (row["Required"], row["Calculated"]) == (["300"], ["282"])
    assert (row["Level required"], row["Claimed"]) == (["PL d"], ["PL d"])
    assert (row["Tested"], row["Against it"]) == (["NOT TESTED"], [])


@pytest.mark.parametrize(
    ("outcome", "kind", "more", "tested", "against"),
    [
        (StepOutcome.AS_EXPECTED, None, {"measured_ms": 61.5}, "as expected, 61.5 ms",
         ["nothing found"]),
        (StepOutcome.AS_EXPECTED, StepKind.LOSS, {}, "NOT TESTED", []),
        (StepOutcome.AS_EXPECTED, StepKind.TRIGGER, {}, "as expected", ["nothing found"]),
        (StepOutcome.NOT_AS_EXPECTED, StepKind.TRIGGER, {}, "FAILED", []),
        (StepOutcome.NOT_RUN, None, {}, "NOT TESTED", []),
    ],
)  # fmt: skip
def test_a_function_is_tested_only_by_its_own_trigger(
    outcome: StepOutcome, kind: StepKind | None, more: dict, tested: str, against: list[str]
) -> None:
    row = function_row(inputs_of(TIMED, tried=tried(outcome, kind, **more)))
    assert (row["Tested"], row["Against it"]) == ([tested], against)


def test_results_of_another_network_do_not_count() -> None:
    done = replace(tried(StepOutcome.AS_EXPECTED), fits=False)
    assert function_row(inputs_of(TIMED, tried=done))["Tested"] == ["NOT TESTED"]


def edited(folder: Path, *edits: tuple[str, str]) -> Path:
    text = TIMED.read_text("utf-8").replace("devices/", f"{TIMED.parent}/devices/")
    for old, new in edits:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "timed.yaml"
    path.write_text(text, "utf-8")
    return path


@pytest.mark.parametrize(
    ("edit", "against"),
    [
        (("required_reaction_ms: 300", "required_reaction_ms: 281"), "takes longer than required"),
        (("required: {pl: d}", "required: {pl: e}"), "level above the lowest claim"),
        (("required: {pl: d}", "required: {sil: 3}"), "level above the lowest claim"),
        (("claim: {pl: d}, ", ""), "claim not judged"),
        (("time_ms: 5, ", ""), "time not judged"),
        (("pfh_per_hour: 1.0e-8", "pfh_per_hour: 1.0e-5"), "PFH above the limit"),
        (("pfh_per_hour: 1.0e-8, ", ""), "PFH not judged"),
        (("source: manual 3.0", "source: manual 3.0?"), "time unverified"),
    ],
)
def test_objections_to_a_function_are_in_its_row(
    tmp_path: Path, edit: tuple[str, str], against: str
) -> None:
    inputs = inputs_of(edited(tmp_path, edit), tried=tried(StepOutcome.AS_EXPECTED))
    assert against in function_row(inputs)["Against it"]


def test_a_function_has_a_page_with_all_that_is_known_of_it() -> None:
    document = compose_report(inputs_of(TIMED, tried=tried(StepOutcome.AS_EXPECTED)))
    (page,) = [s for s in document.sections if s.key == "function_1"]
    assert (page.title, page.page, page.appendix) == ("SF1 estop", True, False)
    found = facts(document, "facts of estop")
    assert found["Trigger"] == ["emergency stop button ES1 is pressed"]
    assert found["Reset"] == ["button S2 is pressed after ES1 is pulled out"]
    assert found["Modes"] == ["all"]
    assert found["FSoE connections"] == ["logic-io, logic-io2"]
    assert found["Required"] == ["PL d", "300"]
    assert found["Claimed"] == [
        "no claim is below PL d; lowest: PL d, claimed by the source of ES1, io, logic, io2, K1",
        "the PFH sum alone would fit PL e: more than the lowest claim, PL d",
    ]
    time, least = found["Calculated time"]
    assert time.endswith("logic-io2 is late up to its watchdog and then lost")
    assert least == "100"
    kinds = [words(row[0]) for row in table(document, "parts of estop").rows]
    assert kinds[:5] == [["sensor"], ["input"], ["logic"], ["output"], ["actuator"]]
    steps = [(words(row[0])[0], words(row[2])) for row in table(document, "tests of estop").rows]
    assert steps[1:] == [
        ("start-up of logic-io, logic-io2", ["2 of 2 steps as expected"]),
        ("loss of io, io2, logic", ["3 of 3 steps as expected"]),
    ]
    assert words(table(document, "signature").rows[0][0]) == [""]


@pytest.mark.parametrize(
    ("outcome", "said"),
    [(StepOutcome.NOT_AS_EXPECTED, "3 of 3 steps FAILED"), (None, "3 of 3 steps open")],
)
def test_losses_that_failed_or_are_open_are_counted(outcome: StepOutcome | None, said: str) -> None:
    document = compose_report(inputs_of(TIMED, tried=tried(outcome, StepKind.LOSS)))
    assert words(table(document, "tests of estop").rows[-1][2]) == [said]


def test_causes_and_effects_are_named_with_their_function() -> None:
    document = compose_report(inputs_of(ROOT / "examples" / "el6910" / "network.yaml"))
    shown = table(document, "causes and effects 1")
    heads = [c.title for c in shown.columns]
    assert heads == ["Cause: sensor, input", "contactors K1 and K2", "motors without torque"]
    assert [[words(c) for c in row] for row in shown.rows] == [[["button ES1"], ["SF1"], ["SF2"]]]


def test_many_effects_take_several_tables_without_empty_rows() -> None:
    inputs = inputs_of(ROOT / "examples" / "el6910" / "network.yaml")
    base = inputs.resolution
    assert base is not None
    (first, *_) = base.network.safety_functions
    functions = tuple(
        replace(
            first,
            name=f"stop {n}",
            elements=(
                replace(first.elements[0], name=f"ES{n}"),
                *first.elements[1:4],
                replace(first.elements[4], name=f"K{n}"),
            ),
        )
        for n in range(8)
    )
    network = replace(base.network, safety_functions=functions)
    resolution = replace(base, network=network)
    budget = make_budget(resolution, builtin_library())
    inputs = replace(inputs, resolution=resolution, budget=budget)
    document = compose_report(inputs)
    one, two = (table(document, f"causes and effects {n}") for n in (1, 2))
    assert [len(t.columns) for t in (one, two)] == [7, 3]
    assert [words(row[0]) for row in two.rows] == [["ES6"], ["ES7"]]
    assert [words(c) for c in two.rows[1]] == [["ES7"], [], ["SF8"]]


def record_of(inputs: ReportInputs) -> Acceptance:
    assert inputs.fingerprint is not None
    assert inputs.plan is not None
    return Acceptance(
        network="timed",
        made_with="0",
        whole=inputs.fingerprint.whole,
        sections=inputs.fingerprint.sections,
        plan=inputs.plan.to_bytes(),
        inputs=(),
        reports=(),
        open_points=0,
        assumptions=0,
        test_record=FILE,
        steps=1,
        author=SignedBy(name="A. Meier", date="2026-11-20"),
        verifier=SignedBy(name="B. Kaya", date="2026-11-21"),
    )


def test_acceptance_and_signatures_are_on_the_first_page() -> None:
    inputs = inputs_of(TIMED)
    given = GivenRecord(
        source=SourceFile(path="acceptance.yaml", sha256="1" * 64),
        record=record_of(inputs),
        fits=True,
    )
    found = facts(compose_report(replace(inputs, accepted=given)), "what is accepted")
    assert found["By whom"] == [
        "author A. Meier, 2026-11-20",
        "verifier B. Kaya, 2026-11-21",
        "acceptance.yaml",
    ]
    assert found["Signatures"] == ["not checked; --signers FILE checks those next to the record"]
    one = CheckedSignature(
        role="author", name="A. Meier", principal="a@example.org", date="2026-11-20", key="ED 25519"
    )
    signed = Signatures(signatures=(one,), against=("no signature of the verifier B. Kaya",))
    document = compose_report(replace(inputs, accepted=given, signed=signed))
    found = facts(document, "what is accepted")
    assert found["Signatures"] == [
        "author A. Meier, 2026-11-20",
        "a@example.org, ED 25519",
        "no signature of the verifier B. Kaya",
    ]
    assert document.verdict.level is Level.ERROR
    other = replace(given, fits=False)
    found = facts(compose_report(replace(inputs, accepted=other)), "what is accepted")
    assert found["By whom"][0] == "the record is of ANOTHER configuration"


def test_the_columns_for_the_hand_are_the_widest_of_the_checklist() -> None:
    document = compose_report(inputs_of(TIMED, tried=tried(None)))
    shares = {c.title: c.share for c in table(document, "checklist").columns}
    widest = sorted(shares, key=lambda title: -shares[title])
    assert set(widest[:2]) == {"MACHINE, by hand", "Who, when"}
    assert sum(shares.values()) == 100


@pytest.mark.parametrize("per_row", [3, 5])
@pytest.mark.parametrize("identities", [True, False])
def test_names_of_connections_never_touch(per_row: int, identities: bool) -> None:
    plan = compile_plan(example("el6910"))
    crossing = tuple(
        c._replace(connection_id=c.connection_id if identities else None)
        for c in (*plan.connections, *plan.connections, *plan.connections)
    )
    svg = topology_picture(replace(plan, connections=crossing), per_row=per_row)
    found = re.findall(r'<rect x="(\S+)" y="(\S+)" width="(\S+)" height="14" class="under"/>', svg)
    boxes = [(float(x), float(y), float(x) + float(w)) for x, y, w in found]
    assert len(boxes) == 12
    for n, (left, top, right) in enumerate(boxes):
        for other_left, other_top, other_right in boxes[:n]:
            apart = right <= other_left or other_right <= left
            assert apart or abs(top - other_top) >= 14


@pytest.mark.parametrize(("per_row", "rows"), [(5, 2), (2, 3)])
def test_each_bus_is_a_line_of_its_own_with_its_name(per_row: int, rows: int) -> None:
    plan = compile_plan(example("two-buses"))
    svg = topology_picture(plan, per_row=per_row)
    lines = [float(y) for y in re.findall(r'<line x1="2" y1="(\S+)"', svg)]
    assert len(lines) == rows
    middles = dict(re.findall(r'y="(\S+)" text-anchor="middle" class="name">(\w+)<', svg)[::-1])
    middles = {name: float(y) for y, name in middles.items()}
    assert middles["el6910"] < middles["drive_1"]
    names = re.findall(r'y="(\S+)" text-anchor="start" class="name">(.*?)<', svg)
    assert [name for _, name in names] == ["bus cell", "bus drives"]
    below = [float(y) - 47 for y, _ in names]
    assert below == [lines[0], lines[-1]]
    one = topology_picture(replace(plan, buses=()), per_row=per_row)
    assert "bus cell" not in one


def test_printed_pages_of_a_report_are_counted(tmp_path: Path) -> None:
    """A safety function takes one page; the rest, without appendices, five for this network."""
    browser = shutil.which("chromium")
    if browser is None:
        pytest.skip("chromium is not installed")
    document = compose_report(inputs_of(TIMED, tried=tried(None)))
    main = replace(document, sections=tuple(s for s in document.sections if not s.appendix))
    page, printed = tmp_path / "report.html", tmp_path / "report.pdf"
    page.write_text(document_html(main), "utf-8")
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-sync",
               "--no-first-run", "--disable-background-networking", "--disable-component-update",
               f"--user-data-dir={tmp_path / 'profile'}", "--no-pdf-header-footer",
               f"--print-to-pdf={printed}", page.as_uri()]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed.read_bytes())) <= 6


def test_the_title_block_has_the_facts_of_the_file_in_every_form(tmp_path: Path):
    logo = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + bytes([0, 0, 0, 60, 0, 0, 0, 20])
    (tmp_path / "logo.png").write_bytes(logo)
    (tmp_path / "devices").symlink_to(BASE / "devices")
    path = tmp_path / "network.yaml"
    facts = ("FSR-17", "B", "2026-11-21", "Press & <b>Sons</b>")
    keys = ("number", "revision", "date", "customer")
    rows = ", ".join(f"{key}: '{fact}'" for key, fact in zip(keys, facts, strict=True))
    path.write_text(f"{TIMED.read_text('utf-8')}report: {{{rows}, logo: logo.png}}\n", "utf-8")
    inputs = inputs_of(path)
    page, text = render_report(inputs, "html"), render_report(inputs, "md")
    block = json.loads(render_report(inputs, "json"))["lead"][0]
    assert [cell[0]["text"] for cell in block["rows"][0]] == list(facts)
    first = page.partition('<p class="banner')[0]
    assert all(f"<div>{escape(fact)}</div>" in first for fact in facts)
    assert f'src="data:image/png;base64,{b64encode(logo).decode()}"' in first
    assert "| FSR-17 | B | 2026-11-21 | Press \\& \\<b>Sons\\</b> |" in text
    # It is about the document, not about the configuration.
    assert inputs.fingerprint == inputs_of(TIMED).fingerprint


def test_an_empty_title_block_is_filled_in_by_hand():
    page = render_report(inputs_of(TIMED), "html")
    block = page.partition("Document number")[2].partition("</table>")[0]
    assert block.count('<span class="blank"></span>') == 4
    assert "<img" not in page


def test_a_connection_between_two_buses_crosses_no_box_of_either():
    plan = compile_plan(example("two-buses"))
    svg = ElementTree.fromstring(topology_picture(plan))
    tops = sorted({float(box.get("y", "")) for box in svg.iter("rect") if "rx" in box.attrib})
    high = next(float(box.get("height", "")) for box in svg.iter("rect") if "rx" in box.attrib)
    upper, lower = tops
    between = []
    for path in (p for p in svg.iter("path") if p.get("class") == "arc"):
        heights = [float(y) for y in re.findall(r",([-\d.]+)", path.get("d", ""))]
        # A curve stays between its lowest and its highest point of control.
        if lower in heights:
            between.append((min(heights), max(heights)))
        else:
            assert max(heights) <= upper
    assert between == [(upper + high, lower)] * 2
