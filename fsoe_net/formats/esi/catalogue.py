"""Lists the devices and modules of an ESI file with their positions, in one fast pass.

The file of a vendor has tens of megabytes, mostly object dictionaries. The pass reads the head of
each ``Device`` and ``Module`` and skips the rest; `esi` then reads only the required piece.
"""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Iterator
from dataclasses import field
from xml.parsers import expat

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.formats.recognise import words_of_root
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import esi_number
from fsoe_net.formats.shared.xml_tree import MAX_DEPTH, shown_name, xml_hint

MAX_ROWS = 100_000
_MAX_TEXT = 1000  # of a stored name
_MAX_PIECES = 8  # of text; expat passes up to 8 KiB at once
_MAX_REFERENCES = 1000
_ENGLISH = "1033"

_PROFILE = re.compile(rb"""<Profile(?:\s(?:[^<>"']|"[^"<]*"|'[^'<]*')*)?(?<!/)>""")
_PROFILE_END = re.compile(rb"</Profile\s*>")

# Elements to search, by parent element; all others are skipped.
_INSIDE = {
    "": frozenset({"EtherCATInfo", "EtherCATInfoList"}),
    "EtherCATInfoList": frozenset({"EtherCATInfo"}),
    "EtherCATInfo": frozenset({"Vendor", "Descriptions", "InfoReference"}),
    "Vendor": frozenset({"Id"}),
    "Descriptions": frozenset({"Devices", "Modules"}),
    "Devices": frozenset({"Device"}),
    "Device": frozenset({"Type", "Name"}),
    "Modules": frozenset({"Module"}),
    "Module": frozenset({"Type", "Name"}),
}
_REFERRED = frozenset({"EtherCATModule", "EtherCATDict"})  # of an ESI with `InfoReference`


@dataclass(frozen=True, slots=True, kw_only=True)
class EsiRow:
    """A ``Device`` or ``Module`` of the file.

    Attributes:
        kind: ``device`` or ``module``.
        vendor: Vendor ID; 0 when not stated.
        product: Product code, or the ident of a module.
        revision: ``None`` for a module, or if not stated.
        type: Order number such as ``EL1904``.
        name: English name, or else the first one.
        group: Number of its ``EtherCATInfo``; a list has several.
        offset: First byte of the element.
        end: Byte after its content.
        line: Line of its tag, from 1.
        column: Column of its tag, from 1.
    """

    kind: str
    vendor: int
    product: int
    revision: int | None
    type: str
    name: str
    group: int
    offset: int
    end: int
    line: int
    column: int


@dataclass(frozen=True, slots=True, kw_only=True)
class EsiCatalogue:
    """The content of a file, in its order. ``encoding`` is that of the pieces."""

    encoding: str
    is_list: bool
    references: tuple[str, ...]
    rows: tuple[EsiRow, ...]

    @property
    def devices(self) -> tuple[EsiRow, ...]:
        """The devices, in the order of the file."""
        return tuple(row for row in self.rows if row.kind == "device")

    @property
    def modules(self) -> tuple[EsiRow, ...]:
        """The modules, in the order of the file."""
        return tuple(row for row in self.rows if row.kind == "module")


def scan_esi(data: bytes, path: str | os.PathLike[str], out: Collector) -> EsiCatalogue | None:
    """List the content of an ESI file.

    Args:
        data: The bytes of the file, from `plain_xml`.
        path: The file, for places.
        out: Takes FSN140 for a file of another kind, FSN118 for invalid XML, a warning if the text
            is not in the declared encoding, FSN110 and FSN111 for a device without an identity.

    Returns:
        The catalogue, or ``None`` with a finding.
    """
    shown = os.fspath(path)
    attempt = _Scan(shown, data, Collector(), None)
    catalogue = attempt.run()
    # Some files declare UTF-8 and contain Latin-1.
    if catalogue is None and attempt.bad_text is not None:
        again = _Scan(shown, data, Collector(), "iso-8859-1")
        catalogue = again.run()
        if catalogue is not None:
            again.out.add(
                "FSN118",
                attempt.bad_text,
                f"not {attempt.encoding.upper()} text here; the file is read as ISO-8859-1",
                hint='declare it: <?xml version="1.0" encoding="ISO-8859-1"?>',
                severity=Severity.WARNING,
            )
            attempt = again
    out.diagnostics.extend(attempt.out.diagnostics)
    return catalogue


class _Stop(Exception):
    """The file is rejected; the finding has been added."""


@dataclass(slots=True)
class _Open:
    """A device or module that is being read."""

    kind: str
    offset: int
    span: Span
    attributes: dict[str, str] = field(default_factory=dict)
    type: str = ""
    name: str = ""
    english: bool = False
    vendor: int = 0


