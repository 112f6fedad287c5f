"""Captures of a start-up become descriptions; what a capture does not show is said, not guessed."""

from __future__ import annotations

import io
import struct
import tracemalloc

import pytest
from capture.traffic import Bus, cut, datagram, packet
from formats.captured_bus import described, expected, layout, read
from formats.startup import (
    FPWR,
    FRAMES,
    IN_START,
    LOGIC,
    LRW,
    OUT_START,
    PRODUCTS,
    TERMINAL,
    Startup,
    startup,
)

from fsoe_net.capture import start_up as capture
from fsoe_net.capture.start_up import load_capture
from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.recognise import find_format
from fsoe_net.formats.shared.files import Collector

WAYS = {(1, 3, 0, 2), (0, 3, 1, 2)}  # source and destination: SubDevice, sync manager


def ways(description):
    return {
        (c.source.subdevice, c.source.sm_index, c.destination.subdevice, c.destination.sm_index)
        for c in description.copies
    }


def test_frames_that_two_datagrams_hold_are_found():
    made = Startup()
    made.configure()
    begun, bus = len(made.packets), Bus()
    made.cycle(bus, 300)
    places = [at + 2 for at in (bus.main_at, bus.sub_at, bus.main_copy_at, bus.sub_copy_at)]
    made.packets[begun:] = [cut(row, *places) for row in made.packets[begun:]]
    found, _ = described(made.pcap())
    assert ways(found) == WAYS


@pytest.mark.parametrize("how", ["upload", "complete", "segments"])
@pytest.mark.parametrize("replies_only", [False, True])
@pytest.mark.parametrize("wide", [False, True])
def test_start_up_reports_everything(how, replies_only, wide):
    made = startup(how=how, wide=wide, cycles=300, replies_only=replies_only, vlan=wide)
    found, findings = described(made)
    assert findings == []
    assert found.format == "capture"
    for number, (sub, station) in enumerate(zip(found.subdevices, FRAMES, strict=True)):
        assert (sub.position, sub.alias) == (number, 7 * number)
        assert (sub.device.vendor_id, sub.device.product_code) == (2, PRODUCTS[station])
        assert (sub.revision, sub.serial) == (0x120000, station)
        assert sub.name == ("LOGIC" if station == LOGIC else "TERMINAL")
        assert layout(sub) == expected(station)
        assert sub.notes == ()
    assert ways(found) == WAYS
    assert {c.bits for c in found.copies} == {48}


def test_few_frames_prove_no_copy():
    found, _ = described(startup(cycles=12))
    assert found.copies == ()


def test_frames_that_are_not_copy_are_none():
    made = Startup()
    made.configure()
    one, other = Bus(), Bus(seed=5)
    for _ in range(300):
        left, right = bytearray(one.image()), other.image()
        for at in (one.main_copy_at, one.sub_copy_at):
            left[at : at + 6] = right[at : at + 6]
        made.packets.append(packet(datagram(LRW, 0, bytes(left), 6)))
    found, _ = described(made.pcap())
    assert found.copies == ()


def test_same_bytes_with_wrong_crcs_are_not_copy():
    """Something that counts and is copied has the shape of a frame, and is none."""
    made = Startup()
    made.configure()
    last = [bytes(6), bytes(6)]
    for n in range(300):
        image = bytearray(200)
        now = [
            struct.pack("<BBHH", 0x36, n & 1, n * 7 % 65521, 7),
            struct.pack("<BBHH", 0x36, 0, n, 7),
        ]
        for at, data in ((20, now[0]), (60, now[1]), (100, last[0]), (150, last[1])):
            image[at : at + 6] = data
        made.packets.append(packet(datagram(LRW, 0, bytes(image), 6)))
        last = now
    content, found = read(made.pcap())
    assert content.copies == ()
    assert any("prove" in message for *_, message in found)


def test_lost_packets_and_retries_change_nothing():
    """Every fifth packet is there twice, and of the process data some are lost."""
    made = Startup()
    made.configure()
    made.packets = [
        row for n, p in enumerate(made.packets) for row in [p] * (2 if n % 5 == 0 else 1)
    ]
    begin = len(made.packets)
    made.cycle(Bus(), 800)
    made.packets[begin:] = [p for n, p in enumerate(made.packets[begin:]) if n % 97]
    found, findings = described(made.pcap())
    assert findings == []
    assert ways(found) == WAYS
    assert [layout(s) for s in found.subdevices] == [expected(s) for s in FRAMES]


