"""The incident page as plain text, for a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

from fsoe_net.observe.candidate import Candidate
from fsoe_net.report.cycle_times import histogram_name
from fsoe_net.report.incident_facts import NO_STATEMENT, WORST_COLUMNS, FrameRow, Story
from fsoe_net.report.incident_window import Strip, strip_of

__all__ = ["incident_text"]

_WIDTH = 100
_STRIP = 96
_SIGNS = ".tXL"  # as in Wrong


def incident_text(story: Story) -> str:
    """Return the page as lines of about a hundred characters."""
    parts = [
        [story.title, "", *_wrap(story.sentence)],
        [f"  {row}" for row in story.facts],
        [line for remark in story.remarks for line in _wrap(f"note: {remark}")],
        _likely(story),
        _others(story),
        _links(story),
        _timeline(story),
        _timing(story),
        _frames(story),
        _wrap(f"{NO_STATEMENT}; the manuals of the devices prevail."),
    ]
    return "\n\n".join("\n".join(part) for part in parts if part)


def _wrap(text: str, first: str = "", rest: str = "") -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent=first, subsequent_indent=rest) or [first]


def _likely(story: Story) -> list[str]:
    found = story.verdicts.likely
    if found is None:
        return ["LIKELY CAUSE", *_wrap(story.nothing, "  ", "  ")]
    return [
        "LIKELY CAUSE",
        *_wrap(found.title, "  ", "  "),
        *_item("looks like", found.looks),
        *[line for fact in found.evidence for line in _wrap(fact, "  evidence    ", " " * 14)],
        *_item("measure", found.measure),
        *_item("change", found.change),
    ]


def _item(name: str, text: str) -> list[str]:
    return _wrap(text, f"  {name:11} ", " " * 14)


def _others(story: Story) -> list[str]:
    rows = story.verdicts.others
    if not rows:
        return []
    return ["OTHER CANDIDATES", *[line for c in rows for line in _other(c)]]


def _other(found: Candidate) -> list[str]:
    why = found.evidence[0] if found.evidence else ""
    return _wrap(f"{found.title} ({why})" if why else found.title, "  - ", "    ")


def _links(story: Story) -> list[str]:
    if not story.links:
        return []
    head = ("", "connection", "ConnID", "addr", "watchdog", "state", "wrong", "resets", "answers")
    rows = [(">" if row.mark else "", *row.cells) for row in story.links]
    more = [f"  {story.links_left} more"] if story.links_left else []
    return [
        "CONNECTIONS (state just before; wrong CRCs to sub / to main; resets by whom and code;",
        "  answers in Data of main / sub: mean and most, ms)",
        *_table([head, *rows]),
        *more,
    ]


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[n]) for row in rows) for n in range(len(rows[0]))]
    return [
        "  " + "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def _timeline(story: Story) -> list[str]:
    lines = [
        line
        for row in story.events
        for line in _wrap(row.text, f"  {row.offset_ms:+10.1f} ms  ", " " * 17)
    ]
    if story.events_left:
        lines.append(f"  {story.events_left} more events in the file")
    strip = strip_of(story.evidence)
    drawn = _strip(strip) if strip else []
    return ["TIMELINE", *drawn, *lines] if lines or drawn else []


def _strip(strip: Strip) -> list[str]:
    """Return the window as a line of characters: what was wrong in each slice."""
    cells = [0] * _STRIP
    for piece in strip.slices:
        at = min(_STRIP - 1, int(piece.begin * _STRIP))
        cells[at] = max(cells[at], piece.wrong)
    mark = min(_STRIP - 1, int(strip.moment * _STRIP))
    return [
        "  " + " " * mark + "v the moment",
        "  " + "".join(_SIGNS[worst] for worst in cells),
        "  . complete   X working counter incomplete   L frames lost   t cycle late",
    ]


def _timing(story: Story) -> list[str]:
    lines = []
    for key, h in story.evidence.head.counters.histograms.items():
        lines.append(
            f"  {histogram_name(key):16} 50 % {h.p50_ns / 1000:8.1f} us   99.9 % "
            f"{h.p999_ns / 1000:8.1f} us   most {h.max_ns / 1000:8.1f} us"
        )
    if story.worst:
        head = [column.lower() for column in WORST_COLUMNS]
        lines += ["  latest cycles:", *_table([head, *story.worst])]
    return ["TIMING", *lines] if lines else []


def _frames(story: Story) -> list[str]:
    if not story.frames:
        return []
    return [
        f"FRAMES OF {story.evidence.name} ([] changed since the frame before)",
        *[line for row in story.frames for line in _frame(row)],
    ]


def _frame(row: FrameRow) -> Iterable[str]:
    shown = "".join(
        f"[{byte:02x}]" if n in row.changed else f" {byte:02x} " for n, byte in enumerate(row.data)
    )
    yield f"  {row.offset_ms:+10.1f} ms  cycle {row.cycle}  {row.direction}  {row.verdict}"
    yield f"      {row.text[:_WIDTH]}"
    for start in range(0, len(shown), 4 * 23):
        yield f"      {shown[start : start + 4 * 23].rstrip()}"
