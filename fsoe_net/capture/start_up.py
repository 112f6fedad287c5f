"""Converts a capture of EtherCAT (pcap or pcapng) to a description of the bus.

The start-up traffic of a MainDevice shows the bus: it assigns station addresses in ring order,
reads EEPROMs and objects, writes PDO assignments, sync managers and FMMUs. Packets are read one by
one, and only the resulting state is kept.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Iterator
from typing import BinaryIO

from fsoe_net.capture.cycles import Cycles, FramePlace
from fsoe_net.core.module import compiled
from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.diag.words import counted
from fsoe_net.errors import InputError
from fsoe_net.formats.capture.datagrams import LOGICAL, DatagramCommand, datagrams, joined
from fsoe_net.formats.capture.device import describe_station
from fsoe_net.formats.capture.packets import CaptureReader
from fsoe_net.formats.capture.ring import Ring
from fsoe_net.formats.capture.station import Station
from fsoe_net.formats.shared.files import Collector, open_file
from fsoe_net.formats.shared.source import Source
from fsoe_net.model.bus import Direction, SyncManager
from fsoe_net.model.description import DescribedCopy, DescribedEnd, DescribedSubDevice, Description
from fsoe_net.model.detect import detect_fsoe
from fsoe_net.model.network import SourceFile

_AGAIN = "capture from before the MainDevice starts until some seconds of OP have passed"


def load_capture(source: Source, out: Collector, *, name: str = "<capture>") -> Description | None:
    """Read a capture packet by packet, of any size.

    Args:
        source: Path of a pcap or pcapng file, compressed with gzip or not, or its bytes.
        out: Takes FSN150 when the capture has no EtherCAT, FSN151 if the file is damaged, FSN152
            for truncated packets, FSN153 for missing data, FSN154 for PDOs that do not fit. The
            line number of a finding is the number of the packet.
        name: Name shown when ``source`` is bytes.
    """
    compiled()  # a missing core must be reported before the file is read
    if isinstance(source, bytes):
        return read_stream(name, io.BytesIO(source), out)
    path = os.fspath(source)
    try:
        with open_file(path) as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
            stream.seek(0)
            row = SourceFile(path=path, sha256=digest)
            if row not in out.sources:
                out.sources.append(row)
            return read_stream(path, stream, out)
    except InputError as exc:
        out.diagnostics += exc.diagnostics
        return None
    except (OSError, ValueError) as exc:
        why = exc.strerror if isinstance(exc, OSError) and exc.strerror else str(exc)
        out.add("FSN101", Span(path), f"cannot read {path!r}: {why}", hint="check the path")
        return None


def read_stream(name: str, stream: BinaryIO, out: Collector) -> Description | None:
    """Read a capture from a stream, which need not be seekable; see `load_capture`."""
    return _Capture(name, out).read(stream)


class _Capture:
    """Reads one capture."""

    def __init__(self, path: str, out: Collector) -> None:
        self._path = path
        self._out = out
        self._ring = Ring()
        self._cycles = Cycles()
        self._packets = 0
        self._ethercat = 0
        self._cuts = self._first_cut = 0
        self._frames: dict[int, tuple[FramePlace, ...]] = {}

    def read(self, stream: BinaryIO) -> Description | None:
        for packet in self._each(stream):
            self._take(packet)
        if not self._ethercat:
            if not any(d.code == "FSN150" for d in self._out.diagnostics):
                message = f"none of the {counted(self._packets, 'packet')} is of EtherCAT"
                hint = "capture on the network interface of the MainDevice, not on `any`"
                self._out.add("FSN150", Span(self._path), message, hint=hint)
            return None
        return self._description()

    def _each(self, stream: BinaryIO) -> Iterator[bytes]:
        reader = CaptureReader(self._path, stream)
        try:
            for _, _, data in reader:
                self._packets = reader.packets
                yield data
        except InputError as exc:
            self._damaged(str(exc))

    def _damaged(self, message: str) -> None:
        words = message.removeprefix(f"{self._path}: ")
        if not self._packets:
            hint = "give a pcap or pcapng file of an Ethernet interface"
            self._out.add("FSN150", Span(self._path), f"this cannot be used: {words}", hint=hint)
            return
        place = Span(self._path, self._packets, 1)
        hint = "copy the file again; the part before this place is used"
        self._out.add("FSN151", place, words, hint=hint)

    def _take(self, packet: bytes) -> None:
        found = datagrams(packet)
        if found is None:
            return
        self._ethercat += 1
        rows, cut = found
        if cut:
            self._cuts += 1
            self._first_cut = self._first_cut or self._packets
        for row in rows:
            if row.command not in LOGICAL:
                self._ring.take(row, self._packets)
        logical = joined(rows)
        # Only for process data: the start-up has thousands of commands that change a layout.
        if logical and self._ring.changed:
            self._watch()
        for row in logical:
            self._cycles.take(row, self._packets)

    def _watch(self) -> None:
        """Recompute where frames are expected."""
        for station in self._ring.stations:
            if station.changed:
                described = describe_station(station, self._path, Collector())
                self._frames[station.number] = tuple(_frames(station, described))
                station.changed = False
        self._ring.changed = False
        self._cycles.watch(
            tuple(p for s in self._ring.stations for p in self._frames.get(s.number, ()))
        )

    # -- the end ----------------------------------------------------------------------------------

    def _description(self) -> Description | None:
        if self._cuts:
            self._out.add(
                "FSN152",
                Span(self._path, self._first_cut, 1),
                f"{self._cuts} packets lack their end, the first is this one: datagrams in it are "
                "left out",
                hint="capture whole packets: tcpdump -s 0, dumpcap without -s",
            )
        stations = self._ring.stations
        if not stations:
            self._silent()
            return None
        subs = tuple(describe_station(s, self._path, self._out) for s in stations)
        self._remarks(stations)
        numbers = {s.number: n for n, s in enumerate(stations)}
        copies, _ = self._cycles.copies()
        return Description(
            span=Span(self._path, 1, 1),
            format="capture",
            path=self._path,
            subdevices=subs,
            copies=tuple(
                _copy(pair, numbers, subs)
                for pair in sorted(copies)
                if pair[0].owner in numbers and pair[1].owner in numbers
            ),
        )

    def _silent(self) -> None:
        rows = [w for w in self._cycles.windows.values() if w.returned]
        rows.sort(key=lambda w: -w.seen)
        shown = ", ".join(
            f"{DatagramCommand(w.command).name} 0x{w.logical:08x} with {w.length} bytes"
            for w in rows[:4]
        )
        message = "no SubDevice is shown"
        if shown:
            message = f"only process data are shown ({shown}), not whose they are"
        self._out.add(
            "FSN153",
            Span(self._path, rows[0].packet if rows else 1, 1),
            message,
            hint=f"{_AGAIN}; fsoe-net decode finds the FSoE frames of this one",
            severity=Severity.ERROR,
        )

    def _remarks(self, stations: list[Station]) -> None:
        """Report remarks that do not concern a single SubDevice."""
        ring = self._ring
        placed = [s for s in stations if s.position is not None]
        if ring.count is not None and len(placed) < ring.count:
            self._remark(
                f"{counted(ring.count, 'SubDevice')} answered broadcasts, {len(placed)} of "
                f"them are shown "
                "with their place in the ring",
                Severity.WARNING,
            )
        if ring.full:
            self._remark("more SubDevices than can be kept; the rest is left out", Severity.WARNING)
        if ring.restarted is not None:
            message = "the number of SubDevices had changed here; what was before is left out"
            self._remark(message, Severity.WARNING, ring.restarted)
        if not any(w.returned for w in self._cycles.windows.values()):
            self._remark("no process data came back, so no copies can be found", Severity.INFO)
            return
        _, weak = self._cycles.copies()
        for source, destination in weak:
            self._remark(
                f"{source.size} bytes of SM{source.manager} at byte {source.byte} come back in SM"
                f"{destination.manager} of another SubDevice, but too few frames, or not both "
                "directions, prove that they are copied",
                Severity.INFO,
            )

    def _remark(self, message: str, severity: Severity, packet: int = 1) -> None:
        place = Span(self._path, packet, 1)
        self._out.add("FSN153", place, message, hint=_AGAIN, severity=severity)


def _logical(station: Station, start: int, size: int, sm: SyncManager) -> int | None:
    """Return the logical address of some bytes of a SubDevice's memory."""
    for fmmu in station.fmmus():
        at = start - fmmu.physical
        if fmmu.direction is sm.direction and at >= 0 and at + size <= fmmu.length:
            return fmmu.logical + at
    return None


