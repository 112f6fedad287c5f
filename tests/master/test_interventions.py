"""The intervention log of a running ``fsn-master``: what is in it, and what a bad folder does."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import pwd
import resource
import shutil
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from master.rig import program, run_to_end, running, write_plan

from fsoe_net.intervention_log.chain import LogChain
from fsoe_net.intervention_log.files import log_files, read_log

MODE = "drive_1.0x6060:00"
Entry = dict[str, Any]


def entries_of(folder: Path) -> list[Entry]:
    """Return the entries of all files, whose chain holds; `log verify` says so too."""
    assert read_log(log_files([str(folder)]), LogChain()).holds
    entries: list[Entry] = []
    before = None
    for path in sorted(folder.iterdir()):
        for line in path.read_bytes().splitlines():
            entry = json.loads(line)
            assert (entry["number"], entry["previous"]) == (len(entries) + 1, before)
            entries.append(entry)
            before = hashlib.sha256(line).hexdigest()
    return entries


def ended(*arguments: str) -> subprocess.CompletedProcess[str]:
    return run_to_end("--bus", "emulated", *arguments)


@pytest.mark.shows("R29")
def test_a_run_is_in_the_log(tmp_path: Path) -> None:
    with running("--intervention-log", str(tmp_path)) as master, master.client() as client:
        client.good("events on")
        client.good("lease 60000")
        client.good(f"set {MODE}=1")
        client.good(f"set {MODE}=2")  # its own already
        client.refused("sdo-write drive_1 0xF980 1 uint16 7", "FSN_E_CLOSED")
        client.good("stop")
        while client.event("state")["state"] != "stopped":
            pass
        status = client.good("status")["interventions"]
        assert (status["folder"], status["lost"], status["error"]) == (str(tmp_path), 0, None)
        client.good("shutdown")
        assert master.wait() == 0
    entries = entries_of(tmp_path)
    assert [entry["event"] for entry in entries if entry["event"] != "state"] == [
        "file",
        "start",
        "plan",
        "taken",
        "request",
        "request",
        "fallback",
        "request",
        "stop",
    ]
    start, plan, taken, refused, stopped, _, _ = (
        entry
        for entry in entries
        if entry["event"] in ("start", "plan", "taken", "request", "stop")
    )
    executable = hashlib.sha256(Path(program()).read_bytes()).hexdigest()
    me = {"pid": os.getpid(), "uid": os.getuid(), "user": pwd.getpwuid(os.getuid()).pw_name}
    assert start["program_sha256"] == executable
    assert str(tmp_path) in start["arguments"]
    assert (start["pid"], start["user"]) == (master.process.pid, me["user"])
    assert plan["fingerprint"]["short"] in plan["text"]
    assert (taken["outputs"], taken["lease_ms"]) == ({MODE: 1}, 60000)
    for entry in (taken, refused, stopped):
        assert {key: entry[key] for key in me} == me
    assert (refused["request"], refused["error"]) == ("sdo-write", "FSN_E_CLOSED")
    assert refused["arguments"] == ["drive_1", "0xF980", "1", "uint16", "7"]
    assert (stopped["request"], stopped["error"]) == ("stop", None)
    assert entries[-1]["code"] == 0


def test_sender_and_target_of_a_signal_are_in_the_log(tmp_path: Path) -> None:
    with running("--intervention-log", str(tmp_path)) as master:
        master.process.send_signal(signal.SIGKILL)
        master.wait()
    with running("--intervention-log", str(tmp_path)) as master:
        master.process.send_signal(signal.SIGTERM)
        assert master.wait() == 0
    entries = entries_of(tmp_path)
    events = [entry["event"] for entry in entries]
    assert events.count("unfinished") == events.count("stop") == 1
    assert events[events.index("unfinished") + 1] == "start"
    assert any(f"Terminated, sent by pid {os.getpid()}" in entry["text"] for entry in entries)


@pytest.mark.shows("R29")
def test_a_refused_start_is_in_the_log(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.mkdir()
    plan = str(write_plan(tmp_path))
    done = ended(plan, "--accepted", "0" * 64, "--intervention-log", str(log))
    assert done.returncode == 1
    assert ended(str(tmp_path / "none"), "--intervention-log", str(log)).returncode == 2
    entries = entries_of(log)
    assert [entry["event"] for entry in entries] == [
        "file",
        *("start", "plan", "log", "stop"),
        *("start", "log", "stop"),
    ]
    assert entries[2]["accepted"] == "0" * 64
    assert "this is not the accepted plan" in entries[3]["text"]
    assert [entries[n]["code"] for n in (4, 7)] == [1, 2]


@pytest.mark.parametrize(
    ("make", "code", "text"),
    [
        (lambda folder: None, 3, "No such file or directory; mkdir it"),
        (lambda folder: folder.write_text("x"), 3, "Not a directory"),
    ],
)
def test_a_folder_that_cannot_be_used_refuses_the_start(
    tmp_path: Path, make: Any, code: int, text: str
) -> None:
    make(tmp_path / "log")
    plan = str(write_plan(tmp_path))
    done = ended(plan, "--intervention-log", str(tmp_path / "log"))
    assert done.returncode == code
    assert text in done.stderr


def test_two_programs_do_not_share_a_log(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.mkdir()
    with running("--intervention-log", str(log)):
        done = ended(str(write_plan(tmp_path)), "--intervention-log", str(log))
    assert done.returncode == 1
    assert "another fsn-master writes its log there; give each fsn-master" in done.stderr


def test_a_full_disk_is_reported_and_the_bus_continues(tmp_path: Path) -> None:
    with running("--intervention-log", str(tmp_path)) as master, master.client() as client:
        client.good("events on")
        resource.prlimit(master.process.pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
        client.good(f"set {MODE}=1")
        told = client.event("interventions")
        assert (told["level"], told["error"]) == ("error", "File too large")
        assert told["text"].endswith("is not written: File too large; entries wait")
        cycle = client.good("status")["cycles"]
        while client.good("status")["cycles"] < cycle + 10:
            pass
        assert client.good("status")["interventions"]["waiting"] > 0
        free = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
        resource.prlimit(master.process.pid, resource.RLIMIT_FSIZE, free)
        told = client.event("interventions")
        assert (told["level"], told["error"]) == ("warning", None)
        client.good("shutdown")
        assert master.wait() == 0
    events = [entry["event"] for entry in entries_of(tmp_path)]
    # Which entry met the full disk first is chance: one of the start may still have waited.
    assert events.count("interventions") == 2
    assert "taken" in events


@pytest.mark.shows("R29")
def test_refused_requests_of_many_connections_leave_room_for_granted_ones(tmp_path: Path) -> None:
    with running("--intervention-log", str(tmp_path)) as master, contextlib.ExitStack() as stack:
        hostile = [stack.enter_context(master.client()) for _ in range(20)]
        for client in hostile * 100:
            client.refused("arm " + "x" * 8000, "FSN_E_ARG")
        owner = stack.enter_context(master.client())
        owner.good("stop")
        status = owner.good("status")["interventions"]
        assert (status["lost"], status["limited"]) == (0, False)
        owner.good("shutdown")
        assert master.wait() == 0
    entries = entries_of(tmp_path)
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 30_000  # 16 MB were sent
    refused = [e for e in entries if e["event"] == "request" and e["error"] is not None]
    assert sum(entry["times"] for entry in refused) == 2000
    assert refused[0]["arguments_cut"] == 8000 - 256
    assert [e["request"] for e in entries if e["event"] == "request" and e["error"] is None] == [
        "stop",
        "shutdown",
    ]


@pytest.mark.shows("R29")
def test_a_folder_half_full_is_reported_and_takes_granted_requests_only(tmp_path: Path) -> None:
    with open(tmp_path / "interventions-000001.jsonl", "wb") as other:
        other.truncate(32 * 2**20)  # half of 64 files of 1 MiB
    options = ("--intervention-log", str(tmp_path), "--intervention-log-file", "1")
    with running(*options) as master, master.client() as client:
        status = client.good("status")["interventions"]
        assert (status["limited"], status["error"]) == (True, None)
        assert 32 * 2**20 < status["bytes"] < 33 * 2**20
        assert status["limit_bytes"] == 64 * 2**20
        client.refused("arm nothing", "FSN_E_ARG")
        client.good(f"set {MODE}=1")
        while client.good("status")["interventions"]["waiting"]:
            pass
        client.good("events on")
        (tmp_path / "interventions-000001.jsonl").unlink()
        event = client.event("interventions")
        assert (event["level"], event["limited"]) == ("warning", False)
        client.good("shutdown")
        assert master.wait() == 0
    text = (tmp_path / "interventions-000002.jsonl").read_text("utf-8")
    entries = [json.loads(line) for line in text.splitlines()]
    (alarm, _) = (entry for entry in entries if entry["event"] == "interventions")
    assert alarm["level"] == "error"
    assert alarm["text"].endswith("no longer logged; move old files away")
    assert [e["request"] for e in entries if e["event"] == "request"] == ["shutdown"]
    assert [e["acts"] for e in entries if e["event"] == "entries_lost"] == [0]
    assert "taken" in [entry["event"] for entry in entries]


def test_entries_that_were_not_written_are_reported_at_the_end(tmp_path: Path) -> None:
    with running("--intervention-log", str(tmp_path)) as master:
        shutil.rmtree(tmp_path)
        master.process.send_signal(signal.SIGTERM)
        assert master.wait() == 0
    assert "entries of the intervention log that were not written: " in master.log[-1]["text"]
    assert not tmp_path.exists()


def test_writes_into_subdevices_are_in_the_log_with_what_became_of_them(tmp_path: Path) -> None:
    """The emulated bus of fsn-master has no SDOs: they are refused when they are done."""
    with running("--intervention-log", str(tmp_path)) as master, master.client() as client:
        client.refused("sdo-write drive_1 0x6060 0 int8 8", "FSN_E_ABSENT")
        client.refused("alias-write drive_1 7", "FSN_E_ABSENT")
        client.good("shutdown")
        assert master.wait() == 0
    rows = [entry for entry in entries_of(tmp_path) if entry["event"] in ("request", "written")]
    assert [(row["event"], row["error"]) for row in rows[:4]] == [
        ("request", None),
        ("written", "FSN_E_ABSENT"),
        ("request", None),
        ("written", "FSN_E_ABSENT"),
    ]
    assert (rows[1]["subdevice"], rows[1]["index"], rows[1]["data"]) == ("drive_1", 0x6060, "08")
    assert (rows[3]["alias"], rows[3]["client"]) == (7, rows[2]["client"])
    assert rows[4]["request"] == "shutdown"


@pytest.mark.shows("R29")
def test_files_go_on_from_each_other(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.mkdir()
    (log / "interventions-000007.jsonl").write_text('{"number":1,"cut in the mid')
    plan = str(write_plan(tmp_path))
    for _ in range(2):
        assert ended(plan, "--accepted", "0" * 64, "--intervention-log", str(log)).returncode
    (only,) = log.iterdir()
    lines = only.read_bytes().splitlines()
    assert lines[0] == b'{"number":1,"cut in the mid torn'
    events = [json.loads(line)["event"] for line in lines[1:]]
    assert events[:4] == ["file", "torn", "unfinished", "start"]
    assert events[-1] == "stop"
    check = read_log(log_files([str(log)]), LogChain())
    assert check.holds
    assert check.remarks == ("1 run has no stop", "1 entry was not written whole")


def test_options_go_together(tmp_path: Path) -> None:
    plan = str(write_plan(tmp_path))
    done = ended(plan, "--intervention-log-file", "1")
    assert done.returncode == 2
    assert "goes with --intervention-log DIR" in done.stderr
    done = ended(plan, "--intervention-log", str(tmp_path), "--intervention-log-file", "0")
    assert "1 to 1000 MiB" in done.stderr
