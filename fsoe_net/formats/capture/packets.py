"""Reads capture files, pcap and pcapng, packet by packet, whatever their size.

Available libraries use the clock of one interface for all, round times to floats, or end silently
at damage in a file. A tool that looks for lost frames cannot accept any of that. Formats:
draft-ietf-opsawg-pcap and draft-ietf-opsawg-pcapng.
"""

from __future__ import annotations

import gzip
import io
import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO, cast

from fsoe_net.dataclass import dataclass
from fsoe_net.errors import InputError

_PCAP = {
    b"\xd4\xc3\xb2\xa1": ("<", 1000),
    b"\xa1\xb2\xc3\xd4": (">", 1000),
    b"\x4d\x3c\xb2\xa1": ("<", 1),
    b"\xa1\xb2\x3c\x4d": (">", 1),
}
"""Byte order, and nanoseconds per unit of the fraction of a second."""
_PCAPNG = b"\x0a\x0d\x0d\x0a"
_GZIP = b"\x1f\x8b"
_GZIP_TELLS = 64
_ETHERNET = 1
_MOST_BYTES = 1 << 24  # of a packet or block; a larger number is damage, not a length
_LATEST_NS = 1 << 63
_MOST_UNPACKED = 100  # times the compressed size: cycles of a bus compress to a tenth
_ALWAYS_UNPACKED = 1 << 24  # bytes
_SECTION, _INTERFACE, _OLD_PACKET, _SIMPLE_PACKET, _PACKET = 0x0A0D0D0A, 1, 2, 3, 6
_TSRESOL, _TSOFFSET = 9, 14


def is_capture(head: bytes) -> bool:
    """Whether the first bytes of a file are those of a capture, compressed with gzip or not.

    A few bytes do not show the content of a compressed file; then the result is true.
    """
    if head[:2] == _GZIP and len(head) > _GZIP_TELLS:
        try:
            head = zlib.decompressobj(wbits=31).decompress(head, 4)
        except zlib.error:
            return False
    return head[:4] in _PCAP or head[:4] == _PCAPNG or head[:2] == _GZIP


class _DamageError(Exception):
    """The rest of the file cannot be read; the text gives the reason."""


@dataclass(slots=True)
class _Clock:
    """The clock of an interface."""

    link_type: int
    units_per_s: int = 1_000_000
    offset_s: int = 0

    def time_ns(self, units: int) -> int:
        return units * 1_000_000_000 // self.units_per_s + self.offset_s * 1_000_000_000


