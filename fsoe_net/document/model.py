"""A document as data: sections of paragraphs, tables and pictures, which writers convert to pages.

Every number is a `Number` with its unit and its source, every judgement a `Verdict` with a word, so
that no meaning depends on colours. Texts may be of any origin: each writer escapes them.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass

from fsoe_net.diag.words import noun


class Level(enum.Enum):
    """Level of a verdict, which is shown by its mark and a word."""

    CLEAR = "clear"
    NOTE = "note"
    OPEN = "open"
    WARNING = "warning"
    ERROR = "error"


MARKS = {
    Level.CLEAR: "✔",
    Level.NOTE: "●",
    Level.OPEN: "○",
    Level.WARNING: "▲",
    Level.ERROR: "✖",
}
"""The marks of studio, see ``SIGNS`` in ``fsoe_net/studio/assets/html.js``."""


class Style(enum.Enum):
    """How text is set. ``BLANK``: a field that a person fills in by hand."""

    PLAIN = "plain"
    MUTED = "muted"
    STRONG = "strong"
    CODE = "code"
    BLANK = "blank"


@dataclass(frozen=True, slots=True)
class Text:
    """Text with a style."""

    text: str
    style: Style = Style.PLAIN


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A number as printed.

    Attributes:
        value: Unrounded value.
        text: Printed form, without the unit.
        unit: Empty only for identifiers, such as an address.
        source: Where it comes from, in words.
    """

    value: int | float
    text: str
    unit: str
    source: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """A judgement in words, with a level."""

    word: str
    level: Level


Item = Text | Number | Verdict
Cell = tuple[Item, ...]
"""The content of one cell, one item below the other."""

BLANK: Cell = (Text("", Style.BLANK),)


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading inside a section."""

    text: str


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Running text; ``note``: set off from the rest."""

    items: tuple[Item, ...]
    note: bool = False


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list; each row is running text."""

    rows: tuple[tuple[Item, ...], ...]


@dataclass(frozen=True, slots=True)
class Lines:
    """Lines without wrapping: commands to copy, recordings, bar charts of characters."""

    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Column:
    """Head of a column.

    Attributes:
        title: Description of its cells.
        number: Whether its cells are aligned like numbers.
        rank: A narrow terminal omits the columns of the highest rank first, and never those of rank
            0.
        wraps: Whether its cells are sentences that may take several lines of a terminal.
        share: Percent of the width of a page; 0 for the natural width.
    """

    title: str
    number: bool = False
    rank: int = 0
    wraps: bool = False
    share: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table.

    Attributes:
        name: Name, unique in its section, for readers of a JSON form.
        columns: Columns, as many as the cells of each row.
        rows: Cells.
        remark: Text below it.
    """

    name: str = ""
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    remark: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A picture.

    Attributes:
        title: Subject.
        words: Description of its content as a text alternative.
        svg: The picture.
        wide: Whether it takes a whole row.
        narrow: Replacement on a narrow screen; empty if it is the same.
        lines: Replacement on a terminal.
    """

    title: str
    words: str
    svg: str
    wide: bool = True
    narrow: str = ""
    lines: tuple[str, ...] = ()


Part = Heading | Paragraph | Bullets | Lines | Table | Picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """Parts below one title.

    Attributes:
        key: Its anchor on a page and its name in a JSON form.
        title: Subject.
        parts: Content.
        page: Whether it begins a printed page.
        appendix: Whether it comes after the numbered sections, with a letter.
    """

    key: str
    title: str
    parts: tuple[Part, ...]
    page: bool = False
    appendix: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A whole document; empty parts are omitted.

    Attributes:
        title: Subject.
        subtitle: Type of document.
        title_block: Facts about the document next to its title.
        logo: A picture for its title, as a ``data:`` address.
        version: Version of fsoe-net.
        seal: Short code of the configuration, on each printed page.
        verdict: The verdict at the top.
        lead: Parts before the first section.
        sections: In their order.
        foot: Text at the foot of each printed page.
        numbered: Whether sections have numbers, with a table of contents.
        landscape: Whether it is printed in landscape format.
    """

    title: str = ""
    subtitle: str = ""
    title_block: Table | None = None
    logo: str = ""
    version: str = ""
    seal: str = ""
    verdict: Verdict | None = None
    lead: tuple[Part, ...] = ()
    sections: tuple[Section, ...] = ()
    foot: str = ""
    numbered: bool = False
    landscape: bool = False


def section_marks(sections: Sequence[Section]) -> list[str]:
    """Return the number of each section, ``1`` …, and the letter of each appendix, ``A`` …."""
    main = sum(not s.appendix for s in sections)
    return [chr(ord("A") + n - main) if s.appendix else str(n + 1) for n, s in enumerate(sections)]


# -- helpers for cells ---------------------------------------------------------------------------


def cell(*items: Item | str) -> Cell:
    """Return a cell; a plain string is plain text."""
    return tuple(Text(i) if isinstance(i, str) else i for i in items)


def words(*items: Item | str, note: bool = False) -> Paragraph:
    """Return a paragraph; a plain string is plain text."""
    return Paragraph(cell(*items), note=note)


def muted(text: str) -> Text:
    """Return text with less emphasis."""
    return Text(text, Style.MUTED)


def strong(text: str) -> Text:
    """Return text with more emphasis."""
    return Text(text, Style.STRONG)


def code(text: str) -> Text:
    """Return text of a file or a screen."""
    return Text(text, Style.CODE)


def decimal(value: float, digits: int = 2) -> str:
    """Return a number rounded to some decimal places, without trailing zeros."""
    text = f"{value:.{digits}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def outward(value: float, digits: int = 2, *, up: bool) -> float:
    """Round a bound so that it remains valid.

    A minimum and a judged time are rounded up, a maximum down: at most 49.996 ms must not be shown
    as 50 ms. Floating-point errors are ignored.
    """
    factor: float = 10**digits
    scaled = round(value * factor, 6)
    return (math.ceil(scaled) if up else math.floor(scaled)) / factor


def number_of(value: float | None, word: str, source: str, text: str = "") -> Item:
    """Return `stated` with a word as the unit, in the singular or plural.

    Args:
        value: The number.
        word: The unit, in the singular.
        source: Source of the number.
        text: Printed form of the number; decimal if empty.
    """
    return stated(value, "" if value is None else noun(value, word), source, text)


def stated(value: float | None, unit: str, source: str, text: str = "") -> Item:
    """Return a number, or a text that it is not stated.

    Args:
        value: The number.
        unit: Its unit.
        source: Source of the number.
        text: Printed form of the number; decimal if empty.
    """
    if value is None:
        return Verdict("not stated", Level.OPEN)
    shown = text or (str(value) if isinstance(value, int) else decimal(value))
    return Number(value=value, text=shown, unit=unit, source=source)
