"""`fsoe-net emulate`: what it refuses, and a network that nobody talks to."""

import contextlib
import json
import signal
import struct
import subprocess

import pytest
from cli.tool import fsn
from networks import example
from patience import PATIENCE_S
from segment.emulated import EMULATE, ESTOP
from segment.wire import read_frame
from wires import command_inside, missing, run_inside, run_program

from fsoe_net.core.segment import Segment
from fsoe_net.errors import CoreError, EnvironmentFault
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.sii.read import load_sii, sii_checksum
from fsoe_net.plan.compile import compile_plan
from fsoe_net.simulate.emulate import SegmentSession
from fsoe_net.simulate.session import counted_session_ids


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ([ESTOP], 2, "--interface"),
        ([ESTOP, "--interface", "lo"], 3, "lo"),
        ([ESTOP, "--interface", "eth99"], 3, "no such interface: 'eth99'; `ip link` lists them"),
        ([ESTOP, "--interface", "x" * 300], 3, "no such interface: 'xxx"),
        ([ESTOP, "--interface", "lo", "--no-machine-on-this-wire"], 3, "this is not a test rig"),
        (["absent.yaml", "--interface", "lo"], 1, "nothing started"),
    ],
)
def test_emulate_refuses_with_exit_code_and_reason(arguments, code, message):
    done = fsn("emulate", *arguments)
    assert done.returncode == code, done.stderr
    assert message in done.stderr


def test_emulation_without_a_main_device_fails():
    why = missing()
    if why:
        pytest.skip(why)
    words = (*EMULATE, ESTOP, "--interface", "far", "--duration", "0.2", "--format", "json")
    done = run_inside(*words)
    assert done.returncode == 1
    assert "EMULATION of 2 SubDevices on far" in done.stderr
    document = json.loads(done.stdout)
    assert document["states"]["ek1914"] == {"state": "INIT", "error": False, "code": 0}
    assert document["connections"] == {"el1918-ek1914": "reset"}
    assert document["passed"] is False


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_with_its_summary(number):
    with emulating() as process:
        process.send_signal(number)
        out, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, err) == (1, "")
    assert "interrupted by the user" in out
    assert out.endswith("0 frames answered: no MainDevice spoke on this interface\n")


def test_ctrl_c_that_was_ignored_stays_ignored():
    """As of a job in the background of a script."""
    with emulating("trap '' INT") as process:
        process.send_signal(signal.SIGINT)
        process.stdin.write("status\n")
        process.stdin.flush()
        while "0 frames, 0 lost" not in (line := process.stderr.readline()):
            assert line  # it answers, so it goes on
        process.send_signal(signal.SIGTERM)
        out, _ = process.communicate(timeout=PATIENCE_S)
    assert "interrupted by the user" in out


def test_one_emulation_answers_on_an_interface():
    why = missing()
    if why:
        pytest.skip(why)
    done = run_program("segment/wire.py", "taken", ESTOP, cables=2)
    assert done.returncode == 0, done.stderr


