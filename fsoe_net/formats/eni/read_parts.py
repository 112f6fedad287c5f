"""The parts of an ENI as in the file, without interpretation."""

from __future__ import annotations

from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import xml_number
from fsoe_net.formats.shared.xml_tree import Element
from fsoe_net.model.bus import Direction

_LRD, _LWR, _LRW = 10, 11, 12
_LOGICAL = (_LRD, _LWR, _LRW)
_MAX_BIT = 0xFFFFFFFF


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Process data of a SubDevice in one image; the ENI names it from the MainDevice's side."""

    direction: Direction
    bit_start: int
    bits: int
    span: Span


@dataclass(frozen=True, slots=True, kw_only=True)
class Fmmu:
    """One FMMU, as start-up commands write it into registers 0x0600 + 16 n.

    +---------+--------+-----+-----+------+------+------+--------+
    | logical | length | bit | bit | phys | bit  | type | active |
    |  0 .. 3 | 4 .. 5 |  6  |  7  | 8..9 |  10  |  11  |   12   |
    +---------+--------+-----+-----+------+------+------+--------+
    """

    logical: int
    start_bit: int
    direction: Direction


@dataclass(frozen=True, slots=True, kw_only=True)
class RawCopy:
    """A ``CopyInfo``; bits of the whole input and output image."""

    source_bit: int
    destination_bit: int
    bits: int
    span: Span


@dataclass(frozen=True, slots=True, kw_only=True)
class CyclicCommand:
    """A cyclic command that carries process data."""

    command: int
    address: int
    length: int
    input_offset: int | None
    output_offset: int | None

    def offset(self, direction: Direction) -> int | None:
        """Return the byte position of its data in an image; ``None`` if they are not in it."""
        if direction is Direction.INPUT:
            return self.input_offset if self.command != _LWR else None
        return self.output_offset if self.command != _LRD else None


@dataclass(slots=True, kw_only=True)
class Image:
    """Inputs or outputs as the ENI lists them: ``(first bit, bits)`` of each variable."""

    bits: int | None = None
    variables: set[tuple[int, int]] = field(default_factory=set)


@dataclass(slots=True, kw_only=True)
class EniParts:
    """Content outside of the SubDevices."""

    commands: list[CyclicCommand] = field(default_factory=list)
    copies: list[RawCopy] = field(default_factory=list)
    images: dict[Direction, Image] = field(
        default_factory=lambda: {Direction.INPUT: Image(), Direction.OUTPUT: Image()}
    )
    cycle_us: int | None = None
    mailbox_address: int | None = None


def read_windows(process_data: Element, out: Collector) -> list[Window]:
    """Return the non-empty ``Send`` and ``Recv`` windows of a SubDevice."""
    windows = []
    for name, direction in (("Send", Direction.OUTPUT), ("Recv", Direction.INPUT)):
        for element in process_data.all(name):
            start = xml_number(element.first("BitStart"), out)
            bits = xml_number(element.first("BitLength"), out)
            if start is not None and bits:
                window = Window(
                    direction=direction, bit_start=start, bits=bits, span=element.value_span
                )
                windows.append(window)
    return windows


def read_cyclic(element: Element, parts: EniParts, out: Collector) -> None:
    """Add the commands and copies of one ``Cyclic``."""
    cycle = xml_number(element.first("CycleTime"), out)
    if cycle and (parts.cycle_us is None or cycle < parts.cycle_us):
        parts.cycle_us = cycle
    # Some files have their commands directly in Cyclic, without Frame.
    for frame in (element, *element.all("Frame")):
        for cmd in frame.all("Cmd"):
            if cmd.children:
                _command(cmd, parts, out)


def _command(cmd: Element, parts: EniParts, out: Collector) -> None:
    code = xml_number(cmd.first("Cmd"), out, high=255)
    address = xml_number(cmd.first("Addr"), out)
    infos = cmd.first("CopyInfos")
    if infos is not None:
        if code not in (_LRD, _LRW):
            out.add(
                "FSN145",
                infos.span,
                "these CopyInfos belong to a command that reads no process data",
                hint="they belong to the LRD or LRW command (Cmd 10 or 12) that brings the source",
            )
        for info in infos.all("CopyInfo"):
            _copy(info, parts, out)
    # A MainDevice polls mailbox states with a separate logical read that is not process data.
    if code not in _LOGICAL or address is None or address == parts.mailbox_address:
        return
    parts.commands.append(
        CyclicCommand(
            command=code,
            address=address,
            length=_length(cmd, out),
            input_offset=xml_number(cmd.first("InputOffs"), out),
            output_offset=xml_number(cmd.first("OutputOffs"), out),
        )
    )


def _length(cmd: Element, out: Collector) -> int:
    # A command has either its data, two hex digits a byte, or only their length.
    data = cmd.first("Data")
    if data is not None:
        return len(data.text.strip()) // 2
    return xml_number(cmd.first("DataLength"), out, high=0xFFFF) or 0


def _copy(info: Element, parts: EniParts, out: Collector) -> None:
    """Add one ``CopyInfo``; some tools call the destination ``DestBitOffs``."""
    wanted = {"SrcBitOffs": 0, "DstBitOffs": 0, "BitSize": 0}
    for name in wanted:
        element = info.first(name)
        if element is None and name == "DstBitOffs":
            element = info.first("DestBitOffs")
        if element is None:
            out.add("FSN141", info.span, f"CopyInfo without {name}", hint=f"add <{name}>")
            return
        value = xml_number(element, out, high=_MAX_BIT)
        if value is None:
            return
        wanted[name] = value
    if wanted["BitSize"] == 0:
        out.add("FSN145", info.span, "this CopyInfo copies nothing", hint="correct its BitSize")
        return
    copy = RawCopy(
        source_bit=wanted["SrcBitOffs"],
        destination_bit=wanted["DstBitOffs"],
        bits=wanted["BitSize"],
        span=info.span,
    )
    parts.copies.append(copy)


def read_image(element: Element, parent: Element, parts: EniParts, out: Collector) -> None:
    """Add one ``Variable`` or ``ByteSize`` below ``Inputs`` or ``Outputs``."""
    direction = Direction.INPUT if parent.name == "Inputs" else Direction.OUTPUT
    image = parts.images[direction]
    if element.name == "ByteSize":
        size = xml_number(element, out)
        image.bits = None if size is None else 8 * size
    elif element.name == "Variable":
        offset = xml_number(element.first("BitOffs"), out)
        bits = xml_number(element.first("BitSize"), out)
        if offset is not None and bits is not None:
            image.variables.add((offset, bits))
