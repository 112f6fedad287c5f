"""PDO layout to the bit and recognition of frames, against layouts of real devices."""

from __future__ import annotations

import re

import pytest
from networks import example

from fsoe_net.model.bus import Device, Direction, Entry, Pdo, SyncManager
from fsoe_net.model.layout import FramePair


def device(text: str, direction: Direction = Direction.INPUT) -> Device:
    """Build a device from ``index:sub/bits`` words, as PDO tables print them."""
    entries = []
    for word in text.split():
        index, sub, bits = re.fullmatch(r"(\w{4}):(\w\w)/(\d+)", word).groups()
        entries.append(Entry(index=int(index, 16), subindex=int(sub, 16), bits=int(bits)))
    carries = "tpdo" if direction is Direction.INPUT else "rpdo"
    pdos = (Pdo(index=0x1A00, entries=tuple(entries)),)
    return Device(
        path="",
        vendor_id=2,
        product_code=1,
        sync_managers=(SyncManager(index=3, direction=direction, carries=carries),),
        tpdos=pdos if carries == "tpdo" else (),
        rpdos=pdos if carries == "rpdo" else (),
    )


def frames(text: str) -> list[tuple[int, int]]:
    (sm,) = device(text).layout.managers
    return [(b.byte_offset, b.frame_bytes) for b in sm.blocks]


def test_estop_offsets_are_those_measured():
    resolution = example("estop")
    ek1914 = resolution.network.subdevices[0].layout
    assert ek1914 is not None
    placed = {
        (sm.sm.index, p.entry.address): p.bit_offset
        for sm in ek1914.managers
        for p in sm.placed
        if not p.entry.is_gap
    }
    assert placed[2, "0x7000:01"] == 0
    assert placed[2, "0x7001:02"] == 9
    assert placed[2, "0x7000:03"] == 16
    assert placed[2, "0x7000:02"] == 32
    assert placed[2, "0x7010:06"] == 53
    assert placed[3, "0x6010:04"] == 51
    assert [sm.size_bytes for sm in ek1914.managers] == [0, 0, 8, 8]


# Entry lists of real devices; the frame starts at the byte and has the length given.
REAL = {
    "EL1904": (
        "6000:01/8 6001:01/1 6001:02/1 6001:03/1 6001:04/1 0000:00/4 6000:03/16 6000:04/16",
        0,
        6,
    ),
    "EL2904": (
        "7000:01/8 7001:01/1 7001:02/1 7001:03/1 7001:04/1 0000:00/4 7000:02/16 7000:03/16",
        0,
        6,
    ),
    "EP1908": ("7000:01/8 0000:00/7 7001:01/1 7000:03/16 7000:02/16", 0, 6),
    "EL1918 as SubInstance": (
        "6080:01/8 6001:01/1 6002:01/1 6011:01/1 6012:01/1 6021:01/1 6022:01/1 6031:01/1 6032:01/1 "
        "6041:01/1 6042:01/1 6051:01/1 6052:01/1 6061:01/1 6062:01/1 6071:01/1 6072:01/1 "
        "6080:03/16 6080:02/16",
        0,
        7,
    ),
    "AX5805, two axes": (
        "E600:01/8 6640:00/8 0000:00/8 E600:03/16 6E40:00/8 0000:00/8 E600:04/16 E600:02/16",
        0,
        11,
    ),
    "drive, one CRC on a neighbouring object": (
        "6760:01/8 6640:00/16 6768:03/16 6630:00/16 6760:04/16 6611:00/16 6760:05/16 6760:02/16",
        0,
        15,
    ),
    "behind other data": ("6041:00/16 6064:00/32 6760:01/8 6640:00/16 6760:03/16 6760:02/16", 6, 7),
}


@pytest.mark.parametrize("name", REAL)
def test_frames_of_real_devices_are_recognised(name: str):
    text, at, size = REAL[name]
    assert frames(text) == [(at, size)]


# Ordinary process data that only look a little like a frame.
ORDINARY = {
    "analog inputs": "6000:01/8 6000:11/16 6010:01/8 6010:11/16",
    "six bytes of one record": "6000:01/8 6000:02/8 6000:03/16 6000:04/16",
    "cia402": "6041:00/16 6064:00/32 606C:00/32 6077:00/16 6061:00/8",
    "encoder": "6010:01/8 6010:09/8 6010:11/16 6010:12/16",
    "off the byte": "6001:01/1 6000:01/8 6002:01/7 6000:03/16 6000:02/16",
    "five data bits only": "6050:01/8 6051:01/5 6050:03/16 6050:02/16",
    "padding instead of the CRC": "6000:01/8 6001:01/8 0000:00/16 6000:02/16",
}


@pytest.mark.parametrize("name", ORDINARY)
def test_ordinary_data_are_not_frame(name: str):
    assert frames(ORDINARY[name]) == []


def test_several_slots_of_a_logic():
    resolution = example("el6910")
    logic = resolution.network.subdevices[0].layout
    assert logic is not None
    slots = {
        sm.sm.index: [(b.byte_offset, b.frame_bytes) for b in sm.blocks] for sm in logic.managers
    }
    assert slots[2] == [(0, 6), (6, 6), (12, 31), (43, 31)]
    assert slots[3] == [(0, 6), (6, 6), (12, 11), (23, 11)]


def test_drive_frames_lie_where_a_field_log_shows_them():
    # A driver log of this drive shows the frame of 31 bytes at byte 97 of its 46 + 51 byte image.
    drive = example("el6910").network.subdevices[3].layout
    assert drive is not None
    outputs, inputs = drive.managers[2], drive.managers[3]
    assert outputs.blocks[0].byte_offset == 35
    assert outputs.size_bytes + inputs.blocks[0].byte_offset == 97


def test_how_far_from_its_command_a_crc_may_be():
    """The second CRC of two on another object, the rest on one."""

    def found(by: int) -> bool:
        place = f"{0x6760 + by:04x}"
        return bool(frames(f"6760:01/8 6640:00/16 {place}:03/16 6641:00/16 6760:04/16 6760:02/16"))

    assert [by for by in range(-32, 33) if found(by)] == list(range(-15, 16))


def test_a_pair_of_one_frame():
    (block,) = device("6760:01/8 6640:00/8 6760:03/16 6760:02/16").layout.managers[0].blocks
    sends = FramePair(slot=0, sends=block, takes=None, matched=False)
    takes = FramePair(slot=0, sends=None, takes=block, matched=False)
    assert (sends.sent_bytes, sends.taken_bytes) == (takes.taken_bytes, takes.sent_bytes) == (6, 0)
    assert sends.fits(takes)
    assert not sends.fits(sends)
    assert (sends.blocks, takes.blocks) == ((block,), (block,))