def test_a_lost_answer_puts_no_word_elsewhere():
    """The answer to an EEPROM command is lost: what is read next belongs to no known address."""
    whole = Startup()
    whole.addresses()
    begin = len(whole.packets)
    whole.eeprom(LOGIC)
    for lost in range(begin, begin + 60):
        made = Startup()
        made.packets = whole.packets[:lost] + whole.packets[lost + 1 :]
        found, _ = described(made.pcap())
        sub = found.subdevices[0]
        assert sub.device.product_code in (0, PRODUCTS[LOGIC])
        assert sub.device.vendor_id in (0, 2)
        assert sub.serial in (None, LOGIC)


def test_aborted_writes_do_not_count():
    made = Startup()
    made.configure()
    made.download(TERMINAL, 0x1600, 0, b"\0")
    made.download(TERMINAL, 0x1600, 0, b"\4")
    made.download(TERMINAL, 0x1600, 1, struct.pack("<I", 0x70990108), abort=0x06010002)
    found, findings = described(made.pcap())
    assert findings == []
    assert layout(found.subdevices[1]) == expected(TERMINAL)
    assert any("0x1600:01" in note and "0x06010002" in note for note in found.subdevices[1].notes)


def test_last_write_counts():
    made = Startup()
    made.configure()
    made.download(TERMINAL, 0x1600, 2, struct.pack("<I", 0x70010808))
    found, _ = described(made.pcap())
    entries = layout(found.subdevices[1])[2][0][1]
    assert entries == (0x70000108, 0x70010808, 0x70000310, 0x70000210)


def test_answers_to_another_question_do_not_count():
    made = Startup()
    made.configure()
    made.ask(TERMINAL, struct.pack("<BHBI", 0x40, 0x1C12, 1, 0))
    made.tell(TERMINAL, struct.pack("<BHB", 0x4B, 0x1C13, 1) + b"\x99\x16\0\0")
    found, findings = described(made.pcap())
    assert findings == []
    assert layout(found.subdevices[1]) == expected(TERMINAL)


def test_start_up_sdos_are_taken_and_later_ones_are_not():
    made = Startup()
    made.addresses()
    made.managers(TERMINAL)
    made.download(TERMINAL, 0x8000, 1, b"\5")
    made.download(TERMINAL, 0x8000, 1, b"\6\0")
    made.datagram(FPWR, TERMINAL, 0x0120, b"\x08\0")
    made.download(TERMINAL, 0x8000, 2, b"\7")
    found, _ = described(made.pcap())
    sub = found.subdevices[1]
    rows = [(s.index, s.subindex, s.size_bytes, s.value) for s in sub.device.sdos]
    assert rows == [(0x8000, 1, 2, 6)]
    assert any("outside of the start-up" in note for note in sub.notes)


def test_mapping_that_does_not_fill_its_room_is_refused():
    made = Startup()
    made.configure()
    at = len(made.packets) + 3
    made.download(TERMINAL, 0x1C12, 1, struct.pack("<H", 0x1601))
    made.upload(TERMINAL, 0x1601, 0, b"\1")
    made.upload(TERMINAL, 0x1601, 1, struct.pack("<I", 0x70100110))
    _, findings = described(made.pcap())
    assert [(code, level) for code, level, *_ in findings] == [("FSN154", Severity.ERROR)]
    assert findings[0][2] == at + 1  # the answer to the write


def test_half_a_layout_is_none():
    made = Startup()
    made.configure()
    made.download(TERMINAL, 0x1C13, 1, struct.pack("<H", 0x1A05))
    found, findings = described(made.pcap())
    sub = found.subdevices[1]
    assert sub.device.sync_managers == ()
    assert [code for code, *_ in findings] == ["FSN153"]
    assert "0x1a05" in findings[0][3]
    assert 0x1600 in {p.index for p in sub.available}


def test_capture_from_the_middle_names_what_it_lacks():
    made = Startup()
    made.cycle(Bus(), 50)
    content, found = read(made.pcap())
    assert content is None
    assert [(code, level) for code, level, *_ in found] == [("FSN153", Severity.ERROR)]
    assert "LRW 0x00000000 with 200 bytes" in found[0][3]


def test_station_addresses_alone_are_not_places():
    made = Startup()
    made.eeprom(TERMINAL)
    made.managers(TERMINAL)
    made.layout(TERMINAL)
    found, findings = described(made.pcap())
    assert [s.position for s in found.subdevices] == [None]
    assert layout(found.subdevices[0]) == expected(TERMINAL)
    assert [code for code, *_ in findings] == ["FSN153"]
    assert "0x1002" in findings[0][3]
    assert "place in the ring" in findings[0][3]


