"""``init``: what each kind of input gives, what is asked, what stays open, refusals."""

from __future__ import annotations

import os
import pty
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from cli.tool import fsn
from formats.texts import TWO_PDOS
from networks import PLAIN

ROOT = Path(__file__).parents[2]
EXAMPLE = PLAIN / "el6910"
DEVICES = EXAMPLE / "devices"
BASE = ROOT / "tests" / "diagnostics" / "base"
DATA = Path(os.environ.get("FSN_TEST_DATA", "/nowhere"))

RING = "subdevices:\n  - {type: EL6910}\n  - {type: EL1904, count: 2}\n  - {type: EL2904}\n"


def four_slots(folder: Path) -> Path:
    """A logic with four slots of 6/6 bytes, as a slave YAML."""
    rows = {"rpdo": ("1600", "7"), "tpdo": ("1a00", "6")}
    text = "vendor_id: 0x00000002\nproduct_id: 0x1afe3052\n"
    for key, (first, high) in rows.items():
        text += f"{key}:\n"
        for slot in range(4):
            entries = ((f"{high}0{slot}0", 1, 8), (f"{high}0{slot}1", 1, 8))
            checks = ((f"{high}0{slot}0", 3, 16), (f"{high}0{slot}0", 2, 16))
            text += f"  - index: 0x{int(first, 16) + slot:04x}\n    channels:\n"
            for index, sub, bits in (*entries, *checks):
                text += f"      - {{index: 0x{index}, sub_index: {sub}, type: uint{bits}}}\n"
    text += "sm:\n  - {index: 2, type: output, pdo: rpdo}\n  - {index: 3, type: input, pdo: tpdo}\n"
    path = folder / "el6910.yaml"
    path.write_text(text, "utf-8")
    return path


def devices(folder: Path) -> list[str]:
    return [str(four_slots(folder)), *(str(DEVICES / f"{n}.yaml") for n in ("el1904", "el2904"))]


def init(*arguments: object, out: Path, answers: str | None = None):
    more: list[str] = ["--no-input"] if answers is None else []
    if answers is not None:
        path = out.parent / "answers.yaml"
        path.write_text(answers, "utf-8")
        more = ["--answers", str(path)]
    return fsn("init", *map(str, arguments), "-o", str(out), *more)


def connections(out: Path) -> list[dict]:
    nets = yaml.safe_load((out / "network.yaml").read_text("utf-8"))["nets"]
    return [row for net in nets for row in net.get("connections", [])]


def pairs(out: Path) -> list[tuple]:
    return [(r["main"], r["slot"], r["sub"], "unconfirmed" in r) for r in connections(out)]


# -- equal lengths --------------------------------------------------------------------------------


@pytest.mark.shows("R22")
def test_equal_lengths_stay_unconfirmed_and_plan_refuses(tmp_path: Path):
    out = tmp_path / "out"
    done = init(*devices(tmp_path), out=out, answers=RING)
    assert done.returncode == 1, done.stderr
    assert pairs(out) == [
        ("el6910", 0, "el1904_1", True),
        ("el6910", 1, "el1904_2", True),
        ("el6910", 2, "el2904", True),
    ]
    text = (out / "network.yaml").read_text("utf-8")
    assert "fit slots 0, 1, 2, 3 of el6910" in text
    assert "the same lengths: el1904_2, el2904" in text
    assert text.count("# address: TODO") == 3
    assert "3 of them unconfirmed" in done.stdout
    assert "Which slot does el2904 belong to?" in done.stderr
    plan = fsn("plan", str(out / "network.yaml"), "-o", str(tmp_path / "x.fsnplan"))
    assert plan.returncode == 1
    assert not (tmp_path / "x.fsnplan").exists()


def test_answers_confirm_what_they_name_and_nothing_else(tmp_path: Path):
    out = tmp_path / "out"
    rows = (
        "connections:\n"
        "  - {sub: el2904, slot: 0, address: 17, connection_id: 3, watchdog_ms: 100}\n"
        "  - {sub: el1904_1, address: 18}\n"
    )
    done = init(*devices(tmp_path), out=out, answers=RING + rows)
    assert done.returncode == 1, done.stderr
    assert pairs(out) == [
        ("el6910", 0, "el2904", False),
        ("el6910", 1, "el1904_1", True),
        ("el6910", 2, "el1904_2", True),
    ]
    first, second, third = connections(out)
    assert (first["address"], first["connection_id"], first["watchdog_ms"]) == (17, 3, 100)
    assert second["address"] == 18
    assert "address" not in third
    assert "as answered" in (out / "network.yaml").read_text("utf-8")


