"""Every request of the control protocol through its typed method."""

import itertools
import sys
import tempfile
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from wires import missing, run_inside

from fsoe_net.errors import ControlRefused, EnvironmentFault
from fsoe_net.live.client import Client
from fsoe_net.live.console.names import SymbolNames
from fsoe_net.live.control_values import BusState
from fsoe_net.live.sockets import control_socket, find_socket
from fsoe_net.testing import fake_master
from fsoe_net.testing.fake_master import FakeMaster


@pytest.fixture
def master():
    with FakeMaster() as found:
        yield found


@pytest.fixture
def client(master):
    with Client(master.path) as found:
        yield found


def test_state_and_values(master, client):
    status = client.status()
    assert (status.state, status.in_op, status.fault) == (BusState.RUNNING, 2, "")
    target, actual = (s for s in client.symbols() if s.name == "drive_1.position")
    assert (target.subdevice, target.entry, target.index) == ("drive_1", "position", 0x607A)
    assert (target.factor, target.is_output, target.client) == (0.5, True, None)
    assert (actual.is_output, actual.index, actual.open) == (False, 0x6064, False)
    assert client.set({"drive_1.0x6040:00": 6, "drive_2.0x6040:00": 15}) == 2
    found = client.get("drive_1.0x6040:00", "drive_2.0x6040:00")
    assert (found.cycle, list(found.outputs.values()), found.inputs) == (9, [6, 15], {})
    assert client.arm("logic.ack") == 10_000
    assert client.lease(500) == 500
    assert client.connections()[0].state == "data_process"
    client.set({"drive_1.position": 700})
    both = client.get("drive_1.position", typed=True)
    assert master.asked[-1] == "get --typed drive_1.position"
    assert both.outputs == {"drive_1.position": 700}
    assert both.inputs == {"drive_1.position": 0}  # where the axis is, not where it shall go


CLOCKS = {
    **dict.fromkeys(("state", "set_by", "reference", "place"), ""),
    **dict.fromkeys(("subdevices", "outside", "leaves", "window_ns"), 0),
    **dict.fromkeys(("worst_ns", "shift_ns", "lead_ns"), 0),
}
CLIENT = {"state": "runs"} | dict.fromkeys(
    ("client", "outputs", "misses", "on_time", "late", "missed", "torn"), 3
)


@pytest.mark.parametrize(
    ("key", "row"), [("clocks", CLOCKS), ("standby", {"pid": 7, "held": True}), ("client", CLIENT)]
)
def test_unknown_keys_of_a_newer_fsn_master_are_ignored(client, monkeypatch, key, row):
    newer = row | {"temperature": 40}
    part = {"in_cycle": [newer]} if key == "client" else {key: newer}
    monkeypatch.setattr(fake_master, "STATUS", fake_master.STATUS | part)
    status = client.status()
    record = status.in_cycle[0] if key == "client" else getattr(status, key)
    assert asdict(record) == row


@pytest.mark.parametrize(
    ("name", "entry"),
    [
        ("cell.drive.0x607a:00", "0x607a:00"),
        ("cell.drive.axis.position", "axis.position"),
    ],
)
def test_a_subdevice_may_have_points_in_its_name(client, name, entry):
    symbol = replace(client.symbols()[0], name=name, subdevice="cell.drive")
    assert symbol.entry == entry
    assert SymbolNames([symbol]).some("cell.drive") == [symbol]


def test_values_are_written_as_the_protocol_has_them(master, client):
    client.set({"drive_1.position": -1.5e-07, "logic.ack": True}, typed=True)
    assert master.asked[-1] == "set --typed drive_1.position=-1.5e-07 logic.ack=true"
    with pytest.raises(ControlRefused, match=r"set: drive_1\.0x6041:00 is closed"):
        client.set({"drive_1.0x6041:00": 1})


