"""The incident page as a document."""

from __future__ import annotations

import re
from collections.abc import Sequence

from fsoe_net.document.markup import svg_text
from fsoe_net.document.model import (
    Bullets,
    Cell,
    Column,
    Document,
    Item,
    Level,
    Part,
    Picture,
    Section,
    Table,
    Text,
    Verdict,
    cell,
    code,
    muted,
    strong,
    words,
)
from fsoe_net.incident.causes_table import SECURE
from fsoe_net.incident.incident_facts import NO_STATEMENT, FrameRow, IncidentFacts, LinkRow
from fsoe_net.incident.incident_window import IncidentWindow, Wrong, window_of
from fsoe_net.report.cycle_times import histogram_name, histogram_picture, percentiles_table

_WIDTH, _HEIGHT, _CELLS = 960, 40, 96
_BARS = {
    Wrong.LATE: 'y="20" width="{}" height="6" style="fill:var(--c3)"',
    Wrong.SHORT: 'y="12" width="{}" height="14" style="fill:var(--c1)"',
    Wrong.LOST: 'y="6" width="{}" height="20" style="fill:var(--red)"',
}
_SIGNS = ".tXL"  # as in Wrong
_BYTES_PER_LINE = 16
_CONNECTION_COLUMNS = (
    Column("Connection"),
    Column("ConnID", number=True, rank=3),
    Column("Address", number=True, rank=4),
    Column("Watchdog", number=True, rank=5),
    Column("State just before", rank=1),
    Column("Wrong CRCs to sub / main", rank=6),
    Column("Resets: by whom, code", rank=2, wraps=True),
    Column("Answers in Data of main / sub: mean (most), ms", rank=7),
)
_WORST_COLUMNS = (
    Column("Latest cycles"),
    Column("When", number=True),
    Column("Too late", number=True),
    Column("Wake-up", number=True, rank=2),
    Column("Work", number=True, rank=3),
    Column("Round trip", number=True, rank=1),
)
_FRAME_COLUMNS = (
    Column("Time, cycle", number=True),
    Column("Direction"),
    Column("Frame; [changed bytes]"),
    Column("CRC"),
)


def incident_document(facts: IncidentFacts, version: str) -> Document:
    """Return the page. The same file gives the same document.

    Args:
        facts: Content of the file.
        version: Version of fsoe-net.
    """
    found = facts.verdicts.likely
    likely = Verdict("No cause is named", Level.OPEN)
    if found is not None:
        likely = Verdict(f"Likely cause: {found.title}", Level.NOTE)
    sections: list[tuple[str, str, list[Part]]] = [
        ("likely", "Likely cause", _likely(facts)),
        ("others", "Other candidates", _others(facts)),
        ("connections", "Connections", _connections(facts)),
        ("timeline", "Timeline", _timeline(facts)),
        ("timing", "Timing", _timing(facts)),
        ("frames", f"Frames of {facts.evidence.name}", _frames(facts)),
        ("not", "What this page is not", [words(f"{NO_STATEMENT}{_LIMITS}", note=True)]),
    ]
    return Document(
        title=facts.title,
        version=version,
        verdict=likely,
        lead=(
            words(strong(facts.sentence)),
            words(muted(" · ".join(facts.facts))),
            *(words(f"note: {remark}", note=True) for remark in facts.remarks),
        ),
        sections=tuple(
            Section(key=key, title=title, parts=tuple(parts))
            for key, title, parts in sections
            if parts
        ),
        foot=NO_STATEMENT,
    )


_LIMITS = (
    ": the MainDevice is part of the black channel and takes no part in the safety function. The "
    "manuals of the devices prevail."
)


def _likely(facts: IncidentFacts) -> list[Part]:
    found = facts.verdicts.likely
    if found is None:
        return [words(facts.nothing)]
    return [
        words(muted(found.looks)),
        words(strong("Evidence:")),
        Bullets(tuple(cell(fact) for fact in found.evidence)),
        words(strong("First: "), Text(SECURE)),
        words(strong("Measure: "), *_with_code(found.measure)),
        words(strong("Change: "), *_with_code(found.change)),
    ]


def _with_code(text: str) -> list[Item]:
    """Return text with the parts between backticks as code."""
    parts = re.split(r"`([^`]+)`", text)
    return [code(part) if n % 2 else Text(part) for n, part in enumerate(parts) if part]


def _others(facts: IncidentFacts) -> list[Part]:
    rows = [
        cell(c.title, muted(f" ({'; '.join(c.evidence[:2])})") if c.evidence else "")
        for c in facts.verdicts.others
    ]
    return [Bullets(tuple(rows))] if rows else []


