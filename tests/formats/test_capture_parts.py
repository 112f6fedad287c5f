"""Parts of a capture on their own: mailboxes that do not belong, EEPROM reads, packets cut off."""

from __future__ import annotations

import errno
import io
import os
import struct

import pytest
from capture.traffic import datagram, packet
from formats.captured_bus import described, expected, layout, read
from formats.startup import BRD, FPRD, FPWR, LOGIC, TERMINAL, Startup, sii

from fsoe_net.capture import start_up as capture
from fsoe_net.capture.start_up import load_capture
from fsoe_net.formats.capture import ring as capture_ring
from fsoe_net.formats.capture.datagrams import datagrams
from fsoe_net.formats.capture.sdo import CapturedSdo, SdoAbort, SdoFollower
from fsoe_net.formats.capture.sii import SiiReads
from fsoe_net.formats.shared.files import Collector


def mailbox(service: int, body: bytes, *, kind: int = 3, length: int | None = None) -> bytes:
    body = struct.pack("<H", service << 12) + body
    size = len(body) if length is None else length
    return struct.pack("<HHBB", size, 0, 0, kind) + body


def sdo(command: int, index: int = 0x1C12, sub: int = 1, data: bytes = b"\0\0\0\0") -> bytes:
    return struct.pack("<BHB", command, index, sub) + data


ASK = mailbox(2, sdo(0x40))
ASK_SEGMENT = mailbox(2, sdo(0x60))
WRITE = mailbox(2, sdo(0x21, data=struct.pack("<I", 8)))
TOLD = CapturedSdo(index=0x1C12, subindex=1, data=b"\1\0\0\0", written=False, complete=False)
ANSWER = mailbox(3, sdo(0x43, data=b"\1\0\0\0"))
LONG = mailbox(3, sdo(0x41, data=struct.pack("<I", 8)))


@pytest.mark.parametrize(
    ("asked", "answered"),
    [
        pytest.param([mailbox(2, sdo(0x40), kind=4)], ANSWER, id="another protocol"),
        pytest.param([mailbox(2, sdo(0x40), length=99)], ANSWER, id="a request cut off"),
        pytest.param([mailbox(3, sdo(0x40))], ANSWER, id="no request"),
        pytest.param([ASK], mailbox(3, sdo(0x43), length=99), id="an answer cut off"),
        pytest.param([ASK], mailbox(3, b"\x43", length=3), id="an answer too short"),
        pytest.param([ASK], mailbox(2, sdo(0x43)), id="no answer"),
        pytest.param([ASK], mailbox(3, sdo(0x43, sub=2)), id="another subindex"),
        pytest.param([ASK], mailbox(3, sdo(0x43, index=0x1C13)), id="another index"),
        pytest.param([ASK], mailbox(3, sdo(0x60)), id="the answer to a write"),
        pytest.param([ASK], mailbox(3, sdo(0x00)), id="a segment that was not asked for"),
        pytest.param([ASK, ASK_SEGMENT], mailbox(3, sdo(0x00)), id="a segment before its begin"),
        pytest.param([ASK, mailbox(2, sdo(0x80))], ANSWER, id="given up by the MainDevice"),
        pytest.param([ASK], mailbox(3, sdo(0x80, sub=3)), id="given up, but another"),
        pytest.param([], ANSWER, id="nothing was asked"),
    ],
)
def test_unrequested_values_are_absent(asked: list[bytes], answered: bytes):
    follower = SdoFollower()
    for request in asked:
        follower.request(request)
    assert follower.response(answered) is None


def test_an_answer_counts_once():
    follower = SdoFollower()
    assert follower.request(ASK) is None
    assert follower.response(ANSWER) == TOLD
    assert follower.response(ANSWER) is None


@pytest.mark.parametrize(
    ("answers", "data"),
    [
        pytest.param([b"\x00ABCDEFG", b"\x1d" + b"H".ljust(7)], b"ABCDEFGH", id="two segments"),
        pytest.param([b"\x01ABCDEFG"], None, id="shorter than told"),
        pytest.param([b"\x10ABCDEFG"], None, id="the other toggle bit"),
        pytest.param([b"\x20ABCDEFG"], None, id="the answer to a write"),
    ],
)
def test_segmented_upload_is_joined(answers: list[bytes], data: bytes | None):
    follower = SdoFollower()
    follower.request(ASK)
    assert follower.response(LONG) is None
    found = None
    for number, answer in enumerate(answers):
        follower.request(mailbox(2, sdo(0x60 | number % 2 << 4)))
        found = follower.response(mailbox(3, answer))
    assert (None if found is None else found.data) == data


def test_more_segments_than_any_object_has():
    follower = SdoFollower()
    follower.request(ASK)
    follower.response(mailbox(3, sdo(0x41, data=struct.pack("<I", 1 << 20))))
    for number in range(10_000):
        follower.request(mailbox(2, sdo(0x60 | number % 2 << 4)))
        follower.response(mailbox(3, bytes([number % 2 << 4]) + b"1234567"))
    follower.request(mailbox(2, sdo(0x60)))
    assert follower.response(mailbox(3, b"\x011234567")) is None


@pytest.mark.parametrize("place", [(0x1C12, 1), (0, 0)])
def test_aborts_name_what_was_given_up(place: tuple[int, int]):
    follower = SdoFollower()
    follower.request(WRITE)
    body = struct.pack("<BHBI", 0x80, *place, 0x06090030)
    assert follower.response(mailbox(3, body)) == SdoAbort(
        index=0x1C12, subindex=1, written=True, code=0x06090030
    )


