"""Picture of a run of the robot cell as SVG: motion, states of the drives and of FSoE over time."""

from collections.abc import Iterator, Sequence
from html import escape

from fsoe_net import ConnectionState

WIDTH, LEFT, RIGHT, PANEL, GAP, BAND = 960, 84, 128, 118, 26, 18
COLOURS = ("#0550ae", "#953800")
STATES = {  # of the statusword: mask, value, words, colour
    "Operation enabled": (0x6F, 0x27, "#2da44e"),
    "Quick stop active": (0x6F, 0x07, "#d4a72c"),
    "Switched on": (0x6F, 0x23, "#80ccff"),
    "Ready to switch on": (0x6F, 0x21, "#b6e3ff"),
    "Switch on disabled": (0x4F, 0x40, "#d0d7de"),
    "Fault": (0x4F, 0x08, "#cf222e"),
    "Fault reaction active": (0x4F, 0x0F, "#ff8182"),
}
FSOE = {
    "ProcessData": "#2da44e",
    "FailSafeData": "#d4a72c",
    "not in Data": "#cf222e",
}


def state_of(statusword: int) -> str:
    """Return the state of a drive in words."""
    for words, (mask, value, _) in STATES.items():
        if statusword & mask == value:
            return words
    return "Not ready to switch on"


def fsoe_word(state: ConnectionState) -> str:
    """Return what an FSoE connection carries."""
    if not state.in_data:
        return "not in Data"
    return "ProcessData" if state is ConnectionState.DATA_PROCESS else "FailSafeData"


def spans(points: Sequence[tuple[float, str]], end: float) -> Iterator[tuple[float, float, str]]:
    """Join points of one word to spans: begin, end, word."""
    begin = 0
    for number in range(1, len(points) + 1):
        if number == len(points) or points[number][1] != points[begin][1]:
            until = end if number == len(points) else points[number][0]
            yield points[begin][0], until, points[begin][1]
            begin = number


