"""Writes a Wireshark dissector for the FSoE frames of one network.

The code is in ``dissector.lua``; this module prepends the tables of the network.
"""

from __future__ import annotations

import re
from importlib.resources import files

from fsoe_net.capture.names import ConnectionNames, Naming
from fsoe_net.capture.wire import LogicalImage
from fsoe_net.fsoe.pdu import Command, ResetCode, command_text, reset_code_text
from fsoe_net.model.resolve import Connection, Resolution
from fsoe_net.model.signals import Signal
from fsoe_net.model.transfer_ends import ResolvedTransfer
from fsoe_net.plan.model import Plan

_WAYS = ("to_sub", "to_main")
_HEAD = """\
-- FSoE frames of one network, for Wireshark and tshark: wireshark -X lua_script:THIS_FILE
-- Written by fsoe-net from the network file; write it again when that changes.
-- Looks at frames only. Compared with independent implementations, not checked against ETG.5100.
"""


def lua_dissector(resolution: Resolution, plan: Plan) -> str:
    """Return the Lua source of a postdissector.

    It finds the frames at the logical addresses that the IgH MainDevice gives them; a preference
    shifts all of them. CRCs are judged along the chain as `fsoe_net.core.monitor.Monitor` does.

    Args:
        resolution: A network without errors.
        plan: Its plan.
    """
    image = LogicalImage(plan)
    names = Naming(resolution, image).connections
    connections = [
        _connection(number, connection, name, image)
        for number, (connection, name) in enumerate(
            zip(resolution.connections, names, strict=True), start=1
        )
    ]
    return (
        f"{_HEAD}"
        f"local NETWORK = {_quoted(resolution.network.name)}\n"
        f"local COMMANDS = {_table({int(c): command_text(int(c)) for c in Command})}\n"
        f"local CODES = {_table({int(c): reset_code_text(int(c)) for c in ResetCode})}\n"
        f"local CONNECTIONS = {{\n{''.join(connections)}}}\n\n"
        f"{(files(__package__) / 'dissector.lua').read_text('utf-8')}"
    )


def _connection(
    number: int, connection: Connection, names: ConnectionNames, image: LogicalImage
) -> str:
    main, sub = names.ends
    rows = [f"name = {_quoted(names.name)}"]
    if names.connection_id:
        rows.append(f"id = {names.connection_id}")
    arrows = f"{main} > {sub}", f"{sub} > {main}"
    rows.append(f"arrows = {{[0] = {_quoted(arrows[0])}, {_quoted(arrows[1])}}}")
    signals = (_signals(number, way, found) for way, found in enumerate(names.signals))
    rows.append("signals = {{[0] = {}, {}}}".format(*signals))
    places = [
        place
        for way, transfer in enumerate((connection.to_sub, connection.to_main))
        for place in _places(way, transfer, image)
    ]
    rows.append(f"places = {_list(places)}")
    return "  {\n" + "".join(f"    {row},\n" for row in rows) + "  },\n"


def _signals(number: int, way: int, signals: tuple[Signal, ...]) -> str:
    rows = []
    for s in signals:
        text = f"{s.label} ({s.address})" if s.label else s.address
        word = re.sub(r"[^a-z0-9]+", "_", s.name.lower()).strip("_")
        field = _quoted(f"fsoe.c{number}.{_WAYS[way]}.{word}")
        rows.append(f"{{filter = {field}, text = {_quoted(text)}, bit = {s.bit}, bits = {s.bits}}}")
    return _list(rows)


def _places(way: int, transfer: ResolvedTransfer, image: LogicalImage) -> list[str]:
    """Return the places of one direction; the chain is followed at the receiver."""
    rows: list[str] = []
    for end, is_input in ((transfer.destination, False), (transfer.source, True)):
        address = image.address(end)
        if address is None:
            continue
        text = f"{end.endpoint.module} {'inputs' if is_input else 'outputs'}"
        rows.append(
            f"{{direction = {way}, address = {address}, size = {transfer.transfer.size_bytes}, "
            f"is_input = {str(is_input).lower()}, watched = {str(not rows).lower()}, "
            f"text = {_quoted(text)}}}"
        )
    return rows


def _list(rows: list[str]) -> str:
    return "{" + "".join(f"\n      {row}," for row in rows) + ("\n    }" if rows else "}")


def _table(texts: dict[int, str]) -> str:
    return "{" + ", ".join(f"[{n}] = {_quoted(t)}" for n, t in texts.items()) + "}"


def _quoted(text: str) -> str:
    """Return a Lua string literal; non-ASCII or unprintable characters become their UTF-8 bytes."""
    parts = []
    for byte in text.encode("utf-8", "replace"):
        char = chr(byte)
        if char in '"\\':
            parts.append("\\" + char)
        elif 0x20 <= byte < 0x7F:
            parts.append(char)
        else:
            # Always three digits: a following digit would be read as part of a shorter escape.
            parts.append(f"\\{byte:03d}")
    return '"' + "".join(parts) + '"'
