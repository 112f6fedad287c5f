"""What the parts of a run say, ask of the system and write: whole texts."""

from __future__ import annotations

import base64
import ctypes
import hashlib
import json
import os
import socket
import struct
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as Facts
from typing import Any

import pytest
from incident.rig import Rig, network
from live.console_rig import Rig as ConsoleRig
from live.whole_programs import program, refusal
from scans import scan_of, subdevice
from simulate.made_session import session
from test_record.filled import fresh_record, timed

from fsoe_net.errors import ConsoleError, ControlRefused
from fsoe_net.formats.own.scan import parse_scan
from fsoe_net.formats.shared.files import Collector
from fsoe_net.live import build_master, packet_socket, scan, sockets
from fsoe_net.live.bus_events import BusEvents
from fsoe_net.live.control_values import read_watched
from fsoe_net.live.master import Master
from fsoe_net.live.packet_socket import PacketSocket
from fsoe_net.live.result import RunEvent, RunEventKind
from fsoe_net.live.scan_files import scan_files
from fsoe_net.model.scenario import Action
from fsoe_net.simulate.commands import CommandError, parse_command
from fsoe_net.simulate.device_logic import _find, _place, _raised, _short, stdout_to_stderr
from fsoe_net.test_record.steps import (
    compare_test_record,
)
from fsoe_net.testing.fake_master import FakeMaster
from fsoe_net.version import __version__

WHOLE = Path(__file__).parent / "incident.txt"


# -- events and commands ---------------------------------------------------------------------------


def test_each_event_of_a_bus_is_reported():
    events = BusEvents(start_ns=1_000_000)
    io_row = {"event": "subdevice", "subdevice": "io", "before": "OP", "after": "OP"}
    link = {"event": "connection", "connection": "c1", "before": "reset"}
    reset = {"reset_by": "sub", "reset_code": 5, "after": "reset"}
    for n, event in enumerate(
        (
            {**io_row, "after": "SAFEOP", "al_code": 0x1B, "detail": "no frames"},
            {**io_row, "link": [1, 0, 1]},
            {"event": "bus", "text": "not shown"},
            {"event": "lost", "text": "3 events were lost"},
            {"event": "wkc", "text": "incomplete"},
            {"event": "other"},
            {**link, "after": "process data"},
            {**link, "after": "failsafe data"},
            {**link, **reset, "before": "data"},
            {**link, **reset, "level": "detail", "reset_by": "main", "reset_code": 1},
            {**link, **reset, "before": "silent", "connection": "c2", "reset_by": "x"},
        ),
        2,
    ):
        events.take({**event, "now_ns": n * 1_000_000})
    wire = {"kind": RunEventKind.STATE, "end": "wire", "in_data": True}
    reset_by = {"kind": RunEventKind.RESET, "code": 5}
    assert events.events == [
        RunEvent(time_ms=t, source=source, text=text, **facts)
        for t, source, text, facts in (
            (1, "io", "OP -> SAFEOP, AL status code 0x001b: no frames", {}),
            (2, "io", "ports: up, open, up", {"kind": RunEventKind.LINKS}),
            (4, "fsn-master", "3 events were lost", {}),
            (5, "bus", "incomplete", {"kind": RunEventKind.WORKING_COUNTER}),
            (6, "fsn-master", "", {}),
            (7, "c1", "wire: Data · ProcessData", wire | {"state": "Data · ProcessData"}),
            (8, "c1", "wire: Data · FailSafeData", wire | {"state": "Data · FailSafeData"}),
            (9, "c1", "SubInstance resets: watchdog expired", reset_by | {"end": "sub"}),
            (11, "c2", "one end resets: watchdog expired", reset_by | {"end": "x"}),
        )
    ]
    assert events.to_data_ns == {"c1": 7_000_000}
    assert events.last_reset == {"c1": 1}
    assert events.last_reset_by == {"c1": "MainInstance"}
    assert events.events_lost == 1


