"""`fsoe-net run --interface`: a network over a real wire, driven by fsn-master."""

import csv
import json
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from cli.tool import fsn
from live.on_the_wire import ESTOP, ROBOT, on_the_wire
from live.support import EXAMPLES, ROOT, document, needs_core
from live.support import run as run_virtually

from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.master import find_master

HISTOGRAMS = {"latency", "period", "work", "copy", "round_trip", "dc_offset"}


@pytest.mark.parametrize(("network", "connections"), [(ESTOP, 1), (ROBOT, 4)])
def test_connections_come_up_over_the_wire(network, connections, tmp_path):
    seen = on_the_wire("comes_up", network, tmp=tmp_path, good=lambda s: s["code"] == 0)
    found = json.loads(seen["out"])
    assert found["result"] == "pass"
    assert found["mode"] == "live"
    assert found["bus"] == {"backend": "soem", "interface": "near"}
    assert len(found["connections"]) == connections
    for row in found["connections"]:
        assert row["state"] == row["wire_state"]
        assert row["wire_state"] in ("data_process", "data_failsafe")
        assert row["frames_to_sub"] > 10
        assert row["time_to_data_ms"] > 0
        assert row["safe_to_sub"] is None
        assert row["connection_id"] > 0
    assert {s["al"] for s in found["subdevices"]} == {"OP"}
    assert found["statistics"]["round_trip"]["count"] > 0
    check_same_keys(found)
    check_files(tmp_path, found)


