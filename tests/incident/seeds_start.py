"""Seeded failures of the start: the bus does not open, and fsn-master says why."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from incident.rig import CELL, FOUND, Seed, network

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
        "found": FOUND[found or right],
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
    status: str,
    text: str,
    *wrong: tuple[int, str, str, dict[str, Any]],
    fsoe: Any = (),
    link_down: bool = False,
) -> Path:
    """Write the file of a bus that did not open; the fault is that of the first wrong SubDevice."""
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
            "fault": {
                "status": f"FSN_E_BUS_{status}",
                "subdevice": plan.subdevices[wrong[0][0]].name if wrong else None,
                "link_down": link_down,
            },
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


def start(status: str, text: str, *wrong: Any, **more: Any) -> Callable[[Path], Path]:
    def seed(tmp: Path) -> Path:
        return failed(tmp, status, text, *wrong, **more)

    return seed


_OTHER = "found vendor 0x00000002 product 0x1afe3052 revision 0x00120000, the plan has ..."

# The fault alone: of all other SubDevices nothing is known.
_ALONE: dict[str, tuple[str, tuple[int, str, str, dict[str, Any]] | None, str]] = {
    "IDENTITY, swapped": (
        "IDENTITY",
        (1, "another device", "...", {"vendor_id": 2, "product_code": 0x0B583052}),
        "devices_swapped_places",
    ),
    "IDENTITY, revision": (
        "IDENTITY",
        (1, "another device", "...", {"revision": 0x120000}),
        "wrong_revision",
    ),
    "IDENTITY, foreign": (
        "IDENTITY",
        (1, "another device", "...", {"vendor_id": 0x539, "product_code": 1}),
        "wrong_device",
    ),
    # Nothing was read of it: what it is instead is not known.
    "IDENTITY, no numbers": (
        "IDENTITY",
        (1, "another device", "...", {"vendor_id": 0, "product_code": 0}),
        "wrong_device",
    ),
    "MISSING": ("MISSING", (4, "does not answer", "alias 0, position 5", {}), "device_missing"),
    "MAPPING": ("MAPPING", (3, "other process data", "...", {}), "wrong_mapping"),
    "ADDRESS": ("ADDRESS", (3, "another FSoE address", "", {"fsoe_address": 250}), "wrong_address"),
    "ADDRESS, no number": ("ADDRESS", (3, "another FSoE address", "...", {}), "wrong_address"),
    "ADDRESS, swapped": (
        "ADDRESS",
        (3, "another FSoE address", "...", {"fsoe_address": 202}),
        "devices_swapped",
    ),
    "SDO": ("SDO", (3, "refused a start-up SDO", "...", {}), "sdo_refused"),
    "MAILBOX": ("MAILBOX", (3, "does not answer an SDO", "...", {}), "sdo_unanswered"),
    "STATE": ("STATE", (4, "refused a state", "...", {}), "state_refused"),
    "BUSY": ("BUSY", None, "other_main_device"),
    "SILENT": ("SILENT", None, "bus_silent"),
}


def alone(
    status: str, wrong: tuple[int, str, str, dict[str, Any]] | None
) -> Callable[[Path], Path]:
    """Return a seed with the fault alone: the bus has let go of all other SubDevices."""

    def seed(tmp: Path) -> Path:
        path = failed(tmp, status, "the text of the fault", *([wrong] if wrong else []))
        head, rest = path.read_text("utf-8").split("\n", 1)
        row = json.loads(head)
        names = ("number", "name", "alias", "position", "stale_cycles")
        row["subdevices"] = [
            s if wrong and n == wrong[0] else {key: s[key] for key in names} | {"known": False}
            for n, s in enumerate(row["subdevices"])
        ]
        path.write_text(json.dumps(row | {"statistics": None}) + "\n" + rest, "utf-8")
        return path

    return seed


START: dict[str, Seed] = {
    "two MainDevices at start": (
        start(
            "BUSY",
            "another MainDevice is talking on this interface: eth1: 42 EtherCAT frames heard",
        ),
        "other_main_device",
    ),
    "no link": (
        start("SILENT", "eth1 has no link: cable", link_down=True),
        "no_link",
    ),
    "nobody answers": (
        start("SILENT", "eth1 has a link, but no EtherCAT SubDevice answers on it"),
        "bus_silent",
    ),
    "device missing at start": (
        start(
            "MISSING",
            "a SubDevice of the plan is missing: drive_2",
            (4, "does not answer", "alias 0, position 5: 5 SubDevices answer", {}),
        ),
        "device_missing",
    ),
    "wrong revision at start": (
        start(
            "IDENTITY",
            "a SubDevice is not the one in the plan: el2904",
            (2, "another device", "found vendor ... revision 0x00120000", {"revision": 0x120000}),
        ),
        "wrong_revision",
    ),
    "wrong device at start": (
        start(
            "IDENTITY",
            "a SubDevice is not the one in the plan: el1904",
            (1, "another device", _OTHER, {"vendor_id": 7, "product_code": 9}),
        ),
        "wrong_device",
    ),
    "mapping differs at start": (
        start(
            "MAPPING",
            "a SubDevice maps other process data than the plan: drive_1",
            (3, "other process data", "SM2: 0x1c12:00 is 0x2, the plan has 0x3", {}),
        ),
        "wrong_mapping",
    ),
    "SDO abort at start": (
        start(
            "SDO",
            "a SubDevice refuses a start-up SDO: drive_1",
            (3, "refused a start-up SDO", "0x8010:01: abort code 0x06090030 value range", {}),
        ),
        "sdo_refused",
    ),
    "SDO without an answer at start": (
        start(
            "MAILBOX",
            "a SubDevice does not answer an SDO: drive_1",
            (3, "does not answer an SDO", "0x1c12:00: no answer", {}),
        ),
        "sdo_unanswered",
    ),
    "state refused at start": (
        start(
            "STATE",
            "a SubDevice does not reach the requested state: drive_2",
            (4, "refused a state", "SAFEOP refused: AL status 0x12", {"al_code": 0x1E}),
        ),
        "state_refused",
    ),
    "wrong FSoE address at start": (
        start(
            "ADDRESS",
            "a SubDevice has another FSoE address than the plan: drive_1",
            (
                3,
                "another FSoE address",
                "it has FSoE address 250, the plan has 201",
                {"fsoe_address": 250},
            ),
            fsoe=({"subdevice": "drive_1", "address": 250, "connections": []},),
        ),
        "wrong_address",
    ),
    "drives swapped at start": (
        start(
            "ADDRESS",
            "a SubDevice has another FSoE address than the plan: drive_1",
            (
                3,
                "another FSoE address",
                "it has FSoE address 202, the plan has 201",
                {"fsoe_address": 202},
            ),
            (
                4,
                "another FSoE address",
                "it has FSoE address 201, the plan has 202",
                {"fsoe_address": 201},
            ),
            fsoe=(
                {"subdevice": "drive_1", "address": 202, "connections": []},
                {"subdevice": "drive_2", "address": 201, "connections": []},
            ),
        ),
        "devices_swapped",
    ),
} | {
    f"alone at start: {n}": (alone(status, wrong), cause)
    for n, (status, wrong, cause) in _ALONE.items()
}
