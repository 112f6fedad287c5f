"""FSN476: interfaces of a robot description that no channel of its SubDevices provides."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fsoe_net.diag.diagnostic import Related, Span
from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.model.bus import Device, RobotComponent, SubDevice
from fsoe_net.model.drives import CIA402_PLUGIN
from fsoe_net.rules.context import Context, few

_GENERIC = ("ethercat_generic_plugins/GenericEcSlave", CIA402_PLUGIN)
_OF_DRIVES = "reset_fault"  # a command that EcCiA402Drive provides itself
_EFFECT = {"command": "commands to it have no effect", "state": "its value is never updated"}


def check_interfaces(ctx: Context) -> None:
    """Check each component that uses only generic plugins; other plugins have their own names."""
    owners: dict[tuple[str, RobotComponent], list[SubDevice]] = {}
    for sub in ctx.resolution.network.subdevices:
        for component in sub.components:
            owners.setdefault((sub.system, component), []).append(sub)
    for (_, component), subs in owners.items():
        devices = [s.device for s in subs if s.plugin in _GENERIC and s.device is not None]
        # Only if all SubDevices of a component use generic plugins: others add their own names.
        if len(devices) == len(subs):
            _component(ctx, component, subs, devices)


def _component(
    ctx: Context, component: RobotComponent, subs: Sequence[SubDevice], devices: Sequence[Device]
) -> None:
    count = len(component.states)
    for side, names, places in (
        ("state", component.states, component.places[:count]),
        ("command", component.commands, component.places[count:]),
    ):
        provided: dict[str, Span] = {}
        for device in devices:
            for name, span in _provided(device, side, component.name):
                provided.setdefault(name, span)
        # The drive plugin provides an interface that no channel has.
        if side == "command" and any(s.plugin == CIA402_PLUGIN for s in subs):
            provided.setdefault(_OF_DRIVES, subs[0].span)
        for name, place in zip(names, places, strict=True):
            if name not in provided:
                # Provided but not used: one of these is probably meant.
                free = {n: s for n, s in provided.items() if n not in (*names, _OF_DRIVES)}
                _missing(ctx, component, few([s.name for s in subs]), (side, name, place), free)


def _provided(device: Device, side: str, component: str) -> Iterator[tuple[str, Span]]:
    """Yield the interfaces of a side that the channels of a component have."""
    key = f"{side}_interface"
    for pdo in device.rpdos if side == "command" else device.tpdos:
        for entry in pdo.entries:
            if entry.component in ("", component):
                for part in (entry, *entry.views):
                    if name := getattr(part, key):
                        yield name, part.at(key)


def _missing(
    ctx: Context,
    component: RobotComponent,
    owner: str,
    interface: tuple[str, str, Span],
    free: Mapping[str, Span],
) -> None:
    side, name, place = interface
    close = guesses(name, free)
    group = "rpdo" if side == "command" else "tpdo"
    ctx.add(
        "FSN476",
        place,
        f"no channel of {owner} provides the {side}_interface {name!r} of {component.kind} "
        f"{component.name}: {_EFFECT[side]}",
        hint=f"write {one_of(close)}"
        if close
        else f"write {side}_interface: {name} at a channel of the {group}, or delete it here",
        related=tuple(Related(span=free[n], message=f"provides {n}") for n in close or [*free][:3]),
    )
