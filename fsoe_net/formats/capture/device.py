"""Converts the data of a SubDevice in a capture into the model; missing data is reported."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.capture.station import MAPPINGS, Manager, Station
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.sii.read import SiiImage, describe_sii, read_sii_categories
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, Sdo, SyncManager, Watchdog
from fsoe_net.model.description import DescribedSubDevice

_IDENTITY = {"vendor": (0x8, 1), "product": (0xA, 2), "revision": (0xC, 3), "serial": (0xE, 4)}


@dataclass(slots=True)
class _Read:
    """State of the description of one SubDevice."""

    station: Station
    path: str
    span: Span
    notes: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)


def describe_station(station: Station, path: str, out: Collector) -> DescribedSubDevice:
    """Return the known data of a SubDevice.

    Args:
        station: Data seen in the capture.
        path: The capture.
        out: Takes FSN153 for data missing in the capture, FSN154 where PDOs do not fill the space
            that the MainDevice has assigned to them.
    """
    read = _Read(station, path, Span(path, station.packet, 1))
    findings, damage = Collector(), Collector()
    data, whole = station.sii.image()
    image = read_sii_categories(data, read.span, damage)
    from_sii = describe_sii(image, path, read.span, damage)
    read.notes += [f"its EEPROM: {d.message}" for d in damage.diagnostics]
    # Categories that were not read could hold the PDOs that count.
    managers = _managers(read, from_sii if whole else None, findings)
    layout = _settled(read, managers)
    vendor, product, revision, serial = (_identity(read, name) for name in _IDENTITY)
    name, order = image.names()
    _judge(read, findings, vendor is None or product is None)
    out.diagnostics += findings.diagnostics
    assigned = {p.index for sm in layout for p in sm.pdos or ()}
    return DescribedSubDevice(
        name=name or station.name(),
        order=order or station.name(),
        position=station.position,
        alias=station.alias,
        device=Device(
            path=path,
            vendor_id=vendor or 0,
            product_code=product or 0,
            assign_activate=station.dc_activation,
            sync_managers=layout,
            sdos=_sdos(read),
            span=read.span,
        ),
        available=tuple(p for p in _offered(read, from_sii, image) if p.index not in assigned),
        revision=revision,
        serial=serial,
        module_ident=station.modules(),
        notes=tuple(read.notes),
        span=read.span,
    )


def _identity(read: _Read, name: str) -> int | None:
    """Return a number of the identity, from the EEPROM or else from object 0x1018."""
    word, subindex = _IDENTITY[name]
    stored = read.station.sii.number(word)
    in_object = read.station.object_number(0x1018, subindex)
    if stored is not None and in_object is not None and stored != in_object:
        read.notes.append(f"{name} is 0x{stored:08x} in the EEPROM and 0x{in_object:08x} in 0x1018")
    return in_object if stored is None else stored


def _judge(read: _Read, findings: Collector, nameless: bool) -> None:
    """Report missing data, in one finding for the SubDevice."""
    station = read.station
    lacking = list(read.unknown)
    if nameless:
        lacking.insert(0, "its identity")
    if station.position is None:
        lacking.insert(0, "its place in the ring")
    if station.sii.conflicts:
        words = ", ".join(f"0x{w:02x}" for w in sorted(station.sii.conflicts)[:4])
        read.notes.append(f"the EEPROM was read with two values (word {words}); the last is taken")
    if station.late:
        read.notes.append(f"{station.late} SDO downloads outside of the start-up are left out")
    if station.odd:
        read.notes.append(f"{station.odd} SDO downloads are not plain 1, 2, 4 or 8 bytes; left out")
    for abort, packet in station.aborts:
        read.notes.append(
            f"packet {packet}: it refused a write to 0x{abort.index:04x}:{abort.subindex:02x} "
            f"(abort 0x{abort.code:08x})"
        )
    if lacking:
        read.notes += [f"not in the capture: {what}" for what in lacking]
        findings.add(
            "FSN153",
            read.span,
            f"{_who(station)}: the capture does not show {', '.join(lacking)}",
            hint="capture from before the MainDevice starts, or give the ESI of the device too",
        )


def _who(station: Station) -> str:
    if station.position is not None:
        return f"the SubDevice at position {station.position}"
    return f"the SubDevice with station address 0x{station.address or 0:04x}"


# -- process data ---------------------------------------------------------------------------------


def _managers(
    read: _Read, from_sii: DescribedSubDevice | None, findings: Collector
) -> list[tuple[SyncManager, Manager | None]]:
    station = read.station
    registers = station.managers()
    stored = {} if from_sii is None else {m.index: m for m in from_sii.device.sync_managers}
    mailboxes = {number for number, m in registers.items() if m.is_mailbox}
    found = []
    for number in range(16):
        if number in mailboxes:
            continue
        row = _enabled(registers.get(number))
        listed = station.assigned(number)
        sii = stored.get(number)
        # If any sync manager was written, the ones that were not written are not in use.
        in_eeprom = not registers and _has_pdos(sii)
        if row is None and not listed and not in_eeprom:
            continue
        pdos = _pdos(read, number, listed, sii, row, findings)
        direction = _direction(row, sii, pdos, listed)
        if direction is None or (pdos is None and row is None and not mailboxes):
            continue
        manager = SyncManager(
            index=number,
            direction=direction,
            watchdog=_watchdog(row, direction),
            pdos=pdos,
            start_byte=_start(row, sii),
            span=_place(read, 0x1C10 + number),
        )
        found.append((manager, row))
    return found


def _has_pdos(manager: SyncManager | None) -> bool:
    return manager is not None and bool(manager.pdos)


def _enabled(row: Manager | None) -> Manager | None:
    """Return a sync manager, or ``None`` if it was written as disabled."""
    return row if row is not None and row.enabled else None


def _watchdog(row: Manager | None, direction: Direction) -> Watchdog:
    # Only writes of the MainDevice trigger the watchdog, so inputs have none.
    if row is None or row.control is None or direction is not Direction.OUTPUT:
        return Watchdog.DEFAULT
    return Watchdog.of(row.control)


def _start(row: Manager | None, sii: SyncManager | None) -> int | None:
    if row is not None:
        return row.start
    return None if sii is None else sii.start_byte


def _place(read: _Read, index: int) -> Span:
    """Return the packet with the content of an object, or the first packet of the SubDevice."""
    packet = read.station.places.get(index)
    return read.span if packet is None else Span(read.path, packet, 1)


def _direction(
    row: Manager | None,
    sii: SyncManager | None,
    pdos: tuple[Pdo, ...] | None,
    listed: Iterable[int] | None,
) -> Direction | None:
    if row is not None:
        return row.direction
    if sii is not None:
        return sii.direction
    indices = [p.index for p in pdos or ()] or list(listed or ())
    if not indices:
        return None
    return Direction.OUTPUT if indices[0] in MAPPINGS[0] else Direction.INPUT


def _pdos(
    read: _Read,
    number: int,
    listed: tuple[int, ...] | None,
    sii: SyncManager | None,
    row: Manager | None,
    findings: Collector,
) -> tuple[Pdo, ...] | None:
    """Return the PDOs of a sync manager, from the object dictionary or else from the EEPROM."""
    if listed is None:
        return _stored_pdos(read, number, sii, row)
    stored = {} if sii is None else {p.index: p for p in sii.pdos or ()}
    pdos: list[Pdo] = []
    missing: list[str] = []
    for index in listed:
        mapping = read.station.mapping(index)
        if mapping is not None:
            pdos.append(_mapped(read, index, mapping))
        elif index in stored:
            pdos.append(stored[index])
        else:
            missing.append(f"0x{index:04x}")
    if missing:
        read.unknown.append(f"the entries of PDO {', '.join(missing)}")
        return None
    if row is not None and _bytes(pdos) != row.length:
        findings.add(
            "FSN154",
            _place(read, 0x1C10 + number),
            f"{_who(read.station)}: SM{number} has {row.length} bytes, its PDOs have "
            f"{_bytes(pdos)}",
            hint="the mapping was changed unseen: capture a whole start-up, or use the ESI alone",
        )
    return tuple(pdos)


def _stored_pdos(
    read: _Read, number: int, sii: SyncManager | None, row: Manager | None
) -> tuple[Pdo, ...] | None:
    """Return the PDOs of the EEPROM if they fill the sync manager."""
    stored = None if sii is None else sii.pdos
    if not stored:
        return None
    if row is not None and _bytes(stored) != row.length:
        read.notes.append(
            f"SM{number} has {row.length} bytes, the PDOs of the EEPROM {_bytes(stored)}: "
            "they are not what is used"
        )
        return None
    return stored


def _bytes(pdos: Iterable[Pdo]) -> int:
    return (sum(p.bits for p in pdos) + 7) // 8


def _mapped(read: _Read, index: int, mapping: tuple[int, ...]) -> Pdo:
    span = _place(read, index)
    entries = tuple(
        Entry(index=row >> 16, subindex=row >> 8 & 0xFF, bits=row & 0xFF, span=span)
        for row in mapping
        if row & 0xFF
    )
    return Pdo(index=index, entries=entries, span=span)


def _settled(
    read: _Read, rows: list[tuple[SyncManager, Manager | None]]
) -> tuple[SyncManager, ...]:
    """Return a layout only if all of it is known: a partial one would shift the following data."""
    blank = [sm for sm, row in rows if sm.pdos is None and (row is None or row.length)]
    if not blank:
        return tuple(sm for sm, _ in rows)
    for sm, row in rows:
        if sm.pdos is None and row is not None:
            read.unknown.append(f"what the {row.length} bytes of SM{sm.index} are")
    kept = [sm for sm, _ in rows if sm.pdos]
    if kept:
        names = ", ".join(f"SM{sm.index}" for sm in kept)
        read.notes.append(f"the PDOs of {names} are known, but not those of all sync managers")
    return ()


def _offered(read: _Read, from_sii: DescribedSubDevice, image: SiiImage) -> tuple[Pdo, ...]:
    """Return all PDOs that were found, those of the object dictionary first."""
    found: dict[int, Pdo] = {}
    for index in sorted(i for i, sub in read.station.objects if sub == 0):
        if any(index in group for group in MAPPINGS):
            mapping = read.station.mapping(index)
            if mapping:
                found[index] = _mapped(read, index, mapping)
    stored = [p.pdo for p in image.pdos]
    for pdo in (*stored, *from_sii.available):
        found.setdefault(pdo.index, pdo)
    return tuple(found.values())


def _sdos(read: _Read) -> tuple[Sdo, ...]:
    return tuple(
        Sdo.of(index, subindex, data, Span(read.path, packet, 1))
        for (index, subindex), (data, packet) in read.station.downloads.items()
    )
