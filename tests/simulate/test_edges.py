"""What the parts of a run do at their edges: bounds, nothing there, what a system refuses."""

from __future__ import annotations

import hashlib
import io
import os
import socket
import tarfile
import threading
from pathlib import Path
from types import SimpleNamespace as Facts
from typing import Any

import pytest
from live.support import needs_core
from simulate.made_session import session

from fsoe_net.diag.diagnostic import Span
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.own.network import load_network
from fsoe_net.live import build_master, sockets
from fsoe_net.live.bus_events import BusEvents
from fsoe_net.live.live_capture import LiveCapture
from fsoe_net.live.packet_socket import _SO_TIMESTAMPNS, _TIME, PacketSocket, _time_ns
from fsoe_net.model.resolve import resolve
from fsoe_net.model.scenario import Action, ScenarioStep
from fsoe_net.simulate.bus import build_network
from fsoe_net.simulate.device_logic import stdout_to_stderr
from fsoe_net.simulate.emulate import serve
from fsoe_net.simulate.emulated_documents import fsoe_json
from fsoe_net.simulate.faults import apply_step
from fsoe_net.simulate.incidents import IncidentRecorder
from fsoe_net.simulate.live_objects import _parameters_at
from fsoe_net.simulate.scenario_check import ScenarioNames, check_step
from fsoe_net.simulate.session import counted_session_ids
from fsoe_net.test_record.steps import _merged

HERE = Span("x", 1, 1)


# -- bounds --------------------------------------------------------------------------------------


