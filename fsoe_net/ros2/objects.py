"""Objects of SubDevices for other nodes: the services of ``ethercat_msgs``. Only if allowed.

``fsn-master`` decides which objects are safety related and are never written. Because a SubDevice
can move without a cyclic output, objects that command a drive are not written from here either.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from fsoe_net.diag.printable import printable
from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.client import Client

# IEC 61800-7-201: controlword, targets, mode, profile position, offsets, outputs, target velocity.
_COMMANDS = frozenset(
    {0x6040, 0x6042, 0x6060, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60FE, 0x60FF}
)
_AXES, _AXIS_STEP = range(0x6000, 0xA000), 0x800
_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_TYPES: Mapping[str, str] = MappingProxyType(
    {word: word for word in ("bool", *_INTEGERS, "string")}
    | {"float": "real32", "double": "real64", "octet_string": "hex", "raw": "hex"}
)
"""Types of ``ethercat_msgs`` and their names on the control socket."""
_LONGEST = 4096  # characters of a value


class ObjectServices:
    """Reads and writes objects for requests of nodes.

    Args:
        path: Control socket.
    """

    def __init__(self, path: str) -> None:
        self._path = path

    def get_sdo(self, request: Any, _who: str) -> tuple[bool, str, str, float]:
        """Read an object: whether it was read, why not, its value as text and as a number."""
        try:
            kind = _kind(request.sdo_data_type)
            with Client(self._path) as client:
                name = _subdevice(client, request)
                found = client.sdo_read(name, request.sdo_index, request.sdo_subindex, kind)
        except EnvironmentFault as fault:
            return False, str(fault), "", math.nan
        number = float(found.value) if isinstance(found.value, int | float) else math.nan
        return True, f"read from {name}", printable(str(found.value)), number

    def set_sdo(self, request: Any, _who: str) -> tuple[bool, str]:
        """Write an object: whether it was written, and why not."""
        index = request.sdo_index & 0xFFFF  # ethercat_msgs has it as a signed number
        try:
            if index in _AXES and 0x6000 + index % _AXIS_STEP in _COMMANDS:
                raise EnvironmentFault(
                    f"0x{index:04x} commands a drive: not written from here; a real-time client "
                    "of fsn-master moves axes"
                )
            if len(request.sdo_value) > _LONGEST:
                raise EnvironmentFault(f"a value has at most {_LONGEST} characters")
            kind = _kind(request.sdo_data_type)
            with Client(self._path) as client:
                name = _subdevice(client, request)
                client.sdo_write(
                    name, index, request.sdo_subindex, kind=kind, value=request.sdo_value
                )
        # A ValueError: no request can contain this text.
        except (EnvironmentFault, ValueError) as fault:
            return False, str(fault)
        return True, f"written to {name}"


def _kind(word: str) -> str:
    if word not in _TYPES:
        raise EnvironmentFault(f"no data type {printable(word[:40])}; known: {', '.join(_TYPES)}")
    return _TYPES[word]


def _subdevice(client: Client, request: Any) -> str:
    """Return the name of a SubDevice of the plan by its place."""
    bus, position = request.master_id, request.slave_position
    for row in client.subdevices():
        if (row.bus, row.alias, row.position) == (bus, 0, position):
            return row.name
    raise EnvironmentFault(f"the plan has no SubDevice at position {position} of bus {bus}")
