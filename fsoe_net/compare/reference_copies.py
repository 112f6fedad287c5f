"""FSN444: copies of another file, and the slot of each connection in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import FindingList, Related, Span
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.description import (
    DescribedConnection,
    DescribedCopy,
    DescribedEnd,
    Description,
)
from fsoe_net.model.resolve import Connection, Resolution
from fsoe_net.model.transfer_ends import ResolvedEnd, ResolvedTransfer

_Byte = tuple[str, int, int]  # SubDevice, sync manager, byte


@dataclass(frozen=True, slots=True)
class _Copied:
    """Where a byte comes from by the other file, and by which of its copies."""

    source: _Byte
    number: int


def check_copies(
    out: FindingList,
    resolution: Resolution,
    file: Description,
    subs: Mapping[int, SubDevice],
    blamed: set[str],
) -> None:
    """Compare copies byte by byte; those of SubDevices that already differ are skipped.

    Args:
        out: Takes the findings.
        resolution: The network.
        file: The other file; may be without copies.
        subs: SubDevice of the network by its number in the file.
        blamed: Names of SubDevices that have a finding.
    """
    if not file.copies:
        return
    copied = _bytes_of(file, subs)
    names = {s.name for s in subs.values()} - blamed
    seen = _Seen({}, set(), set())
    for row in resolution.transfers:
        if not row.usable:
            continue
        size = row.transfer.size_bytes
        seen.covered.update(_own(row.destination, n) for n in range(size))
        if {row.transfer.source.module, row.transfer.destination.module} <= names:
            _transfer(out, row, file, copied, seen)
    for number, copy in enumerate(file.copies):
        source, destination = subs.get(copy.source.subdevice), subs.get(copy.destination.subdevice)
        if source is None or destination is None or not {source.name, destination.name} <= names:
            continue
        if number in seen.used:
            _longer(out, seen.used[number], file, number, subs, seen)
        elif not copy.source.bit_offset % 8 and not copy.destination.bit_offset % 8:
            _unknown(out, resolution, file, copy, source, destination)


@dataclass(frozen=True, slots=True)
class _Seen:
    """Copies of the file by their first transfer, transfers with a finding, bytes written here."""

    used: dict[int, ResolvedTransfer]
    reported: set[int]
    covered: set[_Byte]


def _bytes_of(file: Description, subs: Mapping[int, SubDevice]) -> dict[_Byte, _Copied]:
    found: dict[_Byte, _Copied] = {}
    for number, copy in enumerate(file.copies):
        source, destination = copy.source, copy.destination
        if source.subdevice not in subs or destination.subdevice not in subs:
            continue
        if source.bit_offset % 8 or destination.bit_offset % 8:
            continue  # single bits: no frame
        for byte in range((copy.bits + 7) // 8):
            found[_byte(subs, destination, byte)] = _Copied(_byte(subs, source, byte), number)
    return found


def _byte(subs: Mapping[int, SubDevice], end: DescribedEnd, byte: int) -> _Byte:
    return (subs[end.subdevice].name, end.sm_index, end.bit_offset // 8 + byte)


def _own(end: ResolvedEnd, byte: int) -> _Byte:
    index = end.sm.sm.index if end.sm is not None else 0
    return (end.endpoint.module, index, end.byte_offset + byte)


def _transfer(
    out: FindingList,
    row: ResolvedTransfer,
    file: Description,
    copied: dict[_Byte, _Copied],
    seen: _Seen,
) -> None:
    size = row.transfer.size_bytes
    rows = [copied.get(_own(row.destination, n)) for n in range(size)]
    for found in rows:
        if found is not None:
            seen.used.setdefault(found.number, row)
    missing = sum(c is None for c in rows)
    there = file.span
    text = ""
    for n, found in enumerate(rows):
        if found is not None and found.source != _own(row.source, n):
            there = file.copies[found.number].span
            module, sm, byte = found.source
            text = f"byte {n} of it comes from {module} SM{sm} byte {byte}"
            break
    else:
        if missing == size:
            text = "it is not copied"
        elif missing:
            text = f"only {counted(size - missing, 'byte')} of it are copied"
    if text:
        seen.reported.add(row.number)
        _other(out, row, f"{text} in {file.path}", there)


def _other(out: FindingList, row: ResolvedTransfer, text: str, there: Span) -> None:
    out.add(
        "FSN444",
        row.transfer.span,
        f"{counted(row.transfer.size_bytes, 'byte')} from {row.transfer.source} to "
        f"{row.transfer.destination}: {text}",
        hint="one of the two connects other frames; compare both with the safety project",
        related=(Related(span=there, message="the other file"),),
    )


def _longer(
    out: FindingList,
    row: ResolvedTransfer,
    file: Description,
    number: int,
    subs: Mapping[int, SubDevice],
    seen: _Seen,
) -> None:
    """Name a copy that writes bytes which no transfer writes; two transfers may be one copy."""
    copy = file.copies[number]
    size = (copy.bits + 7) // 8
    more = sum(_byte(subs, copy.destination, n) not in seen.covered for n in range(size))
    if more and row.number not in seen.reported:
        text = f"{counted(size, 'byte')} are copied in {file.path}, {more} of them by no transfer"
        _other(out, row, text, copy.span)


def _unknown(
    out: FindingList,
    resolution: Resolution,
    file: Description,
    copy: DescribedCopy,
    source: SubDevice,
    destination: SubDevice,
) -> None:
    nets = resolution.network.nets
    out.add(
        "FSN444",
        nets[0].span if nets else destination.span,
        f"{file.path} copies {counted((copy.bits + 7) // 8, 'byte')} from {source.name} "
        f"SM{copy.source.sm_index} byte {copy.source.bit_offset // 8} to {destination.name} "
        f"SM{copy.destination.sm_index} byte {copy.destination.bit_offset // 8}; no transfer does",
        hint="add the transfer here, or take the copy out there",
        related=(Related(span=copy.span, message="the copy"),),
    )


def check_slots(
    out: FindingList,
    resolution: Resolution,
    file: Description,
    subs: Mapping[int, SubDevice],
    blamed: set[str],
) -> None:
    """Compare the connections of a file that gives each slot a partner: ``fsoeSlaveIdx``."""
    wanted = _partners(file, subs)
    wrong: dict[tuple[str, int], tuple[Connection, str, DescribedConnection]] = {}
    for connection in resolution.connections:
        slot = connection.slot
        if slot is None or {connection.main.name, connection.sub.name} & blamed:
            continue
        place = (connection.main.name, slot)
        partner, row = wanted.get(place, (connection.sub.name, None))
        if row is not None and partner != connection.sub.name:
            wrong[place] = (connection, partner, row)
    reported: set[str] = set()
    for (main, slot), (connection, partner, row) in wrong.items():
        if connection.sub.name in reported:
            continue
        back = [
            c.sub.name
            for (m, _), (c, name, _) in wrong.items()
            if m == main and name == connection.sub.name
        ]
        more = ""
        if back == [partner]:
            reported.add(partner)
            more = ", and the other way round"
        out.add(
            "FSN444",
            connection.to_sub.transfer.span,
            f"slot {slot} of {main} is connected to {connection.sub.name}, to {partner} in "
            f"{file.path}{more}",
            hint="the order in the safety project decides; compare both with it",
            related=(Related(span=row.span, message="the connection there"),),
        )


def _partners(
    file: Description, subs: Mapping[int, SubDevice]
) -> dict[tuple[str, int], tuple[str, DescribedConnection]]:
    """Return the SubInstance, and the row, for each MainInstance and slot of the file."""
    found: dict[tuple[str, int], tuple[str, DescribedConnection]] = {}
    for row in file.connections:
        if row.main is None or row.sub is None or row.slot is None:
            continue
        if row.main in subs and row.sub in subs:
            found.setdefault((subs[row.main].name, row.slot), (subs[row.sub].name, row))
    return found
