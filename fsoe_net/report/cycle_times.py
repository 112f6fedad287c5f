"""Timing of a run: histograms as CSV, percentiles as text, a picture."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable

from fsoe_net.core.snapshot import Histogram, Statistics, bars_of
from fsoe_net.document.markup import escape, svg_text
from fsoe_net.document.model import Column, Table, cell

_NAMES = {
    "latency": "wake-up latency",
    "period": "period",
    "work": "execution time",
    "copy": "copies alone",
    "round_trip": "round trip",
    "dc_offset": "DC offset",
}
_WIDTH, _PANEL, _LEFT, _RIGHT, _PLOT = 760, 150, 20, 20, 84
_STYLE = (
    "text{font:12px system-ui,sans-serif;fill:#1f2328}.small{font-size:11px;fill:#57606a}"
    ".bar{fill:#1f6feb}.axis{stroke:#57606a}.mark{stroke:#b35900;stroke-dasharray:3 2}"
    ".back{fill:#fff}"
    "@media(prefers-color-scheme:dark){text{fill:#e6edf3}.small{fill:#9198a1}"
    ".bar{fill:#4493f8}.axis{stroke:#9198a1}.mark{stroke:#f0883e}.back{fill:#0d1117}}"
)


def timing_csv(statistics: Statistics) -> str:
    """Return a row for every non-empty bucket.

    Columns: ``histogram``, ``floor_ns`` (smallest time of the bucket), ``count``,
    ``cumulative_share`` (share of all times in this bucket or below).
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["histogram", "floor_ns", "count", "cumulative_share"])
    for name, histogram in statistics.histograms.items():
        total = sum(count for _, count in histogram.buckets)
        below = 0
        for floor_ns, count in histogram.buckets:
            below += count
            writer.writerow([name, floor_ns, count, f"{below / total:.9f}"])
    return out.getvalue()


def times_table(statistics: Statistics) -> Table:
    """Return percentiles, a row per non-empty histogram."""
    return percentiles_table(statistics.histograms.items())


def percentiles_table(histograms: Iterable[tuple[str, Histogram]]) -> Table:
    """Return percentiles of histograms, a row for each non-empty one."""
    rows = []
    for name, h in histograms:
        if h.count:
            times = (h.mean_ns, h.p50_ns, h.p99_ns, h.p999_ns, h.max_ns)
            rows.append(
                (cell(histogram_name(name)), *(cell(_us(ns)) for ns in times), cell(str(h.count)))
            )
    heads = ("mean", "50 %", "99 %", "99.9 %", "most")
    return Table(
        name="times",
        columns=(
            Column("times in us"),
            *(Column(h, number=True) for h in heads),
            Column("times", number=True, rank=1),
        ),
        rows=tuple(rows),
    )


def _us(ns: int) -> str:
    return f"{ns / 1000:.1f}"


def timing_bars(histogram: Histogram, *, width: int = 40) -> list[str]:
    """Return lines of bars, one per factor of two in time, with logarithmic lengths.

    A single late cycle among millions must be visible, so the shortest bar is one eighth.
    """
    octaves: dict[int, int] = {}
    for floor_ns, count in histogram.buckets:
        octave = max(0, floor_ns.bit_length() - 1)
        octaves[octave] = octaves.get(octave, 0) + count
    if not octaves:
        return []
    first, last, most = min(octaves), max(octaves), max(octaves.values())
    lines = []
    for octave in range(first, last + 1):
        count = octaves.get(octave, 0)
        share = math.log(count + 1) / math.log(most + 1)
        eighths = max(1, round(8 * width * share)) if count else 0
        bar = "█" * (eighths // 8) + " ▏▎▍▌▋▊▉"[eighths % 8].strip()
        lines.append(f"{_time(1 << octave, 3):>8} {bar.ljust(width)} {count}".rstrip())
    return lines


def timing_picture(statistics: Statistics, title: str) -> str:
    """Draw the non-empty histograms over logarithmic time; light and dark, no script."""
    shown = [(name, h) for name, h in statistics.histograms.items() if h.buckets]
    height = 44 + _PANEL * max(1, len(shown))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" role="img" '
        f'aria-label="{escape(title)}"><title>{escape(title)}</title><style>{_STYLE}</style>'
        f'<rect class="back" width="{_WIDTH}" height="{height}"/>',
        svg_text(_LEFT, 24, title, "start"),
    ]
    if not shown:
        parts.append(svg_text(_LEFT, 80, "no times were measured", "start"))
    for number, (name, histogram) in enumerate(shown):
        parts.append(_panel(_NAMES[name], histogram, 40 + number * _PANEL))
    return "".join([*parts, "</svg>\n"])


