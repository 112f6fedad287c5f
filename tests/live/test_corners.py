"""What a run says and gives at the edges of what it knows: sources, builds, test records, files."""

from __future__ import annotations

import time
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace as Facts
from typing import Any, cast

import pytest
from live.whole_programs import program, refusal
from networks import example
from test_record.filled import fresh_record, timed

from fsoe_net.core.bus_documents import PlannedConnection
from fsoe_net.core.snapshot import ConnectionSnapshot, DirectionSnapshot
from fsoe_net.errors import ControlRefused
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.pdu import reset_code_text
from fsoe_net.live import build_master, in_use, scan, sockets
from fsoe_net.live.attachment import _facts
from fsoe_net.live.bus_events import BusEvents, connection_result
from fsoe_net.live.live_bus import _LiveRun
from fsoe_net.live.scan_files import _check_manager, _NotExpressible, compact_json
from fsoe_net.model.names import Names
from fsoe_net.model.safety import ElementKind
from fsoe_net.simulate.campaign import campaign_links
from fsoe_net.simulate.live_objects import _rows
from fsoe_net.simulate.scenario_check import _nearest
from fsoe_net.test_record.steps import (
    _loss,
    _trigger,
    keep_machine,
    make_test_record,
)


def test_json_keeps_letters_as_they_are():
    assert compact_json({"größe": ["Ω"]}) == '{"größe": ["Ω"]}'


def test_a_protocol_of_a_network_without_a_project():
    resolution = timed()
    network = replace(resolution.network, project=None)
    bare = make_test_record(replace(resolution, network=network), b"")
    assert (bare.project, bare.network) == ("", network.name)


def test_names_that_are_known():
    assert _nearest("x", []) == "known: none"
    assert _nearest("zz", list("abcdefgh")) == "known: a, b, c, d, e, f, g, h"
    assert _nearest("zz", list("ihgfedcba")) == "known: a, b, c, d, e, f, g, h, …"
    assert _nearest("drive", ["drive_1", "io"]) == "write drive_1"


@pytest.mark.parametrize("driver", ["veth", "tun", "dummy", "netdevsim", "igb"])
def test_which_interface_is_not_a_network_card(driver: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(in_use, "network_driver", lambda _, name: driver)
    status: Any = Facts(backend="soem", interface="eth7")
    card = driver == "igb"
    assert in_use.emulated_bus(status) == ("" if card else f"eth7 is not a network card ({driver})")
    status = Facts(backend="emulated", interface="")
    assert in_use.emulated_bus(status) == "the bus of fsn-master is emulated"


def test_a_source_of_soem(tmp_path: Path):
    (tmp_path / "soem").mkdir()
    (tmp_path / "soem" / "ethercatmain.h").touch()
    assert build_master._is_soem_1(tmp_path) == tmp_path
    (tmp_path / "two" / "include" / "soem").mkdir(parents=True)
    why = "fsn-master is built with SOEM 1.4, fetched without --soem"
    assert refusal(build_master._is_soem_1, tmp_path / "two") == (
        f"{tmp_path / 'two'}: SOEM 2, which is not supported; {why}"
    )
    assert refusal(build_master._is_soem_1, tmp_path / "none") == (
        f"{tmp_path / 'none'}: not the source of SOEM: it has no soem/ethercatmain.h; {why}"
    )


def test_a_scan_by_a_program_that_cannot_be_started(tmp_path: Path):
    path = str(tmp_path / "none")
    assert refusal(scan._own, path, "eth1", None) == (
        f"{path} cannot be started: No such file or directory"
    )


def test_where_sockets_are_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    own = tmp_path / "fsn-master-eth1.sock"
    started = [tmp_path / f"fsoe-net-{n}" / "control.sock" for n in "ab"]
    monkeypatch.setattr(sockets, "_folders", lambda: [str(tmp_path)])
    monkeypatch.setattr(sockets.tempfile, "gettempdir", lambda: str(tmp_path))
    assert list(sockets._sockets("eth1")) == []
    for path in (own, *started, tmp_path / "other" / "control.sock"):
        path.parent.mkdir(exist_ok=True)
        path.touch()
    assert list(sockets._sockets("eth1")) == [str(path) for path in (own, *started)]
    assert list(sockets._sockets("eth2")) == [str(path) for path in started]


def test_where_the_c_source_lies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    package = tmp_path / "fsoe_net"
    monkeypatch.setattr(build_master, "__file__", str(package / "run" / "build_master.py"))
    for folder in (package / "master_core", tmp_path / "master_core"):
        folder.mkdir(parents=True)
        (folder / "CMakeLists.txt").touch()
        assert build_master._source() == folder


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("one\nan Error here\ntwo\n", "an Error here"),
        ("one\ntwo\n", "two"),
        ("", "no word why"),
        ("-- x\nCMake Error at a:3:\n  no such\n  file\n\nlater\n",
         "CMake Error at a:3: no such file"),
    ],
)  # fmt: skip
def test_why_a_build_has_failed(text: str, said: str, tmp_path: Path):
    path = program(tmp_path, f"cat <<'E'\n{text}E\nexit 2")
    assert refusal(build_master._run, [path], "cmake", {}) == f"cmake: exit code 2: {said}"


