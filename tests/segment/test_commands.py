"""Commands and scenario steps on an emulated segment, in memory."""

import signal
import struct
import subprocess

import pytest
from networks import example
from segment.emulated import EMULATE, ESTOP
from segment.wire import read_frame
from wires import command_inside, missing

from fsoe_net.formats.own.scenario import load_scenario
from fsoe_net.fsoe.event import State
from fsoe_net.model.scenario import Action, ScenarioStep
from fsoe_net.plan.compile import compile_plan
from fsoe_net.simulate.commands import CommandError, parse_command
from fsoe_net.simulate.emulate import SegmentSession
from fsoe_net.simulate.session import Session, counted_session_ids, run_virtual


def estop(kind=SegmentSession, scenario=None):
    resolution = example("estop")
    return kind(
        resolution, compile_plan(resolution).to_bytes(), scenario, session_ids=counted_session_ids()
    )


def found_by_scan(session, now_ns):
    answer = session.segment.frame(read_frame(7, 0, 0, 1), now_ns)
    return None if answer is None else answer[-2]


@pytest.mark.parametrize(
    ("line", "action", "target", "number", "values"),
    [
        ("break el1904", Action.BREAK, "el1904", 0, {}),
        ("wrong a 0x2 0x1234", Action.WRONG, "a", 0, {"vendor": 2, "product": 0x1234}),
        ("sdo-abort a 0x1c12 7", Action.SDO_ABORT, "a", 0, {"index": 0x1C12, "code": 7}),
        (
            "sdo-abort a 0x1c12:3 7",
            Action.SDO_ABORT,
            "a",
            0,
            {"index": 0x1C12, "sub": 3, "code": 7},
        ),
        ("lose 10  # frames", Action.LOSE, "", 10, {}),
        ("delay 500us", Action.DELAY, "", 500, {}),
        ("delay 2ms", Action.DELAY, "", 2000, {}),
        ("delay 0", Action.DELAY, "", 0, {}),
        ("stall 1s", Action.STALL, "", 1000, {}),
        ("mailbox-delay a 20ms", Action.MAILBOX_DELAY, "", 0, {"a": 20}),
        ("narrow-clock a", Action.NARROW_CLOCK, "a", 0, {}),
        ("press", Action.PRESS, "reset", 0, {}),
        ("press reset", Action.PRESS, "reset", 0, {}),
        ("release el6910", Action.RELEASE, "el6910", 0, {}),
    ],
)
def test_text_of_a_line(line, action, target, number, values):
    step = parse_command(line, 1).step
    assert (step.action, step.target, step.number, step.values) == (action, target, number, values)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("brake el1904", "did you mean break"),
        ("xyz", "known: break, heal"),
        ("xyz", "status"),
        ("break", "write: break SUBDEVICE"),
        ("wrong a 1", "write: wrong SUBDEVICE VENDOR PRODUCT [REVISION]"),
        ("lose many", "not a number"),
        ("lose -1", "not in 0"),
        ("lose " + "9" * 5000, "not in 0"),
        ("delay 5", "not a time"),
        ("delay \u0665ms", "not a time"),
        ("stall 500us", "not a whole number of ms"),
        ("stall 5000s", "more than an hour"),
        ("swap a a", "itself"),
        ("sdo-abort a 0x1c12: 7", "not a number"),
    ],
)
def test_an_unknown_command_is_rejected(line, says):
    with pytest.raises(CommandError) as fault:
        parse_command(line, 1)
    assert says in str(fault.value)


def test_nothing_is_not_a_command():
    assert parse_command("  # remark", 1) is None
    assert parse_command("", 1) is None


def test_commands_reach_the_segment():
    session = estop()
    assert found_by_scan(session, 1) == 2
    for line, wanted in (
        ("break el1918", 1),
        ("heal el1918", 2),
        ("cut ek1914", 1),
        ("splice ek1914", 2),
        ("cut main", None),
        ("splice main", 2),
        ("lose 1", None),
        ("swap ek1914 el1918", 2),
        ("wrong el1918 7 8", 2),
        ("power-cycle el1918", 2),
        ("lose-every 1", None),
        ("lose-every 0", 2),
    ):
        assert session.command(line, 1, 5) == "ok", line
        assert found_by_scan(session, 10) == wanted, line
    sii = bytes.fromhex("ffffffffffff 010101010101 88a4 1210")
    sii += bytes.fromhex("02 00 0000 0205 0600 0000 000108000000 0000")
    assert session.segment.frame(sii, 20)[-2] == 1
    answer = session.segment.frame(read_frame(1, 0, 0x0508, 8), 21)
    assert answer[26:34] == b"\7\0\0\0\x08\0\0\0"  # the swapped one is first, and another
    assert "ek1914 INIT" in session.command("status", 1, 30)
    assert "2 lost" in session.command("status", 1, 30)
    texts = [e.text for e in session.engine.events if e.source == "command"]
    assert "swap ek1914 and el1918" in texts
    assert "wrong el1918: vendor = 7, product = 8" in texts


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("break ek1915", "write ek1914"),
        ("swap ek1914 nobody", "no SubDevice 'nobody'"),
        ("fsoe-address el1918 3", "no SubInstance"),
        ("fsoe-address ek1914 0", "it holds 1"),
        ("set nobody 1", "no input"),
        ("nonsense", "known: break"),
    ],
)
def test_invalid_command_is_refused_with_the_reason(line, says):
    answer = estop().command(line, 1, 0)
    assert answer.startswith("refused: ")
    assert says in answer


