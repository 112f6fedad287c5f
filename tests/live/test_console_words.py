"""Words of the console and its scripts: what is said to each that is odd, whole texts."""

from __future__ import annotations

import time

import pytest
from live.console_rig import Rig

from fsoe_net.errors import ConsoleError, ControlRefused, EnvironmentFault
from fsoe_net.live.console.completion import complete
from fsoe_net.live.console.names import number, shown
from fsoe_net.testing.fake_master import STATISTICS, STATUS, FakeMaster


@pytest.fixture
def master():
    with FakeMaster() as found:
        yield found


@pytest.fixture
def rig(master):
    found = Rig(master.path)
    yield found
    found.link.close()


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "no number"), (True, "true"), (False, "false"), (1.5, "1.5"), (7, "7")],
)
def test_values_for_people(value, text):
    assert shown(value) == text


SDO = "usage: sdo read SUBDEVICE INDEX[:SUB] [TYPE] | write SUBDEVICE INDEX[:SUB] TYPE VALUE"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("run", "usage: run SCRIPT"),
        ("lease", "usage: lease MS"),
        ("lease 1 2", "usage: lease MS"),
        ("sdo write drive_1 0x1c12:0 uint8", SDO),
        ("sdo read drive_1", SDO),
    ],
)
def test_how_it_is_written(rig, line, message):
    with pytest.raises(ConsoleError) as caught:
        rig.do(line)
    assert str(caught.value) == message


def test_a_cycle_image_whole(rig, monkeypatch):
    monkeypatch.setitem(STATISTICS, "lost_frames", 3)
    monkeypatch.setitem(STATISTICS, "overruns", 1)
    monkeypatch.setitem(STATISTICS, "wkc_errors", 2)
    late = {**STATISTICS["latency"], "max_ns": 2_500_000}
    monkeypatch.setitem(STATISTICS, "latency", late)
    state = (
        "running, cycle 1 ms, 5 cycles, working counter 9 of 9, 2 of 2 SubDevices in OP, "
        "1 of 1 connection in Data"
    )
    connection = "c1  logic - drive_1  data_process  7 / 7 frames"
    assert rig.do("snapshot") == [
        state,
        "overruns 1, incomplete cycles 2, lost frames 3, late 1000 us (half), 1010 us (99 %), "
        "2500 us (most)",
        connection,
        "drive_1  OP  alias 0 position 0",
    ]
    assert rig.do("state") == [state]
    assert rig.do("connections") == [connection]


def test_the_lease_that_is_given_is_kept(rig):
    assert rig.link.lease(300) == 300
    assert rig.do("lease 250") == ["lease 250 ms"]


def test_a_script_that_is_too_long(rig, tmp_path):
    path = tmp_path / "s.fsn"
    path.write_bytes(b"#" * ((4 << 20) + 1))
    with pytest.raises(ConsoleError) as caught:
        rig.do(f"run {path}")
    assert str(caught.value).endswith(f"{path} is too long for a script: more than 4 MiB")


def test_a_bus_that_does_not_come_up(master, rig, monkeypatch):
    def fails(words):
        if words[0] == "start":
            master.state = "failed"
            master.send_event(event="state", state="failed")

    monkeypatch.setattr(master, "_after", fails)
    monkeypatch.setitem(STATUS, "fault", "drive_1 is gone")
    master.state = "stopped"
    with pytest.raises(ConsoleError) as caught:
        rig.do("start")
    assert str(caught.value).endswith("start: fsn-master is failed: drive_1 is gone")
    assert rig.do("state") == ["failed", "error: the bus did not open: drive_1 is gone"]
    row = {"entry": 7, "hash": None, "error": "No space left on device"}
    monkeypatch.setitem(STATUS, "interventions", row)
    text = "warning: the intervention log is not written: No space left on device"
    assert rig.do("state")[2:] == [text]
    monkeypatch.setitem(STATUS, "interventions", None)
    assert len(rig.do("state")) == 2
    counts = {"on_time": 9, "late": 1, "missed": 2, "torn": 0}
    reads = {"client": 3, "outputs": 0, "misses": 0, "state": "reads"} | counts
    writes = {"client": 4, "outputs": 2, "misses": 5, "state": "runs"} | counts
    monkeypatch.setitem(STATUS, "in_cycle", [reads, writes])
    assert rig.do("state")[2:] == [
        "client 3 reads in the cycle",
        "client 4 in the cycle: runs, 2 outputs; sent 9 times in time, 1 late; 2 cycles without, "
        "5 in a row allowed",
    ]
    monkeypatch.delitem(STATUS, "in_cycle")