def test_bus_and_devices(master, client):
    assert client.stop() is BusState.RUNNING
    assert client.start() is BusState.STOPPED
    assert client.sdo_read("drive_1", 0x6041, 0, "uint16").data == b"\x27\x02"
    client.sdo_write("drive_1", 0x6060, 0, kind="int8", value=-1)
    assert len(client.sii_read("drive_1")) == 32
    client.alias_write("drive_1", 7)
    assert client.history("drive_1")[0].parameters == (7,)
    assert client.scan().subdevices[0]["al"] == "OP"
    assert client.incident("a b") == "x.fsnincident"
    layout = client.layout()
    assert (layout.image_bytes, layout.datagrams[0].expected_wkc) == (12, None)
    assert layout.connections[0].to_main.source_byte == 6
    assert "sdo-read drive_1 0x6041 0 uint16" in master.asked
    assert "sdo-write drive_1 0x6060 0 int8 -1" in master.asked
    assert "incident a b" in master.asked


def test_watch_reports_what_was_skipped(master, client):
    found = []
    for cycle in client.watch("drive_1.0x6041:00", every=10):
        found.append(cycle)
        if cycle.cycle == 50:
            break
    assert [c.skipped for c in found] == [0, 0, 2]
    assert found[0].inputs == {"drive_1.0x6041:00": 0x27}
    assert client.status().cycles == 5
    assert master.asked[-3:] == ["watch 10 drive_1.0x6041:00", "watch off", "status"]


def test_watch_of_the_image_and_events_do_not_mix(master, client):
    client.subscribe()
    master.send_event(event="wkc")
    cycle = next(iter(client.watch(image=True)))
    assert (cycle.image, cycle.expected_wkc, cycle.actual_wkc) == (b"\x0a\xff", 3, 2)
    assert [e["event"] for e in client.events(5.0)] == ["wkc"]


def test_more_cycles_than_anybody_reads_are_counted(master, client, monkeypatch):
    monkeypatch.setattr("fsoe_net.live.control_link._MAX_EVENTS", 2)
    client.watch_on("drive_1.0x6041:00")
    client.status()  # its reply stands behind all three
    found = client.watched(1.0)
    assert [(c.cycle, c.skipped) for c in found] == [(20, 1), (50, 2)]


def test_a_bus_without_cycles_ends_the_watch(master, client, monkeypatch):
    monkeypatch.setattr("fsoe_net.live.client._SILENT_S", 0.05)
    with pytest.raises(EnvironmentFault, match="no cycle has come"):
        list(client.watch("drive_1.0x6041:00"))
    assert [c.cycle for c in client.watch("drive_1.0x6041:00", duration_s=0.01)] == [10, 20, 50]


def test_a_watch_that_is_held_up_yields_what_has_come(master, client, monkeypatch):
    """The time is over at every look at the clock."""
    clock = itertools.count(step=3600.0)
    late = SimpleNamespace(monotonic=lambda: next(clock))
    monkeypatch.setattr("fsoe_net.live.client.time", late)
    assert [c.cycle for c in client.watch("drive_1.0x6041:00", duration_s=0.01)] == [10, 20, 50]


def test_a_broken_connection_is_reported_each_time(master, client):
    master.drop()
    for _ in range(2):
        with pytest.raises(EnvironmentFault, match=r"broke: (fsn-master has|Broken pipe)"):
            client.status()
    assert client.closed


def test_a_reply_without_its_keys_is_one_of_another_version(master, client, monkeypatch):
    monkeypatch.setattr("fsoe_net.testing.fake_master.SCAN", {"scan": 1})
    with pytest.raises(EnvironmentFault, match="of one version"):
        client.scan()


def test_where_the_socket_is(tmp_path, monkeypatch):
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert control_socket("if/0") == str(tmp_path / "fsn-master-if_0.sock")


def test_the_socket_of_another_container_is_not_ours(monkeypatch):
    """Its interface has the same name; its processes and network are not seen from here."""
    if why := missing():
        pytest.skip(why)
    look = "from fsoe_net.live.sockets import find_socket; print(find_socket('eth1'))"
    with tempfile.TemporaryDirectory(prefix="fsn-") as folder:
        monkeypatch.setenv("RUNTIME_DIRECTORY", folder)
        master = FakeMaster(Path(folder) / "fsn-master-eth1.sock")
        assert find_socket("eth1") == str(master.path)
        done = run_inside(sys.executable, "-c", look)
        master.close()
    assert (done.stdout, done.stderr) == ("None\n", "")
