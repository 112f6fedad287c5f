"""The Wireshark dissector, run by tshark and compared with our own decoders."""

import dataclasses
import shutil
from pathlib import Path

import pytest
from capture.traffic import cut
from capture.tshark import items, run, tshark
from capture_file import read_capture
from data_files import listed, need
from hypothesis import given, settings
from hypothesis import strategies as st
from live.support import ESTOP, ROBOT, needs_core, resolution_of, session_of
from weekly import first

from fsoe_net.capture.capture import CaptureWriter
from fsoe_net.capture.lua import _quoted, lua_dissector
from fsoe_net.capture.names import Naming
from fsoe_net.capture.wire import LogicalImage
from fsoe_net.core.scan import Scanner
from fsoe_net.fsoe.observed import CrcVerdict
from fsoe_net.fsoe.pdu import Command, safe_data_of
from fsoe_net.plan.compile import compile_plan
from fsoe_net.self_test.monitor import PythonMonitor
from fsoe_net.simulate.session import run_virtual

pytestmark = needs_core

DATA_AT = 26  # of the one datagram per packet: Ethernet, EtherCAT and datagram header before it
NO_BIT_LIBRARY = "bit, bit32 = nil, nil\n"
ODD = 'odd "name" \\ with\nlines, % %s %n and \x07 süß ☃'

SCENARIOS = {
    ESTOP: """\
duration_s: 0.4
steps:
  - {at_ms: 60, press: reset}
  - {at_ms: 70, release: reset}
  - {at_ms: 100, local_reset: el1918-ek1914}
  - {at_ms: 160, break: ek1914}
  - {at_ms: 290, heal: ek1914}
""",
    ROBOT: """\
duration_s: 0.25
logic:
  inputs: [el1904.0x6001:01, el1904.0x6001:02]
  outputs: [el2904.0x7001:01, drive_1.0x6640:00, drive_2.0x6640:00]
steps:
  - {at_ms: 60, press: reset}
  - {at_ms: 70, release: reset}
  - {at_ms: 120, local_reset: el6910-drive_2}
  - {at_ms: 150, power_cycle: drive_1}
""",
}


@pytest.fixture(autouse=True)
def _needs_tshark():
    tshark()


class Made:
    """A network, a capture of a run of it, and the dissector for it."""

    def __init__(self, folder: Path, tmp: Path, *, head: str = ""):
        self.resolution = resolution_of(folder)
        plan = compile_plan(self.resolution)
        self.image = LogicalImage(plan)
        self.naming = Naming(self.resolution, self.image)
        self.script = tmp / "fsoe.lua"
        self.script.write_text(head + lua_dissector(self.resolution, plan), "utf-8")
        self.capture = tmp / "run.pcapng"
        session = session_of(folder, SCENARIOS[folder], tmp=tmp)
        with CaptureWriter(self.capture) as writer:
            run_virtual(session, session.duration_ns, capture=writer)

    def packets(self) -> list[bytes]:
        return [data for _, data in read_capture(self.capture)]

    def write(self, packets: list[bytes]) -> None:
        with CaptureWriter(self.capture) as writer:
            for number, data in enumerate(packets):
                writer.packet(1_000_000 * number, data)

    def watched(self) -> list[tuple[int, int]]:
        """Return the address where each direction arrives, by connection."""
        return [
            (self.image.address(c.to_sub.destination), self.image.address(c.to_main.destination))
            for c in self.resolution.connections
        ]

    def new_frames(self) -> list[tuple]:
        """Return the frames that tshark calls new."""
        packets, found = self.packets(), []
        ways = {}
        for names in self.naming.connections:
            ways[f"{names.ends[0]} > {names.ends[1]}"] = 0
            ways[f"{names.ends[1]} > {names.ends[0]}"] = 1
        for item in items(self.script, self.capture):
            verdict = item.one("fsoe.crc.verdict")
            if verdict in ("copy", "same"):
                assert (item.one("fsoe.state"), item.one("fsoe.sequence")) == (None, None)
                continue
            found.append(
                (
                    item.packet,
                    item.one("fsoe.connection"),
                    ways[item.one("fsoe.direction")],
                    packets[item.packet - 1][item.at : item.at + item.size].hex(),
                    verdict,
                    item.one("fsoe.state"),
                    int(item.one("fsoe.sequence") or 0),
                )
            )
        return sorted(found)