def test_an_eeprom_read_that_was_interrupted_is_none():
    reads = SiiReads()
    reads.written(0x0502, struct.pack("<HI", 0x0100, 8))
    reads.written(0x0502, b"\x00\x02")  # a write to the EEPROM: its address is another matter
    reads.read(0x0508, b"\1\2\3\4")
    assert reads.words == {}
    reads.written(0x0502, struct.pack("<HI", 0x0100, 8))
    reads.read(0x0502, struct.pack("<HI", 0x0000, 16) + b"\1\2\3\4")  # status, address and data
    assert reads.words == {16: 0x0201, 17: 0x0403}
    reads.read(0x0502, struct.pack("<HI", 0x8000, 16) + b"\5\6\7\x08")  # busy
    assert reads.words == {16: 0x0201, 17: 0x0403}
    assert reads.conflicts == set()
    reads.read(0x0502, struct.pack("<HI", 0x0000, 16) + b"\1\2\7\x08")
    assert (reads.words, reads.conflicts) == ({16: 0x0201, 17: 0x0807}, {17})
    reads.read(0x0502, struct.pack("<HI", 0x0000, 0x10000) + b"\1\2\3\4")
    assert set(reads.words) == {16, 17}


ROW = datagram(4, 0x01301001, b"\0\0", 1)


@pytest.mark.parametrize(
    ("data", "number", "cut"),
    [
        (packet(ROW), 1, False),
        (packet(ROW)[:15], 0, True),
        (packet(ROW)[:20], 0, True),
        (packet(ROW)[: 14 + 2 + 12], 0, True),
        (packet(ROW)[:14] + b"\x0e\x40" + packet(ROW)[16:], None, None),  # mailbox gateway
        (packet(ROW)[:12] + b"\x81\x00\0\0" * 9 + packet(ROW)[12:], None, None),
        (packet(ROW)[:12] + b"\x08\x06" + packet(ROW)[14:], None, None),
    ],
)
def test_datagrams_are_found_in_each_kind_of_packet(
    data: bytes, number: int | None, cut: bool | None
):
    found = datagrams(data)
    assert (None if found is None else (len(found[0]), found[1])) == (
        None if number is None else (number, cut)
    )


class Broken(io.RawIOBase):
    def readable(self) -> bool:
        return True

    def readinto(self, into: object) -> int:
        raise OSError(errno.EIO, os.strerror(errno.EIO))


def test_a_disk_that_fails(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(capture, "open_file", lambda path: Broken())
    out = Collector()
    assert load_capture("a.pcap", out) is None
    (found,) = out.diagnostics
    assert (found.code, str(found.span)) == ("FSN101", "a.pcap")
    assert found.message == "cannot read 'a.pcap': Input/output error"
    assert found.hint == "check the path"


# -- what a capture shows twice, and differently --------------------------------------------------


def notes(made: Startup) -> tuple[str, ...]:
    found, _ = described(made.pcap())
    return found.subdevices[-1].notes


def test_differing_identities_are_noted():
    made = Startup()
    made.configure()
    made.upload(TERMINAL, 0x1018, 2, struct.pack("<I", 0x12345678))
    assert notes(made) == ("product is 0x07703052 in the EEPROM and 0x12345678 in 0x1018",)


def test_an_eeprom_of_two_values():
    made = Startup()
    made.configure()
    made.datagram(FPWR, TERMINAL, 0x0502, struct.pack("<HI", 0x0100, 4))
    made.datagram(FPRD, TERMINAL, 0x0502, b"\0\0", b"\0\0")
    made.datagram(FPRD, TERMINAL, 0x0508, bytes(4), b"\5\0\0\0")
    assert notes(made) == ("the EEPROM was read with two values (word 0x04); the last is taken",)


def test_downloads_that_no_file_can_hold():
    made = Startup()
    made.addresses()
    made.managers(TERMINAL)
    made.datagram(FPWR, TERMINAL, 0x0120, b"\x02\0")
    made.download(TERMINAL, 0x8000, 0, b"\2\0\1\0", complete=True)
    made.download(TERMINAL, 0x8001, 1, b"123")
    assert "2 SDO downloads are not plain 1, 2, 4 or 8 bytes; left out" in notes(made)


def test_a_sync_manager_that_was_switched_off_is_none():
    made = Startup()
    made.configure()
    made.datagram(FPWR, TERMINAL, 0x0818, struct.pack("<HHBBBB", 0x1200, 6, 0x20, 0, 0, 0))
    found, _ = described(made.pcap())
    (outputs, inputs) = found.subdevices[1].device.sync_managers
    assert (outputs.start_byte, inputs.start_byte) == (0x1100, 0x1200)
    assert layout(found.subdevices[1]) == expected(TERMINAL)


def test_a_status_that_all_are_asked_for():
    """BRD of the EEPROM's status: busy for all, so what follows belongs to no address."""
    made = Startup(count=1)
    made.addresses()
    made.datagram(FPWR, LOGIC, 0x0502, struct.pack("<HI", 0x0100, 8))
    made.datagram(FPRD, LOGIC, 0x0502, b"\0\0", b"\0\0")
    made.datagram(BRD, 0, 0x0502, b"\0\0", b"\0\x80")
    made.datagram(FPRD, LOGIC, 0x0508, bytes(4), sii(LOGIC)[16:20])
    found, findings = described(made.pcap())
    assert found.subdevices[0].device.vendor_id == 0
    assert [code for code, *_ in findings] == ["FSN153"]


def test_more_subdevices_than_can_be_kept(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(capture_ring, "_MOST_STATIONS", 8)
    made = Startup(count=1)
    made.addresses()
    for station in range(1, 10):
        made.datagram(FPRD, station, 0x0130, b"\0\0", b"\x08\0")
    _, found = read(made.pcap())
    assert "more SubDevices than can be kept; the rest is left out" in [row[3] for row in found]