def test_positions_come_from_what_went_out_where_no_broadcast_was_seen():
    made = Startup()
    made.datagram(2, -1, 0x0010, struct.pack("<H", TERMINAL))
    made.eeprom(TERMINAL)
    found, _ = described(made.pcap())
    assert [s.position for s in found.subdevices] == [1]
    only = Startup(replies_only=True)
    only.datagram(2, -1, 0x0010, struct.pack("<H", TERMINAL))
    only.eeprom(TERMINAL)
    found, _ = described(only.pcap())
    assert [s.position for s in found.subdevices] == [None]


def test_another_ring_makes_a_new_start():
    made = Startup(count=1)
    made.addresses()
    made.eeprom(LOGIC)
    made.count = 2
    at = len(made.packets)
    made.packets += Startup().packets
    made.datagram(7, 0, 0, b"\0\0", counter=2)
    made.datagram(2, 0, 0x0010, struct.pack("<H", TERMINAL))
    made.eeprom(TERMINAL)
    found, findings = described(made.pcap())
    assert [s.serial for s in found.subdevices] == [TERMINAL]
    assert any(line > at and "changed" in message for _, _, line, message in findings)


def test_short_packets_are_named():
    made = Startup()
    made.configure()
    content, rows = read(made.pcap(snap=120))
    assert content is not None
    first = next(n for n, p in enumerate(made.packets, 1) if len(p) > 120)
    assert [(code, line) for code, _, line, _ in rows if code == "FSN152"] == [("FSN152", first)]


def test_a_file_that_ends_early_gives_what_was_before():
    data = startup(cycles=300)
    found, findings = described(data[:-50])
    assert [code for code, *_ in findings] == ["FSN151"]
    assert ways(found) == WAYS
    assert not found.truncated


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xd4\xc3\xb2\xa1",
        b"\x0a\x0d\x0d\x0a" + bytes(40),
        b"\x1f\x8b" + bytes(30),
        Startup().pcap(),
        struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 113),
    ],
)
def test_no_ethercat_is_refused(data):
    content, found = read(data)
    assert content is None
    assert [(code, level) for code, level, *_ in found] == [("FSN150", Severity.ERROR)]


def test_other_protocols_between_do_not_matter():
    made = Startup()
    made.configure()
    noise = bytes(12) + b"\x08\x00" + bytes(50)
    made.packets = [row for p in made.packets for row in (noise, p, b"\1\2\3")]
    found, findings = described(made.pcap())
    assert findings == []
    assert [layout(s) for s in found.subdevices] == [expected(s) for s in FRAMES]


def test_captures_are_known_by_content(tmp_path):
    path = tmp_path / "bus.txt"
    path.write_bytes(startup())
    out = Collector()
    assert find_format(path, out).kind == "capture"
    found = load_capture(path, out)
    assert found is not None
    assert [s.path for s in out.sources] == [str(path)]
    assert load_capture(tmp_path, Collector()) is None
    missing = Collector()
    assert load_capture(tmp_path / "no", missing) is None
    assert [d.code for d in missing.diagnostics] == ["FSN101"]


class _Endless(io.RawIOBase):
    """A start-up, then the same cycles again and again, without holding them all."""

    def __init__(self, size):
        made = Startup()
        made.configure()
        self._head = io.BytesIO(made.pcap())
        made.packets = []
        made.cycle(Bus(size=1400), 400)
        self._again = made.pcap()[24:]
        self._left = size
        self._at = 0

    def readable(self):
        return True

    def readinto(self, into):
        data = self._head.read(len(into))
        if not data and self._left > 0:
            data = self._again[self._at : self._at + len(into)]
            self._at = (self._at + len(data)) % len(self._again)
            self._left -= len(data)
        into[: len(data)] = data
        return len(data)


@pytest.mark.parametrize("megabytes", [1, 24])
@pytest.mark.uncounted
def test_memory_does_not_grow_with_the_capture(megabytes):
    stream = _Endless(megabytes << 20)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        content = capture.read_stream("big", stream, Collector())
        peak = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    assert content is not None
    assert ways(content) == WAYS
    assert peak < 2 << 20


def test_places_of_sync_managers():
    found, _ = described(startup())
    for sub in found.subdevices:
        starts = [sm.start_byte for sm in sub.device.sync_managers]
        assert starts == [OUT_START, IN_START]