def by_scanner(made: Made) -> list[tuple]:
    scanner, found = Scanner(), []
    for time_ns, packet in read_capture(made.capture):
        found += scanner.packet(packet, time_ns)
    named = [made.naming.find_in(c) for c in scanner.connections()]
    for c, (names, swapped) in zip(scanner.connections(), named, strict=True):
        assert names is not None
        assert not swapped
        ends = c.places[0].address, c.places[1].address
        assert all(a in n for a, n in zip(ends, names.addresses, strict=True))
    return sorted(
        (
            named[s.connection][0].name,
            s.direction,
            s.frame.hex(),
            s.verdict.value,
            s.state.replace("_", " "),
            s.sequence,
        )
        for s in found
    )


def by_monitor(made: Made) -> list[tuple]:
    """Follow the chains with the monitor in Python, at the places where frames arrive."""
    found = []
    for names, where in zip(made.naming.connections, made.watched(), strict=True):
        sizes = names.frame_bytes
        monitor = PythonMonitor(*(len(safe_data_of(bytes(n))) for n in sizes))
        for number, packet in enumerate(made.packets(), start=1):
            if packet[6] == 0:  # on its way out
                continue
            shown = [
                packet[DATA_AT + a : DATA_AT + a + n] for a, n in zip(where, sizes, strict=True)
            ]
            restarts = shown[0][0] in (Command.RESET, Command.SESSION)
            for direction in (1, 0) if restarts else (0, 1):
                frame = shown[direction]
                verdict = monitor.frame(direction, frame, 0)
                if verdict is CrcVerdict.SAME:
                    continue
                numbered = verdict is CrcVerdict.RIGHT and frame[0] != Command.RESET
                sequence = (monitor.sequence(direction) - 1 or 0xFFFF) if numbered else 0
                state = monitor.state.replace("_", " ")
                word = verdict.value
                row = number, names.name, direction, frame.hex(), word, state, sequence
                found.append(row)
    return sorted(found)


@pytest.mark.parametrize("head", ["", NO_BIT_LIBRARY], ids=["as it is", "no bit library"])
@pytest.mark.parametrize("folder", first(1, [ESTOP, ROBOT]), ids=["estop", "el6910"])
@pytest.mark.uncounted
def test_verdicts_are_those_of_our_decoders(folder: Path, head: str, tmp_path: Path):
    made = Made(folder, tmp_path, head=head)
    found = made.new_frames()
    assert len(found) > 100
    assert found == by_monitor(made)
    # The scanner may watch where a frame is sent; the last one before a break never arrives.
    sent, arrived = set(by_scanner(made)), {row[1:] for row in found}
    assert not arrived - sent
    assert len(sent - arrived) <= len(made.naming.connections)


@pytest.mark.uncounted
def test_frames_that_two_datagrams_hold_are_judged_as_whole_ones(tmp_path: Path):
    """Each frame of the network is cut in two at its second byte."""
    made = Made(ESTOP, tmp_path)
    whole = made.packets()
    expected = by_monitor(made)
    assert {row[4] for row in expected} >= {"right"}
    names = made.naming.connections[0]
    places = {address + 2 for side in names.addresses for address in side}
    made.write([cut(packet, *places) for packet in whole])
    word = {"verdict": "fsoe.crc.verdict", "state": "fsoe.state", "number": "fsoe.sequence"}
    found = [
        (i.packet, i.one(word["verdict"]), i.one(word["state"]), int(i.one(word["number"]) or 0))
        for i in items(made.script, made.capture)
        if i.one(word["verdict"]) not in ("copy", "same")
    ]
    assert sorted(found) == sorted((row[0], *row[4:]) for row in expected)
    scanned = [row[2:] for row in by_scanner(made)]
    made.write(whole)
    assert scanned == [row[2:] for row in by_scanner(made)]


