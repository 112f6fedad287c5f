"""Model to plan: numbers every record, resolves every copy to sync manager and bit offset."""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import field
from itertools import accumulate
from typing import TypeVar

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.pause import without_collector
from fsoe_net.errors import InputError
from fsoe_net.fsoe.pdu import safe_data_length
from fsoe_net.model.bus import Direction, Entry, EntryView, SubDevice, Watchdog
from fsoe_net.model.layout import SmLayout
from fsoe_net.model.names import Names
from fsoe_net.model.network import TransferKind
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.symbols import DeviceSymbol, device_symbols
from fsoe_net.model.transfer_ends import ResolvedEnd, ResolvedTransfer
from fsoe_net.plan.fingerprint import safety_sha256
from fsoe_net.plan.model import (
    NONE,
    Plan,
    PlanBlock,
    PlanBus,
    PlanConnection,
    PlanCopy,
    PlanEntry,
    PlanGroup,
    PlanPdo,
    PlanSdo,
    PlanSubDevice,
    PlanSymbol,
    PlanSyncManager,
)

_WATCHDOG = {Watchdog.DEFAULT: 0, Watchdog.ENABLE: 1, Watchdog.DISABLE: 2}
_ANY_REVISION = (0, 0xFFFFFFFF)
_Row = TypeVar("_Row")
_SIGNED, _REAL = 2, 4
_REAL_FORMAT = {32: "<f", 64: "<d"}


@without_collector
def compile_plan(resolution: Resolution) -> Plan:
    """Compile a network without errors.

    Raises:
        InputError: A transfer does not resolve to bytes, or an FSoE transfer has no partner. The
            rules report the place, so run `fsoe_net.rules.check.check` first.
    """
    for row in resolution.transfers:
        if not row.usable or row.transfer.size_bytes == 0:
            raise InputError(
                f"{row.transfer.span}: {row.transfer.source} -> {row.transfer.destination} does "
                "not resolve to bytes; `fsoe-net check` shows the reason"
            )
    if resolution.single:
        span = resolution.single[0].transfer.span
        raise InputError(f"{span}: this transfer has no partner; `fsoe-net check` explains it")
    return _Compiler(resolution).compile()


@dataclass(frozen=True, slots=True, kw_only=True)
class _SharedSymbol:
    """A symbol except for its SubDevice and the number of its sync manager."""

    name: str
    bit_offset: int
    bits: int
    kind: int
    output: bool
    restart_relevant: bool
    stop_value: int
    factor: float
    offset: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shared:
    """Records of one sync manager in the plan, the same for every SubDevice of a type.

    Attributes:
        manager: Columns of `PlanSyncManager` from ``index`` to ``bits``.
        pdos: They count their entries from the first of this sync manager.
        entries: Entries of all its PDOs.
        frames: Key of each FSoE frame, and columns of `PlanBlock` from ``byte_offset`` to
            ``safe_bytes``.
        symbols: Its symbols.
    """

    manager: tuple[int, int, int, bool, int]
    pdos: tuple[PlanPdo, ...]
    entries: tuple[PlanEntry, ...]
    frames: tuple[tuple[tuple[int, int], tuple[int, int, int]], ...]
    symbols: tuple[_SharedSymbol, ...]


