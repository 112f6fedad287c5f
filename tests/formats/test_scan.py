"""Scan documents: what is read, and what is damaged is named with its place."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scans import scan_of, subdevice

from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.scan import load_scan, parse_scan
from fsoe_net.model.resolve import resolve

EXAMPLE = Path(__file__).parents[2] / "examples" / "el6910" / "network.yaml"


def document() -> dict:
    network = load_network([EXAMPLE]).network
    assert network is not None
    return scan_of(resolve(network))


def test_everything_is_read():
    row = subdevice(
        0,
        alias=300,
        vendor_id=0xFFFFFFFF,
        product_code=1,
        revision=2,
        serial=3,
        name="EK\u00e4 \U0001f6e1",
        al_status=0x14,
        al="SAFEOP",
        al_code=0x1B,
        mailbox=["coe", "foe"],
        planned="io",
        problems=["0x1C12: no answer"],
        ports=[{"port": 1, "link": False, "link_lost": 4, "rx_errors": 255}],
        sms=[
            {"sm": 0, "kind": "mailbox_out", "start": 4096, "bytes": 128},
            {
                "sm": 2,
                "kind": "outputs",
                "start": 4352,
                "bytes": 1,
                "source": "sii",
                "pdos": [
                    {"index": 0x1600, "name": "out"},
                    {"index": 0x1601, "entries": [{"index": 0, "subindex": 0, "bits": 8}]},
                ],
            },
        ],
        fsoe={
            "address": None,
            "connections": [
                {"object": 0xE901, "address": 7, "connection_id": 8, "watchdog_ms": 100, "sra": 9}
            ],
        },
    )
    later = {"scan": 1, "interface": "eth1", "subdevices": [row], "key of a later version": {}}
    for ascii_only in (False, True):
        data = json.dumps(later, ensure_ascii=ascii_only, indent="\t").encode()
        scan, found = parse_scan(data, "scan.json")
        assert found == []
        assert scan is not None
        (sub,) = scan.subdevices
        assert (sub.alias, sub.vendor_id, sub.serial, sub.planned) == (300, 0xFFFFFFFF, 3, "io")
        assert sub.name == "EK\u00e4 \U0001f6e1"
        assert (sub.in_error, sub.al_code, sub.problems) == (True, 0x1B, ("0x1C12: no answer",))
        assert (sub.ports[0].link, sub.ports[0].link_lost, sub.ports[0].rx_errors) == (
            False,
            4,
            255,
        )
        assert sub.sms is not None
        assert [m.kind for m in sub.process_data] == ["outputs"]
        assert sub.sms[0].pdos is None
        pdos = sub.sms[1].pdos
        assert pdos is not None
        assert (pdos[0].name, pdos[0].is_read) == ("out", False)
        assert pdos[1].is_read
        assert pdos[1].entries[0].bits == 8
        assert sub.fsoe is not None
        assert sub.fsoe.address is None
        assert sub.fsoe.connections[0].connection_id == 8


def test_names_cannot_act_on_a_terminal():
    row = subdevice(0, name="a\x1b[31mb\x85c\ud800d\u2028", al="\x00")
    data = json.dumps({"scan": 1, "interface": "x", "subdevices": [row]})
    scan, found = parse_scan(data.encode(), "scan.json")
    assert found == []
    assert scan is not None
    assert scan.subdevices[0].name == "a\\u001b[31mb\\u0085c\ufffdd\\u2028"


def test_an_absent_value_is_unknown():
    scan, found = parse_scan(b'{"scan": 1, "interface": "x", "subdevices": [{"position": 0}]}', "s")
    assert found == []
    assert scan is not None
    (sub,) = scan.subdevices
    assert (sub.vendor_id, sub.sms, sub.fsoe, sub.dc) == (None, None, None, None)


DAMAGED = {
    "empty": ("", "FSN102", "1:1"),
    "cut off": ('{"scan": 1,\n "subdevices": [', "FSN102", "2:17"),
    "YAML": ("scan: 1\n", "FSN102", "1:1"),
    "a list": ("[]", "FSN104", "1:1"),
    "no number": ('{"scan": NaN}', "FSN102", "1:1"),
    "deep": ("[" * 100_000, "FSN103", "1:1"),
    "deep enough": ('{"scan": 1, "x":' + "[" * 100 + "]" * 100 + "}", "FSN103", "1:80"),
    "many digits": ('{"scan": ' + "9" * 5000 + "}", "FSN102", "1:1"),
    "key twice": ('{"scan": 1, "scan": 1, "interface": "x", "subdevices": []}', "FSN106", "1:13"),
    "later version": ('{"scan": 2, "interface": "x", "subdevices": []}', "FSN116", "1:10"),
    "no SubDevices": ('{"scan": 1, "interface": "x"}', "FSN110", "1:1"),
    "text for a number": (
        '{"scan": 1, "interface": "x", "subdevices": [\n {"position": "a"}]}',
        "FSN111",
        "2:15",
    ),
    "too large": (
        '{"scan": 1, "interface": "x", "subdevices": [\n {"position": 0, "alias": 65536}]}',
        "FSN113",
        "2:27",
    ),
    "negative": (
        '{"scan": 1, "interface": "x", "subdevices": [\n {"position": 0, "alias": -1}]}',
        "FSN113",
        "2:27",
    ),
    "position left out": (
        '{"scan": 1, "interface": "x", "subdevices": [\n {"position": 1}]}',
        "FSN113",
        "2:15",
    ),
    "sync manager of no kind": (
        '{"scan": 1, "interface": "x", "subdevices": [{"position": 0, "sms": [\n'
        ' {"sm": 2, "kind": "both"}]}]}',
        "FSN116",
        "2:20",
    ),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_damage_is_named_at_its_place(case: str, tmp_path: Path):
    text, code, place = DAMAGED[case]
    path = tmp_path / "scan.json"
    path.write_text(text, "utf-8")
    scan, found = load_scan(path)
    assert scan is None
    assert (f"{path}:{place}", code) in [(str(d.span), d.code) for d in found], found
    assert all(d.hint for d in found)


def test_missing_scan_file_is_reported(tmp_path: Path):
    scan, found = load_scan(tmp_path / "scan.json")
    assert scan is None
    assert [d.code for d in found] == ["FSN101"]


WHOLE = json.dumps(document()).encode()


@given(st.integers(0, len(WHOLE) - 1), st.binary(max_size=3))
def test_any_damage_is_a_finding_or_harmless(at: int, put: bytes):
    scan, found = parse_scan(WHOLE[:at] + put + WHOLE[at + len(put) :], "scan.json")
    assert (scan is None) <= bool(found)


@given(st.binary())
def test_anything_is_read_without_an_exception(data: bytes):
    scan, found = parse_scan(data, "scan.json")
    assert scan is None
    assert found