@pytest.mark.parametrize("folder", [ESTOP, ROBOT], ids=["estop", "el6910"])
def test_every_frame_is_shown_with_its_values(folder: Path, tmp_path: Path):
    made = Made(folder, tmp_path)
    packets, numbers = made.packets(), {c.name: n for n, c in enumerate(made.naming.connections)}
    places = set()
    for item in items(made.script, made.capture):
        frame = packets[item.packet - 1][item.at : item.at + item.size]
        data = safe_data_of(frame)
        number = numbers[item.one("fsoe.connection")]
        names = made.naming.connections[number]
        way = int(item.one("fsoe.direction") == f"{names.ends[1]} > {names.ends[0]}")
        places.add((number, way, item.at - DATA_AT))
        assert item.one("fsoe.command") == f"0x{frame[0]:02x}"
        assert item.one("fsoe.conn_id") == str(int.from_bytes(frame[-2:], "little"))
        assert "".join(item.all("fsoe.safe_data")).replace(":", "") == data.hex()
        code = str(data[0]) if frame[0] == Command.RESET else None
        assert item.one("fsoe.reset_code") == code
        is_process = frame[0] == Command.PROCESS_DATA
        values = [str(s.read(data)) for s in names.signals[way]] if is_process else []
        assert item.all(f"fsoe.c{number + 1}.{('to_sub', 'to_main')[way]}.") == values
    assert places == {
        (n, way, address)
        for n, c in enumerate(made.naming.connections)
        for way in (0, 1)
        for address in c.addresses[way]
    }


def test_a_capture_that_begins_in_the_middle(tmp_path: Path):
    made = Made(ROBOT, tmp_path)
    made.write(made.packets()[200:])
    found = made.new_frames()
    assert [row[4] for row in found[:4]] == ["unchecked"] * 4
    assert found[-1][4] == "right"
    assert found == by_monitor(made)


def test_a_lost_packet(tmp_path: Path):
    made = Made(ESTOP, tmp_path)
    packets = made.packets()
    made.write(packets[:151] + packets[155:])
    found = made.new_frames()
    assert {row[4] for row in found} != {"right"}
    assert found == by_monitor(made)


@pytest.mark.parametrize("byte", first(1, range(6)))
@pytest.mark.uncounted
def test_a_corrupted_frame_is_wrong_there_and_nowhere_else(byte: int, tmp_path: Path):
    made = Made(ESTOP, tmp_path)
    rows = [row for row in made.new_frames() if row[3].startswith("36")]
    packet, _, way, *_ = rows[20]
    packets = made.packets()
    data = bytearray(packets[packet - 1])
    data[DATA_AT + made.watched()[0][way] + byte] ^= 0x40
    packets[packet - 1] = bytes(data)
    made.write(packets)
    found = made.new_frames()
    assert [row[0] for row in found if row[4] == "wrong"] == [packet]
    assert found == by_monitor(made)
    shown = run(made.script, made.capture, "-Y", "_ws.expert.message contains chain")
    assert shown.count("WRONG CRC") == shown.count("\n") == 1


def test_the_info_column(tmp_path: Path):
    made = Made(ESTOP, tmp_path)
    lines = run(made.script, made.capture, "-Y", "fsoe.reset_code && fsoe.state").splitlines()
    assert lines[0].endswith("| FSoE el1918 > ek1914 Reset 0")
    assert lines[1].endswith("| FSoE ek1914 > el1918 Reset 0")