def _connections(facts: IncidentFacts) -> list[Part]:
    if not facts.links:
        return []
    left = f"{facts.links_left} more" if facts.links_left else ""
    rows = tuple(_connection(row) for row in facts.links)
    return [Table(name="connections", columns=_CONNECTION_COLUMNS, rows=rows, remark=left)]


def _connection(row: LinkRow) -> tuple[Cell, ...]:
    name, *others = row.cells
    return (cell(strong(name) if row.mark else name), *(cell(text) for text in others))


def _timeline(facts: IncidentFacts) -> list[Part]:
    window = window_of(facts.evidence)
    parts: list[Part] = [] if window is None else [_picture(window)]
    if facts.events:
        rows = tuple(
            (
                cell(f"{row.offset_ms:+.1f} ms"),
                cell(Verdict(row.text, Level.WARNING) if row.is_warning else row.text),
            )
            for row in facts.events
        )
        left = f"{facts.events_left} more in the file" if facts.events_left else ""
        columns = (Column("Time", number=True), Column("Event", wraps=True))
        parts.append(Table(name="events", columns=columns, rows=rows, remark=left))
    return parts


def _picture(window: IncidentWindow) -> Picture:
    return Picture(
        title="Working counter and lost frames over time",
        words="Light band: working counter complete. Dark on it: higher than the band: frames "
        "lost; as high: incomplete; low: cycle late",
        svg=_svg(window),
        lines=_signs(window),
    )


def _svg(window: IncidentWindow) -> str:
    """Draw the window: errors in each slice, and the moment."""
    width = max(1.0, _WIDTH / len(window.slices))
    bars = "".join(
        f'<rect x="{piece.begin * _WIDTH:.1f}" {_BARS[piece.wrong].format(f"{width:.1f}")}/>'
        for piece in window.slices
        if piece.wrong
    )
    at = window.moment * _WIDTH
    anchor = "end" if at > _WIDTH / 2 else "start"
    return (
        f'<svg class="window" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
        'aria-label="working counter and lost frames over time">'
        f'<rect x="0" y="12" width="{_WIDTH}" height="14" class="sm"/>{bars}'
        f'<line x1="{at:.1f}" y1="2" x2="{at:.1f}" y2="28" class="moment"/>'
        f"{svg_text(at, 38, 'the moment', anchor, 'small')}</svg>"
    )


def _signs(window: IncidentWindow) -> tuple[str, ...]:
    """Return the window as a line of characters: errors in each slice."""
    cells = [0] * _CELLS
    for piece in window.slices:
        at = min(_CELLS - 1, int(piece.begin * _CELLS))
        cells[at] = max(cells[at], piece.wrong)
    mark = min(_CELLS - 1, int(window.moment * _CELLS))
    return (
        f"{' ' * mark}v the moment",
        "".join(_SIGNS[worst] for worst in cells),
        ". complete   X working counter incomplete   L frames lost   t cycle late",
    )


def _timing(facts: IncidentFacts) -> list[Part]:
    counters = facts.evidence.head.counters
    histograms = {} if counters is None else counters.histograms
    histograms = {name: h for name, h in histograms.items() if h.count}
    # Two pictures fit on the page; the first two that exist are the most important ones.
    wanted = [k for k in ("period", "round_trip", "latency", "work") if k in histograms][:2]
    parts: list[Part] = [
        Picture(
            title=histogram_name(key),
            words="how often each time was measured, both on logarithmic scales",
            svg=histogram_picture(key, histograms[key]),
            wide=False,
        )
        for key in wanted
    ]
    if histograms:
        parts.append(percentiles_table(histograms.items()))
    if facts.worst:
        rows = tuple(tuple(cell(text) for text in row) for row in facts.worst)
        parts.append(Table(name="latest cycles", columns=_WORST_COLUMNS, rows=rows))
    return parts


def _frames(facts: IncidentFacts) -> list[Part]:
    rows = tuple(
        (
            cell(f"{row.offset_ms:+.1f} ms", muted(str(row.cycle))),
            cell(row.direction),
            cell(row.text, *(code(line) for line in _bytes(row))),
            cell(Verdict(row.verdict, Level.ERROR) if row.wrong else row.verdict),
        )
        for row in facts.frames
    )
    return [Table(name="frames", columns=_FRAME_COLUMNS, rows=rows)] if rows else []


def _bytes(row: FrameRow) -> Sequence[str]:
    shown = [
        f"[{byte:02x}]" if n in row.changed else f"{byte:02x}" for n, byte in enumerate(row.data)
    ]
    return [" ".join(shown[n : n + _BYTES_PER_LINE]) for n in range(0, len(shown), _BYTES_PER_LINE)]
