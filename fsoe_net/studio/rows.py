"""Maps and lists of a network file, found by the part of the network read from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from fsoe_net.errors import InputError
from fsoe_net.model.bus import Located
from fsoe_net.model.resolve import Connection, Resolution

_LONGEST_NAME = 80

Change = Callable[[Any], None]
"""Changes the maps and lists of a file in place."""


def number_of(request: Mapping[str, object], key: str, most: int) -> int:
    """Return a number in a request.

    Raises:
        InputError: The number is missing, or not from 0 to ``most``.
    """
    value = request.get(key)
    if type(value) is not int or not 0 <= value <= most:
        raise InputError(f"{key} is a number from 0 to {most}, not {value!r}")
    return value


def new_name_of(request: Mapping[str, object]) -> str:
    """Return a name entered by a person.

    Raises:
        InputError: The name is empty, too long, or has unprintable characters.
    """
    name = request.get("name")
    if not isinstance(name, str) or not 0 < len(name) <= _LONGEST_NAME or not name.isprintable():
        raise InputError(f"a name has 1 to {_LONGEST_NAME} characters that print")
    return name


def name_of(request: Mapping[str, object], key: str, resolution: Resolution) -> str:
    """Return the SubDevice name in a request.

    Raises:
        InputError: Unknown SubDevice.
    """
    name = request.get(key)
    if not isinstance(name, str) or name not in resolution.numbers:
        raise InputError(f"{key}: no SubDevice has the name {name!r}")
    return name


def row_of(rows: Any, part: Located) -> Any:
    """Return the list item of the file from which a part of the network was read.

    Raises:
        InputError: The item is in another file, or is shared by an anchor.
    """
    for row in rows or ():
        if getattr(row, "place", None) == (part.span.line, part.span.column):
            return row
    raise InputError(f"{part.span}: this part cannot be changed here; change it in the text")


def remove_row(rows: Any, row: Any) -> None:
    """Remove exactly this item of a list, not an equal one."""
    del rows[next(n for n, each in enumerate(rows) if each is row)]


def list_in(parent: Any, key: str) -> Any:
    """Return a list of the file, created if missing."""
    if parent.get(key) is None:
        parent[key] = []
    return parent[key]


def subdevice_row(document: Any, resolution: Resolution, name: str) -> tuple[Any, Any]:
    """Return the list that contains a SubDevice, and its map.

    Raises:
        InputError: As in `row_of`.
    """
    subdevice = resolution.network.subdevices[resolution.numbers[name]]
    # In a file with several buses, the SubDevices are below each bus.
    lists = [document, *(document.get("buses") or ())]
    rows = [(part["subdevices"], row) for part in lists for row in part.get("subdevices") or ()]
    found = row_of([row for _, row in rows], subdevice)
    return next(pair for pair in rows if pair[1] is found)


def net_of(document: Any, connection: Connection) -> Any:
    """Return the map of the net of a connection."""
    return row_of(document["nets"], connection.net)


def disconnected(document: Any, connection: Connection) -> None:
    """Remove a connection with its transfers, and its net if it becomes empty."""
    net = net_of(document, connection)
    parts: list[tuple[str, Located]] = []
    if connection.facts is not None:
        parts.append(("connections", connection.facts))
    for way in (connection.to_sub, connection.to_main):
        if not way.made:
            # Created copies follow from the connection and are not in the file.
            parts.append(("transfers", way.transfer))
    for key, part in parts:
        remove_row(net[key], row_of(net[key], part))
        # An empty list must not remain in the file.
        if not net[key]:
            del net[key]
    if not net.get("transfers") and not net.get("connections"):
        remove_row(document["nets"], net)