@dataclass(slots=True)
class _Compiler:
    """Numbers records in bus order."""

    resolution: Resolution
    sync_managers: list[PlanSyncManager] = field(default_factory=list)
    pdos: list[PlanPdo] = field(default_factory=list)
    entries: list[PlanEntry] = field(default_factory=list)
    sdos: list[PlanSdo] = field(default_factory=list)
    symbols: list[PlanSymbol] = field(default_factory=list)
    blocks: list[PlanBlock] = field(default_factory=list)
    first_sms: list[int] = field(default_factory=list)  # by SubDevice
    symbol_names: tuple[Names, Names] = field(  # of inputs, of outputs
        default_factory=lambda: (Names(between="-"), Names(between="-"))
    )
    # Of the sync managers of a device, by its number.
    shared: dict[int, tuple[_Shared, ...]] = field(default_factory=dict)

    def compile(self) -> Plan:
        network = self.resolution.network
        subdevices = self._subdevices()
        copies, numbers = self._copies()
        return Plan(
            cycle_ns=network.cycle_ns or 0,
            subdevices=subdevices,
            sync_managers=_taken(self.sync_managers),
            pdos=_taken(self.pdos),
            entries=_taken(self.entries),
            sdos=_taken(self.sdos),
            symbols=_taken(self.symbols),
            blocks=_taken(self.blocks),
            copies=copies,
            connections=self._connections(numbers),
            safety_sha256=safety_sha256(network.safety_functions),
            buses=self._buses(),
            groups=self._groups(),
        )

    def _subdevices(self) -> tuple[PlanSubDevice, ...]:
        used = self._used()
        rows = enumerate(self.resolution.network.subdevices)
        return tuple(self._subdevice(number, sub, used) for number, sub in rows)

    def _groups(self) -> tuple[PlanGroup, ...]:
        network = self.resolution.network
        numbers = {sub.name: n for n, sub in enumerate(network.subdevices)}
        rows = (
            PlanGroup(
                name=group.name,
                place=group.place,
                first_subdevice=numbers[group.subdevices[0]],
                subdevice_count=len(group.subdevices),
            )
            for group in network.groups
        )
        # In bus order, because the plan reader checks this order.
        return tuple(sorted(rows, key=lambda row: row.first_subdevice))

    def _buses(self) -> tuple[PlanBus, ...]:
        network = self.resolution.network
        on_bus = Counter(sub.master_id for sub in network.subdevices)
        first = accumulate((on_bus[n] for n in range(len(network.buses))), initial=0)
        return tuple(
            PlanBus(
                name=bus.name,
                cycle_ns=bus.cycle_ns or 0,
                first_subdevice=begin,
                subdevice_count=on_bus[n],
            )
            for n, (bus, begin) in enumerate(zip(network.buses, first, strict=False))
        )

    def _used(self) -> dict[int, set[tuple[int, int]]]:
        """Return, for every SubDevice of a copy, those of its frames that are copied."""
        used: dict[int, set[tuple[int, int]]] = {}
        for row in self.resolution.transfers:
            for end in (row.source, row.destination):
                frames = used.setdefault(self._number(end), set())
                if end.block is not None:
                    frames.add(end.block.key)
        return used

    def _subdevice(
        self,
        number: int,
        sub: SubDevice,
        used: dict[int, set[tuple[int, int]]],
    ) -> PlanSubDevice:
        first_sm, first_sdo = len(self.sync_managers), len(self.sdos)
        self.first_sms.append(first_sm)
        copied = used.get(number, set())
        device = self.resolution.device_numbers[number]
        # Devices of one type share their records, which keeps a plan with thousands of SubDevices
        # small.
        if device not in self.shared:
            self.shared[device] = tuple(_shared_of(sub))
        for shared in self.shared[device]:
            self._sync_manager(number, sub, shared, copied)
        for sdo in sub.device.sdos if sub.device else ():
            self.sdos.append(
                PlanSdo(
                    index=sdo.index,
                    subindex=sdo.subindex,
                    size_bytes=sdo.size_bytes,
                    value=sdo.value,
                )
            )
        return PlanSubDevice(
            name=sub.name,
            alias=sub.alias,
            position=sub.position,
            vendor_id=sub.device.vendor_id if sub.device else 0,
            product_code=sub.device.product_code if sub.device else 0,
            # If no revision is stated, each one is accepted.
            revision_low=_ANY_REVISION[0] if sub.revision is None else sub.revision,
            revision_high=_ANY_REVISION[1] if sub.revision is None else sub.revision,
            first_sm=first_sm,
            sm_count=len(self.sync_managers) - first_sm,
            first_sdo=first_sdo,
            sdo_count=len(self.sdos) - first_sdo,
            # The register has 16 bits.
            assign_activate=(sub.device.assign_activate if sub.device else 0) & 0xFFFF,
            in_copy=number in used,
            driver=sub.device.driver if sub.device else "",
        )

    def _sync_manager(
        self,
        number: int,
        sub: SubDevice,
        shared: _Shared,
        copied: set[tuple[int, int]],
    ) -> None:
        sm_number = len(self.sync_managers)
        # Hundreds of thousands of rows, created in a quarter of the time of a call with keywords.
        row = (number, *shared.manager, len(self.pdos), len(shared.pdos))
        self.sync_managers.append(tuple.__new__(PlanSyncManager, row))
        first_entry = len(self.entries)
        self.pdos += [
            tuple.__new__(PlanPdo, (index, first_entry + first, count, bit_offset))
            for index, first, count, bit_offset in shared.pdos
        ]
        self.entries += shared.entries
        self.blocks += [
            tuple.__new__(PlanBlock, (sm_number, *places, key in copied))
            for key, places in shared.frames
        ]
        for symbol in shared.symbols:
            self._symbol(sub, symbol, sm_number)

    def _symbol(self, sub: SubDevice, shared: _SharedSymbol, sm_number: int) -> None:
        self.symbols.append(
            PlanSymbol(
                name=self._symbol_name(f"{sub.name}.{shared.name}", shared.output),
                sm=sm_number,
                bit_offset=shared.bit_offset,
                bits=shared.bits,
                kind=shared.kind,
                output=shared.output,
                restart_relevant=shared.restart_relevant,
                stop_value=shared.stop_value,
                factor=shared.factor,
                offset=shared.offset,
            )
        )

    def _symbol_name(self, name: str, output: bool) -> str:
        """Return a name that is unique among the inputs or outputs.

        Two SubDevices may have the same name: ``a`` with ``b.c``, and ``a.b`` with ``c``.
        """
        return self.symbol_names[output].add(name)

    def _copies(self) -> tuple[tuple[PlanCopy, ...], dict[int, int]]:
        """Return the copies sorted by destination, and a map from transfer to copy number."""
        owner = {
            row.number: number
            for number, c in enumerate(self.resolution.connections)
            for row in (c.to_sub, c.to_main)
        }
        rows = sorted(
            (
                (self._copy(row, owner.get(row.number, NONE)), row.number)
                for row in self.resolution.transfers
            ),
            # Sorted by destination, because C checks for overlaps by comparing neighbours.
            key=lambda pair: (pair[0].destination_sm, pair[0].destination_bit),
        )
        numbers = {row: number for number, (_, row) in enumerate(rows)}
        return tuple(copy for copy, _ in rows), numbers

    def _copy(self, row: ResolvedTransfer, connection: int) -> PlanCopy:
        source_sm, source_bit = self._place(row.source)
        destination_sm, destination_bit = self._place(row.destination)
        return PlanCopy(
            source_sm=source_sm,
            source_bit=source_bit,
            destination_sm=destination_sm,
            destination_bit=destination_bit,
            bits=8 * row.transfer.size_bytes,
            net=row.net.name,
            kind=1 if row.transfer.kind is TransferKind.FSOE else 2,
            connection=connection,
        )

    def _place(self, end: ResolvedEnd) -> tuple[int, int]:
        assert end.sm is not None  # noqa: S101  (compile_plan has refused everything else)
        return self.first_sms[self._number(end)] + end.sm.number, 8 * end.byte_offset

    def _number(self, end: ResolvedEnd) -> int:
        return self.resolution.numbers[end.endpoint.module]

    def _connections(self, numbers: dict[int, int]) -> tuple[PlanConnection, ...]:
        return tuple(
            PlanConnection(
                name=c.name,
                net=c.net.name,
                main=self.resolution.numbers[c.main.name],
                sub=self.resolution.numbers[c.sub.name],
                copy_to_sub=numbers[c.to_sub.number],
                copy_to_main=numbers[c.to_main.number],
                connection_id=stated.connection_id,
                address=stated.address,
                watchdog_ms=stated.watchdog_ms,
                safe_to_sub=safe_data_length(c.to_sub.transfer.size_bytes),
                safe_to_main=safe_data_length(c.to_main.transfer.size_bytes),
                app_parameters=stated.app_parameters.hex(),
            )
            for c in self.resolution.connections
            for stated in (c.stated,)  # created on each access if there are no facts
        )


