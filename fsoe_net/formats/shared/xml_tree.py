"""Parses XML into elements with file, line and column; rejects entities and DTDs."""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import field
from xml.parsers import expat

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.diag.printable import printable
from fsoe_net.formats.shared.files import Collector

MAX_DEPTH = 200
MAX_ELEMENTS = 500_000
MAX_TEXT_PIECES = 3_000_000  # expat passes each line of text separately

_BYTE_ORDER_MARKS = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_ENCODING_HINT = "save the file as UTF-8 and declare no other encoding"
_HINTS = {
    "XML_ERROR_NO_ELEMENTS": "the file is empty or cut off",
    "XML_ERROR_UNCLOSED_TOKEN": "close this tag, comment or quote; the file may be cut off",
    "XML_ERROR_UNCLOSED_CDATA_SECTION": "close it with ]]>",
    "XML_ERROR_PARTIAL_CHAR": _ENCODING_HINT,
    "XML_ERROR_DUPLICATE_ATTRIBUTE": "delete one of the two attributes",
    "XML_ERROR_JUNK_AFTER_DOC_ELEMENT": "a file has one root element; delete the text after it",
    "XML_ERROR_UNDEFINED_ENTITY": "write &amp; for a plain &",
    "XML_ERROR_BAD_CHAR_REF": "this character number is not allowed in XML; delete it",
    "XML_ERROR_MISPLACED_XML_PI": "<?xml …?> must be the very first bytes of the file",
    "XML_ERROR_UNKNOWN_ENCODING": _ENCODING_HINT,
    "XML_ERROR_INCORRECT_ENCODING": _ENCODING_HINT,
}
_HINT_OF_CODE = {
    expat.errors.codes[getattr(expat.errors, name)]: hint for name, hint in _HINTS.items()
}
_INVALID_TOKEN = expat.errors.codes[expat.errors.XML_ERROR_INVALID_TOKEN]
_TAG_MISMATCH = expat.errors.codes[expat.errors.XML_ERROR_TAG_MISMATCH]


@dataclass(slots=True, eq=False)
class Element:
    """One element. ``text`` is its own character data, ``text_span`` the place of its first word.

    Not frozen: built while parsing, children before their parent is complete.
    """

    name: str
    attributes: dict[str, str]
    span: Span
    children: list[Element] = field(default_factory=list)
    text: str = ""
    text_span: Span | None = None

    def all(self, name: str) -> list[Element]:
        """Return the direct children with this name."""
        return [c for c in self.children if c.name == name]

    def first(self, name: str) -> Element | None:
        """Return the first direct child with this name, or ``None``."""
        return next((c for c in self.children if c.name == name), None)

    def text_of(self, name: str) -> str:
        """Return the words of the first child with this name; empty if there is none."""
        child = self.first(name)
        return "" if child is None else child.words

    def walk(self) -> Iterator[Element]:
        """Yield this element and all its descendants, in document order."""
        stack = [self]
        while stack:
            element = stack.pop()
            yield element
            stack.extend(reversed(element.children))

    @property
    def words(self) -> str:
        """The text as a printable name on one line."""
        return shown_name(self.text)

    @property
    def value_span(self) -> Span:
        """The place of the text, or of the element if it has no text."""
        return self.text_span or self.span


def shown_name(text: str) -> str:
    """Return character data as a printable name on one line."""
    return printable(re.sub(r"\s*[\r\n]\s*", " ", text.strip()))


def shown_attributes(attributes: dict[str, str]) -> dict[str, str]:
    """Return printable attributes: they contain names and numbers on a single line."""
    return {name: printable(value) for name, value in attributes.items()}


Closed = Callable[[Element, Element, int], bool]


class _Refused(Exception):
    """The document was rejected; the finding has been added."""


def parse_xml(
    data: bytes,
    path: str | os.PathLike[str],
    out: Collector,
    *,
    what: str = "a robot description",
    encoding: str | None = None,
    skip: frozenset[str] = frozenset(),
    begin: Span | None = None,
    closed: Closed | None = None,
) -> Element | None:
    """Parse a document, or one element cut out of a larger one.

    Args:
        data: The bytes of the file; UTF-8, or as in its byte order mark or declaration.
        path: The file, for places.
        out: Takes FSN118 if the document is rejected.
        what: Expected type of the file, for the hint if it is far too large.
        encoding: Encoding of an extracted element, which has no declaration.
        skip: Names of elements to omit with all their content.
        begin: Start of an extracted element.
        closed: Called with each element at its end, its parent and its depth (1 for the children of
            the root). If it returns true, the element is freed, so that a long file needs little
            memory.

    Returns:
        The root element, or ``None`` with a finding.
    """
    shown = os.fspath(path)
    builder = _Builder(shown, data, out, what=what, encoding=encoding, skip=skip, begin=begin)
    builder.closed = closed
    try:
        return builder.parse()
    except expat.ExpatError as exc:
        builder.refused(exc)
    except (ValueError, LookupError) as exc:
        out.add("FSN118", Span(shown, 1, 1), f"not readable as XML: {exc}", hint=_ENCODING_HINT)
    except _Refused:
        pass
    return None


