"""Networks, plans, descriptions and scans in one form, the sides of a comparison.

A fact is ``None`` if the source does not state it; then it is not compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace

from fsoe_net.diag.words import identity_text
from fsoe_net.formats.own.scan_bus import described_manager
from fsoe_net.model.bus import (
    Device,
    Direction,
    Entry,
    Pdo,
    Sdo,
    SubDevice,
    SyncManager,
    Watchdog,
)
from fsoe_net.model.described_network import described_connections, described_facts
from fsoe_net.model.description import (
    DescribedConnection,
    DescribedEnd,
    DescribedSubDevice,
    Description,
)
from fsoe_net.model.layout import DeviceLayout, FsoeBlock, Placed, SmLayout
from fsoe_net.model.network import TransferKind
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.safety import SafetyFunction
from fsoe_net.model.scan import Scan, ScannedSm, ScannedSubDevice
from fsoe_net.model.transfer_ends import ResolvedEnd
from fsoe_net.plan.fingerprint import safety_sha256
from fsoe_net.plan.model import NONE, Plan, PlanBlock, PlanEntry, PlanSdo, PlanSubDevice

_WATCHDOGS = (Watchdog.DEFAULT, Watchdog.ENABLE, Watchdog.DISABLE)
_NO_ENTRY = Entry(index=0, subindex=0, bits=8)
_NO_PDO = Pdo(index=0, entries=())  # PDOs are not compared

Managers = Mapping[int, SmLayout]
"""The sync managers with process data by number."""
Sdos = dict[tuple[int, int], tuple[int, int]]
"""Size and value of start-up SDOs by index and subindex."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SideSubDevice:
    """One SubDevice; ``fsoe_addresses`` are those that the device reports."""

    name: str
    alias: int | None = None
    position: int | None = None
    identity: tuple[int, int] | None = None
    revision: int | None = None
    managers: Managers | None = None
    sdos: Sdos | None = None
    fsoe_addresses: tuple[int, ...] | None = None

    @property
    def place(self) -> tuple[int, int] | None:
        """Its alias and position, if it has a place in a ring."""
        return None if self.position is None else (self.alias or 0, self.position)

    @property
    def title(self) -> str:
        """Its name, or its position."""
        if self.name:
            return self.name
        return "unnamed SubDevice" if self.position is None else f"position {self.position}"

    @property
    def identity_text(self) -> str | None:
        """``vendor 0x00000002, product 0x07703052``."""
        if self.identity is None:
            return None
        return identity_text(*self.identity)


@dataclass(frozen=True, slots=True)
class SideEnd:
    """An end of a copy: number of the SubDevice, and the entry there.

    ``subdevice`` is ``None`` if it is in a file that was not given; ``address`` then names it.
    Without an entry, ``address`` is the sync manager and the bit.
    """

    subdevice: int | None
    address: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SideCopy:
    """One copy; ``kind`` is ``fsoe``, ``standard`` or ``None``."""

    source: SideEnd
    destination: SideEnd
    bits: int
    kind: str | None = None
    net: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """All facts of one source.

    Attributes:
        format: ``network``, ``plan``, ``scan``, ``eni`` and so on.
        path: Path of the source.
        whole: ``None`` inside it means *not set*, which differs from a value on the other side.
        cycle_ns: Cycle of the bus; with several buses, of the first one.
        bus_cycles: Cycles of all buses except the first, by name.
        copies: ``None`` if the source has no copies, such as an ESI or a scan.
        connections: Likewise.
        functions: Likewise, and for a plan, which contains only
        functions_sha256: their hash; empty without any.
    """

    format: str
    path: str
    whole: bool
    cycle_ns: int | None = None
    bus_cycles: Mapping[str, int | None] = field(default_factory=dict)
    subdevices: tuple[SideSubDevice, ...] = ()
    copies: tuple[SideCopy, ...] | None = None
    connections: tuple[DescribedConnection, ...] | None = None
    functions: tuple[SafetyFunction, ...] | None = None
    functions_sha256: str | None = None


