"""Capture files: what is damaged in them is said, with everything before it read."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from fsoe_net.errors import InputError
from fsoe_net.observe import read_capture


def _block(kind: int, body: bytes) -> bytes:
    length = struct.pack("<I", 12 + len(body))
    return struct.pack("<I", kind) + length + body + length


def _pcapng(path: Path, times_us: list[int], options: bytes = b"") -> Path:
    section = _block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    interface = _block(1, struct.pack("<HHI", 1, 0, 65535) + options)
    packets = (
        _block(6, struct.pack("<IIIII", 0, t >> 32, t & 0xFFFFFFFF, 4, 4) + b"data")
        for t in times_us
    )
    path.write_bytes(section + interface + b"".join(packets))
    return path


BEFORE_1970 = struct.pack("<HHqHH", 14, 8, -5, 0, 0)  # option if_tsoffset


@pytest.mark.parametrize(
    ("times_us", "options", "good"),
    [([1, 1 << 63], b"", 1), ([(1 << 64) - 1], b"", 0), ([9_000_000, 0], BEFORE_1970, 1)],
)
def test_a_time_that_is_none_ends_the_capture(times_us, options, good, tmp_path):
    path = _pcapng(tmp_path / "x.pcapng", times_us, options)
    packets = read_capture(path)
    assert [next(packets)[1] for _ in range(good)] == [b"data"] * good
    with pytest.raises(InputError, match=rf"x.pcapng: damaged after packet {good} \(the time"):
        next(packets)


def test_a_length_beyond_the_memory(tmp_path, monkeypatch):
    path = _pcapng(tmp_path / "x.pcapng", [1])

    def out_of_memory(_):
        raise MemoryError
        yield

    monkeypatch.setattr("dpkt.pcapng.Reader.__iter__", out_of_memory)
    with pytest.raises(InputError, match=r"damaged after packet 0 .a length beyond the memory"):
        list(read_capture(path))
