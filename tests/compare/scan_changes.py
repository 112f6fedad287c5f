"""Changes of the scan of the robot cell: each is one finding at one line of the user's file."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any

from networks import PLAIN
from scans import COUPLER, subdevice

from fsoe_net.compare.bus_scan import check_scan
from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.scan import parse_scan
from fsoe_net.model.resolve import Resolution, resolve

Change = Callable[[list[dict[str, Any]]], object]


def network(name: str) -> Resolution:
    network = load_network([PLAIN / name / "network.yaml"]).network
    assert network is not None
    return resolve(network)


NETWORKS = {name: network(name) for name in ("estop", "el6910")}
ROBOT = NETWORKS["el6910"]  # 1 el6910, 2 el1904, 3 el2904, 4 drive_1, 5 drive_2; 0 is a coupler


def scan_findings(resolution: Resolution, document: dict[str, Any]) -> list[Diagnostic]:
    scan, damage = parse_scan(json.dumps(document).encode(), "scan.json")
    assert scan is not None, damage
    return check_scan(resolution, scan)


def renumbered(document: dict[str, Any]) -> dict[str, Any]:
    for number, row in enumerate(document["subdevices"]):
        row["position"] = number
    return document


def _remove(n):
    return lambda rows: rows.pop(n)


def _swap(a, b):
    def change(rows):
        rows[a], rows[b] = rows[b], rows[a]

    return change


def _insert(n, row):
    return lambda rows: rows.insert(n, copy.deepcopy(row))


def _put(n, *path_and_value):
    *path, value = path_and_value

    def change(rows):
        at = rows[n]
        for step in path[:-1]:
            at = at[step]
        at[path[-1]] = value

    return change


def _delete(n, *path):
    def change(rows):
        at = rows[n]
        for step in path[:-1]:
            at = at[step]
        del at[path[-1]]

    return change


def _both(*changes):
    def change(rows):
        for one in changes:
            one(rows)

    return change


FOREIGN = subdevice(
    0,
    vendor_id=9,
    product_code=7,
    name="drive",
    sms=[{"sm": 2, "kind": "outputs", "bytes": 4, "pdos": []}],
)
ENTRY = {"index": 0x7777, "subindex": 1, "bits": 8}
# Name: what is changed in the SubDevices of the document, the one code, the line of the network.
CASES: dict[str, tuple[Change, str, int]] = {
    "coupler gone": (_remove(0), "FSN501", 7),
    "first gone": (_remove(1), "FSN501", 7),
    "middle gone": (_remove(3), "FSN501", 9),
    "twin gone, told by its address": (_remove(4), "FSN501", 10),
    "last gone": (_remove(5), "FSN501", 11),
    "extra at the front": (_insert(0, FOREIGN), "FSN502", 2),
    "extra in the middle": (_insert(3, FOREIGN), "FSN502", 2),
    "extra at the end": (_insert(6, FOREIGN), "FSN502", 2),
    "coupler in the way": (_insert(3, subdevice(3, **COUPLER)), "FSN502", 2),
    "process data on a free place": (_put(0, "sms", FOREIGN["sms"]), "FSN502", 2),
    "neighbours exchanged": (_swap(2, 3), "FSN503", 8),
    "far ones exchanged": (_swap(1, 4), "FSN503", 7),
    "moved to the end": (lambda r: r.append(r.pop(1)), "FSN503", 7),
    "other vendor": (_put(3, "vendor_id", 3), "FSN504", 9),
    "other product": (_put(3, "product_code", 3), "FSN504", 9),
    "PDO less": (lambda r: r[4]["sms"][0]["pdos"].pop(2), "FSN506", 8),
    "PDO more": (
        lambda r: r[4]["sms"][0]["pdos"].append({"index": 0x1633, "entries": []}),
        "FSN506",
        8,
    ),
    "PDOs in another order": (lambda r: r[4]["sms"][1]["pdos"].reverse(), "FSN506", 52),
    "entry of another object": (_put(2, "sms", 0, "pdos", 0, "entries", 0, ENTRY), "FSN506", 8),
    "entry longer": (
        _both(
            _put(2, "sms", 0, "pdos", 0, "entries", 1, "bits", 16),
            _put(2, "sms", 0, "bytes", 7),
        ),
        "FSN506",
        9,
    ),
    "entry less": (lambda r: r[2]["sms"][0]["pdos"][0]["entries"].pop(), "FSN506", 11),
    "entry more": (lambda r: r[2]["sms"][0]["pdos"][0]["entries"].append(ENTRY), "FSN506", 6),
    "longer, mapping not read": (
        _both(_delete(2, "sms", 1, "pdos"), _put(2, "sms", 1, "bytes", 7)),
        "FSN507",
        29,
    ),
    "no such sync manager": (_delete(2, "sms", 1), "FSN507", 29),
    "other direction": (_put(2, "sms", 1, "kind", "outputs"), "FSN507", 29),
    "more sync managers": (
        lambda r: r[2]["sms"].append({"sm": 6, "kind": "outputs", "bytes": 2}),
        "FSN507",
        26,
    ),
    "other address": (_put(2, "fsoe", "address", 77), "FSN508", 42),
    "address of another": (_put(2, "fsoe", "address", 102), "FSN508", 42),
    "twins exchanged": (_swap(4, 5), "FSN508", 44),
    "other address in the safety project": (
        _put(1, "fsoe", "connections", 2, "address", 77),
        "FSN508",
        44,
    ),
    "other connection ID": (_put(1, "fsoe", "connections", 1, "connection_id", 9), "FSN509", 43),
    "connection IDs crossed": (
        _both(
            _put(1, "fsoe", "connections", 0, "connection_id", 2),
            _put(1, "fsoe", "connections", 1, "connection_id", 1),
        ),
        "FSN509",
        42,
    ),
    "other watchdog": (_put(1, "fsoe", "connections", 3, "watchdog_ms", 50), "FSN510", 45),
    "error state": (_both(_put(3, "al_status", 0x14), _put(3, "al_code", 0x1B)), "FSN511", 9),
    "error state of a coupler": (_put(0, "al_status", 0x11), "FSN511", 2),
    "lost link": (_put(3, "ports", 1, "link_lost", 3), "FSN512", 9),
    "receive error": (_put(3, "ports", 0, "rx_errors", 1), "FSN512", 9),
    "address not readable": (_put(2, "fsoe", None), "FSN513", 42),
    "connection not reported": (lambda r: r[1]["fsoe"]["connections"].pop(), "FSN513", 45),
    "not read": (_put(2, "problems", ["0x1C12: no answer"]), "FSN514", 8),
}
