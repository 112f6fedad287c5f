"""The report as data: blocks of paragraphs, tables and pictures; writers turn it into pages.

Every number is a `Number` with its unit and its source, every judgement a `Verdict` with a word, so
that no writer needs colours to say anything. What is open or assumed is a `Point` of the block that
knows it; `Document.points` gathers them, and no writer leaves them out.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import Diagnostic

__all__ = [
    "BLANK",
    "Block",
    "Bullets",
    "Cell",
    "Column",
    "Document",
    "Heading",
    "Item",
    "Level",
    "Number",
    "Paragraph",
    "Part",
    "Picture",
    "Point",
    "PointKind",
    "Style",
    "Table",
    "Text",
    "Verdict",
    "cell",
    "code",
    "decimal",
    "muted",
    "stated",
    "strong",
]


class Level(enum.Enum):
    """How a verdict has to be read; each writer gives it a mark and a word."""

    CLEAR = "clear"
    NOTE = "note"
    OPEN = "open"
    WARNING = "warning"
    ERROR = "error"


class Style(enum.Enum):
    """How a text is set. ``BLANK``: a field that a person fills in by hand."""

    PLAIN = "plain"
    MUTED = "muted"
    STRONG = "strong"
    CODE = "code"
    BLANK = "blank"


@dataclass(frozen=True, slots=True)
class Text:
    """Words."""

    text: str
    style: Style = Style.PLAIN


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A number as printed.

    Attributes:
        value: Unrounded.
        text: As it is printed, without the unit.
        unit: Empty only for what is a name, such as an address.
        source: Where it comes from, in words.
    """

    value: int | float
    text: str
    unit: str
    source: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """A judgement in words."""

    word: str
    level: Level


Item = Text | Number | Verdict
Cell = tuple[Item, ...]
"""What stands in one cell, one below the other."""

BLANK: Cell = (Text("", Style.BLANK),)


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading inside a block."""

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
class Column:
    """Head of a column; ``number``: its cells are aligned as numbers are."""

    title: str
    number: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table.

    Attributes:
        name: What it is, unique in its block, for readers of the JSON form.
        columns: As many as each row has cells.
        rows: Cells.
        remark: Words below it.
    """

    name: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    remark: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A picture. ``words`` say what it shows for those who do not see it; ``wide``: a whole row.

    ``narrow`` takes its place on a narrow screen; empty where it is the same.
    """

    title: str
    words: str
    svg: str
    wide: bool = True
    narrow: str = ""


Part = Heading | Paragraph | Bullets | Table | Picture


class PointKind(enum.Enum):
    """What a point asks of the reader."""

    OPEN = "open"
    ASSUMPTION = "assumption"


@dataclass(frozen=True, slots=True)
class Point:
    """Something that is not settled, or that is taken for granted."""

    kind: PointKind
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """One of the blocks of a report; ``key`` names it in the JSON form."""

    key: str
    title: str
    parts: tuple[Part, ...]
    points: tuple[Point, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A whole report.

    Attributes:
        project: Name of the machine; that of the network when none is stated.
        network: Name of the network.
        version: Of fsoe-net.
        short: Short code of the fingerprint; empty when there is no plan.
        whole: The fingerprint, hex.
        verdict: What stands on top.
        lead: First page: what was found, and how much is open.
        blocks: In the order of the report.
        points: What is open or assumed, of all blocks, each with the title of its block.
        findings: What the blocks and points say about findings, as the data they are.
        against: What the first page holds against the network beside findings, each with the title
            of its block; empty where findings are errors.
    """

    project: str
    network: str
    version: str
    short: str
    whole: str
    verdict: Verdict
    lead: tuple[Part, ...]
    blocks: tuple[Block, ...]
    points: tuple[tuple[str, Point], ...]
    findings: tuple[Diagnostic, ...] = ()
    against: tuple[tuple[str, Verdict], ...] = ()


# -- short ways to write cells --------------------------------------------------------------------


def cell(*items: Item | str) -> Cell:
    """Return a cell; a plain string is plain text."""
    return tuple(Text(i) if isinstance(i, str) else i for i in items)


def muted(text: str) -> Text:
    """Return text of less weight."""
    return Text(text, Style.MUTED)


def strong(text: str) -> Text:
    """Return text of more weight."""
    return Text(text, Style.STRONG)


def code(text: str) -> Text:
    """Return text as in a file or on a screen."""
    return Text(text, Style.CODE)


def decimal(value: float, digits: int = 2) -> str:
    """Return a number rounded to some digits behind the point, without zeros at its end."""
    text = f"{value:.{digits}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def outward(value: float, digits: int = 2, *, up: bool) -> float:
    """Round a bound to the side on which it still holds.

    A least value and a time that is judged go up, a greatest value goes down: 49.996 ms at most
    must not be shown as 50 ms. What floating point is off does not count.
    """
    factor: float = 10**digits
    scaled = round(value * factor, 6)
    return (math.ceil(scaled) if up else math.floor(scaled)) / factor


def stated(value: float | None, unit: str, source: str, text: str = "") -> Item:
    """Return a number, or that it is not stated.

    Args:
        value: The number.
        unit: Its unit.
        source: Where it comes from.
        text: How it is printed; in decimal form when empty.
    """
    if value is None:
        return Verdict("not stated", Level.OPEN)
    shown = text or (str(value) if isinstance(value, int) else decimal(value))
    return Number(value=value, text=shown, unit=unit, source=source)
