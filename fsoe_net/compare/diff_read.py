"""Networks, plans, descriptions and scans as sides of a comparison."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

from fsoe_net.compare.diff_side import (
    Side,
    SideCopy,
    SideEnd,
    SideEntry,
    SideFrame,
    SideManager,
    SideSubDevice,
)
from fsoe_net.model.bus import Direction, Entry, Pdo, SubDevice, SyncManager, Watchdog
from fsoe_net.model.described_network import described_connections, described_facts
from fsoe_net.model.description import DescribedConnection, DescribedSubDevice, Description
from fsoe_net.model.layout import DeviceLayout, SmLayout, find_blocks, place_entries
from fsoe_net.model.network import TransferKind
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.safety import SafetyFunction
from fsoe_net.model.scan import Scan, ScannedSm, ScannedSubDevice
from fsoe_net.model.transfer_ends import ResolvedEnd
from fsoe_net.plan.fingerprint import safety_sha256
from fsoe_net.plan.model import NONE, Plan, PlanSubDevice

_WATCHDOGS = ("default", "enable", "disable")


def _placed(
    pdos: Iterable[Pdo], sm: SyncManager
) -> tuple[tuple[SideEntry, ...], tuple[SideFrame, ...], int]:
    placed = place_entries(pdos)
    entries = tuple(
        SideEntry(p.entry.index, p.entry.subindex, p.bit_offset, p.entry.bits)
        for p in placed
        if not p.entry.is_gap
    )
    frames = tuple(
        SideFrame(b.command.address, b.byte_offset, b.frame_bytes) for b in find_blocks(placed, sm)
    )
    return entries, frames, placed[-1].end_bit if placed else 0


def _of_layout(layout: DeviceLayout, *, restart: bool, watchdogs: bool) -> dict[int, SideManager]:
    return {
        sm.sm.index: _manager(sm, restart=restart, watchdogs=watchdogs)
        for sm in layout.managers
        if sm.bits or sm.placed or not sm.complete
    }


def _manager(sm: SmLayout, *, restart: bool, watchdogs: bool) -> SideManager:
    entries = tuple(
        SideEntry(
            p.entry.index,
            p.entry.subindex,
            p.bit_offset,
            p.entry.bits,
            p.entry.restart_relevant if restart else None,
        )
        for p in sm.placed
        if not p.entry.is_gap
    )
    frames = tuple(SideFrame(b.command.address, b.byte_offset, b.frame_bytes) for b in sm.blocks)
    is_stated = watchdogs or sm.sm.watchdog is not Watchdog.DEFAULT
    return SideManager(
        index=sm.sm.index,
        direction=sm.sm.direction.value,
        bits=sm.bits if sm.complete else None,
        entries=entries if sm.complete else None,
        frames=frames,
        watchdog=sm.sm.watchdog.value if is_stated else None,
    )


def side_of_network(resolution: Resolution, path: str) -> Side:
    """Return the side of a network, of a slave YAML or of a transfer YAML on its own."""
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
        described_facts(facts, f"{facts.main} - {facts.sub}")  # its transfers are not there
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
        subdevices=tuple(
            _network_subdevice(s, addresses.get(n, ())) for n, s in enumerate(network.subdevices)
        ),
        copies=tuple(copies),
        connections=tuple(connections),
        functions=network.safety_functions,
        functions_sha256=safety_sha256(network.safety_functions),
    )


def _resolved_end(end: ResolvedEnd, numbers: Mapping[str, int]) -> SideEnd:
    if end.subdevice is None:
        return SideEnd(None, -1, -1, str(end.endpoint))
    number = numbers[end.subdevice.name]
    if end.sm is None or end.placed is None:
        address = f"0x{end.endpoint.index:04x}:{end.endpoint.subindex:02x}"
        return SideEnd(number, -1, -1, address)
    return SideEnd(number, end.sm.sm.index, end.placed.bit_offset, end.placed.entry.address)


def _addresses(connections: Iterable[DescribedConnection]) -> dict[int, tuple[int, ...]]:
    found: dict[int, tuple[int, ...]] = {}
    for c in connections:
        if c.sub is not None and c.address is not None:
            found[c.sub] = (*found.get(c.sub, ()), c.address)
    return found


def _network_subdevice(sub: SubDevice, addresses: tuple[int, ...]) -> SideSubDevice:
    device = sub.device
    managers = None if device is None else _of_layout(device.layout, restart=True, watchdogs=True)
    return SideSubDevice(
        name=sub.name,
        alias=sub.alias,
        position=sub.position,
        identity=None if device is None else (device.vendor_id, device.product_code),
        revision=sub.revision,
        managers=managers,
        sdos=None
        if device is None
        else {(s.index, s.subindex): (s.size_bytes, s.value) for s in device.sdos},
        fsoe_addresses=addresses or None,
    )


def side_of_plan(
    plan: Plan, path: str, functions: tuple[SafetyFunction, ...] | None = None
) -> Side:
    """Return the side of a plan, with its safety functions if they were kept."""
    per_device: dict[int, dict[int, SideManager]] = {}
    ends: dict[int, dict[int, str]] = {}
    restart = _restart_bits(plan)
    frames: dict[int, list[tuple[int, int]]] = {}
    for block in plan.blocks:
        frames.setdefault(block.sm, []).append((block.byte_offset, block.frame_bytes))
    for number, sm in enumerate(plan.sync_managers):
        entries = tuple(
            SideEntry(
                e.index,
                e.subindex,
                e.bit_offset,
                e.bits,
                any((number, b) in restart for b in range(e.bit_offset, e.bit_offset + e.bits)),
            )
            for p in plan.pdos[sm.first_pdo : sm.first_pdo + sm.pdo_count]
            for e in plan.entries[p.first_entry : p.first_entry + p.entry_count]
            if e.index
        )
        at = ends[number] = {e.bit: e.address for e in reversed(entries)}
        if sm.bits or entries:
            per_device.setdefault(sm.subdevice, {})[sm.index] = SideManager(
                index=sm.index,
                direction="output" if sm.is_output else "input",
                bits=sm.bits,
                entries=entries,
                frames=tuple(
                    SideFrame(at.get(8 * byte, f"byte {byte}"), byte, size)
                    for byte, size in frames.get(number, ())
                ),
                watchdog=_WATCHDOGS[sm.watchdog],
            )
    connections = _plan_connections(plan)
    addresses = _addresses(connections)

    def end(sm_number: int, bit: int) -> SideEnd:
        sm = plan.sync_managers[sm_number]
        return SideEnd(sm.subdevice, sm.index, bit, ends[sm_number].get(bit, ""))

    return Side(
        format="plan",
        path=path,
        whole=True,
        cycle_ns=plan.cycle_ns or None,
        subdevices=tuple(
            _plan_subdevice(plan, s, per_device.get(n, {}), addresses.get(n))
            for n, s in enumerate(plan.subdevices)
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


def _restart_bits(plan: Plan) -> set[tuple[int, int]]:
    return {
        (s.sm, bit)
        for s in plan.symbols
        if s.restart_relevant
        for bit in range(s.bit_offset, s.bit_offset + s.bits)
    }


def _plan_subdevice(
    plan: Plan,
    sub: PlanSubDevice,
    managers: dict[int, SideManager],
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
        sdos={
            (s.index, s.subindex): (s.size_bytes, s.value)
            for s in plan.sdos[sub.first_sdo : sub.first_sdo + sub.sdo_count]
        },
        fsoe_addresses=addresses,
    )


def _plan_connections(plan: Plan) -> list[DescribedConnection]:
    numbers = _plan_slots(plan)
    rows = []
    for c in plan.connections:
        down, up = plan.copies[c.copy_to_sub], plan.copies[c.copy_to_main]
        used = {
            numbers.get((down.source_sm, down.source_bit // 8)),
            numbers.get((up.destination_sm, up.destination_bit // 8)),
        }
        slot = used.pop() if len(used) == 1 else None
        rows.append(
            DescribedConnection(
                name=c.name,
                main=None if c.main == NONE else c.main,
                sub=None if c.sub == NONE else c.sub,
                slot=slot,
                address=c.address,
                connection_id=c.connection_id,
                watchdog_ms=c.watchdog_ms,
            )
        )
    return rows


def _plan_slots(plan: Plan) -> dict[tuple[int, int], int]:
    """Return the number of each frame among those of its device and direction."""
    seen: Counter[tuple[int, bool]] = Counter()
    found = {}
    order = sorted(plan.blocks, key=lambda b: (plan.sync_managers[b.sm].index, b.byte_offset))
    for block in order:
        sm = plan.sync_managers[block.sm]
        key = (sm.subdevice, sm.is_output)
        found[block.sm, block.byte_offset] = seen[key]
        seen[key] += 1
    return found


def side_of_description(description: Description) -> Side:
    """Return the side for the content of another tool's file."""
    subdevices = tuple(_described(s) for s in description.subdevices)
    copies = None
    if description.copies or description.format == "eni":
        copies = tuple(
            SideCopy(
                source=_end(subdevices, c.source.subdevice, c.source.sm_index, c.source.bit_offset),
                destination=_end(
                    subdevices,
                    c.destination.subdevice,
                    c.destination.sm_index,
                    c.destination.bit_offset,
                ),
                bits=c.bits,
                kind=None if c.fsoe is None else ("fsoe" if c.fsoe else "standard"),
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
    known = bool(device.vendor_id or device.product_code)
    managers = _of_layout(device.layout, restart=False, watchdogs=False)
    return SideSubDevice(
        name=sub.name or sub.order,
        alias=sub.alias or None,
        position=sub.position,
        identity=(device.vendor_id, device.product_code) if known else None,
        revision=sub.revision,
        managers=managers if managers and not sub.truncated else None,
        sdos=None,
    )


def _end(subdevices: tuple[SideSubDevice, ...], number: int, sm_index: int, bit: int) -> SideEnd:
    managers = subdevices[number].managers or {}
    manager = managers.get(sm_index)
    rows = (manager.entries or ()) if manager is not None else ()
    address = next((e.address for e in rows if e.bit == bit), "")
    return SideEnd(number, sm_index, bit, address)


def side_of_scan(scan: Scan, path: str) -> Side:
    """Return the side of a bus as it was read."""
    return Side(
        format="scan",
        path=path,
        whole=False,
        subdevices=tuple(_scanned(s) for s in scan.subdevices),
    )


def _scanned(sub: ScannedSubDevice) -> SideSubDevice:
    identity = None
    if sub.vendor_id is not None and sub.product_code is not None:
        identity = (sub.vendor_id, sub.product_code)
    return SideSubDevice(
        name=sub.name,
        position=sub.position,
        identity=identity,
        revision=sub.revision,
        managers=None
        if sub.sms is None
        else {s.index: _scanned_manager(sub, s) for s in sub.process_data},
        fsoe_addresses=sub.fsoe.addresses or None if sub.fsoe is not None else None,
    )


def _scanned_manager(sub: ScannedSubDevice, sm: ScannedSm) -> SideManager:
    direction = Direction.OUTPUT if sm.kind == "outputs" else Direction.INPUT
    unread = sm.pdos is None or any(p.entries is None for p in sm.pdos) or not sm.complete
    pdos = [
        Pdo(
            index=p.index,
            entries=tuple(
                Entry(index=e.index, subindex=e.subindex, bits=e.bits) for e in p.entries or ()
            ),
        )
        for p in sm.pdos or ()
    ]
    entries, frames, bits = _placed(pdos, SyncManager(index=sm.index, direction=direction))
    return SideManager(
        index=sm.index,
        direction=direction.value,
        bits=None if unread else bits,
        entries=None if unread else entries,
        frames=frames,
    )