def test_events_of_a_story_are_bounded_and_counted(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("fsoe_net.live.bus_events._MAX_EVENTS", 2)
    events = BusEvents(start_ns=0)
    events.take({"event": "lost", "text": "3 events were lost", "now_ns": 5})
    events.take({"event": "wkc", "text": "incomplete", "now_ns": 6})
    events.take({"event": "state", "text": "stopped", "now_ns": 7})
    assert [(e.source, e.text) for e in events.events] == [
        ("fsn-master", "3 events were lost"),
        ("bus", "incomplete"),
    ]
    assert events.events_lost == 2  # what was told as lost, and the third one


@needs_core
def test_events_of_a_run_are_bounded_and_counted(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("fsoe_net.simulate.engine._MAX_EVENTS", 1)
    engine = session().engine
    engine.log(1_000_000, "run", "one")
    engine.log(2_000_000, "run", "two")
    assert [(e.text, e.time_ms) for e in engine.events] == [("one", 1)]
    assert engine.events_lost == 1


def test_frames_come_a_thousand_at_a_time():
    data = _TIME.pack(7, 5)
    stamped = [(socket.SOL_SOCKET, 0, b""), (socket.SOL_SOCKET, _SO_TIMESTAMPNS, data)]
    listening = PacketSocket.__new__(PacketSocket)
    listening._socket = Facts(  # type: ignore[assignment]
        settimeout=lambda _: None, recvmsg=lambda *_: (b"x", stamped, 0, ("eth1", 0, 4))
    )
    found = listening.packets(0.1)
    assert len(found) == 1000
    assert (found[0].time_ns, found[0].outbound) == (7_000_000_005, True)
    assert _time_ns([]) == 0


# -- nothing there ---------------------------------------------------------------------------------


@needs_core
def test_a_run_without_a_scenario_has_no_findings():
    assert session().scenario_findings() == []


@needs_core
def test_an_incident_before_the_first_cycle_is_none(tmp_path: Path):
    recorder = IncidentRecorder(session(), tmp_path)
    recorder.request("too early")
    recorder.finish(0)
    assert (recorder.files, list(tmp_path.iterdir())) == ([], [])


@needs_core
def test_a_device_without_fsoe_reports_nothing_of_it(tmp_path: Path):
    base = Path(__file__).parents[1] / "diagnostics" / "base"
    text = (base / "timed.yaml").read_text("utf-8").replace("devices/", f"{base}/devices/")
    row = f"  - {{name: other, position: 3, config: {base}/devices/ek1914.yaml}}\nnets:\n"
    text = text.replace("nets:\n", row, 1)
    text = text.replace("in: {ec_module: io, index: 0x6010", "in: {ec_module: other, index: 0x6010")
    path = tmp_path / "network.yaml"
    path.write_text(text, "utf-8")
    network = load_network([path]).network
    assert network is not None
    devices = build_network(resolve(network), counted_session_ids())
    assert sorted(devices.devices) == ["io", "io2", "logic", "other"]
    assert [row["subdevice"] for row in fsoe_json(devices)] == ["io", "io2", "logic"]


def test_a_capture_waits_for_images():
    written: list[Any] = []
    recorder: Any = Facts(
        skipped=0, _frames=None, packets=0, _wire=None, _client=None, _stop=threading.Event(),
        _writer=Facts(packet=lambda *row, **_: written.append(row)), _epoch_ns=0,
    )  # fmt: skip
    client: Any = Facts(watched=lambda _: [Facts(skipped=3, image=None)])
    LiveCapture._images(recorder, client, 0.0)
    assert (recorder.skipped, recorder.packets, written) == (3, 0, [])
    recorder._stop.set()
    LiveCapture._take(recorder, 1.0)  # it ends: nobody is waited for


def block(index: int) -> Any:
    return Facts(command=Facts(index=index))


@pytest.mark.parametrize(
    ("source", "place"),
    [
        (None, 0),
        (block(0x6760), 0x6791),
        (block(0x6010), 0x9011),
        (block(0x7020), 0x9021),
        (block(0xE610), 0xE911),
        (block(0xE720), 0xE921),
        (block(0x2000), 0),
    ],
)
def test_places_of_parameters(source: Any, place: int):
    transfer = Facts(source=Facts(block=source))
    port: Any = Facts(is_main=True, setup=Facts(connection=Facts(to_sub=transfer)))
    assert _parameters_at(port) == place


# -- steps -----------------------------------------------------------------------------------------


class Recorder:
    """A segment that writes down what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[Any, ...]] = []
        self.names = ("a", "b")

    def position(self, name: str) -> int:
        return self.names.index(name)

    def __getattr__(self, name: str) -> Any:
        return lambda *words: self.told.append((name, *words))


@pytest.mark.parametrize(
    ("action", "more", "told"),
    [
        (Action.MAILBOX_DELAY, {"values": {"a": 5}}, ("set_mailbox_delay", 0, 5_000_000)),
        (Action.AL_DELAY, {"values": {"b": 5}}, ("set_al_delay", 1, 5_000_000)),
        (Action.RX_ERRORS, {"values": {"b": 5}}, ("rx_errors", 1, 0, 5)),
        (Action.DELAY, {"number": 7}, ("set_delay", 7000)),
        (Action.STALL, {"number": 7}, ("stall", 7_000_000)),
        (Action.CUT, {"target": "main"}, ("set_link", None, False)),
        (Action.SPLICE, {"target": "b"}, ("set_link", 1, True)),
        (Action.SWAP, {"target": "a", "other": "b"}, ("swap", 0, 1)),
        (Action.RIGHT, {"target": "b"}, ("set_identity", 1, None)),
        (Action.NARROW_CLOCK, {"target": "b"}, ("set_clock_bits", 1, 32)),
        (
            Action.WRONG,
            {"target": "b", "values": {"vendor": 1, "revision": 3}},
            ("set_identity", 1, (1, 0, 3)),
        ),
        (
            Action.SDO_ABORT,
            {"target": "a", "values": {"index": 0x1C12, "code": 9}},
            ("set_sdo_abort", 0, 0x1C12, None, 9),
        ),
        (Action.POWER_CYCLE, {"target": "a"}, ("power_cycle", 0)),
        (Action.PRESS, {"target": "reset"}, None),
    ],
)
def test_steps_act_on_a_segment(action: Action, more: dict[str, Any], told: tuple[Any, ...] | None):
    segment: Any = Recorder()
    apply_step([segment], ScenarioStep(span=HERE, at_ns=0, action=action, **more))
    assert segment.told == ([] if told is None else [told])


@pytest.mark.parametrize(
    ("action", "more", "text"),
    [
        (Action.MAILBOX_DELAY, {"values": {"a": 1}}, ""),
        (Action.RX_ERRORS, {"values": {"a": 256}}, "a cannot be 256; it holds 0 … 255"),
        (Action.AL_DELAY, {"values": {"x": 1}}, "this network has no SubDevice 'x'"),
        (Action.NARROW_CLOCK, {"target": "x"}, "this network has no SubDevice 'x'"),
    ],
)
def test_targets_of_a_step_on_a_segment(action: Action, more: dict[str, Any], text: str):
    names = ScenarioNames(
        safe_inputs={}, safe_outputs={}, inputs={}, outputs={}, subdevices=frozenset("a"),
        devices=frozenset(), connections=frozenset(), groups=frozenset(),
        subs=frozenset(), axes=frozenset(), logics=frozenset(), segment=True,
    )  # fmt: skip
    found = check_step(ScenarioStep(span=HERE, at_ns=0, action=action, **more), names)
    assert "".join(d.message for d in found) == text


def test_a_step_that_is_new_is_taken_as_it_is():
    step: Any = object()
    assert _merged(step, None) is step


def test_a_segment_is_served_until_its_time_is_over():
    class Segment:
        linked: Any = None

        def __enter__(self) -> Segment:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def link(self, link: Any) -> None:
            self.linked = link

    stepped: list[int] = []
    updates: list[int] = []
    segment = Segment()
    served: Any = Facts(
        segment=segment, segments=[segment], step_devices=stepped.append, result=lambda now: now
    )
    link: Any = "eth1"
    end = serve(served, link, 3_000_000, on_update=lambda _, now: updates.append(now))
    assert int(end) >= 3_000_000  # type: ignore[call-overload]
    assert (served.segment.linked, stepped[0], updates) == ("eth1", 0, [0])


# -- what a system refuses -------------------------------------------------------------------------


def test_a_device_may_print_where_no_output_is_open(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def closed(_number: int) -> int:
        raise OSError(9, "Bad file descriptor")

    monkeypatch.setattr(os, "dup", closed)
    monkeypatch.setattr(os, "dup2", lambda *_: None)
    with stdout_to_stderr():
        print("told")  # noqa: T201
    assert capsys.readouterr() == ("", "told\n")


@pytest.mark.parametrize(
    ("writable", "answers", "found"),
    [
        (True, "eth1", "control.sock"),
        (True, "eth2", None),
        (False, "eth1", None),  # of another user, and nothing says that it drives this interface
    ],
)
def test_the_socket_of_an_interface(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, writable: bool, answers: str, found: str | None
):
    path = str(tmp_path / "control.sock")
    monkeypatch.setattr(sockets, "_sockets", lambda _: iter([path]))
    monkeypatch.setattr(sockets, "_same_network", lambda _: True)
    monkeypatch.setattr(sockets, "interface_of", lambda _: answers)
    monkeypatch.setattr(os, "access", lambda *_: writable)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    assert sockets.find_socket("eth1") == (path if found else None)
    expected = path if found else str(tmp_path / "fsn-master-eth1.sock")
    assert sockets.control_socket("eth1") == expected


def test_a_socket_that_may_not_be_used_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    path = str(tmp_path / "fsn-master-eth1.sock")
    monkeypatch.setattr(sockets, "_sockets", lambda _: iter([path]))
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(EnvironmentFault) as refused:
        sockets.find_socket("eth1")
    assert str(refused.value) == (
        f"{path}: an fsn-master may drive eth1, but you may not connect; --allow-user NAME of "
        "fsn-master permits it"
    )


def test_soem_is_fetched_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    name = f"pysoem-{build_master._PYSOEM}"
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w:gz") as tar:
        head = tarfile.TarInfo(f"{name}/soem/soem/ethercatmain.h")
        tar.addfile(head, io.BytesIO())
    fetched: list[str] = []

    def pip(_arguments: object, package: str, _refusal: str) -> None:
        fetched.append(package)
        (tmp_path / f"{name}.tar.gz").write_bytes(packed.getvalue())

    monkeypatch.setattr(build_master, "_pip", pip)
    monkeypatch.setattr(build_master, "_SHA256", hashlib.sha256(packed.getvalue()).hexdigest())
    for _ in range(2):
        assert build_master.fetch_soem(tmp_path) == tmp_path / name / "soem"
    assert fetched == [f"pysoem=={build_master._PYSOEM}"]


def test_cmake_is_fetched_where_it_is_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    fetched: list[str] = []
    monkeypatch.setattr(build_master, "_pip", lambda *row: fetched.append(row[1]))
    monkeypatch.setattr(build_master.shutil, "which", lambda _: None)
    monkeypatch.setattr(build_master.sys, "executable", str(tmp_path / "python"))
    call, env = build_master._cmake(tmp_path)
    assert (call, fetched) == ([str(tmp_path / "cmake" / "bin" / "cmake")], ["cmake"])
    assert env == {"PYTHONPATH": str(tmp_path / "cmake")}


def test_an_installation_without_the_c_source(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(build_master, "__file__", str(tmp_path / "a" / "b" / "c.py"))
    with pytest.raises(EnvironmentFault, match="the C source is not part of this installation"):
        build_master._source()


def test_pip_is_asked(monkeypatch: pytest.MonkeyPatch):
    asked: list[list[str]] = []
    monkeypatch.setattr(build_master, "_run", lambda words, *_: asked.append(list(words)))
    build_master._pip(["download"], "x==1", "no x")
    assert [words[1:3] + words[-2:] for words in asked] == [["-m", "pip", "download", "x==1"]]
    monkeypatch.setattr(build_master.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(EnvironmentFault) as refused:
        build_master._pip(["download"], "x==1", "no x")
    assert str(refused.value) == "no x: this Python has no pip"