def histogram_name(key: str) -> str:
    """Return the display name of a histogram of the statistics."""
    return _NAMES.get(key, key)


def histogram_picture(key: str, histogram: Histogram) -> str:
    """Draw one histogram for a page, in the style of `timing_picture`."""
    height = _PANEL - 8
    return (
        f'<svg viewBox="0 0 {_WIDTH} {height}" role="img" class="timing"><style>{_STYLE}</style>'
        f"{_panel(histogram_name(key), histogram, 4)}</svg>"
    )


class _Axis:
    """Maps logarithmic time to positions in the picture, in whole decades."""

    def __init__(self, least_ns: int, most_ns: int) -> None:
        self.first = math.floor(math.log10(max(1, least_ns)))
        self.last = max(self.first + 1, math.ceil(math.log10(most_ns)))

    def x(self, ns: float) -> float:
        share = (math.log10(max(1.0, ns)) - self.first) / (self.last - self.first)
        return _LEFT + min(1.0, max(0.0, share)) * (_WIDTH - _LEFT - _RIGHT)


def _panel(name: str, histogram: Histogram, top: float) -> str:
    bars = bars_of(histogram.buckets)
    axis = _Axis(bars[0][0], bars[-1][1])
    most = max(count for _, _, count in bars)
    base = top + 24 + _PLOT
    parts = [
        svg_text(_LEFT, top + 14, name, "start"),
        svg_text(
            _WIDTH - _RIGHT,
            top + 14,
            f"50 % {_time(histogram.p50_ns)} · 99 % {_time(histogram.p99_ns)} · 99.9 % "
            f"{_time(histogram.p999_ns)} · most {_time(histogram.max_ns)}",
            "end",
            "small",
        ),
        f'<line class="axis" x1="{_LEFT}" y1="{base}" x2="{_WIDTH - _RIGHT}" y2="{base}"/>',
    ]
    for floor_ns, end_ns, count in bars:
        left, right = axis.x(floor_ns), axis.x(end_ns)
        # A single time among millions must be visible: bars are also logarithmic.
        tall = _PLOT * math.log1p(count) / math.log1p(most)
        parts.append(
            f'<rect class="bar" x="{left:.1f}" y="{base - tall:.1f}" width="{right - left:.1f}" '
            f'height="{tall:.1f}"><title>{_time(floor_ns)} … {_time(end_ns)}: '
            f"{count} of {histogram.count}</title></rect>"
        )
    # Percentiles are drawn over the bars, because limits are compared with them.
    for ns in (histogram.p50_ns, histogram.p99_ns, histogram.p999_ns):
        x = axis.x(ns)
        parts.append(f'<line class="mark" x1="{x:.1f}" y1="{top + 22}" x2="{x:.1f}" y2="{base}"/>')
    for decade in range(axis.first, axis.last + 1):
        x = axis.x(10.0**decade)
        # At the borders the text would extend beyond the picture.
        anchor = {axis.last: "end", axis.first: "start"}.get(decade, "middle")
        parts.append(svg_text(x, base + 14, _time(10**decade), anchor, "small"))
    return "<g>" + "".join(parts) + "</g>"


def _time(ns: int, digits: int = 4) -> str:
    for unit, size in (("s", 10**9), ("ms", 10**6), ("us", 10**3)):
        if ns >= size:
            return f"{ns / size:.{digits}g} {unit}"
    return f"{ns} ns"
