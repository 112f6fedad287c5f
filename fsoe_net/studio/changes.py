"""Edits in the drawing, as changes to the network file.

Each one is a map whose keyword selects the change: ``connect``, ``disconnect``, ``confirm``,
``set`` for a connection, ``network`` for its name and cycle; those of SubDevices are in
`fsoe_net.studio.subdevices`. Names are resolved in the network of the edited text. FSoE addresses,
connection IDs and watchdogs belong to the safety project: a person enters them, they are never
selected here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from fsoe_net.errors import InputError
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.resolve import Connection, Resolution
from fsoe_net.project.check import Checked
from fsoe_net.studio.rows import (
    Change,
    disconnected,
    list_in,
    name_of,
    net_of,
    new_name_of,
    number_of,
    row_of,
)
from fsoe_net.studio.subdevices import SUBDEVICE_CHANGES

FACTS = {"address": 65535, "connection_id": 65535, "watchdog_ms": 65534}
"""Numbers of a connection that the page sets, with their maximum: ETG.5100, 16 bits each."""

# A plan holds the cycle in nanoseconds, 32 bits.
LONGEST_CYCLE_US = 4_000_000

DRAWN = "drawn in studio: compare it with the safety project"
"""Reason why a drawn connection is unconfirmed."""


def change_of(request: Mapping[str, object], checked: Checked) -> Change:
    """Return the change to the maps and lists of the file for a request.

    Args:
        request: Request of the page; untrusted.
        checked: The edited network.

    Raises:
        InputError: The change is impossible; with the reason and the next step.
    """
    if checked.resolution is None:
        raise InputError("the text is not a valid network at present: correct it first")
    make = _MAKERS.get(str(request.get("change")))
    if make is None:
        raise InputError(f"unknown change {str(request.get('change'))!r}")
    return make(request, checked.resolution)


def _connection(request: Mapping[str, object], resolution: Resolution) -> Connection:
    rows = resolution.connections
    number = number_of(request, "connection", max(len(rows) - 1, 0))
    if number >= len(rows):
        raise InputError("unknown connection")
    return rows[number]


def _facts_in(document: Any, connection: Connection) -> Any:
    """Return the map of a connection in the file, created if its net only has transfers."""
    net = net_of(document, connection)
    if connection.facts is not None:
        return row_of(net["connections"], connection.facts)
    facts: dict[str, object] = {"main": connection.main.name, "sub": connection.sub.name}
    facts |= _slot("slot", connection.main, connection.slot)
    facts |= _slot("sub_slot", connection.sub, connection.sub_slot)
    net.setdefault("connections", []).append(facts)
    return net["connections"][-1]


def _slot(key: str, sub: SubDevice, number: int | None) -> dict[str, object]:
    """Return the key that names a frame pair; it is not needed for slot 0 of a single pair."""
    pairs = sub.layout.frame_pairs if sub.layout is not None else ()
    needed = number is not None and (len(pairs) != 1 or number != 0)
    return {key: number} if needed else {}


def _set(request: Mapping[str, object], resolution: Resolution) -> Change:
    key = request.get("key")
    if not isinstance(key, str) or key not in FACTS:
        raise InputError(f"{key!r} is nothing that is set here; {', '.join(FACTS)} are")
    connection = _connection(request, resolution)
    value = None if request.get("value") is None else number_of(request, "value", FACTS[key])

    def change(document: Any) -> None:
        facts = _facts_in(document, connection)
        if value is not None:
            facts[key] = value
        else:
            facts.pop(key, None)

    return change


def _confirm(request: Mapping[str, object], resolution: Resolution) -> Change:
    connection = _connection(request, resolution)
    if connection.stated.unconfirmed is None:
        raise InputError("this connection is confirmed already")
    return lambda document: _facts_in(document, connection).pop("unconfirmed", None)


def _disconnect(request: Mapping[str, object], resolution: Resolution) -> Change:
    connection = _connection(request, resolution)

    def change(document: Any) -> None:
        disconnected(document, connection)

    return change


def _connect(request: Mapping[str, object], resolution: Resolution) -> Change:
    main, sub = (name_of(request, key, resolution) for key in ("main", "sub"))
    numbers = {key: number_of(request, key, 65535) for key in ("slot", "sub_slot")}
    if main == sub:
        raise InputError(f"{main} cannot be connected with itself")
    # The request is checked against the file as read, before anything is changed.
    known = {s.name: s for s in resolution.network.subdevices}
    slots = _slot("slot", known[main], numbers["slot"])
    slots |= _slot("sub_slot", known[sub], numbers["sub_slot"])
    # One net per MainInstance: a safety project is one net, and a second one would split it.
    own = [net for net in resolution.network.nets if net.safety_master == main]

    def change(document: Any) -> None:
        # Keys are added in the order of the documentation, because a person reads the file.
        facts: dict[str, object] = {"main": main, "sub": sub}
        facts |= slots
        # A drawn line proves nothing: a person must compare it with the safety project and confirm
        # it.
        facts["unconfirmed"] = DRAWN
        if own:
            net = row_of(document["nets"], own[0])
        else:
            nets = list_in(document, "nets")
            nets.append({"name": _free_name(main, nets), "safety_master": main})
            net = nets[-1]
        net.setdefault("connections", []).append(facts)

    return change


def _free_name(main: str, nets: Any) -> str:
    taken = {net.get("name") for net in nets}
    names = [main, *(f"{main}_{n}" for n in range(2, len(taken) + 3))]
    return next(name for name in names if name not in taken)


def _network(request: Mapping[str, object], resolution: Resolution) -> Change:
    """Set name or bus cycle of the network."""
    values: dict[str, object] = {}
    if "name" in request:
        values["name"] = new_name_of(request)
    if "cycle_us" in request:
        if resolution.network.buses:
            raise InputError("each bus has a cycle of its own: set it in the text")
        values["cycle_us"] = number_of(request, "cycle_us", LONGEST_CYCLE_US)

    def change(document: Any) -> None:
        # Existing keys keep their place and their comment; only new ones are inserted.
        new = {key: value for key, value in values.items() if key not in document}
        document.update({key: value for key, value in values.items() if key in document})
        if new:  # at the front, where a person looks for it
            following = list(document)[int(next(iter(document), None) == "version") :]
            document.update(new | {key: document.pop(key) for key in following})

    return change


_MAKERS: dict[str, Callable[[Mapping[str, object], Resolution], Change]] = {
    "confirm": _confirm,
    "connect": _connect,
    "disconnect": _disconnect,
    "network": _network,
    "set": _set,
    **SUBDEVICE_CHANGES,
}
