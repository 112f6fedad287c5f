"""Capture files of every kind; what is damaged in them is said, with everything before it read."""

import gzip
import io
import itertools
import random
import struct

import pytest
from capture_file import read_capture
from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.capture.capture import CaptureWriter
from fsoe_net.errors import InputError
from fsoe_net.formats.capture.packets import CaptureReader

T_S = 1_763_719_200
TIMES_NS = [T_S * 10**9 + n * 2_000_000 for n in range(4)]
DATA = [bytes((n,)) * (60 + n) for n in range(4)]


def pcap(order="<", unit_ns=1000, link=1, times=TIMES_NS, snap=65535):
    magic = 0xA1B2C3D4 if unit_ns == 1000 else 0xA1B23C4D
    head = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link)
    rows = (
        struct.pack(order + "IIII", t // 10**9, t % 10**9 // unit_ns, len(d[:snap]), len(d))
        + d[:snap]
        for t, d in zip(times, DATA, strict=False)
    )
    return head + b"".join(rows)


def block(kind, body, order="<"):
    body = body.ljust((len(body) + 3) // 4 * 4, b"\0")
    length = struct.pack(order + "I", 12 + len(body))
    return struct.pack(order + "I", kind) + length + body + length


def section(order="<"):
    return block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)


def interface(resolution=6, link=1, order="<", offset_s=None):
    options = struct.pack(order + "HHB3x", 9, 1, resolution)
    if offset_s is not None:
        options += struct.pack(order + "HHq", 14, 8, offset_s)
    body = struct.pack(order + "HHI", link, 0, 0) + options + bytes(4)
    return block(1, body, order)


def packet(units, data, number=0, order="<"):
    head = struct.pack(order + "IIIII", number, units >> 32, units & 0xFFFFFFFF, *[len(data)] * 2)
    return block(6, head + data, order)


def rows(data):
    return list(CaptureReader("x", io.BytesIO(data)))


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("unit_ns", [1, 1000])
def test_pcap_is_read_in_each_byte_order_and_compressed(order, unit_ns):
    want = [(t, 0, d) for t, d in zip(TIMES_NS, DATA, strict=True)]
    assert rows(pcap(order, unit_ns)) == want
    assert rows(gzip.compress(pcap(order, unit_ns))) == want


@pytest.mark.parametrize("order", ["<", ">"])
def test_pcapng_interfaces_have_clocks_of_their_own(order):
    data = (
        section(order)
        + interface(9, order=order)
        + interface(6, order=order)
        + interface(0x80 | 10, order=order, offset_s=T_S)
        + packet(TIMES_NS[0], DATA[0], 0, order)
        + packet(TIMES_NS[1] // 1000, DATA[1], 1, order)
        + packet(1024, DATA[2], 2, order)
    )
    assert rows(data) == [
        (TIMES_NS[0], 0, DATA[0]),
        (TIMES_NS[1], 1, DATA[1]),
        ((T_S + 1) * 10**9, 2, DATA[2]),
    ]


def test_sections_after_each_other_restarts():
    one = section() + interface(6) + packet(TIMES_NS[0] // 1000, DATA[0])
    other = section(">") + interface(9, order=">") + packet(TIMES_NS[1], DATA[1], order=">")
    assert [t for t, _, _ in rows(one + other)] == TIMES_NS[:2]


def test_packets_of_other_links_are_left_out():
    reader = CaptureReader(
        "x",
        io.BytesIO(
            section()
            + interface(6, 113)
            + interface(6)
            + packet(1, DATA[0], 0)
            + packet(2, DATA[1], 1)
        ),
    )
    assert [d for _, _, d in reader] == [DATA[1]]
    assert (reader.packets, reader.other_links) == (1, 1)


@pytest.mark.parametrize(
    "data",
    [pcap(link=113), section() + interface(6, 113) + packet(1, DATA[0])],
    ids=["pcap", "pcapng"],
)
def test_no_ethernet_at_all(data):
    with pytest.raises(InputError, match="link type 113, not Ethernet"):
        rows(data)


def test_cut_packets_are_counted():
    reader = CaptureReader("x", io.BytesIO(pcap(snap=40)))
    assert [len(d) for _, _, d in reader] == [40] * 4
    assert reader.cut == 4


def test_old_and_simple_packet_blocks():
    old = block(2, struct.pack("<HHIIII", 0, 0, 0, 5_000, 60, 60) + DATA[0])
    simple = block(3, struct.pack("<I", 61) + DATA[1])
    assert rows(section() + interface() + old + simple) == [
        (5_000_000, 0, DATA[0]),
        (0, 0, DATA[1]),
    ]


PCAPNG = section() + interface() + packet(1000, DATA[0]) + packet(2000, DATA[1])


PCAP_PARTS = [24, *(16 + len(d) for d in DATA)]
PCAPNG_PARTS = [len(p) for p in (section(), interface(), packet(1, DATA[0]), packet(2, DATA[1]))]


@pytest.mark.parametrize(
    ("whole", "parts"), [(pcap(), PCAP_PARTS), (PCAPNG, PCAPNG_PARTS)], ids=["pcap", "pcapng"]
)
def test_a_file_cut_anywhere_is_said_to_be(whole, parts):
    ends = set(itertools.accumulate(parts))
    for size in range(4, len(whole)):
        if size in ends:
            rows(whole[:size])
            continue
        with pytest.raises(InputError, match="damaged after packet"):
            rows(whole[:size])


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (
            pcap()[:24] + struct.pack("<IIII", 1, 1, 0xFFFFFFFF, 0xFFFFFFFF) + pcap()[24:],
            "not a packet",
        ),
        (pcap()[:24] + b"\xff" * 50 + pcap()[24:], "not a packet"),
        (section() + interface() + packet(1, DATA[0], 7), "interface 7, which was not announced"),
        (section() + interface() + packet((1 << 64) - 1, DATA[0]), "not after 1970"),
        (section() + interface(6, offset_s=-5) + packet(0, DATA[0]), "not after 1970"),
        (section() + struct.pack("<II", 6, 13) + bytes(20), "a block of 13 bytes"),
        (section() + interface()[:-4] + bytes(4), "two lengths differ"),
        (section() + interface() + block(6, bytes(16)), "a packet block is too short"),
        (section() + interface() + block(2, bytes(16)), "a packet block is too short"),
        (section() + interface() + block(3, b""), "a packet block is too short"),
        (section() + block(1, bytes(4)), "an interface block is too short"),
        (
            section() + interface() + block(6, struct.pack("<IIIII", 0, 0, 1, 99, 99) + DATA[0]),
            "a packet longer than its block",
        ),
        (gzip.compress(pcap(), mtime=0)[:-20], "damaged after packet"),
    ],
)
def test_damage_has_a_reason(data, reason):
    with pytest.raises(InputError, match=reason):
        rows(data)


def large(data_of, count=500):
    """A packed capture of 32 MB: count packets of 64 KB."""
    head = struct.pack("<IIII", T_S, 0, 64000, 64000)
    return gzip.compress(pcap(times=[]) + b"".join(head + data_of(n) for n in range(count)))


def test_a_small_packed_file_is_not_a_large_capture():
    bomb = large(lambda n: bytes(64000))
    assert len(bomb) < 40_000
    reader = CaptureReader("x", io.BytesIO(bomb))
    with pytest.raises(InputError) as told:
        list(reader)
    assert str(told.value) == (
        f"x: damaged after packet {reader.packets} (it unpacks to more than 100 times its size, as "
        "no capture of a bus does); everything before it was read"
    )
    assert 15_000_000 < 64000 * reader.packets < 17_000_000
    cycles = large(lambda n: random.Random(n).randbytes(4000).ljust(64000, b"\0"))
    assert len(rows(cycles)) == 500


def test_written_files_are_read(tmp_path):
    path = tmp_path / "x.pcapng"
    with CaptureWriter(path) as writer:
        for time_ns, data in zip(TIMES_NS, DATA, strict=True):
            writer.packet(time_ns + 333, data)
    assert list(read_capture(path)) == [(t + 333, d) for t, d in zip(TIMES_NS, DATA, strict=True)]


@given(st.data())
def test_damaged_capture_is_read_or_rejected_with_its_name(data):
    whole = bytearray(data.draw(st.sampled_from([pcap(), PCAPNG, pcap(">", 1)])))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(whole) - 1))
        whole[at] = data.draw(st.integers(0, 255))
    try:
        for time_ns, _, _ in CaptureReader("x", io.BytesIO(bytes(whole))):
            assert 0 <= time_ns < 1 << 63
    except InputError as exc:
        assert str(exc).startswith("x: ")  # noqa: PT017 - either is right
