"""Replaces the CopyInfos of an ENI; all other bytes of the file are unchanged."""

from __future__ import annotations

import codecs
from collections.abc import Iterable
from dataclasses import field
from xml.parsers import expat

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Severity, sort_diagnostics
from fsoe_net.diag.words import counted
from fsoe_net.errors import InputError
from fsoe_net.formats.eni.read import load_eni_images
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.model.description import Description
from fsoe_net.model.renumber import renumbered_copies

_READS = ("10", "12")  # LRD, LRW
_UTF16 = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
_BLANK = b" \t\r\n"
_STEP = b"\t"


@dataclass(slots=True)
class _Cmd:
    """A cyclic command in the bytes: its end, the position of its CopyInfos, its numbers."""

    values: dict[str, str] = field(default_factory=dict)
    infos: list[tuple[int, int]] = field(default_factory=list)
    end: int = 0

    def bits(self, header_bits: int) -> range:
        """Return the bits of the input image that it fills; empty if it reads nothing."""
        offset = _number(self.values.get("InputOffs", ""))
        if self.values.get("Cmd") not in _READS or offset is None:
            return range(0)
        data = self.values.get("Data", "")
        # A command has either its data, two hex digits a byte, or only their length.
        length = len(data) // 2 or _number(self.values.get("DataLength", "")) or 0
        first = 8 * offset + header_bits
        return range(first, first + 8 * length)


def replace_copies(
    data: bytes, copies: Iterable[tuple[int, int, int]], *, header_bits: int
) -> bytes:
    """Return the ENI with these copies instead of its own; all other bytes are unchanged.

    Args:
        data: An ENI that was read without a finding.
        copies: Source bit, destination bit and number of bits of each, in the images of this file.
        header_bits: Bits between the offset of a command and its data in this file, 80 or 0.

    Raises:
        InputError: No command of the file contains the source of a copy, or the file is not an ENI.
    """
    encoding = _UTF16.get(data[:2])
    if encoding is not None:
        # Edits look for single bytes such as `>`. The XML declaration still names UTF-16, which the
        # encoding given to expat overrides.
        text = data[2:].decode(encoding).encode("utf-8")
        changed = _replaced(text, list(copies), header_bits, "utf-8")
        return data[:2] + changed.decode("utf-8").encode(encoding)
    return _replaced(data, list(copies), header_bits, None)


def _replaced(
    data: bytes, copies: list[tuple[int, int, int]], header_bits: int, encoding: str | None
) -> bytes:
    commands = _Finder(data, encoding).commands
    wanted: dict[int, list[tuple[int, int, int]]] = {}
    rooms = [(number, room) for number, c in enumerate(commands) if (room := c.bits(header_bits))]
    for copy in copies:
        number = _bringer(rooms, copy)
        wanted.setdefault(number, []).append(copy)
    edits: list[tuple[int, int, bytes]] = []
    for number, command in enumerate(commands):
        edits += _edits(data, command, wanted.get(number, []))
    pieces: list[bytes] = []
    done = 0
    for start, end, new in sorted(edits):
        pieces += (data[done:start], new)
        done = end
    return b"".join((*pieces, data[done:]))


def _bringer(rooms: list[tuple[int, range]], copy: tuple[int, int, int]) -> int:
    source, _, bits = copy
    for number, room in rooms:
        if source in room and source + bits - 1 in room:
            return number
    raise InputError(f"no cyclic command of this ENI brings input bits {source} to {source + bits}")


def _edits(
    data: bytes, command: _Cmd, copies: list[tuple[int, int, int]]
) -> list[tuple[int, int, bytes]]:
    """Return the replacements in one command, with their positions."""
    # New lines use the line break and indent of this file, so that a diff shows only copies.
    last = command.end
    while last > 0 and data[last - 1] in _BLANK:
        last -= 1
    blank = data[last : command.end]
    line = blank[: blank.rfind(b"\n") + 1][-2:] if b"\n" in blank else b""
    line = b"\r\n" if line == b"\r\n" else line[-1:]
    indent = blank[blank.rfind(b"\n") + 1 :] if line else b""
    inner = indent + _STEP if line else b""
    new = _element(copies, line, inner) if copies else b""
    if not command.infos:
        return [(last, last, line + inner + new)] if copies else []
    edits = []
    for number, (start, end) in enumerate(command.infos):
        # All copies go into the first CopyInfos; others are removed with the blanks before them.
        if copies and number == 0:
            edits.append((start, end, new))
            continue
        while data[start - 1] in _BLANK:
            start -= 1
        edits.append((start, end, b""))
    return edits


