"""Parameters that were observed on the wire, compared with those of the plan and of the files."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from fsoe_net.document.model import Cell, Item, Level, Verdict, cell, muted
from fsoe_net.fsoe.parameters import FsoeParameters, differences


class _Seen(Protocol):
    """A connection of a run, or of a running bus."""

    @property
    def configured(self) -> FsoeParameters: ...
    @property
    def observed(self) -> FsoeParameters: ...
    @property
    def differs(self) -> tuple[str, ...]: ...


def observed_cell(name: str, seen: _Seen) -> Cell:
    """Return what the MainInstance sent in its last start-up, and what speaks against it."""
    against = tuple(_against(name, seen))
    if against:
        return against
    o = seen.observed
    if o.watchdog_ms is None:
        return cell(Verdict("not observed", Level.OPEN))
    words = f"ConnID {o.connection_id}, address {o.address}, {o.watchdog_ms} ms"
    if not o.app_bytes:
        return cell(Verdict("as stated", Level.CLEAR), muted(words))
    words += f", {o.app_bytes} bytes of application parameters"
    if seen.configured.app_bytes is None:
        words += ", which the network does not state"
        return cell(Verdict("application parameters not compared", Level.OPEN), muted(words))
    return cell(Verdict("as stated", Level.CLEAR), muted(words))


def _against(name: str, seen: _Seen) -> Iterator[Item]:
    for text in differences(seen.differs, seen.configured, seen.observed):
        yield Verdict(f"{name}: {text}", Level.ERROR)