def test_the_place_of_a_command_and_what_an_image_lacks():
    command = parse_command("  break io  # now", 7)
    assert command is not None
    assert command.step is not None
    assert (str(command.step.span), command.step.action) == ("command:7:1", Action.BREAK)
    row = read_watched({"cycle": 3, "now_ns": 4}, 2)
    assert (row.cycle, row.now_ns, row.skipped, row.image) == (3, 4, 2, None)
    assert row.inputs == row.outputs == {}
    assert (row.expected_wkc, row.actual_wkc) == (0, 0)


USAGE = """\
break SUBDEVICE
heal SUBDEVICE
power-cycle SUBDEVICE
local-reset CONNECTION
press [LOGIC]
release [LOGIC]
set SIGNAL VALUE
fsoe-address SUBDEVICE ADDRESS
cut SUBDEVICE|main
splice SUBDEVICE|main
swap SUBDEVICE SUBDEVICE
wrong SUBDEVICE VENDOR PRODUCT [REVISION]
right SUBDEVICE
sdo-abort SUBDEVICE INDEX[:SUB] CODE
mailbox-delay SUBDEVICE TIME
al-delay SUBDEVICE TIME
rx-errors SUBDEVICE ERRORS
lose FRAMES
lose-every FRAMES
repeat FRAMES
delay TIME
stall TIME
"""


@pytest.mark.parametrize("usage", USAGE.splitlines())
def test_how_a_command_of_the_emulation_is_written(usage: str):
    line = usage.partition(" ")[0]
    with pytest.raises(CommandError) as caught:
        parse_command(f"{line} 1 2 3 4 5", 1)
    assert str(caught.value) == f"write: {usage}"


@pytest.mark.parametrize(
    ("line", "most"),
    [
        ("set io.x", 2**64 - 1),
        ("fsoe-address io", 0xFFFF),
        ("rx-errors io", 255),
        ("lose", 1_000_000),
        ("lose-every", 1_000_000),
        ("repeat", 1_000_000),
    ],
)
def test_the_most_that_a_command_takes(line: str, most: int):
    command = parse_command(f"{line} {most}", 3)
    assert command is not None
    assert command.step is not None
    assert most in (command.step.number, *(command.step.values or {}).values())
    assert str(command.step.span) == "command:3:1"
    with pytest.raises(CommandError) as caught:
        parse_command(f"{line} {most + 1}", 3)
    assert str(caught.value) == f"{most + 1} is not in 0 … {most}"


def test_each_command_has_its_line():
    for line in (
        "swap a b",
        "wrong a 1 2",
        "sdo-abort a 0x1018:01 5",
        "stall 2ms",
        "al-delay a 1s",
    ):
        command = parse_command(line, 9)
        assert command is not None
        assert command.step is not None
        assert (str(command.step.span), command.step.at_ns) == ("command:9:1", 0)


# -- a process of fsn-master -----------------------------------------------------------------------


def test_fsn_master_is_asked_to_end_before_it_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Only the signal gives it the time for stop values, while copying goes on."""
    program, ready, ended = tmp_path / "fsn-master", tmp_path / "ready", tmp_path / "ended"
    program.write_text(
        f"#!/bin/sh\ntrap 'echo orderly >{ended}; exit 0' TERM\n: >{ready}\n"
        "while :; do sleep 0.01; done\n"
    )
    program.chmod(0o755)
    monkeypatch.setenv("FSN_MASTER", str(program))
    with Master(b"", ()) as master:
        while not ready.exists():
            time.sleep(0.01)
    assert ended.read_text() == "orderly\n"
    assert master.ended()
    assert not master.directory.exists()


# -- console ---------------------------------------------------------------------------------------

SAID = """\
get drive_1.nothing
  no input or output is called drive_1.nothing; drive_1 has 0x6040:00, 0x6041:00, position
get logic.0x7000
  no input or output is called logic.0x7000; logic has ack
get nobody
  no input or output is called nobody; list shows the names
get all.x*
  no input or output is called like all.x*; list shows them
set all 0x9999 1
  no SubDevice has an output 0x9999; list shows the names
