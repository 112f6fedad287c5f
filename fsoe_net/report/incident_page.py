"""The incident page as HTML: one or two sheets when printed."""

from __future__ import annotations

import re

from fsoe_net.document.markup import escape
from fsoe_net.observe.candidate import Candidate
from fsoe_net.report.cycle_times import histogram_picture
from fsoe_net.report.html import html_page, table
from fsoe_net.report.incident_facts import NO_STATEMENT, WORST_COLUMNS, FrameRow, Story
from fsoe_net.report.incident_window import Strip, Wrong, strip_of

__all__ = ["incident_page"]

_STYLE = """
body{font-size:13px;line-height:1.4}h1{font-size:1.5em;margin:0 0 .3em}h2{font-size:1.1em;
margin:1.1em 0 .3em}.what{font-size:1.12em}.cause{border:2px solid #0969da;border-radius:6px;
padding:.5em 1em;margin:.6em 0}.cause h2{margin:0;border:0}.cause ul{margin:.3em 0}
.next{background:#f6f8fa;padding:.2em .8em;margin:.3em 0}dt{font-weight:600}dd{margin:0 0 .2em 1em}
td,th{padding:.15em .5em}.mark td{background:#fff8c5}.bytes{font:11.5px ui-monospace,monospace;
word-break:break-all}.bytes b{background:#fff1a8}svg.timing{max-width:620px}
svg.strip{max-height:46px}figure{margin:.3em 0}
@media screen and (max-width:700px){figure>svg.timing{min-width:600px}}
@media print{body{font-size:9.5px}.bytes{font-size:8.5px}
.cause{break-inside:avoid}@page{margin:12mm}}
"""
_STRIP_WIDTH, _STRIP_HEIGHT = 960, 40
_BARS = {
    Wrong.LATE: 'y="20" width="{}" height="6" fill="#8250df"',
    Wrong.SHORT: 'y="12" width="{}" height="14" fill="#b35900"',
    Wrong.LOST: 'y="6" width="{}" height="20" fill="#b00020"',
}


def incident_page(story: Story, version: str) -> str:
    """Return the page. The same file gives the same bytes.

    Args:
        story: What there is to tell.
        version: Version of fsoe-net.
    """
    body = [
        f"<h1>{escape(story.title)}</h1>",
        f'<p class="what"><b>{escape(story.sentence)}</b></p>',
        f'<p class="muted">{escape(" · ".join(story.facts))} · page by fsoe-net '
        f"{escape(version)}</p>",
        *(f'<p class="note">{escape(remark)}</p>' for remark in story.remarks),
        *_likely(story),
        *_others(story),
        *_links(story),
        *_timeline(story),
        *_timing(story),
        *_frames(story),
        f'<p class="note">{NO_STATEMENT}: the MainDevice is part of the black channel and takes no '
        "part in the safety function. The manuals of the devices prevail.</p>",
    ]
    return html_page(story.title, body, style=_STYLE)


def _likely(story: Story) -> list[str]:
    found = story.verdicts.likely
    if found is None:
        return [f'<div class="cause"><h2>Likely cause</h2><p>{escape(story.nothing)}</p></div>']
    facts = "".join(f"<li>{escape(fact)}</li>" for fact in found.evidence)
    return [
        '<div class="cause"><h2>Likely cause</h2>'
        f"<p><b>{escape(found.title)}</b></p>"
        f'<p class="muted">{escape(found.looks)}</p><ul>{facts}</ul>'
        f'<dl class="next"><dt>Measure</dt><dd>{_words(found.measure)}</dd>'
        f"<dt>Change</dt><dd>{_words(found.change)}</dd></dl></div>"
    ]


