"""A test protocol as a page to print and write on."""

from __future__ import annotations

from fsoe_net.diag.words import counted
from fsoe_net.document.markup import escape
from fsoe_net.model.protocol import EMULATED_NOTE, Outcome, Protocol, ProtocolStep, Seen
from fsoe_net.report.html import html_page, table

__all__ = ["protocol_page"]

_STYLE = (  # room to write in the last two columns, seen as such on black and white paper
    "@media print{@page{size:A4 landscape;margin:10mm 10mm 13mm;@bottom-left{content:SEAL;"
    "font:8.5pt sans-serif}}body{font-size:8.5pt;line-height:1.35}th,td{padding:.25em .45em}"
    "tbody tr{height:13mm}}body{max-width:1400px}"
    "th:nth-child(n+6),td:nth-child(n+6){border-left:1px solid #57606a}"
    "@media print,screen and (min-width:701px){table{table-layout:fixed}"
    "th:nth-child(1){width:11%}th:nth-child(2){width:14%}th:nth-child(3){width:17%}"
    "th:nth-child(4){width:13%}th:nth-child(5){width:7%}th:nth-child(7){width:11%}}"
    "@media screen and (max-width:700px){td{min-width:9em}}"
    "td{overflow-wrap:break-word}th .muted{font-weight:400}"
)
_HEAD = (
    "Step",
    "What to do",
    "Expected",
    f"EMULATED<br><span class='muted'>{EMULATED_NOTE}</span>",
    "LIVE<br><span class='muted'>seen by fsn-master</span>",
    "MACHINE<br><span class='muted'>result, time, remark</span>",
    "Who, when",
)


def protocol_page(protocol: Protocol, *, version: str) -> str:
    """Return the page; the same protocol gives the same bytes.

    Args:
        protocol: What to print.
        version: Version of fsoe-net.
    """
    count = len(protocol.open_steps)
    title = f"Test protocol of {protocol.network}"
    body = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="muted">{escape(protocol.project)} fsoe-net {escape(version)}</p>',
        '<p class="note">The EtherCAT MainDevice is part of the black channel and takes no part in '
        "the safety function. This tool is not certified. What was tried on emulated devices is "
        f"{EMULATED_NOTE}; it closes no step. The safety manuals of the devices prevail.</p>",
        f"<p>Plan <code>{escape(protocol.plan_sha256)}</code></p>",
    ]
    if protocol.fingerprint:
        body.append(f"<p>Fingerprint <code>{escape(protocol.fingerprint)}</code></p>")
    words = f"{count} of {counted(len(protocol.machine_steps), 'step')} open at the machine"
    if protocol.failed_steps:
        words += f", {len(protocol.failed_steps)} not as expected"
    if protocol.disputed_steps:
        words += f", {len(protocol.disputed_steps)} as expected by hand and not by program"
    body.append(f"<p><b>{words}.</b></p>")
    body.append(table(_HEAD, [_row(step) for step in protocol.steps]))
    return html_page(title, body, style=_STYLE.replace("SEAL", _foot(title, protocol.fingerprint)))


def _foot(title: str, fingerprint: str) -> str:
    """Return what stands below each printed page, as a string of CSS."""
    short = fingerprint[:16].upper()
    code = " ".join(short[n : n + 4] for n in range(0, len(short), 4))
    words = f"{title} · fingerprint {code or 'not known'}"
    return (
        '"' + "".join(c if c.isalnum() or c in " ·_-." else f"\\{ord(c):06x}" for c in words) + '"'
    )


def _row(step: ProtocolStep) -> tuple[str, ...]:
    limit = ""
    if step.limit_ms is not None:
        limit = f"<br>within {step.limit_ms:g} ms <span class='muted'>({escape(step.limit_source)})"
        limit += "</span>"
    machine = step.machine
    return (
        f"<b>{escape(step.id)}</b>",
        escape(step.what),
        escape(step.expected) + limit,
        _seen(step.emulated),
        _seen(step.live),
        _machine(step),
        escape(" ".join(part for part in (machine.by, machine.date) if part)),
    )


def _seen(seen: Seen | None) -> str:
    if seen is None:
        return ""
    said = "; ".join(text for text in (seen.time_is, seen.remark) if text)
    return _words(seen.outcome, seen.measured_ms, said)


def _machine(step: ProtocolStep) -> str:
    if not step.kind.at_machine:
        return "<span class='muted'>not tried at the machine</span>"
    machine = step.machine
    late = '<span class="fail">later than allowed</span><br>' if step.is_late else ""
    return late + _words(machine.outcome, machine.measured_ms, machine.remark)


def _words(outcome: Outcome | None, measured_ms: float | None, remark: str) -> str:
    parts = []
    if outcome is not None:
        kind = "fail" if outcome is Outcome.NOT_AS_EXPECTED else "info"
        parts.append(f'<span class="{kind}">{escape(outcome.value)}</span>')
    if measured_ms is not None:
        parts.append(f"<b>{measured_ms:g} ms</b>")
    if remark:
        parts.append(f"<span class='muted'>{escape(remark)}</span>")
    return "<br>".join(parts)
