"""Cyclic process data of a capture: the windows in it, and the FSoE frames that are copied.

A copy is accepted if three conditions hold: the process data of both ends have the structure of an
FSoE frame; every new frame at the destination was at exactly one source a few cycles before; and
both directions form a conversation with a valid chain of CRCs (`core.monitor`). This needs memory
for a few frames per place, regardless of the length of the capture.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from fsoe_net.core.monitor import Monitor
from fsoe_net.formats.capture.datagrams import Datagram, DatagramCommand
from fsoe_net.fsoe.pdu import Command, safe_data_length

ENOUGH_FRAMES = 20
_LIKELY_FRAMES = 4  # number of frames from which the CRCs are checked
_REMEMBERED = 6  # frames by which a copy may lag its source, plus a lost packet
_MOST_WINDOWS = 4096
_MOST_MONITORS = 256
_SHARE = 0.9  # of the new frames at the destination must come from the source
_INPUTS, _OUTPUTS = (
    (DatagramCommand.LRD, DatagramCommand.LRW),
    (DatagramCommand.LWR, DatagramCommand.LRW),
)
_COMMANDS = frozenset(int(c) for c in Command)


class FramePlace(NamedTuple):
    """A place with the structure of an FSoE frame; ``owner`` is the number of its `Station`."""

    owner: int
    manager: int
    byte: int
    size: int
    is_output: bool
    logical: int


@dataclass(slots=True)
class CyclicWindow:
    """A datagram that is repeated in every cycle."""

    command: int
    logical: int
    length: int
    packet: int
    seen: int = 0
    returned: int = 0


@dataclass(slots=True)
class _Source:
    recent: deque[bytes] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))


@dataclass(slots=True)
class _Destination:
    last: bytes = b""
    changes: int = 0
    from_source: dict[FramePlace, int] = field(default_factory=dict)

    def sources(self, least: int) -> list[FramePlace]:
        """Return the sources of nearly all of its frames, if there were enough frames."""
        need = max(least, _SHARE * self.changes)
        return [place for place, count in self.from_source.items() if count >= need]


_Copy = tuple[FramePlace, FramePlace]


class Cycles:
    """Processes the logical datagrams.

    Attributes:
        windows: Data seen, by command, logical address and length.
    """

    def __init__(self) -> None:
        self.windows: dict[tuple[int, int, int], CyclicWindow] = {}
        self._sources: dict[FramePlace, _Source] = {}
        self._destinations: dict[FramePlace, _Destination] = {}
        self._inside: dict[tuple[int, int, int], tuple[FramePlace, ...]] = {}
        self._twice: set[FramePlace] = set()
        self._monitors: dict[tuple[_Copy, _Copy], Monitor] = {}
        self._sure: set[_Copy] = set()
        self._sure_sources: set[FramePlace] = set()

    def watch(self, places: tuple[FramePlace, ...]) -> None:
        """Set the places where frames are expected; results of places that remain are kept."""
        sources = {p: self._sources.get(p) or _Source() for p in places if not p.is_output}
        self._sources = sources
        self._destinations = {
            p: self._destinations.get(p) or _Destination() for p in places if p.is_output
        }
        self._inside = {}
        inputs = [p for p in places if not p.is_output]
        self._twice = {
            o
            for o in self._destinations
            if any(
                i.logical < o.logical + o.size and o.logical < i.logical + i.size for i in inputs
            )
        }

    def take(self, datagram: Datagram, packet: int) -> None:
        """Process one logical datagram."""
        key = (datagram.command, datagram.logical, len(datagram.data))
        window = self.windows.get(key)
        if window is None:
            if len(self.windows) >= _MOST_WINDOWS:
                return
            window = self.windows[key] = CyclicWindow(*key, packet)
        window.seen += 1
        if datagram.counter:
            window.returned += 1
        inside = self._inside.get(key)
        if inside is None:
            inside = self._inside[key] = self._found_in(*key)
        for place in inside:
            self._look(place, datagram)

    def _found_in(self, command: int, logical: int, length: int) -> tuple[FramePlace, ...]:
        ways = [p for p in self._destinations if command in _OUTPUTS]
        ways += [
            p for p in self._sources if command in _INPUTS
        ]  # destinations first, as they are older
        end = logical + length
        return tuple(p for p in ways if logical <= p.logical and p.logical + p.size <= end)

    def _look(self, place: FramePlace, datagram: Datagram) -> None:
        at = place.logical - datagram.logical
        frame = datagram.data[at : at + place.size]
        if not place.is_output:
            recent = self._sources[place].recent
            if datagram.counter and (not recent or recent[-1] != frame):
                recent.append(frame)
                self._follow(place, frame)
            return
        if place in self._twice and datagram.counter:
            return  # data that return at this address are inputs
        row = self._destinations[place]
        if frame == row.last:
            return
        row.last = frame
        if frame[0] not in _COMMANDS or frame[0] == Command.RESET:
            return  # Resets of all connections are identical
        row.changes += 1
        for source, seen in self._sources.items():
            # A SubDevice that repeats its own outputs is not the source of a copy.
            if source.size == place.size and source.owner != place.owner and frame in seen.recent:
                row.from_source[source] = row.from_source.get(source, 0) + 1

    # -- CRCs -------------------------------------------------------------------------------------

    def _follow(self, source: FramePlace, frame: bytes) -> None:
        """Compare a new frame with every conversation that its source may be part of."""
        if source in self._sure_sources:
            return
        for pair, monitor in list(self._monitors.items()):
            for direction, copy in enumerate(pair):
                if copy[0] == source:
                    monitor.frame(direction, frame, 0)
            if _is_conversation(monitor):
                self._sure |= set(pair)
                self._sure_sources |= {copy[0] for copy in pair}
                done = [p for p in self._monitors if self._sure & set(p)]
                for key in done:
                    del self._monitors[key]
                return
        self._begin(source)

    def _begin(self, source: FramePlace) -> None:
        copies = [
            (found, destination)
            for destination, row in self._destinations.items()
            for found in row.sources(_LIKELY_FRAMES)
            if (found, destination) not in self._sure
        ]
        for there in copies:
            for back in copies:
                ends = (back[1].owner, back[0].owner)
                if there[0] != source or ends != (there[0].owner, there[1].owner):
                    continue
                # Either end may be the main: only one of the two orders has valid CRCs.
                for pair in ((there, back), (back, there)):
                    if pair not in self._monitors and len(self._monitors) < _MOST_MONITORS:
                        sizes = [safe_data_length(c[0].size) for c in pair]
                        self._monitors[pair] = Monitor(*sizes)

    def _by_values(self) -> list[_Copy]:
        found = []
        for destination, row in self._destinations.items():
            sources = row.sources(ENOUGH_FRAMES)
            if len(sources) == 1:
                found.append((sources[0], destination))
        return found

    def copies(self) -> tuple[list[_Copy], list[_Copy]]:
        """Return the proven copies, and those that are supported only by equal bytes."""
        by_values = self._by_values()
        return [c for c in by_values if c in self._sure], [
            c for c in by_values if c not in self._sure
        ]


def _is_conversation(monitor: Monitor) -> bool:
    counts = [monitor.counts(direction) for direction in (0, 1)]
    # Packets missing from the capture make some CRCs wrong.
    return all(c.right >= ENOUGH_FRAMES and c.wrong * 10 <= c.right for c in counts)
