"""A robot as a picture: controllers left, joints in the middle, channels and SubDevices right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fsoe_net.document.markup import escape, shortened, svg_text
from fsoe_net.document.model import MARKS, Level
from fsoe_net.report.robot_boxes import End, EndState, RobotBox, RobotGraph, SafetyWire, Wire

_MARGIN, _BOX, _GAP, _SAFETY = 12, 240, 120, 170  # widths
_HEAD, _ROW, _PAD, _BETWEEN, _LEGEND = 42, 20, 6, 14, 44  # heights
_PORT, _STUB = 10, 26
_MOST_BOXES, _MOST_ENDS = 100, 40  # of a column, and of a box
_LETTERS = 24  # of a name in a box
_SIGNS = {
    EndState.BOUND: "",
    EndState.OPEN: f"{MARKS[Level.OPEN]} ",
    EndState.WRONG: f"{MARKS[Level.ERROR]} ",
}
_COMMAND = 'style="stroke:var(--c0);stroke-width:1.6"'
_STATE = 'style="stroke:var(--c2);stroke-width:1.6" stroke-dasharray="6 3"'
_SAFE = 'style="stroke:var(--c4);stroke-width:3"'
_WRONG = 'style="stroke:var(--red)" stroke-dasharray="2 4"'

_Place = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Placed:
    """A box with its place; a missing end has the place of the row that counts the others."""

    box: RobotBox
    x: float
    y: float
    cls: str

    @property
    def ends(self) -> tuple[End, ...]:
        return self.box.ends[:_MOST_ENDS]

    @property
    def more(self) -> int:
        return len(self.box.ends) - len(self.ends)

    @property
    def height(self) -> int:
        rows = len(self.ends) + bool(self.more)
        return _HEAD + _ROW * rows + _PAD * bool(rows)

    def port(self, end: int, *, is_right: bool) -> _Place:
        row = min(end, len(self.ends))
        return self.x + _BOX * is_right, self.y + _HEAD + _ROW * row + _ROW / 2


def robot_picture(graph: RobotGraph) -> str:
    """Draw a robot: each interface from the controller to the channel, and FSoE connections."""
    columns, x = [], float(_MARGIN)
    for boxes, cls in (
        (graph.controllers, "box"),
        (graph.components, "box main"),
        (graph.subdevices, "box sub"),
    ):
        columns.append(_column(boxes[:_MOST_BOXES], x, cls))
        x += (_BOX + _GAP) * bool(boxes)
    width = x - _GAP + _SAFETY * bool(graph.safety) + _MARGIN
    bottom = max((b.y + b.height for column in columns for b in column), default=0)
    left_out = sum(
        max(len(boxes) - _MOST_BOXES, 0)
        for boxes in (graph.controllers, graph.components, graph.subdevices)
    )
    controllers, components, subdevices = columns
    parts = [*_lines(graph.claims, controllers, components)]
    parts += _lines(graph.bindings, components, subdevices)
    parts += [part for n, line in enumerate(graph.safety) for part in _safety(line, subdevices, n)]
    parts += [part for column in columns for placed in column for part in _drawn(placed)]
    parts += _legend(bottom + _BETWEEN, left_out)
    return (
        f'<svg viewBox="0 0 {width:g} {bottom + _LEGEND:g}" style="max-width:{width:g}px" '
        f'role="img" aria-label="{escape(graph.words)}">{"".join(parts)}</svg>'
    )


def _column(boxes: Sequence[RobotBox], x: float, cls: str) -> list[_Placed]:
    column, y = [], float(_MARGIN)
    for box in boxes:
        column.append(_Placed(box=box, x=x, y=y, cls=cls))
        y += column[-1].height + _BETWEEN
    return column


def _drawn(placed: _Placed) -> list[str]:
    box, x, y = placed.box, placed.x, placed.y
    parts = [
        f"<g><title>{escape(shortened(f'{box.name}: {box.about}', 200))}</title>"
        f'<rect x="{x:g}" y="{y:g}" width="{_BOX}" height="{placed.height}" rx="6" '
        f'class="{placed.cls}"/>',
        svg_text(x + 12, y + 19, shortened(box.name, _LETTERS), "start", "name"),
        svg_text(x + 12, y + 35, shortened(box.about, 34), "start", "small"),
        "</g>",
    ]
    for n, end in enumerate(placed.ends):
        parts += _row(placed, n, end)
    if placed.more:
        _, middle = placed.port(len(placed.ends), is_right=False)
        parts.append(svg_text(x + 12, middle + 4, f"and {placed.more} more", "start", "small"))
    return parts


def _row(placed: _Placed, number: int, end: End) -> list[str]:
    left, y = placed.port(number, is_right=False)
    side = "command" if end.is_command else "state"
    is_wrong = end.state is EndState.WRONG
    style = ' style="fill:var(--red);font-weight:600"' if is_wrong else ""
    name = _SIGNS[end.state] + shortened(end.name, _LETTERS)
    text = (
        f"<g><title>{escape(shortened(end.name, 200))}, {side}, {end.state.value}</title>"
        f'<text x="{left + 14:g}" y="{y + 4:g}" class="small"{style}>{escape(name)}</text>'
    )
    parts = [text, svg_text(left + _BOX - 14, y + 4, end.at or side, "end", "tiny"), "</g>"]
    if is_wrong:
        # Channels have their lines left, all others right.
        start, step = (left, -_STUB) if end.at else (left + _BOX, _STUB)
        parts.append(f'<path d="M{start:g},{y:g}h{step}" class="arc" {_WRONG}/>')
    return parts


def _lines(lines: Sequence[Wire], left: list[_Placed], right: list[_Placed]) -> list[str]:
    """Draw the lines between two columns; several of the same two places are drawn once."""
    parts = {}
    for line in lines:
        if line.left[0] < len(left) and line.right[0] < len(right):
            begin = left[line.left[0]].port(line.left[1], is_right=True)
            end = right[line.right[0]].port(line.right[1], is_right=False)
            parts[begin, end] = _wire(begin, end, _COMMAND if line.is_command else _STATE)
    return list(parts.values())


def _wire(begin: _Place, end: _Place, style: str) -> str:
    middle = (begin[0] + end[0]) / 2
    ports = "".join(
        f'<rect x="{x - _PORT / 2:g}" y="{y - _PORT / 2:g}" width="{_PORT}" height="{_PORT}" '
        'class="sm"/>'
        for x, y in (begin, end)
    )
    return (
        f'<path d="M{begin[0]:g},{begin[1]:g}C{middle:g},{begin[1]:g} {middle:g},{end[1]:g} '
        f'{end[0]:g},{end[1]:g}" class="arc" {style}/>{ports}'
    )


def _safety(line: SafetyWire, subs: list[_Placed], number: int) -> list[str]:
    """Draw an FSoE connection right of both SubDevices, with its name at the SubInstance."""
    if max(line.main, line.sub) >= len(subs):
        return []
    main, sub = subs[line.main], subs[line.sub]
    x, out = main.x + _BOX, _SAFETY - 12 - 8 * (number % 5)
    y1, y2 = main.y + 8 + 6 * (number % 5), sub.y + 22
    return [
        f"<g><title>{escape(shortened(line.name, 200))}</title>"
        f'<path d="M{x:g},{y1:g}h{out}V{y2:g}h{-out}" class="arc" {_SAFE}/>',
        svg_text(x + 8, y2 - 6, shortened(line.name, 18), "start", "tiny"),
        "</g>",
    ]


def _legend(y: float, left_out: int) -> list[str]:
    """Explain the lines and signs below the picture."""
    parts, x = [], float(_MARGIN)
    for style, word in (
        (_COMMAND, "command"),
        (_STATE, "state"),
        (_SAFE, "FSoE connection"),
        (_WRONG, f"{MARKS[Level.ERROR]} unbound"),
    ):
        parts.append(f'<path d="M{x:g},{y + 8:g}h30" class="arc" {style}/>')
        parts.append(svg_text(x + 36, y + 12, word, "start", "small"))
        x += 60 + 7 * len(word)
    text = f"{MARKS[Level.OPEN]} not connected"
    if left_out:
        text += f"; boxes not drawn: {left_out}"
    return [*parts, svg_text(x, y + 12, text, "start", "small")]
