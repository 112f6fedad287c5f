"""Parameters that were observed on the wire, compared with those of the plan and of the files."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Protocol

from fsoe_net.document.model import Cell, Item, Level, Verdict, cell, muted
from fsoe_net.fsoe.parameters import FsoeParameters, differences
from fsoe_net.report.inputs import ReportInputs

__all__ = ["observed_cell"]


class Seen(Protocol):
    """A connection of a run, or of a running bus."""

    @property
    def configured(self) -> FsoeParameters: ...
    @property
    def observed(self) -> FsoeParameters: ...
    @property
    def differs(self) -> tuple[str, ...]: ...


def observed_cell(name: str, seen: Seen, inputs: ReportInputs) -> Cell:
    """Return what the MainInstance sent in its last start-up, and what speaks against it."""
    against = tuple(_against(name, seen, inputs))
    if against:
        return against
    o = seen.observed
    if o.watchdog_ms is None:
        return cell(Verdict("not observed", Level.OPEN))
    words = f"ConnID {o.connection_id}, address {o.address}, {o.watchdog_ms} ms"
    if o.app_bytes:
        words += f", {o.app_bytes} bytes of application parameters"
    return cell(Verdict("as stated", Level.CLEAR), muted(words))


def _against(name: str, seen: Seen, inputs: ReportInputs) -> Iterator[Item]:
    for text in differences(seen.differs, seen.configured, seen.observed):
        yield Verdict(f"{name}: {text}", Level.ERROR)
    stated = _application_parameters(name, inputs)
    o = seen.observed
    if stated is None or o.app_bytes is None:
        return
    if o.app_bytes != len(stated):
        text = f"{name}: {o.app_bytes} bytes of application parameters, {len(stated)} stated"
        yield Verdict(text, Level.ERROR)
    elif o.app_crc != zlib.crc32(stated):
        text = f"{name}: other application parameters than stated, {len(stated)} bytes"
        yield Verdict(text, Level.ERROR)


def _application_parameters(name: str, inputs: ReportInputs) -> bytes | None:
    rows = inputs.resolution.connections if inputs.resolution else ()
    found = next((c.facts for c in rows if c.name == name), None)
    return None if found is None else found.app_parameters