class CaptureReader:
    """Iterates over the Ethernet packets of a capture: time in ns since 1970, interface, bytes.

    Args:
        name: Name of the file, for messages.
        stream: Content of the file; need not be seekable.

    Attributes:
        packets: Ethernet packets so far.
        cut: Truncated packets among these.
        other_links: Packets of interfaces that are not Ethernet; they are omitted.

    Raises:
        InputError: The file is not a capture, not of Ethernet, or damaged; the message names the
            packet. Packets before the damage have been yielded.
    """

    def __init__(self, name: str, stream: BinaryIO) -> None:
        self.packets = self.cut = self.other_links = 0
        self._name = name
        self._stream = stream if isinstance(stream, io.BufferedReader) else buffered(stream)
        self._clocks: list[_Clock] = []

    def __iter__(self) -> Iterator[tuple[int, int, bytes]]:
        try:
            if self._stream.peek(2)[:2] == _GZIP:
                self._stream = buffered(_Unpacked(self._stream))
            head = self._stream.read(4)
            if head in _PCAP:
                yield from self._pcap(*_PCAP[head])
            elif head == _PCAPNG:
                yield from self._pcapng()
            else:
                from fsoe_net.formats.recognise import other_document  # imports all formats

                other = other_document(head + self._stream.peek(), "capture")
                what = "; ".join(other) if other else "neither a pcap nor a pcapng capture"
                raise InputError(f"{self._name}: {what}")
        except (_DamageError, gzip.BadGzipFile, zlib.error, EOFError) as exc:
            raise InputError(
                f"{self._name}: damaged after packet {self.packets} ({exc or 'cut short'}); "
                "everything before it was read"
            ) from exc

    def _exactly(self, size: int, what: str) -> bytes:
        data = self._stream.read(size)
        if len(data) != size:
            raise _DamageError(f"the file ends inside {what}")
        return data

    def _packet(
        self, time_ns: int, interface: int, data: bytes, original: int
    ) -> tuple[int, int, bytes]:
        if not 0 <= time_ns < _LATEST_NS:
            raise _DamageError("the time of the next one is not after 1970")
        self.packets += 1
        self.cut += len(data) < original
        return time_ns, interface, data

    # -- pcap -------------------------------------------------------------------------------

    def _pcap(self, order: str, unit_ns: int) -> Iterator[tuple[int, int, bytes]]:
        _, _, _, _, _, link = struct.unpack(order + "HHiIII", self._exactly(20, "its header"))
        link &= 0xFFFF  # the upper bits announce a checksum after each packet
        if link != _ETHERNET:
            raise InputError(_no_ethernet(self._name, {link}))
        record = struct.Struct(order + "IIII")
        read = self._stream.read
        while head := read(16):
            if len(head) != 16:
                raise _DamageError("the file ends inside the head of a packet")
            seconds, fraction, size, original = record.unpack(head)
            if size > _MOST_BYTES:  # real captures have fractions above one second
                raise _DamageError("what follows is not a packet")
            data = self._exactly(size, "a packet")
            time_ns = seconds * 1_000_000_000 + fraction * unit_ns
            yield self._packet(time_ns, 0, data, original)

    # -- pcapng -----------------------------------------------------------------------------

    def _pcapng(self) -> Iterator[tuple[int, int, bytes]]:
        order, body = self._section(self._exactly(8, "its header"))
        kind = _SECTION
        packet = struct.Struct(order + "IIIII")
        while True:
            if kind == _PACKET:
                if len(body) < 20:
                    raise _DamageError("a packet block is too short")
                number, high, low, size, original = packet.unpack_from(body)
                row = self._block(number, high << 32 | low, body, 20, size, original)
            elif kind in (_OLD_PACKET, _SIMPLE_PACKET):
                row = self._other_packet(order, kind, body)
            else:
                row = None
                if kind == _INTERFACE:
                    self._clocks.append(_clock(order, body))
            if row is not None:
                yield row
            head = self._stream.read(8)
            if not head:
                break
            if len(head) != 8:
                raise _DamageError("the file ends inside the head of a block")
            kind, length = struct.unpack(order + "II", head)
            if kind == _SECTION:
                order, body = self._section(head[4:] + self._exactly(4, "a section header"))
                packet = struct.Struct(order + "IIIII")
            else:
                body = self._body(order, length)
        if self._clocks and not self.packets and self.other_links:
            raise InputError(_no_ethernet(self._name, {c.link_type for c in self._clocks}))

    def _section(self, head: bytes) -> tuple[str, bytes]:
        """Begin a section: reset byte order and interfaces. ``head``: length and magic."""
        if head[4:] == b"\x4d\x3c\x2b\x1a":
            order = "<"
        elif head[4:] == b"\x1a\x2b\x3c\x4d":
            order = ">"
        else:
            raise _DamageError("a section without its magic number")
        (length,) = struct.unpack(order + "I", head[:4])
        # Interfaces are numbered from 0 in each section.
        self._clocks = []
        return order, self._body(order, length, already=4)

    def _body(self, order: str, length: int, already: int = 0) -> bytes:
        if length % 4 or not 12 + already <= length <= _MOST_BYTES:
            raise _DamageError(f"a block of {length} bytes")
        data = self._exactly(length - 8 - already, "a block")
        if data[-4:] != struct.pack(order + "I", length):
            raise _DamageError("a block whose two lengths differ")
        return data[:-4]

    def _block(
        self, number: int, units: int, body: bytes, at: int, size: int, original: int
    ) -> tuple[int, int, bytes] | None:
        if number >= len(self._clocks):
            raise _DamageError(f"a packet of interface {number}, which was not announced")
        if at + size > len(body):
            raise _DamageError("a packet longer than its block")
        clock = self._clocks[number]
        if clock.link_type != _ETHERNET:
            self.other_links += 1
            return None
        return self._packet(clock.time_ns(units), number, body[at : at + size], original)

    def _other_packet(self, order: str, kind: int, body: bytes) -> tuple[int, int, bytes] | None:
        if len(body) < (20 if kind == _OLD_PACKET else 4):
            raise _DamageError("a packet block is too short")
        if kind == _SIMPLE_PACKET:  # it has no time
            (original,) = struct.unpack_from(order + "I", body)
            # The body is padded to 4 bytes, and the number of captured bytes is not stated.
            return self._block(0, 0, body, 4, min(original, len(body) - 4), original)
        number, _, high, low, size, original = struct.unpack_from(order + "HHIIII", body)
        return self._block(number, high << 32 | low, body, 20, size, original)


class _Counted(io.RawIOBase):
    """A stream that counts the bytes read from it."""

    def __init__(self, stream: BinaryIO | gzip.GzipFile) -> None:
        self._stream = stream
        self.taken = 0

    def readable(self) -> bool:
        return True

    def readinto(self, room: memoryview) -> int:  # type: ignore[override]
        data = self._stream.read(len(room))
        room[: len(data)] = data
        self.taken += len(data)
        return len(data)


class _Unpacked(_Counted):
    """Content of a gzip stream; a few bytes that expand to hours of packets are rejected."""

    def __init__(self, stream: BinaryIO) -> None:
        self._packed = _Counted(stream)
        super().__init__(gzip.GzipFile(fileobj=cast(BinaryIO, self._packed)))

    def readinto(self, room: memoryview) -> int:  # type: ignore[override]
        size = super().readinto(room)
        if self.taken > max(_ALWAYS_UNPACKED, _MOST_UNPACKED * self._packed.taken):
            raise _DamageError(
                f"it unpacks to more than {_MOST_UNPACKED} times its size, as no capture of a bus "
                "does"
            )
        return size


def buffered(stream: BinaryIO | io.RawIOBase) -> io.BufferedReader:
    """Return a stream that can be peeked at without consuming bytes."""
    return io.BufferedReader(cast(io.RawIOBase, stream), 1 << 16)


def _clock(order: str, body: bytes) -> _Clock:
    """Read an interface description: link type, then options."""
    if len(body) < 8:
        raise _DamageError("an interface block is too short")
    clock = _Clock(struct.unpack_from(order + "H", body)[0])
    at = 8
    while at + 4 <= len(body):
        code, size = struct.unpack_from(order + "HH", body, at)
        value = body[at + 4 : at + 4 + size]
        if code == 0 or len(value) != size:
            break
        if code == _TSRESOL and size == 1:
            power = value[0] & 0x7F
            # Bit 7: a power of two instead of ten.
            clock.units_per_s = 2**power if value[0] & 0x80 else 10**power
        elif code == _TSOFFSET and size == 8:
            (clock.offset_s,) = struct.unpack(order + "q", value)
        at += 4 + (size + 3) // 4 * 4
    return clock


def _no_ethernet(name: str, links: set[int]) -> str:
    return (
        f"{name}: captured with link type {', '.join(map(str, sorted(links)))}, not Ethernet (1); "
        "capture on the Ethernet interface itself, not on `any`"
    )