def _element(copies: list[tuple[int, int, int]], line: bytes, indent: bytes) -> bytes:
    inner = indent + _STEP if line else b""
    rows = [b"<CopyInfos>"]
    for source, destination, bits in copies:
        row = (
            f"<CopyInfo><SrcBitOffs>{source}</SrcBitOffs><DstBitOffs>{destination}</DstBitOffs>"
            f"<BitSize>{bits}</BitSize></CopyInfo>"
        )
        rows.append(inner + row.encode("ascii"))
    rows.append(indent + b"</CopyInfos>")
    return line.join(rows)


def _number(text: str) -> int | None:
    text = text.strip().lower()
    hexadecimal = text.startswith(("#x", "0x"))
    try:
        return int(text[2:], 16) if hexadecimal else int(text)
    except ValueError:
        return None


class _Finder:
    """Finds the cyclic commands of an ENI and their positions in the bytes."""

    def __init__(self, data: bytes, encoding: str | None) -> None:
        self.commands: list[_Cmd] = []
        self._data = data
        self._stack: list[str] = []
        self._text: list[str] = []
        self._infos = 0
        self._open_end = -1
        self._parser = expat.ParserCreate(encoding)
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text.append
        self._parser.StartDoctypeDeclHandler = self._doctype
        try:
            self._parser.Parse(data, True)
        except (expat.ExpatError, ValueError, LookupError) as exc:
            raise InputError(f"this ENI cannot be changed: {exc}") from exc

    def _doctype(self, *_arguments: object) -> None:
        raise InputError("a document type is declared; delete it first")

    def _in_command(self) -> bool:
        """Whether the current element is a direct child of a cyclic command."""
        above = self._stack[-2:]
        return len(above) == 2 and above[1] == "Cmd" and above[0] in ("Cyclic", "Frame")

    def _start(self, name: str, _attributes: dict[str, str]) -> None:
        if name == "Cmd" and self._stack[-1:] in (["Cyclic"], ["Frame"]):
            self.commands.append(_Cmd())
        if name == "CopyInfos" and self._in_command():
            self._infos = self._parser.CurrentByteIndex
        self._text.clear()
        self._stack.append(name)

    def _end(self, name: str) -> None:
        self._stack.pop()
        here = self._parser.CurrentByteIndex
        if self._in_command():
            command = self.commands[-1]
            # The first of several counts, as in the reader of ENIs.
            command.values.setdefault(name, "".join(self._text).strip())
            if name == "CopyInfos":
                end = self._data.index(b">", here) + 1
                command.infos.append((self._infos, end))
        elif name == "Cmd" and self._stack[-1:] in (["Cyclic"], ["Frame"]):
            self.commands[-1].end = here
        self._text.clear()


def renewed_eni(bus: Description, path: str, notes: list[str]) -> bytes:
    """Return the ENI with the copies of the bus; all other bytes are unchanged.

    Args:
        bus: Description of the network.
        path: The ENI.
        notes: Takes the numbers of removed and added copies.

    Raises:
        InputError: The ENI cannot be read, or is of another bus.
    """
    out = Collector()
    data = read_bytes(path, out)
    images = None if data is None else load_eni_images(data, out, name=path)
    errors = [d for d in out.diagnostics if d.level is Severity.ERROR]
    if errors:
        raise InputError("nothing written", sort_diagnostics(errors))
    if data is None or images is None:
        raise InputError(f"nothing written: {path} does not say where its process data are")
    copies = renumbered_copies(bus, images.description)
    rows = []
    for copy in copies:
        bits = images.bits_of(copy)
        if bits is None:
            raise InputError(f"nothing written: {path} has no place for the copy of {copy.span}")
        rows.append(bits)
    before = len(images.description.copies)
    notes.append(f"{path}: {counted(len(rows), 'copy')} instead of {before}, all else as it was")
    lacking = len(images.description.subdevices) - len(bus.subdevices)
    if lacking > 0:
        notes.append(f"{lacking} SubDevices of {path} are not in {bus.path}")
    return replace_copies(data, rows, header_bits=images.header_bits)
