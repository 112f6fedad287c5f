"""Parameters that were observed on the wire, compared with those of the plan and of the files."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.document.model import Cell, Item, Level, Verdict, cell, muted
from fsoe_net.fsoe.parameters import SeenParameters, differences


def observed_cell(name: str, seen: SeenParameters) -> Cell:
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


def _against(name: str, seen: SeenParameters) -> Iterator[Item]:
    for text in differences(seen.differs, seen.configured, seen.observed):
        yield Verdict(f"{name}: {text}", Level.ERROR)
