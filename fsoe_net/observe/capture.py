"""Capture files: pcap and pcapng in, pcapng out. Read packet by packet, whatever their size."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import dpkt

from fsoe_net.errors import InputError

__all__ = ["CaptureWriter", "is_capture", "read_capture"]

_PCAP = {b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d"}
_PCAPNG = b"\x0a\x0d\x0d\x0a"
_ETHERNET = 1
_TIMES_NS = range(1 << 63)  # a later year than 2262 is no clock
_DAMAGED = (dpkt.Error, ValueError, struct.error, MemoryError)


def is_capture(head: bytes) -> bool:
    """Whether these first bytes of a file are those of a pcap or pcapng capture."""
    return head[:4] in _PCAP or head[:4] == _PCAPNG


def read_capture(path: str | Path) -> Iterator[tuple[int, bytes]]:
    """Yield the packets of a capture: time in nanoseconds since 1970, bytes from the MAC on.

    Raises:
        InputError: No capture, not of Ethernet, or damaged; the message names the packet. What was
            read before has been yielded.
        OSError: The file cannot be read.
    """
    with open(path, "rb") as file:
        reader = _reader(str(path), file)
        if reader.datalink() != _ETHERNET:
            raise InputError(
                f"{path}: captured with link type {reader.datalink()}, not Ethernet (1); "
                "capture on the Ethernet interface itself, not on `any`"
            )
        number = 0
        try:
            for seconds, data in reader:
                time_ns = int(seconds * 1_000_000_000)
                if time_ns not in _TIMES_NS:
                    raise ValueError("the time of the next one is none after 1970")
                number += 1
                yield time_ns, data
        except (*_DAMAGED, OverflowError) as exc:
            raise InputError(
                f"{path}: damaged after packet {number} ({_reason(exc)}); "
                "everything before it was read"
            ) from exc


def _reason(exc: BaseException) -> str:
    # dpkt reads as many bytes at once as the file claims a packet has.
    return "a length beyond the memory" if isinstance(exc, MemoryError) else str(exc)


def _reader(path: str, file: BinaryIO) -> Any:
    head = file.read(4)
    file.seek(0)
    if not is_capture(head):
        raise InputError(f"{path}: neither a pcap nor a pcapng capture")
    try:
        return dpkt.pcapng.Reader(file) if head == _PCAPNG else dpkt.pcap.Reader(file)
    except _DAMAGED as exc:
        raise InputError(f"{path}: the header of the capture is damaged ({_reason(exc)})") from exc


class CaptureWriter:
    """Writes a pcapng file of Ethernet packets; a context manager.

    Raises:
        OSError: The file cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self._file = open(path, "wb")  # noqa: SIM115 - closed by close()
        self._writer = dpkt.pcapng.Writer(self._file, snaplen=65535, linktype=_ETHERNET)

    def packet(self, time_ns: int, data: bytes) -> None:
        """Append one packet, bytes from the destination MAC on."""
        self._writer.writepkt_time(data, time_ns / 1e9)

    def close(self) -> None:
        """Finish the file; may be called twice."""
        self._file.close()

    def __enter__(self) -> CaptureWriter:
        """Return the writer itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
