"""Changes of SubDevices in the drawing: ``place``, ``move``, ``rename``, ``remove``, and adding.

Positions and aliases describe the existing machine; they are never selected here, except for a
SubDevice that is added without a position: it gets the next position after the last one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fsoe_net.errors import InputError
from fsoe_net.formats.shared.yaml_words import Hex
from fsoe_net.model.resolve import Resolution
from fsoe_net.proposal.offers import Addition
from fsoe_net.studio.rows import (
    Change,
    disconnected,
    list_in,
    name_of,
    new_name_of,
    number_of,
    remove_row,
    subdevice_row,
)

_MOST_POSITION = 65535


def added(
    resolution: Resolution, rows: Sequence[Addition], bus: int
) -> Callable[[Any, Sequence[str]], None]:
    """Return the change that adds SubDevices to a bus; it takes the names of their device files.

    Args:
        resolution: Resolution of the text.
        rows: SubDevices to add; given positions are kept.
        bus: Number of the bus, 0 if the file has only one.

    Raises:
        InputError: Unknown bus, a position is in use, or no position is left.
    """
    network = resolution.network
    if bus and bus >= len(network.buses):
        raise InputError("unknown bus")
    # An alias starts a separate count of positions, so those SubDevices cannot collide here.
    there = [sub for sub in network.subdevices if sub.master_id == bus and not sub.alias]
    taken = {sub.position: sub.name for sub in there}
    names = set(resolution.numbers)
    made: list[dict[str, object]] = []
    for row in rows:
        # Incremented with each row: several SubDevices of one request are consecutive.
        position = max(taken, default=-1) + 1 if row.position is None else row.position
        if position in taken:
            raise InputError(f"position {position} is taken by {taken[position]}")
        if position > _MOST_POSITION:
            raise InputError("no position is left after the last SubDevice")
        name = _free_name(row.name, names)
        names.add(name)
        taken[position] = name
        fields: dict[str, object] = {"name": name, "position": position, "config": ""}
        if row.revision is not None:
            fields["revision"] = Hex(row.revision)
        made.append(fields)

    # The names of device files are determined when the text is written, as files may exist by then.
    def change(document: Any, configs: Sequence[str]) -> None:
        parent = document["buses"][bus] if network.buses else document
        found = list_in(parent, "subdevices")
        for fields, config in zip(made, configs, strict=True):
            found.append({**fields, "config": config})

    return change


def _free_name(name: str, taken: set[str]) -> str:
    names = [name, *(f"{name}_{n}" for n in range(2, len(taken) + 3))]
    return next(name for name in names if name not in taken)


def _place(request: Mapping[str, object], resolution: Resolution) -> Change:
    name = name_of(request, "subdevice", resolution)
    keys = [key for key in ("position", "alias") if key in request] or ["position"]
    values = {key: number_of(request, key, _MOST_POSITION) for key in keys}

    def change(document: Any) -> None:
        _, row = subdevice_row(document, resolution, name)
        for key, value in values.items():
            row[key] = value
        # Alias 0 means none, so it is not written.
        if row.get("alias") == 0:
            del row["alias"]

    return change


def _move(request: Mapping[str, object], resolution: Resolution) -> Change:
    """Move a SubDevice to the place of another: those between shift, all positions stay in use."""
    subdevices = resolution.network.subdevices
    moved, other = (
        subdevices[resolution.numbers[name_of(request, key, resolution)]]
        for key in ("subdevice", "to")
    )
    # Only SubDevices that count from the start of one bus have an order that can change.
    if moved.alias or other.alias or moved.master_id != other.master_id:
        raise InputError(
            "only SubDevices of one bus that are counted from its begin change their places; "
            "set the position of one with an alias"
        )
    line = sorted(
        (s for s in subdevices if s.master_id == moved.master_id and not s.alias),
        key=lambda s: s.position,
    )
    # The set of positions stays the same, because gaps in a bus are facts of the machine.
    positions = [sub.position for sub in line]
    place = line.index(other)
    line.remove(moved)
    line.insert(place, moved)

    def change(document: Any) -> None:
        for sub, position in zip(line, positions, strict=True):
            if sub.position != position:
                subdevice_row(document, resolution, sub.name)[1]["position"] = position

    return change


def _rename(request: Mapping[str, object], resolution: Resolution) -> Change:
    """Give a SubDevice another name, wherever the file uses the old one."""
    old, new = name_of(request, "subdevice", resolution), new_name_of(request)
    if new in resolution.numbers:
        raise InputError(f"a SubDevice has the name {new} already")

    def change(document: Any) -> None:
        _, row = subdevice_row(document, resolution, old)
        row["name"] = new
        # Missing or invalid lists are skipped: the text may have errors while it is edited.
        for net in _maps(document.get("nets")):
            _renamed(net, ("safety_master", "transfer_master"), old, new)
            for part in _maps(net.get("connections")):
                _renamed(part, ("main", "sub"), old, new)
            for part in _maps(net.get("transfers")):
                for end in _maps([part.get("in"), part.get("out")]):
                    _renamed(end, ("ec_module",), old, new)
        for function in _maps(document.get("safety_functions")):
            for part in _maps(function.get("elements")):
                _renamed(part, ("sub",), old, new)
        for group in _maps(document.get("groups")):
            names = group.get("subdevices") or []
            # Assigned in place, because a new list would lose the comments of the file.
            names[:] = [new if str(name) == old else name for name in names]

    return change


def _renamed(row: Any, keys: Sequence[str], old: str, new: str) -> None:
    for key in keys:
        if str(row.get(key)) == old:
            row[key] = new


def _remove(request: Mapping[str, object], resolution: Resolution) -> Change:
    """Remove a SubDevice with all its copies; its device file is kept."""
    name = name_of(request, "subdevice", resolution)
    sub = resolution.network.subdevices[resolution.numbers[name]]

    def change(document: Any) -> None:
        # Items are found by their place, which an earlier removal does not change.
        for connection in resolution.connections:
            if sub in (connection.main, connection.sub):
                disconnected(document, connection)
        _remove_from_nets(document, name)
        _remove_from_groups(document, name)
        rows, row = subdevice_row(document, resolution, name)
        remove_row(rows, row)

    return change


def _remove_from_nets(document: Any, name: str) -> None:
    """Remove references to a SubDevice outside connections, such as a copy of standard data."""
    nets = _maps(document.get("nets"))
    for net in nets:
        gone = [
            _without(
                net, "transfers", lambda row: name in map(_module, (row.get("in"), row.get("out")))
            ),
            _without(net, "connections", lambda row: name in (row.get("main"), row.get("sub"))),
        ]
        if any(gone) and not net.get("transfers") and not net.get("connections"):
            remove_row(document["nets"], net)


def _remove_from_groups(document: Any, name: str) -> None:
    for group in _maps(document.get("groups")):
        names = group.get("subdevices") or []
        if name in names:
            names.remove(name)
            # A group without SubDevices must not remain in the file.
            if not names:
                remove_row(document["groups"], group)
    if "groups" in document and not document["groups"]:
        del document["groups"]


def _without(parent: Any, key: str, goes: Callable[[Any], bool]) -> bool:
    """Remove items of a list, and the list if it becomes empty; return whether there were any."""
    gone = [row for row in _maps(parent.get(key)) if goes(row)]
    for row in gone:
        remove_row(parent[key], row)
    if gone and not parent[key]:
        del parent[key]
    return bool(gone)


def _maps(rows: Any) -> list[Any]:
    """Return the items that are maps; others are findings and stay unchanged."""
    return [row for row in rows or () if isinstance(row, dict)]


def _module(end: Any) -> object:
    return end.get("ec_module") if isinstance(end, dict) else None


SUBDEVICE_CHANGES: dict[str, Callable[[Mapping[str, object], Resolution], Change]] = {
    "move": _move,
    "place": _place,
    "remove": _remove,
    "rename": _rename,
}
