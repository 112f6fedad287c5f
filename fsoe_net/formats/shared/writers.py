"""Helpers for writers: files with notes, names, the entry at the start of a copy, the logic."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.errors import InputError
from fsoe_net.model.bus import Entry, same_devices
from fsoe_net.model.description import DescribedCopy, DescribedEnd, Description
from fsoe_net.model.layout import DeviceLayout, SmLayout
from fsoe_net.model.names import Names

_MARKS = (0xFEFF, 0xFFFE, 0xFFFF)
# XML 1.0 and YAML do not allow these, not even escaped.
_NOT_TEXT = dict.fromkeys(
    (*range(0x20), *range(0x7F, 0xA0), 0x2028, 0x2029, *range(0xD800, 0xE000), *_MARKS),
    " ",
)
_BARE = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*\Z")
# YAML 1.1, which yaml-cpp follows, reads these as a boolean or null.
_WORDS = {"true", "false", "yes", "no", "on", "off", "null", "y", "n"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """Files by their path inside the folder, and notes on data that the format cannot represent."""

    files: Mapping[str, str]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CopyGroup:
    """The copies of one MainInstance. ``main`` is ``None`` if the copies do not identify it."""

    name: str
    main: int | None
    copies: tuple[DescribedCopy, ...]


def own_words_lost(description: Description, *, nets: bool) -> list[str]:
    """Return notes on data that only a network file of fsoe-net can represent, if present.

    Args:
        description: Description to write.
        nets: Whether names of nets are also lost.
    """
    notes = []
    entries = (
        entry
        for sub in description.subdevices
        for sm in sub.device.sync_managers
        for pdo in sub.device.pdos_of(sm)
        for entry in pdo.entries
    )
    if any(entry.restart_relevant for entry in entries):
        notes.append("restart_relevant marks of entries are not in this file")
    if nets and any(copy.name for copy in description.copies):
        notes.append("names of nets are not in this file")
    return notes


def plain_text(text: str) -> str:
    """Return a text on one line, without characters that are invalid in text files."""
    return text.translate(_NOT_TEXT).strip()


def quoted(text: str) -> str:
    """Return a text as a YAML string."""
    text = plain_text(text)
    if _BARE.match(text) and text.lower() not in _WORDS:
        return text
    return json.dumps(text, ensure_ascii=False)


def unique_names(description: Description) -> tuple[str, ...]:
    """Return a name for each SubDevice: its own, or its order number, or its position."""
    names, found = Names(), []
    for number, sub in enumerate(description.subdevices):
        place = number if sub.position is None else sub.position
        own = plain_text(sub.name) or plain_text(sub.order) or f"subdevice_{place}"
        found.append(names.add(own))
    return tuple(found)


def identifiers(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names as C identifiers and file names: lower case, unique."""
    given, found = Names(), []
    for name in names:
        own = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:48]
        if own[:1].isdigit():
            own = f"n{own}"
        found.append(given.add(own or "unnamed"))
    return tuple(found)


def manager_of(description: Description, end: DescribedEnd) -> SmLayout | None:
    """Return the sync manager of an end of a copy."""
    return description.subdevices[end.subdevice].device.layout.manager(end.sm_index)


class Endpoints:
    """The entries at which copies may begin; each device is searched once."""

    def __init__(self, description: Description, names: Sequence[str]) -> None:
        self._subs = description.subdevices
        self._names = names
        self._devices = same_devices(sub.device for sub in description.subdevices)
        self._tables: dict[int, dict[tuple[int, int], tuple[Entry, bool]]] = {}  # by device

    def at(self, end: DescribedEnd) -> Entry:
        """Return the entry at the start of a copy, which drivers find by index and subindex.

        Raises:
            InputError: No entry begins there, the entry is padding, or an earlier one has the same
                address.
        """
        device = self._devices[end.subdevice]
        if device not in self._tables:
            self._tables[device] = _entries_by_place(self._subs[device].device.layout)
        name = self._names[end.subdevice]
        where = f"{name}: bit {end.bit_offset} of Sm{end.sm_index}, where a copy begins,"
        entry, first = self._tables[device].get((end.sm_index, end.bit_offset), (None, False))
        if entry is None:
            raise InputError(
                f"{where} is not the begin of an entry; the layout of the device is needed"
            )
        if not entry.registered:
            raise InputError(f"{where} is padding, which has no address")
        if not first:
            raise InputError(
                f"{where} is {entry.address} a second time; drivers take the first one"
            )
        return entry


def _entries_by_place(layout: DeviceLayout) -> dict[tuple[int, int], tuple[Entry, bool]]:
    """Return each entry with a length, and whether it is the first one with its address."""
    seen: set[tuple[int, int]] = set()
    table = {}
    for manager in layout.managers:
        for placed in manager.placed:
            entry = placed.entry
            key = (entry.index, entry.subindex)
            # After a PDO of unknown length no offset is certain.
            if entry.bits and placed.bit_offset < manager.known_bits:
                table[manager.sm.index, placed.bit_offset] = (entry, key not in seen)
            if entry.registered:
                seen.add(key)
    return table


def is_fsoe(description: Description, copy: DescribedCopy) -> bool:
    """Return whether a copy moves an FSoE frame: stated by the source, or both ends are frames."""
    if copy.fsoe is not None:
        return copy.fsoe
    for end in (copy.source, copy.destination):
        manager = manager_of(description, end)
        block = None if manager is None else manager.block_at(end.bit_offset)
        if block is None or (8 * block.byte_offset, 8 * block.frame_bytes) != (
            end.bit_offset,
            copy.bits,
        ):
            return False
    return True


def _by_net(description: Description) -> list[tuple[str, list[DescribedCopy]]]:
    """Return the copies by name; unnamed ones by the SubDevices that they connect."""
    root = list(range(len(description.subdevices)))

    def top(number: int) -> int:
        while root[number] != number:
            # Path halving: chains of thousands of copies stay short.
            root[number] = root[root[number]]
            number = root[number]
        return number

    for copy in description.copies:
        root[top(copy.source.subdevice)] = top(copy.destination.subdevice)
    named: dict[str, list[DescribedCopy]] = {}
    loose: dict[int, list[DescribedCopy]] = {}
    for copy in description.copies:
        if copy.name:
            named.setdefault(copy.name, []).append(copy)
        else:
            loose.setdefault(top(copy.source.subdevice), []).append(copy)
    unnamed = [(f"net_{number}", copies) for number, copies in enumerate(loose.values())]
    return [*named.items(), *unnamed]


def copy_groups(description: Description, notes: list[str]) -> tuple[CopyGroup, ...]:
    """Return the copies by their MainInstance, which is never guessed.

    Named copies are grouped by name. Other copies are grouped if they share SubDevices. A SubDevice
    at one end of every FSoE copy of a group is its MainInstance, if it is the only one or a
    connection names it.

    Args:
        description: SubDevices, copies, connections.
        notes: Takes a line for each group whose MainInstance is unknown.
    """
    rows = _by_net(description)
    mains = {c.main for c in description.connections if c.main is not None}
    groups = []
    for name, copies in rows:
        frames = [c for c in copies if is_fsoe(description, c)]
        common = set.intersection(
            *({c.source.subdevice, c.destination.subdevice} for c in frames or copies)
        )
        found = common & mains or common
        main = next(iter(found)) if len(found) == 1 and frames else None
        if main is None and frames:
            notes.append(
                f"net {name}: which SubDevice is the MainInstance is not known; add safety_master"
            )
        groups.append(CopyGroup(name=name, main=main, copies=tuple(copies)))
    return tuple(groups)
