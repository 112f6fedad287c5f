"""What a SubDevice is to a person at the machine, from its process data and its FSoE role."""

from __future__ import annotations

from enum import Enum

from fsoe_net.model.bus import SubDevice
from fsoe_net.model.drives import drive_axes


class SubDeviceKind(Enum):
    """Kind of a SubDevice; each has a symbol in the drawings."""

    COUPLER = "coupler"  # no process data of its own
    TERMINAL = "terminal"
    DRIVE = "drive"  # has a CiA 402 controlword
    LOGIC = "logic"  # has FSoE MainInstances


def kind_of(sub: SubDevice, *, is_main: bool) -> SubDeviceKind:
    """Return the kind of a SubDevice.

    Args:
        sub: The SubDevice; without a known layout it is a terminal.
        is_main: Whether it has, or by the device library can only have, FSoE MainInstances.
    """
    if is_main:
        return SubDeviceKind.LOGIC
    if sub.layout is None:
        return SubDeviceKind.TERMINAL
    if drive_axes(sub.layout):
        return SubDeviceKind.DRIVE
    has_data = any(sm.placed for sm in sub.layout.managers)
    return SubDeviceKind.TERMINAL if has_data else SubDeviceKind.COUPLER
