"""The signal path of a safety function as a picture: its parts, and the FSoE connections between.

Parts of one kind share a column. On a narrow screen the columns become rows.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from fsoe_net.diag.words import listed
from fsoe_net.document.markup import escape, svg_text
from fsoe_net.document.model import MARKS, Level, Picture
from fsoe_net.model.resolve import Connection
from fsoe_net.model.safety import ElementKind
from fsoe_net.timing.elements import Apart, ElementRow, FunctionParts
from fsoe_net.timing.reaction import FunctionBudget
from fsoe_net.timing.ways import watchdog_of

_ELEMENT, _BUS, _GAP, _NARROW = 106, 90, 16, 330  # widths
_BETWEEN, _LINE, _PAD = 10, 14, 6  # heights
_MOST_BLOCKS, _MOST_LINES = 5, 6  # of a column, and of a name
_SHORTEST_WORD = 3  # before a line break, in letters
_WIDE_LETTERS, _THIN_LETTERS = frozenset("MWmw@%&"), frozenset("iIjlt.,:;'|!()[] ")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Block:
    """A box. ``facts``: lines below its name; ``words``: the block in the text alternative."""

    head: str
    name: str
    facts: tuple[str, ...]
    words: str
    is_bus: bool = False


_Column = tuple[_Block, ...]


def function_picture(row: FunctionBudget) -> Picture:
    """Draw the signal path of a safety function."""
    columns = [c for c in _columns(row.parts) if c]
    words = " → ".join(listed([b.words for b in column]) for column in columns)
    return Picture(
        title="Signal path",
        words=words or "no parts are stated",
        svg=_svg(columns, is_narrow=False),
        narrow=_svg(columns, is_narrow=True),
    )


def _columns(parts: FunctionParts) -> Iterator[_Column]:
    """Yield the columns in the order of the signal; some may be empty."""
    before, after = list(parts.to_input), list(parts.to_output)
    has_logic = any(r.element.kind is ElementKind.LOGIC for r in parts.rows)
    # Without a logic between them, both ways are one column.
    if not has_logic:
        before, after = list({c.name: c for c in (*before, *after)}.values()), []
    for kind in ElementKind:
        own = tuple(_element(r) for r in parts.rows if r.element.kind is kind)
        ends = {r.element.sub for r in parts.rows if r.element.kind is kind}
        apart = tuple(_apart(a) for a in parts.apart if a.end in ends)
        if kind is ElementKind.OUTPUT:
            yield (*map(_connection, after), *apart)
        yield own
        if kind is ElementKind.INPUT:
            yield (*map(_connection, before), *apart)


def _element(row: ElementRow) -> _Block:
    e, time, pfh = row.element, row.time, row.pfh
    opened = MARKS[Level.OPEN]
    facts = [
        f"{opened} no time" if time.value is None else f"{time.value:g} ms",
        f"{opened} no PFH" if pfh.value is None else f"PFH {pfh.value:.2e}/h",
        f"{opened} no claim" if row.has_no_claim else row.claim,
    ]
    if any(q.value is not None and not q.answered_for for q in (time, pfh)):
        facts.append(f"{opened} unverified")
    if e.sub and e.sub != e.name:
        facts.insert(0, f"of {e.sub}")
    return _Block(head=e.kind.value, name=e.name, facts=tuple(filter(None, facts)), words=e.name)


def _connection(c: Connection) -> _Block:
    ms = watchdog_of(c)
    watchdog = f"{MARKS[Level.OPEN]} no watchdog" if ms is None else f"watchdog {ms:g} ms"
    return _Block(
        head="FSoE", name=c.name, facts=(watchdog,), words=f"{c.name} ({watchdog})", is_bus=True
    )


def _apart(apart: Apart) -> _Block:
    name = f"{MARKS[Level.ERROR]} no connection of {apart.end}"
    return _Block(head="FSoE", name=name, facts=(), words=apart.words, is_bus=True)


def _most(column: _Column) -> _Column:
    """Return a column that fits on a page."""
    more = len(column) - _MOST_BLOCKS
    if more <= 0:
        return column
    last = _Block(head="", name=f"and {more} more", facts=(), words="", is_bus=column[0].is_bus)
    return (*column[:_MOST_BLOCKS], last)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Box:
    """A block with its place."""

    block: _Block
    x: float
    y: float
    width: float
    height: float


def _svg(columns: Sequence[_Column], *, is_narrow: bool) -> str:
    columns = [_most(c) for c in columns]
    stages, width, height = _stacked(columns) if is_narrow else _side_by_side(columns)
    parts = [
        f'<svg viewBox="0 0 {width:g} {height:g}" style="max-width:{width:g}px" role="img" '
        'aria-label="Signal path">'
    ]
    for left, right in pairwise(stages):
        parts.append(_arrows(left, right, is_narrow=is_narrow))
    parts += [_drawn(box) for stage in stages for box in stage]
    return "".join([*parts, "</svg>"])


_Placed = tuple[list[list[_Box]], float, float]


def _side_by_side(columns: Sequence[_Column]) -> _Placed:
    """Place one column next to the other, each in the middle of the height."""
    widths = [_BUS if column[0].is_bus else _ELEMENT for column in columns]
    heights = [
        sum(_height(b, wide) + _BETWEEN for b in column) - _BETWEEN
        for column, wide in zip(columns, widths, strict=True)
    ]
    height = max(heights, default=0)
    stages, x = [], 1.0
    for column, wide, own in zip(columns, widths, heights, strict=True):
        stages.append(_below(column, x, 1 + (height - own) / 2, wide))
        x += wide + _GAP
    return stages, max(x - _GAP, 0) + 1, height + 2


def _stacked(columns: Sequence[_Column]) -> _Placed:
    """Place one column below the other."""
    stages, y = [], 1.0
    for column in columns:
        stages.append(_below(column, 1, y, _NARROW))
        y = stages[-1][-1].y + stages[-1][-1].height + _GAP
    return stages, _NARROW + 2, max(y - _GAP, 0) + 1


def _below(column: _Column, x: float, y: float, width: float) -> list[_Box]:
    boxes = []
    for block in column:
        high = _height(block, width)
        boxes.append(_Box(block=block, x=x, y=y, width=width, height=high))
        y += high + _BETWEEN
    return boxes


def _height(block: _Block, width: float) -> float:
    return 2 * _PAD + _LINE * len(_lines(block, width))


def _lines(block: _Block, width: float) -> list[tuple[str, str]]:
    """Return the lines of a block, each with its class."""
    space = width - 2 * _PAD
    names = [("label", line) for line in _wrapped(block.name, space / 12)]
    facts = [("tiny", line) for fact in block.facts for line in _wrapped(fact, space / 9.9)]
    return [*([("tiny", block.head)] if block.head else []), *names, *facts]


def _drawn(box: _Box) -> str:
    kind = "sm" if box.block.is_bus else "box"
    lines = [
        svg_text(box.x + box.width / 2, box.y + _PAD + _LINE * n + 11, line, "middle", cls)
        for n, (cls, line) in enumerate(_lines(box.block, box.width))
    ]
    return (
        f"<g><title>{escape(box.block.words or box.block.name)}</title>"
        f'<rect x="{box.x:g}" y="{box.y:g}" width="{box.width:g}" height="{box.height:g}" '
        f'rx="6" class="{kind}"/>{"".join(lines)}</g>'
    )


def _arrows(left: Sequence[_Box], right: Sequence[_Box], *, is_narrow: bool) -> str:
    """Draw the way of the signal from each box of a column to each of the next."""
    if is_narrow:
        x, end = left[-1].x + left[-1].width / 2, right[0].y
        return _line(f"M{x:g},{left[-1].y + left[-1].height:g}V{end:g}") + _head(x, end, "v")
    middle = right[0].x - _GAP / 2
    starts, ends = [_mid(b) for b in left], [_mid(b) for b in right]
    both = [*starts, *ends]
    path = "".join(f"M{left[0].x + left[0].width:g},{y:g}H{middle:g}" for y in starts)
    path += f"M{middle:g},{min(both):g}V{max(both):g}"
    path += "".join(f"M{middle:g},{y:g}H{right[0].x:g}" for y in ends)
    return _line(path) + "".join(_head(right[0].x, y, "h") for y in ends)


def _mid(box: _Box) -> float:
    return box.y + box.height / 2


def _line(path: str) -> str:
    return f'<path d="{path}" class="arc" style="stroke:var(--soft)"/>'


def _head(x: float, y: float, way: str) -> str:
    sides = "l-7,-4v8z" if way == "h" else "l-4,-7h8z"
    return f'<path d="M{x:g},{y:g}{sides}" style="fill:var(--soft)"/>'


def _wrapped(text: str, most: float) -> list[str]:
    """Return a text in lines of a width in units of its font size; a long text ends in …."""
    lines, line, wide = [], "", 0.0
    for letter in text:
        own = _width(letter)
        if wide + own > most and line:
            cut = _cut(line)
            lines.append(line[:cut].strip())
            line = line[cut:].lstrip()
            wide = sum(map(_width, line))
            if len(lines) == _MOST_LINES:
                return [*lines[:-1], f"{lines[-1][:-1]}…"]
        line += letter
        wide += own
    return [*lines, line.strip()] if line.strip() else lines


def _cut(line: str) -> int:
    """Return where a line may end: after its last space, hyphen or underscore, or at its end."""
    last = max(line.rfind(sign) for sign in " -_/")
    return last + 1 if last >= _SHORTEST_WORD else len(line)


def _width(letter: str) -> float:
    """Return the width of a letter in units of its font size, for a bold font without serifs."""
    if letter in _WIDE_LETTERS or unicodedata.east_asian_width(letter) in "WF":
        return 1.15
    if letter in _THIN_LETTERS:
        return 0.42
    return 0.8 if letter.isupper() else 0.66
