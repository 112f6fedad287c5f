"""ENI (EtherCAT network information, root ``EtherCATConfig``) into a description."""

from __future__ import annotations

from collections.abc import Mapping

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Span
from fsoe_net.formats.eni.read_image import ImageMap, copies_of, header_bits, map_images
from fsoe_net.formats.eni.read_parts import EniParts, read_cyclic, read_image
from fsoe_net.formats.eni.read_subdevice import EniSlave, read_slave
from fsoe_net.formats.recognise import is_format
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.ring import MOST_SUBDEVICES
from fsoe_net.formats.shared.source import Source, source_bytes, xml_number
from fsoe_net.formats.shared.xml_text import readable_xml
from fsoe_net.formats.shared.xml_tree import Element, parse_xml
from fsoe_net.model.bus import Direction
from fsoe_net.model.description import DescribedCopy, Description


@dataclass(frozen=True, slots=True, kw_only=True)
class EniImages:
    """An ENI and the position of its images, for a writer that only changes its copies.

    Attributes:
        description: Result of `load_eni`.
        header_bits: Bits between the offset of a command and its data.
        starts: First bit of each sync manager in its image, by SubDevice and SM number.
    """

    description: Description
    header_bits: int
    starts: Mapping[tuple[int, int], int]

    def bits_of(self, copy: DescribedCopy) -> tuple[int, int, int] | None:
        """Return source bit, destination bit and length of a copy, or ``None`` if not placed."""
        source = self.starts.get((copy.source.subdevice, copy.source.sm_index))
        destination = self.starts.get((copy.destination.subdevice, copy.destination.sm_index))
        if source is None or destination is None:
            return None
        first = source + copy.source.bit_offset
        return (first, destination + copy.destination.bit_offset, copy.bits)


def load_eni(source: Source, out: Collector, *, name: str = "<eni>") -> Description | None:
    """Read an ENI.

    Each section is freed after reading, so even a large file on a single line is supported.

    Args:
        source: Path, or the bytes of the file.
        out: Takes findings, located.
        name: Name shown when ``source`` is bytes.

    Returns:
        SubDevices with their assigned PDOs, and copies; ``None`` when the file cannot be trusted.
    """
    reader = _read(source, out, name)
    return None if reader is None else reader.result


def load_eni_images(source: Source, out: Collector, *, name: str = "<eni>") -> EniImages | None:
    """Read an ENI with the position of its images; ``None`` if the file does not state it.

    Args:
        source: Path, or the bytes of the file.
        out: Takes findings, located.
        name: Name shown when ``source`` is bytes.
    """
    reader = _read(source, out, name)
    if reader is None or reader.result is None or reader.header is None:
        return None
    starts = {
        (p.subdevice, p.sm_index): p.first_bit for m in reader.maps.values() for p in m.places
    }
    return EniImages(description=reader.result, header_bits=reader.header, starts=starts)


def _read(source: Source, out: Collector, name: str) -> _Reader | None:
    data, shown = source_bytes(source, out, name)
    if data is None or not is_format(data, "eni", shown, out):
        return None
    reader = _Reader(shown, out)
    root = parse_xml(
        readable_xml(data, shown, out), shown, out, closed=reader.closed, what="an ENI"
    )
    if root is None:
        return None
    reader.result = reader.conclude(root)
    return reader


class _Reader:
    """Processes the sections of an ENI as they end."""

    def __init__(self, path: str, out: Collector) -> None:
        self._path = path
        self._out = out
        self._slaves: list[EniSlave] = []
        self._parts = EniParts()
        self.header: int | None = None
        self.maps: dict[Direction, ImageMap] = {}
        self.result: Description | None = None

    def closed(self, element: Element, parent: Element, depth: int) -> bool:
        """Process an element; return true if it is no longer needed."""
        if depth == 4 and parent.name in ("Inputs", "Outputs"):
            read_image(element, parent, self._parts, self._out)
            return True
        if depth != 2:
            return False
        if element.name == "Slave":
            if len(self._slaves) <= MOST_SUBDEVICES:  # one more, so that the limit is reported
                slave = read_slave(element, len(self._slaves), self._out, self._path)
                self._slaves.append(slave)
        elif element.name == "Cyclic":
            read_cyclic(element, self._parts, self._out)
        elif element.name == "Master":
            states = element.first("MailboxStates")
            if states is not None:
                address = xml_number(states.first("StartAddr"), self._out)
                self._parts.mailbox_address = address
        return True

    def conclude(self, root: Element) -> Description | None:
        """Complete the description; ``None`` if the file contradicts itself about its header."""
        if not self._slaves:
            self._out.add(
                "FSN141",
                root.span,
                "this ENI has no SubDevices",
                hint="export it again, with the SubDevices of the bus",
            )
            return None
        known = len(self._out.diagnostics)
        self.header = header_bits(self._slaves, self._parts, self._out)
        if len(self._out.diagnostics) > known:
            return None
        self._one_each()
        self.maps = map_images(self._slaves, self._parts, self._out)
        placed = not any(d.code == "FSN143" for d in self._out.diagnostics[known:])
        copies: tuple[DescribedCopy, ...] = ()
        if self._parts.copies and self.header is None:
            self._out.add(
                "FSN142",
                self._parts.copies[0].span,
                "no FMMU and cyclic command show what the bits of these CopyInfos count from",
                hint="export the full ENI, with cyclic commands and start-up commands",
            )
        elif self._parts.copies:
            copies = copies_of(self._parts, self.maps, self._out, placed=placed)
        return Description(
            span=root.span,
            format="eni",
            path=self._path,
            subdevices=tuple(s.described for s in self._slaves),
            copies=copies,
            cycle_us=self._parts.cycle_us,
        )

    def _one_each(self) -> None:
        """Report two SubDevices at the same ring position.

        Members of groups that may be absent have no position until they are attached.
        """
        if any(slave.hot_connect for slave in self._slaves):
            return
        seen: dict[int | None, Span] = {}
        for slave in self._slaves:
            position = slave.described.position
            if position in seen:
                self._out.add(
                    "FSN141",
                    slave.described.at("AutoIncAddr"),
                    f"two SubDevices at ring position {position}",
                    hint="correct AutoIncAddr: 0, 65535, 65534 and so on",
                    related=(Related(span=seen[position], message="the other one"),),
                )
                return
            seen[position] = slave.described.at("AutoIncAddr")
