"""Seeded failures of the start: the bus does not open, and fsn-master says why."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from incidents.rig import CELL, Seed, network

from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.model import Plan


def subdevice(plan: Plan, number: int, found: str = "", detail: str = "", **more: Any) -> Any:
    """Return a SubDevice as `fsn-master` tells it."""
    sub = plan.subdevices[number]
    right = "the SubDevice of the plan"
    row = {
        "number": number,
        "name": sub.name,
        "alias": sub.alias,
        "position": sub.position,
        "known": True,
        "al": "none" if found == "does not answer" else "PREOP",
        "al_code": 0,
        "found_text": found or right,
        "detail": detail,
        "vendor_id": sub.vendor_id,
        "product_code": sub.product_code,
        "revision": sub.revision_low,
        "returns": 0,
        "stale_cycles": 0,
        "link": [],
        "link_lost": [],
        "rx_errors": [],
    }
    return row | more


def failed(
    tmp: Path,
    text: str,
    *wrong: tuple[int, str, str, dict[str, Any]],
    fsoe: Any = (),
) -> Path:
    """Write the file of a bus that did not open."""
    plan = compile_plan(network(CELL, tmp))
    data = plan.to_bytes()
    rows = [subdevice(plan, n) for n in range(len(plan.subdevices))]
    for number, found, detail, more in wrong:
        rows[number] = subdevice(plan, number, found, detail, **more)
    head = {
        "incident": 1,
        "utc": "2026-03-01T12:00:00.000Z",
        "version": "0.1.0",
        "interface": "eth1",
        "backend": "soem",
        "plan": base64.b64encode(data).decode(),
        "plan_file": "cell.fsnplan",
        "plan_sha256": hashlib.sha256(data).hexdigest(),
        "cycle_ns": 1_000_000,
        "trigger": {
            "kind": "bus_failed",
            "connection": None,
            "cycle": 0,
            "now_ns": 1,
            "text": text,
        },
        "statistics": {},
        "connections": [],
        "subdevices": rows,
        "events": [],
        "layout": None,
        "fsoe": list(fsoe),
    }
    path = tmp / "failed.fsnincident"
    path.write_text(json.dumps(head) + "\n" + '{"end":true,"cycles":0}\n', "utf-8")
    return path


def start(text: str, *wrong: Any, fsoe: Any = ()) -> Callable[[Path], Path]:
    def seed(tmp: Path) -> Path:
        return failed(tmp, text, *wrong, fsoe=fsoe)

    return seed


_OTHER = "found vendor 0x00000002 product 0x1afe3052 revision 0x00120000, the plan says ..."

# As fsn-master tells them when it knows nothing of any SubDevice any more.
_PLANNED = "the plan says 0x00000002 0x07703052 0x00000000 to 0xffffffff; compare the bus"
_TOLD = {
    "IDENTITY, swapped": (
        "IDENTITY: SubDevice 1 (el1904): a SubDevice is another one than the plan says: found "
        f"vendor 0x00000002 product 0x0b583052 revision 0x00000000, {_PLANNED}",
        "devices_swapped_places",
    ),
    "IDENTITY, revision": (
        "IDENTITY: SubDevice 1 (el1904): a SubDevice is another one than the plan says: found "
        f"vendor 0x00000002 product 0x07703052 revision 0x00120000, {_PLANNED}",
        "wrong_revision",
    ),
    "IDENTITY, foreign": (
        "IDENTITY: SubDevice 1 (el1904): a SubDevice is another one than the plan says: found "
        f"vendor 0x00000539 product 0x00000001 revision 0x00120000, {_PLANNED}",
        "wrong_device",
    ),
    "MISSING": (
        "MISSING: SubDevice 4 (drive_2): a SubDevice of the plan is missing: alias 0, position 5: "
        "5 SubDevices answer; check cable and power behind the last SubDevice found",
        "device_missing",
    ),
    "MAPPING": (
        "MAPPING: SubDevice 3 (drive_1): a SubDevice maps other process data than the plan says: "
        "SM2: 0x1c12:00 is 0x2, the plan says 0x3",
        "wrong_mapping",
    ),
    "ADDRESS": (
        "ADDRESS: SubDevice 3 (drive_1): a SubDevice has another FSoE address than the plan says: "
        "it has FSoE address 250, the plan says 201",
        "wrong_address",
    ),
    # Told in other words: what it is instead is not known.
    "IDENTITY, no numbers": (
        "IDENTITY: SubDevice 1 (el1904): a SubDevice is another one than the plan says",
        "wrong_device",
    ),
    "ADDRESS, no number": (
        "ADDRESS: SubDevice 3 (drive_1): a SubDevice has another FSoE address than the plan says",
        "wrong_address",
    ),
    "ADDRESS, swapped": (
        "ADDRESS: SubDevice 3 (drive_1): a SubDevice has another FSoE address than the plan says: "
        "it has FSoE address 202, the plan says 201",
        "devices_swapped",
    ),
    "SDO": (
        "SDO: SubDevice 3 (drive_1): a SubDevice refuses a start-up SDO: 0x1c12:00: abort code "
        "0x06090030",
        "sdo_refused",
    ),
    "MAILBOX": (
        "MAILBOX: SubDevice 3 (drive_1): a SubDevice does not answer an SDO: 0x1c12:00: no answer; "
        "--wait 30s tries again",
        "sdo_unanswered",
    ),
    "STATE": (
        "STATE: SubDevice 4 (drive_2): a SubDevice does not reach the requested state: "
        "SAFEOP refused: AL status 0x12, code 0x001e",
        "state_refused",
    ),
    "BUSY": (
        "BUSY: another MainDevice is talking on this interface: near: 42 frames",
        "other_main_device",
    ),
    "SILENT": (
        "SILENT: no SubDevice answers on this interface: near has a link, but no EtherCAT "
        "SubDevice behind it answers",
        "bus_silent",
    ),
    "SILENT, link": (
        "SILENT: no SubDevice answers on this interface: near has no link: cable, power",
        "no_link",
    ),
}


def told(text: str) -> Callable[[Path], Path]:
    """Return a seed with the fault alone: the bus has let go of its SubDevices."""

    def seed(tmp: Path) -> Path:
        path = failed(tmp, f"the bus does not open: FSN_E_BUS_{text}")
        head, rest = path.read_text("utf-8").split("\n", 1)
        row = json.loads(head)
        names = ("number", "name", "alias", "position", "stale_cycles")
        row["subdevices"] = [
            {key: s[key] for key in names} | {"known": False} for s in row["subdevices"]
        ]
        path.write_text(json.dumps(row | {"statistics": None}) + "\n" + rest, "utf-8")
        return path

    return seed


START: dict[str, Seed] = {
    "two MainDevices at start": (
        start("another MainDevice is talking on this interface: eth1: 42 EtherCAT frames heard"),
        "other_main_device",
    ),
    "no link": (
        start("no SubDevice answers on this interface: eth1 has no link: cable"),
        "no_link",
    ),
    "nobody answers": (
        start("eth1 has a link, but no EtherCAT SubDevice behind it answers"),
        "bus_silent",
    ),
    "device missing at start": (
        start(
            "a SubDevice of the plan is missing: drive_2",
            (4, "does not answer", "alias 0, position 5: 5 SubDevices answer", {}),
        ),
        "device_missing",
    ),
    "wrong revision at start": (
        start(
            "a SubDevice is another one than the plan says: el2904",
            (2, "another device", "found vendor ... revision 0x00120000", {"revision": 0x120000}),
        ),
        "wrong_revision",
    ),
    "wrong device at start": (
        start(
            "a SubDevice is another one than the plan says: el1904",
            (1, "another device", _OTHER, {"vendor_id": 7, "product_code": 9}),
        ),
        "wrong_device",
    ),
    "mapping differs at start": (
        start(
            "a SubDevice maps other process data than the plan says: drive_1",
            (3, "other process data", "SM2: 0x1c12:00 is 0x2, the plan says 0x3", {}),
        ),
        "wrong_mapping",
    ),
    "SDO abort at start": (
        start(
            "a SubDevice refuses a start-up SDO: drive_1",
            (3, "refused a start-up SDO", "0x8010:01: abort code 0x06090030 value range", {}),
        ),
        "sdo_refused",
    ),
    "SDO without an answer at start": (
        start(
            "a SubDevice does not answer an SDO: drive_1",
            (3, "does not answer an SDO", "0x1c12:00: no answer", {}),
        ),
        "sdo_unanswered",
    ),
    "state refused at start": (
        start(
            "a SubDevice does not reach the requested state: drive_2",
            (4, "refused a state", "SAFEOP refused: AL status 0x12", {"al_code": 0x1E}),
        ),
        "state_refused",
    ),
    "wrong FSoE address at start": (
        start(
            "a SubDevice has another FSoE address than the plan says: drive_1",
            (3, "another FSoE address", "it has FSoE address 250, the plan says 201", {}),
            fsoe=({"subdevice": "drive_1", "address": 250, "connections": []},),
        ),
        "wrong_address",
    ),
    "drives swapped at start": (
        start(
            "a SubDevice has another FSoE address than the plan says: drive_1",
            (3, "another FSoE address", "it has FSoE address 202, the plan says 201", {}),
            (4, "another FSoE address", "it has FSoE address 201, the plan says 202", {}),
            fsoe=(
                {"subdevice": "drive_1", "address": 202, "connections": []},
                {"subdevice": "drive_2", "address": 201, "connections": []},
            ),
        ),
        "devices_swapped",
    ),
} | {f"told at start: {n}": (told(text), cause) for n, (text, cause) in _TOLD.items()}