class Picture:
    """Panels below each other over one time axis in seconds."""

    def __init__(self, start: float, end: float, marks: Sequence[tuple[float, str]]) -> None:
        self._start, self._end, self._marks = start, end, marks
        self._y = 64.0
        self._parts: list[str] = []

    def _x(self, time: float) -> float:
        return LEFT + (time - self._start) / (self._end - self._start) * (WIDTH - LEFT - RIGHT)

    def _text(
        self, x: float, y: float, text: str, *, anchor: str = "start", more: str = ""
    ) -> None:
        self._parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {more}>{escape(text)}</text>'
        )

    def lines(self, title: str, unit: str, series: dict[str, list[tuple[float, float]]]) -> None:
        """Add a panel with one line for each series."""
        values = [value for points in series.values() for _, value in points]
        low, high = min([*values, 0.0]), max([*values, 0.0])
        room = (high - low or 1.0) * 0.08
        low, high = low - room, high + room
        top, bottom = self._y, self._y + PANEL
        self._frame(top, PANEL)
        self._text(LEFT - 62, top - 6, f"{title}, {unit}", more='class="title"')
        for value in ticks(low, high):
            y = bottom - (value - low) / (high - low) * PANEL
            x = WIDTH - RIGHT
            self._parts.append(f'<path d="M{LEFT} {y:.1f}H{x}" class="grid"/>')
            self._text(LEFT - 6, y + 4, f"{value:g}", anchor="end")
        for number, (name, points) in enumerate(series.items()):
            drawn = thinned(points, (self._end - self._start) / 600)
            path = "L".join(
                f"{self._x(t):.1f} {bottom - (v - low) / (high - low) * PANEL:.1f}"
                for t, v in drawn
            )
            colour, dash = COLOURS[number], ("", ' stroke-dasharray="7 3"')[number]
            self._parts.append(f'<path d="M{path}" class="line" stroke="{colour}"{dash}/>')
            y = top + 14 + 18 * number
            x = WIDTH - RIGHT + 10
            self._parts.append(f'<path d="M{x} {y - 4}h22" class="line" stroke="{colour}"{dash}/>')
            self._text(x + 28, y, name)
        self._y += PANEL + GAP

    def bands(
        self, title: str, rows: dict[str, list[tuple[float, str]]], colours: dict[str, str]
    ) -> None:
        """Add a row of coloured spans for each name, and what the colours mean."""
        self._text(LEFT - 62, self._y - 6, title, more='class="title"')
        used: dict[str, str] = {}
        for name, points in rows.items():
            self._frame(self._y, BAND)
            self._text(LEFT - 6, self._y + 13, name, anchor="end")
            for begin, end, word in spans(points, self._end):
                used[word] = colours.get(word, "#eaeef2")
                x, wide = self._x(begin), max(0.6, self._x(end) - self._x(begin))
                tip = f"{name}: {word} from {begin:.3f} s to {end:.3f} s"
                self._parts.append(
                    f'<rect x="{x:.1f}" y="{self._y:.1f}" width="{wide:.1f}" height="{BAND}" '
                    f'fill="{used[word]}"><title>{escape(tip)}</title></rect>'
                )
            self._y += BAND + 5
        x = float(LEFT)
        for word in sorted(used, key=list(colours).index):
            self._parts.append(
                f'<rect x="{x:.1f}" y="{self._y + 2:.1f}" width="11" height="11" '
                f'fill="{used[word]}"/>'
            )
            self._text(x + 16, self._y + 12, word)
            x += 34 + 6.6 * len(word)
        self._y += 20 + GAP

    def _frame(self, top: float, height: float) -> None:
        wide = WIDTH - LEFT - RIGHT
        self._parts.append(
            f'<rect x="{LEFT}" y="{top:.1f}" width="{wide}" height="{height}" class="frame"/>'
        )

    def svg(self) -> str:
        """Return the document."""
        bottom = self._y - GAP + 6
        for time in ticks(self._start, self._end, 10):
            self._text(self._x(time), bottom + 14, f"{time:g}", anchor="middle")
        self._text(WIDTH - RIGHT + 10, bottom + 14, "s")
        for number, (time, text) in enumerate(self._marks):
            x, y = self._x(time), (32, 46)[number % 2]
            self._parts.append(f'<path d="M{x:.1f} {y + 3}V{bottom:.1f}" class="mark"/>')
            self._text(x, y, text, anchor="middle", more='class="event"')
        height = bottom + 24
        style = (
            "text{font:12px sans-serif;fill:#1f2328}.title{font-weight:600}.event{font-size:11px}"
            ".frame{fill:none;stroke:#8c959f}.grid{stroke:#d8dee4;stroke-width:.7}"
            ".line{fill:none;stroke-width:1.6}.mark{stroke:#57606a;stroke-dasharray:3 3;fill:none}"
        )
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0f}" '
            f'width="{WIDTH}" role="img" aria-label="Robot cell: an e-stop while two axes move">'
            f"<title>Robot cell: an e-stop while two axes move</title><style>{style}</style>"
            f'<rect width="{WIDTH}" height="{height:.0f}" fill="#fff"/>'
            f"{''.join(self._parts)}"
            f'<text x="{LEFT - 62}" y="16" class="title">'
            "EMULATION: two axes, e-stop while they move, restart</text></svg>\n"
        )


def ticks(low: float, high: float, most: int = 4) -> list[float]:
    """Return round numbers between two values."""
    step = next(
        s * 10.0**power
        for power in range(-4, 8)
        for s in (1, 2, 5)
        if (high - low) / (s * 10.0**power) <= most
    )
    first = -(-low // step)
    return [round((first + n) * step, 6) for n in range(most + 1) if (first + n) * step <= high]


def thinned(points: Sequence[tuple[float, float]], step: float) -> list[tuple[float, float]]:
    """Return lowest and highest point of each step, so that no peak is lost."""
    kept: list[tuple[float, float]] = []
    group: list[tuple[float, float]] = []
    for point in points:
        if group and point[0] - group[0][0] > step:
            kept += sorted({min(group, key=lambda p: p[1]), max(group, key=lambda p: p[1])})
            group = []
        group.append(point)
    return kept + group
