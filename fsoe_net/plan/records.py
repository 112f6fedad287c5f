"""The records of a plan file: the table that the codec reads.

``scripts/plan-records`` writes the fields of the C core and the tables of
``docs/reference/plan-format.md`` from it. The bytes are in the order of the fields.
"""

from __future__ import annotations

import struct

from fsoe_net.dataclass import dataclass

STRING_BYTES = 1
HASH_BYTES = 32

# Type: code of `struct`. A flag is bit 0 of its field.
_CODES = {
    "u8": "B",
    "u16": "H",
    "u32": "I",
    "u64": "Q",
    "i64": "q",
    "f64": "d",
    "string": "I",
    "flag8": "B",
    "flag16": "H",
    "flag32": "I",
}
RESERVED = "reserved"


@dataclass(frozen=True, slots=True)
class Field:
    """One field; a reserved one is zero and has no attribute in the row in memory."""

    type: str
    name: str
    meaning: str

    @property
    def code(self) -> str:
        """The letter of `struct`."""
        return _CODES[self.type]

    @property
    def size(self) -> int:
        """Size in bytes."""
        return struct.calcsize("<" + self.code)


@dataclass(frozen=True, slots=True)
class Record:
    """All records of one section."""

    number: int
    name: str
    fields: tuple[Field, ...]

    @property
    def named(self) -> tuple[Field, ...]:
        """The fields of a row in memory."""
        return tuple(field for field in self.fields if field.name != RESERVED)

    @property
    def layout(self) -> struct.Struct:
        """Packs and unpacks the named fields; reserved bytes are zero."""
        codes = (f.code if f.name != RESERVED else f"{f.size}x" for f in self.fields)
        return struct.Struct("<" + "".join(codes))


def _record(number: int, name: str, fields: str) -> Record:
    rows = (line.split(None, 2) for line in fields.strip().splitlines())
    return Record(number, name, tuple(Field(*row) for row in rows))


_SUBDEVICE = """
    string name            name
    u16    alias           alias; 0 = addressed by ring position
    u16    position        position (ring position, or distance from the alias)
    u32    vendor_id       vendor ID
    u32    product_code    product code
    u32    revision_low    lowest accepted revision
    u32    revision_high   highest accepted revision
    u32    first_sm        first sync manager
    u32    sm_count        number of sync managers
    u32    first_sdo       first start-up SDO
    u32    sdo_count       number of start-up SDOs
    u16    assign_activate DC AssignActivate word; 0 = no distributed clocks
    flag16 in_copy         flags: bit 0 = at least one copy touches this SubDevice
    string driver          keys that only the ROS 2 driver uses; may be empty
"""
_SYNC_MANAGER = """
    u32    subdevice       SubDevice
    u8     index           SM number, 0 … 15, ascending in a SubDevice
    u8     direction       direction: 1 = output (MainDevice to SubDevice), 2 = input
    u8     watchdog        watchdog: 0 = leave, 1 = enable, 2 = disable
    flag8  registered      flags: bit 0 = an entry is registered, so the SM has a place in the image
    u32    bits            length of the process data in bits, with padding, at most 11 888
    u32    first_pdo       first PDO
    u32    pdo_count       number of PDOs
    u32    reserved        reserved, 0
"""
_PDO = """
    u16    index           index
    u16    reserved        reserved, 0
    u32    first_entry     first entry
    u32    entry_count     number of entries
    u32    bit_offset      bit offset in the SM
"""
_ENTRY = """
    u16    index           index; 0 = padding
    u8     subindex        subindex
    flag8  registered      flags: bit 0 = registered by the MainDevice
    u16    bits            length in bits
    u8     kind            type: 0 bits, 1 bool, 2 signed, 3 unsigned, 4 floating point
    u8     reserved        reserved, 0
    u32    bit_offset      bit offset in the SM
"""
_SDO = """
    u16    index           index
    u8     subindex        subindex
    u8     size_bytes      size in bytes: 1, 2, 4 or 8
    u32    reserved        reserved, 0
    i64    value           value, sign-extended
"""
_SYMBOL = """
    string name            unique in its direction: `subdevice.interface` or `subdevice.0x6010:01`
    u32    sm              sync manager
    u32    bit_offset      bit offset in the SM
    u16    bits            length in bits, 1 … 64
    u8     kind            type as in *Entry*
    u8     flags           flags: bit 0 = output, bit 1 = restart relevant
    u32    reserved        reserved, 0
    u64    stop_value      stop value: raw bits of the output while no client writes it
    f64    factor          factor, IEEE 754; finite, not 0
    f64    offset          offset, IEEE 754; finite
"""
_BLOCK = """
    u32    sm              sync manager
    u32    byte_offset     byte offset in the SM
    u16    frame_bytes     frame length in bytes
    u16    safe_bytes      safe data in bytes
    flag32 copied          flags: bit 0 = a copy moves this block
"""
_COPY = """
    u32    source_sm       source sync manager (an input)
    u32    source_bit      source bit offset, a multiple of 8
    u32    destination_sm  destination sync manager (an output)
    u32    destination_bit destination bit offset, a multiple of 8
    u32    bits            length in bits, a multiple of 8, above 0
    string net             name of the net
    u16    kind            kind: 1 = FSoE frame, 2 = standard data
    u16    reserved        reserved, 0
    u32    connection      connection, or `NONE`
"""
_CONNECTION = """
    string name            name, unique: `main-sub`, with `-2`, `-3` … for further slots
    string net             name of the net
    u32    main            SubDevice with the MainInstance
    u32    sub             SubDevice with the SubInstance
    u32    copy_to_sub     copy from MainInstance to SubInstance
    u32    copy_to_main    copy from SubInstance to MainInstance
    u16    connection_id   connection ID
    u16    address         FSoE address
    u16    watchdog_ms     watchdog in milliseconds
    u16    known           flags: known are bit 0 = connection ID, bit 1 = address, bit 2 = watchdog
    u16    safe_to_sub     safe data main to sub, bytes
    u16    safe_to_main    safe data sub to main, bytes
    string app_parameters  application parameters, two lower-case hex digits each; empty: not stated
"""
# Only in format 1.2: the records above of one bus are consecutive.
_BUS = """
    string name            name, unique
    u32    cycle_ns        bus cycle in nanoseconds
    u32    first_subdevice first SubDevice
    u32    subdevice_count number of SubDevices
"""
# Only in format 1.3.
_GROUP = """
    string name            name, unique
    string place           place of alternatives; empty: none
    u32    first_subdevice first SubDevice, which is found by its alias
    u32    subdevice_count number of SubDevices, consecutive
"""
RECORDS = (
    _record(1, "subdevice", _SUBDEVICE),
    _record(2, "sm", _SYNC_MANAGER),
    _record(3, "pdo", _PDO),
    _record(4, "entry", _ENTRY),
    _record(5, "sdo", _SDO),
    _record(6, "symbol", _SYMBOL),
    _record(7, "block", _BLOCK),
    _record(8, "copy", _COPY),
    _record(9, "connection", _CONNECTION),
)
BUS_RECORD = _record(12, "bus", _BUS)
GROUP_RECORD = _record(13, "group", _GROUP)
