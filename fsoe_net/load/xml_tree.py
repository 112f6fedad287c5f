"""XML into elements that know their file, line and column; entities and DTDs are refused."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from fsoe_net.diag import Span
from fsoe_net.load.files import Collector

__all__ = ["Element", "parse_xml"]

MAX_DEPTH = 200
MAX_ELEMENTS = 500_000


@dataclass(slots=True, eq=False)
class Element:
    """One element. ``text`` is its own character data, ``text_span`` where that starts."""

    name: str
    attributes: dict[str, str]
    span: Span
    children: list[Element] = field(default_factory=list)
    text: str = ""
    text_span: Span | None = None

    def all(self, name: str) -> list[Element]:
        """Return the direct children of that name."""
        return [c for c in self.children if c.name == name]

    def first(self, name: str) -> Element | None:
        """Return the first direct child of that name, or ``None``."""
        return next((c for c in self.children if c.name == name), None)

    def walk(self) -> Iterator[Element]:
        """Yield this element and everything below, in document order."""
        stack = [self]
        while stack:
            element = stack.pop()
            yield element
            stack.extend(reversed(element.children))

    @property
    def value(self) -> str:
        """The text without white space around it."""
        return self.text.strip()

    @property
    def value_span(self) -> Span:
        """Place of the text, else of the element."""
        return self.text_span or self.span


class _Refused(Exception):
    """The document was refused; the finding is already recorded."""


def parse_xml(data: bytes, path: str | os.PathLike[str], out: Collector) -> Element | None:
    """Parse a document; ``None`` with FSN118 when it is refused."""
    builder = _Builder(os.fspath(path), out)
    try:
        return builder.parse(data)
    except expat.ExpatError as exc:
        reason = expat.ErrorString(exc.code)
        hint = "a tag is not closed, or the file is cut off"
        if exc.code == expat.errors.codes[expat.errors.XML_ERROR_TAG_MISMATCH]:
            hint = builder.open_tag_hint()
        span = Span(os.fspath(path), exc.lineno, exc.offset + 1)
        out.add("FSN118", span, f"not well-formed XML: {reason}", hint=hint)
    except (ValueError, LookupError) as exc:
        out.add("FSN118", Span(os.fspath(path), 1, 1), f"not XML: {exc}", hint="save it as UTF-8")
    except _Refused:
        pass
    return None


class _Builder:
    """Feeds expat and keeps an own stack."""

    def __init__(self, file: str, out: Collector) -> None:
        self._file = file
        self._out = out
        self._stack: list[Element] = []
        self._root: Element | None = None
        self._count = 0
        self._parser = expat.ParserCreate()
        # Unbuffered, so that the position at a piece of text is where it starts.
        self._parser.buffer_text = False
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.StartDoctypeDeclHandler = self._doctype

    def parse(self, data: bytes) -> Element | None:
        self._parser.Parse(data, True)
        return self._root

    def open_tag_hint(self) -> str:
        if not self._stack:
            return "a tag is closed that was never opened"
        top = self._stack[-1]
        return f"<{top.name}> of line {top.span.line} is still open here"

    def _here(self) -> Span:
        parser = self._parser
        return Span(self._file, parser.CurrentLineNumber, parser.CurrentColumnNumber + 1)

    def _refuse(self, message: str, hint: str) -> None:
        self._out.add("FSN118", self._here(), message, hint=hint)
        raise _Refused

    def _doctype(self, *_arguments: object) -> None:
        self._refuse("a document type is declared", "delete <!DOCTYPE …>; entities are not used")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if len(self._stack) >= MAX_DEPTH or self._count > MAX_ELEMENTS:
            self._refuse(
                f"more than {MAX_DEPTH} levels or {MAX_ELEMENTS} elements", "is this a robot?"
            )
        element = Element(name, attributes, self._here())
        if self._stack:
            self._stack[-1].children.append(element)
        else:
            self._root = element
        self._stack.append(element)

    def _end(self, _name: str) -> None:
        self._stack.pop()

    def _characters(self, text: str) -> None:
        top = self._stack[-1]
        if not top.text.strip() and text.strip():
            # expat reports where the text starts; skip the white space before the first word.
            before = text[: len(text) - len(text.lstrip())]
            here = self._here()
            lines = before.count("\n")
            column = here.column + len(before) if not lines else len(before.rsplit("\n", 1)[1]) + 1
            top.text_span = Span(self._file, here.line + lines, column)
        top.text += text
