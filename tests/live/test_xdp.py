"""The cycle by AF_XDP on a veth pair: all else on the interface is as before."""

import json

import pytest
from capture_file import read_capture
from live.on_the_wire import ESTOP, ROBOT, on_the_wire
from weekly import first

from fsoe_net.live.master import find_master

RIG = "live/xdp_rig.py"


@pytest.fixture
def _by_xdp(tmp_path_factory, monkeypatch):
    """Each `fsn-master` that `run` starts gets the option."""
    program = tmp_path_factory.mktemp("xdp") / "fsn-master"
    program.write_text(f'#!/bin/sh\nexec {find_master()} "$@" --xdp\n', "utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("FSN_MASTER", str(program))


@pytest.mark.usefixtures("_by_xdp")
@pytest.mark.parametrize("network", first(1, [ESTOP, ROBOT]))
def test_connections_come_up(network, tmp_path):
    seen = on_the_wire("comes_up", network, tmp=tmp_path, good=lambda s: s["code"] == 0)
    found = json.loads(seen["out"])
    assert found["result"] == "pass"
    assert found["statistics"]["cycles"] > 1000


@pytest.mark.usefixtures("_by_xdp")
@pytest.mark.weekly
def test_a_ring_is_driven_from_both_ends(tmp_path):
    seen = on_the_wire("ring", ESTOP, tmp=tmp_path, cables=2)
    assert seen["middle cable"].startswith("between ek1914")
    assert seen["near2"].endswith("(no link)")
    assert "the ring is closed again" in "\n".join(seen["events"])


@pytest.mark.usefixtures("_by_xdp")
def test_frames_of_another_maindevice_are_still_counted(tmp_path):
    seen = on_the_wire("fault foreign", ESTOP, tmp=tmp_path, good=lambda s: s["key"] is not None)
    assert seen["key"] == "other_main_device"


def test_the_program_ends_with_the_process(tmp_path):
    assert on_the_wire("killed", ESTOP, tmp=tmp_path, script=RIG) == [True, True]


def test_frames_that_are_not_sent_are_counted(tmp_path):
    seen = on_the_wire("interface_down", ESTOP, tmp=tmp_path, script=RIG)
    assert seen["code"] == 0
    assert seen["unsent"] > 0
    assert seen["lost"] >= seen["unsent"]


def test_no_successor_follows(tmp_path):
    seen = on_the_wire("takes_no_successor", ESTOP, tmp=tmp_path, script=RIG)
    assert seen["code"] == 1
    assert "takes a successor" in seen["said"]
    assert seen["running"]


def test_a_capture_is_rebuilt(tmp_path):
    seen = on_the_wire("captured", ESTOP, tmp=tmp_path, script=RIG, good=lambda s: s["code"] == 0)
    assert "the capture is rebuilt from the process image" in seen["said"]
    assert len(list(read_capture(tmp_path / "a.pcapng"))) > 100


@pytest.mark.parametrize(
    ("case", "code", "words"),
    [
        ("taken_by_another", 1, "another XDP program has the interface"),
        ("several_queues", 1, "near3 receives on 2 queues; ethtool -L near3 rx 1"),
        ("without_capabilities", 3, "AF_XDP also needs CAP_NET_ADMIN and CAP_BPF"),
        ("without_capabilities", 3, "cap_ipc_lock,cap_net_admin,cap_bpf=ep /"),
    ],
)
def test_what_is_missing_is_named(case, code, words, tmp_path):
    seen = on_the_wire(case, ESTOP, tmp=tmp_path, script=RIG)
    assert words in seen["said"]
    assert seen["code"] == code
