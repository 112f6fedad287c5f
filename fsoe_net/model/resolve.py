"""From names to bytes: which block of which sync manager each end of a transfer means.

Pure functions on the model; rules turn what does not resolve into diagnostics, the plan takes what
does.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

from fsoe_net.model.bus import Device, Direction, SubDevice
from fsoe_net.model.layout import DeviceLayout, FsoeBlock, Placed, SmLayout, layout_of
from fsoe_net.model.network import ConnectionFacts, Endpoint, Net, Network, Transfer, TransferKind

__all__ = [
    "Connection",
    "Miss",
    "Resolution",
    "ResolvedEnd",
    "ResolvedTransfer",
    "main_instance_of",
    "partner_block",
    "resolve",
    "shared_modules",
]


class Miss(enum.Enum):
    """Why an end of a transfer means no bytes."""

    MODULE = "module is not known"
    DEVICE = "device description could not be read"
    ENTRY = "entry is not mapped"
    SKIPPED = "entry is marked skip"
    GAP = "entry is padding"
    LAYOUT = "layout is not known offline"


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedEnd:
    """One end of a transfer. ``miss`` is ``None`` when all other fields are set."""

    endpoint: Endpoint
    subdevice: SubDevice | None = None
    layout: DeviceLayout | None = None
    sm: SmLayout | None = None
    placed: Placed | None = None
    miss: Miss | None = None

    @property
    def block(self) -> FsoeBlock | None:
        """The recognised FSoE frame the entry lies in, or ``None``."""
        if self.sm is None or self.placed is None:
            return None
        return self.sm.block_at(self.placed.bit_offset)

    @property
    def byte_offset(self) -> int:
        """Byte inside the sync manager where the copy starts (bits are dropped, as memcpy does)."""
        return self.placed.bit_offset // 8 if self.placed is not None else 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedTransfer:
    """A transfer of a net with both ends looked up."""

    net: Net
    transfer: Transfer
    source: ResolvedEnd
    destination: ResolvedEnd

    @property
    def found(self) -> bool:
        """Whether both ends mean bytes."""
        return self.source.miss is None and self.destination.miss is None

    @property
    def usable(self) -> bool:
        """Whether both ends mean bytes and the direction is input to output."""
        return (
            self.found
            and self.source.sm is not None
            and self.destination.sm is not None
            and self.source.sm.sm.direction is Direction.INPUT
            and self.destination.sm.sm.direction is Direction.OUTPUT
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Connection:
    """Two FSoE transfers in opposite directions between a MainInstance and a SubInstance."""

    name: str
    net: Net
    main: SubDevice
    sub: SubDevice
    slot: int
    to_sub: ResolvedTransfer
    to_main: ResolvedTransfer
    facts: ConnectionFacts | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """A network with every layout, transfer and connection worked out.

    ``layouts`` has one row per SubDevice, in bus order. ``single`` are FSoE transfers that found no
    partner in the opposite direction.
    """

    network: Network
    layouts: tuple[DeviceLayout | None, ...]
    transfers: tuple[ResolvedTransfer, ...]
    connections: tuple[Connection, ...]
    single: tuple[ResolvedTransfer, ...]
    unmatched_facts: tuple[tuple[Net, ConnectionFacts], ...]


def resolve(network: Network) -> Resolution:
    """Work out layouts, transfer ends and connections of a network. Never raises."""
    layouts = _Layouts()
    by_name: dict[str, SubDevice] = {}
    for sub in network.subdevices:
        by_name.setdefault(sub.name, sub)
    finder = _Finder(by_name, layouts)
    transfers = tuple(
        ResolvedTransfer(
            net=net,
            transfer=transfer,
            source=finder.end(transfer.source),
            destination=finder.end(transfer.destination),
        )
        for net in network.nets
        for transfer in net.transfers
    )
    connections, single, unmatched = _pair(network, transfers, by_name)
    return Resolution(
        network=network,
        layouts=tuple(
            layouts.of(s.device) if s.device is not None else None for s in network.subdevices
        ),
        transfers=transfers,
        connections=connections,
        single=single,
        unmatched_facts=unmatched,
    )


class _Layouts:
    """Layouts by device object: a hundred equal terminals are placed once."""

    def __init__(self) -> None:
        self._known: dict[int, DeviceLayout] = {}

    def of(self, device: Device) -> DeviceLayout:
        found = self._known.get(id(device))
        if found is None:
            found = self._known[id(device)] = layout_of(device)
        return found


class _Finder:
    """Looks up transfer ends the way the driver does."""

    def __init__(self, by_name: dict[str, SubDevice], layouts: _Layouts) -> None:
        self._by_name = by_name
        self._layouts = layouts
        self._entries: dict[int, dict[tuple[int, int], tuple[SmLayout, Placed]]] = {}

    def end(self, endpoint: Endpoint) -> ResolvedEnd:
        sub = self._by_name.get(endpoint.module)
        if sub is None:
            return ResolvedEnd(endpoint=endpoint, miss=Miss.MODULE)
        if sub.device is None:
            return ResolvedEnd(endpoint=endpoint, subdevice=sub, miss=Miss.DEVICE)
        layout = self._layouts.of(sub.device)
        if endpoint.index == 0:
            return ResolvedEnd(endpoint=endpoint, subdevice=sub, layout=layout, miss=Miss.GAP)
        hit = self._index(sub.device, layout).get((endpoint.index, endpoint.subindex))
        if hit is None:
            complete = all(sm.complete for sm in layout.managers)
            miss = Miss.ENTRY if complete else Miss.LAYOUT
            return ResolvedEnd(endpoint=endpoint, subdevice=sub, layout=layout, miss=miss)
        sm, placed = hit
        return ResolvedEnd(
            endpoint=endpoint,
            subdevice=sub,
            layout=layout,
            sm=sm,
            placed=placed,
            miss=_doubt(sm, placed),
        )

    def _index(
        self, device: Device, layout: DeviceLayout
    ) -> dict[tuple[int, int], tuple[SmLayout, Placed]]:
        known = self._entries.get(id(device))
        if known is None:
            known = {}
            for sm in layout.managers:
                for placed in sm.placed:
                    if not placed.entry.is_gap:
                        known.setdefault((placed.entry.index, placed.entry.subindex), (sm, placed))
            self._entries[id(device)] = known
        return known


def _doubt(sm: SmLayout, placed: Placed) -> Miss | None:
    if placed.entry.skip:
        return Miss.SKIPPED
    return Miss.LAYOUT if placed.end_bit > sm.known_bits else None


def shared_modules(ends: list[tuple[str, str]]) -> set[str]:
    """Return the modules that every one of these transfers touches."""
    return set(ends[0]).intersection(*map(set, ends[1:])) if ends else set()


def main_instance_of(net: Net, ends: list[tuple[str, str]]) -> str | None:
    """Return the name of the SubDevice with the MainInstance of a net.

    The file says it (``safety_master``); without that, the one SubDevice all FSoE transfers share.
    """
    if net.safety_master is not None:
        return net.safety_master
    common = shared_modules(ends)
    return common.pop() if len(common) == 1 else None


def _pair(
    network: Network, transfers: tuple[ResolvedTransfer, ...], by_name: dict[str, SubDevice]
) -> tuple[
    tuple[Connection, ...],
    tuple[ResolvedTransfer, ...],
    tuple[tuple[Net, ConnectionFacts], ...],
]:
    per_net: dict[int, list[ResolvedTransfer]] = {}
    for item in transfers:
        if item.transfer.kind is TransferKind.FSOE:
            per_net.setdefault(id(item.net), []).append(item)
    connections: list[Connection] = []
    single: list[ResolvedTransfer] = []
    unmatched: list[tuple[Net, ConnectionFacts]] = []
    names: dict[str, int] = {}
    for net in network.nets:
        rows = per_net.get(id(net), [])
        ends = [(r.transfer.source.module, r.transfer.destination.module) for r in rows]
        main_name = main_instance_of(net, ends)
        facts: dict[tuple[str, str, int], ConnectionFacts] = {}
        for fact in net.connections:
            if facts.setdefault((fact.main, fact.sub, fact.slot), fact) is not fact:
                unmatched.append((net, fact))  # stated twice
        for (main, sub), (to_sub, to_main) in _by_partner(rows, main_name).items():
            couples, alone = _couple(to_sub, to_main)
            single.extend(alone)
            for slot, (down, up) in enumerate(couples):
                known = facts.pop((main, sub, slot), None)
                if main not in by_name or sub not in by_name:
                    continue
                connections.append(
                    Connection(
                        name=_unique(f"{main}-{sub}", names),
                        net=net,
                        main=by_name[main],
                        sub=by_name[sub],
                        slot=slot,
                        to_sub=down,
                        to_main=up,
                        facts=known,
                    )
                )
        unmatched.extend((net, fact) for fact in facts.values())
    return tuple(connections), tuple(single), tuple(unmatched)


def _unique(name: str, used: dict[str, int]) -> str:
    used[name] = used.get(name, 0) + 1
    return name if used[name] == 1 else f"{name}-{used[name]}"


_Rows = list[ResolvedTransfer]


def _by_partner(rows: _Rows, main_name: str | None) -> dict[tuple[str, str], tuple[_Rows, _Rows]]:
    """Group transfers by (main, sub); rules speak about those that miss the MainInstance."""
    groups: dict[tuple[str, str], tuple[_Rows, _Rows]] = {}
    for row in rows:
        source, destination = row.transfer.source.module, row.transfer.destination.module
        if main_name is None or main_name not in (source, destination):
            # Without a MainInstance the two directions still belong together: take either order.
            main, sub = sorted((source, destination))
        elif source == main_name:
            main, sub = source, destination
        else:
            main, sub = destination, source
        down, up = groups.setdefault((main, sub), ([], []))
        (down if source == main else up).append(row)
    return groups


def _couple(
    to_sub: _Rows, to_main: _Rows
) -> tuple[list[tuple[ResolvedTransfer, ResolvedTransfer]], _Rows]:
    """Match the two directions of each connection between one pair of SubDevices.

    First by the blocks they use (a device's output block has one input block as partner), then in
    file order for what the blocks do not tell.
    """
    couples: list[tuple[ResolvedTransfer, ResolvedTransfer]] = []
    left_up = list(to_main)
    waiting: _Rows = []
    for down in to_sub:
        match = next((up for up in left_up if _blocks_agree(down, up)), None)
        if match is None:
            waiting.append(down)
        else:
            left_up.remove(match)
            couples.append((down, match))
    couples.extend(zip(waiting, left_up, strict=False))
    matched = min(len(waiting), len(left_up))
    order = {id(row): n for n, row in enumerate(to_sub)}
    couples.sort(key=lambda pair: order[id(pair[0])])
    return couples, waiting[matched:] + left_up[matched:]


def _blocks_agree(down: ResolvedTransfer, up: ResolvedTransfer) -> bool:
    sub_ok = partner_block(down.destination) == _key(up.source)
    main_ok = partner_block(up.destination) == _key(down.source)
    return sub_ok and main_ok


def _key(end: ResolvedEnd) -> tuple[int, int] | None:
    block = end.block
    return block.key if block is not None else None


def partner_block(end: ResolvedEnd) -> tuple[int, int] | None:
    """Return the key of the input frame that belongs to the output frame this end means.

    ``None`` when the end is no output frame or the device shows no such partner.
    """
    block = end.block
    if block is None or end.layout is None or block.direction is not Direction.OUTPUT:
        return None
    return end.layout.partners.get(block.key)
