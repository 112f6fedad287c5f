"""FSoE frames in captured EtherCAT traffic, with their names in a network."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from fsoe_net.capture.names import ConnectionNames, Naming
from fsoe_net.capture.wire import LogicalImage
from fsoe_net.core.scan import FoundConnection, ScanCounts, Scanner, Sighting
from fsoe_net.formats.capture.packets import CaptureReader
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict, FrameDirection
from fsoe_net.fsoe.pdu import Command
from fsoe_net.model.resolve import Resolution
from fsoe_net.plan.compile import compile_plan

_DIRECTIONS = tuple(FrameDirection)

Found = tuple[FoundConnection, ConnectionNames | None, bool]


class DecodedFrame(NamedTuple):
    """One FSoE frame; ``packet`` 0 and ``time_ms`` ``None``: from hex, not captured.

    Attributes:
        packet: Number of the packet, from 1.
        time_ms: Time since the first packet of the capture.
        names: Its connection in the network, if known.
        number: Number of the connection in this capture, from 0.
        direction: Direction, given by the end that sent it.
        frame: Its bytes.
        verdict: Result of the CRC check.
        state: State of the connection, according to these frames.
        sequence: Its number in the chain of CRCs.
        note: Further remarks.
    """

    packet: int
    time_ms: float | None
    names: ConnectionNames | None
    number: int
    direction: FrameDirection
    frame: bytes
    verdict: CrcVerdict
    state: ConnectionState
    sequence: int
    note: str

    @property
    def connection(self) -> str:
        """Its name in the network, or its number in this capture."""
        return f"connection {self.number}" if self.names is None else self.names.name


class CaptureFacts(NamedTuple):
    """Facts about a capture.

    Attributes:
        start_ns: Time of its first packet; -1 if it is empty.
        cut: Truncated packets.
        other_links: Packets of interfaces that are not Ethernet.
    """

    start_ns: int
    cut: int
    other_links: int


def naming_of(resolution: Resolution | None) -> Naming:
    """Return the names of a network for captured items; empty without a network."""
    if resolution is None:
        return Naming(None)
    return Naming(resolution, LogicalImage(compile_plan(resolution)))


class CaptureDecoder:
    """Reads a capture once; its connections and counters are complete at the end.

    Args:
        name: Name of the capture, for messages.
        stream: Bytes of the capture.
        naming: See `naming_of`.

    Raises:
        CoreMissing: The compiled part is missing.
    """

    def __init__(self, name: str, stream: BinaryIO, naming: Naming) -> None:
        self._reader, self._scanner = CaptureReader(name, stream), Scanner()
        self._naming = naming
        self._known: dict[int, tuple[ConnectionNames | None, bool]] = {}
        self._start_ns = -1

    def sightings(self) -> Iterator[Sighting]:
        """Yield every new FSoE frame, as the core found it.

        Raises:
            InputError: The capture cannot be read to its end.
        """
        now_ns = -1
        for time_ns, bus, packet in self._reader:
            if self._start_ns < 0:
                self._start_ns = time_ns
            now_ns = max(now_ns, time_ns)  # times of several interfaces may go backwards
            yield from self._scanner.packet(packet, now_ns, bus)

    def frame_of(self, s: Sighting) -> DecodedFrame:
        """Return a frame with its names."""
        # A start-up shows the roles with certainty, so the guess is discarded.
        if s.connection not in self._known or s.frame[0] == Command.SESSION:
            found = self._scanner.connections()[s.connection]
            self._known[s.connection] = self._naming.find_in(found)
        names, swapped = self._known[s.connection]
        return DecodedFrame(
            s.packet,
            (s.time_ns - self._start_ns) / 1e6,
            names,
            s.connection,
            _DIRECTIONS[s.direction ^ swapped],
            s.frame,
            s.verdict,
            s.state,
            s.sequence,
            "",
        )

    def connections(self) -> list[Found]:
        """Return the connections found so far, with names and whether the roles are swapped."""
        return [(c, *self._naming.find_in(c)) for c in self._scanner.connections()]

    def counts(self) -> ScanCounts:
        """Return the counters so far."""
        return self._scanner.counts()

    @property
    def facts(self) -> CaptureFacts:
        """Facts about the capture itself."""
        return CaptureFacts(self._start_ns, self._reader.cut, self._reader.other_links)