def _words(text: str) -> str:
    """Return text with what stands between backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))


def _others(story: Story) -> list[str]:
    rows = story.verdicts.others
    if not rows:
        return []
    items = "".join(f"<li>{_other(c)}</li>" for c in rows)
    return ["<h2>Other candidates</h2>", f"<ul>{items}</ul>"]


def _other(found: Candidate) -> str:
    why = "; ".join(found.evidence[:2])
    return f"{escape(found.title)} <span class='muted'>{escape(why)}</span>"


def _links(story: Story) -> list[str]:
    if not story.links:
        return []
    rows = []
    for row in story.links:
        name, *cells = map(escape, row.cells)
        rows.append([f"<b>{name}</b>" if row.mark else name, *cells])
    head = (
        "Connection",
        "ConnID",
        "Address",
        "Watchdog",
        "State just before",
        "Wrong CRCs to sub / main",
        "Resets: by whom, code",
        "Answers in Data of main / sub: mean (most), ms",
    )
    more = f'<p class="muted">{story.links_left} more.</p>' if story.links_left else ""
    return ["<h2>Connections</h2>", table(head, rows), more]


def _timeline(story: Story) -> list[str]:
    rows = [
        (
            f"{row.offset_ms:+.1f} ms",
            f'<span class="{"warning" if row.level in ("warning", "error") else "info"}">'
            f"{escape(row.text)}</span>",
        )
        for row in story.events
    ]
    more = f'<p class="muted">{story.events_left} more in the file.</p>' * bool(story.events_left)
    strip = strip_of(story.evidence)
    if not rows and strip is None:
        return []
    drawn = _strip(strip) if strip else ""
    return ["<h2>Timeline</h2>", drawn, table(("Time", "Event"), rows) if rows else "", more]


def _strip(strip: Strip) -> str:
    """Draw the window: what was wrong in each slice, and the moment."""
    width = max(1.0, _STRIP_WIDTH / len(strip.slices))
    bars = "".join(
        f'<rect x="{piece.begin * _STRIP_WIDTH:.1f}" {_BARS[piece.wrong].format(f"{width:.1f}")}/>'
        for piece in strip.slices
        if piece.wrong
    )
    at = strip.moment * _STRIP_WIDTH
    anchor = "end" if at > _STRIP_WIDTH / 2 else "start"
    return (
        f'<svg class="strip" viewBox="0 0 {_STRIP_WIDTH} {_STRIP_HEIGHT}" role="img" '
        'aria-label="working counter and lost frames over time">'
        f'<rect x="0" y="12" width="{_STRIP_WIDTH}" height="14" fill="#dafbe1"/>{bars}'
        f'<line x1="{at:.1f}" y1="2" x2="{at:.1f}" y2="28" stroke="#1f2328" stroke-width="2"/>'
        f'<text x="{at:.1f}" y="38" text-anchor="{anchor}" class="small">the moment</text></svg>'
        '<p class="muted">Light band: working counter complete. Dark on it: higher than the band '
        "(red): frames lost; as high (brown): incomplete; low (violet): cycle late.</p>"
    )


def _timing(story: Story) -> list[str]:
    histograms = story.evidence.head.counters.histograms
    wanted = [k for k in ("period", "round_trip", "latency", "work") if k in histograms][:2]
    pictures = [f"<figure>{histogram_picture(k, histograms[k])}</figure>" for k in wanted]
    rows = [[escape(cell) for cell in row] for row in story.worst]
    worst = [table(WORST_COLUMNS, rows)] if rows else []
    return ["<h2>Timing</h2>", *pictures, *worst] if pictures or worst else []


def _frames(story: Story) -> list[str]:
    if not story.frames:
        return []
    rows = [
        (
            f"{row.offset_ms:+.1f} ms<br><span class='muted'>{row.cycle}</span>",
            escape(row.direction),
            f"{escape(row.text)}<br>{_bytes(row)}",
            f'<span class="{"error" if row.wrong else "info"}">{escape(row.verdict)}</span>',
        )
        for row in story.frames
    ]
    return [
        f"<h2>Frames of {escape(story.evidence.name)}</h2>",
        table(("Time, cycle", "Direction", "Frame; changed bytes are marked", "CRC"), rows),
    ]


def _bytes(row: FrameRow) -> str:
    cells = (
        f"<b>{byte:02x}</b>" if n in row.changed else f"{byte:02x}"
        for n, byte in enumerate(row.data)
    )
    return f'<span class="bytes">{" ".join(cells)}</span>'