def test_the_documented_capabilities_open_the_interface(tmp_path_factory, tmp_path, monkeypatch):
    """The bus opens without CAP_NET_ADMIN, which SOEM's promiscuous mode would need."""
    program = tmp_path_factory.mktemp("limited") / "fsn-master"
    limit = "--bounding-set=-all,+net_raw,+sys_nice,+ipc_lock"
    program.write_text(f'#!/bin/sh\nexec setpriv {limit} {find_master()} "$@"\n', "utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("FSN_MASTER", str(program))
    seen = on_the_wire("comes_up", ESTOP, tmp=tmp_path, good=lambda s: s["code"] == 0)
    assert json.loads(seen["out"])["result"] == "pass"


def check_same_keys(found):
    """A live bus has the document of the emulated one."""
    emulated = document(run_virtually(EXAMPLES / "estop"))
    assert list(found) == list(emulated)
    assert list(found["connections"][0]) == list(emulated["connections"][0])
    assert list(found["statistics"]) == list(emulated["statistics"])
    assert emulated["bus"] == {"backend": "emulated", "interface": None}
    page = (ROOT / "docs/reference/run-output.md").read_text("utf-8")
    assert [k for k in found["subdevices"][0] if f"`{k}`" not in page] == []


def check_files(folder, found):
    with open(folder / "timing.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    filled = {name for name in HISTOGRAMS if found["statistics"][name]["count"]}
    assert {row["histogram"] for row in rows} == filled
    for name in filled:
        mine = [row for row in rows if row["histogram"] == name]
        buckets = [[int(row["floor_ns"]), int(row["count"])] for row in mine]
        assert buckets == found["statistics"][name]["buckets"]
        assert float(mine[-1]["cumulative_share"]) == 1
    tree = ET.parse(folder / "timing.svg")
    text = " ".join(tree.getroot().itertext())
    assert "wake-up latency" in text
    assert "prefers-color-scheme:dark" in text


def test_silent_bus_is_reported_with_the_next_step(tmp_path):
    seen = on_the_wire("silent", ESTOP, tmp=tmp_path)
    assert seen["code"] == 1
    assert "FSN_E_BUS_SILENT" in seen["err"]
    assert "check cable" in seen["err"]
    assert seen["out"] == ""


@pytest.mark.shows("R8")
def test_another_network_on_the_bus(tmp_path):
    seen = on_the_wire("wrong", ESTOP, ROBOT, tmp=tmp_path)
    assert seen["code"] == 1
    assert "FSN_E_BUS_IDENTITY: SubDevice 0 (ek1914)" in seen["err"]
    assert "ek1914 is at" in seen["err"]
    assert "network.yaml:8:5" in seen["err"]


@pytest.mark.shows("R16")
def test_other_parameters_than_the_plan_are_seen_on_the_wire(tmp_path):
    """Connection ID 4 and 100 ms in the plan; 2099 and 4000 ms on the wire."""
    (tmp_path / "devices").symlink_to(EXAMPLES / "el6910" / "devices")
    stated = "address: 202, connection_id: 4, watchdog_ms: 100"
    other = stated.replace(": 4,", ": 2099,").replace(": 100", ": 4000")
    text = Path(ROBOT).read_text("utf-8").partition("safety_functions:")[0]
    assert stated in text
    (tmp_path / "other.yaml").write_text(text.replace(stated, other), "utf-8")
    rows = "parameters of 4 of 4 connections observed"

    def observed(seen):  # a busy machine may have reset a connection meanwhile
        return rows in seen["answers"]["verify"][1]

    words = ("parameters", ROBOT, str(tmp_path / "other.yaml"))
    seen = on_the_wire(*words, tmp=tmp_path, good=observed)
    said = "connection ID 2099, 4 in the plan; watchdog 4000 ms, 100 ms in the plan"
    assert f"runs with other parameters than the plan: {said}" in " ".join(seen["lines"].split())
    assert seen["code"] == 4
    code, text = seen["answers"]["verify"]
    assert code == 1
    assert "DIFFERS in observed_parameters" in text
    assert "  ! el6910-drive_2: watchdog 4000 ms, 100 ms in the plan" in text
    assert f"el6910-drive_2: other parameters: {said}" in " ".join(
        seen["answers"]["monitor"][1].split()
    )


@pytest.mark.shows("R3")
def test_an_unplugged_subdevice_is_named(tmp_path):
    seen = on_the_wire("unplug", ROBOT, tmp=tmp_path)
    assert seen["code"] == 1
    assert not seen["left"]
    found = json.loads(seen["out"])
    assert found["result"] == "fail"
    gone = found["subdevices"][-1]
    assert (gone["name"], gone["al"]) == (seen["last"], "none")
    assert gone["detail"]
    told = [e["text"] for e in found["events"] if e["source"] == seen["last"]]
    assert any(text.startswith("OP -> none") for text in told)
    clocks = seen["clocks"]  # the drives of this cell start SYNC0
    assert (clocks["set_by"], clocks["reference"]) == ("bus", "coupler")
    assert (clocks["subdevices"], clocks["outside"]) == (2, 0)
    assert clocks["worst_ns"] <= clocks["window_ns"] == 1000
    said = [e["text"] for e in found["events"] if e["source"] == "bus"]
    # On a busy machine they may be apart first: then they are synchronous again.
    assert any(text.startswith("the clocks are synchronous") for text in said)


@pytest.mark.parametrize(
    ("kind", "key", "title"),
    [
        # The devices after el1904 are gone; which connection drops first is chance.
        ("line", "cable_interrupted", "The line was interrupted before el2904 for a while"),
        ("interface", "main_link_lost", "The link of the MainDevice was down"),
    ],
)
def test_a_gap_is_named_by_its_place(kind, key, title, tmp_path):
    seen = on_the_wire("gap", ROBOT, kind, tmp=tmp_path, good=lambda s: s["key"] == key)
    assert seen["title"].startswith(title)


def test_an_incident_names_its_cause_and_holds_what_the_devices_tell(tmp_path):
    seen = on_the_wire("incident", ESTOP, tmp=tmp_path, good=lambda s: s["file"] is not None)
    done = fsn("log", "incident", str(tmp_path / seen["file"]), "--format", "json")
    assert seen["last"] in json.loads(done.stdout)["likely"]["title"]
    head = json.loads((tmp_path / seen["file"]).read_text("utf-8").splitlines()[0])
    told = {row["subdevice"]: row for row in head["fsoe"]}
    assert told["ek1914"]["address"] == 14


FIRST = "ek1914 (ring position 0, port 0)"
LAST = "between el1918 (ring position 1, port 1) and near2"


def test_a_loop_in_the_cycle_continues_while_a_subdevice_is_lost(tmp_path):
    seen = on_the_wire("in_the_cycle", ROBOT, tmp=tmp_path)
    assert [seen[step] for step in ("begins", "breaks", "heals", "sent")] == [True] * 4
    assert seen["on_time"] > 100


@pytest.mark.shows("R3")
def test_each_gap_of_a_ring_is_named(tmp_path):
    """Open at the start, each cable, each interface: in status, events, and the last incident."""
    seen = on_the_wire("ring", ESTOP, tmp=tmp_path, cables=2)
    middle = "between ek1914 (ring position 0, port 1) and el1918 (ring position 1, port 0)"
    gaps = {
        "start": f"between near (no link) and {FIRST}",
        "first cable": f"between near and {FIRST}",
        "middle cable": middle,
        "last cable": LAST,
        "near": f"between near (no link) and {FIRST}",
        "near2": f"{LAST} (no link)",
    }
    assert {name: seen[name] for name in gaps} == gaps
    assert seen["breaks"] >= len(gaps)
    said = [line.partition("bus: ")[2] for line in seen["events"]]
    assert said[0] == f"the ring has been open since the start: {gaps['start']}"
    # What changes twice between two looks is told once, and a gap may be told before its link is
    # known to be gone; the status has counted and named each.
    assert "the ring is closed again" in said
    assert f"the ring is open: {gaps['middle cable']}" in said
    assert (seen["incident"]["state"], seen["incident"]["ways"]) == ("open", [0, 0])
    assert any(f"the ring is open: between near and {FIRST}" in line for line in seen["evidence"])


def test_an_mtu_that_is_too_small_is_said(tmp_path):
    seen = on_the_wire("small", ESTOP, tmp=tmp_path)
    assert seen["code"] == 3
    assert (
        "near has an MTU of 1400, they need 1500: Message too long; ip link set IF mtu 1500"
        in seen["err"]
    )


@pytest.mark.parametrize(
    ("fault", "key"),
    [("foreign", "other_main_device"), ("wrong", "wrong_device"), ("late", "late_replies")],
)
def test_the_cause_of_a_fault_on_the_wire_is_named(fault, key, tmp_path):
    case = f"fault {fault}"
    seen = on_the_wire(case, ESTOP, tmp=tmp_path, good=lambda s: s["key"] == key)
    assert key != "wrong_device" or seen["last"] in seen["title"]
    kept = {Path(e["file"]).name: e["sha256"] for e in seen["log"] if e["event"] == "incident"}
    assert kept == seen["files"]
    events = [entry["event"] for entry in seen["log"]]
    assert ("foreign" in events) == (fault == "foreign")
    assert events[-1] == "stop"


def test_a_bus_that_does_not_open_is_kept_with_all_that_was_found(tmp_path):
    wanted = "ek1914 and el1918 are exchanged on the bus."
    seen = on_the_wire("swapped_at_start", ESTOP, tmp=tmp_path, good=lambda s: s["title"] == wanted)
    assert seen["code"] == 1
    assert seen["found"] == [3, 3]


def test_killing_the_tool_leaves_the_bus(tmp_path):
    seen = on_the_wire("kill_tool", ESTOP, tmp=tmp_path)
    assert seen == {"data": True, "socket_left": False}


def test_killing_the_master_is_reported(tmp_path):
    seen = on_the_wire("kill_master", ESTOP, tmp=tmp_path)
    assert seen["code"] == 3
    assert "was killed by SIGKILL" in seen["err"]
    assert not seen["left"]


def test_another_client_ends_it(tmp_path):
    seen = on_the_wire("stopped", ESTOP, tmp=tmp_path)
    assert seen["code"] == 3
    assert "was ended from outside" in seen["err"]


def test_an_interrupt_stops_orderly(tmp_path):
    seen = on_the_wire("interrupt", ESTOP, tmp=tmp_path)
    assert seen["code"] in (0, 1)  # whether it was in Data in that very moment
    assert "interrupted by the user" in seen["out"]
    assert "soem on near" in seen["out"]
    assert not seen["left"]
    assert seen["status"].startswith("ek1914")
    assert " OP" not in seen["status"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--interface", "x", "--scenario", "s.yaml"], "fsoe-net emulate"),
        (["--interface", "x", "--virtual-time"], "--virtual-time is for emulated devices"),
        (["--interface", "x", "--capture", "f"], "tcpdump"),
        (["--interface", "x", "--device-period", "2ms"], "--device-period"),
        (["--interface", "x", "--redundant", "x"], "same interface twice"),
        (["--interface", "0", "--bus", "igh", "--redundant", "x"], "setting of IgH"),
        (["--interface", "x", "--bus", "emulated"], "--bus"),
        (["--interface", "x", "--cycle", "1"], "has no unit; write 1ms or 1us"),
        (["--interface", "x", "--cycle", "5s"], "5s is out of range: 50us to 1s"),
        (["--interface", "x", "--priority", "100"], "--priority"),
        (["--interface", "x", "--cpu", "-1"], "--cpu"),
        (["--interface", "x", "--wait", "nan"], "'nan' is not a time"),
        (["--redundant", "x"], "--redundant is for a live bus"),
        (["--bus", "soem"], "--bus is for a live bus"),
        (["--cycle", "1ms"], "--cycle is for a live bus"),
        (["--priority", "3"], "--priority is for a live bus"),
        (["--cpu", "0"], "--cpu is for a live bus"),
        (["--wait", "3"], "--wait is for a live bus"),
        (["--intervention-log", "x"], "--intervention-log is for a live bus"),
        (["--virtual-time", "--stats", "f"], "--stats and --plot need real time"),
    ],
)
def test_options_that_are_refused(options, message):
    done = fsn("run", ESTOP, *options)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert done.stdout == ""


def test_a_missing_master_names_the_next_step(monkeypatch, tmp_path):
    monkeypatch.setenv("FSN_MASTER", str(tmp_path / "none"))
    done = fsn("run", ESTOP, "--interface", "x")
    assert done.returncode == 3
    assert "is not an executable program" in done.stderr
    monkeypatch.delenv("FSN_MASTER")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with pytest.raises(EnvironmentFault, match="install-master"):
        find_master()


@pytest.mark.parametrize("option", ["--stats", "--plot"])
def test_a_file_that_cannot_be_written_is_refused_before(option, tmp_path):
    for path in (tmp_path, tmp_path / "no" / "file"):
        done = fsn("run", ESTOP, option, str(path), "--interface", "x")
        assert done.returncode == 3
        assert f"cannot write {path}: " in done.stderr


@needs_core
def test_timing_of_an_emulated_run(tmp_path: Path):
    stats, plot = tmp_path / "t.csv", tmp_path / "t.svg"
    done = fsn("run", ESTOP, "--duration", "1", "--stats", str(stats), "--plot", str(plot))
    assert "times in us" in done.stdout
    assert "wake-up latency" in done.stdout
    assert "round trip" not in done.stdout
    assert stats.read_text("utf-8").startswith("histogram,floor_ns,count,cumulative_share\nlat")
    ET.parse(plot)


def test_a_lost_bus_is_one_line(tmp_path):
    lines = on_the_wire("lost_bus", ROBOT, tmp=tmp_path)["lines"].splitlines()
    at = next(n for n, line in enumerate(lines) if "the bus is lost" in line)
    assert (
        lines[at]
        .partition(" warning ")[2]
        .startswith(
            "the bus is lost: none of 5 SubDevices answers: near has a link, but no SubDevice"
        )
    )
    end = next(n for n, line in enumerate(lines) if "ends: Terminated" in line)
    after = [line for line in lines[at + 1 : end] if "connection " not in line]
    assert [line for line in after if "SubDevice" in line] == []
    assert len(after) <= 1, after  # the working counter, once


def test_a_subdevice_that_is_waited_for_is_not_reported_in_each_try(tmp_path):
    seen = on_the_wire("missing_one", ROBOT, tmp=tmp_path)
    assert seen["code"] == 1
    assert seen["lines"].count("; tries again\n") == 1
    assert seen["lines"].count("drive_2") <= 3, seen["lines"]
