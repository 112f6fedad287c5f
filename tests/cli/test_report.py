"""``fsoe-net report`` as a user runs it: forms, evidence, plans, wrong use."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import EXAMPLES, write_big_network
from report.made import BASE, CODES, TIMED, with_mistakes

from fsoe_net.testing.fake_master import FakeMaster

ESTOP = str(EXAMPLES / "estop" / "network.yaml")


def report(*arguments: str, out: Path) -> tuple[int, str, dict]:
    done = fsn("report", *arguments, "-o", str(out), "--overwrite")
    document = json.loads(out.read_text("utf-8")) if out.suffix == ".json" else {}
    return done.returncode, done.stdout + done.stderr, document


def block(document: dict, key: str) -> str:
    return json.dumps(next(b for b in document["blocks"] if b["key"] == key))


@pytest.mark.parametrize("form", ["html", "md", "json"])
def test_each_form_is_written_and_repeatable(form: str, tmp_path: Path):
    pages = []
    for name in ("a", "b"):
        out = tmp_path / f"{name}.{form}"
        assert report(str(TIMED), out=out)[0] == 0
        pages.append(out.read_bytes())
    assert pages[0] == pages[1]


def test_a_network_with_errors_gets_a_report_and_exit_code_1(tmp_path: Path):
    code, said, document = report(str(with_mistakes(tmp_path)), out=tmp_path / "r.json")
    assert code == 1
    assert "NOT ACCEPTABLE" in said
    assert set(said.replace("[", " ").replace("]", " ").split()) >= CODES
    assert document["verdict"]["word"].startswith("NOT ACCEPTABLE")
    assert f"r.json: {document['verdict']['word']}" in said
    assert "against it" not in said


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("nowhere.yaml", "-o", "OUT/x.html"), 1, "no such file"),
        ((ESTOP, "-o", "OUT/x.txt"), 2, ".html, .md, .json"),
        ((ESTOP, "--evidence", "nowhere.json", "-o", "OUT/x.html"), 1, "nowhere.json"),
        ((ESTOP, "--evidence", ESTOP, "-o", "OUT/x.html"), 1, "evidence is a scan.json"),
        ((ESTOP, "--plan", ESTOP, "-o", "OUT/x.html"), 1, "no .fsnplan"),
        ((ESTOP, "--against", "nowhere.yaml", "-o", "OUT/x.html"), 1, "nowhere.yaml"),
        ((ESTOP, "--socket", "/nonexistent/socket", "-o", "OUT/x.html"), 3, "/nonexistent/socket"),
    ],
)
def test_wrong_use_writes_nothing(
    arguments: tuple[str, ...], code: int, words: str, tmp_path: Path
):
    done = fsn("report", *(a.replace("OUT", str(tmp_path)) for a in arguments))
    assert done.returncode == code, done.stderr
    assert words in done.stdout + done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_scan_is_evidence_and_what_differs_is_a_finding(tmp_path: Path):
    network, scan = str(BASE / "network.yaml"), BASE / "scan.json"
    code, _, document = report(network, "--evidence", str(scan), out=tmp_path / "r.json")
    assert code == 0
    shown = block(document, "bus_evidence")
    assert "0x077a2c52" in shown
    assert "mapping" in shown
    rows = json.loads(scan.read_text("utf-8"))
    rows["subdevices"][0]["product_code"] += 1
    other = tmp_path / "other.json"
    other.write_text(json.dumps(rows), "utf-8")
    code, said, document = report(network, "--evidence", str(other), out=tmp_path / "r2.json")
    assert code == 1
    assert "FSN5" in said
    assert "FSN5" in json.dumps(document["lead"])


def test_a_run_of_a_real_bus_can_only_worsen_the_budget(tmp_path: Path):
    done = fsn("run", ESTOP, "--virtual-time", "--duration", "1", "--format", "json")
    row = json.loads(done.stdout)
    emulated, real = tmp_path / "emulated.json", tmp_path / "real.json"
    emulated.write_text(json.dumps(row), "utf-8")
    row["bus"] = {"backend": "soem", "interface": "eth1"}
    row["connections"][0]["fsoe_cycle_ms"]["max"] = 77.0
    real.write_text(json.dumps(row), "utf-8")
    found = []
    for path in (emulated, real):
        _, _, document = report(ESTOP, "--evidence", str(path), out=tmp_path / "r.json")
        found.append(document)
        assert "this plan" in block(document, "bus_evidence")
    assert "EMULATED, not evidence for this machine" in block(found[0], "bus_evidence")
    assert "77 ms round trip" not in block(found[0], "timing")
    assert "77 ms round trip as measured" in block(found[1], "timing")
    open_points = [p["text"] for p in found[0]["points"]]
    assert any("no evidence of the machine" in text for text in open_points)


def test_plan_and_earlier_state(tmp_path: Path):
    plan = tmp_path / "estop.fsnplan"
    assert fsn("plan", ESTOP, "-o", str(plan)).returncode == 0
    code, _, document = report(
        ESTOP, "--plan", str(plan), "--against", str(plan), out=tmp_path / "r.json"
    )
    assert code == 0
    assert "is the plan of these files" in block(document, "identity")
    assert "no difference" in block(document, "change_log")
    _, _, document = report(
        str(TIMED), "--plan", str(plan), "--against", ESTOP, out=tmp_path / "r.json"
    )
    assert "is NOT the plan" in block(document, "identity")
    assert "to be tried again" in json.dumps(document["points"])


def test_a_running_bus_is_asked(tmp_path: Path):
    with FakeMaster() as master:
        code, said, document = report(
            str(TIMED), "--socket", str(master.path), out=tmp_path / "r.json"
        )
        asked = {line.split()[0] for line in master.asked}
    assert code == 0, said
    assert "SubDevices planned" in block(document, "bus_evidence")
    assert "the running fsn-master has another plan" in json.dumps(document["points"])
    assert asked <= {"status", "snapshot", "hello"}


def test_thirty_two_connections_are_reported(tmp_path: Path, record_property):
    network = write_big_network(tmp_path, 33, 64)
    began = time.perf_counter()
    assert report(str(network), out=tmp_path / "r.html")[0] == 0
    record_property("report_32_connections_s", time.perf_counter() - began)