def test_the_preference_shifts_all_addresses(tmp_path: Path):
    made = Made(ESTOP, tmp_path)
    packets = [p[:18] + (0x10000).to_bytes(4, "little") + p[22:] for p in made.packets()]
    before = made.new_frames()
    made.write(packets)
    assert made.new_frames() == []
    shown = run(
        made.script, made.capture, "-o", "fsoe.base:65536", "-Y", "fsoe.state", "-T", "fields",
        "-e", "frame.number",
    )  # fmt: skip
    assert sorted(int(n) for n in shown.split()) == sorted({row[0] for row in before})


def test_packets_cut_short_by_the_capture(tmp_path: Path):
    """Any length is fine: no Lua error, and only whole datagrams are looked at."""
    made = Made(ESTOP, tmp_path)
    packet = made.packets()[9]
    made.write([packet[:n] for n in range(len(packet) + 1)])
    assert {item.packet for item in items(made.script, made.capture)} <= {
        n + 1 for n in range(len(packet) + 1) if n >= DATA_AT + made.image.size_bytes + 2
    }


def test_vlan_and_udp(tmp_path: Path):
    made = Made(ESTOP, tmp_path)
    before, packets = made.new_frames(), made.packets()
    made.write([p[:12] + bytes.fromhex("8100 0007") + p[12:] for p in packets])
    assert [row[3:] for row in made.new_frames()] == [row[3:] for row in before]
    made.write([_udp(p) for p in packets])
    assert [row[3:] for row in made.new_frames()] == [row[3:] for row in before]


def _udp(packet: bytes) -> bytes:
    data = packet[14:]
    head = bytes.fromhex("4500") + (28 + len(data)).to_bytes(2, "big") + bytes.fromhex("0000 0000")
    head += bytes.fromhex("4011 0000 c0a80001 c0a80002 88a4 88a4")
    head += (8 + len(data)).to_bytes(2, "big") + bytes(2)
    return packet[:12] + bytes.fromhex("0800") + head + data


@pytest.mark.parametrize("folder", [ESTOP, ROBOT], ids=["estop", "el6910"])
@pytest.mark.parametrize("name", listed("pcap", "*.pcapng"))
def test_ethercat_without_fsoe_shows_none(folder: Path, name: str, tmp_path: Path):
    resolution = resolution_of(folder)
    script, capture = tmp_path / "fsoe.lua", tmp_path / "real.pcapng"
    script.write_text(lua_dissector(resolution, compile_plan(resolution)), "utf-8")
    shutil.copy(need("pcap", name), capture)
    assert run(script, capture, "-Y", "ecat", "-c", "5") != ""
    assert items(script, capture) == []


@settings(max_examples=4)
@given(texts=st.lists(st.text(), min_size=50, max_size=200))
def test_any_text_passes_through_lua(texts, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lua")
    script, capture = folder / "texts.lua", folder / "empty.pcapng"
    CaptureWriter(capture).close()
    prints = """
local function hex(text)
  io.write((text:gsub(".", function(c) return ("%02x"):format(c:byte()) end)), "\\n")
end
""" + "".join(f"hex({_quoted(t)})\n" for t in [ODD, *texts])
    script.write_text(prints, "ascii")
    lines = run(script, capture).split("\n")
    assert lines[:-1] == [t.encode("utf-8", "replace").hex() for t in [ODD, *texts]]


def test_odd_names_do_not_break_it(tmp_path: Path):
    made = Made(ESTOP, tmp_path)
    before = made.new_frames()
    r = made.resolution
    odd = dataclasses.replace(
        r,
        network=dataclasses.replace(r.network, name=ODD),
        connections=[dataclasses.replace(c, name=ODD) for c in r.connections],
    )
    made.script.write_text(lua_dissector(odd, compile_plan(odd)), "utf-8")
    found = items(made.script, made.capture)
    assert sum(item.one("fsoe.state") is not None for item in found) == len(before)
