"""A device as a slave YAML of ethercat_driver_ros2."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator

from fsoe_net.errors import InputError
from fsoe_net.formats.shared.writers import plain_text, quoted
from fsoe_net.model.bus import Device, Direction, Entry, EntryView, Pdo, Sdo, SyncManager, Watchdog
from fsoe_net.model.drives import driver_facts
from fsoe_net.model.type_words import DRIVER_WORD, TYPE_BITS

LONGEST_BITS = 255
"""Maximum length of an entry: the driver stores its bits in one byte."""
_OF_CHANNELS = ("for", "factor_from_sdo", "mask")  # written in channels
_GROUP = {Direction.OUTPUT: "rpdo", Direction.INPUT: "tpdo"}


def type_word(entry: Entry) -> str:
    """Return the type of an entry as the driver writes it, always with the correct length."""
    if entry.is_gap:
        return f"bit{entry.bits}"
    word = entry.type_name.lower()
    word = DRIVER_WORD.get(word, word)
    if TYPE_BITS.get(word) == entry.bits or word == f"bit{entry.bits}":
        return word
    if entry.bits == 1:
        return "bool"
    return f"uint{entry.bits}" if entry.bits in (8, 16, 32, 64) else f"bit{entry.bits}"


def write_slave_yaml(
    device: Device, name: str, notes: list[str], *, needed: Collection[int] = ()
) -> str:
    """Return the slave YAML of a device.

    Args:
        device: Identity, sync managers, start-up SDOs.
        name: Name of the device in notes.
        notes: Takes notes on data that this format cannot represent.
        needed: Sync managers that copies use; they are never omitted.

    Raises:
        InputError: Copies use two sync managers of one direction, or an entry is too long.
    """
    kept = _kept(device, name, notes, needed)
    lines = [f"vendor_id: 0x{device.vendor_id:08x}", f"product_id: 0x{device.product_code:08x}"]
    if device.assign_activate:
        lines.append(f"assign_activate: 0x{device.assign_activate:04x}")
    for key, value in driver_facts(device.driver).items():
        if key not in _OF_CHANNELS:
            lines.append(f"{key}: {json.dumps(value)}")
    if device.sdos:
        lines += ["", "sdo:", *(_sdo(s, name, notes) for s in device.sdos)]
    for direction, group in _GROUP.items():
        manager = kept.get(direction)
        pdos = () if manager is None else device.pdos_of(manager)
        if pdos:
            lines += ["", f"{group}:"]
            for pdo in pdos:
                lines += _pdo(pdo, direction, name, notes)
    lines += ["", "sm:"] if device.sync_managers else []
    for sm in sorted(device.sync_managers, key=lambda s: s.index):
        row = f"index: {sm.index}, type: {sm.direction.value}"
        if kept.get(sm.direction) is sm:
            row += f", pdo: {_GROUP[sm.direction]}"
        if sm.watchdog is not Watchdog.DEFAULT:
            row += f", watchdog: {sm.watchdog.value}"
        lines.append(f"  - {{{row}}}")
    return "\n".join(lines) + "\n"


def _kept(
    device: Device, name: str, notes: list[str], needed: Collection[int]
) -> dict[Direction, SyncManager]:
    """Return the sync manager whose PDOs the file contains, for each direction."""
    kept: dict[Direction, SyncManager] = {}
    for direction in Direction:
        rows = [s for s in device.sync_managers if s.direction is direction and device.pdos_of(s)]
        used = [s for s in rows if s.index in needed]
        if len(used) > 1:
            both = " and ".join(f"Sm{s.index}" for s in used)
            raise InputError(f"{name}: copies use {both}; the driver has one list of PDOs for both")
        for sm in rows:
            if kept.setdefault(direction, (used or rows)[0]) is not sm:
                notes.append(
                    f"{name}: the PDOs of Sm{sm.index} are left out; the driver has one list of "
                    f"PDOs for all sync managers with {direction.value}s"
                )
    return kept


def _sdo(sdo: Sdo, name: str, notes: list[str]) -> str:
    bits, value = 8 * sdo.size_bytes, sdo.raw
    # The driver reads a signed 32-bit number, so a large uint32 is written as a negative one.
    if value >= 1 << (bits - 1) and (sdo.value < 0 or bits == 32):
        value -= 1 << bits
    if not -(2**31) <= value < 2**31:
        notes.append(
            f"{name}: SDO 0x{sdo.index:04x}:{sdo.subindex:02x} has a value that the driver cannot "
            "read; it takes 32 bits with a sign"
        )
    kind = "int" if value < 0 else "uint"
    return (
        f"  - {{index: 0x{sdo.index:04x}, sub_index: {sdo.subindex}, type: {kind}{bits}, "
        f"value: {value}}}"
    )


def _pdo(pdo: Pdo, direction: Direction, name: str, notes: list[str]) -> Iterator[str]:
    title = plain_text(pdo.name)
    yield f"  - index: 0x{pdo.index:04x}{f'   # {title}' if title else ''}"
    if not pdo.entries:
        notes.append(f"{name}: PDO 0x{pdo.index:04x} has no entries; the device's own are used")
        return
    yield "    channels:"
    for entry in pdo.entries:
        if entry.bits <= LONGEST_BITS and (entry.bits or not entry.is_gap):
            yield from _channel(entry, direction)
            continue
        if not entry.is_gap:
            raise InputError(
                f"{name}: {entry.address} has {entry.bits} bits; the driver counts up to 255"
            )
        for first in range(0, entry.bits, LONGEST_BITS):
            bits = min(LONGEST_BITS, entry.bits - first)
            yield from _channel(Entry(index=0, subindex=0, bits=bits), direction)


def _channel(entry: Entry, direction: Direction) -> Iterator[str]:
    parts = [f"index: 0x{entry.index:04x}", f"sub_index: {entry.subindex}"]
    parts.append(f"type: {type_word(entry)}")
    if entry.skip:
        parts.append("skip: true")
    if entry.name and not entry.is_gap:
        parts.append(f"name: {quoted(entry.name)}")
    if not entry.views:
        parts += _interfaces(entry)
        if entry.default is not None:
            # Versions of 2025 read a default only with an interface; null binds nothing.
            if direction is Direction.OUTPUT and entry.command_interface is None:
                parts.append("command_interface: ~")
            parts.append(f"default: {_float(entry.default)}")
    if entry.mask is not None:
        parts.append(f"mask: 0x{entry.mask:02x}")
    parts += _scale(entry)
    if entry.component:
        parts.append(f"for: {quoted(entry.component)}")
    parts += [f"{key}: {json.dumps(value)}" for key, value in driver_facts(entry.driver).items()]
    if entry.restart_relevant:
        parts.append("restart_relevant: true")
    if not entry.views:
        yield f"      - {{{', '.join(parts)}}}"
        return
    yield f"      - {parts[0]}"
    for part in parts[1:]:
        yield f"        {part}"
    yield "        data_mapping:"
    for view in entry.views:
        yield f"          - {{{', '.join(_view(view))}}}"


def _view(view: EntryView) -> list[str]:
    parts = [f"addr_offset: {view.bit // 8}", f"type: {view.type_name}"]
    if view.type_name in ("bool", "int8", "uint8") or view.bit % 8 or view.bits < 8:
        parts.append(f"mask: 0x{((1 << view.bits) - 1) << view.bit % 8:02x}")
    parts += _interfaces(view)
    if view.default is not None:
        parts.append(f"default_value: {_float(view.default)}")
    return parts + _scale(view)


def _interfaces(row: Entry | EntryView) -> list[str]:
    keys = ("command_interface", "state_interface")
    return [f"{k}: {quoted(value)}" for k in keys if (value := getattr(row, k)) is not None]


def _scale(row: Entry | EntryView) -> list[str]:
    parts = [] if row.factor == 1 else [f"factor: {_float(row.factor)}"]
    return parts if row.offset == 0 else [*parts, f"offset: {_float(row.offset)}"]


def _float(value: float) -> str:
    return ".nan" if value != value else repr(value)
