"""Public parts of ETG.5100 Annex A and a start-up recorded with a drive (§14 names the sources)."""

from __future__ import annotations

import struct

import pytest

from fsoe_net.fsoe.chain import Chain
from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.crc import block_crc
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.instance import Instance
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import decode_pdu
from fsoe_net.fsoe.sub_instance import SubInstance

# Entries 1, 2, 4 … 128 of both tables of Annex A. Both are linear, so these give the others.
TABLE_1 = (0x39B7, 0x736E, 0xE6DC, 0xF40F, 0xD1A9, 0x9AE5, 0x0C7D, 0x18FA)
TABLE_2 = (0x7648, 0xEC90, 0xE097, 0xF899, 0xC885, 0xA8BD, 0x68CD, 0xD19A)


def _entry(table: tuple[int, ...], value: int) -> int:
    entry = 0
    for bit, number in enumerate(table):
        entry ^= number if value >> bit & 1 else 0
    return entry


def _annex_a(fields: bytes) -> int:
    """Return the CRC as Annex A does it: from 0, a table each for register and input."""
    crc = 0
    for value in fields:
        crc = (crc << 8 & 0xFF00) ^ _entry(TABLE_1, crc >> 8) ^ _entry(TABLE_2, value)
    return crc


@pytest.mark.parametrize(
    ("old", "connection_id", "sequence", "command", "block", "data", "crc"),
    [
        (0, 0, 1, 0x4E, 0, "1234", 0x4D07),
        (0, 0, 1, 0x4E, 0, "12", 0xA176),
        (0xABCD, 7, 2, 0x36, 1, "dead", 0xBC47),
    ],
)
def test_a_block_has_the_published_crc(
    old: int, connection_id: int, sequence: int, command: int, block: int, data: str, crc: int
) -> None:
    safe = bytes.fromhex(data)
    assert block_crc(old, connection_id, sequence, command, block, safe) == crc
    fields = struct.pack("<HHHB", old, connection_id, sequence, command)
    fields += struct.pack("<H", block) if block else b""
    assert _annex_a(fields + safe) == crc


@pytest.mark.parametrize("value", range(256))
def test_the_tables_append_the_three_zeros_of_section_2(value: int) -> None:
    """Annex A appends no zeros; its second table is that of a byte with three zeros after it."""
    fields = struct.pack("<HHHB", value << 8, 0x0102, value, 0x36)
    data = bytes((value, value ^ 0x5A))
    assert block_crc(value << 8, 0x0102, value, 0x36, 0, data) == _annex_a(fields + data)


MAIN = (
    "2a0000c42d0000b91400009c0200007f0f0000",
    "4e1122b71f0000434e00006658000085550000",
    "6407004a1a030002b1000015310000f63c0700",
    "52020027f7640032860000f2ed000011e00700",
    "3601006f3e00001622000033340000d0390700",
    "36010042a200006f6800004a7e0000a9730700",
    "3601001b1e0000c9280000ec3e00000f330700",
    "360100071c00005b8800007e9e00009d930700",
)
SUB = (
    "2a0000c42d0000b91400009c0200007f0f0000d62e000035230000",
    "4ebd9a0726000066c0000043d60000a0db000009fa0000eaf70000",
    "640700f56503001d0800000a880000e985000040a40000a3a90700",
    "520200cb3c6400fd4e00003d250000de2800007709000094040700",
    "36011f79531020cb0230408e1f506057de70800425112254430700",
    "36011f9e4f1020f2043040b71950606ed870803d2311226d450700",
    "36011f1fd3102047de304002c35060db02708088f91122d89f0700",
)
INPUTS = bytes.fromhex("011f10203040506070801122")


def _answers(end: Instance, data: bytes, frames: list[bytes | None]) -> list[str]:
    end.set_safe_data(data)
    answers = []
    for number, frame in enumerate(frames):
        answer = end.step(number * 1_000_000, frame)
        assert answer is not None
        answers.append(answer.hex())
        end.enable = end.state is not State.RESET  # the recording has ProcessData from the start
    return answers


@pytest.mark.shows("R17")
def test_both_ends_send_the_frames_of_a_drive_that_passed_the_conformance_test() -> None:
    """15 frames of a start-up: 8 bytes out and 12 in, ConnID 7, address 3, watchdog 100 ms."""
    mains, subs = (tuple(bytes.fromhex(text) for text in frames) for frames in (MAIN, SUB))
    main = MainInstance(
        MainConfig(connection_id=7, address=3, watchdog_ms=100, safe_out_bytes=8, safe_in_bytes=12),
        session_ids=lambda: 0x2211,
    )
    outputs = bytes((1,)) + bytes(7)
    assert _answers(main, outputs, [None, *subs]) == [frame.hex() for frame in mains]
    assert main.received_safe_data == INPUTS == decode_pdu(subs[-1]).safe_data
    sub = SubInstance(
        SubConfig(address=3, safe_out_bytes=8, safe_in_bytes=12), session_ids=lambda: 0x9ABD
    )
    assert _answers(sub, INPUTS, [*mains[:-1]]) == [frame.hex() for frame in subs]
    assert sub.received_safe_data == outputs


@pytest.mark.shows("R17")
@pytest.mark.parametrize("both", [True, False], ids=["the rule", "without the rule"])
def test_a_crc_that_would_repeat_takes_the_next_number(both: bool) -> None:
    """ETG.5100: the sequence number skips where CRC_0 would equal that of the frame before."""
    command, connection_id = 0x36, 7

    def crc(old: int, sequence: int, safe: bytes) -> int:
        return _annex_a(struct.pack("<HHHB", old, connection_id, sequence, command) + safe)

    first = b"\x01\x00"
    before = crc(0, 1, first)
    every = (struct.pack("<H", value) for value in range(1 << 16))
    second = next(safe for safe in every if crc(before, 2, safe) == before)
    crcs = (before, crc(before, 3 if both else 2, second))
    frames = [
        struct.pack("<B2sHH", command, safe, number, connection_id)
        for safe, number in zip((first, second), crcs, strict=True)
    ]
    sender, receiver = Chain(), Chain()
    sent = [sender.send(command, safe, connection_id) for safe in (first, second)]
    assert (sent == frames) is both
    received = [receiver.receive(decode_pdu(frame)) for frame in frames]
    assert received == [True, both]
    if both:  # the number goes on behind the one that was skipped
        third = sender.send(command, first, connection_id)
        assert decode_pdu(third).crcs == (crc(crcs[1], 4, first),)
        assert receiver.receive(decode_pdu(third))
