"""Objects, SII, diagnosis history and scan over the control socket, on the emulated segment."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from live.on_the_wire import ATTEMPTS, why_not
from live.support import EXAMPLES
from master.rig import run_to_end, running, write_plan
from wires import attempts, run_program

ROBOT = str(EXAMPLES / "el6910" / "network.yaml")
NAMES = ["coupler", "el6910", "el1904", "el2904", "drive_1", "drive_2"]


def seen(case: str, tmp_path: Path, good: Callable[[Any], bool] = lambda _: True) -> Any:
    why = why_not()
    if why:
        pytest.skip(why)
    plan = write_plan(tmp_path)
    for _ in attempts(tmp_path, ATTEMPTS):
        done = run_program("master/acyclic_rig.py", case, ROBOT, plan, cwd=tmp_path)
        assert "Traceback (most recent" not in done.stdout
        if done.returncode == 0 and good(json.loads(done.stdout.splitlines()[-1])):
            return json.loads(done.stdout.splitlines()[-1])
    pytest.fail(f"{ATTEMPTS} times: {done.stdout}{done.stderr}")


def errors(replies: list[Any]) -> list[str | None]:
    return [reply.get("error") for reply in replies]


@pytest.mark.shows("R20")
def test_objects_are_read_and_written(tmp_path: Path) -> None:
    replies = seen("objects", tmp_path)
    vendor, name, kind, absent, no_sub = replies[:5]
    assert (vendor["value"], vendor["bytes"], vendor["data"]) == (8914, 4, "d2220000")
    assert (name["tag"], name["value"]) == ("7", "drive_1")
    assert "value" not in kind
    assert kind["bytes"] == 4
    assert absent["error"] == "FSN_E_BUS_SDO"
    assert "0x5fff:00: abort code 0x06020000: no such object" in absent["text"]
    assert "no such subindex" in no_sub["text"]
    assert errors(replies[5:9]) == ["FSN_E_ARG"] * 4
    read_only, written, back, too_great, length = replies[9:14]
    assert "read only" in read_only["text"]
    assert (written["ok"], written["bytes"], back["value"]) == (True, 2, 3)
    assert too_great["error"] == "FSN_E_ARG"
    assert "another length" in length["text"]
    assert errors(replies[14:18]) == ["FSN_E_CLOSED"] * 4
    address, history = replies[18:]
    assert address["value"] == 201
    (message,) = history["messages"]
    assert (message["id"], message["kind"], message["text_id"]) == (0xE800, "info", 1)
    assert message["parameters"] == [1]


def test_sii_and_alias(tmp_path: Path) -> None:
    def answered(replies: Any) -> bool:  # on a busy machine a SubDevice may be too late
        return all(reply["ok"] for reply in replies[:3])

    before, alias, after, *wrong = seen("sii", tmp_path, answered)
    old, new = bytes.fromhex(before["data"]), bytes.fromhex(after["data"])
    assert len(old) == before["bytes"] > 128
    assert b"drive_1" in old
    assert alias["alias"] == 0x1234
    assert new[8:10] == b"\x34\x12"
    assert (new[:8], new[10:14], new[16:]) == (old[:8], old[10:14], old[16:])
    assert errors(wrong) == ["FSN_E_ARG"] * 3


def check_document(document: Any) -> None:
    assert document["scan"] == 1
    assert (document["interface"], document["backend"]) == ("near", "soem")
    found = document["subdevices"]
    assert [s["name"] for s in found] == NAMES
    assert [s["position"] for s in found] == list(range(6))
    drive = found[4]
    assert (drive["vendor_id"], drive["product_code"]) == (8914, 770)
    assert drive["mailbox"] == ["coe"]
    assert [p["port"] for p in drive["ports"]] == [0, 1]
    assert drive["ports"][0] == {"port": 0, "link": True, "link_lost": 0, "rx_errors": 0}
    assert found[5]["ports"][1]["link"] is False
    assert drive["fsoe"]["address"] == 201
    main = found[1]["fsoe"]["connections"]
    assert [c["address"] for c in main] == [101, 102, 201, 202]
    assert [c["connection_id"] for c in main] == [1, 2, 3, 4]
    assert found[0]["fsoe"] is None
    assert found[0]["sms"] == []


def complete(seen: Any) -> bool:
    """Whether a scan has read everything: on a busy machine an answer may come too late."""
    document = seen.get("document") or seen["scan"]
    return not any(s["problems"] for s in document.get("subdevices", ()))


def test_scan_without_a_plan(tmp_path: Path) -> None:
    done = seen("whole", tmp_path, good=complete)
    document = done["document"]
    assert done["code"] == 0
    check_document(document)
    assert document["states_changed"] is True
    assert {s["al"] for s in document["subdevices"]} == {"PREOP"}
    assert all(s["problems"] == [] for s in document["subdevices"])
    drive = document["subdevices"][4]
    kinds = [sm["kind"] for sm in drive["sms"]]
    assert kinds == ["mailbox_out", "mailbox_in", "outputs", "inputs"]
    outputs = drive["sms"][2]
    assert outputs["source"] == "coe"
    entries = [e for pdo in outputs["pdos"] for e in pdo["entries"]]
    assert entries[0] == {"index": 0x6040, "subindex": 0, "bits": 16}
    assert outputs["bytes"] == (sum(e["bits"] for e in entries) + 7) // 8
    code, out, err = done["silent"]
    assert (code, out) == (1, "")
    assert "FSN_E_BUS_SILENT" in err


def test_a_half_dead_subdevice_does_not_stop_a_scan(tmp_path: Path) -> None:

    def alive(seen: Any) -> bool:
        """Whether it and its SII answered to the scan, which waits for milliseconds."""
        found = seen["document"]["subdevices"]
        is_named = [s["name"] for s in found] == NAMES
        return is_named and found[4]["problems"] != ["it does not answer"]

    done = seen("half", tmp_path, good=alive)
    found = done["document"]["subdevices"]
    drive = found[4]
    assert "no answer; no further object is read" in drive["problems"][0]
    assert drive["sms"][2]["source"] == "sii"  # its SII still tells its process data
    assert drive["sms"][2]["pdos"][0]["entries"][0]["index"] == 0x6040
    assert drive["fsoe"] is None
    assert found[2]["sms"][2]["source"] == "sii"
    assert found[5]["problems"] == []


def test_scan_of_a_running_bus(tmp_path: Path) -> None:
    done = seen("scan", tmp_path, good=complete)
    assert done["ok"]
    assert done["op"]  # nobody left OP
    document = done["scan"]
    assert document["ok"] is True
    check_document(document)
    assert document["states_changed"] is False
    assert {s["al"] for s in document["subdevices"][1:]} == {"OP"}
    assert [s["planned"] for s in document["subdevices"]] == [None, *NAMES[1:]]


def test_a_thousand_requests_at_once(tmp_path: Path) -> None:
    # SOEM waits for milliseconds: on a busy machine an answer of the emulation may come later.
    found = seen("queue", tmp_path, good=lambda s: len(s["refused"]) < 10)
    assert found["in_order"]
    assert found["between"]
    assert {r["error"] for r in found["refused"]} <= {"FSN_E_BUS_MAILBOX"}


def test_clients_that_leave_and_mailboxes_that_are_slow(tmp_path: Path) -> None:
    done = seen("leaves", tmp_path)
    assert done["slow"]["value"] == 8914
    assert done["never"]["error"] == "FSN_E_BUS_MAILBOX"
    assert done["never"]["text"].startswith("drive_1, 0x")
    assert done["never"]["text"].endswith(": no answer")
    assert done["again"]["value"] == 8914
    assert done["half"]["value"] == 8914
    assert done["left"] <= 2


def test_a_device_unplugged_during_a_transfer(tmp_path: Path) -> None:
    done = seen("unplug", tmp_path)
    # Whether it is gone or slow, a mailbox does not tell; the list of SubDevices does.
    assert "FSN_E_BUS_MAILBOX" in errors(done["replies"])
    assert done["gone"]["error"] in ("FSN_E_BUS_MISSING", "FSN_E_BUS_MAILBOX")
    assert done["rest"]["value"] == 2
    lost = done["scan"]["subdevices"][4]
    assert lost["planned"] == "drive_1"
    assert "it does not answer" in lost["problems"]
    assert "al" not in lost


def test_a_stop_ends_transfers(tmp_path: Path) -> None:
    done = seen("stop", tmp_path)
    assert len(done["replies"]) == 8
    assert set(errors(done["replies"])) <= {"FSN_E_STATE", None}
    assert errors(done["stopped"]) == ["FSN_E_STATE"] * 2


def test_a_bus_without_subdevices_is_reported() -> None:
    with running() as master, master.client() as client:
        client.refused("sdo-read drive_1 0x1000 0", "FSN_E_ABSENT")
        client.refused("scan", "FSN_E_ABSENT")
        client.refused("sdo-read drive_1 0x1000", "FSN_E_ARG")
        client.refused("sdo-write drive_1 0x6640 0 uint8 1", "FSN_E_CLOSED")


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["--scan"], 2, "--interface: is missing"),
        (["--scan", "a.fsnplan", "--interface", "nix"], 2, "takes no plan"),
        (["--scan", "--bus", "emulated"], 1, "cannot be scanned"),
        (["--scan", "--interface", "nosuchif"], 3, "unknown interface"),
    ],
)
def test_scans_that_cannot_be(arguments: list[str], code: int, text: str) -> None:
    if arguments[-1] == "nosuchif" and why_not():
        pytest.skip("needs the SOEM backend")
    done = run_to_end(*arguments)
    assert (done.returncode, done.stdout) == (code, "")
    assert text in done.stderr
