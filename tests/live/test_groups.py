"""Groups that may be absent: files, plan, rules, virtual time, report, and over a wire."""

from __future__ import annotations

import json
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from cli import tool
from live.on_the_wire import on_the_wire
from live.support import needs_core
from master.rig import run_to_end, write_plan
from networks import EXAMPLES, resolved
from scans import scan_of

from fsoe_net.compare.bus_scan import check_scan
from fsoe_net.errors import PlanFormatError
from fsoe_net.formats.own.scan import parse_scan
from fsoe_net.model.network import MOST_COMBINATIONS, Group
from fsoe_net.model.test_record import StepKind, StepOutcome
from fsoe_net.plan.codec import decode_plan, encode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.rules.check import check
from fsoe_net.test_record.steps import make_test_record
from fsoe_net.test_record.virtual import run_tests_virtual

FOLDER = EXAMPLES / "tool-exchange"
NETWORK = FOLDER / "network.yaml"


def fsn(*words: object):
    return tool.fsn(*map(str, words))


@pytest.fixture(name="changed")
def changed_network(tmp_path: Path):
    """Return a function that writes the example with some texts replaced."""

    def write(*pairs: tuple[str, str]) -> Path:
        text = NETWORK.read_text("utf-8")
        for before, after in pairs:
            assert before in text
            text = text.replace(before, after)
        path = tmp_path / "changed.yaml"
        text = text.replace("../el6910", str(EXAMPLES / "el6910"))
        path.write_text(text.replace("config: devices", f"config: {FOLDER}/devices"), "utf-8")
        return path

    return write


# -- plan -----------------------------------------------------------------------------------------


def test_a_plan_names_who_may_be_absent():
    plan = compile_plan(resolved(NETWORK))
    assert plan.format == "1.3"
    assert [(g.name, g.place, g.first_subdevice, g.subdevice_count) for g in plan.groups] == [
        ("gripper", "flange", 2, 1),
        ("drill", "flange", 3, 1),
    ]
    assert [plan.group_number(n) for n in range(4)] == [None, None, 0, 1]
    assert [plan.is_first_choice(g) for g in plan.groups] == [True, False]
    assert decode_plan(encode_plan(plan)) == plan
    assert "group drill: 1 SubDevice that may be absent, at flange" in plan.show()


@needs_core
def test_the_core_makes_the_same_fingerprint(changed):
    from fsoe_net.core.core import CorePlan

    plan = compile_plan(resolved(NETWORK))
    assert CorePlan.load(encode_plan(plan)).fingerprint() == plan.fingerprint
    for pair in (("name: drill,", "name: mill,"), ("place: flange", "place: wrist")):
        other = compile_plan(resolved(changed(pair))).fingerprint
        assert other.changed(plan.fingerprint) == ("devices",)


@needs_core
@pytest.mark.parametrize(
    ("place", "value", "text"),
    [(8, 9, "group 0: SubDevice"), (24, 2, "group 1: SubDevice"), (28, 2, "group 1: SubDevice")],
)
def test_a_wrong_group_is_refused_by_both_readers(place, value, text):
    from fsoe_net.core.core import CorePlan

    raw = bytearray(encode_plan(compile_plan(resolved(NETWORK))))
    raw[len(raw) - 32 + place] = value
    raw[16:20] = bytes(4)
    raw[16:20] = zlib.crc32(raw).to_bytes(4, "little")
    with pytest.raises(PlanFormatError, match=text):
        decode_plan(bytes(raw))
    with pytest.raises(PlanFormatError, match=r"SubDevices of the group"):
        CorePlan.load(bytes(raw))


def test_combinations_are_bounded():
    network = resolved(NETWORK).network
    assert network.combinations() == ((), ("gripper",), ("drill",))
    assert resolved(EXAMPLES / "el6910" / "network.yaml").network.combinations() == ()
    free = tuple(Group(name=f"g{n}", subdevices=("valves",)) for n in range(7))
    assert len(replace(network, groups=free).combinations()) == MOST_COMBINATIONS


# -- rules ----------------------------------------------------------------------------------------


def found(path: Path) -> list[str]:
    rows = check(resolved(path))
    return [f"{d.code}: {d.message}" for d in rows if d.code in ("FSN165", "FSN166", "FSN167")]


