"""Writes capture files (pcapng); `fsoe_net.formats.capture.packets` reads them.

Format: draft-ietf-opsawg-pcapng.
"""

from __future__ import annotations

import struct
from pathlib import Path

_ETHERNET = 1
_SECTION, _INTERFACE, _PACKET = 0x0A0D0D0A, 1, 6
_TSRESOL = 9
_COMMENT, _NAME, _FLAGS = 1, 2, 2  # codes of options: of any block, an interface, a packet


class CaptureWriter:
    """Writes a pcapng file of Ethernet packets with times in nanoseconds; a context manager.

    Args:
        path: The file.
        comment: Comment for readers, in addition to file and interface; Wireshark shows it.
        interface: Name of the interface.

    Raises:
        OSError: The file cannot be written.
    """

    def __init__(self, path: str | Path, *, comment: str = "", interface: str = "") -> None:
        self._file = open(path, "wb")  # noqa: SIM115 - closed by close()
        said = _option(_COMMENT, comment.encode()) if comment else b""
        name = _option(_NAME, interface.encode()) if interface else b""
        end = struct.pack("<HH", 0, 0)
        section = struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)
        self._block(_SECTION, section + (said + end if said else b""))
        resolution = _option(_TSRESOL, b"\x09")
        head = struct.pack("<HHI", _ETHERNET, 0, 0)
        self._block(_INTERFACE, head + said + name + resolution + end)

    def _block(self, kind: int, body: bytes) -> None:
        body = body.ljust((len(body) + 3) // 4 * 4, b"\0")
        length = struct.pack("<I", 12 + len(body))
        self._file.write(struct.pack("<I", kind) + length + body + length)

    def packet(self, time_ns: int, data: bytes, *, outbound: bool | None = None) -> None:
        """Append a packet, from the destination MAC on; ``outbound``: sent by this host."""
        size = len(data)
        head = struct.pack("<IIIII", 0, time_ns >> 32, time_ns & 0xFFFFFFFF, size, size)
        body = head + data
        if outbound is not None:
            body = body.ljust((len(body) + 3) // 4 * 4, b"\0")
            body += _option(_FLAGS, struct.pack("<I", 2 if outbound else 1))
            body += struct.pack("<HH", 0, 0)
        self._block(_PACKET, body)

    def close(self) -> None:
        """Finish the file; may be called twice."""
        self._file.close()

    def __enter__(self) -> CaptureWriter:
        """Return the writer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _option(code: int, value: bytes) -> bytes:
    return struct.pack("<HH", code, len(value)) + value.ljust((len(value) + 3) // 4 * 4, b"\0")
