"""`.fsnplan` bytes ⇄ plan. The layout is described in ``docs/reference/plan-format.md``."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from fsoe_net.diag.pause import without_collector
from fsoe_net.diag.printable import printable
from fsoe_net.errors import PlanFormatError
from fsoe_net.plan.model import (
    NONE,
    Plan,
    PlanBlock,
    PlanConnection,
    PlanCopy,
    PlanEntry,
    PlanPdo,
    PlanSdo,
    PlanSubDevice,
    PlanSymbol,
    PlanSyncManager,
)

__all__ = ["MAGIC", "decode_plan", "encode_plan"]

MAGIC = b"FSNPLAN\0"
MAJOR = 1
SECTIONS = 10
MINOR_WITH_SAFETY = 1
SECTIONS_WITH_SAFETY = 11  # the last holds the hash of the safety functions

_HEADER = struct.Struct("<8sHHIIIII")
_ROW = struct.Struct("<IIII")
_CRC_OFFSET = 16

_SUBDEVICE = struct.Struct("<IHHIIIIIIIIHHI")
_SYNC_MANAGER = struct.Struct("<IBBBBIIII")
_PDO = struct.Struct("<HHIII")
_ENTRY = struct.Struct("<HBBHBBI")
_SDO = struct.Struct("<HBBI8s")
_SYMBOL = struct.Struct("<IIIHBBIQdd")
_BLOCK = struct.Struct("<IIHHI")
_COPY = struct.Struct("<IIIIIIHHI")
_CONNECTION = struct.Struct("<IIIIIIHHHHHHI")
_STRING_BYTES = 1
_HASH_BYTES = 32
_FORMS = {(0, SECTIONS), (MINOR_WITH_SAFETY, SECTIONS_WITH_SAFETY)}
_RECORDS = (
    _SUBDEVICE,
    _SYNC_MANAGER,
    _PDO,
    _ENTRY,
    _SDO,
    _SYMBOL,
    _BLOCK,
    _COPY,
    _CONNECTION,
)


class _Strings:
    """The string table while writing: offset 0 is the empty string, equal strings share one."""

    def __init__(self) -> None:
        self._offsets = {"": 0}
        self.data = bytearray(b"\0")

    def add(self, text: str) -> int:
        known = self._offsets.get(text)
        if known is None:
            known = self._offsets[text] = len(self.data)
            shown = re.sub(r"[\0-\x1f\x7f]", lambda bad: printable(bad[0]), text)
            self.data += shown.encode("utf-8") + b"\0"
        return known


@without_collector
def encode_plan(plan: Plan) -> bytes:
    """Return the bytes of a plan. Equal plans give equal bytes on every platform."""
    strings = _Strings()
    sections = _encode_sections(plan, strings)
    sections.append((bytes(strings.data), _STRING_BYTES))
    minor = 0
    if plan.safety_sha256:
        minor = MINOR_WITH_SAFETY
        sections.append((bytes.fromhex(plan.safety_sha256), _HASH_BYTES))
    offset = _HEADER.size + len(sections) * _ROW.size
    table, body = bytearray(), bytearray()
    for kind, (data, size) in enumerate(sections, start=1):
        body += bytes(-len(body) % 4)
        table += _ROW.pack(kind, offset + len(body), len(data) // size, size)
        body += data
    total = offset + len(body)
    header = _HEADER.pack(MAGIC, MAJOR, minor, total, 0, plan.cycle_ns, len(sections), 0)
    raw = bytearray(header + table + body)
    struct.pack_into("<I", raw, _CRC_OFFSET, zlib.crc32(raw))
    return bytes(raw)


def _encode_sections(plan: Plan, strings: _Strings) -> list[tuple[bytes, int]]:
    rows: tuple[Iterable[bytes], ...] = (
        [_pack_subdevice(s, strings) for s in plan.subdevices],
        [_pack_sync_manager(s) for s in plan.sync_managers],
        [_PDO.pack(p.index, 0, p.first_entry, p.entry_count, p.bit_offset) for p in plan.pdos],
        _pack_entries(plan.entries),
        [_pack_sdo(s) for s in plan.sdos],
        [_pack_symbol(s, strings) for s in plan.symbols],
        [
            _BLOCK.pack(b.sm, b.byte_offset, b.frame_bytes, b.safe_bytes, b.copied)
            for b in plan.blocks
        ],
        [_pack_copy(c, strings) for c in plan.copies],
        [_pack_connection(c, strings) for c in plan.connections],
    )
    return [(b"".join(r), s.size) for r, s in zip(rows, _RECORDS, strict=True)]


def _pack_subdevice(s: PlanSubDevice, strings: _Strings) -> bytes:
    return _SUBDEVICE.pack(
        strings.add(s.name),
        s.alias,
        s.position,
        s.vendor_id,
        s.product_code,
        s.revision_low,
        s.revision_high,
        s.first_sm,
        s.sm_count,
        s.first_sdo,
        s.sdo_count,
        s.assign_activate,
        s.in_copy,
        0,
    )


def _pack_sync_manager(s: PlanSyncManager) -> bytes:
    return _SYNC_MANAGER.pack(
        s.subdevice,
        s.index,
        s.direction,
        s.watchdog,
        s.registered,
        s.bits,
        s.first_pdo,
        s.pdo_count,
        0,
    )


def _pack_entries(entries: Iterable[PlanEntry]) -> Iterator[bytes]:
    known: dict[int, bytes] = {}  # SubDevices of one type share their records
    for e in entries:
        packed = known.get(id(e))
        if packed is None:
            packed = _ENTRY.pack(e.index, e.subindex, e.registered, e.bits, e.kind, 0, e.bit_offset)
            known[id(e)] = packed
        yield packed


def _pack_sdo(s: PlanSdo) -> bytes:
    value = (s.value & 0xFFFFFFFFFFFFFFFF).to_bytes(8, "little")
    return _SDO.pack(s.index, s.subindex, s.size_bytes, 0, value)


def _pack_symbol(s: PlanSymbol, strings: _Strings) -> bytes:
    flags = s.output | (s.restart_relevant << 1)
    return _SYMBOL.pack(
        strings.add(s.name),
        s.sm,
        s.bit_offset,
        s.bits,
        s.kind,
        flags,
        0,
        s.stop_value,
        s.factor,
        s.offset,
    )


def _pack_copy(c: PlanCopy, strings: _Strings) -> bytes:
    return _COPY.pack(
        c.source_sm,
        c.source_bit,
        c.destination_sm,
        c.destination_bit,
        c.bits,
        strings.add(c.net),
        c.kind,
        0,
        c.connection,
    )


def _pack_connection(c: PlanConnection, strings: _Strings) -> bytes:
    known = (c.connection_id, c.address, c.watchdog_ms)
    flags = sum((value is not None) << bit for bit, value in enumerate(known))
    return _CONNECTION.pack(
        strings.add(c.name),
        strings.add(c.net),
        c.main,
        c.sub,
        c.copy_to_sub,
        c.copy_to_main,
        *(value or 0 for value in known),
        flags,
        c.safe_to_sub,
        c.safe_to_main,
        0,
    )


# -- reading --------------------------------------------------------------------------------------


@without_collector
def decode_plan(data: bytes) -> Plan:
    """Read a plan for showing it. The C core proves more before it copies anything.

    Raises:
        PlanFormatError: Not a plan: wrong magic, version, length, CRC, or a number out of range.
    """
    sections, cycle_ns = _open(data)
    reader = _Reader(data, sections)
    plan = Plan(
        cycle_ns=cycle_ns,
        subdevices=reader.rows(1, reader.subdevice),
        sync_managers=reader.rows(2, reader.sync_manager),
        pdos=reader.rows(3, reader.pdo),
        entries=reader.rows(4, reader.entry),
        sdos=reader.rows(5, reader.sdo),
        symbols=reader.rows(6, reader.symbol),
        blocks=reader.rows(7, reader.block),
        copies=reader.rows(8, reader.copy),
        connections=reader.rows(9, reader.connection),
        safety_sha256=reader.safety_sha256(),
    )
    _references(plan)
    return plan


def _open(data: bytes) -> tuple[list[tuple[int, int]], int]:
    if len(data) < _HEADER.size + SECTIONS * _ROW.size:
        raise PlanFormatError(f"{len(data)} bytes are too short for a plan; is the file cut off?")
    magic, major, minor, total, crc, cycle_ns, count, reserved = _HEADER.unpack_from(data)
    if magic != MAGIC:
        raise PlanFormatError("this is no .fsnplan file; `fsoe-net plan NETWORK -o OUT` makes one")
    if major != MAJOR:
        raise PlanFormatError(f"plan format {major} is not known here (1 is); compile it again")
    if total != len(data):
        raise PlanFormatError(f"the plan says {total} bytes, the file has {len(data)}")
    if crc != zlib.crc32(data[:_CRC_OFFSET] + bytes(4) + data[_CRC_OFFSET + 4 :]):
        raise PlanFormatError("CRC-32 does not fit: the file was changed; compile it again")
    if (minor, count) not in _FORMS or reserved:
        raise PlanFormatError("section table is damaged, or of a newer format than 1.1")
    return _section_table(data, count), cycle_ns


def _section_table(data: bytes, count: int) -> list[tuple[int, int]]:
    sections: list[tuple[int, int]] = []
    expected = _HEADER.size + count * _ROW.size
    sizes = [*(s.size for s in _RECORDS), _STRING_BYTES, _HASH_BYTES][:count]
    if expected > len(data):
        raise PlanFormatError("the section table is cut off")
    for number, size in enumerate(sizes, start=1):
        expected += -expected % 4
        kind, offset, records, record_bytes = _ROW.unpack_from(
            data, _HEADER.size + (number - 1) * _ROW.size
        )
        end = offset + records * record_bytes
        if (kind, offset, record_bytes) != (number, expected, size) or end > len(data):
            raise PlanFormatError(f"section {number} is not where it must be")
        sections.append((offset, records))
        expected = end
    if expected != len(data):
        raise PlanFormatError("the last section does not end the file")
    first, length = sections[SECTIONS - 1]
    if not length or data[first] or data[first + length - 1]:
        raise PlanFormatError("the strings do not start and end with a zero byte")
    if re.search(rb"[\x01-\x1f\x7f]", data[first : first + length]):
        raise PlanFormatError("a name has a control character")
    if count == SECTIONS_WITH_SAFETY and sections[-1][1] != 1:
        raise PlanFormatError("a plan has one hash of safety functions")
    return sections


_T = TypeVar("_T")


class _Reader:
    """Unpacks records once the section table is known to be right."""

    def __init__(self, data: bytes, sections: list[tuple[int, int]]) -> None:
        self._data = data
        self._sections = sections
        self._strings_at, self._strings_bytes = sections[SECTIONS - 1]
        self._entries: dict[bytes, PlanEntry] = {}  # thousands of SubDevices are of one type

    def rows(self, kind: int, make: Callable[[int], _T]) -> tuple[_T, ...]:
        offset, count = self._sections[kind - 1]
        size = _RECORDS[kind - 1].size
        return tuple(make(offset + size * n) for n in range(count))

    def safety_sha256(self) -> str:
        if len(self._sections) < SECTIONS_WITH_SAFETY:
            return ""
        offset = self._sections[-1][0]
        return self._data[offset : offset + _HASH_BYTES].hex()

    def _text(self, offset: int) -> str:
        if offset >= self._strings_bytes:
            raise PlanFormatError(f"string {offset} lies outside the strings")
        start = self._strings_at + offset
        return self._data[start : self._data.index(b"\0", start)].decode("utf-8", "replace")

    def subdevice(self, at: int) -> PlanSubDevice:
        f = _SUBDEVICE.unpack_from(self._data, at)
        return PlanSubDevice(
            name=self._text(f[0]),
            alias=f[1],
            position=f[2],
            vendor_id=f[3],
            product_code=f[4],
            revision_low=f[5],
            revision_high=f[6],
            first_sm=f[7],
            sm_count=f[8],
            first_sdo=f[9],
            sdo_count=f[10],
            assign_activate=f[11],
            in_copy=bool(f[12] & 1),
        )

    def sync_manager(self, at: int) -> PlanSyncManager:
        f = _SYNC_MANAGER.unpack_from(self._data, at)
        return PlanSyncManager(
            subdevice=f[0],
            index=f[1],
            direction=f[2],
            watchdog=f[3],
            registered=bool(f[4] & 1),
            bits=f[5],
            first_pdo=f[6],
            pdo_count=f[7],
        )

    def pdo(self, at: int) -> PlanPdo:
        index, _, first, count, bit = _PDO.unpack_from(self._data, at)
        return PlanPdo(index=index, first_entry=first, entry_count=count, bit_offset=bit)

    def entry(self, at: int) -> PlanEntry:
        raw = self._data[at : at + _ENTRY.size]
        known = self._entries.get(raw)
        if known is None:
            known = self._entries[raw] = self._new_entry(raw)
        return known

    def _new_entry(self, raw: bytes) -> PlanEntry:
        index, subindex, flags, bits, kind, _, bit = _ENTRY.unpack(raw)
        return PlanEntry(
            index=index,
            subindex=subindex,
            registered=bool(flags & 1),
            bits=bits,
            kind=kind,
            bit_offset=bit,
        )

    def sdo(self, at: int) -> PlanSdo:
        index, subindex, size, _, raw = _SDO.unpack_from(self._data, at)
        value = int.from_bytes(raw, "little", signed=True)
        return PlanSdo(index=index, subindex=subindex, size_bytes=size, value=value)

    def symbol(self, at: int) -> PlanSymbol:
        name, sm, bit, bits, kind, flags, _, stop_value, factor, offset = _SYMBOL.unpack_from(
            self._data, at
        )
        return PlanSymbol(
            name=self._text(name),
            sm=sm,
            bit_offset=bit,
            bits=bits,
            kind=kind,
            output=bool(flags & 1),
            restart_relevant=bool(flags & 2),
            stop_value=stop_value,
            factor=factor,
            offset=offset,
        )

    def block(self, at: int) -> PlanBlock:
        sm, byte, frame, safe, flags = _BLOCK.unpack_from(self._data, at)
        return PlanBlock(
            sm=sm, byte_offset=byte, frame_bytes=frame, safe_bytes=safe, copied=bool(flags & 1)
        )

    def copy(self, at: int) -> PlanCopy:
        f = _COPY.unpack_from(self._data, at)
        return PlanCopy(
            source_sm=f[0],
            source_bit=f[1],
            destination_sm=f[2],
            destination_bit=f[3],
            bits=f[4],
            net=self._text(f[5]),
            kind=f[6],
            connection=f[8],
        )

    def connection(self, at: int) -> PlanConnection:
        f = _CONNECTION.unpack_from(self._data, at)
        flags = f[9]
        return PlanConnection(
            name=self._text(f[0]),
            net=self._text(f[1]),
            main=f[2],
            sub=f[3],
            copy_to_sub=f[4],
            copy_to_main=f[5],
            connection_id=f[6] if flags & 1 else None,
            address=f[7] if flags & 2 else None,
            watchdog_ms=f[8] if flags & 4 else None,
            safe_to_sub=f[10],
            safe_to_main=f[11],
        )


def _references(plan: Plan) -> None:
    """Refuse record numbers out of range, so that showing a plan cannot fail later."""
    sms, subs = len(plan.sync_managers), len(plan.subdevices)
    copies, connections = len(plan.copies), len(plan.connections)
    for number, sub in enumerate(plan.subdevices):
        _need(sub.first_sm + sub.sm_count, sms + 1, f"SubDevice {number}: sync manager")
        _need(sub.first_sdo + sub.sdo_count, len(plan.sdos) + 1, f"SubDevice {number}: SDO")
    for number, sm in enumerate(plan.sync_managers):
        _need(sm.subdevice, subs, f"sync manager {number}: SubDevice")
        _need(sm.first_pdo + sm.pdo_count, len(plan.pdos) + 1, f"sync manager {number}: PDO")
    for number, pdo in enumerate(plan.pdos):
        _need(pdo.first_entry + pdo.entry_count, len(plan.entries) + 1, f"PDO {number}: entry")
    places = [("symbol", n, s.sm) for n, s in enumerate(plan.symbols)]
    places += [("block", n, b.sm) for n, b in enumerate(plan.blocks)]
    places += [("copy", n, c.source_sm) for n, c in enumerate(plan.copies)]
    places += [("copy", n, c.destination_sm) for n, c in enumerate(plan.copies)]
    for kind, number, sm_number in places:
        _need(sm_number, sms, f"{kind} {number}: sync manager")
    for number, copy in enumerate(plan.copies):
        _need(copy.connection, connections, f"copy {number}: connection", none_allowed=True)
    for number, row in enumerate(plan.connections):
        _need(max(row.main, row.sub), subs, f"connection {number}: SubDevice")
        _need(max(row.copy_to_sub, row.copy_to_main), copies, f"connection {number}: copy")


def _need(value: int, limit: int, what: str, *, none_allowed: bool = False) -> None:
    if value >= limit and not (none_allowed and value == NONE):
        raise PlanFormatError(f"{what} {value} does not exist")