def test_all_answered_can_be_planned(tmp_path: Path):
    out = tmp_path / "out"
    rows = "connections:\n" + "".join(
        f"  - {{sub: {sub}, slot: {slot}, address: {slot + 1}, connection_id: {slot + 1}, "
        "watchdog_ms: 100}\n"
        for slot, sub in ((3, "el1904_1"), (0, "el1904_2"), (1, "el2904"))
    )
    done = init(*devices(tmp_path), out=out, answers=RING + rows + "cycle_us: 1000\n")
    assert done.returncode == 0, done.stderr
    assert "FSN157" not in done.stderr
    assert fsn("check", str(out / "network.yaml"), "-q").stdout == ""
    plan = fsn("plan", str(out / "network.yaml"))
    assert plan.returncode == 0, plan.stderr
    assert re.search(r"el1904_1.*0x6000", plan.stdout)


# -- kinds of input -------------------------------------------------------------------------------


@pytest.mark.parametrize("file", [EXAMPLE / "network.yaml", BASE / "bus.eni.xml"])
def test_known_copies_settle_pairs(file: Path, tmp_path: Path):
    out = tmp_path / "out"
    done = init(file, out=out)
    assert done.returncode == 0, done.stderr
    assert connections(out)
    assert not any("unconfirmed" in r for r in connections(out))
    assert "copied in both directions by" in (out / "network.yaml").read_text("utf-8")


def test_a_network_gives_the_same_plan_again(tmp_path: Path):
    out = tmp_path / "out"
    assert init(EXAMPLE / "network.yaml", out=out).returncode == 0
    done = fsn("diff", str(EXAMPLE / "network.yaml"), str(out / "network.yaml"))
    assert done.returncode == 0, done.stdout + done.stderr


