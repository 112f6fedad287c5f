"""FSN165 … FSN167: groups of SubDevices that may be absent, and copies from and to them."""

from __future__ import annotations

from collections import Counter

from fsoe_net.diag.diagnostic import Related
from fsoe_net.diag.guesses import one_of
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.network import Group, TransferKind
from fsoe_net.rules.context import Context


def check_groups(ctx: Context) -> None:
    """Check groups, and that no permanent SubDevice depends on one that may be absent."""
    network = ctx.resolution.network
    if not network.groups:
        return
    names: dict[str, Group] = {}
    owners: dict[str, Group] = {}
    subs: dict[str, list[tuple[int, SubDevice]]] = {}
    for number, sub in enumerate(network.subdevices):
        # A duplicate name is reported elsewhere; both SubDevices count here.
        subs.setdefault(sub.name, []).append((number, sub))
    own: dict[str, int] = {}  # the number of the group that contains a name
    heads: dict[int, tuple[int, Group, SubDevice]] = {}  # the first group found by an alias
    for number, group in enumerate(network.groups):
        for name in group.subdevices:
            own.setdefault(name, number)
        rows = [row for name in group.subdevices for row in subs.get(name, ())]
        _name(ctx, group, names)
        _members(ctx, group, owners)
        _order(ctx, group, rows)
        # The first group with an alias is found on the bus; a second one would be found by mistake.
        if rows:
            heads.setdefault(rows[0][1].alias, (number, group, rows[0][1]))
    for sub in network.subdevices:
        found = heads.get(sub.alias) if sub.alias else None
        # Positions after an alias count from it: the alias of a group must not be used outside of
        # it.
        if found is not None and found[0] < own.get(sub.name, len(network.groups)):
            _foreign_alias(ctx, sub, *found[1:])
    _connections(ctx)
    _transfers(ctx)


def _name(ctx: Context, group: Group, names: dict[str, Group]) -> None:
    first = names.setdefault(group.name, group)
    if first is not group and group.name:
        ctx.add(
            "FSN165",
            group.at("name"),
            f"two groups have the name {group.name!r}",
            hint="give each group a name of its own",
            related=(Related(span=first.at("name"), message="the first is here"),),
        )


def _members(ctx: Context, group: Group, owners: dict[str, Group]) -> None:
    count = Counter(group.subdevices)
    for name, span in zip(group.subdevices, group.places, strict=True):
        if name not in ctx.names:
            near = ctx.nearest_names(name)
            hint = f"write {one_of(near)}" if near else "add it to subdevices"
            ctx.add("FSN165", span, f"group {group.name} names {name!r}, no SubDevice", hint=hint)
            continue
        owner = owners.setdefault(name, group)
        if owner is not group or count[name] > 1:
            ctx.add(
                "FSN165",
                span,
                f"{name} is named twice in groups; it is absent with one group only",
                hint="name it in one group, once",
                related=(Related(span=owner.span, message=f"group {owner.name}"),),
            )


def _order(ctx: Context, group: Group, rows: list[tuple[int, SubDevice]]) -> None:
    """Check that the first one is found by its alias and the others follow, here and on the bus."""
    # A missing member shifts the numbers of all others.
    if not rows or len(rows) != len(group.subdevices):
        return  # already reported
    first_number, first = rows[0]
    if not first.alias:
        ctx.add(
            "FSN165",
            first.at("position"),
            f"{first.name}, the first of group {group.name}, has no alias to find it by",
            hint="give it an alias of its own and position: 0; `alias-write` of the control socket "
            "stores it in the device",
        )
        return
    # The group is one segment of the bus: its members follow the first one.
    for n, (number, sub) in enumerate(rows):
        if (number, sub.alias, sub.position) != (first_number + n, first.alias, n):
            ctx.add(
                "FSN165",
                sub.at("position" if "position" in sub.fields else "name"),
                f"{sub.name} of group {group.name} is not number {n} after alias {first.alias}; "
                "the SubDevices of a group follow each other",
                hint=f"write alias: {first.alias}, position: {n}, in the order of the group",
                related=(Related(span=first.span, message="the first of the group"),),
            )
            return
    # Clocks are measured at the start, when a group may be absent.
    for _, sub in rows:
        if sub.device is not None and sub.device.assign_activate:
            ctx.add(
                "FSN165",
                sub.span,
                f"{sub.name} of group {group.name} has distributed clocks (assign_activate "
                f"0x{sub.device.assign_activate:04x}); clocks are set at the start only",
                hint="use a device file without assign_activate, or take it out of the group",
            )


def _foreign_alias(ctx: Context, sub: SubDevice, group: Group, first: SubDevice) -> None:
    ctx.add(
        "FSN165",
        sub.at("alias"),
        f"{sub.name} has alias {sub.alias}, by which group {group.name} is found",
        hint="give each group an alias that nothing else has",
        related=(Related(span=first.at("alias"), message=f"group {group.name}"),),
    )


def _never_together(one: Group | None, other: Group | None) -> bool:
    return one is not None and other is not None and one is not other and _same(one, other)


def _same(one: Group, other: Group) -> bool:
    return bool(one.place) and one.place == other.place


def _connections(ctx: Context) -> None:
    network = ctx.resolution.network
    for c in ctx.resolution.connections:
        main, sub = network.group_of(c.main.name), network.group_of(c.sub.name)
        # A group may contain a SubInstance with its own MainInstance.
        if main is None or main is sub:
            continue
        span = c.facts.span if c.facts is not None else c.net.span
        if _never_together(main, sub) and sub is not None:
            ctx.add(
                "FSN166",
                span,
                f"{c.name} joins the groups {main.name} and {sub.name}, which are never at "
                f"{main.place} together",
                hint="connect each with a MainInstance that is always there",
                related=_both(main, sub),
            )
        else:
            ctx.add(
                "FSN166",
                span,
                f"the MainInstance of {c.name} is in group {main.name} and may be absent while "
                f"{c.sub.name} is there",
                hint="take the MainInstance out of the group, or put both into one group",
                related=(Related(span=main.span, message=f"group {main.name}"),),
            )


def _transfers(ctx: Context) -> None:
    network = ctx.resolution.network
    for row in ctx.resolution.transfers:
        source, destination = row.source.subdevice, row.destination.subdevice
        # FSoE handles an absent partner by itself, but standard values do not.
        if source is None or destination is None or row.transfer.kind is TransferKind.FSOE:
            continue
        one, other = network.group_of(source.name), network.group_of(destination.name)
        if _never_together(one, other) and one is not None and other is not None:
            ctx.add(
                "FSN166",
                row.transfer.span,
                f"nothing is ever copied from {source.name} to {destination.name}: the groups "
                f"{one.name} and {other.name} are never at {one.place} together",
                hint="delete the transfer",
                related=_both(one, other),
            )
        # An absent source leaves the last value in the output.
        elif one is not None and one is not other:
            ctx.add(
                "FSN167",
                row.transfer.span,
                f"while group {one.name} is absent, {destination.name} keeps the last value of "
                f"{source.name}",
                hint="make sure that this value does no harm, or let a program with a lease write "
                "the output",
                related=(Related(span=one.span, message=f"group {one.name}"),),
            )


def _both(one: Group, other: Group) -> tuple[Related, ...]:
    return tuple(Related(span=g.span, message=f"group {g.name}") for g in (one, other))