"""


@pytest.fixture
def master():
    with FakeMaster() as found:
        yield found


@pytest.fixture
def console(master):
    found = ConsoleRig(master.path)
    yield found
    found.link.close()


def test_messages_of_the_console_for_unusual_words(console: ConsoleRig):
    lines = []
    for line in SAID.splitlines()[::2]:
        lines += [line, f"  {refusal(console.do, line)}"]
    assert "\n".join(lines) + "\n" == SAID


def test_input_of_the_console(master: FakeMaster, console: ConsoleRig):
    assert console.do("get logic.ACK") == ["logic.ack  0"]
    console.lines.clear()
    console.console.run_script("echo $2 a", "s.fsn")
    assert console.lines == ["$2 a"]
    master.refuse["get"] = {}
    with pytest.raises(ControlRefused) as refused:
        console.do("get logic.ack")
    assert str(refused.value) == "get: refused"


def test_a_name_that_is_there_in_both_cases_is_taken_as_it_is(master: FakeMaster):
    master.symbols.append({**master.symbols[0], "name": "logic.ACK"})
    rig = ConsoleRig(master.path)
    for name in ("logic.ACK", "logic.ack"):
        assert [s.name for s in rig.console.names().some(name)] == [name]
    with pytest.raises(ConsoleError, match=r"no input or output is called logic\.Ack"):
        rig.console.names().some("logic.Ack")
    rig.link.close()


# -- devices of others -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("json:loads:x", "module 'json' has no 'loads:x'"),
        ("json", "'json' is not module:factory, e.g. my_device:make_sub"),
        (
            "no_such:x",
            "module 'no_such' cannot be imported (No module named 'no_such'); it is looked for in "
            "the current folder and in PYTHONPATH",
        ),
        ("fsoe.devices:not_callable", "fsoe.devices:not_callable is 3 and cannot be called"),
    ],
)
def test_a_name_that_leads_nowhere(name: str, text: str):
    assert refusal(_find, name) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (b"a" * 25, repr(b"a" * 25)),
        (b"\1" * 26, "01" * 25 + "..."),
        ("a\n  b", "'a\\n b'"),
        ("x" * 98, repr("x" * 98)),
        ("x" * 99, "'" + "x" * 99 + "..."),
    ],
)
def test_a_value_of_others_is_short(value: object, text: str):
    assert _short(value) == text


def test_where_in_the_code_of_others():
    code = compile("def f():\n    import json\n    json.loads('x')\nf()", "/a/mine.py", "exec")
    with pytest.raises(ValueError, match="Expecting") as caught:
        exec(code, {})
    assert _place(caught.value).startswith(" (mine.py, line 3)")
    code = compile("1 / 0", "<frozen x>", "exec")
    with pytest.raises(ZeroDivisionError) as caught:
        exec(code, {})
    assert "test_whole_words.py" in _place(caught.value)
    assert str(_raised("a:b", "step()", KeyError("x"))) == "a:b: step() raised KeyError('x')"


def test_output_is_what_it_was_afterwards(capfd: pytest.CaptureFixture[str]):
    with stdout_to_stderr():
        os.write(1, b"inside\n")
    os.write(1, b"behind\n")
    assert capfd.readouterr() == ("behind\n", "inside\n")


# -- what the system is asked ----------------------------------------------------------------------


def test_a_socket_that_listens_to_ethercat(monkeypatch: pytest.MonkeyPatch):
    asked: list[tuple[Any, ...]] = []
    made = Facts(setsockopt=lambda *row: asked.append(row), bind=lambda at: asked.append(at))
    monkeypatch.setattr(packet_socket.socket, "socket", lambda *row: asked.append(row) or made)
    monkeypatch.setattr(packet_socket.socket, "if_nametoindex", lambda _: 9)
    monkeypatch.setattr(ctypes, "addressof", lambda found: asked.append(bytes(found)) or 0x1000)
    PacketSocket("eth1")
    # BPF: half word at 12; equal to 0x88a4, else one further; the whole frame; nothing.
    program = "28000000 0c000000 15000001 a4880000 06000000 ffff0000 06000000 00000000"
    assert asked == [
        (socket.AF_PACKET, socket.SOCK_RAW, 0),
        bytes.fromhex(program),
        (socket.SOL_SOCKET, 26, struct.pack("@HP", 4, 0x1000)),
        (socket.SOL_SOCKET, 35, 1),
        (socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20),
        (263, 1, struct.pack("@iHH8x", 9, 1, 0)),
        ("eth1", 3),
    ]


def test_a_socket_of_another_user_does_not_hide_the_next(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    first, second = (str(tmp_path / name / "control.sock") for name in "ab")
    monkeypatch.setattr(sockets, "_sockets", lambda _: iter([first, second]))
    monkeypatch.setattr(sockets, "_same_network", lambda _: True)
    monkeypatch.setattr(sockets, "interface_of", lambda _: "eth1")
    monkeypatch.setattr(os, "access", lambda path, _: path == second)
    assert sockets.find_socket("eth1") == second


def test_cmake_of_the_system_and_what_a_program_states(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.setattr(build_master.sys, "executable", str(tmp_path / "python"))
    monkeypatch.setattr(build_master.shutil, "which", "/bin/{}".format)
    assert build_master._cmake(tmp_path) == (["/bin/cmake"], {})
    monkeypatch.undo()
    shell = ["/bin/sh", "-c", "echo $FSN_WORD $0 >&2; exit 3", "an error"]
    monkeypatch.setenv("FSN_WORD", "outer")
    said = [refusal(build_master._run, shell, "sh", env) for env in ({}, {"FSN_WORD": "inner"})]
    assert said == [f"sh: exit code 3: {word} an error" for word in ("outer", "inner")]
    assert (
        build_master._run(["/bin/sh", "-c", "echo $PATH"], "sh", {}).strip() == os.environ["PATH"]
    )
    silent = refusal(build_master._run, ["/bin/sh", "-c", "exit 1"], "sh", {})
    assert silent == "sh: exit code 1: no word why"


VERSIONS = "install fsoe-net and fsn-master of one version"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("echo", "PROGRAM gave a scan that cannot be read (no scan document, not valid JSON: "
         f"Expecting value); {VERSIONS}"),
        ("exit 9", "PROGRAM ended with 9 and did not say why"),
        ("""echo '{"event":"log","level":"error","text":"gone"}' >&2
            echo '{"event":"log","level":"info","text":"on"}' >&2; exit 3""", "gone"),
        ("""echo '{"event":"log","level":"error","text":"\\u001b[2J"}' >&2; exit 3""",
         "\N{REPLACEMENT CHARACTER}[2J"),
        ("echo cannot open shared object file >&2; exit 3", "cannot open shared object file"),
        ("exit 1", "fsn-master refused the bus and did not say why"),
        ("exit 2", f"PROGRAM does not take its options: no reason given; {VERSIONS}"),
    ],
)  # fmt: skip
def test_own_scan_has_the_facts_of_the_bus(tmp_path: Path, text: str, said: str):
    path = program(tmp_path, text)
    assert refusal(scan._own, path, "eth1", "soem").replace(path, "PROGRAM") == said


def test_whose_bus_is_scanned(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(scan, "interface_of", lambda _: "eth1")
    for interface in ("eth1", None):
        assert scan.scan_source(interface, socket="/s").attached
    assert refusal(lambda: scan.scan_source("eth2", socket="/s")) == "/s drives eth1, not eth2"
    assert refusal(scan.scan_source, None) == (
        "no bus: name an interface or the socket of an fsn-master"
    )
    monkeypatch.setattr(scan, "find_socket", lambda _: None)
    monkeypatch.setattr(scan, "find_master", lambda: "fsn-master")
    own = scan.scan_source("eth1")
    assert not own.attached
    assert own.announcement == (
        "fsn-master --scan listens on eth1 and stops when another MainDevice talks there; else "
        "every SubDevice on it goes to PREOP: process data ends, outputs fall back"
    )


# -- what is written -------------------------------------------------------------------------------


def test_an_incident_file_as_a_whole(tmp_path: Path):
    """The head as JSON, and the first, the failing and the last cycles."""
    rig = Rig(network("estop", tmp_path), tmp_path, steps="  - {at_ms: 300, break: ek1914}\n")
    rig.run(1_500)
    head, *rows = rig.end().read_text("utf-8").splitlines()
    document = json.loads(head)
    run = rig.session
    identity = run.plan.fingerprint().to_json()
    assert base64.b64decode(document.pop("plan")) == run.plan_bytes
    assert document.pop("plan_sha256") == hashlib.sha256(run.plan_bytes).hexdigest()
    assert document.pop("fingerprint") == {
        **identity, "version": __version__, "cycle_ns": run.cycle_ns
    }  # fmt: skip
    assert document.pop("version") == __version__
    shown = [json.dumps(document, indent=1), *rows[:3], *rows[198:203], *rows[-3:]]
    assert "\n".join(shown) + "\n" == WHOLE.read_text("utf-8")


def test_a_file_is_written_by_the_time_the_window_is_over(tmp_path: Path):
    rig = Rig(network("estop", tmp_path), tmp_path)
    rig.run(20)
    rig.recorder.request("asked")
    rig.run(1_100)
    assert len(rig.recorder.files) == 1
    assert rig.recorder._threads == []


def test_the_time_that_devices_stood_still():
    stood = session().result("live", 2_000_000, devices_stood_ns=5_000_000)
    assert (stood.mode, stood.duration_ms, stood.stalled_ms) == ("live", 2.0, 5.0)


@pytest.mark.parametrize(
    ("change", "key", "value"),
    [
        ({"subject": "x"}, "subject", "estop"),
        (
            {"what": "x"},
            "do",
            "Switch the outputs on. Then cause the trigger: emergency stop button ES1 is pressed.",
        ),
        ({"expected": "x"}, "expect", "contactor K1 opens. This remains after the trigger "
         "has ended, until a reset is pressed."),
        ({"limit_ms": 1.0}, "limit_ms", 300.0),
    ],
)  # fmt: skip
def test_a_step_that_asks_for_something_else(change: dict[str, Any], key: str, value: object):
    fresh, _ = fresh_record(timed())
    steps = tuple(replace(s, **change) if s.id == "trigger estop" else s for s in fresh.steps)
    out = Collector()
    compare_test_record(replace(fresh, steps=steps), fresh, out)
    assert [(d.code, d.message, d.hint) for d in out.diagnostics] == [
        (
            "FSN161",
            f"step trigger estop: {key} is not what these files give",
            f"write back: {value}",
        )
    ]


DEVICE = """\
# GATE, as it was found on the bus by `fsoe-net scan`. Types
# are not known from a bus: whole bytes are unsigned here, other lengths bits.
vendor_id: 0x00000002
product_id: 0x00000003
# assign_activate: 0x0300   # it has distributed clocks; see its ESI file

