"""A bus in a domain of DDS, seen and acted on by another vendor's implementation and by callers."""

from __future__ import annotations

import contextlib
import json
import math
import queue
import re
import select
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from master.rig import Client, Master
from master.rig import running as master_running
from networks import EXAMPLES
from patience import PATIENCE_S
from ros2.caller import Caller
from ros2.found import Found
from ros2.rig import ROOT, Peer, bridged, needed, own_domain, typestore
from weekly import examples

from fsoe_net.errors import EnvironmentFault
from fsoe_net.ros2 import control, messages, node, objects
from fsoe_net.ros2.messages import HASHES, SIGNALS, DiagnosticArray, TriggerRequest
from fsoe_net.ros2.values import SignalKind
from fsoe_net.testing import fake_master
from fsoe_net.testing.fake_master import FakeMaster

STORE = typestore()
ARRAY = "diagnostic_msgs::msg::dds_::DiagnosticArray_"
JOINTS = "sensor_msgs::msg::dds_::JointState_"
BOOL = "std_msgs::msg::dds_::Bool_"
UINT64 = "std_msgs::msg::dds_::UInt64_"
HARDWARE = "control_msgs::msg::dds_::HardwareStatus_"
LAMP = "el2904.standard_1"
LAMP_TOPIC = "rt/cell/outputs/el2904/standard_1"
DRIVE = 4  # position of drive_1
RESET = 1


def arrays(peer: Peer) -> Iterator[dict[str, Any]]:
    """Yield what another vendor received, as another program decodes it, by name."""
    for payload in peer.payloads():
        array = STORE.deserialize_cdr(payload, "diagnostic_msgs/msg/DiagnosticArray")
        yield {row.name: row for row in array.status}


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Master]:
    """Run the example with positions in units: counts of a drive are no joint states."""
    folder = shutil.copytree(EXAMPLES / "el6910", tmp_path_factory.mktemp("robot") / "el6910")
    drive = folder / "devices" / "circulo.yaml"
    text, count = re.subn(r"(state_interface: (?:position|velocity|effort))", r"\1, factor: 0.001",
                          drive.read_text("utf-8"))  # fmt: skip
    assert count > 0
    drive.write_text(text, "utf-8")
    with master_running(network=folder / "network.yaml") as master:
        yield master


@pytest.fixture
def lamp(robot: Master) -> Iterator[Client]:
    """Whoever reads the lamp."""
    client = robot.client()
    yield client
    client.close()


def test_another_vendor_reads_an_error_at_most_two_pictures_after_a_reset() -> None:
    """A picture comes every quarter of a second, so this is within the second that is promised."""
    with (
        FakeMaster() as master,
        bridged(master.path) as domain,
        Peer("listen", domain, "rt/diagnostics", ARRAY, 1000) as peer,
    ):
        seen = arrays(peer)
        first = next(seen)
        rows = ["cell: bus", "cell: SubDevice drive_1", "cell: connection c1"]
        assert list(first)[:3] == rows  # and of joints, once its symbols were read
        assert [first[row].level for row in rows] == [0, 0, 0]
        assert first["cell: bus"].hardware_id == "eth1"
        while next(seen)["cell: connection c1"].level != 0:
            pass
        master.connection_state = RESET
        after = [next(seen)["cell: connection c1"] for _ in range(3)]
        # One may have been on its way, and one made of what was read before.
        assert after[2].level == 2
        assert after[2].message == "Reset; not in Data"


def devices(peer: Peer) -> Iterator[Any]:
    """Yield the devices of each hardware status as another program decodes them."""
    for payload in peer.payloads():
        status = STORE.deserialize_cdr(payload, "control_msgs/msg/HardwareStatus")
        yield status.hardware_device_states


