"""FSN476, FSN481, FSN482, FSN491: interfaces of a robot description against channels of the bus."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fsoe_net.diag.diagnostic import Related, Severity, Span
from fsoe_net.diag.guesses import near_misses, one_of
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.drives import (
    CIA402_PLUGIN,
    GENERIC_PLUGINS,
    PLUGIN_OUTPUTS,
    ROS_PACKAGE_DRIVER,
    switches_states,
)
from fsoe_net.model.robot_graph import (
    RobotChannel,
    ServedComponent,
    channels_of,
    served_components,
)
from fsoe_net.rules.context import Context, few

_OF_DRIVES = "reset_fault"  # a command that EcCiA402Drive provides itself
_EFFECT = {"command": "commands to it have no effect", "state": "its value is never updated"}
_SIDES = {
    False: ("state", "only the value of one of them is shown"),
    True: ("command", "each of them gets every command"),
}


def check_interfaces(ctx: Context) -> None:
    """Check the graph of a robot where it consists of generic plugins; others have own names."""
    subdevices = ctx.resolution.network.subdevices
    meant: set[tuple[str, str]] = set()
    for node in served_components(subdevices):
        _driven_twice(ctx, node)
        # Only if all SubDevices of a component use generic plugins: others add their own names.
        if all(_is_generic(sub) for sub in node.subdevices):
            for is_command in (False, True):
                meant.update(_missing(ctx, node, is_command=is_command))
                _bound_twice(ctx, node, is_command=is_command)
    for sub in subdevices:
        if sub.components and _is_generic(sub):
            _unbound(ctx, sub, meant)


def _is_generic(sub: SubDevice) -> bool:
    return sub.plugin in GENERIC_PLUGINS and sub.device is not None


def _missing(ctx: Context, node: ServedComponent, *, is_command: bool) -> Iterator[tuple[str, str]]:
    """FSN476; yield SubDevice and name of the channels that are probably meant."""
    channels: dict[str, RobotChannel] = {}
    for channel in node.channels(is_command=is_command):
        channels.setdefault(channel.name, channel)
    provided = set(channels)
    if is_command and any(s.plugin == CIA402_PLUGIN for s in node.subdevices):
        provided.add(_OF_DRIVES)
    requests = dict(node.requests(is_command=is_command))
    # Provided but not used: one of these is probably meant.
    free = {name: channel for name, channel in channels.items() if name not in requests}
    for name, place in requests.items():
        if name not in provided:
            close = near_misses(name, free)
            side = "command" if is_command else "state"
            _not_provided(
                ctx,
                node,
                (side, name, place),
                [free[n] for n in close or [*free][:3]],
                is_close=bool(close),
            )
            yield from ((free[n].subdevice.name, n) for n in close)


def _not_provided(
    ctx: Context,
    node: ServedComponent,
    interface: tuple[str, str, Span],
    offers: Sequence[RobotChannel],
    *,
    is_close: bool,
) -> None:
    side, name, place = interface
    group = "rpdo" if side == "command" else "tpdo"
    ctx.add(
        "FSN476",
        place,
        f"no channel of {few([s.name for s in node.subdevices])} provides the {side}_interface "
        f"{name!r} of {node}: {_EFFECT[side]}",
        hint=f"write {one_of([c.name for c in offers])}"
        if is_close
        else f"write {side}_interface: {name} at a channel of the {group}, or delete it here",
        related=tuple(Related(span=c.span, message=f"provides {c.name}") for c in offers),
    )


def _bound_twice(ctx: Context, node: ServedComponent, *, is_command: bool) -> None:
    """FSN482: several channels of one interface."""
    channels: dict[str, dict[str, RobotChannel]] = {}
    for channel in node.channels(is_command=is_command):
        # An entry that is mapped twice is FSN408.
        channels.setdefault(channel.name, {}).setdefault(str(channel), channel)
    for name, _ in node.requests(is_command=is_command):
        bound = list(channels.get(name, {}).values())
        if len(bound) < 2:
            continue
        # Two drives can move one joint.
        together = node.component.kind == "joint" and len({c.subdevice.name for c in bound}) == len(
            bound
        )
        side, effect = _SIDES[is_command]
        ctx.add(
            "FSN482",
            bound[1].span,
            f"{side}_interface {name!r} of {node} is bound to {few([str(c) for c in bound])}: "
            f"{effect}",
            severity=Severity.INFO if together else None,
            hint="give each channel an interface of its own"
            + ("; fine for drives that move the joint together" if together else ""),
            related=(Related(span=bound[0].span, message="the first channel"),),
        )


def _driven_twice(ctx: Context, node: ServedComponent) -> None:
    """FSN491: several drives of a joint, which `ROS_PACKAGE_DRIVER` does not enable."""
    drives = [s for s in node.subdevices if s.hardware == ROS_PACKAGE_DRIVER and _is_driven(s)]
    if node.component.kind != "joint" or len(drives) < 2:
        return
    ctx.add(
        "FSN491",
        drives[1].span,
        f"{node} has the drives {few([s.name for s in drives])}: {ROS_PACKAGE_DRIVER} drives one "
        "for each joint, and enables none of these",
        hint="give each drive a joint of its own",
        related=(Related(span=drives[0].span, message="the first drive"),),
    )


def _is_driven(sub: SubDevice) -> bool:
    return sub.device is not None and switches_states(sub.plugin, sub.device.driver)


def _unbound(ctx: Context, sub: SubDevice, meant: set[tuple[str, str]]) -> None:
    """FSN481: commands of channels that no component requests, and that have no default."""
    free = [
        channel
        for channel in channels_of(sub, is_command=True)
        if not any(channel.serves(c) and channel.name in c.commands for c in sub.components)
        and (sub.name, channel.name) not in meant  # FSN476 has named it
        and not _has_value(channel)
    ]
    if free and not ctx.is_copied_to(sub):
        ctx.add(
            "FSN481",
            free[0].span,
            f"{few([str(c) for c in sub.components])} has no command_interface for "
            f"{few([f'{c.name} ({c})' for c in free])}: nothing writes it, and it stays 0",
            hint="add the command_interface to the robot description, or state a default here",
        )


def _has_value(channel: RobotChannel) -> bool:
    """Whether the driver writes the output without a command."""
    by_plugin = channel.subdevice.plugin == CIA402_PLUGIN
    return channel.part.default is not None or (by_plugin and channel.entry.index in PLUGIN_OUTPUTS)