def test_what_is_not_of_the_bus_is_named(tmp_path: Path):
    text = (EXAMPLE / "network.yaml").read_text("utf-8")
    shutil.copytree(EXAMPLE, tmp_path / "in")
    added = "project: hall 3\nreport: {number: R-1}\n"
    (tmp_path / "in" / "network.yaml").write_text(text + added, "utf-8")
    done = init(tmp_path / "in" / "network.yaml", out=tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "left out: project, report; copy them into the new file" in done.stderr


def test_an_unconfirmed_connection_stays_unconfirmed(tmp_path: Path):
    assert init(*devices(tmp_path), out=tmp_path / "one", answers=RING).returncode == 1
    done = init(tmp_path / "one" / "network.yaml", out=tmp_path / "two")
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("is unconfirmed there, so it is open here") == 3
    assert pairs(tmp_path / "two") == pairs(tmp_path / "one")
    text = (EXAMPLE / "network.yaml").read_text("utf-8")
    spoiled = tmp_path / "spoiled"
    shutil.copytree(EXAMPLE, spoiled)
    text = text.replace("sub: el1904, address", "sub: el1904, unconfirmed: true, address")
    (spoiled / "network.yaml").write_text(text, "utf-8")
    refused = init(spoiled / "network.yaml", out=tmp_path / "three")
    assert refused.returncode == 1
    assert "compare it with the safety project first" in refused.stderr


def test_a_scan_reports_connections_by_fsoe_address(tmp_path: Path):
    out = tmp_path / "out"
    done = init(BASE / "scan.json", out=out)
    assert done.returncode == 0, done.stderr
    assert [(r["sub"], r["slot"], r["address"]) for r in connections(out)] == [
        ("ek1914_1", 0, 1),
        ("ek1914_2", 1, 2),
    ]


def test_lcec_with_process_data_of_the_library(tmp_path: Path):
    out = tmp_path / "out"
    answers = "process_data: {el1904: device PDO, out: module 0x122}\n"
    done = init(BASE / "lcec.xml", out=out, answers=answers)
    assert done.returncode == 0, done.stderr
    assert pairs(out) == [("logic", 0, "out", False), ("logic", 1, "el1904", False)]
    text = (out / "network.yaml").read_text("utf-8")
    assert "process data from the device library (EL6900, '6 connections'), unverified" in text
    assert "source: output of ethercat cstruct, public" in text
    assert "CRC and connection ID swap" in (out / "devices" / "el1904.yaml").read_text("utf-8")


@pytest.mark.shows("R22")
def test_unknown_process_data_are_not_invented(tmp_path: Path):
    out = tmp_path / "out"
    done = init(BASE / "lcec.xml", out=out)
    assert done.returncode == 1, done.stderr
    assert "Which process data does out (EL2904) have?" in done.stderr
    assert "rpdo" not in (out / "devices" / "out.yaml").read_text("utf-8")
    assert "connects slot 0 of logic with out" in done.stdout
    assert "nets: []" in (out / "network.yaml").read_text("utf-8")


def test_ethercat_pdos_have_places_and_no_identity(tmp_path: Path):
    (tmp_path / "pdos.txt").write_text(TWO_PDOS, "utf-8")
    out = tmp_path / "out"
    done = init(tmp_path / "pdos.txt", out=out, answers="main: subdevice_3\n")
    assert done.returncode == 0, done.stderr
    text = (out / "network.yaml").read_text("utf-8")
    assert "position: 3" in text
    assert "TODO vendor and product are not known" in text
    assert pairs(out) == [("subdevice_3", 0, "subdevice_11", False)]
    again = init(tmp_path / "pdos.txt", out=tmp_path / "two")
    assert "Which of these are FSoE MainInstances" in again.stderr


def test_esi_alone_asks_what_is_on_the_ring(tmp_path: Path):
    done = init(BASE / "gate.xml", out=tmp_path / "out")
    assert done.returncode == 1
    assert "gate.xml: error[FSN157]: Which SubDevices are on the ring" in done.stderr
    assert not (tmp_path / "out").exists()
    answers = "subdevices: [{type: gate2, position: 1}, {type: EL2904, name: stop}]\n"
    told = init(BASE / "gate.xml", out=tmp_path / "out", answers=answers)
    assert told.returncode == 1, told.stderr
    rows = yaml.safe_load((tmp_path / "out" / "network.yaml").read_text("utf-8"))["subdevices"]
    assert [(r["name"], r["position"]) for r in rows] == [("gate2", 1), ("stop", 2)]


def test_a_folder_with_other_things_in_it(tmp_path: Path):
    folder = tmp_path / "mixed"
    shutil.copytree(EXAMPLE, folder)
    (folder / "README.md").unlink(missing_ok=True)
    (folder / "photo.jpg").write_bytes(b"\xff\xd8\xff\0junk")
    (folder / "notes.txt").write_text("call the vendor", "utf-8")
    (folder / "broken.eni.xml").write_text("<EtherCATConfig><Config>", "utf-8")
    (folder / "empty.yaml").write_text("", "utf-8")
    (folder / ".git").mkdir()
    (folder / ".git" / "network.yaml").write_text("x: [", "utf-8")
    out = tmp_path / "out"
    done = init(folder, out=out)
    assert done.returncode == 0, done.stderr
    left = re.findall(r"/(\S+): warning\[FSN158\]: left out", done.stderr)
    assert sorted(Path(p).name for p in left) == [
        "broken.eni.xml",
        "empty.yaml",
        "notes.txt",
        "photo.jpg",
        "scenario.yaml",
    ]
    assert len(connections(out)) == 4


def test_a_broken_file_that_is_named_is_refused(tmp_path: Path):
    (tmp_path / "broken.eni.xml").write_text("<EtherCATConfig><Config>", "utf-8")
    done = init(EXAMPLE / "network.yaml", tmp_path / "broken.eni.xml", out=tmp_path / "out")
    assert done.returncode == 1
    assert "FSN118" in done.stderr
    assert not (tmp_path / "out").exists()


def test_files_that_cannot_be_read_are_all_named_at_once(tmp_path: Path):
    (tmp_path / "a.txt").write_text("hello", "utf-8")
    (tmp_path / "b.eni.xml").write_text("<EtherCATConfig><Config>", "utf-8")
    (tmp_path / "c.yaml").write_text("subdevices: [", "utf-8")
    files = [tmp_path / n for n in ("a.txt", "b.eni.xml", "c.yaml", "none.xml")]
    for command, out in (("init", tmp_path / "out"), ("convert", tmp_path / "out" / "n.yaml")):
        done = fsn(command, *map(str, files), str(EXAMPLE / "network.yaml"), "-o", str(out))
        assert done.returncode == 1
        codes = re.findall(r"error\[(FSN\d+)\]", done.stderr)
        assert codes == ["FSN117", "FSN118", "FSN102", "FSN101"], command
        assert not (tmp_path / "out").exists()


@pytest.mark.skipif(not (DATA / "yaml").is_dir(), reason="needs FSN_TEST_DATA")
def test_published_estop_files(tmp_path: Path):
    folder = tmp_path / "estop"
    folder.mkdir()
    for path in (DATA / "yaml").glob("yguel_safety-humble_*"):
        name = path.name.removeprefix("yguel_safety-humble_")
        if "estop" in name or name.startswith("beckhoff"):
            shutil.copy(path, folder / name)
    out = tmp_path / "out"
    done = init(folder, out=out)
    assert done.returncode == 0, done.stderr
    assert pairs(out) == [("el1918", 0, "ek1914", False)]
    next(folder.glob("*.xacro")).unlink()
    alone = init(folder, out=tmp_path / "alone")
    assert alone.returncode == 1
    assert "FSN157" in alone.stderr
    ring = "subdevices: [{type: EK1914}, {type: EL1918}]\n"
    told = init(folder, out=tmp_path / "told", answers=ring)
    assert told.returncode == 0, told.stderr
    assert pairs(tmp_path / "told") == [("el1918", 0, "ek1914", False)]


# -- answers --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rows", "code", "at"),
    [
        ("connections: [{sub: el1905, slot: 0}]", "FSN155", "6:21"),
        ("connections: [{sub: el2904, slot: 4}]", "FSN155", "6:35"),
        ("connections: [{sub: el2904, main: el1904_1, slot: 0}]", "FSN156", "6:35"),
        ("connections: [{sub: el2904, slot: 0}, {sub: el1904_1, slot: 0}]", "FSN156", "6:61"),
        ("main: [logic]", "FSN155", "6:8"),
        ("process_data: {el2904: device PDO}", "FSN156", "6:16"),
        ("frames: {nobody: yes}", "FSN155", "6:10"),
        ("conections: []", "FSN109", "6:1"),
        ("connections: [{sub: el2904, slot: -1}]", "FSN113", "6:35"),
    ],
)
def test_wrong_answers_are_named_at_their_place(rows: str, code: str, at: str, tmp_path: Path):
    out = tmp_path / "out"
    done = init(*devices(tmp_path), out=out, answers="name: a\n" + RING + rows + "\n")
    assert done.returncode == 1, done.stdout
    assert f"answers.yaml:{at}: error[{code}]" in done.stderr
    assert "hint: " in done.stderr
    assert not out.exists()