def test_a_subdevice_without_fsoe_and_a_function_without_words():
    assert _loss("coupler", []).expected == (
        "coupler has no FSoE end: no output comes on; note what the connections do."
    )
    (function,) = timed().network.safety_functions
    bare = _trigger(replace(function, trigger="", reaction=""))
    inputs = [e.sub or e.name for e in function.elements if e.kind is ElementKind.INPUT]
    assert inputs
    assert ", ".join(inputs) in bare.what
    assert "its input" in _trigger(replace(function, trigger="", elements=())).what


def test_a_device_that_a_person_filled_in_is_not_written_over():
    old, _ = fresh_record(timed())
    first, *rest = old.devices
    assert rest
    filled = replace(old, plan_sha256="0" * 64, devices=(replace(first, serial="17"), *rest))
    assert filled.devices[0].filled
    said = refusal(keep_machine, old, filled)
    assert said == (
        "that file holds results at the machine of another plan "
        f"(0000000000000000, now {old.plan_sha256[:16]}); write to another file"
    )
    assert keep_machine(old, replace(filled, devices=old.devices)) == old


def test_links_of_a_campaign_have_the_bus_cycle():
    resolution = example("estop")
    network = replace(resolution.network, cycle_ns=2_000_000)
    links = campaign_links(replace(resolution, network=network))
    assert links
    assert {link.cycle_ns for link in links} == {2_000_000}


def test_files_of_one_name_are_numbered():
    names = Names(["io_3"])
    assert [names.add("io") for _ in range(3)] == ["io", "io_2", "io_4"]
    assert names.add("io_2", "x") == "x"


def test_a_pdo_that_no_file_can_state():
    for is_read, said in (
        (False, "the mapping of PDO 0x1600 was not read"),
        (True, "PDO 0x1600 maps nothing"),
    ):
        pdo = Facts(index=0x1600, entries=(), is_read=is_read)
        manager: Any = Facts(index=2, complete=True, pdos=(pdo,))
        with pytest.raises(_NotExpressible) as caught:
            _check_manager(manager)
        assert str(caught.value) == said


def test_a_device_without_an_end_has_no_addresses():
    assert list(_rows(Facts(ports=[]))) == []


def test_connections_of_a_master_that_states_no_layout():
    def layout() -> Any:
        raise ControlRefused("FSN_E_UNSUPPORTED", "no such request")

    rows = [Facts(name=n, net="n", main="logic", sub=n) for n in ("c1", "c2")]
    client: Any = Facts(connections=lambda: rows, layout=layout)
    found = _facts(client)
    assert [(f.name, f.net, f.main, f.sub, f.watchdog_ms) for f in found] == [
        ("c1", "n", "logic", "c1", None),
        ("c2", "n", "logic", "c2", None),
    ]