def _managers(device: Device) -> Managers:
    rows = device.layout.managers
    return {sm.sm.index: sm for sm in rows if sm.bits or sm.placed or not sm.complete}


def _sdos(rows: Iterable[Sdo | PlanSdo]) -> Sdos:
    return {(s.index, s.subindex): (s.size_bytes, s.value) for s in rows}


class _Ends:
    """Ends of copies by their entries, whose addresses stay the same when they move."""

    def __init__(self) -> None:
        self._addresses: dict[tuple[int, int], dict[int, str]] = {}

    def at(self, number: int, managers: Managers | None, sm_index: int, bit: int) -> SideEnd:
        """Return an end; the entries of a sync manager are read once for all copies."""
        manager = (managers or {}).get(sm_index)
        if manager is not None and manager.complete:
            found = self._addresses.get((number, sm_index))
            if found is None:
                # Reversed: entries without a length share a bit, and the first one counts.
                rows = (row for row in reversed(manager.placed) if not row.entry.is_gap)
                found = {row.bit_offset: row.entry.address for row in rows}
                self._addresses[number, sm_index] = found
            if bit in found:
                return SideEnd(number, found[bit])
        return SideEnd(number, f"SM{sm_index} bit {bit}")


# -- networks -------------------------------------------------------------------------------------


def side_of_network(resolution: Resolution, path: str) -> Side:
    """Return the side of a network, or of a slave YAML or transfer YAML alone."""
    network = resolution.network
    numbers = resolution.numbers
    copies = [
        SideCopy(
            source=_resolved_end(row.source, numbers),
            destination=_resolved_end(row.destination, numbers),
            bits=8 * row.transfer.size_bytes,
            kind=row.transfer.kind.value,
            net=row.net.name,
        )
        for row in resolution.transfers
    ]
    used = {(c.net_number, c.facts_number) for c in resolution.connections}
    connections = [
        described_facts(facts, f"{facts.main} - {facts.sub}")  # its transfers are in another file
        for net_number, net in enumerate(network.nets)
        for number, facts in enumerate(net.connections)
        if (net_number, number) not in used
    ]
    connections += described_connections(resolution)
    addresses = _addresses(connections)
    return Side(
        format="network",
        path=path,
        whole=True,
        cycle_ns=network.cycle_ns,
        bus_cycles={bus.name: bus.cycle_ns for bus in network.buses[1:]},
        subdevices=tuple(
            _network_subdevice(s, addresses.get(n)) for n, s in enumerate(network.subdevices)
        ),
        copies=tuple(copies),
        connections=tuple(connections),
        functions=network.safety_functions,
        functions_sha256=safety_sha256(network.safety_functions),
    )


def _resolved_end(end: ResolvedEnd, numbers: Mapping[str, int]) -> SideEnd:
    if end.subdevice is None:
        return SideEnd(None, str(end.endpoint))
    address = f"0x{end.endpoint.index:04x}:{end.endpoint.subindex:02x}"
    return SideEnd(numbers[end.subdevice.name], address)


def _addresses(connections: Iterable[DescribedConnection]) -> dict[int, tuple[int, ...]]:
    addresses: dict[int, tuple[int, ...]] = {}
    for c in connections:
        if c.sub is not None and c.address is not None:
            addresses[c.sub] = (*addresses.get(c.sub, ()), c.address)
    return addresses


def _network_subdevice(sub: SubDevice, addresses: tuple[int, ...] | None) -> SideSubDevice:
    side = SideSubDevice(
        name=sub.name,
        alias=sub.alias,
        position=sub.position,
        revision=sub.revision,
        fsoe_addresses=addresses,
    )
    if sub.device is None:
        return side
    return replace(
        side,
        identity=sub.device.identity,
        managers=_managers(sub.device),
        sdos=_sdos(sub.device.sdos),
    )


# -- plans ----------------------------------------------------------------------------------------