@pytest.mark.parametrize(
    ("row", "at", "message", "hint"),
    [
        (
            "{type: EL1904, position: 0}",
            "1:55: error[FSN156]",
            "position 0 follows position 0",
            "list the SubDevices in ring order",
        ),
        (
            "{type: GATE2, revision: 5}",
            "1:54: error[FSN155]",
            "no GATE2 of revision 0x00000005 is in these files",
            "there are: 0x00020000",
        ),
    ],
)
def test_a_ring_that_cannot_be(row: str, at: str, message: str, hint: str, tmp_path: Path):
    answers = f"subdevices: [{{type: EL6910}}, {row}]\n"
    done = init(*devices(tmp_path), BASE / "gate.xml", out=tmp_path / "o", answers=answers)
    assert done.returncode == 1
    assert f"answers.yaml:{at}: {message}\n" in done.stderr
    assert f"hint: {hint}\n" in done.stderr


def test_a_type_no_one_has(tmp_path: Path):
    done = init(*devices(tmp_path), out=tmp_path / "o", answers="subdevices: [{type: EL1094}]\n")
    assert done.returncode == 1
    assert "answers.yaml:1:21: error[FSN155]: no file and no device library contains" in done.stderr
    assert "did you mean 'EL1904'?" in done.stderr


def test_revision_0_of_an_answer_is_a_revision(tmp_path: Path):
    init(out=tmp_path / "o", answers="subdevices: [{type: EL6910}, {type: EL1904, revision: 0}]\n")
    subs = yaml.safe_load((tmp_path / "o" / "network.yaml").read_text("utf-8"))["subdevices"]
    assert [s.get("revision") for s in subs] == [None, 0]