@pytest.mark.parametrize("fails", [False, True])
def test_fsn_master_is_compiled_and_put_in_its_place(
    fails: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """With a CMake that writes down what it gets."""
    build, target = tmp_path / "build", tmp_path / "bin" / "fsn-master"
    build.mkdir()
    target.parent.mkdir()
    cmake = tmp_path / "cmake"
    made = "printf '#!/bin/sh\\necho fsn-master 7 $1\\n' >$2/fsn-master; chmod +x $2/fsn-master"
    cmake.write_text(
        f'#!/bin/sh\necho "$1 $FLAG" >>{tmp_path}/calls\n[ "$1" = --build ] || exit 0\n'
        + ("echo 'error: no room'; exit 2\n" if fails else made + "\n")
    )
    cmake.chmod(0o755)
    monkeypatch.setattr(build_master, "_cmake", lambda _: ([str(cmake)], {"FLAG": "set"}))
    monkeypatch.setattr(build_master.shutil, "which", lambda _: "/usr/bin/cc")
    if fails:
        said = refusal(lambda: build_master.build_master(target, with_soem=False, build=build))
        assert said == "the compiler: exit code 2: error: no room"
        assert not target.exists()
    else:
        said = build_master.build_master(target, with_soem=False, build=build)
        assert said == "fsn-master 7 --version\n"
        assert [path.name for path in target.parent.iterdir()] == ["fsn-master"]
    assert (tmp_path / "calls").read_text() == "-S set\n--build set\n"


@pytest.mark.parametrize(("client", "lost"), [(None, 0), (Facts(events_lost=3), 3)])
def test_values_of_a_live_bus_have_their_times(client: Any, lost: int):
    bus = _LiveRun(
        example("estop"), b"plan", cast(Any, Facts(backend="igh", interface="0")), cast(Any, None)
    )
    bus._facts, bus._client = (), client
    bus._events = BusEvents(start_ns=time.monotonic_ns() - 2_000_000_000)
    statistics = Facts(period=Facts(max_ns=4_000_000))
    seen: Any = Facts(cycle=Facts(connections=(), statistics=statistics), subdevices=())
    update = bus._update(seen)
    assert 2 <= update.now_s < 900
    assert (update.connections, update.statistics, update.subdevices) == ((), statistics, ())
    bus._begin_ns, bus._end_ns = 1_000_000, 251_000_000
    done = bus._result(seen, current=False)
    assert (done.duration_ms, done.events_lost, done.stalled_ms) == (250.0, lost, 4.0)
    assert [event.text for event in done.events] == [
        "the bus was not running at the end; what is shown was seen last"
    ]


@pytest.mark.parametrize(
    ("to_sub", "to_main", "code"),
    [((4, 5), (2, 0), 5), ((2, 0), (3, 7), 7), ((0, 5), (0, 0), None), ((1, 5), (1, 0), 5)],
)
def test_a_reset_without_an_event_has_the_code_of_its_counter(to_sub, to_main, code):
    """Towards a silent end a Reset changes no state, so fsn-master sends no event."""
    zero = dict.fromkeys((f.name for f in fields(DirectionSnapshot)), 0)
    down, up = (
        DirectionSnapshot(**zero | {"resets": resets, "reset_code": reset_code})
        for resets, reset_code in (to_sub, to_main)
    )
    wire = ConnectionSnapshot(state=ConnectionState.SILENT, to_sub=down, to_main=up, gaps=0)
    result = connection_result(PlannedConnection(name="a"), wire, BusEvents(start_ns=0))
    assert result.last_reset_code == code
    assert result.last_reset_text == ("" if code is None else reset_code_text(code))