def test_a_bus_that_comes_up_already_is_only_waited_for(master, rig):
    master.state = "starting"
    with pytest.raises(ConsoleError) as caught:
        rig.do("start for 0s")
    assert str(caught.value).endswith("start: fsn-master is starting")
    assert "start" not in master.asked


CLOCKS = {
    "state": "synchronous", "set_by": "bus", "reference": "el6910", "subdevices": 2, "outside": 0,
    "leaves": 0, "window_ns": 1000, "worst_ns": 38, "shift_ns": 1, "lead_ns": 1, "place": "",
}  # fmt: skip


@pytest.mark.parametrize(
    ("part", "row", "text"),
    [
        ("ring", {"state": "closed", "place": ""}, "ring closed"),
        ("ring", {"state": "open", "place": "behind a"}, "warning: ring open: behind a"),
        ("clocks", {}, "distributed clocks synchronous: all within 38 ns of el6910"),
        ("clocks", {"state": "unknown", "subdevices": 0}, "distributed clocks unknown"),
        (
            "clocks",
            {"state": "apart", "place": "b is 2000 ns from a"},
            "warning: distributed clocks apart: b is 2000 ns from a",
        ),
    ],
)
def test_the_state_shows_ring_and_clocks_that_are_in_use(rig, monkeypatch, part, row, text):
    whole = {"ring": {"ways": [1, 1], "breaks": 0}, "clocks": CLOCKS}[part]
    assert text not in rig.do("state")
    monkeypatch.setitem(STATUS, part, whole | row)
    assert text in rig.do("state")


def test_the_state_names_who_is_not_in_op(master, rig, monkeypatch):
    device = master._device

    def lacking(name, position):
        row = device(name, position)
        return row if name == "drive_1" else row | {"al": "PREOP", "detail": "why"}

    monkeypatch.setattr(master, "_device", lacking)
    assert rig.do("state")[1:] == ["drive_2  PREOP  alias 0 position 1  error: PREOP: why"]


def test_an_output_that_a_copy_writes(master, rig):
    master.symbols[0]["open"] = False
    (row,) = [line for line in rig.do("list") if line.startswith("logic.ack")]
    assert row.split() == ["logic.ack", "bool", "0", "copy", "or", "FSoE", "restart", "relevant"]


def test_values_that_are_refused(master, rig):
    master.refuse["get"] = {"error": "FSN_E_STATE", "text": "the bus does not run"}
    assert rig.do("list logic.ack")[1].split() == [
        "logic.ack", "bool", "-", "free", "restart", "relevant",
    ]  # fmt: skip
    with pytest.raises(ControlRefused, match="get: the bus does not run"):
        rig.do("get logic.ack")


def test_loud_events_are_noted_at_the_prompt(master, rig, monkeypatch):
    monkeypatch.setattr(rig.console, "_notes_level", "warning")
    rig.do("events on")
    for level, kind in (("info", "x"), ("warning", "edge"), ("warning", "x")):
        master.send_event(event=kind, level=level, text=f"{level} of {kind}")
    while not rig.notes:
        rig.do("wait 1ms")
    assert rig.notes == ["U warning warning of x"]


def test_events_are_reported_for_a_time(master, rig):
    rig.do("events on")
    master.send_event(event="x", text="told")
    found = rig.do("events for 1ms")
    while not found:
        found = rig.do("events for 150ms")
    assert found == ["U info told"]


@pytest.mark.parametrize(
    ("before", "words"),
    [
        ("on-error ", ["continue", "stop"]),
        ("events ", ["for", "off", "on"]),
        ("start ", ["for"]),
        ("stop ", ["for"]),
        ("restart ", ["for"]),
    ],
)
def test_words_that_complete_a_command(before, words, rig):
    names = rig.console.names()
    assert sorted(complete(before, "", names, [])) == words


def test_the_longest_number_has_64_bits_one_by_one():
    assert number("0b" + "1" * 64, "value") == 2**64 - 1
    with pytest.raises(ConsoleError) as caught:
        number("0b" + "1" * 65, "value")
    assert str(caught.value) == f"0b{'1' * 22}: a value is a number from 0"


def test_a_server_that_does_not_answer(master, rig):
    with pytest.raises(EnvironmentFault) as caught:
        rig.link.call(lambda _: time.sleep(0.5), wait_s=0.01)
    assert str(caught.value) == f"fsn-master does not answer on {master.path}"