def _frames(station: Station, described: DescribedSubDevice) -> Iterator[FramePlace]:
    """Yield where FSoE frames of a SubDevice may be in the logical address space.

    Possible places are included; their content shows whether they are FSoE frames.
    """
    for manager in described.device.layout.managers:
        start = manager.sm.start_byte
        for guess in detect_fsoe(manager.placed, manager.sm):
            block = guess.block
            if start is None:
                continue
            logical = _logical(station, start + block.byte_offset, block.frame_bytes, manager.sm)
            if logical is not None:
                yield FramePlace(
                    owner=station.number,
                    manager=block.sm_index,
                    byte=block.byte_offset,
                    size=block.frame_bytes,
                    is_output=block.direction is Direction.OUTPUT,
                    logical=logical,
                )


def _copy(
    pair: tuple[FramePlace, FramePlace],
    numbers: dict[int, int],
    subs: tuple[DescribedSubDevice, ...],
) -> DescribedCopy:
    source, destination = (
        DescribedEnd(
            subdevice=numbers[place.owner],
            sm_index=place.manager,
            bit_offset=8 * place.byte,
            span=subs[numbers[place.owner]].span,
        )
        for place in pair
    )
    return DescribedCopy(
        source=source,
        destination=destination,
        bits=8 * pair[0].size,
        fsoe=True,
        span=source.span,
    )
