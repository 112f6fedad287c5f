"""Comparing sides of which little is known, and safety functions that came and went."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from networks import example, resolved
from report.made import BASE, TIMED
from scans import scan_of

from fsoe_net.compare.diff import compare
from fsoe_net.compare.diff_safety import compare_functions
from fsoe_net.compare.sides import Side, SideSubDevice, side_of_network, side_of_plan, side_of_scan
from fsoe_net.formats.own.scan import parse_scan
from fsoe_net.plan.compile import compile_plan


def said(a: Side, b: Side) -> list[str]:
    words = ((c.kind, c.area, c.where, c.what, c.before, c.after) for c in compare(a, b).changes)
    return [" ".join(str(w) for w in row if w not in ("", None)) for row in words]


def one(**facts: object) -> Side:
    sub = SideSubDevice(**{"name": "", **facts})  # type: ignore[arg-type]
    return Side(format="x", path="x", whole=False, subdevices=(sub,))


def test_one_device_type_against_one_device():
    kind, device = one(name="A", identity=(1, 2)), one(name="B", identity=(3, 4), position=0)
    assert said(kind, device) == [
        "exchanged subdevice A vendor 0x00000001, product 0x00000002 vendor 0x00000003, "
        "product 0x00000004"
    ]
    placed = one(name="A", identity=(1, 2), position=1)
    assert said(placed, device) == [
        "removed subdevice A vendor 0x00000001, product 0x00000002",
        "added subdevice B vendor 0x00000003, product 0x00000004",
    ]


def test_a_device_without_identity_is_known_by_its_place():
    assert said(one(position=0), one(position=0, identity=(1, 2))) == []


def test_sdos_that_stay_are_not_reported():
    a = one(name="A", sdos={(0x8000, 1): (2, 7), (0x8000, 2): (1, 1)})
    b = one(name="A", sdos={(0x8000, 1): (2, 7)})
    assert said(a, b) == ["removed sdo A 0x8000:02 1 (1 bytes)"]


def test_entries_that_were_not_read_are_not_compared():
    side = side_of_network(example("estop"), "a")
    sub = side.subdevices[0]
    assert sub.managers is not None
    unread = {n: replace(m, complete=False) for n, m in sub.managers.items()}
    other = replace(side, subdevices=(replace(sub, managers=unread), *side.subdevices[1:]))
    assert said(side, other) == []


def test_a_scan_without_an_identity():
    document = scan_of(example("estop"))
    del document["subdevices"][0]["product_code"]
    scan, _ = parse_scan(json.dumps(document).encode(), "scan.json")
    assert scan is not None
    assert side_of_scan(scan, "scan.json").subdevices[0].identity is None


def test_a_copy_of_what_is_not_mapped_keeps_its_address(tmp_path: Path):
    text = TIMED.read_text("utf-8").replace("devices/", f"{BASE}/devices/")
    path = tmp_path / "n.yaml"
    path.write_text(text.replace("io, index: 0x6010", "io, index: 0x6999"), "utf-8")
    copies = side_of_network(resolved(path), "n").copies
    assert copies is not None
    assert copies[-1].source.address == "0x6999:01"


def test_functions_that_one_side_does_not_have():
    timed = resolved(TIMED)
    unknown = replace(side_of_plan(compile_plan(timed), "p"), functions_sha256=None)
    difference = compare(side_of_network(timed, "n"), unknown)
    assert difference.not_compared == ("safety functions: p (plan) does not contain them",)


def test_functions_and_elements_by_name():
    (function,) = resolved(TIMED).network.safety_functions
    sensor = function.elements[0]
    twice = replace(function, elements=(*function.elements, sensor))
    later = replace(sensor, time_ms=9.0)
    other = replace(function, elements=(*function.elements, later), trigger="door")
    rows = [
        (c.kind, c.where, c.what, c.before, c.after) for c in compare_functions([twice], [other])
    ]
    assert rows == [
        ("changed", "estop", "trigger", function.trigger, "door"),
        ("changed", "estop", "sensor ES1 no. 2: time_ms", "5", "9"),
    ]
    (gone,) = compare_functions([function], [replace(function, name="stop")])[:1]
    assert (gone.kind, gone.where) == ("removed", "estop")
