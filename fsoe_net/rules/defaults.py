"""FSN450: an output that not every version of ethercat_driver_ros2 writes."""

from __future__ import annotations

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.model.bus import Direction, Entry
from fsoe_net.model.drives import CIA402_PLUGIN
from fsoe_net.model.layout import SmLayout
from fsoe_net.rules.context import Context
from fsoe_net.rules.runtime import Runtime


def check_defaults(ctx: Context, runtime: Runtime) -> None:
    """Check each device type once; it is certain for the version that does not write them."""
    severity = Severity.WARNING if runtime is Runtime.ROS2_2025 else None
    for _, device, sub in ctx.devices():
        # Without a URDF, the device can be one of the drive plugin.
        is_drive = sub.plugin in (None, CIA402_PLUGIN)
        for sm in device.layout.managers:
            if sm.sm.direction is Direction.OUTPUT:
                _outputs(ctx, sm, severity, is_drive=is_drive)


def _outputs(ctx: Context, sm: SmLayout, severity: Severity | None, *, is_drive: bool) -> None:
    for placed in sm.placed:
        entry = placed.entry
        # A default of 0 has no effect, because the memory starts with 0.
        if not entry.default or {"command_interface", "data_mapping"} & set(entry.fields):
            continue
        if entry.is_gap or sm.block_at(placed.bit_offset) is not None:
            continue
        if is_drive and _by_drive_plugin(entry):
            continue
        ctx.add(
            "FSN450",
            entry.at("default"),
            f"{entry.address} has a default and no command_interface: ethercat_driver_ros2 of 2025 "
            "then ignores the default and the output stays 0; versions of 2024 and the newest "
            "write it",
            severity=severity,
            hint="write `command_interface: ~` too: every version then writes the default",
        )


def _by_drive_plugin(entry: Entry) -> bool:
    """Whether EcCiA402Drive writes it: the controlword and the mode of operation of an axis."""
    return entry.index in range(0x6000, 0xA000) and entry.index % 0x800 in (0x40, 0x60)