class Sdo:
    """Reads objects of a SubDevice by its place, as a MainDevice does."""

    def __init__(self, segment, place):
        self._segment, self._place = segment, -place & 0xFFFF
        for number, (start, control) in enumerate([(0x1000, 0x26), (0x1080, 0x22)]):
            self._write(0x0800 + 8 * number, struct.pack("<HHBBBB", start, 128, control, 0, 1, 0))
        self._write(0x0120, b"\x12\0")

    def _write(self, address, data):
        head = bytes.fromhex("ffffffffffff 010101010101 88a4")
        body = struct.pack(
            "<HBBHHHH", 0x1000 | 12 + len(data), 2, 0, self._place, address, len(data), 0
        )
        answer = self._segment.frame(head + body + data + b"\0\0", 1)
        assert answer[-2:] == b"\1\0"

    def read(self, index, sub):
        request = struct.pack("<HHBBHBHB4x", 10, 0, 0, 0x13, 0x2000, 0x40, index, sub)
        self._write(0x1000, request.ljust(128, b"\0"))
        answer = self._segment.frame(read_frame(1, self._place, 0x1080, 128), 1)
        size = 4 - (answer[34] >> 2 & 3)
        assert answer[34] & 0xE3 == 0x43, answer.hex()
        return int.from_bytes(answer[38 : 38 + size], "little")


def test_devices_tell_what_they_are():
    """FSoE address, connection ID and state, as SDOs show them."""
    session = estop()
    main, sub = Sdo(session.segment, 1), Sdo(session.segment, 0)
    setup = session.network.setups[0]
    assert sub.read(0xF980, 0) == 1
    assert sub.read(0xF980, 1) == setup.main.address
    for index in (0x9081, 0xE901):  # its frame is mapped from 0x7080 and 0x6080
        assert main.read(index, 0) == 8
        told = [main.read(index, n) for n in (1, 2, 3, 4, 6)]
        assert told == [
            0x3130,
            setup.main.address,
            setup.main.connection_id,
            setup.main.watchdog_ms,
            0,
        ]
    assert main.read(0xEA00, 1) == 100
    assert [sub.read(0x9001, n) for n in (0, 2, 3, 4, 6)] == [8, setup.main.address, 0, 0, 1]
    session.step_devices(0)
    instance = session.network.mains["el1918-ek1914"].instance
    for state, number in zip(State, range(100, 104), strict=False):
        instance.state = state
        session._objects.update()
        assert main.read(0xA080, 1) == main.read(0xEA00, 1) == number
    instance.state = State.DATA
    session._objects.update()
    assert main.read(0xA080, 1) == 105  # nothing valid has come in
    instance._valid = True
    session._objects.update()
    assert main.read(0xA080, 1) == 104
    session.network.subs["el1918-ek1914"].instance.connection_id = 0x1234
    session._objects.update()
    assert sub.read(0x9001, 3) == 0x1234


def test_another_address_is_reported():
    """Turned address switches: the object says so at once, the end from its next Connection."""
    session = estop()
    sub = Sdo(session.segment, 0)
    assert session.command("fsoe-address ek1914 77", 1, 0) == "ok"
    assert session.network.subs["el1918-ek1914"].instance.config.address == 77
    session.step_devices(0)
    assert sub.read(0xF980, 1) == sub.read(0x9001, 2) == 77
    assert session.command("power-cycle ek1914", 1, 0) == "ok"
    assert Sdo(session.segment, 0).read(0xF980, 1) == 77


def test_another_address_ends_with_code_6():
    """In a run as well: the SubInstance refuses the address it was not given."""
    session = estop(Session)
    session.engine.do(ScenarioStep(at_ns=0, action=Action.FSOE_ADDRESS, values={"ek1914": 77}), 0)
    result = run_virtual(session, 100_000_000)
    assert result.connections[0].last_reset_code == 6
    assert result.connections[0].state != "data_process"


def test_a_run_without_a_segment_is_reported(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text("version: 1\nsteps:\n  - {at_ms: 1, lose: 3}\n", "utf-8")
    scenario, found = load_scenario(path)
    assert found == []
    (finding,) = estop(Session, scenario).scenario_findings()
    assert "fsoe-net emulate" in finding.hint
    assert str(finding.span).endswith("s.yaml:3:22")
    assert estop(SegmentSession, scenario).scenario_findings() == []


def test_lines_on_standard_input():
    """Answers come for good and bad lines, and the end of input does not end the emulation."""
    why = missing()
    if why:
        pytest.skip(why)
    words = command_inside(*EMULATE, ESTOP, "--interface", "far", "--commands")
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        process.stdin.write("cut ek1914\nbroke it\n\nstatus")
        process.stdin.close()
        told = []
        while not told or "0 frames, 0 lost" not in told[-1]:
            told.append(process.stderr.readline())
            assert told[-1], told
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        out, rest = process.stdout.read(), process.stderr.read()
    assert process.returncode == 1
    assert rest == ""
    assert told[1] == "ok\n"
    assert "refused: unknown command 'broke'" in told[2]
    assert "command: cut ek1914" in out
    assert "interrupted by the user" in out
