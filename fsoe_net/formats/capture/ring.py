"""All SubDevices of a capture: the SubDevice that an address refers to, and the requests to it.

A datagram is used when it returns, which its working counter shows: on the way out it is 0. Every
SubDevice increments an auto-increment address, so a returning address is the number of SubDevices
minus the position. A broadcast is sent with 0 and returns with the number of SubDevices.
"""

from __future__ import annotations

from fsoe_net.formats.capture.datagrams import Datagram, DatagramCommand
from fsoe_net.formats.capture.sii import SII_REGISTERS
from fsoe_net.formats.capture.station import FMMUS, MANAGERS, Station

_STATION_ADDRESS, _AL_CONTROL = 0x0010, 0x0120
_SII_CONTROL = 0x0502
_MOST_STATIONS = 8192
_POSITIONAL = (
    DatagramCommand.APRD,
    DatagramCommand.APWR,
    DatagramCommand.APRW,
    DatagramCommand.ARMW,
)
_BROADCAST = (DatagramCommand.BRD, DatagramCommand.BWR, DatagramCommand.BRW)
_READS = (DatagramCommand.APRD, DatagramCommand.FPRD)
_WRITES = (DatagramCommand.APWR, DatagramCommand.FPWR)
_KNOWN = frozenset({*_POSITIONAL, *_BROADCAST, *_READS, *_WRITES})


class Ring:
    """Processes the datagrams to registers and mailboxes.

    Attributes:
        count: SubDevices in the ring according to the last broadcast; ``None`` before the first
            one.
        restarted: Last packet where the number of SubDevices had changed and addresses were
            assigned again.
        full: Whether there are more SubDevices than can be kept.
        changed: Whether anything that affects layouts has changed since this was last cleared.
    """

    def __init__(self) -> None:
        self.count: int | None = None
        self.restarted: int | None = None
        self.full = False
        self.changed = False
        self._born = 0
        self._by_position: dict[int, Station] = {}
        self._by_address: dict[int, Station] = {}
        self._assigned_with: int | None = None
        self._sent: dict[int, tuple[int, int, int]] = {}
        self._for_all: dict[int, bytes] = {}

    @property
    def stations(self) -> list[Station]:
        """All of them, in ring order; then those with unknown position, by address."""
        placed = [self._by_position[n] for n in sorted(self._by_position)]
        return placed + [self._by_address[n] for n in sorted(self._by_address) if self._free(n)]

    def _free(self, address: int) -> bool:
        return self._by_address[address].position is None

    def take(self, datagram: Datagram, packet: int) -> None:
        """Process one datagram that is not logical."""
        command = datagram.command
        if command not in _KNOWN:
            return
        if not datagram.counter:
            self._went_out(datagram)
            return
        if command in _BROADCAST:
            self._broadcast(datagram, packet)
            return
        station = self._station(datagram, packet)
        if station is None:
            return
        if command in _WRITES:
            station.wrote(datagram.register, datagram.data, packet)
            if command == DatagramCommand.APWR and datagram.register == _STATION_ADDRESS:
                self._assign(station, datagram.data, packet)
        elif command in _READS:
            station.read(datagram.register, datagram.data, packet)
            if command == DatagramCommand.APRD and datagram.register == _STATION_ADDRESS:
                self._assign(station, datagram.data, packet)
        self.changed |= station.changed

    def _went_out(self, datagram: Datagram) -> None:
        """Remember a datagram without an answer so far."""
        if datagram.command in _POSITIONAL:
            key = (datagram.command, datagram.address, datagram.register)
            self._sent[datagram.number] = key
        end = datagram.register + len(datagram.data)
        if datagram.register >= SII_REGISTERS.stop or end <= SII_REGISTERS.start:
            return
        if datagram.command == DatagramCommand.FPWR and datagram.address in self._by_address:
            self._by_address[datagram.address].sii.lost()
        elif datagram.command in (DatagramCommand.APWR, DatagramCommand.BWR):
            for station in self.stations:
                station.sii.lost()

    def _broadcast(self, datagram: Datagram, packet: int) -> None:
        self.count = datagram.address or None
        register, data = datagram.register, datagram.data
        if datagram.command == DatagramCommand.BWR:
            # Kept for SubDevices that appear later: the broadcast has also set their registers.
            kept = register in FMMUS or register in MANAGERS or register == _AL_CONTROL
            if kept and len(self._for_all) < len(FMMUS):
                self._for_all[register] = data
            for station in self.stations:
                station.wrote(register, data, packet)
            self.changed = True
        elif (
            datagram.command == DatagramCommand.BRD and register == _SII_CONTROL and len(data) >= 2
        ):
            for station in self.stations:
                station.sii.status(data[0] | data[1] << 8)

    def _position(self, datagram: Datagram) -> int | None:
        sent = self._sent.get(datagram.number)
        if sent is not None and (sent[0], sent[2]) == (datagram.command, datagram.register):
            position = -sent[1] & 0xFFFF
            fits = self.count is None or (position + datagram.address) & 0xFFFF == self.count
            if fits and position <= 0x7FFF:
                return position
        # The packet that was sent is missing from the capture: the ring size gives the position.
        if self.count is None:
            return None
        position = (self.count - datagram.address) & 0xFFFF
        return position if position < self.count else None

    def _station(self, datagram: Datagram, packet: int) -> Station | None:
        if datagram.command in _POSITIONAL:
            place = self._position(datagram)
            return None if place is None else self._at(self._by_position, place, packet, place)
        return self._at(self._by_address, datagram.address, packet, None)

    def _at(
        self, known: dict[int, Station], key: int, packet: int, position: int | None
    ) -> Station | None:
        if key in known:
            return known[key]
        if len(self._by_position) + len(self._by_address) >= _MOST_STATIONS:
            self.full = True
            return None
        station = self._new(packet, position)
        if position is None:
            station.address = key
        for register, data in self._for_all.items():
            station.wrote(register, data, packet)
        known[key] = station
        return station

    def _new(self, packet: int, position: int | None) -> Station:
        self._born += 1
        return Station(number=self._born, packet=packet, position=position)

    def _assign(self, station: Station, data: bytes, packet: int) -> None:
        """Process a station address that is written or read back."""
        address = int.from_bytes(data[:2], "little")
        if len(data) < 2 or not address:
            return
        # Different addresses for a different number of SubDevices mean that the bus has restarted.
        if self._assigned_with not in (None, self.count) and station.address != address:
            self.restarted = packet
            place = station.position
            self._by_position, self._by_address = {}, {}
            station = self._new(packet, place)
            if place is not None:
                self._by_position[place] = station
        self._assigned_with = self.count
        for known, other in list(self._by_address.items()):
            if other is station or known == address:
                del self._by_address[known]
                other.address = None
        station.address = address
        self._by_address[address] = station