def _taken(rows: list[_Row]) -> tuple[_Row, ...]:
    """Return the rows of a list, which is emptied, so that a large bus is not in memory twice."""
    found = tuple(rows)
    rows.clear()
    return found


def _shared_of(sub: SubDevice) -> Iterator[_Shared]:
    """Yield each sync manager of a device."""
    if sub.layout is None:
        return
    named = device_symbols(sub.layout)
    for sm in sub.layout.managers:
        symbols = tuple(_symbol(s) for s in named if s.sm == sm.number)
        yield _shared(sub, sm, symbols)


def _shared(sub: SubDevice, sm: SmLayout, symbols: tuple[_SharedSymbol, ...]) -> _Shared:
    pdos: list[PlanPdo] = []
    entries: list[PlanEntry] = []
    bit = 0
    # Without padding between PDOs: a sync manager has no alignment.
    for pdo in sub.device.pdos_of(sm.sm) if sub.device else ():
        pdos.append(
            PlanPdo(
                index=pdo.index,
                first_entry=len(entries),
                entry_count=len(pdo.entries),
                bit_offset=bit,
            )
        )
        for entry in pdo.entries:
            entries.append(
                PlanEntry(
                    index=entry.index,
                    subindex=entry.subindex,
                    registered=entry.registered,
                    bits=entry.bits,
                    kind=entry_kind(entry),
                    bit_offset=bit,
                )
            )
            bit += entry.bits
    return _Shared(
        manager=(
            sm.sm.index,
            1 if sm.sm.direction is Direction.OUTPUT else 2,
            _WATCHDOG[sm.sm.watchdog],
            sm.registered,
            sm.bits,
        ),
        pdos=tuple(pdos),
        entries=tuple(entries),
        frames=tuple((b.key, (b.byte_offset, b.frame_bytes, b.safe_bytes)) for b in sm.blocks),
        symbols=symbols,
    )


