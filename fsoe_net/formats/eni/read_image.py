"""Positions of the process data of an ENI, and what its CopyInfos copy.

``Send``/``Recv`` windows, ``Variable``s and ``CopyInfo``s share one coordinate per image: bits of
the input image, bits of the output image. Two routes lead to each entry, through the PDO lists and
through the variables; they must agree.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from itertools import pairwise

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Span
from fsoe_net.formats.eni.read_parts import CyclicCommand, EniParts, Fmmu, RawCopy, Window
from fsoe_net.formats.eni.read_subdevice import EniSlave
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Direction
from fsoe_net.model.description import DescribedCopy, DescribedEnd
from fsoe_net.model.layout import FsoeBlock, SmLayout

_WRAP = 0x10000
_NAMES = {Direction.INPUT: "input", Direction.OUTPUT: "output"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """The process data of one sync manager in its image."""

    first_bit: int
    end_bit: int
    subdevice: int
    sm_index: int
    blocks: tuple[FsoeBlock, ...]
    edges: tuple[int, ...]  # begin and end of frames and of the sync manager; bits of the image

    def block_at(self, bit: int) -> FsoeBlock | None:
        """Return the FSoE frame that contains a bit of this sync manager."""
        number = bisect_right(self.blocks, bit, key=lambda b: 8 * b.byte_offset) - 1
        if number < 0 or bit >= 8 * self.blocks[number].end_byte:
            return None
        return self.blocks[number]


@dataclass(slots=True)
class ImageMap:
    """All places of one image, in ascending order of bits."""

    places: list[Place]
    starts: list[int]

    def at(self, bit: int) -> Place | None:
        """Return the place that contains a bit."""
        number = bisect_right(self.starts, bit) - 1
        if number < 0 or bit >= self.places[number].end_bit:
            return None
        return self.places[number]


# -- header bytes ---------------------------------------------------------------------------------


def header_bits(slaves: list[EniSlave], parts: EniParts, out: Collector) -> int | None:
    """Return the distance from the offset of a command to its data: 80 bits or 0 in known files.

    ``BitStart == 8 * (Offs + FMMU.logical - Addr) + FMMU.startbit + header``. Tools that count from
    the datagram header have 10 bytes there, others none.

    Returns:
        The constant, or ``None`` if it is unknown or, with FSN142, if the file is inconsistent.
    """
    first: dict[int, Window] = {}
    commands = {
        d: sorted((c for c in parts.commands if c.offset(d) is not None), key=lambda c: c.address)
        for d in Direction
    }
    for slave in slaves:
        for direction in Direction:
            windows = [w for w in slave.windows if w.direction is direction]
            fmmus = [f for f in slave.fmmus if f.direction is direction]
            for window, fmmu in _paired(windows, fmmus):
                delta = _delta(window, fmmu, commands[direction])
                if delta is not None:
                    first.setdefault(delta, window)
    if len(first) > 1:
        (one, a), (two, b) = list(first.items())[:2]
        out.add(
            "FSN142",
            b.span,
            f"this window is {two} bits after the offset of its command, another one {one} bits",
            hint="one file has one header size (0 or 80 bits); export the ENI again",
            related=(Related(span=a.span, message=f"{one} bits here"),),
        )
        return None
    return next(iter(first), None)


def _paired(windows: list[Window], fmmus: list[Fmmu]) -> Iterable[tuple[Window, Fmmu]]:
    """Pair each window with the FMMU at its start; several FMMUs may share the only window."""
    fmmus = sorted(fmmus, key=lambda f: (f.logical, f.start_bit))
    if len(windows) == 1 or len(windows) == len(fmmus):
        yield from zip(sorted(windows, key=lambda w: w.bit_start), fmmus, strict=False)


def _delta(window: Window, fmmu: Fmmu, commands: list[CyclicCommand]) -> int | None:
    """Find the command of an FMMU among those of its direction, which are sorted by address."""
    behind_last = bisect_right(commands, fmmu.logical, key=lambda c: c.address)
    for command in reversed(commands[max(behind_last - 8, 0) : behind_last]):
        offset = command.offset(window.direction)
        distance = fmmu.logical - command.address
        if offset is not None and distance < command.length:
            return window.bit_start - 8 * (offset + distance) - fmmu.start_bit
    return None


# -- windows --------------------------------------------------------------------------------------


def map_images(
    slaves: list[EniSlave], parts: EniParts, out: Collector
) -> dict[Direction, ImageMap]:
    """Place every sync manager; report contradictions in the file as FSN143 and FSN144."""
    found: dict[Direction, list[Place]] = {Direction.INPUT: [], Direction.OUTPUT: []}
    for number, slave in enumerate(slaves):
        layout = slave.described.device.layout
        for direction, places in found.items():
            managers = [m for m in layout.managers if m.sm.direction is direction and m.bits]
            windows = [w for w in slave.windows if w.direction is direction]
            starts = _starts(slave, managers, windows, out)
            for manager, start in zip(managers, starts, strict=False):
                place = Place(
                    first_bit=start,
                    end_bit=start + manager.bits,
                    subdevice=number,
                    sm_index=manager.sm.index,
                    blocks=manager.blocks,
                    edges=_edges(manager, start),
                )
                places.append(place)
                _compare(slave, manager, start, parts, out)
    maps = {}
    for direction, places in found.items():
        places.sort(key=lambda p: p.first_bit)
        _no_overlap(places, slaves, direction, out)
        maps[direction] = ImageMap(places, [p.first_bit for p in places])
    return maps


def _starts(
    slave: EniSlave, managers: list[SmLayout], windows: list[Window], out: Collector
) -> list[int]:
    """Return the first bit of each sync manager, or nothing with FSN143."""
    bits = sum(m.bits for m in managers)
    room = sum(w.bits for w in windows)
    if bits == room and len(windows) == 1:
        starts, at = [], windows[0].bit_start
        for manager in managers:
            starts.append(at)
            at += manager.bits
        return starts
    if len(windows) == len(managers):
        pairs = zip(managers, windows, strict=True)
        if all(m.bits == w.bits for m, w in pairs):
            return [w.bit_start for w in windows]
    if managers or windows:
        span = windows[0].span if windows else managers[0].sm.span
        out.add(
            "FSN143",
            span,
            f"the PDOs of {slave.described.name!r} have {bits} bits, its process data {room}",
            hint="export the ENI again; the places of its entries are unknown",
        )
    return []


def _compare(
    slave: EniSlave, manager: SmLayout, start: int, parts: EniParts, out: Collector
) -> None:
    """Look up each named entry among the variables."""
    image = parts.images[manager.sm.direction]
    if not image.variables:
        return
    for placed in manager.placed:
        entry = placed.entry
        if not entry.name or entry.is_gap:
            continue
        # One such entry moves all others, so only the first is reported.
        if (start + placed.bit_offset, entry.bits) not in image.variables:
            out.add(
                "FSN144",
                entry.span,
                f"entry {entry.address} {entry.name!r} of {slave.described.name!r} is at bit "
                f"{start + placed.bit_offset} by its PDOs; no {_NAMES[manager.sm.direction]} "
                f"variable of {entry.bits} bits is there",
                hint="export the ENI again; one of the two is out of date",
            )
            return


def _no_overlap(
    places: list[Place], slaves: list[EniSlave], direction: Direction, out: Collector
) -> None:
    for before, after in pairwise(places):
        if after.first_bit < before.end_bit:
            one, two = (slaves[p.subdevice] for p in (before, after))
            out.add(
                "FSN143",
                two.span,
                f"{_NAMES[direction]} data of {two.described.name!r} and {one.described.name!r} "
                "lie on the same bits",
                hint="export the ENI again",
                related=(Related(span=one.span, message="the other SubDevice"),),
            )
            return


# -- copies ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Run:
    source: int
    destination: int
    bits: int
    span: Span


def copies_of(
    parts: EniParts, maps: dict[Direction, ImageMap], out: Collector, *, placed: bool
) -> tuple[DescribedCopy, ...]:
    """Return the copies of the CopyInfos: adjacent ones joined, then split at SMs and frames.

    Args:
        parts: The file.
        maps: Positions of process data.
        out: Takes FSN145 and FSN149.
        placed: Whether every SubDevice has its place; otherwise a copy to an unknown place is not a
            finding.
    """
    copies: list[DescribedCopy] = []
    if not placed:
        out = Collector()
    sound = [c for c in parts.copies if _inside(c, parts, maps, out)]
    for run in _merged(sound):
        copies += _pieces(run, maps, out)
    return tuple(copies)


def _inside(
    copy: RawCopy, parts: EniParts, maps: dict[Direction, ImageMap], out: Collector
) -> bool:
    for direction, bit, word in (
        (Direction.INPUT, copy.source_bit, "source"),
        (Direction.OUTPUT, copy.destination_bit, "destination"),
    ):
        bits = parts.images[direction].bits
        if bits is not None and bit + copy.bits > bits:
            out.add(
                "FSN145",
                copy.span,
                f"the {word} of this CopyInfo ends at bit {bit + copy.bits}, the "
                f"{_NAMES[direction]} image has {bits}",
                hint="correct it, or export the ENI again",
            )
            return False
        if maps[direction].at(bit) is None:
            out.add(
                "FSN145",
                copy.span,
                f"the {word} of this CopyInfo, bit {bit}, lies in no SubDevice's process data",
                hint=_wrap_hint(bit, maps[direction]),
            )
            return False
    return True


def _wrap_hint(bit: int, image: ImageMap) -> str:
    """Return a hint with the bit that a 16-bit counter may have meant."""
    end = image.places[-1].end_bit if image.places else 0
    for candidate in range(bit + _WRAP, min(end, 0x1000000), _WRAP):
        if image.at(candidate) is not None:
            return f"a 16-bit counter may have wrapped: is {candidate} meant?"
    return "correct it, or export the ENI again"


def _merged(copies: list[RawCopy]) -> list[_Run]:
    runs: list[_Run] = []
    # Adjacent copies of one run have the same distance from source to destination.
    for copy in sorted(copies, key=lambda c: (c.source_bit - c.destination_bit, c.source_bit)):
        last = runs[-1] if runs else None
        shift = copy.source_bit - copy.destination_bit
        if (
            last is not None
            and last.source - last.destination == shift
            and copy.source_bit <= last.source + last.bits
        ):
            end = max(last.source + last.bits, copy.source_bit + copy.bits)
            runs[-1] = _Run(last.source, last.destination, end - last.source, last.span)
        else:
            runs.append(_Run(copy.source_bit, copy.destination_bit, copy.bits, copy.span))
    return sorted(runs, key=lambda r: (r.source, r.destination))


def _pieces(run: _Run, maps: dict[Direction, ImageMap], out: Collector) -> list[DescribedCopy]:
    pieces: list[DescribedCopy] = []
    done = 0
    while done < run.bits:
        source_bit, destination_bit = run.source + done, run.destination + done
        source = maps[Direction.INPUT].at(source_bit)
        destination = maps[Direction.OUTPUT].at(destination_bit)
        if source is None or destination is None:
            side, bit = (
                ("source", source_bit) if source is None else ("destination", destination_bit)
            )
            out.add(
                "FSN145",
                run.span,
                f"this copy runs out of the process data of its SubDevice: {side} bit {bit}",
                hint="correct its BitSize, or export the ENI again",
            )
            break
        length = min(
            run.bits - done,
            _to_edge(source, source_bit),
            _to_edge(destination, destination_bit),
        )
        piece = DescribedCopy(
            span=run.span,
            source=_end(source, source_bit, run.span),
            destination=_end(destination, destination_bit, run.span),
            bits=length,
        )
        _whole_frames(piece, source, destination, out)
        pieces.append(piece)
        done += length
    return pieces


def _end(place: Place, bit: int, span: Span) -> DescribedEnd:
    return DescribedEnd(
        span=span,
        subdevice=place.subdevice,
        sm_index=place.sm_index,
        bit_offset=bit - place.first_bit,
    )


def _to_edge(place: Place, bit: int) -> int:
    """Return the bits from here to the next edge of an FSoE frame or of the sync manager."""
    return place.edges[bisect_right(place.edges, bit)] - bit


def _edges(manager: SmLayout, start: int) -> tuple[int, ...]:
    edges = {start + manager.bits}
    for block in manager.blocks:
        edges |= {start + 8 * block.byte_offset, start + 8 * block.end_byte}
    return tuple(sorted(edges))


def _whole_frames(piece: DescribedCopy, source: Place, destination: Place, out: Collector) -> None:
    """Report FSN149 if a copy includes only a part of an FSoE frame."""
    for end, place in ((piece.source, source), (piece.destination, destination)):
        block = place.block_at(end.bit_offset)
        if block is None:
            continue
        first, end_bit = 8 * block.byte_offset, 8 * block.end_byte
        if (end.bit_offset, piece.bits) != (first, end_bit - first):
            out.add(
                "FSN149",
                piece.span,
                f"bits {end.bit_offset} to {end.bit_offset + piece.bits - 1} of Sm{end.sm_index} "
                f"are copied, a part of the FSoE frame at bits {first} to {end_bit - 1}",
                hint="copy the frame as a whole, from command to connection ID",
            )
            return