@pytest.mark.parametrize(
    ("pairs", "text"),
    [
        ([("name: drill,", "name: gripper,")], "two groups have the name 'gripper'"),
        ([("[spindle]}", "[spindel]}")], "group drill names 'spindel', no SubDevice"),
        ([("[spindle]}", "[valves]}")], "valves is named twice in groups"),
        ([("alias: 12, position: 0", "position: 4")], "has no alias to find it by"),
        ([("alias: 12, position: 0", "alias: 12, position: 1")], "is not number 0 after alias 12"),
        ([("alias: 12,", "alias: 11,")], "has alias 11, by which group"),
        ([("position: 2, config", "alias: 12, position: 3, config")], "el1904 has alias 12, by"),
        (
            [("config: devices/spindle.yaml", "config: ../el6910/devices/circulo.yaml")],
            "has distributed clocks (assign_activate 0x0300)",
        ),
        ([("[spindle]}", "[spindle, valves]}")], "valves is named twice"),
        (
            [("[spindle]}", "[el6910]}"), ("position: 1, config", "alias: 9, position: 0, config")],
            "FSN166: the MainInstance of el6910-el1904 is in group drill and may be absent",
        ),
        (
            [("[spindle]}", "[el6910]}"), ("position: 1, config", "alias: 9, position: 0, config")],
            "FSN166: el6910-valves joins the groups drill and gripper, which are never at flange",
        ),
    ],
)
def test_groups_that_are_not_possible(changed, pairs, text):
    assert any(text in row for row in found(changed(*pairs))), found(changed(*pairs))


STANDARD = """    transfers:
      - {size: 1, kind: standard,
         in: {ec_module: %s, index: 0x6010, subindex: 1},
         out: {ec_module: %s, index: 0x7010, subindex: 1}}
"""


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ("valves", "FSN166: nothing is ever copied from valves to io: the groups gripper and"),
        ("tool", "FSN167: while group rest is absent, io keeps the last value of tool"),
    ],
)
def test_copies_from_what_may_be_absent(changed, source, text):
    more = "  - {name: %s, alias: %d, position: 0, config: ../el6910/devices/el2904.yaml}\n"
    path = changed(
        ("\ngroups:", more % ("tool", 21) + more % ("io", 22) + "\ngroups:"),
        ("[spindle]}", "[spindle]}\n  - {name: rest, subdevices: [tool]}\n"
         "  - {name: third, place: flange, subdevices: [io]}"),
        ("    transfers: []\n", STANDARD % (source, "io")),
    )  # fmt: skip
    assert any(row.startswith(text) for row in found(path)), found(path)


def test_groups_go_with_one_bus(tmp_path):
    text = (EXAMPLES / "two-buses" / "network.yaml").read_text("utf-8")
    path = tmp_path / "n.yaml"
    text = text.replace("\nnets:", "\ngroups:\n  - {name: a, subdevices: [drive_1]}\nnets:")
    path.write_text(text.replace("../el6910", str(EXAMPLES / "el6910")), "utf-8")
    done = fsn("check", path)
    assert "error[FSN165]: groups are next to buses" in done.stdout + done.stderr


def test_other_formats_hold_no_groups(tmp_path):
    done = fsn("convert", NETWORK, "-o", tmp_path / "bus.eni.xml")
    assert done.returncode == 1
    assert "this network has groups that may be absent, and no other format" in done.stderr


# -- a scan ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("silent", [False, True])
@pytest.mark.parametrize("there", ["valves", "spindle", ""])
def test_a_scan_accepts_absent_groups(there, silent):
    resolution = resolved(NETWORK)
    subs = resolution.network.subdevices
    ring = tuple(replace(sub, position=n) for n, sub in enumerate(subs, start=1))
    document = scan_of(replace(resolution, network=replace(resolution.network, subdevices=ring)))
    rows = []
    for row, sub in zip(document["subdevices"][1:], subs, strict=True):
        absent = sub.alias and sub.name != there
        if absent and silent:
            row |= {"al_status": 0, "planned": sub.name, "alias": 0}
        if not absent or silent:
            rows.append(row)
    document["subdevices"][1:] = rows
    for number, row in enumerate(document["subdevices"]):
        row["position"] = number
    scan, damage = parse_scan(json.dumps(document).encode(), "scan.json")
    assert scan is not None, damage
    assert [d.message for d in check_scan(resolution, scan)] == []