def test_a_ring_that_a_file_reports_is_not_answered(tmp_path: Path):
    done = init(EXAMPLE / "network.yaml", out=tmp_path / "o", answers=RING)
    assert done.returncode == 1
    assert "answers.yaml:2:3: error[FSN156]" in done.stderr


def test_the_template_is_taken_as_it_is_and_when_completed(tmp_path: Path):
    answers = tmp_path / "ring.yaml"
    answers.write_text(RING, "utf-8")
    files = devices(tmp_path)
    text = fsn("init", *files, "--answers", str(answers), "--answers-template").stdout
    assert f"in addition to the answers in {answers}" in text
    assert "name: " not in text.splitlines()[2]  # it is in the answers
    plain = init(*files, out=tmp_path / "one", answers=text + RING)
    assert plain.returncode == 1, plain.stderr
    full = re.sub(r"^#   - ", "  - ", text.replace("# connections:", "connections:"), flags=re.M)
    assert full.count("slot: TODO") == 3
    for slot in range(3):
        full = full.replace("slot: TODO, address: TODO", f"slot: {slot}, address: {slot + 5}", 1)
    full = re.sub(r", \w+: TODO", "", full)
    done = init(*files, out=tmp_path / "two", answers=full + RING)
    assert done.returncode == 0, done.stderr
    assert [(r["slot"], r["address"]) for r in connections(tmp_path / "two")] == [
        (0, 5),
        (1, 6),
        (2, 7),
    ]


def test_no_question_is_asked_without_a_terminal(tmp_path: Path):
    done = fsn("init", str(BASE / "lcec.xml"), "-o", str(tmp_path / "out"))
    assert done.returncode == 1
    assert "answers are needed" in done.stderr
    assert "--no-input leaves it open" in done.stderr
    assert fsn("init").returncode == 2


# -- the terminal ---------------------------------------------------------------------------------


