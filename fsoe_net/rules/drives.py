"""FSN470 … FSN475, FSN484, FSN485: drives by CiA 402 (IEC 61800-7-201, ETG.6010)."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Severity, Span
from fsoe_net.model.bus import Device, Entry, SubDevice
from fsoe_net.model.drives import (
    CIA402_PLUGIN,
    CONTROLWORD,
    GENERIC_PLUGINS,
    MODE_OF_OPERATION,
    ROS_PACKAGE_DRIVER,
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

    def is_switched(self, commands: Collection[str | None]) -> bool:
        """Whether a command changes the mode of operation."""
        entry = self.outputs.get(MODE_OF_OPERATION)
        return entry is not None and entry.command_interface in commands

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
    for number, device, sub in ctx.devices():
        axes = [
            _Axis(device, found.base, _entries(found.outputs), _entries(found.inputs))
            for found in drive_axes(device.layout)
        ]
        # A PDO without channels can have any object; FSN401 and FSN409 have reported the others.
        known = all(sm.complete for sm in device.layout.managers)
        known = known and number not in ctx.exchanged | ctx.unassigned
        if sub.plugin == CIA402_PLUGIN and known and not axes:
            _never_enabled(ctx, sub, CONTROLWORD)
        for axis in axes:
            # The plugin runs axis 0 only.
            by_plugin = sub.plugin == CIA402_PLUGIN and known and axis.base == 0
            _state(ctx, axis, sub, by_plugin=by_plugin)
            _mode(ctx, axis, sub, by_plugin=by_plugin)
            _targets(ctx, axis, sub, by_plugin=by_plugin)


def _entries(placed: Mapping[int, tuple[int, Placed]]) -> dict[int, Entry]:
    return {index: place.entry for index, (_, place) in placed.items()}


def _is_fixed(entry: Entry) -> bool:
    """Whether a value in the file is sent; ``.nan`` means none."""
    return entry.default is not None and math.isfinite(entry.default)


def _unread(axis: _Axis, sub: SubDevice) -> list[int]:
    """Return the inputs that the plugin needs to send the actual position as target."""
    if sub.hardware == ROS_PACKAGE_DRIVER:
        return []  # it does not run the plugin, and sends that position by itself
    target = axis.outputs.get(TARGET_POSITION)
    missing = [i for i in (_MODE_DISPLAY, _ACTUAL_POSITION) if i not in axis.inputs]
    # Without a mode, a fixed target is sent.
    if target is None or (_is_fixed(target) and _MODE_DISPLAY in missing):
        return []
    return missing


def _state(ctx: Context, axis: _Axis, sub: SubDevice, *, by_plugin: bool) -> None:
    if _STATUSWORD in axis.inputs:
        return
    if by_plugin:
        _never_enabled(ctx, sub, _STATUSWORD)
        return
    ctx.add(
        "FSN472",
        axis.outputs[CONTROLWORD].span,
        f"the controlword {axis.object(CONTROLWORD)} is written, the statusword "
        f"{axis.object(_STATUSWORD)} is not read: the state of the axis is unknown",
        hint=f"map {axis.object(_STATUSWORD)} in a TxPDO",
    )


def _never_enabled(ctx: Context, sub: SubDevice, missing: int) -> None:
    ctx.add(
        "FSN484",
        sub.at("plugin"),
        f"EcCiA402Drive needs the controlword 0x6040 and the statusword 0x6041; {sub.name} does "
        f"not map 0x{missing:04x}: the drive is never enabled, and the driver waits for it",
        hint=f"map 0x{missing:04x}, or use GenericEcSlave for a device that is not a drive",
    )


def _mode(ctx: Context, axis: _Axis, sub: SubDevice, *, by_plugin: bool) -> None:
    entry = axis.outputs.get(MODE_OF_OPERATION)
    if entry is None:
        stated = "mode_of_operation" in sub.fields and axis.mode() is None
        if by_plugin and stated:
            ctx.add(
                "FSN485",
                sub.at("mode_of_operation"),
                f"{sub.name} maps no mode of operation 0x6060: this mode is not sent, and the "
                "drive keeps its own",
                severity=Severity.INFO,
                hint="map 0x6060 in an RxPDO, or write it with a start-up SDO",
            )
        return
    waits = by_plugin and _MODE_DISPLAY in _unread(axis, sub)
    if _MODE_DISPLAY not in axis.inputs and not waits:
        ctx.add(
            "FSN474",
            entry.span,
            f"the mode of operation {axis.object(MODE_OF_OPERATION)} is written, "
            f"{axis.object(_MODE_DISPLAY)} is not read: whether the drive has accepted it "
            "is unknown",
            hint=f"map {axis.object(_MODE_DISPLAY)} in a TxPDO; enable the drive when it shows the "
            "mode",
        )
    if _is_idle(entry, sub) and not ctx.is_copied_to(sub):
        ctx.add(
            "FSN485",
            entry.span,
            f"nothing writes the mode of operation {entry.address}: mode 0, no mode, is sent in "
            "each cycle",
            hint="state the mode as default, such as 8 for cyclic synchronous position",
        )


def _is_idle(entry: Entry, sub: SubDevice) -> bool:
    """Whether the driver leaves an output of a robot at 0: no default, and no command for it."""
    commands = {name for c in sub.components for name in c.commands}
    is_driver = bool(sub.components) and sub.plugin in GENERIC_PLUGINS
    return is_driver and not entry.default and entry.command_interface not in commands


def _targets(ctx: Context, axis: _Axis, sub: SubDevice, *, by_plugin: bool) -> None:
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
        else:
            _commanded_targets(ctx, axis, sub, (mode, span))
    target = axis.outputs.get(TARGET_POSITION)
    # Other modes do not follow a target position.
    if target is not None and (stated is None or stated[0] == 8):
        unread = _unread(axis, sub) if by_plugin else []
        if unread:
            names = " and ".join(axis.object(i) for i in unread)
            ctx.add(
                "FSN475",
                target.span,
                f"EcCiA402Drive sends the actual position 0x6064 as target position 0x607a, once "
                f"it has read a mode from 0x6061; without {names} in a TxPDO the target stays 0, "
                "and the axis runs to 0 as soon as the drive is enabled",
                hint=f"map {names} in a TxPDO",
            )
        _position(ctx, axis, sub, target, by_plugin=by_plugin)


def _commanded_targets(ctx: Context, axis: _Axis, sub: SubDevice, stated: tuple[int, Span]) -> None:
    """FSN470 if a robot commands only targets of other modes."""
    mode, span = stated
    index = _CYCLIC[mode][1]
    commands = {name for c in sub.components for name in c.commands}
    commanded = [
        axis.outputs[target]
        for _, target in _CYCLIC.values()
        if target in axis.outputs and axis.outputs[target].command_interface in commands
    ]
    if commanded and axis.outputs[index] not in commanded and not axis.is_switched(commands):
        ctx.add(
            "FSN470",
            commanded[0].at("command_interface"),
            f"the command {commanded[0].command_interface} goes to {commanded[0].address}; mode "
            f"{mode} takes its target from {axis.object(index)}, which no command reaches",
            severity=Severity.WARNING,
            hint="state the mode of this command, or command the target of the mode",
            related=(Related(span=span, message=f"mode {mode}"),),
        )


def _position(ctx: Context, axis: _Axis, sub: SubDevice, target: Entry, *, by_plugin: bool) -> None:
    if _ACTUAL_POSITION not in axis.inputs and not (by_plugin and _unread(axis, sub)):
        ctx.add(
            "FSN471",
            target.span,
            f"the target position {axis.object(TARGET_POSITION)} is written, the actual position "
            f"{axis.object(_ACTUAL_POSITION)} is not read: the first target cannot be where the "
            "axis stands, and it jumps",
            hint=f"map {axis.object(_ACTUAL_POSITION)} in a TxPDO; the first target is what it "
            "shows",
        )
    sends_actual = by_plugin and _MODE_DISPLAY in axis.inputs
    if _is_fixed(target) and not sends_actual:
        ctx.add(
            "FSN473",
            target.at("default"),
            f"the target position {axis.object(TARGET_POSITION)} has a fixed value: the axis goes "
            "there as soon as the drive is enabled, wherever it stands",
            hint="leave the default out, and let the program that moves the axis write the actual "
            "position before it enables the drive",
        )
