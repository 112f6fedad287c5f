"""Finds FSoE connections in captured EtherCAT frames, using the C core."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from fsoe_net.core.module import compiled, raise_status
from fsoe_net.core.monitor import direction_snapshot
from fsoe_net.core.snapshot import DirectionSnapshot
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict

_COMMANDS = {
    1: "APRD",
    2: "APWR",
    3: "APRW",
    4: "FPRD",
    5: "FPWR",
    6: "FPRW",
    10: "LRD",
    11: "LWR",
    12: "LRW",
}
_VERDICTS = tuple(CrcVerdict)
_STATES = tuple(ConnectionState)


class Sighting(NamedTuple):
    """One new frame of a connection.

    ``direction`` 0 is main to sub, 1 sub to main. ``sequence`` is the number of the frame in its
    chain, 0 if unknown. ``packet`` counts the packets of the capture from 1.
    """

    time_ns: int
    packet: int
    connection: int
    direction: int
    verdict: CrcVerdict
    state: ConnectionState
    sequence: int
    frame: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundPlace:
    """Where frames of one direction were found.

    Attributes:
        command: EtherCAT command of the datagram, e.g. ``LRW``.
        address: Logical address of the first byte; for a physical command, the station address in
            the lower and the offset in the upper 16 bits.
        direction: 0 main to sub, 1 sub to main.
        size_bytes: Length of the frame.
    """

    command: str
    address: int
    direction: int
    size_bytes: int

    @property
    def is_logical(self) -> bool:
        """Whether the address is logical."""
        return self.command.startswith("L")


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundConnection:
    """A connection that was found; ``roles_certain`` if its start-up was captured."""

    connection_id: int
    places: tuple[FoundPlace, ...]
    roles_certain: bool
    state: ConnectionState
    gaps: int
    to_sub: DirectionSnapshot
    to_main: DirectionSnapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanCounts:
    """Counters of everything found besides FSoE; see ``struct fsn_scan_counts``."""

    packets: int
    ethercat: int
    malformed: int
    datagrams: int
    unanswered: int
    dropped: int


class Scanner:
    """Reads captured Ethernet frames and returns the new FSoE frames in them.

    Raises:
        CoreMissing: The compiled part is missing.
    """

    def __init__(self) -> None:
        self._ffi, self._lib = compiled()
        slot = self._ffi.new("struct fsn_scan **")
        raise_status(self._lib.fsn_scan_create(slot), "scanner")
        self._scan = self._ffi.gc(slot[0], self._lib.fsn_scan_free)
        self._sighting = self._ffi.new("struct fsn_sighting *")
        self._frame = self._ffi.buffer(self._sighting.frame)
        self._packet = self._lib.fsn_scan_packet  # looked up once: called for every packet

    def packet(self, data: bytes, time_ns: int, bus: int = 0) -> list[Sighting]:
        """Process one captured Ethernet frame.

        Args:
            data: The bytes from the destination address on.
            time_ns: When it was captured, never decreasing.
            bus: Number of the bus or interface, if the capture contains several.

        Returns:
            The new FSoE frames, oldest first; those of a connection that was just found include
            its frames in earlier packets.
        """
        if not self._packet(self._scan, bus, data, len(data), time_ns):
            return []
        s, found = self._sighting, []
        while self._lib.fsn_scan_next(self._scan, s):
            found.append(
                Sighting(
                    s.time_ns,
                    s.packet,
                    s.connection,
                    s.way,
                    _VERDICTS[s.verdict],
                    _STATES[s.observed],
                    s.sequence,
                    self._frame[: s.size_bytes],
                )
            )
        return found

    def connections(self) -> list[FoundConnection]:
        """Return the connections found so far."""
        c = self._ffi.new("struct fsn_scan_connection *")
        found = []
        for number in range(self._lib.fsn_scan_connection_count(self._scan)):
            raise_status(self._lib.fsn_scan_connection(self._scan, number, c), "connection")
            found.append(
                FoundConnection(
                    connection_id=c.connection_id,
                    places=tuple(_place(c.places[n]) for n in range(c.place_count)),
                    roles_certain=bool(c.roles),
                    state=_STATES[c.status.observed],
                    gaps=c.status.gaps,
                    to_sub=direction_snapshot(c.status.direction[0]),
                    to_main=direction_snapshot(c.status.direction[1]),
                )
            )
        return found

    def counts(self) -> ScanCounts:
        """Return the current counters."""
        c = self._ffi.new("struct fsn_scan_counts *")
        self._lib.fsn_scan_counts(self._scan, c)
        return ScanCounts(**{f.name: getattr(c, f.name) for f in fields(ScanCounts)})


def _place(p: Any) -> FoundPlace:
    return FoundPlace(
        command=_COMMANDS[p.command], address=p.address, direction=p.way, size_bytes=p.size_bytes
    )
