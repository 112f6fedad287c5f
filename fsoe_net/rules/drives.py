"""FSN470 … FSN475: process data of drives by CiA 402 (IEC 61800-7-201, ETG.6010)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import Span
from fsoe_net.model.bus import Device, Entry, SubDevice
from fsoe_net.model.drives import (
    CIA402_PLUGIN,
    CONTROLWORD,
    MODE_OF_OPERATION,
    TARGET_POSITION,
    drive_axes,
)
from fsoe_net.model.layout import Placed
from fsoe_net.rules.context import Context

_STATUSWORD = 0x6041
_MODE_DISPLAY = 0x6061
_ACTUAL_POSITION = 0x6064
# Cyclic modes: name, and the target sent in each cycle.
_CYCLIC = {
    8: ("cyclic synchronous position", TARGET_POSITION),
    9: ("cyclic synchronous velocity", 0x60FF),
    10: ("cyclic synchronous torque", 0x6071),
}


@dataclass(frozen=True, slots=True)
class _Axis:
    """An axis of a device, with its entries by the objects of axis 0."""

    device: Device
    base: int
    outputs: Mapping[int, Entry]
    inputs: Mapping[int, Entry]

    def object(self, index: int) -> str:
        return f"0x{index + self.base:04x}"

    def mode(self) -> tuple[int, Span] | None:
        """Return the mode of operation stated in the file, and its place."""
        entry = self.outputs.get(MODE_OF_OPERATION)
        # Only a mode that does not change at run time is reliable.
        if entry is not None and entry.command_interface is None and _is_fixed(entry):
            return int(entry.default or 0), entry.at("default")
        # Without a fixed output, a start-up SDO may set the mode.
        for sdo in self.device.sdos:
            if sdo.index == MODE_OF_OPERATION + self.base:
                return sdo.value, sdo.at("value")
        return None


def check_drives(ctx: Context) -> None:
    """Check each device type that has axes once."""
    for _, device, sub in ctx.devices():
        for found in drive_axes(device.layout):
            axis = _Axis(device, found.base, _entries(found.outputs), _entries(found.inputs))
            waits = _waits_for_mode(axis, sub)
            _feedback(ctx, axis, waits=waits)
            _targets(ctx, axis, sub, waits=waits)


def _entries(placed: Mapping[int, tuple[int, Placed]]) -> dict[int, Entry]:
    return {index: place.entry for index, (_, place) in placed.items()}


def _is_fixed(entry: Entry) -> bool:
    """Whether a value in the file is sent; ``.nan`` means none."""
    return entry.default is not None and math.isfinite(entry.default)


def _waits_for_mode(axis: _Axis, sub: SubDevice) -> bool:
    """Whether the plugin of the driver sends neither a command nor the actual position."""
    target = axis.outputs.get(TARGET_POSITION)
    # The plugin runs axis 0 only.
    is_first = sub.plugin == CIA402_PLUGIN and axis.base == 0
    unread = _MODE_DISPLAY not in axis.inputs
    return is_first and unread and target is not None and not _is_fixed(target)


def _feedback(ctx: Context, axis: _Axis, *, waits: bool) -> None:
    if _STATUSWORD not in axis.inputs:
        ctx.add(
            "FSN472",
            axis.outputs[CONTROLWORD].span,
            f"the controlword {axis.object(CONTROLWORD)} is written, the statusword "
            f"{axis.object(_STATUSWORD)} is not read: the state of the axis is unknown",
            hint=f"map {axis.object(_STATUSWORD)} in a TxPDO",
        )
    if MODE_OF_OPERATION in axis.outputs and _MODE_DISPLAY not in axis.inputs and not waits:
        ctx.add(
            "FSN474",
            axis.outputs[MODE_OF_OPERATION].span,
            f"the mode of operation {axis.object(MODE_OF_OPERATION)} is written, "
            f"{axis.object(_MODE_DISPLAY)} is not read: whether the drive has accepted it "
            "is unknown",
            hint=f"map {axis.object(_MODE_DISPLAY)} in a TxPDO; enable the drive when it shows the "
            "mode",
        )


def _targets(ctx: Context, axis: _Axis, sub: SubDevice, *, waits: bool) -> None:
    stated = axis.mode()
    if stated is not None and stated[0] in _CYCLIC:
        mode, span = stated
        name, index = _CYCLIC[mode]
        if index not in axis.outputs:
            ctx.add(
                "FSN470",
                span,
                f"mode {mode} ({name}) takes its target {axis.object(index)} in each cycle, and "
                "no RxPDO has it",
                hint=f"map {axis.object(index)} in an RxPDO, or state the mode that is used",
            )
    target = axis.outputs.get(TARGET_POSITION)
    # Other modes do not follow a target position.
    if target is not None and (stated is None or stated[0] == 8):
        _position(ctx, axis, target, sub)
        if waits:
            ctx.add(
                "FSN475",
                target.span,
                f"EcCiA402Drive writes the target position {axis.object(TARGET_POSITION)} once it "
                f"has read the mode of operation {axis.object(_MODE_DISPLAY)}, which no TxPDO has: "
                "the target stays 0, and the axis runs to 0 as soon as the drive is enabled",
                hint=f"map {axis.object(_MODE_DISPLAY)} in a TxPDO",
            )


def _position(ctx: Context, axis: _Axis, target: Entry, sub: SubDevice) -> None:
    if _ACTUAL_POSITION not in axis.inputs:
        ctx.add(
            "FSN471",
            target.span,
            f"the target position {axis.object(TARGET_POSITION)} is written, the actual position "
            f"{axis.object(_ACTUAL_POSITION)} is not read: the first target cannot be where the "
            "axis stands, and it jumps",
            hint=f"map {axis.object(_ACTUAL_POSITION)} in a TxPDO; the first target is what it "
            "shows",
        )
    sends_actual = sub.plugin == CIA402_PLUGIN and _MODE_DISPLAY in axis.inputs
    if _is_fixed(target) and not sends_actual:
        ctx.add(
            "FSN473",
            target.at("default"),
            f"the target position {axis.object(TARGET_POSITION)} has a fixed value: the axis goes "
            "there as soon as the drive is enabled, wherever it stands",
            hint="leave the default out, and let the program that moves the axis write the actual "
            "position before it enables the drive",
        )
