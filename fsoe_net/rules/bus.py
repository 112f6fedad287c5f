"""FSN134, FSN164, FSN230, FSN414, FSN415, FSN417: buses, modules and their places."""

from __future__ import annotations

from fsoe_net.diag.diagnostic import Related, Severity
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.network import Bus
from fsoe_net.rules.context import Context, few

_YAML_ORIGINS = {"transfer_modules", "safety_modules"}


def check_bus(ctx: Context) -> None:
    """Check names and addresses of all modules, and the buses."""
    _buses(ctx)
    names: dict[str, SubDevice] = {}
    places: dict[tuple[int, int, int], SubDevice] = {}
    for sub in ctx.resolution.network.subdevices:
        first = names.setdefault(sub.name, sub)
        same_name = first is not sub
        if same_name:
            _name_twice(ctx, sub, first)
        place = (sub.master_id, sub.alias, sub.position)
        there = places.setdefault(place, sub)
        # A duplicate module is one finding, not two.
        if there is not sub and not (same_name and there is first):
            _place_twice(ctx, sub, there)
        is_group = ctx.resolution.network.group_of(sub.name) is not None
        # Groups are addressed by alias by design.
        if sub.alias and not is_group and sub.device is not None and sub.device.sdos:
            ctx.add(
                "FSN417",
                sub.at("alias"),
                f"{sub.name} has alias {sub.alias} and start-up SDOs; ethercat_driver_ros2 sends "
                f"them to ring position {sub.position} instead",
                hint="address it by ring position (alias 0) while it has SDOs",
            )
        if len(sub.components) > 1:
            _several_components(ctx, sub)
    _optional_modules(ctx)


def _buses(ctx: Context) -> None:
    network = ctx.resolution.network
    names: dict[str, Bus] = {}
    used = {sub.master_id for sub in network.subdevices}
    for number, bus in enumerate(network.buses):
        first = names.setdefault(bus.name, bus)
        lead = network.buses[0]
        if first is not bus and bus.name:
            ctx.add(
                "FSN164",
                bus.at("name"),
                f"two buses have the name {bus.name!r}",
                hint="give each bus a name of its own",
                related=(Related(span=first.at("name"), message="the first is here"),),
            )
        if number not in used and "subdevices" in bus.fields:
            ctx.add(
                "FSN164",
                bus.at("subdevices"),
                f"bus {bus.name} has no SubDevice",
                hint="write its SubDevices here, or leave the bus out",
            )
        # The first bus copies frames between buses; with a longer cycle it would lose some.
        if bus.cycle_ns is not None and lead.cycle_ns and bus.cycle_ns < lead.cycle_ns:
            ctx.add(
                "FSN164",
                bus.at("cycle_us"),
                f"bus {bus.name} has a shorter cycle than {lead.name}, the first, which moves the "
                "frames between the buses",
                hint="put the bus with the shortest cycle first",
                related=(Related(span=lead.at("cycle_us"), message="the first bus"),),
            )


def _address(sub: SubDevice) -> str:
    return (
        f"alias {sub.alias}, position {sub.position}" if sub.alias else (f"position {sub.position}")
    )


def _name_twice(ctx: Context, sub: SubDevice, first: SubDevice) -> None:
    mixed = (sub.origin in _YAML_ORIGINS) != (first.origin in _YAML_ORIGINS)
    related = (Related(span=first.at("name"), message=f"first declared here ({first.origin})"),)
    if mixed:
        ctx.add(
            "FSN415",
            sub.at("name"),
            f"{sub.name} is declared in the URDF and in the YAML; it would be configured twice",
            hint=f"delete it from {sub.origin}, or from the URDF",
            related=related,
        )
        return
    ctx.name_twice = True
    ctx.add(
        "FSN134",
        sub.at("name"),
        f"the name {sub.name!r} is used twice; every transfer would use the first",
        hint="give each SubDevice a name of its own",
        related=related,
    )


def _several_components(ctx: Context, sub: SubDevice) -> None:
    ctx.add(
        "FSN134",
        sub.at("name"),
        f"{sub.name} serves {few([c.name for c in sub.components])}: one SubDevice for the newest "
        "driver; older ones configure it once for each, and all write its outputs",
        severity=Severity.INFO,
        hint="`for:` at a PDO or channel names the one that its interfaces belong to",
    )


def _place_twice(ctx: Context, sub: SubDevice, there: SubDevice) -> None:
    same = (
        sub.device is not None
        and there.device is not None
        and sub.device.identity == there.device.identity
    )
    effect = (
        "the PDO list of the second replaces the first"
        if same
        else "the master refuses the second with “Slave type mismatch”"
    )
    ctx.add(
        "FSN414",
        sub.at("position"),
        f"{sub.name} and {there.name} are both at {_address(sub)}; {effect}",
        hint="`ethercat slaves` lists the positions",
        related=(Related(span=there.at("position"), message=f"{there.name} is here"),),
    )


def _optional_modules(ctx: Context) -> None:
    seen: set[tuple[str, int]] = set()
    for row in ctx.resolution.transfers:
        for end in (row.source, row.destination):
            sub = end.subdevice
            if sub is None or sub.required or (sub.name, row.net_number) in seen:
                continue
            # Once per SubDevice and net: ten transfers have the same cause.
            seen.add((sub.name, row.net_number))
            ctx.add(
                "FSN230",
                end.endpoint.at("ec_module"),
                f"{sub.name} is marked required: false; when it is left out the driver copies "
                "through an uninitialised pointer",
                hint="remove required: false from this module",
                related=(Related(span=sub.at("required"), message="required: false"),),
            )
