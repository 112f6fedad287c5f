"""Receives EtherCAT frames on a network interface, with kernel timestamps."""

from __future__ import annotations

import contextlib
import ctypes
import socket
import struct
from dataclasses import dataclass

_ALL, _ETHERCAT = 0x0003, 0x88A4
# From the Linux headers: Python's module `socket` does not have these.
_SO_ATTACH_FILTER, _SO_TIMESTAMPNS = 26, 35
_SOL_PACKET, _ADD_MEMBERSHIP, _STATISTICS, _PROMISCUOUS = 263, 1, 6, 1
_OUTGOING = 4
_BUFFER_BYTES = 8 << 20
_MOST_BYTES = 1600
_TIME = struct.Struct("@ll")
# Load the EtherType, compare, accept the whole frame or drop it.
_PROGRAM = (
    (0x28, 0, 0, 12),
    (0x15, 0, 1, _ETHERCAT),
    (0x06, 0, 0, 0xFFFF),
    (0x06, 0, 0, 0),
)


@dataclass(frozen=True, slots=True)
class Packet:
    """A frame from the destination MAC on; ``time_ns`` since 1970; its sender."""

    time_ns: int
    data: bytes
    outbound: bool


class PacketSocket:
    """Socket that receives the EtherCAT frames of an interface; a context manager. Sends nothing.

    Outgoing frames are not seen if their sender bypasses the queue of the interface, as the cycle
    of ``fsn-master`` does.

    Args:
        interface: Name of the interface.

    Raises:
        OSError: The socket cannot be opened, or the interface does not exist.
    """

    def __init__(self, interface: str) -> None:
        self._dropped = 0
        # Protocol 0 receives nothing until `bind`, so the filter is set first (packet(7)).
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        try:
            self._prepare(interface)
        except OSError:
            self._socket.close()
            raise

    def _prepare(self, interface: str) -> None:
        rows = b"".join(struct.pack("=HBBI", *row) for row in _PROGRAM)
        program = ctypes.create_string_buffer(rows, len(rows))
        form = struct.pack("@HP", len(_PROGRAM), ctypes.addressof(program))
        s = self._socket
        s.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, form)
        s.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        number = socket.if_nametoindex(interface)
        with contextlib.suppress(OSError):  # returned frames have another MAC
            wanted = struct.pack("@iHH8x", number, _PROMISCUOUS, 0)
            s.setsockopt(_SOL_PACKET, _ADD_MEMBERSHIP, wanted)
        s.bind((interface, _ALL))

    def packets(self, wait_s: float) -> list[Packet]:
        """Return the frames received, after waiting at most this time for the first one.

        Raises:
            OSError: The interface went down or was removed.
        """
        found: list[Packet] = []
        self._socket.settimeout(wait_s)
        while len(found) < 1000:
            try:
                got = self._socket.recvmsg(_MOST_BYTES, 64)
            except (TimeoutError, BlockingIOError):
                break
            data, extra, _, sender = got
            self._socket.settimeout(0)
            found.append(Packet(_time_ns(extra), data, sender[2] == _OUTGOING))
        return found

    @property
    def dropped(self) -> int:
        """Number of frames lost so far because they arrived too fast."""
        row = self._socket.getsockopt(_SOL_PACKET, _STATISTICS, 8)
        self._dropped += struct.unpack("@II", row)[1]  # reading resets the counter
        return self._dropped

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def _time_ns(extra: list[tuple[int, int, bytes]]) -> int:
    for level, kind, data in extra:
        if level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS and len(data) >= _TIME.size:
            seconds, rest = _TIME.unpack_from(data)
            return int(seconds) * 1_000_000_000 + int(rest)
    return 0