@pytest.mark.parametrize(
    ("change", "health", "connectivity", "al"),
    [
        ({}, 1, 1, (8, False, 0)),
        ({"al": "SAFEOP+ERROR", "al_code": 0x1B}, 4, 1, (4, True, 0x1B)),
        ({"al": "BOOT", "al_code": None}, 4, 1, (3, False, 0)),
        ({"al": "none", "found": 9}, 1, 2, (0, False, 0)),
        ({"detail": "port 1 is open"}, 3, 1, (8, False, 0)),
        ({"known": False}, 0, 0, (0, False, 0)),
    ],
)
def test_hardware_status_has_the_constants_of_control_msgs(
    monkeypatch: pytest.MonkeyPatch,
    change: dict[str, object],
    health: int,
    connectivity: int,
    al: tuple[int, bool, int],
) -> None:
    for key, value in change.items():
        monkeypatch.setitem(fake_master.SUBDEVICE, key, value)
    with (
        FakeMaster() as master,
        bridged(master.path) as domain,
        Peer("listen", domain, "rt/cell/hardware_status", HARDWARE, 1) as peer,
    ):
        ((device,),) = devices(peer)
    (state,), (ethercat,) = device.hardware_status, device.ethercat_states
    assert (device.device_id, ethercat.slave_position) == ("drive_1", 0)
    identity = (ethercat.vendor_id, ethercat.product_code)
    assert identity == (("0x00000002", "0x00000003") if change.get("known", True) else ("", ""))
    assert (state.health_status, state.connectivity_status) == (health, connectivity)
    assert (ethercat.al_state, ethercat.has_error, ethercat.al_status_code) == al
    assert (list(state.error_domain), state.operational_mode, state.power_state) == ([], 0, 0)


def test_hardware_status_of_a_stopped_bus_is_unknown() -> None:
    with (
        FakeMaster() as master,
        bridged(master.path) as domain,
        Peer("listen", domain, "rt/cell/hardware_status", HARDWARE, 1000) as peer,
    ):
        found = devices(peer)
        next(found)
        master.state = "stopped"
        while (device := next(found)[0]).hardware_status[0].health_status != 0:
            pass
    (state,), (ethercat,) = device.hardware_status, device.ethercat_states
    assert (ethercat.al_state, state.connectivity_status) == (0, 0)
    details = {row.key: row.value for row in state.state_details}
    assert details["FSoE c1"] == "unknown"


def test_an_offer_has_the_name_hash_and_qos_of_an_rmw() -> None:
    with (
        FakeMaster() as master,
        bridged(master.path) as domain,
        Peer("listen", domain, "rt/diagnostics", ARRAY, 1000) as peer,
    ):
        offer = next(line for line in peer.lines() if line.startswith("offer "))
    assert offer == f"offer {ARRAY} reliable typehash=RIHS01_{HASHES[DiagnosticArray]};"


def test_joints_and_values_reach_another_vendor(robot: Master) -> None:
    with bridged(robot.path, rate_hz=100.0) as domain:
        with Peer("listen", domain, "rt/joint_states", JOINTS, 2) as peer:
            for payload in peer.payloads():
                state = STORE.deserialize_cdr(payload, "sensor_msgs/msg/JointState")
                assert state.name == ["drive_1", "drive_2"]
                assert list(state.position) == list(state.velocity) == list(state.effort) == [0, 0]
        with Peer("listen", domain, LAMP_TOPIC, BOOL, 2) as peer:
            for payload in peer.payloads():
                assert STORE.deserialize_cdr(payload, "std_msgs/msg/Bool").data is False


def test_joints_are_left_to_another_node_that_publishes_them(robot: Master) -> None:
    with bridged(robot.path) as domain, Peer("listen", domain, "rt/diagnostics", ARRAY, 1000) as p:
        seen = arrays(p)
        while (first := next(seen)).get("cell: joints") is None:
            pass
        assert first["cell: joints"].level == 0
        with Peer("send", domain, "rt/joint_states", JOINTS):
            while next(seen)["cell: joints"].level == 0:
                pass
            text = "another node publishes /joint_states: not published here"
            assert next(seen)["cell: joints"].message == text
        while next(seen)["cell: joints"].level != 0:
            pass


def test_an_endpoint_that_cannot_be_decoded_hides_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """`cyclonedds` raises where an entity has a name that is not UTF-8."""
    bool_message = SIGNALS[SignalKind.BOOL]
    with own_domain() as domain, contextlib.closing(node.Node(domain, here_only=True)) as here:
        offers: Any = here._offers
        convert, seen = offers._cqos_conv, []

        def fails_once(pointer: Any) -> Any:
            seen.append(pointer)
            return convert(pointer) if len(seen) > 1 else b"\xff".decode()

        monkeypatch.setattr(offers, "_cqos_conv", fails_once)
        for topic in ("/a", "/b"):
            here.publish(topic, bool_message(True))
        monkeypatch.setattr(node, "_OURS", "another")  # each is one of another program
        assert not here.has_other_publisher("/a")  # the first, which could not be decoded
        assert here.has_other_publisher("/b")
        assert here.unreadable == 1
        here._writers.clear()
        while here.has_other_publisher("/b"):
            pass


