"""`.fsnplan` bytes ⇄ plan. The layout is described in ``docs/reference/plan-format.md``."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields
from io import BytesIO
from itertools import starmap
from typing import Any

from fsoe_net.diag.pause import without_collector
from fsoe_net.diag.printable import printable
from fsoe_net.errors import PlanFormatError
from fsoe_net.fsoe.parameters import MOST_APP_BYTES
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
from fsoe_net.plan.records import (
    BUS_RECORD,
    GROUP_RECORD,
    HASH_BYTES,
    RECORDS,
    STRING_BYTES,
    Record,
)

MAGIC = b"FSNPLAN\0"
MAJOR = 1
SECTIONS = 10
SECTIONS_WITH_SAFETY = 11  # the last one contains the hash of the safety functions
SECTIONS_WITH_BUSES = 12
SECTIONS_WITH_GROUPS = 13

_HEADER = struct.Struct("<8sHHIIIII")
_ROW = struct.Struct("<IIII")
_CRC_OFFSET = 16

_FORMS = {(n - SECTIONS, n) for n in range(SECTIONS, SECTIONS_WITH_GROUPS + 1)}
_SIZES = (
    *(record.layout.size for record in RECORDS),
    STRING_BYTES,
    HASH_BYTES,
    BUS_RECORD.layout.size,
    GROUP_RECORD.layout.size,
)
_ROW_TYPES = (
    PlanSubDevice,
    PlanSyncManager,
    PlanPdo,
    PlanEntry,
    PlanSdo,
    PlanSymbol,
    PlanBlock,
    PlanCopy,
    PlanConnection,
)
_APP_PARAMETERS = re.compile(rf"(?:[0-9a-f]{{2}}){{0,{MOST_APP_BYTES}}}")
_KNOWN = ("connection_id", "address", "watchdog_ms")  # bit 0, 1 and 2 of `known`


class _Strings:
    """The string table during writing: offset 0 is the empty string, equal strings are shared."""

    def __init__(self) -> None:
        self._offsets = {"": 0}
        self.data = bytearray(b"\0")

    def add(self, text: str) -> int:
        known = self._offsets.get(text)
        if known is None:
            known = self._offsets[text] = len(self.data)
            if not text.isprintable():
                text = re.sub(r"[\0-\x1f\x7f]", lambda bad: printable(bad[0]), text)
            self.data += text.encode("utf-8") + b"\0"
        return known


@without_collector
def encode_plan(plan: Plan) -> bytes:
    """Return the bytes of a plan. Equal plans give equal bytes on every platform."""
    # The minor version is the number of added sections; old readers reject a plan that they would
    # misread. Later sections require the earlier ones, because a reader counts them by number.
    minor = int(plan.format.removeprefix(f"{MAJOR}."))
    sizes = _SIZES[: SECTIONS + minor]
    # One buffer, which becomes the result: a large plan is not in memory twice.
    out = BytesIO()
    out.write(bytes(_HEADER.size + len(sizes) * _ROW.size))
    table = []
    for kind, (size, chunks) in enumerate(zip(sizes, _contents(plan), strict=False), start=1):
        # Aligned, so that C can read the records in place; the file ends with its last section.
        out.write(bytes(-out.tell() % 4))
        begin = out.tell()
        out.writelines(chunks)
        table.append(_ROW.pack(kind, begin, (out.tell() - begin) // size, size))
    header = _HEADER.pack(MAGIC, MAJOR, minor, out.tell(), 0, plan.cycle_ns, len(sizes), 0)
    out.seek(0)
    out.writelines((header, *table))
    with out.getbuffer() as data:
        struct.pack_into("<I", data, _CRC_OFFSET, zlib.crc32(data))  # its own field was 0
    return out.getvalue()


def _contents(plan: Plan) -> Iterator[Iterable[bytes | bytearray]]:
    """Yield the content of each section in parts; each must be read before the next one."""
    strings = _Strings()
    tables: tuple[Sequence[Any], ...] = (
        plan.subdevices,
        plan.sync_managers,
        plan.pdos,
        plan.entries,
        plan.sdos,
        plan.symbols,
        plan.blocks,
        plan.copies,
        plan.connections,
    )
    for record, rows in zip(RECORDS, tables, strict=True):
        yield _packed(record, rows, strings)
    # Before the strings, which contain their names.
    buses = list(_packed(BUS_RECORD, plan.buses, strings))
    groups = list(_packed(GROUP_RECORD, plan.groups, strings))
    yield (strings.data,)
    yield (bytes.fromhex(plan.safety_sha256),)
    yield buses
    yield groups


def _packed(record: Record, rows: Sequence[Any], strings: _Strings) -> Iterator[bytes]:
    values_of = _VALUES.get(record.name)
    values: Iterable[Iterable[Any]] = rows if values_of is None else map(values_of, rows)
    texts = [n for n, field in enumerate(record.named) if field.type == "string"]
    layout = record.layout
    # SubDevices of one type have equal entries, which are packed once.
    if record.name == "entry":
        known = {row: layout.pack(*row) for row in dict.fromkeys(rows)}
        return map(known.__getitem__, rows)

    def with_offsets(row: Iterable[Any]) -> list[Any]:
        cells = list(row)
        for n in texts:
            cells[n] = strings.add(cells[n])
        return cells

    return starmap(layout.pack, map(with_offsets, values) if texts else values)


def _sdo_values(sdo: PlanSdo) -> tuple[int, ...]:
    value = (sdo.value + (1 << 63)) % (1 << 64) - (1 << 63)  # also unsigned values of 64 bits
    return sdo.index, sdo.subindex, sdo.size_bytes, value


def _symbol_values(s: PlanSymbol) -> tuple[object, ...]:
    flags = s.output | (s.restart_relevant << 1)
    place = (s.name, s.sm, s.bit_offset, s.bits, s.kind)
    return *place, flags, s.stop_value, s.factor, s.offset


def _connection_values(c: PlanConnection) -> tuple[object, ...]:
    known = [getattr(c, name) for name in _KNOWN]
    flags = sum((value is not None) << bit for bit, value in enumerate(known))
    place = (c.name, c.net, c.main, c.sub, c.copy_to_sub, c.copy_to_main)
    safe = (c.safe_to_sub, c.safe_to_main)
    return *place, *(value or 0 for value in known), flags, *safe, c.app_parameters


# Storage of rows that differs from their attributes; all others are tuples of the stored values.
_VALUES: dict[str, Callable[[Any], tuple[object, ...]]] = {
    "sdo": _sdo_values,
    "symbol": _symbol_values,
    "connection": _connection_values,
}


# -- reading --------------------------------------------------------------------------------------


@without_collector
def decode_plan(data: bytes) -> Plan:
    """Read a plan to show it. The C core verifies more before it copies anything.

    Raises:
        PlanFormatError: Not a plan: wrong magic, version, length, CRC, or a number out of range.
    """
    sections, cycle_ns = _open(data)
    reader = _Reader(data, sections)
    names = [field.name for field in fields(Plan)][1:-3]  # the tables are between cycle and hash
    rows = map(reader.rows, RECORDS, _ROW_TYPES)
    tables = dict(zip(names, rows, strict=True))
    if len(sections) >= SECTIONS_WITH_BUSES:
        tables["buses"] = reader.rows(BUS_RECORD, PlanBus)
    if len(sections) == SECTIONS_WITH_GROUPS:
        tables["groups"] = reader.rows(GROUP_RECORD, PlanGroup)
    plan = Plan(cycle_ns=cycle_ns, safety_sha256=reader.safety_sha256(), **tables)
    _references(plan)
    return plan


def _open(data: bytes) -> tuple[list[tuple[int, int]], int]:
    if len(data) < _HEADER.size + SECTIONS * _ROW.size:
        raise PlanFormatError(f"{len(data)} bytes are too short for a plan; is the file cut off?")
    magic, major, minor, total, crc, cycle_ns, count, reserved = _HEADER.unpack_from(data)
    # From general to specific: the first message must name the real problem.
    if magic != MAGIC:
        raise PlanFormatError("not a .fsnplan file; `fsoe-net plan NETWORK -o OUT` makes one")
    if major != MAJOR:
        raise PlanFormatError(f"plan format {major} is not known here (1 is); compile it again")
    if total != len(data):
        raise PlanFormatError(f"the plan states {total} bytes, the file has {len(data)}")
    if crc != zlib.crc32(data[:_CRC_OFFSET] + bytes(4) + data[_CRC_OFFSET + 4 :]):
        raise PlanFormatError("CRC-32 does not fit: the file was changed; compile it again")
    if (minor, count) not in _FORMS or reserved:
        raise PlanFormatError("section table is damaged, or of a newer format than 1.3")
    return _section_table(data, count), cycle_ns


def _section_table(data: bytes, count: int) -> list[tuple[int, int]]:
    sections: list[tuple[int, int]] = []
    expected = _HEADER.size + count * _ROW.size
    if expected > len(data):
        raise PlanFormatError("the section table is cut off")
    # Strict positions: a plan has only one form, so that equal networks have equal bytes.
    for number, size in enumerate(_SIZES[:count], start=1):
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
    # Offset 0 is the empty name; without the final zero a reader would run past the end.
    if not length or data[first] or data[first + length - 1]:
        raise PlanFormatError("the strings do not start and end with a zero byte")
    # Names appear in logs and terminals.
    if re.search(rb"[\x01-\x1f\x7f]", data[first : first + length]):
        raise PlanFormatError("a name has a control character")
    _newer_sections(sections)
    return sections


def _newer_sections(sections: list[tuple[int, int]]) -> None:
    count = len(sections)
    hashes = sections[SECTIONS][1] if count > SECTIONS else 0
    if hashes > 1 or (count == SECTIONS_WITH_SAFETY and not hashes):
        raise PlanFormatError("a plan has one hash of safety functions")
    if count == SECTIONS_WITH_BUSES and sections[-1][1] < 2:
        raise PlanFormatError("a plan with buses has two of them at least")
    if count == SECTIONS_WITH_GROUPS and (sections[-2][1] or not sections[-1][1]):
        raise PlanFormatError("a plan with groups has one bus, and a group at least")


class _Reader:
    """Unpacks records after the section table has been verified."""

    def __init__(self, data: bytes, sections: list[tuple[int, int]]) -> None:
        self._data = data
        self._sections = sections
        self._strings_at, self._strings_bytes = sections[SECTIONS - 1]

    def rows(self, record: Record, make: Callable[..., Any]) -> tuple[Any, ...]:
        """Return all rows of a section; equal rows are one object."""
        offset, count = self._sections[record.number - 1]
        size = record.layout.size
        read = self._reader(record, make)
        known: dict[bytes, Any] = {}  # thousands of SubDevices have the same type
        rows = []
        for at in range(offset, offset + size * count, size):
            raw = self._data[at : at + size]
            row = known.get(raw)
            if row is None:
                row = known[raw] = read(raw)
            rows.append(row)
        return tuple(rows)

    def _reader(self, record: Record, make: Callable[..., Any]) -> Callable[[bytes], Any]:
        names = [field.name for field in record.named]
        texts = [field.name for field in record.named if field.type == "string"]
        flags = [field.name for field in record.named if field.type.startswith("flag")]
        unpack = record.layout.unpack
        change = _ATTRIBUTES.get(record.name)

        def read(raw: bytes) -> Any:
            row: dict[str, Any] = dict(zip(names, unpack(raw), strict=True))
            for name in texts:
                row[name] = self._text(row[name])
            for name in flags:
                # Reserved bits of a flag are ignored, as C does.
                row[name] = bool(row[name] & 1)
            if change is not None:
                change(row)
            return make(**row)

        return read

    def safety_sha256(self) -> str:
        if len(self._sections) < SECTIONS_WITH_SAFETY:
            return ""
        offset, count = self._sections[SECTIONS]
        if not count:
            return ""
        return self._data[offset : offset + HASH_BYTES].hex()

    def _text(self, offset: int) -> str:
        if offset >= self._strings_bytes:
            raise PlanFormatError(f"string {offset} lies outside the strings")
        start = self._strings_at + offset
        return self._data[start : self._data.index(b"\0", start)].decode("utf-8", "replace")


def _symbol_attributes(row: dict[str, Any]) -> None:
    flags = row.pop("flags")
    row |= {"output": bool(flags & 1), "restart_relevant": bool(flags & 2)}


def _connection_attributes(row: dict[str, Any]) -> None:
    if not _APP_PARAMETERS.fullmatch(row["app_parameters"]):
        raise PlanFormatError("application parameters that are not pairs of hex digits")
    known = row.pop("known")
    row |= {name: None for bit, name in enumerate(_KNOWN) if not known >> bit & 1}


# Row columns whose attributes are named or coded differently.
_ATTRIBUTES: dict[str, Callable[[dict[str, Any]], None]] = {
    "symbol": _symbol_attributes,
    "connection": _connection_attributes,
}


def _references(plan: Plan) -> None:
    """Reject record numbers out of range, so that showing a plan cannot fail later."""
    sms, subs = len(plan.sync_managers), len(plan.subdevices)
    # Checked here: a plan of unknown origin must not lead to an index error later.
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
    # Buses and groups cover SubDevices without overlap, in order.
    end = 0
    for number, bus in enumerate(plan.buses):
        _need(end, bus.first_subdevice + 1, f"bus {number}: SubDevice")
        end = bus.first_subdevice + bus.subdevice_count
        _need(end, subs + 1, f"bus {number}: SubDevice")
    end = 0
    for number, group in enumerate(plan.groups):
        _need(end, group.first_subdevice + 1, f"group {number}: SubDevice")
        end = group.first_subdevice + group.subdevice_count
        _need(end, subs + 1, f"group {number}: SubDevice")
    for number, row in enumerate(plan.connections):
        _need(max(row.main, row.sub), subs, f"connection {number}: SubDevice")
        _need(max(row.copy_to_sub, row.copy_to_main), copies, f"connection {number}: copy")


def _need(value: int, limit: int, what: str, *, none_allowed: bool = False) -> None:
    if value >= limit and not (none_allowed and value == NONE):
        raise PlanFormatError(f"{what} {value} does not exist")
