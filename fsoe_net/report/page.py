"""The report page: one self-contained HTML file, no script, prints well."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from fsoe_net.diag import Diagnostic
from fsoe_net.model import Network, SourceFile
from fsoe_net.plan import NONE, Fingerprint, Plan, copy_end, fingerprint_of, igh_image
from fsoe_net.report.html import html_page, table
from fsoe_net.report.svg import copy_picture, topology_picture
from fsoe_net.run import RunResult, state_text

__all__ = ["render_report"]


def render_report(
    network: Network,
    plan: Plan,
    diagnostics: Sequence[Diagnostic],
    *,
    version: str,
    run: RunResult | None = None,
    references: Sequence[SourceFile] = (),
) -> str:
    """Return the page. The same input gives the same bytes: no date, no machine name.

    Args:
        network: What was read.
        plan: What was compiled from it.
        diagnostics: Everything found.
        version: Version of fsoe-net.
        run: Result of a run of this plan, if there was one.
        references: Other files the network was compared with.
    """
    body = [
        *_head(network, plan, fingerprint_of(plan), version),
        "<h2>Topology</h2>",
        topology_picture(plan),
        *_connections(plan),
        *_copies(plan),
        *_findings(diagnostics),
        *(_run(run) if run is not None else _no_run()),
        *_files("Input files", network.sources),
        *(_files("Compared with", references) if references else ()),
        *_sign_off(),
    ]
    return html_page(f"FSoE network {network.name}", body)


def _head(network: Network, plan: Plan, fingerprint: Fingerprint, version: str) -> list[str]:
    cycle = f"{plan.cycle_ns / 1000:g} µs" if plan.cycle_ns else "not stated"
    moved = sum(c.size_bytes for c in plan.copies)
    return [
        f"<h1>FSoE network {escape(network.name)}</h1>",
        f'<p class="muted">Configuration report by fsoe-net {escape(version)}</p>',
        '<p class="note">The EtherCAT MainDevice is part of the black channel: it copies FSoE '
        "frames and takes no part in the safety function. This tool is not certified, and this "
        "report is evidence for a review, not a certificate. The safety manuals of the devices "
        "prevail.</p>",
        table(
            ("Fingerprint", "Network"),
            [
                (
                    f'<span class="code">{fingerprint.short}</span><br>'
                    f"<code>{fingerprint.whole}</code>",
                    f"SubDevices: {len(plan.subdevices)}, FSoE connections: "
                    f"{len(plan.connections)}, "
                    f"copies: {len(plan.copies)}, {moved} bytes per bus cycle; bus cycle {cycle}",
                )
            ],
        ),
    ]


def _unknown(value: object, unit: str = "") -> str:
    return '<span class="muted">not stated</span>' if value is None else f"{value}{unit}"


def _connections(plan: Plan) -> list[str]:
    rows = []
    for c in plan.connections:
        address = _unknown(c.address)
        if c.address is not None:
            address = f"{c.address} (0x{c.address:04x})"
        rows.append(
            (
                f"<b>{escape(c.name)}</b><br><span class='muted'>net {escape(c.net)}</span>",
                escape(plan.subdevices[c.main].name),
                escape(plan.subdevices[c.sub].name),
                _unknown(c.connection_id),
                address,
                _unknown(c.watchdog_ms, " ms"),
                f"{c.safe_to_sub} to sub<br>{c.safe_to_main} to main",
                " / ".join(str(plan.copies[n].size_bytes) for n in (c.copy_to_sub, c.copy_to_main)),
            )
        )
    head = (
        "Connection",
        "MainInstance",
        "SubInstance",
        "ConnID",
        "FSoE address",
        "Watchdog",
        "Safe data, bytes",
        "Frames, bytes",
    )
    return ["<h2>Connections</h2>", table(head, rows)]


def _copies(plan: Plan) -> list[str]:
    bases = {f.sm: f.offset_bytes for f in igh_image(plan).fmmus}
    rows = []
    pictures = []
    for number, c in enumerate(plan.copies):
        source = bases.get(c.source_sm, 0) + c.source_bit // 8
        destination = bases.get(c.destination_sm, 0) + c.destination_bit // 8
        name = "standard data" if c.connection == NONE else plan.connections[c.connection].name
        rows.append(
            (
                f"{number}<br><span class='muted'>{escape(name)}</span>",
                str(c.size_bytes),
                f"{escape(copy_end(plan, c.source_sm, c.source_bit))}<br>"
                f"<span class='muted'>IgH image {source} … {source + c.size_bytes - 1}</span>",
                f"{escape(copy_end(plan, c.destination_sm, c.destination_bit))}<br>"
                f"<span class='muted'>IgH image {destination} … {destination + c.size_bytes - 1}"
                "</span>",
            )
        )
        pictures.append(copy_picture(plan, number))
    return [
        "<h2>Copies</h2>",
        "<p>Every bus cycle, unmodified and in the same cycle in which the source arrived. Each "
        "row was proved: input to output, whole bytes inside one sync manager, no byte written "
        "twice, whole frames only, both directions of each connection present.</p>",
        table(("Copy", "Bytes", "From", "To"), rows, "copies"),
        "<h3>Bytes in the sync managers</h3>",
        *(f"<p>Copy {n}</p>{picture}" for n, picture in enumerate(pictures)),
    ]


def _findings(diagnostics: Sequence[Diagnostic]) -> list[str]:
    if not diagnostics:
        return ["<h2>Findings</h2>", '<p class="pass">None.</p>']
    rows = [
        (
            f'<span class="{d.level.value}">{d.code}</span>',
            f"<code>{escape(str(d.span))}</code>",
            escape(d.message)
            + (f"<br><span class='muted'>{escape(d.hint)}</span>" if d.hint else ""),
        )
        for d in diagnostics
    ]
    return ["<h2>Findings</h2>", table(("Code", "Place", "Finding and mend"), rows)]


def _no_run() -> list[str]:
    return [
        "<h2>Run</h2>",
        '<p class="muted">No run is part of this report; <code>--scenario FILE</code> adds one.'
        "</p>",
    ]


def _run(run: RunResult) -> list[str]:
    s = run.statistics
    verdict = (
        '<span class="pass">passed</span>' if run.passed else '<span class="fail">failed</span>'
    )
    rows = [
        (
            escape(c.name),
            escape(state_text(c.state)),
            "-" if c.time_to_data_ms is None else f"{c.time_to_data_ms:.0f} ms",
            f"{c.fsoe_cycle_ms['mean']:.2f} / {c.fsoe_cycle_ms['max']:.2f} ms",
            f"{c.watchdog_ms} ms",
            f"{c.resets}" + (f" ({escape(c.last_reset_text)})" if c.resets else ""),
        )
        for c in run.connections
    ]
    head = (
        "Connection",
        "State at the end",
        "To Data",
        "FSoE cycle mean / max",
        "Watchdog",
        "Resets",
    )
    parts = [
        "<h2>Run</h2>",
        f"<p>Emulated bus, {escape(run.mode)} time, {run.duration_ms / 1000:g} s: {verdict}. "
        f"{s.cycles} bus cycles, {s.wkc_errors} with incomplete working counter, "
        f"{s.bytes_copied} bytes copied.</p>",
        table(head, rows),
    ]
    if run.verdicts:
        judged = [
            (
                '<span class="pass">held</span>'
                if v.held
                else '<span class="fail">not held</span>',
                escape(v.text),
                f"<code>{escape(v.place)}</code>" + (f"<br>{escape(v.seen)}" if v.seen else ""),
            )
            for v in run.verdicts
        ]
        parts.append(table(("Verdict", "Expectation", "Place"), judged))
    return parts


def _files(title: str, files: Sequence[SourceFile]) -> list[str]:
    rows = [(f"<code>{escape(f.path)}</code>", f"<code>{f.sha256}</code>") for f in files]
    return [f"<h2>{title}</h2>", table(("File", "SHA-256"), rows)]


def _sign_off() -> list[str]:
    rows = [("Author", "", "", ""), ("Verifier (independent)", "", "", "")]
    return [
        "<h2>Sign-off</h2>",
        table(("Role", "Name", "Date", "Signature"), rows, "sign"),
    ]
