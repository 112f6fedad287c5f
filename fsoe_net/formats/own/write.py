"""A description as a network of fsoe-net, with the parts shared with transfer YAML."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from fsoe_net.errors import InputError
from fsoe_net.formats.own.comments import Remarks, comment, connection_lines
from fsoe_net.formats.own.write_slave_yaml import write_slave_yaml
from fsoe_net.formats.shared.writers import (
    CopyGroup,
    Endpoints,
    Written,
    copy_groups,
    identifiers,
    is_fsoe,
    quoted,
    unique_names,
)
from fsoe_net.model.bus import same_devices
from fsoe_net.model.description import DescribedConnection, DescribedSubDevice, Description
from fsoe_net.model.names import Names


def write_network(
    description: Description,
    *,
    file: str = "network.yaml",
    name: str | None = None,
    remarks: Remarks | None = None,
) -> Written:
    """Return a network YAML with a slave YAML for each device type.

    Args:
        description: Description to write.
        file: Name of the network YAML.
        name: Name of the network; default: that of the file.
        remarks: Comments. With them connections need no copies, and list missing data.

    Raises:
        InputError: A copy does not begin at an entry, or a device does not fit into a slave YAML.
    """
    files = NetworkFiles(description, remarks)
    lines = comment(() if remarks is None else remarks.head)
    lines += ["version: 1", f"name: {quoted(Path(file).stem if name is None else name)}"]
    if description.cycle_us:
        lines.append(f"cycle_us: {description.cycle_us}")
    elif remarks is not None:
        lines.append("# cycle_us: TODO   bus cycle in microseconds, such as 1000")
    lines += ["", "subdevices:" if description.subdevices else "subdevices: []"]
    for number, (sub, called, place, config) in enumerate(files.rows()):
        if remarks is not None:
            lines += comment(remarks.subdevices.get(number, ()), 2)
        row = f"name: {quoted(called)}, {place}, config: {config}"
        if sub.revision is not None:
            row += f", revision: 0x{sub.revision:08x}"
        lines.append(f"  - {{{row}}}")
    lines += files.nets("safety_master")
    return files.written(file, lines)


class NetworkFiles:
    """SubDevices with their slave YAMLs, and nets, for both kinds of files.

    Attributes:
        notes: Data that the files cannot represent.
        configs: Slave YAMLs by path.
    """

    def __init__(self, description: Description, remarks: Remarks | None = None) -> None:
        self._remarks = remarks
        self.notes: list[str] = []
        self.configs: dict[str, str] = {}
        self._texts: dict[tuple[int, frozenset[int]], str] = {}
        self._description = description
        # Numbers of the connections between two SubDevices.
        self._between: dict[frozenset[int | None], list[int]] = {}
        for number, row in enumerate(description.connections):
            self._between.setdefault(frozenset((row.main, row.sub)), []).append(number)
        self._devices = same_devices(sub.device for sub in description.subdevices)
        self._names = unique_names(description)
        self._endpoints = Endpoints(description, self._names)
        self._groups = copy_groups(description, self.notes)
        if remarks is not None:
            named = {c.net: c.main for c in description.connections if c.net}
            self._groups = tuple(
                g if g.main is not None else replace(g, main=named.get(g.name))
                for g in self._groups
            )
            self._groups += self._without_copies()

    def rows(self) -> Iterator[tuple[DescribedSubDevice, str, str, str]]:
        """Yield each SubDevice with its name, address and slave YAML."""
        by_text: dict[tuple[str, str], str] = {}
        needed: dict[int, set[int]] = {}
        for copy in self._description.copies:
            for end in (copy.source, copy.destination):
                needed.setdefault(end.subdevice, set()).add(end.sm_index)
        words = identifiers(self._names)
        for number, sub in enumerate(self._description.subdevices):
            name = self._names[number]
            text = self._slave_yaml(number, name, frozenset(needed.get(number, ())))
            # Without an identity two types are equal: only the order number differs.
            key = (text, "" if sub.device.product_code else sub.order.casefold())
            if key not in by_text:
                path = by_text[key] = f"devices/{words[number]}.yaml"
                head = () if self._remarks is None else self._remarks.devices.get(number, ())
                self.configs[path] = "\n".join([*comment(head), text])
            self._lost(sub, name)
            yield sub, name, self._place(sub, name, number), by_text[key]

    def _slave_yaml(self, number: int, name: str, needed: frozenset[int]) -> str:
        """Return a slave YAML; equal SubDevices share one, unless it needs a note."""
        key = (self._devices[number], needed)
        text = self._texts.get(key)
        if text is None:
            before = len(self.notes)
            device = self._description.subdevices[number].device
            text = write_slave_yaml(device, name, self.notes, needed=needed)
            if len(self.notes) == before:
                self._texts[key] = text
        return text

    def _lost(self, sub: DescribedSubDevice, name: str) -> None:
        lost = []
        if sub.serial:
            lost.append("serial number")
        if sub.available:
            lost.append("PDOs that are offered and not assigned")
        if sub.module_ident:
            lost.append("modules of the slots")
        if lost:
            self.notes.append(f"{name}: not in these files: {', '.join(lost)}")

    def _place(self, sub: DescribedSubDevice, name: str, number: int) -> str:
        if sub.alias:
            return f"alias: {sub.alias}, position: 0"
        if sub.position is None:
            self.notes.append(f"{name}: its ring position is not known; {number} is written")
            return f"alias: 0, position: {number}"
        return f"alias: 0, position: {sub.position}"

    def nets(self, key: str) -> Iterator[str]:
        """Yield the lines of the nets."""
        yield ""
        yield "nets:" if self._groups else "nets: []"
        for group in self._groups:
            yield f"  - name: {quoted(group.name)}"
            if group.main is not None:
                yield f"    {key}: {quoted(self._names[group.main])}"
            if group.copies:
                yield "    transfers:"
                yield from self._transfers(group)
            yield from self._connections(group)
        if self._remarks is not None:
            return
        placed = {n for g in self._groups for c in g.copies for n in (c.source.subdevice,)}
        if any(c.main not in placed or c.sub not in placed for c in self._description.connections):
            self.notes.append("connections without copies are not in these files")

    def _transfers(self, group: CopyGroup) -> Iterator[str]:
        for copy in group.copies:
            if copy.bits % 8:
                raise InputError(f"a copy of {copy.bits} bits: transfers move whole bytes")
            yield f"      - size: {copy.bits // 8}"
            for key, end in (("in", copy.source), ("out", copy.destination)):
                name = self._names[end.subdevice]
                entry = self._endpoints.at(end)
                yield (
                    f"        {key}: {{ec_module: {quoted(name)}, index: 0x{entry.index:04x}, "
                    f"subindex: {entry.subindex}}}"
                )
            if not is_fsoe(self._description, copy):
                yield "        kind: standard"

    def _without_copies(self) -> tuple[CopyGroup, ...]:
        """Return a net for each MainInstance with connections that are in no group of copies."""
        known = {g.main for g in self._groups}
        names = Names(g.name for g in self._groups)
        groups = []
        for row in self._description.connections:
            if row.main is None or row.main in known:
                continue
            known.add(row.main)
            own = (row.net,) if row.net else ()
            name = names.add(*own, f"{self._names[row.main]}_safety")
            groups.append(CopyGroup(name=name, main=row.main, copies=()))
        return tuple(groups)

    def _commented(self, group: CopyGroup, remarks: Remarks) -> Iterator[str]:
        rows = [
            (row, why)
            for row, why in zip(self._description.connections, remarks.connections, strict=True)
            if group.main is not None and row.main == group.main
        ]
        if rows:
            yield "    connections:"
        for row, why in rows:
            yield from connection_lines(row, self._names, why)

    def _connections(self, group: CopyGroup) -> Iterator[str]:
        if self._remarks is not None:
            yield from self._commented(group, self._remarks)
            return
        ends: set[frozenset[int | None]] = {
            frozenset((c.source.subdevice, c.destination.subdevice)) for c in group.copies
        }
        several = Counter(
            (c.source.subdevice, c.destination.subdevice)
            for c in group.copies
            if is_fsoe(self._description, c)
        )
        rows = []
        for number in sorted(n for pair in ends for n in self._between.get(pair, ())):
            row = self._description.connections[number]
            if row.main is None or row.sub is None:
                continue
            parts = [f"main: {quoted(self._names[row.main])}"]
            parts.append(f"sub: {quoted(self._names[row.sub])}")
            # With several pairs of frames between two SubDevices only the slot distinguishes them.
            if several[row.main, row.sub] > 1:
                slot = self._slot(row, group)
                if slot is None:
                    self.notes.append(
                        f"{', '.join(parts)}: its frames are not known, so this connection is not "
                        "in these files"
                    )
                    continue
                parts.append(f"slot: {slot}")
            parts += _facts_of(row)
            # If no facts are stated, the transfers alone describe the connection.
            if len(parts) > 2:
                rows.append(f"      - {{{', '.join(parts)}}}")
        if rows:
            yield "    connections:"
            yield from rows

    def _slot(self, row: DescribedConnection, group: CopyGroup) -> int | None:
        """Return the slot if the same two SubDevices have several connections with copies."""
        if row.main is None:
            return None
        slots = self._description.subdevices[row.main].device.layout.slots
        copied = set()
        for copy in group.copies:
            for end, other in ((copy.source, copy.destination), (copy.destination, copy.source)):
                if (end.subdevice, other.subdevice) == (row.main, row.sub):
                    copied.add((end.sm_index, end.bit_offset // 8))
        known = {slots[key] for key in copied if key in slots}
        return row.slot if row.slot in known else None

    def written(self, name: str, lines: list[str]) -> Written:
        """Return all files."""
        text = "\n".join(lines) + "\n"
        return Written(files={name: text, **self.configs}, notes=tuple(self.notes))


def _facts_of(row: DescribedConnection) -> list[str]:
    facts = {key: getattr(row, key) for key in ("address", "connection_id", "watchdog_ms")}
    lines = [f"{key}: {value}" for key, value in facts.items() if value is not None]
    if row.app_parameters:
        lines.append(f'app_parameters: "{row.app_parameters.hex(" ")}"')
    return lines
