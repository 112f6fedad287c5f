"""Answers of a user: every mistake with line and column."""

from __future__ import annotations

import pytest
from formats.good_answers import GOOD

from fsoe_net.formats.own.answers import parse_answers
from fsoe_net.formats.shared.files import Collector


def test_everything_is_read():
    out = Collector()
    found = parse_answers(GOOD, "a.yaml", out)
    assert out.diagnostics == []
    assert found is not None
    assert (found.name, found.cycle_us) == ("cell", 2000)
    assert [(d.type, d.name, d.count, d.position, d.revision) for d in found.subdevices] == [
        ("EL6910", "", 1, 1, None),
        ("EL1904", "stop", 2, None, 0x120000),
    ]
    assert [w.text for w in found.main or ()] == ["logic"]
    assert found.process_data["stop_1"].text == "device PDO"
    assert {k: w.text for k, w in found.frames.items()} == {"drive": "no", "other": "yes"}
    row = found.connections[0]
    assert (row.sub, row.main, row.slot, row.address) == ("stop_1", "logic", 1, 17)
    assert (row.connection_id, row.watchdog_ms) == (3, 100)
    assert str(row.at("slot")) == "a.yaml:10:38"


@pytest.mark.parametrize(
    ("find", "put", "code", "at"),
    [
        ("type: EL6910", "typ: EL6910", "FSN109", "a.yaml:4:6"),
        ("count: 2", "count: two", "FSN111", "a.yaml:5:39"),
        ("count: 2", "count: 0", "FSN113", "a.yaml:5:39"),
        ("slot: 1", "slot: 300", "FSN113", "a.yaml:10:38"),
        ("address: 17", "address: TODO", "FSN111", "a.yaml:10:50"),
        ("name: cell", "name: cell\nname: two", "FSN106", "a.yaml:2:1"),
        ("{drive: no, other: yes}", "[drive]", "FSN111", "a.yaml:8:9"),
        ("subdevices:", "\tsubdevices:", "FSN102", "a.yaml:3:1"),
    ],
)
def test_a_mistake_is_named_at_its_place(find: str, put: str, code: str, at: str):
    out = Collector()
    parse_answers(GOOD.decode().replace(find, put, 1).encode(), "a.yaml", out)
    assert (code, at) in [(d.code, str(d.span)) for d in out.diagnostics]
    assert all(d.hint for d in out.diagnostics)