def asked(keys: bytes, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run with a terminal as standard input at which these keys are pressed."""
    ours, theirs = pty.openpty()
    try:
        os.write(ours, keys)
        done = subprocess.run(
            [sys.executable, "-m", "fsoe_net.cli", "init", *map(str, arguments)],
            stdin=theirs,
            capture_output=True,
            text=True,
            check=False,
        )
    finally:
        os.close(ours)
        os.close(theirs)
    assert "Traceback" not in done.stderr, done.stderr
    return done


def test_questions_at_a_terminal(tmp_path: Path):
    out = tmp_path / "out"
    keys = b"EL6910, 2 x EL1904, stop=EL2904\n9\n2\n\n1\n"
    done = asked(keys, *devices(tmp_path), "-o", out)
    assert done.returncode == 1, done.stderr
    assert "That is not one of the answers." in done.stderr
    assert pairs(out) == [
        ("el6910", 0, "stop", False),
        ("el6910", 1, "el1904_1", False),
        ("el6910", 2, "el1904_2", True),
    ]


def test_the_end_of_input_at_a_question_writes_nothing(tmp_path: Path):
    done = asked(b"EL6910, EL1904\n\x04", *devices(tmp_path), "-o", tmp_path / "out")
    assert done.returncode == 130
    assert "nothing written" in done.stderr
    assert not (tmp_path / "out").exists()


def test_roles_and_frames_are_asked(tmp_path: Path):
    (tmp_path / "pdos.txt").write_text(TWO_PDOS, "utf-8")
    done = asked(b"1\n", tmp_path / "pdos.txt", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "FSoE MainInstance" in (tmp_path / "out" / "network.yaml").read_text("utf-8")
    ring = b"EL6910, circulo\n"
    likely = asked(ring + b"yes\n1\n1\n", four_slots(tmp_path), DEVICES / "circulo.yaml", "-o",
                   tmp_path / "drive")  # fmt: skip
    assert "circulo: is this an FSoE frame?" in likely.stderr
    assert likely.returncode == 1, likely.stderr
    assert "likely FSoE frame, taken as answered" in (
        tmp_path / "drive" / "network.yaml"
    ).read_text("utf-8")
    assert "against it: not on the object of the command" in likely.stderr


# -- writing --------------------------------------------------------------------------------------


def test_nothing_is_overwritten(tmp_path: Path):
    out = tmp_path / "out"
    assert init(EXAMPLE / "network.yaml", out=out).returncode == 0
    before = {p: p.read_bytes() for p in out.rglob("*.yaml")}
    again = init(EXAMPLE / "network.yaml", out=out)
    assert again.returncode == 1
    assert "exists; name another folder" in again.stderr
    assert {p: p.read_bytes() for p in out.rglob("*.yaml")} == before


def test_a_folder_that_cannot_be_written(tmp_path: Path):
    (tmp_path / "file").write_text("", "utf-8")
    done = init(EXAMPLE / "network.yaml", out=tmp_path / "file" / "out")
    assert done.returncode == 3
    assert "nothing written" in done.stderr
    done = init(EXAMPLE / "network.yaml", out=Path("/proc/fsn"), answers=None)
    assert done.returncode == 3
    assert "cannot write /proc/fsn" in done.stderr


def test_open_questions_name_what_can_be_answered(tmp_path: Path):
    done = init(out=tmp_path / "out", answers="subdevices: [{type: EL6900}, {type: EL1904}]\n")
    assert "does el1904 (EL1904) have? One of: device PDO, module 0xBE" in done.stderr
    assert "el1904: which process data? device PDO, module 0xBE" in done.stdout


def test_facts_of_a_subinstance_without_a_connection_are_not_lost(tmp_path: Path):
    ring = "{type: EL6910}, {type: EL1904, name: stop, count: 4}, {type: EL2904}"
    answers = f"subdevices: [{ring}]\nconnections: [{{sub: el2904, address: 18}}]\n"
    out = tmp_path / "out"
    done = init(*devices(tmp_path), out=out, answers=answers)
    assert done.returncode == 1, done.stderr
    written = (out / "network.yaml").read_text("utf-8")
    assert re.search(r"not connected: more SubInstances.*\n\s*# answered: address 18\n", written)


# -- types by order number ------------------------------------------------------------------------

LCEC = """<masters><master idx="0" appTimePeriod="1000000">
<slave idx="0" type="EK1100"/>
<slave idx="1" type="EL6900"><modParam name="fsoeSlaveIdx" value="4"/>
<modParam name="fsoeSlaveIdx" value="3"/></slave>
<slave idx="2" type="EL2808"/><slave idx="3" type="EL1904"/><slave idx="4" type="EL2904"/>
</master></masters>
"""
TWINSAFE = """<Project><SAddress>1</SAddress><Connections>
<Connection><Name>K7 (EL2904)</Name><Mode>Master</Mode><SAddress>4</SAddress>
<SWatchdog>100</SWatchdog><ConId>3</ConId><VendorId>2</VendorId><ModuleIdent>290</ModuleIdent>
</Connection>
<Connection><Name>K5 (EL1904)</Name><Mode>Master</Mode><SAddress>2</SAddress>
<SWatchdog>120</SWatchdog><ConId>1</ConId><VendorId>2</VendorId><ModuleIdent>190</ModuleIdent>
</Connection></Connections></Project>
"""


def terminal_esi(*orders: tuple[str, str]) -> str:
    """An ESI with terminals of one 6-byte frame each way."""

    def pdo(tag: str, index: str, high: str, sm: int) -> str:
        rows = [(f"#x{high}000", 1, 8), (f"#x{high}001", 1, 8)]
        rows += [(f"#x{high}000", sub, 16) for sub in (3, 2)]
        names = ("FSoE CMD", "data", "FSoE CRC_0", "FSoE Connection ID")
        entries = "".join(
            f"<Entry><Index>{i}</Index><SubIndex>{s}</SubIndex><BitLen>{b}</BitLen>"
            f"<Name>{n}</Name></Entry>"
            for (i, s, b), n in zip(rows, names, strict=True)
        )
        return f'<{tag} Fixed="1" Sm="{sm}"><Index>{index}</Index><Name/>{entries}</{tag}>'

    sms = "".join(
        f'<Sm StartAddress="#x{at}">{what}</Sm>'
        for at, what in (("1000", "MBoxOut"), ("1100", "MBoxIn"), ("1200", "Outputs"))
    )
    devices = "".join(
        f'<Device Physics="KK"><Type ProductCode="#x{product}" RevisionNo="#x120000">{order}</Type>'
        f'<Name>{order}</Name>{sms}<Sm StartAddress="#x1300">Inputs</Sm>'
        + pdo("RxPdo", "#x1600", "7", 2)
        + pdo("TxPdo", "#x1a00", "6", 3)
        + "</Device>"
        for order, product in orders
    )
    return (
        "<EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices>"
        f"{devices}</Devices></Descriptions></EtherCATInfo>"
    )


def test_types_of_linuxcnc_ethercat_are_found_in_an_esi(tmp_path: Path):
    files = {
        "machine.xml": LCEC,
        "TwinSAFE-Project.xml": TWINSAFE,
        "maker.xml": terminal_esi(("EL1904", "07703052"), ("EL2904", "0b583052")),
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text, "utf-8")
    out = tmp_path / "cell"
    done = init(*(tmp_path / name for name in files), out=out)
    assert done.returncode == 0, done.stderr
    assert pairs(out) == [("el6900", 0, "el2904", False), ("el6900", 1, "el1904", False)]
    assert [(r["address"], r["connection_id"], r["watchdog_ms"]) for r in connections(out)] == [
        (4, 3, 100),
        (2, 1, 120),
    ]
    assert "which process data" not in done.stdout
    assert "0 of them unconfirmed" in done.stdout
    rows = yaml.safe_load((out / "network.yaml").read_text("utf-8"))["subdevices"]
    assert [row["config"] for row in rows] == [
        f"devices/{name}.yaml" for name in ("ek1100", "el6900", "el2808", "el1904", "el2904")
    ]
    text = (out / "devices" / "el1904.yaml").read_text("utf-8")
    assert "product_id: 0x07703052" in text


@pytest.mark.parametrize("agree", [True, False])
def test_equal_terminals_have_the_values_of_their_slot(agree: bool, tmp_path: Path):
    """Two equal terminals: the order of both files tells them apart, where they agree."""
    more = '<modParam name="fsoeSlaveIdx" value="5"/></slave>'
    machine = LCEC.replace("</slave>", more, 1).replace(
        "</master>", '<slave idx="5" type="EL1904"/></master>'
    )
    third = TWINSAFE[TWINSAFE.index("<Connection><Name>K5") : TWINSAFE.index("</Connections>")]
    third = third.replace("<SAddress>2<", "<SAddress>9<").replace("<ConId>1<", "<ConId>7<")
    project = TWINSAFE.replace("</Connections>", third + "</Connections>")
    if not agree:  # the EL2904 is in another slot there
        begin, end = project.index("<Connection><Name>K7"), project.index("<Connection><Name>K5")
        first = project[begin:end]
        project = project.replace(first, "").replace("</Connections>", first + "</Connections>")
    files = {
        "machine.xml": machine,
        "TwinSAFE-Project.xml": project,
        "maker.xml": terminal_esi(("EL1904", "07703052"), ("EL2904", "0b583052")),
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text, "utf-8")
    init(*(tmp_path / name for name in files), out=tmp_path / "cell")
    rows = {r["sub"]: (r["slot"], r.get("address")) for r in connections(tmp_path / "cell")}
    known = {"el1904_1": (1, 2), "el1904_2": (2, 9)}
    unknown = {"el1904_1": (1, None), "el1904_2": (2, None)}
    assert {k: rows[k] for k in known} == (known if agree else unknown)


def test_types_without_an_identity_have_a_file_each(tmp_path: Path):
    (tmp_path / "machine.xml").write_text(LCEC, "utf-8")
    out = tmp_path / "cell"
    done = init(tmp_path / "machine.xml", out=out)
    assert done.returncode == 1  # nets are still to be written, which is an error of the network
    assert "error[FSN125]" in done.stdout + done.stderr
    rows = yaml.safe_load((out / "network.yaml").read_text("utf-8"))["subdevices"]
    assert len({row["config"] for row in rows}) == 5
