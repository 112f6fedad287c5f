"""Incident files of fsn-master: by request, for connections that never come, on a full disk."""

from __future__ import annotations

import base64
import hashlib
import json
import resource
from pathlib import Path
from typing import Any

import pytest
from master.rig import run_to_end, running, write_plan
from networks import example

from fsoe_net.plan.codec import decode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import fingerprint_from_json, fingerprint_of


def read(path: str | Path) -> tuple[dict[str, Any], list[dict[str, Any]], dict[str, Any] | None]:
    """Return head, cycles and end of a file, with every image in its place."""
    head, *lines = Path(path).read_text("utf-8").splitlines()
    end = json.loads(lines.pop()) if lines and lines[-1].startswith('{"end"') else None
    cycles = [json.loads(line) for line in lines] if end else []
    return json.loads(head), cycles, end


def test_a_client_asks_for_one(tmp_path):
    with running("--incidents", tmp_path, "--cycle", "2ms") as master, master.client() as client:
        client.good("events on")
        assert client.good('incident "after the door was opened"')["begun"] is True
        client.refused("incident again", "FSN_E_BUSY")
        told = client.event("incident")
    assert told["whole"] is True
    assert "after the door was opened" in told["text"]
    head, cycles, end = read(told["file"])
    assert Path(told["file"]).parent == tmp_path
    assert told["sha256"] == hashlib.sha256(Path(told["file"]).read_bytes()).hexdigest()
    assert end == {"end": True, "cycles": told["cycles"]}
    assert told["cycles"] == len(cycles) > 100
    numbers = [row["cycle"] for row in cycles]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert cycles[-1]["t"] - head["trigger"]["now_ns"] > 0.9e9
    assert head["trigger"]["kind"] == "request"
    assert numbers[0] <= head["trigger"]["cycle"] < numbers[-1]
    plan = base64.b64decode(head["plan"])
    assert plan == compile_plan(example("el6910")).to_bytes()
    assert hashlib.sha256(plan).hexdigest() == head["plan_sha256"]
    assert fingerprint_from_json(head["fingerprint"]) == fingerprint_of(decode_plan(plan))
    assert len(bytes.fromhex(cycles[0]["image"])) == head["layout"]["image_bytes"]
    assert "image" not in cycles[1]  # nothing changes on this bus
    assert {"statistics", "connections", "subdevices", "events", "cycle_ns"} <= set(head)


def test_files_of_all_runs_have_a_limit_and_nothing_is_deleted(tmp_path):
    older = tmp_path / "of-another-run.fsnincident"
    older.write_bytes(bytes(1 << 20))
    options = ("--incidents", tmp_path, "--incidents-limit", "1", "--cycle", "2ms")
    with running(*options) as master, master.client() as client:
        client.good("events on")
        client.good("incident first")
        told = client.event("incident")
        assert (told["file"], told["cycles"], told["whole"]) == ("", 0, False)
        assert told["sha256"] is None
        assert told["level"] == "error"
        assert told["text"] == (
            f"incident: first; not kept, for the incident files in {tmp_path} have 1 MiB; move "
            "some of them away, or start with a higher --incidents-limit"
        )
        assert list(tmp_path.iterdir()) == [older]
        older.rename(tmp_path / "moved.txt")  # not one any more
        client.good("incident second")
        told = client.event("incident")
    assert told["whole"] is True
    assert sorted(tmp_path.iterdir()) == sorted([tmp_path / "moved.txt", Path(told["file"])])


def test_a_connection_that_never_comes_is_one(tmp_path):
    with running("--incidents", tmp_path) as master, master.client() as client:
        client.good("events on")
        told = client.event("incident")
    head, cycles, end = read(told["file"])
    assert head["trigger"]["kind"] == "not_connected"
    assert head["trigger"]["connection"] in [c["name"] for c in head["connections"]]
    assert head["trigger"]["after"] == "silent"
    assert "5 s" in head["trigger"]["text"]
    assert end
    assert cycles


def test_a_full_disk_cuts_the_file_off_and_nothing_else(tmp_path):
    with running("--incidents", tmp_path) as master, master.client() as client:
        client.good("events on")
        # The head fits, and some of the cycles.
        client.good("incident first")
        size = Path(client.event("incident")["file"]).stat().st_size
        resource.prlimit(master.process.pid, resource.RLIMIT_FSIZE, (size - 5000, size - 5000))
        client.good("incident second")
        told = client.event("incident")
        before = client.good("status")["cycles"]
        while client.good("status")["cycles"] == before:
            pass
    assert told["whole"] is False
    assert told["level"] == "error"
    assert "File too large" in told["text"]
    head, _, end = read(told["file"])
    assert head["incident"] == 1
    assert end is None


def test_nothing_that_exists_is_overwritten(tmp_path):
    with running("--incidents", tmp_path) as master, master.client() as client:
        client.good("events on")
        client.good("incident")
        first = Path(client.event("incident")["file"])
        for path in tmp_path.iterdir():
            path.write_text("kept", "utf-8")
        client.good("incident")
        second = Path(client.event("incident")["file"])
    assert first.read_text("utf-8") == "kept"
    assert second != first


@pytest.mark.parametrize("folder", ["nowhere", "file"])
def test_a_folder_that_cannot_be_written_is_refused_at_the_start(tmp_path, folder):
    (tmp_path / "file").touch()
    plan = write_plan(tmp_path)
    done = run_to_end(plan, "--bus", "emulated", "--incidents", tmp_path / folder)
    assert done.returncode == 3
    assert "is not a writable folder" in done.stderr


def test_without_the_option_the_request_names_the_next_step():
    with running() as master, master.client() as client:
        reply = client.ask("incident")
    assert reply["ok"] is False
    assert "--incidents" in reply["hint"]