@contextlib.contextmanager
def emulating(before="true"):
    """Run an emulation that answers already, after a command of the shell."""
    why = missing()
    if why:
        pytest.skip(why)
    shell = ["sh", "-c", f'{before}; exec "$@"', "sh"]
    process = subprocess.Popen(
        command_inside(*shell, *EMULATE, ESTOP, "--interface", "far", "--commands"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        line = process.stderr.readline()
        assert line == "EMULATION of 2 SubDevices on far; Ctrl-C ends it\n"
        yield process
    finally:
        process.kill()
        process.communicate()


def test_an_mtu_that_is_too_small_is_said():
    why = missing()
    if why:
        pytest.skip(why)
    small = 'ip link set far mtu 1499; exec "$@"'
    done = run_inside("sh", "-c", small, "sh", *EMULATE, ESTOP, "--interface", "far")
    assert done.returncode == 3
    assert done.stderr.splitlines()[-1] == (
        "error: 'far': Message too long; EtherCAT frames need an MTU of 1500: "
        "ip link set IF mtu 1500"
    )


def test_a_rig_is_loud_and_wants_a_word(monkeypatch, capsys):
    from fsoe_net.cli import emulate_output

    monkeypatch.setattr(emulate_output, "is_test_rig", lambda: True)
    with pytest.raises(EnvironmentFault, match="look at the cable"):
        emulate_output.check_rig(False)
    assert "TEST RIG" in capsys.readouterr().err
    emulate_output.check_rig(True)
    assert "REAL network interfaces" in capsys.readouterr().err


def estop_segment() -> Segment:
    resolution = example("estop")
    session = SegmentSession(
        resolution, compile_plan(resolution).to_bytes(), None, session_ids=counted_session_ids()
    )
    return session.segment


def register(segment: Segment, place: int, address: int, size: int) -> bytes:
    """Return bytes of a register of the SubDevice at a place."""
    answer = segment.frame(read_frame(1, -place & 0xFFFF, address, size), 1)
    assert answer is not None
    assert answer[-2:] == b"\1\0"
    return answer[-2 - size : -2]


def test_a_cut_cable_and_its_counters():
    segment = estop_segment()
    assert register(segment, 0, 0x0110, 2) == b"\x31\x5a"
    segment.set_link(0, False)
    assert segment.frame(read_frame(7, 0, 0, 1), 1)[-2:] == b"\1\0"
    assert register(segment, 0, 0x0110, 2) == b"\x11\x56"
    assert register(segment, 0, 0x0310, 4) == b"\0\1\0\0"
    segment.set_link(0, True)
    assert register(segment, 1, 0x0310, 4) == b"\1\0\0\0"
    segment.rx_errors(0, 1, 7)
    assert register(segment, 0, 0x0300, 4) == b"\0\0\7\7"
    segment.set_link(None, False)
    assert segment.frame(read_frame(7, 0, 0, 1), 1) is None
    with pytest.raises(CoreError):
        segment.set_link(2, False)
    with pytest.raises(CoreError):
        segment.rx_errors(0, 4, 1)


def test_a_clock_of_32_bits_is_one_for_its_maindevice():
    """Bit 3 of its features, by ETG.1000.4, stands for 64 bits."""
    segment = estop_segment()
    segment.set_clock_bits(1, 32)
    assert [register(segment, place, 0x0008, 2) for place in (0, 1)] == [b"\x0c\0", b"\x04\0"]
    with pytest.raises(CoreError):
        segment.set_clock_bits(1, 33)


def test_a_ring_in_memory():
    segment = estop_segment()
    read = read_frame(7, 0, 0, 1)
    assert segment.frame_from(1, read, 1) is None
    segment.set_ring(True)
    answer, port = segment.frame_from(0, read, 2)
    assert (answer[-2:], port) == (b"\2\0", 1)
    answer, port = segment.frame_from(1, read, 3)
    assert (answer[-2:], port) == (b"\0\0", 0)


def sii_of(segment: Segment, place: int) -> bytes:
    """Read the first KiByte of an SII word by word, as a MainDevice does."""
    image = b""
    for word in range(0, 512, 4):
        head = struct.pack("<HBBHHHH", 0x1000 | 18, 2, 0, -place & 0xFFFF, 0x0502, 6, 0)
        command = struct.pack("<HI", 0x0100, word) + bytes(2)
        segment.frame(bytes.fromhex("ffffffffffff 010101010101 88a4") + head + command, 1)
        image += register(segment, place, 0x0508, 8)
    return image


def test_the_sii_is_whole_for_a_reader():
    """Checksum of its first words, and no service announced that its mailbox refuses."""
    segment = estop_segment()
    for place in (0, 1):
        data, out = sii_of(segment, place), Collector()
        described = load_sii(data, out)
        assert described is not None
        assert not out.diagnostics
        assert data[14] == sii_checksum(data)
        general = data.index(b"\x1e\x00\x10\x00") + 4
        assert data[general + 5] == 0x21  # SDO, complete access: no SDO information


def test_frames_in_memory():
    """A broadcast read counts both SubDevices; unplugging the second leaves one."""
    segment = estop_segment()
    read = read_frame(7, 0, 0, 1)
    assert segment.frame(read, 1)[-2:] == b"\2\0"
    assert segment.position("el1918") == 1
    segment.set_present(1, False)
    assert segment.frame(read, 2)[-2:] == b"\1\0"
    assert segment.al_status(1).state == "absent"
    assert segment.frame(b"nothing", 3) is None
    assert (segment.counts().frames, segment.counts().foreign) == (2, 1)