def test_two_threads_may_read_endpoints(robot: Master) -> None:
    """`cyclonedds` converts QoS in buffers of the process; a name was read while it was freed."""
    with bridged(robot.path, allow_control=True) as domain, listening(domain) as found:
        request = "std_srvs::srv::dds_::Trigger_Request_"
        with Peer("send", domain, "rq/cell/restartRequest", request):
            for _ in range(examples(300)):
                found.offers()
            while "rt/diagnostics" not in found.offers():  # the bridge still runs
                pass


def test_topics_can_have_a_namespace_and_no_joints(robot: Master) -> None:
    done = _command(
        "--socket", robot.path, "--duration", "300ms", "--namespace", "left/arm", "--no-joints"
    )
    assert done.stdout.endswith(
        " on this machine by Cyclone DDS: /diagnostics, /left/arm/fsoe_net; Ctrl-C ends it\n"
    )
    wrong = _command("--socket", robot.path, "--namespace", "left/a b")
    assert (wrong.returncode, "'left/a b' is not a namespace" in wrong.stderr) == (2, True)


def lights(lamp: Client, again: Callable[[], object]) -> None:
    """Set the lamp until it is seen: on a busy machine its lease may end before anybody looks."""
    again()
    while not lamp.value(LAMP):
        time.sleep(0.05)
        again()


def test_another_vendor_sets_an_output_which_falls_back_when_it_is_silent(
    robot: Master, lamp: Client
) -> None:
    with (
        bridged(robot.path, allow_control=True) as domain,
        Peer("send", domain, f"{LAMP_TOPIC}/set", BOOL) as peer,
    ):
        assert next(peer.lines()) == "matched"
        lights(lamp, partial(peer.send, b"\x01"))
        lamp.wait_for(LAMP, False)  # nobody said so: its lease has ended
        lights(lamp, partial(peer.send, b"\x01"))
        peer.send(b"\x00")
        lamp.wait_for(LAMP, False)
        assert peer.done() == 0


