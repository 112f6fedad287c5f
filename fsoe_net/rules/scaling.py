"""FSN486, FSN487, FSN490: factors and offsets of commands, states and limits of joints."""

from __future__ import annotations

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Severity
from fsoe_net.model.bus import Entry, SubDevice
from fsoe_net.model.drives import (
    CIA402_PLUGIN,
    GENERIC_PLUGINS,
    TARGET_POSITION,
    drive_axes,
)
from fsoe_net.model.robot_graph import RobotChannel, ServedComponent, served_components
from fsoe_net.rules.context import Context

_PAIRS = {TARGET_POSITION: 0x6064, 0x60FF: 0x606C, 0x6071: 0x6077}  # target: actual value
_FEW_INCREMENTS = 20  # of a whole travel; three turns in rad are less
_ROUNDED, _NOTED = 1e-3, 1e-2  # relative: factors are written with some digits


@dataclass(frozen=True, slots=True)
class _Scales:
    """A command of v is shown as ``gain * v + shift``: 1 and 0 if the scales are inverse."""

    command: Entry
    state: Entry

    @property
    def gain(self) -> float:
        return self.command.factor * self.state.factor

    @property
    def shift(self) -> float:
        return self.state.factor * self.command.offset + self.state.offset

    def are_inverse(self, tolerance: float) -> bool:
        # An offset of the command is often rounded to one increment of the drive.
        rounded = abs(self.state.factor) + tolerance * abs(self.state.offset)
        return abs(self.gain - 1) <= tolerance and abs(self.shift) <= rounded


def check_scaling(ctx: Context) -> None:
    """Check each device type that has axes once."""
    for _, device, sub in ctx.devices():
        for axis in drive_axes(device.layout):
            for target, actual in _PAIRS.items():
                if target in axis.outputs and actual in axis.inputs:
                    command = axis.outputs[target][1].entry
                    state = axis.inputs[actual][1].entry
                    by_plugin = sub.plugin == CIA402_PLUGIN and command.index == TARGET_POSITION
                    if _is_known(command, state) and (by_plugin or _is_one(command, state)):
                        _compare(ctx, sub, _Scales(command, state))
    for node in served_components(ctx.resolution.network.subdevices):
        _limits(ctx, node)


def _is_known(command: Entry, state: Entry) -> bool:
    """Whether the file states both scales; the newest driver can read a factor from the device."""
    scaled = (command, state)
    return not any(e.views or "factor_from_sdo" in e.fields for e in scaled)


def _is_one(command: Entry, state: Entry) -> bool:
    """Whether a controller takes both for the same quantity."""
    return command.command_interface is not None and (
        command.command_interface == state.state_interface
    )


def _compare(ctx: Context, sub: SubDevice, scales: _Scales) -> None:
    command, state = scales.command, scales.state
    related = (Related(span=state.at("factor"), message=f"scale of the state {state.address}"),)
    shown = f"{sub.name}: a command of 1 to {command.address} is shown as "
    if scales.gain < 0:
        ctx.add(
            "FSN486",
            command.at("factor"),
            f"{shown}{scales.gain + scales.shift:g} by {state.address}: their factors have "
            "opposite signs, and a controller drives the axis away from its target",
            hint="give both factors the sign of the axis",
            related=related,
        )
    elif not scales.are_inverse(_ROUNDED):
        inverse = 1 / state.factor
        ctx.add(
            "FSN487",
            command.at("factor"),
            f"{shown}{scales.gain + scales.shift:g} by {state.address}: factor and offset are not "
            "inverse, so an axis that holds its value moves by the difference",
            severity=Severity.INFO if scales.are_inverse(_NOTED) else None,
            hint=f"write factor: {inverse:.9g}, offset: {0 - state.offset * inverse:.9g} here, or "
            "correct those of the state",
            related=related,
        )


def _limits(ctx: Context, node: ServedComponent) -> None:
    """FSN490: limits of a joint in increments of its drive."""
    limits = node.component.limits
    if limits is None:
        return
    requests = dict(node.requests(is_command=True))
    for channel in node.channels(is_command=True):
        if channel.name in requests and _is_target_position(channel):
            low, high = sorted(v * channel.entry.factor + channel.entry.offset for v in limits)
            joint = Related(span=requests[channel.name], message=str(node))
            _express(ctx, channel, (low, high), joint)


def _is_target_position(channel: RobotChannel) -> bool:
    """Whether a channel is a target position in increments."""
    entry, layout = channel.entry, channel.subdevice.layout
    is_integer = entry.type_name.removeprefix("u").startswith("int")
    if channel.subdevice.plugin not in GENERIC_PLUGINS or layout is None or not is_integer:
        return False
    targets = {TARGET_POSITION + axis.base for axis in drive_axes(layout)}
    return entry.index in targets and _is_known(entry, entry)


def _express(
    ctx: Context, channel: RobotChannel, limits: tuple[float, float], joint: Related
) -> None:
    (low, high), (lowest, highest) = limits, _range(channel.entry)
    is_unscaled = high - low < _FEW_INCREMENTS
    if not is_unscaled and lowest <= low and high <= highest:
        return
    ctx.add(
        "FSN490",
        channel.entry.at("factor"),
        f"the limits of {joint.message} are {low:g} and {high:g} increments of {channel}: "
        + (
            "the command is sent in rad or m, and the drive counts increments"
            if is_unscaled
            else f"{channel.entry.type_name} cannot hold them, the drive gets another position"
        ),
        hint="write as factor the increments of the drive for one rad or m",
        related=(joint,),
    )


def _range(entry: Entry) -> tuple[int, int]:
    """Return the numbers that an integer entry holds."""
    if entry.type_name.startswith("u"):
        return 0, 2**entry.bits - 1
    return -(2 ** (entry.bits - 1)), 2 ** (entry.bits - 1) - 1
