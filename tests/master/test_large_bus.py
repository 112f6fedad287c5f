"""A bus of 400 SubDevices, 392 connections and 9 408 values, through every reader."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from cli.tool import fsn
from incident.rig import read
from master.rig import Master
from master.rig import running as master_running
from networks import write_big_network

import fsoe_net
from fsoe_net.errors import ControlRefused
from fsoe_net.live.attachment import Attachment
from fsoe_net.testing.fake_master import FakeMaster

SUBDEVICES, CONNECTIONS, VALUES = 400, 392, 12
EACH = "".join(
    f"      - {{index: 0x{index:04x}, sub_index: {sub}, type: uint16}}\n"
    for index in (0x3000,)
    for sub in range(1, VALUES + 1)
)


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the network: terminals with values beside their frames, in both directions."""
    folder = tmp_path_factory.mktemp("large")
    network = write_big_network(folder, SUBDEVICES, 2 * CONNECTIONS)
    terminal = folder / "terminal.yaml"
    text = terminal.read_text("utf-8")
    for group, pdo, index in (("rpdo", 0x1601, "3000"), ("tpdo", 0x1A01, "3001")):
        more = f"  - index: 0x{pdo:04x}\n    channels:\n{EACH.replace('3000', index)}"
        head, body = text.split(f"{group}:\n")
        first, _, rest = body.partition("\n\n")
        text = f"{head}{group}:\n{first}\n{more}\n{rest}"
    terminal.write_text(text, "utf-8")
    return network


@pytest.fixture(scope="module")
def bus(large: Path) -> Iterator[Master]:
    with master_running(network=large) as master:
        yield master


def test_every_page_comes_once(bus: Master) -> None:
    with fsoe_net.connect(str(bus.path)) as client:
        snapshot = client.snapshot()
        names = [s.name for s in snapshot.subdevices]
        assert names == [f"s{n}" for n in range(SUBDEVICES)]
        assert [s.name for s in client.subdevices()] == names
        assert len(snapshot.cycle.connections) == CONNECTIONS
        connections = [c.name for c in client.connections()]
        assert len(set(connections)) == CONNECTIONS
        layout = client.layout()
        assert [c.name for c in layout.connections] == connections
        assert len(layout.copies) == 2 * CONNECTIONS
        symbols = client.symbols()
        assert len({(s.is_output, s.name) for s in symbols}) == 2 * CONNECTIONS * VALUES


def test_a_page_holds_what_fits_and_names_the_next_one(bus: Master) -> None:
    with bus.client() as client:
        first = client.good("snapshot")
        second = client.good(f"snapshot {first['next']}")
        assert 1 < len(first["connections"]) < CONNECTIONS
        assert len(json.dumps(first)) < 256 * 1024
        names = [row["name"] for row in (*first["connections"], *second["connections"])]
        assert len(set(names)) == len(names)
        last = client.good(f"snapshot {CONNECTIONS + SUBDEVICES - 1}")
        assert [row["name"] for row in last["subdevices"]] == [f"s{SUBDEVICES - 1}"]
        assert "next" not in last
        beyond = client.good("snapshot 100000")
        assert (beyond["connections"], beyond["subdevices"]) == ([], [])
        assert client.ask("snapshot x")["text"] == "the first row of a page is a number"