def side_of_plan(
    plan: Plan, path: str, functions: tuple[SafetyFunction, ...] | None = None
) -> Side:
    """Return the side of a plan, with its safety functions if they were kept."""
    managers = _plan_managers(plan)
    connections = _plan_connections(plan, managers)
    addresses = _addresses(connections)
    ends = _Ends()

    def end(sm_number: int, bit: int) -> SideEnd:
        sm = plan.sync_managers[sm_number]
        return ends.at(sm.subdevice, managers[sm.subdevice], sm.index, bit)

    return Side(
        format="plan",
        path=path,
        whole=True,
        cycle_ns=plan.cycle_ns or None,
        bus_cycles={bus.name: bus.cycle_ns or None for bus in plan.buses[1:]},
        subdevices=tuple(
            _plan_subdevice(plan, sub, managers[n], addresses.get(n))
            for n, sub in enumerate(plan.subdevices)
        ),
        copies=tuple(
            SideCopy(
                source=end(c.source_sm, c.source_bit),
                destination=end(c.destination_sm, c.destination_bit),
                bits=c.bits,
                kind=(TransferKind.FSOE if c.kind == 1 else TransferKind.STANDARD).value,
                net=c.net,
            )
            for c in plan.copies
        ),
        connections=tuple(connections),
        functions=functions,
        functions_sha256=plan.safety_sha256,
    )


def _plan_managers(plan: Plan) -> list[dict[int, SmLayout]]:
    """Return the sync managers of each SubDevice; their frames are those in the plan."""
    restart = {
        (s.sm, bit)
        for s in plan.symbols
        if s.restart_relevant
        for bit in range(s.bit_offset, s.bit_offset + s.bits)
    }
    frames: dict[int, list[PlanBlock]] = {}
    for block in plan.blocks:
        frames.setdefault(block.sm, []).append(block)
    managers: list[dict[int, SmLayout]] = [{} for _ in plan.subdevices]
    for number, sm in enumerate(plan.sync_managers):
        layout = _plan_manager(plan, number, restart, frames.get(number, ()))
        if layout.bits or layout.placed:
            managers[sm.subdevice][sm.index] = layout
    return managers


def _plan_manager(
    plan: Plan, number: int, restart: Set[tuple[int, int]], frames: Iterable[PlanBlock]
) -> SmLayout:
    sm = plan.sync_managers[number]
    direction = Direction.OUTPUT if sm.is_output else Direction.INPUT
    placed = tuple(
        _plan_entry(number, row, restart)
        for pdo in plan.pdos[sm.first_pdo : sm.first_pdo + sm.pdo_count]
        for row in plan.entries[pdo.first_entry : pdo.first_entry + pdo.entry_count]
    )
    starts = {row.bit_offset: row.entry for row in reversed(placed)}
    blocks = tuple(
        FsoeBlock(
            byte_offset=block.byte_offset,
            frame_bytes=block.frame_bytes,
            command=starts.get(8 * block.byte_offset, _NO_ENTRY),
            direction=direction,
            sm_index=sm.index,
        )
        for block in frames
    )
    return SmLayout(
        number=number,
        sm=SyncManager(index=sm.index, direction=direction, watchdog=_WATCHDOGS[sm.watchdog]),
        placed=placed,
        bits=sm.bits,
        known_bits=sm.bits,
        complete=True,
        blocks=blocks,
    )


def _plan_entry(sm: int, row: PlanEntry, restart: Set[tuple[int, int]]) -> Placed:
    bits = range(row.bit_offset, row.bit_offset + row.bits)
    entry = Entry(
        index=row.index,
        subindex=row.subindex,
        bits=row.bits,
        restart_relevant=any((sm, bit) in restart for bit in bits),
    )
    return Placed(entry=entry, pdo=_NO_PDO, pdo_number=0, bit_offset=row.bit_offset)


