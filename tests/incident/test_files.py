"""Incident files: read as far as they go, hostile ones told with place, written whole or told."""

from __future__ import annotations

import io
import json
import os

import pytest
from incident.rig import FOUND, START, Rig, edited, network, read
from incident.seeds_start import failed

from fsoe_net.core.bus_documents import Found
from fsoe_net.document.write_html import document_html
from fsoe_net.document.write_markdown import document_markdown
from fsoe_net.document.write_terminal import document_text
from fsoe_net.errors import IncidentError
from fsoe_net.incident.causes import judge
from fsoe_net.incident.incident import CycleRecord
from fsoe_net.incident.incident_facts import facts_json, facts_of
from fsoe_net.incident.incident_read import IncidentReader
from fsoe_net.incident.incident_write import incident_name, write_incident
from fsoe_net.report.incident_document import incident_document

TRIGGER = {"kind": "request", "connection": None, "cycle": 3, "now_ns": 3000, "text": "x"}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a file of a real incident."""
    tmp = tmp_path_factory.mktemp("whole")
    rig = Rig(network("estop", tmp), tmp, steps="  - {at_ms: 300, break: ek1914}\n")
    rig.run(1_500)
    return rig.end()


def head(**changes):
    row = {"incident": 1, "utc": "2026-03-01T12:00:00.000Z", "trigger": TRIGGER} | changes
    return json.dumps(row).encode() + b"\n"


def reader(data):
    return IncidentReader("f", io.BytesIO(data))


def cycles(data):
    found = reader(data)
    return list(found), found.cut


def tell(path):
    """Render everything; nothing may raise."""
    facts = facts_of(read(path))
    document = incident_document(facts, "0")
    page = document_html(document) + document_markdown(document)
    return document_text(document) + page + json.dumps(facts_json(facts, "0"))


def test_a_file_is_read_back(whole):
    e = read(whole)
    assert e.cut == ""
    assert (e.bus.cycles, e.bus.missed) == (1400, 0)
    assert e.head.trigger.kind.value == "left_data"
    assert (e.by, e.code) == ("main", 5)
    assert e.head.utc.startswith("2026-03-01T12:00:00.4")
    assert e.link.sent_address == 14
    assert e.link.sent_watchdog_ms == 100
    assert judge(e).likely.key == "device_lost"


def test_a_file_cut_anywhere_is_read_as_far_as_it_goes(whole, tmp_path):
    data = whole.read_bytes()
    first = data.index(b"\n") + 1
    seen = []
    for end in [first, first + 1, *range(first + 40, len(data) - 1, len(data) // 7)]:
        path = tmp_path / "cut"
        path.write_bytes(data[:end])
        e = read(path)
        assert e.cut
        assert "note: the file ends early" in document_text(incident_document(facts_of(e), "0"))
        seen.append(e.bus.cycles)
    assert seen == sorted(seen)
    assert seen[-1] > 500


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "empty"),
        (b"\n", "empty"),
        (b"\xff\xfe\n", "UTF-8"),
        (b"PK\x03\x04\n", "JSON"),
        (b"[1]\n", "no JSON object"),
        (b"[" * 100_000 + b"\n", "nested too deep"),
        (b'{"incident":1', "cut off"),
        (b"{}\n", "not an incident file"),
        (head(incident=2), "version 1"),
        (head(incident=True), "non-negative integer"),
        (head(incident=-1), "non-negative integer"),
        (head(trigger={"kind": "boom"}), "trigger.kind"),
        (head(trigger=7), "trigger is not an object"),
        (head(trigger=TRIGGER | {"now_ns": -5}), "trigger.now_ns"),
        (head(trigger=TRIGGER | {"reset_code": 256}), "trigger.reset_code"),
        (head(trigger=TRIGGER | {"connection": ["a"]}), "trigger.connection"),
        (head(cycle_ns=1 << 64), "cycle_ns"),
        (head(cycle_ns=1.5), "cycle_ns"),
        (head(events={}), "events is not a list"),
        (head(events=[1]), "events[0]"),
        (head(subdevices=[{"known": 1}]), "subdevices[0].known"),
        (
            head(statistics={"work": {"count": 1, "buckets": [[1, 2], [1, 2]]}}),
            "buckets do not rise",
        ),
        (head(statistics={"work": {"count": 1, "buckets": [[1]]}}), "not a pair"),
        (
            head(
                layout={
                    "image_bytes": 4,
                    "connections": [
                        {
                            "name": "a",
                            "to_sub": {"source_byte": 0, "destination_byte": 0, "bytes": 6},
                            "to_main": {"source_byte": 0, "destination_byte": 0, "bytes": 6},
                        }
                    ],
                }
            ),
            "outside the image",
        ),
        (
            head(
                layout={
                    "image_bytes": 99,
                    "connections": [
                        {"to_sub": {"source_byte": 0, "destination_byte": 0, "bytes": 8}}
                    ],
                }
            ),
            "no FSoE frame has this length",
        ),
    ],
)
def test_a_bad_head_is_reported_with_line_and_key(data, message):
    with pytest.raises(IncidentError) as refused:
        reader(data)
    assert str(refused.value).startswith("f:1: ")
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (b"nonsense\n", "no JSON"),
        (b'{"cycle":1}\n', "t is missing"),
        (b'{"cycle":1,"t":"5"}\n', "t must be a non-negative integer"),
        (b'{"cycle":1,"t":NaN}\n', "not a number"),
        (b'{"cycle":1,"t":5,"image":"zz"}\n', "not hexadecimal"),
        (b'{"cycle":1,"t":5,"image":"00"}\n', "has 1 bytes"),
        (b'{"cycle":1,"t":5,"wkc":[1]}\n', "wkc"),
        (b'{"cycle":1,"t":5,"wkc":[1,-1]}\n', "wkc"),
        (b'{"cycle":0,"t":5}\n', "comes after"),
        (b'{"cycle":1,"t":5', "middle of a line"),
        (b'{"cycle":' + b"9" * 5000 + b"}\n", "no JSON"),
        (b'{"end":true,"cycles":7}\n', "7 cycles were written"),
    ],
)
def test_a_bad_cycle_ends_the_reading_there(line, message):
    data = head(layout={"image_bytes": 2, "connections": []}) + b'{"cycle":0,"t":4}\n' + line
    rows, cut = cycles(data)
    assert len(rows) == 1
    assert cut.startswith("f:3: ")
    assert message in cut


@pytest.mark.parametrize(
    ("limit", "most", "row", "message"),
    [
        (
            "incident.incident_read._HEAD_BYTES",
            1 << 20,
            {"x": "x" * (1 << 20)},
            "longer than 1 MiB",
        ),
        ("core.json_object._MOST_ROWS", 3, {"events": [{}] * 4}, "events has more than 3 entries"),
    ],
)
def test_more_than_a_head_may_hold(monkeypatch, limit, most, row, message):
    monkeypatch.setattr(f"fsoe_net.{limit}", most)
    with pytest.raises(IncidentError) as refused:
        reader(head(**row))
    assert str(refused.value) == f"f:1: {message}"


def test_more_cycles_than_are_read(monkeypatch):
    monkeypatch.setattr("fsoe_net.incident.incident_read._MOST_CYCLES", 2)
    rows, cut = cycles(head() + b"".join(b'{"cycle":%d,"t":%d}\n' % (n, n) for n in range(3)))
    assert [row.cycle for row in rows] == [0, 1]
    assert cut == "f:4: more than 2 cycles"


def test_the_connection_of_a_request_is_one_that_is_not_in_data(whole, tmp_path):
    """Where sync managers lie is not told: nothing is searched beside a frame."""
    path = tmp_path / "f"
    path.write_bytes(whole.read_bytes())

    def change(row):
        row["trigger"] |= {"kind": "request", "connection": None}
        row["layout"]["sms"] = []

    e = read(edited(path, change))
    assert (e.name, e.link.state.in_data) == ("el1918-ek1914", False)
    assert e.link.shifts == (None, None)


def test_a_damaged_plan_costs_names_not_the_file(whole, tmp_path):
    first, rest = whole.read_bytes().split(b"\n", 1)
    row = json.loads(first)
    good = row["plan"]
    for plan, told in (
        ("%%%", "no base64"),
        (good[:-8], "SHA-256"),
        ("", "holds no plan"),
        ("é", "no base64"),
    ):
        path = tmp_path / "f"
        path.write_bytes(json.dumps(row | {"plan": plan}).encode() + b"\n" + rest)
        e = read(path)
        assert e.head.plan is None
        assert told in e.head.remarks[0]
        assert judge(e).likely.key == "device_lost"
        assert told in tell(path)


@pytest.mark.shows("R24")
def test_foreign_names_cannot_spoil_terminal_or_page(tmp_path):
    evil = "\x1b[2J<script>\ud800{sub}\n"
    path = failed(tmp_path, "IDENTITY", evil, (3, "another device", evil, {"name": evil}))
    told = tell(path)
    told.encode("utf-8")
    assert "\x1b" not in told
    assert "<script>" not in document_html(incident_document(facts_of(read(path)), "0"))


@pytest.mark.shows("R7")
def test_random_damage_never_raises_anything_else(whole, tmp_path):
    import random

    data = bytearray(whole.read_bytes()[:40_000])
    chance = random.Random(5)
    path = tmp_path / "f"
    for _ in range(60):
        bad = bytearray(data)
        for _ in range(chance.randrange(1, 6)):
            bad[chance.randrange(len(bad))] = chance.randrange(256)
        path.write_bytes(bad)
        try:
            tell(path)
        except IncidentError as exc:
            assert str(exc).startswith("f:1: ")  # noqa: PT017 - most damage raises nothing


def test_a_long_line_is_not_read_into_memory():
    rows, cut = cycles(head() + b'{"cycle":1,"t":5,"image":"' + b"0" * (9 << 20) + b'"}\n')
    assert rows == []
    assert "too long" in cut


def test_a_full_disk_leaves_what_fits_and_reports(tmp_path):
    rows = [CycleRecord(cycle=n, now_ns=n, image=os.urandom(2000)) for n in range(1, 200)]
    path = tmp_path / "x.fsnincident"
    done = write_incident(tmp_path, path.name, {"trigger": TRIGGER}, rows)
    assert (done.path, done.fault) == (path, "")
    assert len(cycles(path.read_bytes())[0]) == 199
    again = write_incident(tmp_path, path.name, {"trigger": TRIGGER}, rows)
    assert again.path == tmp_path / "x-2.fsnincident"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x-2.fsnincident", "x.fsnincident"]


def test_a_disk_that_fills_up_while_writing(tmp_path, monkeypatch):
    class Full(io.StringIO):
        def write(self, text):
            if self.tell() > 20_000:
                raise OSError(28, "No space left on device")
            file.write(text)
            return super().write(text)

        def fileno(self):
            return file.fileno()

    file = open(tmp_path / ".x.fsnincident.part", "w", encoding="utf-8")  # noqa: SIM115
    rows = [CycleRecord(cycle=n, now_ns=n, image=os.urandom(500)) for n in range(1, 200)]
    with monkeypatch.context() as patch, file:
        patch.setattr("builtins.open", lambda *_, **__: Full())
        done = write_incident(tmp_path, "x.fsnincident", {"trigger": TRIGGER}, rows)
    assert "No space left" in done.fault
    assert "can be read as far as it goes" in done.fault
    seen, cut = cycles(done.path.read_bytes())
    assert 10 < len(seen) < 30
    assert cut


def test_a_folder_that_is_gone_disturbs_nothing(tmp_path):
    rig = Rig(network("estop", tmp_path), tmp_path, steps="  - {at_ms: 100, break: ek1914}\n")
    (tmp_path / "incidents").rmdir()
    rig.run(300)
    rig.recorder.finish(rig.now_ns)
    assert rig.recorder.files == []
    told = [e.text for e in rig.session.engine.events if e.source == "incident"]
    assert len(told) == 1
    assert "no incident file was written" in told[0]


@pytest.mark.parametrize("disk", [True, False])
def test_the_last_file_of_a_run_is_reported_also_when_none_could_be_written(
    tmp_path, monkeypatch, disk
):
    monkeypatch.setattr("fsoe_net.simulate.incidents._MOST_FILES", 1)
    rig = Rig(network("estop", tmp_path), tmp_path)
    if not disk:
        (tmp_path / "incidents").rmdir()
    rig.run(100)
    for text in ("first", "second", "third"):
        rig.recorder.request(text)
        rig.run(6000)
    assert len(rig.recorder.files) == disk
    told = [e.text for e in rig.session.engine.events if e.source == "incident"]
    assert told[1:] == ["not written: second; one run writes 1 files at most"]


def test_names_of_files():
    utc = START.strftime("%Y-%m-%dT%H:%M:%S.000Z")
    name = incident_name(utc, "../a b/ü")
    assert name == "incident-20260301T120000.000Z-.._a_b__.fsnincident"


def test_differences_to_the_text_of_fsn_master(whole, tmp_path):
    """State words in its own spelling, code 0 without a reset, no facts about the ends."""
    first, rest = whole.read_bytes().split(b"\n", 1)
    row = json.loads(first)
    row |= {"interface": None, "statistics": None, "unknown": {"key": [1]}}
    row.pop("fsoe")
    row["trigger"] |= {"before": "process data", "reset_by": None, "reset_code": 0, "cycle": 0}
    path = tmp_path / "f"
    path.write_bytes(json.dumps(row).encode() + b"\n" + rest)
    e = read(path)
    assert (e.by, e.code) == ("main", 5)  # as the frames say
    assert "left Data · ProcessData" in facts_of(e).sentence
    assert judge(e).likely.key == "device_lost"


def test_found_codes_match_the_c_header():
    assert {member.text: int(member) for member in Found} == FOUND