class _Builder:
    """Feeds expat and keeps its own stack of open elements with their text."""

    def __init__(
        self,
        file: str,
        data: bytes,
        out: Collector,
        *,
        what: str,
        encoding: str | None,
        skip: frozenset[str],
        begin: Span | None,
    ) -> None:
        self.closed: Closed | None = None
        self._file = file
        self._data = data
        self._what = what
        self._skip = skip
        self._skipped = 0  # open elements inside a skipped one
        self._begin = begin or Span(file, 1, 1)
        # expat counts a byte order mark as a column of the first line; editors do not show it.
        self._mark = int(data.startswith(_BYTE_ORDER_MARKS))
        self._out = out
        self._stack: list[tuple[Element, list[str]]] = []
        self._root: Element | None = None
        self._elements = 0
        self._pieces = 0
        self._parser = expat.ParserCreate(encoding)
        # Unbuffered, so that the position at a piece of text is where it starts.
        self._parser.buffer_text = False
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.StartDoctypeDeclHandler = self._doctype

    def parse(self) -> Element | None:
        self._parser.Parse(self._data, True)
        return self._root

    def refused(self, error: expat.ExpatError) -> None:
        """Record an error of expat."""
        at = self._parser.ErrorByteIndex
        top = self._stack[-1][0] if self._stack else None
        name = (top.name, top.span.line) if top is not None else None
        self._out.add(
            "FSN118",
            self.place(error.lineno, error.offset),
            f"not well-formed XML: {expat.ErrorString(error.code)}",
            hint=xml_hint(error, self._data, at, name),
        )

    def place(self, line: int, offset: int) -> Span:
        """Return the place for a line and an offset as counted by expat."""
        if line > 1:
            return Span(self._file, line + self._begin.line - 1, offset + 1)
        column = offset + self._begin.column - self._mark
        return Span(self._file, self._begin.line, max(column, 1))

    def _here(self) -> Span:
        return self.place(self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber)

    def _refuse(self, message: str, hint: str, span: Span | None = None) -> None:
        self._out.add("FSN118", span or self._here(), message, hint=hint)
        raise _Refused

    def _doctype(self, *_arguments: object) -> None:
        """Reject the declaration; expat reports it after its name, so search for its start."""
        before = self._data[: self._parser.CurrentByteIndex]
        start = before.rfind(b"<!DOCTYPE")
        span = None
        if start >= 0:
            line = before.count(b"\n", 0, start) + 1
            begin = before.rfind(b"\n", 0, start) + 1
            span = self.place(line, len(before[begin:start].decode("utf-8", "replace")))
        message = "a document type is declared"
        self._refuse(message, "delete <!DOCTYPE …>; entities are not used", span)

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._elements += 1
        if len(self._stack) + self._skipped >= MAX_DEPTH:
            self._refuse(f"more than {MAX_DEPTH} levels of tags", f"is this {self._what}?")
        if self._skipped or name in self._skip:
            self._skipped += 1
            return
        if self._elements > MAX_ELEMENTS:
            self._refuse(f"more than {MAX_ELEMENTS} tags", f"is this {self._what}?")
        element = Element(name, shown_attributes(attributes), self._here())
        if self._stack:
            self._stack[-1][0].children.append(element)
        else:
            self._root = element
        self._stack.append((element, []))

    def _end(self, _name: str) -> None:
        if self._skipped:
            self._skipped -= 1
            return
        element, pieces = self._stack.pop()
        element.text = "".join(pieces)
        if self.closed is not None and self._stack:
            parent = self._stack[-1][0]
            if self.closed(element, parent, len(self._stack)):
                parent.children.pop()
                self._elements -= sum(1 for _ in element.walk()) if element.children else 1

    def _characters(self, text: str) -> None:
        if self._skipped:
            return
        self._pieces += 1
        if self._pieces > MAX_TEXT_PIECES:
            self._refuse(f"more than {MAX_TEXT_PIECES} lines", f"is this {self._what}?")
        element, pieces = self._stack[-1]
        pieces.append(text)
        if element.text_span is None and not text.isspace():
            # expat reports where the piece starts, and ends a piece at each line.
            here = self._here()
            blanks = len(text) - len(text.lstrip())
            element.text_span = Span(self._file, here.line, here.column + blanks)


def xml_hint(
    error: expat.ExpatError, data: bytes, at: int, still_open: tuple[str, int] | None
) -> str:
    """Return a hint for an error of expat.

    Args:
        error: The error of expat.
        data: The bytes that it read.
        at: Byte where it stopped.
        still_open: Name and line of the innermost open element.
    """
    if error.code in _HINT_OF_CODE:
        return _HINT_OF_CODE[error.code]
    if error.code == _INVALID_TOKEN:
        return _invalid_token_hint(data[max(at - 1, 0) : at], data[at : at + 1])
    if still_open is None:
        return "look for a tag that is closed but was never opened"
    verb = "close it before this tag" if error.code == _TAG_MISMATCH else "close it"
    return f"<{still_open[0]}> of line {still_open[1]} is still open here; {verb}"


def _invalid_token_hint(before: bytes, byte: bytes) -> str:
    if byte == b"\0":
        return "delete the NUL byte; is this a text file?"
    if byte >= b"\x80":
        return _ENCODING_HINT
    if b"&" in (before, byte):
        return "write &amp; for a plain &"
    if b"<" in (before, byte):
        return "write &lt; for a plain <, or close the tag or quote before it"
    return "look at this character and the tag around it; quotes around attribute values?"