def _plan_subdevice(
    plan: Plan,
    sub: PlanSubDevice,
    managers: Managers,
    addresses: tuple[int, ...] | None,
) -> SideSubDevice:
    one = sub.revision_low == sub.revision_high
    return SideSubDevice(
        name=sub.name,
        alias=sub.alias,
        position=sub.position,
        identity=(sub.vendor_id, sub.product_code),
        revision=sub.revision_low if one else None,
        managers=managers,
        sdos=_sdos(plan.sdos[sub.first_sdo : sub.first_sdo + sub.sdo_count]),
        fsoe_addresses=addresses,
    )


def _plan_connections(plan: Plan, managers: Sequence[Managers]) -> list[DescribedConnection]:
    slots = [
        DeviceLayout(managers=tuple(rows[n] for n in sorted(rows)), partners={}).slots
        for rows in managers
    ]

    def slot(sm_number: int, bit: int) -> int | None:
        sm = plan.sync_managers[sm_number]
        return slots[sm.subdevice].get((sm.index, bit // 8))

    rows = []
    for c in plan.connections:
        down, up = plan.copies[c.copy_to_sub], plan.copies[c.copy_to_main]
        first, second = (
            slot(down.source_sm, down.source_bit),
            slot(up.destination_sm, up.destination_bit),
        )
        rows.append(
            DescribedConnection(
                name=c.name,
                main=None if c.main == NONE else c.main,
                sub=None if c.sub == NONE else c.sub,
                # A logic has one slot for both directions of a connection.
                slot=first if first == second else None,
                address=c.address,
                connection_id=c.connection_id,
                watchdog_ms=c.watchdog_ms,
                app_parameters=bytes.fromhex(c.app_parameters),
            )
        )
    return rows


# -- descriptions of other tools ------------------------------------------------------------------


def side_of_description(description: Description) -> Side:
    """Return the side for the content of another tool's file."""
    subdevices = tuple(_described(s) for s in description.subdevices)
    ends = _Ends()

    def end(row: DescribedEnd) -> SideEnd:
        managers = subdevices[row.subdevice].managers
        return ends.at(row.subdevice, managers, row.sm_index, row.bit_offset)

    copies = None
    # An ENI without copies copies nothing; other files without copies do not state them.
    if description.copies or description.format == "eni":
        copies = tuple(
            SideCopy(
                source=end(c.source),
                destination=end(c.destination),
                bits=c.bits,
                kind={None: None, True: "fsoe", False: "standard"}[c.fsoe],
            )
            for c in description.copies
        )
    cycle_us = description.cycle_us
    return Side(
        format=description.format,
        path=description.path,
        whole=False,
        cycle_ns=None if cycle_us is None else 1000 * cycle_us,
        subdevices=subdevices,
        copies=copies,
        connections=description.connections or None,
    )


def _described(sub: DescribedSubDevice) -> SideSubDevice:
    device = sub.device
    managers = None if sub.truncated else _managers(device)
    return SideSubDevice(
        name=sub.name or sub.order,
        alias=sub.alias or None,
        position=sub.position,
        identity=device.identity if any(device.identity) else None,
        revision=sub.revision,
        managers=managers or None,
    )


# -- scans ----------------------------------------------------------------------------------------


def side_of_scan(scan: Scan, path: str) -> Side:
    """Return the side of a scanned bus."""
    subdevices = tuple(_scanned(s) for s in scan.subdevices)
    return Side(format="scan", path=path, whole=False, subdevices=subdevices)


def _scanned(sub: ScannedSubDevice) -> SideSubDevice:
    managers = None
    if sub.sms is not None:
        managers = {sm.index: _scanned_manager(sm) for sm in sub.process_data}
    return SideSubDevice(
        name=sub.name,
        position=sub.position,
        identity=sub.numbers,
        revision=sub.revision,
        managers=managers,
        fsoe_addresses=None if sub.fsoe is None else sub.fsoe.addresses or None,
    )


def _scanned_manager(sm: ScannedSm) -> SmLayout:
    is_read = sm.complete and sm.pdos is not None and all(p.is_read for p in sm.pdos)
    device = Device(path="", vendor_id=0, product_code=0, sync_managers=(described_manager(sm),))
    return replace(device.layout.managers[0], complete=is_read)
