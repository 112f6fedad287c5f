"""FSN444: copies of another file, and the slot of each connection in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

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
        blamed: Names of SubDevices that already have a finding.
    """
    if file.copies:
        _Copies(out, file, subs).check(resolution, {s.name for s in subs.values()} - blamed)


@dataclass(frozen=True, slots=True)
class _Copies:
    """Copies of the file, and the results of looking up the transfers in them.

    ``used``: the first transfer of a copy by its number. ``reported``: transfers with a finding.
    ``covered``: bytes that a transfer writes.
    """

    out: FindingList
    file: Description
    subs: Mapping[int, SubDevice]
    used: dict[int, ResolvedTransfer] = field(default_factory=dict)
    reported: set[int] = field(default_factory=set)
    covered: set[_Byte] = field(default_factory=set)

    def check(self, resolution: Resolution, names: set[str]) -> None:
        """Compare the transfers and copies between SubDevices with these names."""
        sources = self._sources()
        for row in resolution.transfers:
            if row.usable:
                self.covered.update(_own(row.destination, row.transfer.size_bytes))
                if {row.transfer.source.module, row.transfer.destination.module} <= names:
                    self._check_transfer(row, sources)
        nets = resolution.network.nets
        for number, copy in enumerate(self.file.copies):
            ends = self.subs.get(copy.source.subdevice), self.subs.get(copy.destination.subdevice)
            if not {None if sub is None else sub.name for sub in ends} <= names:
                continue
            if number in self.used:
                self._check_longer(copy, self.used[number])
            elif _is_aligned(copy):
                self._add_unknown(copy, nets[0].span if nets else None)

    def _bytes(self, end: DescribedEnd, size: int) -> list[_Byte]:
        name, first = self.subs[end.subdevice].name, end.bit_offset // 8
        return [(name, end.sm_index, first + n) for n in range(size)]

    def _sources(self) -> dict[_Byte, tuple[_Byte, int]]:
        """Return the source of each byte that the file writes, and the number of the copy."""
        sources: dict[_Byte, tuple[_Byte, int]] = {}
        for number, copy in enumerate(self.file.copies):
            known = {copy.source.subdevice, copy.destination.subdevice} <= self.subs.keys()
            if known and _is_aligned(copy):
                ends = (self._bytes(e, _size(copy)) for e in (copy.destination, copy.source))
                sources |= {to: (byte, number) for to, byte in zip(*ends, strict=True)}
        return sources

    def _check_transfer(
        self, row: ResolvedTransfer, sources: Mapping[_Byte, tuple[_Byte, int]]
    ) -> None:
        size = row.transfer.size_bytes
        found = [sources.get(byte) for byte in _own(row.destination, size)]
        # All copies that the transfer touches are marked before the first difference returns.
        for known in found:
            if known is not None:
                self.used.setdefault(known[1], row)
        for n, (known, own) in enumerate(zip(found, _own(row.source, size), strict=True)):
            if known is not None and known[0] != own:
                module, sm, byte = known[0]
                text = f"byte {n} of it comes from {module} SM{sm} byte {byte}"
                self._add(row, text, self.file.copies[known[1]].span)
                return
        copied = size - found.count(None)
        if not copied:
            self._add(row, "it is not copied", self.file.span)
        elif copied < size:
            self._add(row, f"only {counted(copied, 'byte')} of it are copied", self.file.span)

    def _check_longer(self, copy: DescribedCopy, row: ResolvedTransfer) -> None:
        """Report a copy with bytes that no transfer writes; two transfers may be one copy."""
        size = _size(copy)
        more = sum(byte not in self.covered for byte in self._bytes(copy.destination, size))
        if more and row.number not in self.reported:
            self._add(row, f"{counted(size, 'byte')} are copied", copy.span, more)

    def _add(self, row: ResolvedTransfer, text: str, there: Span, more: int = 0) -> None:
        self.reported.add(row.number)
        end = f", {more} of them by no transfer" if more else ""
        self.out.add(
            "FSN444",
            row.transfer.span,
            f"{counted(row.transfer.size_bytes, 'byte')} from {row.transfer.source} to "
            f"{row.transfer.destination}: {text} in {self.file.path}{end}",
            hint="one of the two copies the wrong frames; compare both with the safety project",
            related=(Related(span=there, message="the other file"),),
        )

    def _add_unknown(self, copy: DescribedCopy, net: Span | None) -> None:
        ends = [
            f"{self.subs[end.subdevice].name} SM{end.sm_index} byte {end.bit_offset // 8}"
            for end in (copy.source, copy.destination)
        ]
        self.out.add(
            "FSN444",
            net or self.subs[copy.destination.subdevice].span,
            f"{self.file.path} copies {counted(_size(copy), 'byte')} from {ends[0]} to {ends[1]}; "
            "no transfer does",
            hint="add the transfer here, or take the copy out there",
            related=(Related(span=copy.span, message="the copy"),),
        )


def _size(copy: DescribedCopy) -> int:
    return (copy.bits + 7) // 8


def _is_aligned(copy: DescribedCopy) -> bool:
    """Whether it copies whole bytes; single bits are not a frame."""
    return not copy.source.bit_offset % 8 and not copy.destination.bit_offset % 8


def _own(end: ResolvedEnd, size: int) -> list[_Byte]:
    sm = end.sm.sm.index if end.sm is not None else 0
    return [(end.endpoint.module, sm, end.byte_offset + n) for n in range(size)]


def check_slots(
    out: FindingList,
    resolution: Resolution,
    file: Description,
    subs: Mapping[int, SubDevice],
    blamed: set[str],
) -> None:
    """Compare the connections of a file that gives each slot a partner (``fsoeSlaveIdx``)."""
    partners = _partners(file, subs)
    wrong: list[tuple[Connection, str, DescribedConnection]] = []
    for connection in resolution.connections:
        if {connection.main.name, connection.sub.name} & blamed:
            continue
        known = partners.get((connection.main.name, connection.slot))
        if known is not None and known[0] != connection.sub.name:
            wrong.append((connection, *known))
    reported: set[str] = set()
    for connection, partner, row in wrong:
        main, sub = connection.main.name, connection.sub.name
        if sub in reported:
            continue
        # Two exchanged partners are one mistake and get one finding.
        back = [c.sub.name for c, name, _ in wrong if c.main.name == main and name == sub]
        more = ""
        if back == [partner]:
            reported.add(partner)
            more = ", and the other way round"
        out.add(
            "FSN444",
            connection.to_sub.transfer.span,
            f"slot {connection.slot} of {main} is connected to {sub}, to {partner} in "
            f"{file.path}{more}",
            hint="the order in the safety project decides; compare both with it",
            related=(Related(span=row.span, message="the connection there"),),
        )


def _partners(
    file: Description, subs: Mapping[int, SubDevice]
) -> dict[tuple[str, int | None], tuple[str, DescribedConnection]]:
    """Return the SubInstance, and the row, for each MainInstance and slot of the file."""
    partners: dict[tuple[str, int | None], tuple[str, DescribedConnection]] = {}
    for row in file.connections:
        if row.main is None or row.sub is None or row.slot is None:
            continue
        if row.main in subs and row.sub in subs:
            partners.setdefault((subs[row.main].name, row.slot), (subs[row.sub].name, row))
    return partners
