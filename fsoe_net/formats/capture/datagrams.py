"""EtherCAT datagrams in captured Ethernet packets.

+-----------+------------------+------------------------------------------+-----+---------+
| Ethernet, | length, type 1   | command, index, address, length + flags, | ... | padding |
| VLAN tags | (16 bits)        | interrupt, data, working counter         |     |         |
+-----------+------------------+------------------------------------------+-----+---------+
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Sequence
from typing import NamedTuple

_ETHERCAT, _IPV4, _VLANS, _UDP_PORT = 0x88A4, 0x0800, (0x8100, 0x88A8, 0x9100), 0x88A4
_MOST_TAGS = 4
LOGICAL = (10, 11, 12)
"""Commands of the logical address space: LRD, LWR, LRW."""
_HEAD = struct.Struct("<BBHHHH")
_COMMANDS_TYPE = 1
_LENGTH, _MORE = 0x07FF, 0x8000


class DatagramCommand(enum.IntEnum):
    """Addressing of a datagram: a SubDevice by ring position or station address, all, logical."""

    APRD, APWR, APRW = 1, 2, 3
    FPRD, FPWR, FPRW = 4, 5, 6
    BRD, BWR, BRW = 7, 8, 9
    LRD, LWR, LRW = 10, 11, 12
    ARMW, FRMW = 13, 14


class Datagram(NamedTuple):
    """Datagram; ``address`` is that of a SubDevice, ``register`` a location in its memory."""

    command: int
    number: int
    address: int
    register: int
    data: bytes
    counter: int

    @property
    def logical(self) -> int:
        """The logical address of LRD, LWR and LRW."""
        return self.register << 16 | self.address


def joined(rows: Sequence[Datagram]) -> list[Datagram]:
    """Return the logical datagrams of a packet, with consecutive ones joined.

    A MainDevice may split its image into datagrams anywhere, even within an FSoE frame. A datagram
    with an answer is not joined to one without.
    """
    found: list[Datagram] = []
    for row in rows:
        if row.command not in LOGICAL:
            continue
        last = found[-1] if found else None
        if (
            last is not None
            and (last.command, bool(last.counter)) == (row.command, bool(row.counter))
            and last.logical + len(last.data) == row.logical
        ):
            found[-1] = last._replace(data=last.data + row.data)
        else:
            found.append(row)
    return found


def datagrams(packet: bytes) -> tuple[list[Datagram], bool] | None:
    """Return the datagrams of a packet, and whether something is missing at its end.

    Args:
        packet: The packet, from the destination MAC on.

    Returns:
        The datagrams and whether the end is truncated, or ``None`` if the packet is not EtherCAT.
    """
    start = _begin(packet)
    if start is None:
        return None
    if start + 2 > len(packet):
        return [], True
    # EtherCAT header: length in bits 0 … 10, type in bits 12 … 15.
    head = packet[start] | packet[start + 1] << 8
    if head >> 12 != _COMMANDS_TYPE:
        return None
    at, size = start + 2, len(packet)
    found: list[Datagram] = []
    while True:
        if at + 12 > size:
            return found, True
        command, number, address, register, length, _ = _HEAD.unpack_from(packet, at)
        end = at + 12 + (length & _LENGTH)
        if end > size:
            return found, True
        counter = packet[end - 2] | packet[end - 1] << 8
        data = packet[at + 10 : end - 2]
        found.append(Datagram(command, number, address, register, data, counter))
        if not length & _MORE:
            return found, False
        at = end


def _begin(packet: bytes) -> int | None:
    """Return where the EtherCAT header begins."""
    at = 12
    for _ in range(_MOST_TAGS + 1):
        kind = int.from_bytes(packet[at : at + 2], "big")
        if kind == _ETHERCAT:
            return at + 2
        if kind not in _VLANS:
            return _begin_udp(packet, at + 2) if kind == _IPV4 else None
        at += 4
    return None


def _begin_udp(packet: bytes, at: int) -> int | None:
    head = packet[at : at + 20]
    if len(head) < 20 or head[0] >> 4 != 4 or head[9] != 17 or (head[6] & 0x1F or head[7]):
        return None
    udp = at + 4 * (head[0] & 0x0F)
    port = int.from_bytes(packet[udp + 2 : udp + 4], "big")
    return udp + 8 if port == _UDP_PORT else None