def _symbol(symbol: DeviceSymbol) -> _SharedSymbol:
    view, output = symbol.view, symbol.is_output
    restart_relevant = symbol.entry.restart_relevant
    # The driver does not shift a masked value, so its values are larger by a factor of 1 << shift.
    scale = 2.0**-view.shift if output else 2.0**view.shift
    return _SharedSymbol(
        name=symbol.name,
        bit_offset=symbol.bit_offset,
        bits=view.bits,
        kind=entry_kind(view),
        output=output,
        restart_relevant=restart_relevant,
        # After a stop, no bit that can restart a machine may remain set.
        stop_value=0 if restart_relevant or not output else stop_value(view),
        factor=view.factor * scale,
        offset=view.offset * scale if output else view.offset,
    )


def entry_kind(entry: Entry | EntryView) -> int:
    """Return the type number of the plan format for a type word."""
    word = entry.type_name
    if word == "bool":
        return 1
    if word.startswith("int"):
        return 2
    if word.startswith("uint"):
        return 3
    return 4 if word in ("float", "double", "real32", "real64") else 0


def stop_value(entry: EntryView) -> int:
    """Return the raw bits of an output's ``default``, or 0; see the plan format."""
    value = entry.default
    if value is None or math.isnan(value):
        return 0
    # The interface is a part of the entry, whose raw value is shifted.
    value /= 1 << entry.shift
    kind = entry_kind(entry)
    if kind == _REAL and entry.bits in _REAL_FORMAT:
        return _real_bits(value, entry.bits)
    signed = kind == _SIGNED
    low = -(1 << (entry.bits - 1)) if signed else 0
    high = (1 << (entry.bits - signed)) - 1
    # Values out of range are limited, as in the driver; an overflow would become another value.
    whole = int(min(max(value, low), high))
    return whole & ((1 << entry.bits) - 1)


def _real_bits(value: float, bits: int) -> int:
    try:
        packed = struct.pack(_REAL_FORMAT[bits], value)
    except OverflowError:  # a 32-bit float has no such value
        packed = struct.pack(_REAL_FORMAT[bits], math.copysign(math.inf, value))
    return int.from_bytes(packed, "little")
