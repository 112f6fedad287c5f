"""A description as a configuration of linuxcnc-ethercat, with ``fsoeSlaveIdx`` at each logic.

The driver copies FSoE frames only for supported types, whose PDOs are built in. All others are
written as ``generic`` with their PDOs.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape

from fsoe_net.errors import InputError
from fsoe_net.formats.shared.writers import (
    Written,
    copy_groups,
    is_fsoe,
    own_words_lost,
    plain_text,
    unique_names,
)
from fsoe_net.model.bus import Direction, Entry, Pdo, Sdo, SyncManager
from fsoe_net.model.description import DescribedConnection, DescribedSubDevice, Description
from fsoe_net.model.names import Names

_DEFAULT_CYCLE_US = 1000
# IgH keeps the length of an entry in one byte (ec_pdo_entry_info_t).
_LONGEST_BITS = 255
# Types for which linuxcnc-ethercat has FSoE built in; vendor 2 is Beckhoff.
_LOGICS = {(2, 0x1AF43052): "EL6900", (2, 0x077E3052): "EL1918_LOGIC"}
_TERMINALS = {(2, 0x07703052): "EL1904", (2, 0x0B583052): "EL2904"}
_HAL = {"REAL": "float", "FLOAT": "float", "LREAL": "float"}


def write_lcec(description: Description, *, file: str = "ethercat-conf.xml") -> Written:
    """Return the configuration of one master.

    Args:
        description: SubDevices with ring positions; connections, or copies that imply them.
        file: Name of the file.

    Raises:
        InputError: A SubDevice has no ring position, or two have the same one.
    """
    return _Configuration(description).written(file)


class _Configuration:
    """Writes one ``<master>``."""

    def __init__(self, description: Description) -> None:
        self._description = description
        self._names = unique_names(description)
        self._notes: list[str] = []
        self._check_positions()
        self._partners = self._find_partners()
        self._connected = {*self._partners, *(s for row in self._partners.values() for s in row)}

    def written(self, file: str) -> Written:
        """Return the file."""
        period = (self._description.cycle_us or _DEFAULT_CYCLE_US) * 1000
        lines = ["<masters>", f'  <master idx="0" appTimePeriod="{period}" refClockSyncCycles="1">']
        for number in range(len(self._names)):
            lines += self._slave(number)
        lines += ["  </master>", "</masters>"]
        facts = [c for c in self._description.connections if c.address or c.watchdog_ms]
        if facts:
            self._notes.append("addresses and watchdogs of connections are not in this file")
        if any(s.device.sync_managers for s in self._description.subdevices):
            self._notes.append("watchdogs of sync managers are not in this file")
        self._notes += own_words_lost(self._description, nets=True)
        return Written(files={file: "\n".join(lines) + "\n"}, notes=tuple(self._notes))

    def _check_positions(self) -> None:
        seen: dict[int, str] = {}
        for name, sub in zip(self._names, self._description.subdevices, strict=True):
            if sub.position is None:
                raise InputError(f"{name}: no ring position, which linuxcnc-ethercat needs")
            if sub.position in seen:
                raise InputError(f"{name}: at ring position {sub.position} is {seen[sub.position]}")
            seen[sub.position] = name

    def _find_partners(self) -> dict[int, list[int]]:
        """Return the SubInstances of each logic, in the order of its slots."""
        partners = self._named_partners()
        for group in copy_groups(self._description, self._notes):
            frames = [c for c in group.copies if is_fsoe(self._description, c)]
            if len(frames) < len(group.copies):
                self._notes.append(f"net {group.name}: copies of other data are not in this file")
            if group.main is None or group.main in partners:
                continue
            # The slot is given by the position of the frame in the logic.
            into = [c for c in frames if c.destination.subdevice == group.main]
            into.sort(key=lambda c: (c.destination.sm_index, c.destination.bit_offset))
            partners[group.main] = list(dict.fromkeys(c.source.subdevice for c in into))
        return partners

    def _named_partners(self) -> dict[int, list[int]]:
        """Return the SubInstances of each logic, as named by the connections."""
        rows = list(self._description.connections)
        if all(row.slot is not None for row in rows):
            rows.sort(key=lambda row: row.slot or 0)  # only their order shows the slot
            self._gaps(rows)
        partners: dict[int, list[int]] = {}
        for row in rows:
            if row.main is not None and row.sub is not None:
                partners.setdefault(row.main, []).append(row.sub)
        return partners

    def _gaps(self, rows: list[DescribedConnection]) -> None:
        """Note each logic with an omitted slot."""
        slots: dict[int, list[int]] = {}
        for row in rows:
            if row.main is not None and row.slot is not None:
                slots.setdefault(row.main, []).append(row.slot)
        for main, numbers in slots.items():
            if numbers != list(range(len(numbers))):
                listed = ", ".join(map(str, numbers))
                self._notes.append(
                    f"{self._names[main]}: slots {listed} are connected; linuxcnc-ethercat counts "
                    "from 0 without gaps and would serve others"
                )

    def _type(self, number: int) -> str:
        """Return the type that the driver has for this SubDevice; empty for ``generic``."""
        device = self._description.subdevices[number].device
        key = device.identity
        if number in self._partners:
            known = _LOGICS.get(key, "")
        elif number in self._connected:
            known = _TERMINALS.get(key, "")
        else:
            known = ""
        order = self._description.subdevices[number].order
        if not known and order and not device.sync_managers and not device.vendor_id:
            known = plain_text(order)  # as written by linuxcnc-ethercat
        return known

    def _slave(self, number: int) -> Iterator[str]:
        sub = self._description.subdevices[number]
        name, kind = self._names[number], self._type(number)
        own = f"idx={_quoted(str(sub.position))} type={_quoted(kind or 'generic')}"
        own += f" name={_quoted(name)}"
        if number in self._connected and not kind:
            self._notes.append(
                f"{name}: linuxcnc-ethercat has no FSoE for this device; it is written as generic "
                "and its frames are not copied"
            )
        rows = [
            f'      <modParam name="fsoeSlaveIdx" value="'
            f'{self._description.subdevices[partner].position}"/>'
            for partner in self._partners.get(number, [])
        ]
        if kind:
            if sub.device.sync_managers:
                self._notes.append(f"{name}: its PDOs are those that the driver has for {kind}")
        else:
            own += f' vid="{sub.device.vendor_id:08X}" pid="{sub.device.product_code:08X}"'
            own += ' configPdos="true"'
            rows += self._generic(sub, name)
        if sub.revision is not None or sub.alias:
            self._notes.append(f"{name}: revision and alias are not in this file")
        if rows:
            yield f"    <slave {own}>"
            yield from rows
            yield "    </slave>"
        else:
            yield f"    <slave {own}/>"

    def _generic(self, sub: DescribedSubDevice, name: str) -> Iterator[str]:
        device = sub.device
        if device.assign_activate:
            yield f'      <dcConf assignActivate="{device.assign_activate:x}"/>'
        for sdo in device.sdos:
            yield from _sdo(sdo)
        pins = Names()
        for sm in sorted(device.sync_managers, key=lambda s: s.index):
            yield from self._manager(sm, device.pdos_of(sm), name, pins)

    def _manager(
        self, sm: SyncManager, pdos: tuple[Pdo, ...], name: str, pins: Names
    ) -> Iterator[str]:
        direction = "out" if sm.direction is Direction.OUTPUT else "in"
        yield f'      <syncManager idx="{sm.index}" dir="{direction}">'
        for pdo in pdos:
            yield f'        <pdo idx="{pdo.index:04X}">'
            for entry in pdo.entries:
                if entry.bits > _LONGEST_BITS and not entry.is_gap:
                    raise InputError(f"{name}: {entry.address} has {entry.bits} bits; 255 fit")
                # Padding that is longer than the longest entry is split; data cannot be split.
                for first in range(0, max(entry.bits, 1), _LONGEST_BITS):
                    yield _entry(entry, min(_LONGEST_BITS, entry.bits - first), pins)
            yield "        </pdo>"
        yield "      </syncManager>"


def _entry(entry: Entry, bits: int, pins: Names) -> str:
    row = f'idx="{entry.index:04X}" subIdx="{entry.subindex:02X}" bitLen="{bits}"'
    pin = plain_text(entry.name)
    # HAL pins of the types bit, s32, u32 and float have at most 32 bits.
    if pin and not entry.is_gap and bits <= 32:
        pin = pins.add(pin)
        word = entry.type_name.upper()
        kind = "bit" if bits == 1 else _HAL.get(word, "")
        if not kind:
            kind = "s32" if word.startswith(("INT", "SINT", "DINT")) else "u32"
        row += f' halPin={_quoted(pin)} halType="{kind}"'
    return f"          <pdoEntry {row}/>"


def _sdo(sdo: Sdo) -> Iterator[str]:
    data = sdo.raw.to_bytes(sdo.size_bytes, "little").hex(" ").upper()
    yield f'      <sdoConfig idx="{sdo.index:04X}" subIdx="{sdo.subindex:02X}">'
    yield f'        <sdoDataRaw data="{data}"/>'
    yield "      </sdoConfig>"


def _quoted(text: str) -> str:
    return '"' + escape(plain_text(text), {'"': "&quot;"}) + '"'