class _Places:
    """Converts increasing offsets to lines and columns, without reading anything twice."""

    def __init__(self, data: bytes, encoding: str) -> None:
        self._data = data
        self._encoding = encoding
        self._at = len(codecs.BOM_UTF8) if data.startswith(codecs.BOM_UTF8) else 0
        self._line, self._column = 1, 1

    def of(self, offset: int) -> tuple[int, int]:
        """Return line and column, from 1, of an offset not below the previous one."""
        data, low = self._data, self._at
        offset = max(offset, low)
        lines = data.count(b"\n", low, offset)
        if lines:
            self._line += lines
            self._column = 1
            low = data.rfind(b"\n", low, offset) + 1
        if offset > low:
            self._column += len(data[low:offset].decode(self._encoding, "replace"))
        self._at = offset
        return self._line, self._column


def _pieces(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield the ranges to parse: everything except the content of ``Profile``.

    Nothing is skipped if comments or CDATA make it uncertain that these are real tags.
    """
    low = 0
    for match in _PROFILE.finditer(data):
        begin = match.end()
        if begin <= low:
            continue
        closing = _PROFILE_END.search(data, begin)
        if closing is None:
            break
        end = closing.start()
        if not _is_whole(data, begin, end):
            break  # do not retry from here: the time would be quadratic
        yield low, begin
        low = end
    yield low, len(data)


def _is_whole(data: bytes, begin: int, end: int) -> bool:
    for opening, closing in ((b"<!--", b"-->"), (b"<![CDATA[", b"]]>")):
        closed = data.count(closing, begin, end)
        if closed != data.count(opening, begin, end):
            return False
        if closed and data.find(closing, begin, end) < data.find(opening, begin, end):
            return False
    if _PROFILE.search(data, begin, end):
        return False
    return all(data.find(tag, begin, end) < 0 for tag in (b"</Device>", b"</Module>"))


class _Scan:
    """Drives expat with two pairs of handlers: one inspects elements, one only counts levels."""

    def __init__(self, file: str, data: bytes, out: Collector, encoding: str | None) -> None:
        self.out = out
        self.bad_text: Span | None = None
        self.encoding = encoding or "utf-8"
        self._file = file
        self._data = data
        self._forced = encoding is not None
        self._places: _Places | None = None
        self._left_out = 0  # bytes before the current piece that expat has not received
        self._path = [""]
        self._lines: list[int] = []
        self._skipped = 0
        self._text: list[str] | None = None
        self._attributes: dict[str, str] = {}
        self._open: _Open | None = None
        self._vendor_id = 0
        self._groups = 0
        self._references: list[str] = []
        self._rows: list[EsiRow] = []
        self._met = 0  # devices and modules, including omitted ones
        self._is_list = False
        self._parser = expat.ParserCreate(encoding)
        self._parser.buffer_text = True
        self._parser.XmlDeclHandler = self._declared
        self._parser.StartDoctypeDeclHandler = self._doctype
        defer = getattr(self._parser, "SetReparseDeferralEnabled", None)
        if defer is not None:
            defer(False)  # the end of a piece is reported before the next one begins
        self._look()

    def run(self) -> EsiCatalogue | None:
        try:
            self._feed()
        except expat.ExpatError as exc:
            self._failed(exc)
            return None
        except (ValueError, LookupError) as exc:
            self.out.add(
                "FSN118",
                Span(self._file, 1, 1),
                f"not readable as XML: {exc}",
                hint="save the file as UTF-8 and declare no other encoding",
            )
            return None
        except _Stop:
            return None
        return EsiCatalogue(
            encoding=self.encoding,
            is_list=self._is_list,
            references=tuple(self._references),
            rows=tuple(self._rows),
        )

    def _feed(self) -> None:
        view, seen = memoryview(self._data), 0
        for low, high in _pieces(self._data):
            self._left_out = low - seen
            self._parser.Parse(view[low:high], False)
            seen += high - low
        self._parser.Parse(b"", True)

    def _failed(self, error: expat.ExpatError) -> None:
        at = self._parser.ErrorByteIndex + self._left_out
        codes = expat.errors.codes
        bad = (
            codes[expat.errors.XML_ERROR_INVALID_TOKEN],
            codes[expat.errors.XML_ERROR_PARTIAL_CHAR],
        )
        span = self._span(at)
        if not self._forced and error.code in bad and self._data[at : at + 1] >= b"\x80":
            self.bad_text = span
        still_open = (self._path[-1], self._lines[-1]) if self._lines else None
        self.out.add(
            "FSN118",
            span,
            f"not well-formed XML: {expat.ErrorString(error.code)}",
            hint=xml_hint(error, self._data, at, still_open),
        )

    def _span(self, offset: int) -> Span:
        if self._places is None:
            self._places = _Places(self._data, self.encoding)
        try:
            return Span(self._file, *self._places.of(offset))
        except LookupError:  # unknown encoding
            return Span(self._file, 1, 1)

    def _here(self) -> Span:
        return self._span(self._parser.CurrentByteIndex + self._left_out)

    def _refuse(self, code: str, message: str, hint: str) -> None:
        self.out.add(code, self._here(), message, hint=hint)
        raise _Stop

    def _declared(self, _version: str, encoding: str | None, _alone: int) -> None:
        if encoding and not self._forced and not self._data.startswith(codecs.BOM_UTF8):
            self.encoding = encoding

    def _doctype(self, *_arguments: object) -> None:
        """Reject the declaration; expat reports it after its name, so search for its start."""
        behind = self._parser.CurrentByteIndex + self._left_out
        span = self._span(max(self._data.rfind(b"<!DOCTYPE", 0, behind), 0))
        hint = "delete <!DOCTYPE …>; entities are not used"
        self.out.add("FSN118", span, "a document type is declared", hint=hint)
        raise _Stop

    # -- the handlers that inspect
    # -------------------------------------------------------------------

    def _look(self) -> None:
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        parent = self._path[-1]
        if name not in _INSIDE.get(parent, ()):
            if parent == "":
                self._refuse_root(name)
            self._skipped = 1
            self._parser.StartElementHandler = self._skip_start
            self._parser.EndElementHandler = self._skip_end
            self._parser.CharacterDataHandler = None
            return
        self._path.append(name)
        span = self._here()
        self._lines.append(span.line)
        if name == "EtherCATInfoList":
            self._is_list = True
        elif name == "EtherCATInfo":
            self._groups += 1
            self._vendor_id = 0
        elif name in ("Device", "Module"):
            self._met += 1
            if self._met > MAX_ROWS:
                self._refuse("FSN103", f"more than {MAX_ROWS} devices", "is this an ESI file?")
            offset = self._parser.CurrentByteIndex + self._left_out
            self._open = _Open(name.lower(), offset, span, vendor=self._vendor_id)
        elif name in ("Id", "Name", "Type", "InfoReference"):
            self._text = []
            self._attributes = attributes

    def _refuse_root(self, name: str) -> None:
        known = words_of_root(name)
        hint = f"this is {known}" if known else "the root element of an ESI is <EtherCATInfo>"
        if name in _REFERRED:
            hint += "; name the ESI that refers to it"
        self._refuse("FSN140", f"<{name[:80]}> is not the root of an ESI file", hint)

    def _characters(self, text: str) -> None:
        if self._text is not None and len(self._text) < _MAX_PIECES:
            self._text.append(text)

    def _end(self, name: str) -> None:
        self._path.pop()
        self._lines.pop()
        text, self._text = shown_name("".join(self._text or ())[:_MAX_TEXT]), None
        if name in ("Device", "Module"):
            self._close()
        elif name == "Id" and self._path[-1] == "Vendor":
            self._of_vendor(text)
        elif name == "InfoReference":
            if len(self._references) < _MAX_REFERENCES:
                self._references.append(text)
        elif self._open is not None and name == "Type":
            self._open.type, self._open.attributes = text, self._attributes
        elif self._open is not None and name == "Name":
            english = self._attributes.get("LcId", "") == _ENGLISH
            if not self._open.name or (english and not self._open.english):
                self._open.name, self._open.english = text, english

    def _of_vendor(self, text: str) -> None:
        number = esi_number(text)
        if number is None or not 0 <= number <= 0xFFFFFFFF:
            hint = "write it as 2 or #x00000002"
            self.out.add(
                "FSN111", self._here(), f"vendor ID {text[:40]!r} is not a number", hint=hint
            )
            return
        self._vendor_id = number

    def _close(self) -> None:
        row, self._open = self._open, None
        if row is None:
            return
        is_module = row.kind == "module"
        key = "ModuleIdent" if is_module else "ProductCode"
        product = self._number(row, key)
        if product is None:
            return
        revision = None
        if not is_module and "RevisionNo" in row.attributes:
            revision = self._number(row, "RevisionNo")
        self._rows.append(
            EsiRow(
                kind=row.kind,
                vendor=row.vendor,
                product=product,
                revision=revision,
                type=row.type,
                name=row.name,
                group=self._groups,
                offset=row.offset,
                end=self._parser.CurrentByteIndex + self._left_out,
                line=row.span.line,
                column=row.span.column,
            )
        )

    def _number(self, row: _Open, key: str) -> int | None:
        """Return an attribute of ``Type`` as a number, or ``None`` with a finding."""
        text = row.attributes.get(key)
        what = row.kind
        if text is None:
            message = f"{what} {row.type[:80]!r} has no {key} and is left out"
            hint = f'add {key}="#x…" to its <Type>'
            self.out.add("FSN110", row.span, message, hint=hint, severity=Severity.WARNING)
            return None
        number = esi_number(text)
        if number is not None and 0 <= number <= 0xFFFFFFFF:
            return number
        message = f"{key} {text[:40]!r} of {what} {row.type[:80]!r} is not a number of 32 bits"
        self.out.add("FSN111", row.span, message, hint="write it as #x07703052")
        return None

    # -- the handlers that only count
    # ----------------------------------------------------------------

    def _skip_start(self, _name: str, _attributes: dict[str, str]) -> None:
        self._skipped += 1
        if self._skipped > MAX_DEPTH:
            self._refuse("FSN118", f"more than {MAX_DEPTH} levels of tags", "is this an ESI file?")

    def _skip_end(self, _name: str) -> None:
        self._skipped -= 1
        if not self._skipped:
            self._look()
