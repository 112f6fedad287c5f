"""``fsoe-net studio --snapshot``: a network and the current state of its bus as one page."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import click

from fsoe_net.cli.monitor_output import bus_document
from fsoe_net.cli.run_output import health_verdict
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_target
from fsoe_net.core.bus_documents import SubDeviceSnapshot
from fsoe_net.document.model import (
    Cell,
    Column,
    Document,
    Level,
    Part,
    Section,
    Table,
    Verdict,
    cell,
    muted,
    strong,
    words,
)
from fsoe_net.document.write_html import document_html
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.live.attachment import Attachment, BusView
from fsoe_net.live.health import HealthLevel, SubDeviceHealth, health_texts
from fsoe_net.project.check import check_files
from fsoe_net.project.snapshot import snapshot
from fsoe_net.version import __version__


def write_snapshot(
    name: str,
    loading: LoadOptions,
    target: str,
    socket: str | None,
    *,
    may_be_missing: bool,
    overwrite: bool,
) -> None:
    """Write a network and the current state of its bus as one page.

    Args:
        name: The network file.
        loading: How references in it are followed.
        target: The page.
        socket: Control socket of a running ``fsn-master``, or ``None``.
        may_be_missing: Whether the bus alone is shown if the file is missing.
        overwrite: Whether to replace an existing page.

    Raises:
        click.UsageError: The name has not the suffix of a page.
        InputError: The file exists and must not be replaced.
        EnvironmentFault: It cannot be written, or no ``fsn-master`` answers.
    """
    if Path(target).suffix not in (".html", ".htm"):
        raise click.UsageError(f"--snapshot {target}: write a page, .html")
    check_target(target, overwrite=overwrite)
    bus = None if socket is None else _live(socket)
    # Without a network file, a page of the bus alone is still useful.
    if bus is not None and may_be_missing and not os.path.exists(name):
        page, what = bus, f"the bus at {socket}"
    else:
        page, what = snapshot(check_files([name], loading, compared=True), name), name
        if bus is not None:
            page, what = _with_bus(page, bus), f"{name} and the bus at {socket}"
    write_whole(target, document_html(page).encode("utf-8"), overwrite=overwrite)
    echo(f"{target}: {what} as one page, without scripts")


def _live(socket: str) -> Document:
    """Return the current state of a bus.

    Raises:
        EnvironmentFault: No ``fsn-master`` answers.
    """
    with Attachment(socket) as attached:
        view = attached.look(0.0)
        if view.snapshot is None and not view.away:
            view = attached.look(1.0)  # a snapshot may need several attempts between cycles
    if view.away:
        raise EnvironmentFault(view.away)
    shown = bus_document(view)
    parts: list[Part] = [words(shown.title)]
    if view.status is not None:
        plan = f"plan {view.status.plan}, SHA-256 {view.status.plan_sha256}"
        parts.append(words(muted(plan)))
    parts += shown.lead
    if view.snapshot is not None:
        now = view.snapshot.cycle.statistics
        parts.append(words(f"working counter {now.actual_wkc} of {now.expected_wkc}"))
        parts.append(_subdevices(view.health.subdevices))
    return Document(
        title=shown.title,
        subtitle=f"bus at {socket}, seen {datetime.now(UTC):%Y-%m-%d %H:%M:%S} UTC",
        version=__version__,
        verdict=_verdict(view),
        sections=(Section(key="live", title="The bus at this moment", parts=tuple(parts)),),
        foot="part of the black channel, not certified, never a safety function",
    )


def _with_bus(page: Document, bus: Document) -> Document:
    """Return the page of a network with its bus first; the worse verdict applies."""
    verdict = bus.verdict
    if page.verdict is not None and verdict is not None:
        levels = list(Level)
        worse = max(page.verdict, verdict, key=lambda v: levels.index(v.level))
        verdict = Verdict(f"{page.verdict.word}; bus: {verdict.word}", worse.level)
    return replace(
        page,
        subtitle=f"{page.subtitle}; {bus.subtitle}",
        verdict=verdict,
        sections=(*bus.sections, *page.sections),
    )


def _verdict(view: BusView) -> Verdict:
    if view.good:
        return Verdict("every connection in Data, every SubDevice in OP", Level.CLEAR)
    return Verdict("not every connection in Data with its SubDevices in OP", Level.ERROR)


def _subdevices(rows: Sequence[SubDeviceHealth]) -> Table:
    columns = (Column("SubDevice"), Column("AL state"), Column("Ports"), Column("Lost and back"))
    cells = tuple(
        (
            cell(strong(h.name)),
            _al(h),
            cell(_ports(h.seen) or muted("not known")),
            cell(str(h.seen.returns)),
        )
        for h in rows
    )
    return Table(name="subdevices", columns=columns, rows=cells)


def _al(h: SubDeviceHealth) -> Cell:
    if not h.reasons:
        return cell(h.seen.al)
    text = "; ".join(health_texts(h))
    return cell(muted(text) if h.level <= HealthLevel.UNKNOWN else health_verdict(text, h.level))


def _ports(s: SubDeviceSnapshot) -> str:
    return ", ".join(f"{port} {'up' if up else 'open'}" for port, up in enumerate(s.link))