def test_a_message_before_its_reader_is_registered_is_handled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A thread may be held up between making a reader and knowing whose messages it takes."""
    from cyclonedds.sub import DataReader

    handled: queue.SimpleQueue[bool] = queue.SimpleQueue()
    passed = threading.Event()

    class Probe:
        def take(self, _: int) -> list[Any]:
            passed.set()
            return []

    probe: Any = Probe()
    bool_message = SIGNALS[SignalKind.BOOL]
    with (
        own_domain() as domain,
        contextlib.closing(node.Node(domain, here_only=True)) as here,
        contextlib.closing(node.Node(domain, here_only=False)) as there,
    ):

        def held_up(*words: Any, **more: Any) -> DataReader:
            reader = DataReader(*words, **more)
            while not reader.read(1):
                there.publish("/a", bool_message(True))
            here._listener.on_data_available(None)  # what it is while that does not come back
            here._arrivals.put(probe)
            assert passed.wait(PATIENCE_S)  # what came so far was looked at, and known to nobody
            return reader

        here._readers[probe] = lambda *_: None
        monkeypatch.setattr(node, "DataReader", held_up)
        here.subscribe("/a", bool_message, lambda message, _: handled.put(message.data))
        assert handled.get(timeout=PATIENCE_S) is True


def test_without_the_option_no_one_sets_anything(robot: Master) -> None:
    with bridged(robot.path) as domain, listening(domain) as found:
        while "rt/diagnostics" not in found.offers():
            pass
        assert found.requests() == set()


def test_only_what_may_be_set_has_a_subscription(robot: Master) -> None:
    with bridged(robot.path, allow_control=True) as domain, listening(domain) as found:
        wanted = {f"rt/cell/outputs/el2904/standard_{n}/set" for n in (1, 2, 3, 4)}
        while not wanted <= found.requests():
            pass
        assert found.requests() == wanted  # no drive, no logic_control, which is armed


def test_a_service_is_there_while_a_caller_waits_that_can_be_answered(robot: Master) -> None:
    """`rmw_fastrtps_cpp` counts endpoints that match; its caller would wait forever."""
    services = ("start", "stop", "restart", "set_parameters")
    with (
        bridged(robot.path, allow_control=True) as domain,
        listening(domain) as found,
        Peer("listen", domain, "rt/diagnostics", ARRAY, 1000) as peer,
        Peer("call", domain, "/cell/stop", "std_srvs::srv::dds_::Trigger") as other,
    ):
        seen = arrays(peer)
        while (row := next(seen).get("cell: control")) is None or row.level == 0:
            pass
        need = "callers of /cell/stop need RMW_IMPLEMENTATION=rmw_cyclonedds_cpp"
        assert (row.level, row.message) == (1, need)
        assert select.select([other.stdout], [], [], 0)[0] == []  # it has found no service
        callers = [Caller(domain, f"/cell/{word}") for word in services]
        wanted = {f"rq/cell/{word}Request" for word in services}
        while not wanted <= found.requests():
            pass
        lines = other.lines()
        while next(lines) != "matched 1 1":
            pass
        # A request with the header of Cyclone DDS in its payload: it cannot be told from one.
        other.send(TriggerRequest(1, 1).serialize(use_version_2=False)[4:])
        while dict(pairs(next(seen)["cell: control"]))["not answered"] != "1":
            pass
        with robot.client() as client:
            assert client.good("status")["state"] == "running"
        callers.clear()
        while wanted & found.requests():
            pass


def test_a_request_that_cannot_be_read_is_counted_and_the_next_one_served(robot: Master) -> None:
    kinds = messages.SetParametersRequest, messages.SetParametersResponse
    bad = kinds[0](0, 1, [parameter("bad", True)]).serialize(use_version_2=False)
    bad = bad.replace(b"bad\0", b"\xff\xfe\xff\0")  # no UTF-8
    request = "rcl_interfaces::srv::dds_::SetParameters_Request_"
    with (
        bridged(robot.path, allow_control=True) as domain,
        Peer("listen", domain, "rt/diagnostics", ARRAY, 1000) as peer,
        Peer("send", domain, "rq/cell/set_parametersRequest", request) as sends,
    ):
        caller = Caller(domain, "/cell/set_parameters", *kinds)
        next(sends.lines())
        for payload in (bad, bad[:40], bad[:20] + b"\xff" * 40):
            sends.send(payload[4:])
        assert sends.done() == 0
        seen = arrays(peer)
        while not int(dict(pairs(next(seen)["cell: control"]))["unreadable"]):
            pass
        (result,) = caller.call([parameter("x", 1)]).results
        assert result.reason == "x is not an output that nodes may set"


def pairs(row: Any) -> list[tuple[str, str]]:
    return [(value.key, value.value) for value in row.values]


GARBAGE = [b"", b"\x02", bytes(3), bytes(1000), b"\xff" * 40]


def test_bytes_that_are_not_message_do_nothing(robot: Master, lamp: Client) -> None:
    request = "std_srvs::srv::dds_::Trigger_Request_"
    with (
        bridged(robot.path, allow_control=True) as domain,
        Peer("send", domain, "rq/cell/stopRequest", request) as calls,
        Peer("send", domain, f"{LAMP_TOPIC}/set", BOOL) as sets,
    ):
        caller = Caller(domain, "/cell/stop")
        next(calls.lines())
        next(sets.lines())
        for garbage in GARBAGE:
            calls.send(garbage[:16])  # one that is long enough would be a request
            sets.send(garbage)
        assert calls.done() == 0
        del caller
        lights(lamp, partial(sets.send, b"\x01"))
        assert lamp.good("status")["state"] == "running"
        assert sets.done() == 0


@contextlib.contextmanager
def listening(domain: int) -> Iterator[Found]:
    """Join a domain that is on the loopback in this process already."""
    from cyclonedds.domain import DomainParticipant

    yield Found(DomainParticipant(domain))


def test_a_service_starts_and_stops_the_bus() -> None:
    with (
        master_running(name="estop") as master,
        master.client() as client,
        bridged(master.path, allow_control=True) as domain,
    ):
        stop, start = (Caller(domain, f"/cell/{word}") for word in ("stop", "start"))
        (reader,), (writer,) = stop.marks()
        mark, _, _ = reader.partition(b";")
        assert mark.startswith(b"serviceid=")
        assert mark == writer.partition(b";")[0]
        assert mark != next(iter(start.marks()[0])).partition(b";")[0]
        assert stop.call().message == "stop has begun"
        while client.good("status")["state"] != "stopped":
            pass
        assert start.call().message == "start has begun"
        while client.good("status")["state"] != "running":
            pass


def parameter(name: str, value: object) -> Any:
    """Return a parameter as `ros2 param set` sends it."""
    fields = {bool: "bool_value", int: "integer_value", float: "double_value", str: "string_value"}
    kind = list(fields).index(type(value)) + 1
    held = dict(zip(fields.values(), (False, 0, 0.0, ""), strict=True))
    held[fields[type(value)]] = value
    return messages._Parameter(name, messages._ParameterValue(kind, *held.values(), *([],) * 5))


def test_a_service_sets_outputs_and_gives_the_reason(robot: Master, lamp: Client) -> None:
    with bridged(robot.path, allow_control=True) as domain:
        caller = Caller(
            domain,
            "/cell/set_parameters",
            messages.SetParametersRequest,
            messages.SetParametersResponse,
        )
        on = partial(caller.call, [parameter(LAMP, True)])
        while not on().results[0].successful:
            pass  # which outputs there are comes from the bus, a moment later
        lights(lamp, on)
        lamp.wait_for(LAMP, False)  # it was not sent again
        odd = {
            LAMP: 1,
            "drive_1.0x6060:00": 8,  # an axis
            "el6910.logic_control": 1,  # can restart the machine
            "no\x1b[2J.lamp": True,
        }
        reply = caller.call([parameter(LAMP, True), *(parameter(*row) for row in odd.items())])
        assert [(r.successful, r.reason) for r in reply.results] == [
            (True, ""),
            (False, f"{LAMP} takes a value as std_msgs/msg/Bool has it"),
            (False, "drive_1.0x6060:00 is not an output that nodes may set"),
            (False, "el6910.logic_control is not an output that nodes may set"),
            (False, "no\\u001b[2J.lamp is not an output that nodes may set"),
        ]
        lights(lamp, on)
        (many,) = caller.call([parameter(LAMP, True)] * 257).results
        assert many.reason == "more than 256 parameters at once: nothing was set"
        (long,) = caller.call([parameter("\x1b" * 100_000, True)]).results
        assert long.reason == "\\u001b" * 100 + " is not an output that nodes may set"
        assert caller.call([]).results == []


def test_an_object_that_commands_a_drive_is_not_written(robot: Master) -> None:
    with bridged(robot.path, allow_control=True) as domain:
        put = Caller(domain, "/cell/set_sdo", messages.SetSdoRequest, messages.SetSdoResponse)
        get = Caller(domain, "/cell/get_sdo", messages.GetSdoRequest, messages.GetSdoResponse)
        for index in (0x6040, 0x607A, 0x68FF, 0x9860 - 0x10000):
            refused = put.call(0, DRIVE, index, 0, "uint16", "15")
            assert not refused.success
            assert "a real-time client of fsn-master moves axes" in refused.sdo_return_message
        for place, kind, text in (
            ((0, 40), "uint32", "no SubDevice at position 40 of bus 0"),
            ((3, DRIVE), "uint32", f"no SubDevice at position {DRIVE} of bus 3"),
            ((0, DRIVE), "sm8\x1b", "no data type sm8\\u001b; known: bool, int8"),
        ):
            reply = get.call(*place, 0x1018, 1, kind)
            assert (reply.success, math.isnan(reply.sdo_return_value)) == (False, True)
            assert text in reply.sdo_return_message
        for value in ("1\nstop", "x" * 5000):
            assert not put.call(0, DRIVE, 0x6083, 0, "uint32", value).success


def test_a_slow_object_delays_no_output(
    robot: Master, lamp: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, answered = threading.Event(), threading.Event()

    def slow(*_: object) -> tuple[bool, str, str, float]:
        asked.set()
        answered.wait(PATIENCE_S)
        return True, "", "", 0.0

    monkeypatch.setattr(objects.ObjectServices, "get_sdo", slow)
    with bridged(robot.path, allow_control=True) as domain:
        get = Caller(domain, "/cell/get_sdo", messages.GetSdoRequest, messages.GetSdoResponse)
        reader = threading.Thread(
            target=get.call, args=(0, DRIVE, 0x1018, 1, "uint32"), daemon=True
        )
        reader.start()
        assert asked.wait(PATIENCE_S)
        caller = Caller(
            domain,
            "/cell/set_parameters",
            messages.SetParametersRequest,
            messages.SetParametersResponse,
        )
        lights(lamp, partial(caller.call, [parameter(LAMP, True)]))
        answered.set()
        reader.join()


def test_a_refusal_is_the_answer_and_a_warning() -> None:
    with FakeMaster() as master:
        master.access = "operator"
        master.refuse["stop"] = {"error": "FSN_E_CLOSED", "text": "your role is operator"}
        with bridged(master.path, allow_control=True) as domain:
            reply = Caller(domain, "/cell/stop").call()
            assert (reply.success, reply.message) == (False, "stop: your role is operator")
            with Peer("listen", domain, "rt/diagnostics", ARRAY, 1000) as peer:
                seen = arrays(peer)
                row = next(seen)["cell: control"]
                while row.level != 1:
                    row = next(seen)["cell: control"]
            assert row.message == "refused: stop: your role is operator"


def test_an_observer_controls_nothing() -> None:
    with FakeMaster() as master:
        master.access = "observer"
        with pytest.raises(EnvironmentFault, match="observer, which only reads"):
            control.NodeControl(str(master.path))


def test_processes_have_clients_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    with FakeMaster() as master:
        acting = control.NodeControl(str(master.path))
        topic = type("T", (), {})()
        topic.kind = SignalKind.UNSIGNED
        topic.symbol = type("S", (), {"name": "drive_1.0x6040:00"})()
        send = SIGNALS[SignalKind.UNSIGNED]
        for number in range(control._MOST_SENDERS + 1):
            acting.set_output(topic, send(number), f"process {number}")
        assert dict(acting.status("").values)["outputs set"] == str(control._MOST_SENDERS)
        assert acting.status("").message == "refused: more than 8 processes set outputs"
        assert master.outputs["drive_1.0x6040:00"] == control._MOST_SENDERS - 1
        later_s = time.monotonic() + control._IDLE_S - 1.0
        monkeypatch.setattr(control, "time", SimpleNamespace(monotonic=lambda: later_s))
        acting.set_output(topic, send(5), "process 0")  # the others are silent
        monkeypatch.setattr(control, "time", SimpleNamespace(monotonic=lambda: later_s + 2.0))
        acting.set_output(topic, send(77), "a new process")
        assert master.outputs["drive_1.0x6040:00"] == 77
        assert set(acting._senders) == {"process 0", "a new process"}
        master.drop()
        acting.set_output(topic, send(78), "a new process")
        acting.close()


def test_a_recording_opens_elsewhere_and_holds_what_was_sent(robot: Master, tmp_path: Path) -> None:
    needed("mcap", "ros2")
    from mcap.reader import make_reader

    path = tmp_path / "run.mcap"
    with (
        bridged(robot.path, record=str(path)) as domain,
        Peer("listen", domain, "rt/diagnostics", ARRAY, 3) as peer,
    ):
        received = list(peer.payloads())
    with open(path, "rb") as file:
        rows = list(make_reader(file, validate_crcs=True).iter_messages())
    topics = {channel.topic for _, channel, _ in rows}
    assert {"/diagnostics", "/joint_states", "/cell/outputs/el2904/standard_1"} <= topics
    recorded = {m.data for _, c, m in rows if c.topic == "/diagnostics"}
    for payload in received:  # on the wire padded to 4 bytes
        assert {payload[: len(payload) - n] for n in range(4)} & recorded
    for schema, channel, message in rows:
        assert channel.message_encoding == "cdr"
        assert schema.encoding == "ros2msg"
        assert channel.metadata["topic_type_hash"] == STORE.hash_rihs01(schema.name)
        found = STORE.deserialize_cdr(message.data, schema.name)
        if channel.topic == "/joint_states":
            assert not math.isnan(found.position[0])


def _at(path: str, message: Any) -> list[Any]:
    """Return what a path of Foxglove finds in a message: fields, rows, rows of a name."""
    found = [message]
    for field, name in re.findall(r"(\w+)(?:\[:\])?(?:\{name==\"(.*?)\"\})?", path):
        found = [getattr(value, field) for value in found]
        if name:
            found = [row for rows in found for row in rows if row.name == name]
    return found


def test_each_panel_of_the_layout_finds_its_data(tmp_path: Path) -> None:
    """`ros/fsoe_net_ros/config/foxglove.json`, and a recording of `examples/robot-cell`."""
    needed("mcap", "ros2")
    from mcap.reader import make_reader

    layout = json.loads((ROOT / "ros/fsoe_net_ros/config/foxglove.json").read_text("utf-8"))
    recorded = tmp_path / "run.mcap"
    with (
        master_running(name="robot-cell") as cell,
        bridged(cell.path, name="fsoe_net", record=str(recorded)) as domain,
        Peer("listen", domain, "rt/fsoe_net/inputs/axis_2/error_code", UINT64, 3) as peer,
    ):
        list(peer.payloads())
    with open(recorded, "rb") as file:
        last = {c.topic: (s.name, m.data) for s, c, m in make_reader(file).iter_messages()}
    panels = layout["configById"]
    paths = [row["value"] for panel in panels.values() for row in panel.get("paths", ())]
    assert len(paths) == 12
    for path in paths:
        topic, _, fields = path.partition(".")
        name, data = last[topic]
        assert len(_at(fields, STORE.deserialize_cdr(data, name))) == 1, path
    assert {panel.get("topicToRender", "/diagnostics") for panel in panels.values()} <= last.keys()
    shown = re.findall(r'"(?:first|second)": "(.*?)"', json.dumps(layout["layout"]))
    assert sorted(shown) == sorted(panels)


def test_a_program_that_reads_bags_reads_it(robot: Master, tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    path = tmp_path / "run.mcap"
    with (
        bridged(robot.path, record=str(path)) as domain,
        Peer("listen", domain, "rt/diagnostics", ARRAY, 1) as peer,
    ):
        list(peer.payloads())
    with AnyReader([path]) as reader:
        names = {c.topic: c.msgtype for c in reader.connections}
        assert names["/diagnostics"] == "diagnostic_msgs/msg/DiagnosticArray"
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


def test_a_disk_that_is_full_ends_it_with_its_name(robot: Master) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    done = _command(
        "--socket", robot.path, "--record", "/dev/full", "--overwrite", "--duration", "60s"
    )
    assert done.returncode == 3
    assert done.stderr == "error: /dev/full: No space left on device\n"


def _command(*words: object) -> subprocess.CompletedProcess[str]:
    with own_domain() as domain:
        return subprocess.run(
            [
                *(sys.executable, "-m", "fsoe_net.cli", "ros2", "--localhost"),
                *("--domain", str(domain), *map(str, words)),
            ],
            capture_output=True, text=True, check=False, timeout=PATIENCE_S,
        )  # fmt: skip


def test_the_command_names_what_it_shows(robot: Master, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    done = _command(
        "--socket", robot.path, "--duration", "300ms", "--record", path, "--allow-control"
    )
    assert (done.returncode, done.stderr) == (0, "")
    first, second, third = done.stdout.splitlines()
    assert first.endswith(
        " on this machine by Cyclone DDS: /diagnostics, /joint_states, /fsoe_net; Ctrl-C ends it"
    )
    assert second == (
        "every node there may set outputs (role here: maintainer); no emergency stop, no safety "
        "function"
    )
    assert third.endswith(" messages")
    again = _command("--socket", robot.path, "--record", path)
    assert (again.returncode, again.stdout) == (1, "")
    assert "--overwrite" in again.stderr


def test_arguments_that_the_command_rejects(tmp_path: Path) -> None:
    done = _command("--socket", tmp_path / "nobody")
    assert done.returncode == 3
    assert "no answer" in done.stderr
    done = _command("--socket", "x", "--name", "my cell")
    assert done.returncode == 2
    assert "'my cell' is not a name of a node; 'my_cell' would be" in done.stderr


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from click.testing import CliRunner

    from fsoe_net.cli.main import cli

    for name in [n for n in sys.modules if n.startswith(("fsoe_net.ros2.", "cyclonedds"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "cyclonedds", None)
    result = CliRunner().invoke(cli, ["ros2", "--socket", "x"])
    assert isinstance(result.exception, EnvironmentFault)
    assert str(result.exception) == (
        "ros2 needs cyclonedds, which is not installed; "
        f"{sys.executable} -m pip install 'cyclonedds>=0.10.5' 'mcap>=1.1'"
    )