tpdo:
  - index: 0x1a00   # inputs
    channels:
      - {index: 0x6000, sub_index: 1, type: bool}
      - {index: 0x6000, sub_index: 2, type: bit5}
      - {index: 0x0000, sub_index: 0, type: bit2}
      - {index: 0x6000, sub_index: 3, type: uint64}

sm:
  - {index: 0, type: output, watchdog: disable}
  - {index: 1, type: input, watchdog: disable}
  - {index: 2, type: output, watchdog: disable}
  - {index: 3, type: input, pdo: tpdo, watchdog: disable}
"""


def test_the_file_of_a_device_that_was_found():
    def sm(number: int, kind: str, size: int, pdos: Any = ()) -> dict[str, Any]:
        return {"sm": number, "kind": kind, "start": 0x1000 + number, "bytes": size,
                "source": "coe", "pdos": list(pdos)}  # fmt: skip

    rows = ((0x6000, 1, 1), (0x6000, 2, 5), (0, 0, 2), (0x6000, 3, 64))
    entries = [{"index": i, "subindex": s, "bits": b} for i, s, b in rows]
    pdo = {"index": 0x1A00, "name": "inputs", "entries": entries}
    found = subdevice(
        0, vendor_id=2, product_code=3, name="GATE",
        sms=[sm(3, "inputs", 9, [pdo]), sm(0, "mailbox_out", 128), sm(1, "mailbox_in", 128),
             sm(2, "outputs", 0)],
    )  # fmt: skip
    document = {**scan_of(session().resolution), "subdevices": [found]}
    taken, wrong = parse_scan(json.dumps(document).encode(), "scan.json")
    assert taken is not None, wrong
    files = scan_files(scan.TakenScan(document=document, scan=taken))
    (text,) = (text for name, text in files.texts.items() if name.startswith("devices/"))
    assert text == DEVICE