# -- virtual time, report, test record -------------------------------------------------------------


@needs_core
def test_a_run_does_not_wait_for_who_is_absent():
    done = fsn("run", NETWORK, "--virtual-time", "--duration", "0.3s", "--format", "json")
    seen = json.loads(done.stdout)
    states = {c["name"]: c["state"] for c in seen["connections"]}
    assert done.returncode == 0
    assert states["el6910-valves"].startswith("data")
    assert not states["el6910-spindle"].startswith("data")
    assert seen["statistics"]["wkc_errors"] == 0


def test_a_scenario_names_groups(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text("version: 1\nsteps:\n  - {at_ms: 1, pull: griper}\n", "utf-8")
    done = fsn("run", NETWORK, "--scenario", path, "--virtual-time")
    assert "error[FSN116]" in done.stdout + done.stderr
    assert "gripper" in done.stdout + done.stderr


@pytest.mark.uncounted
@needs_core
def test_the_protocol_tries_each_combination():
    resolution = resolved(NETWORK)
    plan = encode_plan(compile_plan(resolution))
    test_record = make_test_record(resolution, plan)
    steps = [s for s in test_record.steps if s.kind is StepKind.COMBINATION]
    assert [s.id for s in steps] == [
        "combination none",
        "combination gripper",
        "combination drill",
    ]
    assert all(step.is_open and step.kind.at_machine for step in steps)
    assert "plug in drill, without gripper" in steps[2].what
    assert "el6910-el1904, el6910-spindle reaches" in steps[2].expected
    others = ("start-up el6910-spindle", "trigger e-stop to spindle", "loss spindle")
    due = (*steps, *(s for s in test_record.steps if s.id in others))
    assert len(due) == 6
    tried = run_tests_virtual(replace(test_record, steps=due), resolution, plan, faults=1)
    for step in tried.steps:
        assert step.emulated is not None
        assert step.emulated.outcome is StepOutcome.AS_EXPECTED, (step.id, step.emulated)


def test_the_report_lists_the_combinations(tmp_path):
    fsn("report", NETWORK, "-o", tmp_path / "report.md")
    text = (tmp_path / "report.md").read_text("utf-8")
    assert "Groups that may be absent" in text
    assert "none of them" in text.partition("Combinations")[2]


@pytest.mark.parametrize("option", ["--standby", "--take-over", "--redundant=far"])
def test_options_that_groups_do_not_go_with(option, tmp_path):
    plan = write_plan(tmp_path, "tool-exchange")
    done = run_to_end(plan, "--bus", "soem", "--interface", "near", option)
    assert done.returncode in (1, 2)  # 1: this build has no soem
    name = option.partition("=")[0]
    if done.returncode == 2:
        assert f"{name}: the plan has groups that may be absent" in done.stderr


# -- over a wire ----------------------------------------------------------------------------------


def undisturbed(seen: Any) -> bool:
    """A busy machine may reset a connection that is always there: then it is tried again."""
    calm = seen["code"] == 0 and not seen["incidents"]
    return bool(calm and seen["resets"][0] == seen["resets"][1])


def test_tools_are_exchanged_over_a_wire(tmp_path):
    words = ("exchange", NETWORK)
    rig = "live/groups_rig.py"
    seen = on_the_wire(*words, tmp=tmp_path, good=undisturbed, script=rig)
    assert {n: g["state"] for n, g in seen["first"].items()} == {
        "gripper": "there",
        "drill": "absent",
    }
    assert seen["none"] == [2, 0, 6, 6]
    assert seen["second"] == [1, 0, 9, 9]
    (empty, nothing), (full, drill) = seen["monitor"]
    assert (empty, full) == (0, 0)
    assert "group gripper at flange: absent" in nothing
    assert "group drill at flange: there" in drill
    assert "while drill is at flange" in seen["both"]["detail"]
    assert "gripper" in seen["refused"]