def test_monitor_console_verify_and_studio_read_it(bus: Master, large: Path) -> None:
    where = ("--socket", str(bus.path))
    done = fsn("monitor", *where, "--once", "--format", "json")
    found = json.loads(done.stdout)
    assert found["current"] is True
    assert found["refused"] is None
    assert len(found["connections"]) == CONNECTIONS
    assert len(found["subdevices"]) == SUBDEVICES
    shown = fsn("monitor", *where, "--once")
    assert "does not run" not in shown.stdout + shown.stderr
    lines = fsn("console", *where, "-c", "state; connections; list s1; get all").stdout.splitlines()
    assert f"0 of {CONNECTIONS} connections in Data" in lines[0]
    assert sum(" frames" in line for line in lines) == CONNECTIONS
    assert sum(line.startswith("s399.0x3001:0c") for line in lines) == 1
    several = fsn("console", *where, "-c", "get all.0x3001:0c; get all.0x3000:01")
    assert (several.returncode, several.stderr) == (0, "")
    assert len(several.stdout.splitlines()) == 2 * CONNECTIONS
    assert {line.split()[1] for line in several.stdout.splitlines()} == {"0"}
    verified = fsn("acceptance", "verify", "--accepted", str(large), *where)
    assert verified.returncode == 0, verified.stderr
    assert f"parameters of 0 of {CONNECTIONS} connections observed" in verified.stdout


def test_a_report_and_a_page_of_it(bus: Master, large: Path) -> None:
    where = ("--socket", str(bus.path))
    made = fsn("report", str(large), *where, "-o", str(large.with_name("report.json")))
    assert made.returncode in (0, 1), made.stderr
    page = large.with_name("page.html")
    made = fsn("studio", str(large), *where, "--snapshot", str(page))
    assert made.returncode == 0, made.stderr
    assert f"s{SUBDEVICES - 1}" in page.read_text("utf-8")


@pytest.mark.weekly
def test_ros_gets_its_health_and_its_values(bus: Master) -> None:
    from ros2.rig import Peer, bridged, typestore

    array = "diagnostic_msgs::msg::dds_::DiagnosticArray_"
    store = typestore()
    with (
        bridged(bus.path) as domain,
        Peer("listen", domain, "rt/diagnostics", array, 1) as peer,
    ):
        found = store.deserialize_cdr(next(peer.payloads()), "diagnostic_msgs/msg/DiagnosticArray")
    names = [row.name for row in found.status]
    assert sum(name.startswith("cell: SubDevice ") for name in names) == SUBDEVICES
    assert sum(name.startswith("cell: connection ") for name in names) == CONNECTIONS
    (state,) = [row.message for row in found.status if row.name == "cell: bus"]
    assert "does not run" not in state


def test_an_incident_of_it_is_written(large: Path, tmp_path: Path) -> None:
    with (
        master_running("--incidents", tmp_path, network=large) as master,
        master.client() as client,
    ):
        client.good("events on")
        client.good("incident test")
        written = client.event("incident")
        assert written["whole"] is True
    incident = read(tmp_path / written["file"])
    assert len(incident.planned) == CONNECTIONS


def test_values_of_every_cycle_fit_a_line(bus: Master) -> None:
    with fsoe_net.connect(str(bus.path)) as client:
        seen = next(client.watch("*", every=50))
        assert len(seen.inputs) == len(seen.outputs) == CONNECTIONS * VALUES


def test_an_attachment_reports_a_refusal_from_a_stop() -> None:
    with FakeMaster() as master, Attachment(master.path) as attached:
        assert attached.look(0.0).current
        master.refuse["snapshot"] = {"error": "FSN_E_SPACE", "text": "the reply is too long"}
        view = attached.look(0.0)
        assert (view.current, view.refused) == (False, "snapshot: the reply is too long")
        master.refuse["snapshot"] = {"error": "FSN_E_STATE", "text": "the bus is stopped"}
        view = attached.look(0.0)
        assert (view.current, view.refused) == (False, "")
        master.refuse.clear()
        assert attached.look(0.0).current


def test_pages_without_an_end_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fsoe_net.live.control_link._MOST_PAGES", 3)
    with FakeMaster() as master, fsoe_net.connect(str(master.path)) as client:
        monkeypatch.setattr(master, "_reply", lambda *_: {"ok": True, "symbols": [], "next": 1})
        with pytest.raises(fsoe_net.FsnError, match="symbols of more than 3 pages"):
            client.symbols()
        with pytest.raises(fsoe_net.FsnError) as ended:
            client.status()
        assert not isinstance(ended.value, ControlRefused)
