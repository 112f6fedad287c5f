"""FSN234 … FSN239: connections as written by the user, and why they have no frames."""

from __future__ import annotations

from fsoe_net.diag.diagnostic import Related
from fsoe_net.diag.words import counted
from fsoe_net.model.expand import NotExpanded, Obstacle
from fsoe_net.model.layout import FramePair
from fsoe_net.model.network import Net, Transfer
from fsoe_net.rules.context import Context, few
from fsoe_net.rules.runtime import ROS2, Runtime
from fsoe_net.rules.transfer_ends import add_main_device, add_two_masters, is_main_device


def check_connections(ctx: Context) -> None:
    """Check the `connections` of the nets, except for the values."""
    for net in ctx.resolution.network.nets:
        for fact in net.connections:
            # Reported even if everything else matches: an unconfirmed connection must never reach a
            # plan.
            if fact.unconfirmed is not None:
                why = f" ({fact.unconfirmed})" if fact.unconfirmed else ""
                ctx.add(
                    "FSN234",
                    fact.at("unconfirmed"),
                    f"the connection {fact.main}-{fact.sub} is marked unconfirmed{why}; no plan is "
                    "made of it",
                    hint="compare main, sub, slot, address and connection ID with the safety "
                    "project and the devices, then delete unconfirmed",
                )
    suspects = {
        sub.name
        for sub, device in zip(
            ctx.resolution.network.subdevices, ctx.resolution.device_numbers, strict=True
        )
        if device in ctx.exchanged | ctx.unassigned
    }
    for trouble in ctx.resolution.troubles:
        # The PDOs of such a device have another finding, and its frames depend on them.
        if not suspects & {trouble.facts.main, trouble.facts.sub}:
            _say(ctx, trouble)


def check_drivers(ctx: Context, runtime: Runtime) -> None:
    """Report that a driver ignores connections without transfers (FSN223)."""
    if runtime not in ROS2:
        return
    made: dict[int, list[str]] = {}
    for connection in ctx.resolution.connections:
        if connection.made:
            made.setdefault(connection.net_number, []).append(connection.name)
    for number, names in made.items():
        ctx.add(
            "FSN223",
            ctx.resolution.network.nets[number].span,
            f"the driver does not support connections: it would copy nothing for {few(names)}",
            hint="`fsoe-net convert` writes their transfers out for the driver",
        )


def _say(ctx: Context, trouble: NotExpanded) -> None:
    match trouble.obstacle:
        case Obstacle.MODULE:
            _module(ctx, trouble)
        case Obstacle.SAME | Obstacle.NOT_MAIN:
            _main(ctx, trouble)
        case Obstacle.MASTERS:
            _masters(ctx, trouble)
        case Obstacle.NO_FRAMES | Obstacle.NO_SLOT:
            _no_slot(ctx, trouble)
        case Obstacle.UNMATCHED | Obstacle.HIDDEN:
            _unmatched(ctx, trouble)
        case Obstacle.LENGTHS:
            _lengths(ctx, trouble)
        case Obstacle.SEVERAL:
            _several(ctx, trouble)
        case Obstacle.USED:
            _used(ctx, trouble)


def _module(ctx: Context, trouble: NotExpanded) -> None:
    span = trouble.facts.at(trouble.key)
    if trouble.key == "main" and is_main_device(trouble.name):
        add_main_device(ctx, span, trouble.name)
        return
    if any(d.code == "FSN134" for d in ctx.diagnostics):
        return  # a duplicate name is a missing name elsewhere
    hint = ctx.name_hint(ctx.nearest_names(trouble.name))
    ctx.add("FSN201", span, f"no module is named {trouble.name!r}", hint=hint)


def _main(ctx: Context, trouble: NotExpanded) -> None:
    facts = trouble.facts
    if trouble.obstacle is Obstacle.SAME:
        ctx.add(
            "FSN239",
            facts.at("sub"),
            f"main and sub are both {facts.main}; a connection joins two SubDevices",
            hint="main holds the MainInstance, sub the SubInstance",
        )
        return
    # The MainInstance of the net is on the other side: usually the ends are exchanged.
    if facts.sub == trouble.name:
        hint = "main and sub look exchanged; slot then counts the frames of the other device"
    else:
        hint = f"write main: {trouble.name}, or put it into the net of its own safety master"
    said = trouble.other
    key = "main"
    # The place where the MainInstance was stated; the reader decides which one is wrong.
    if isinstance(said, Net):
        key = "transfer_master" if "transfer_master" in said.fields else "safety_master"
    ctx.add(
        "FSN239",
        facts.at("main"),
        f"main is {facts.main}, but {trouble.name} holds the MainInstance of net "
        f"{trouble.net.name!r}",
        hint=hint,
        related=(Related(span=said.at(key), message="said here"),) if said is not None else (),
    )


def _masters(ctx: Context, trouble: NotExpanded) -> None:
    by_name = {s.name: s for s in reversed(ctx.resolution.network.subdevices)}
    main, sub = by_name[trouble.facts.main], by_name[trouble.facts.sub]
    add_two_masters(ctx, trouble.facts.span, main, sub)


def _no_slot(ctx: Context, trouble: NotExpanded) -> None:
    facts, name, pairs = trouble.facts, trouble.name, trouble.pairs
    if trouble.obstacle is Obstacle.NO_FRAMES:
        ctx.add(
            "FSN235",
            facts.at(trouble.key),
            f"{name} shows no FSoE frame (command, data, CRC, connection ID) in its process data",
            hint="name another SubDevice, map the entries of its frames one by one, or write the "
            "two transfers",
        )
        return
    stated = facts.slot if trouble.key == "slot" else facts.sub_slot
    last = pairs[-1].slot
    there = f"its {counted(len(pairs), 'frame pair')} count from 0 to {last}"
    ctx.add(
        "FSN235",
        facts.at(trouble.key),
        f"{name} has no slot {stated}; " + (there if last else "its only frame pair is slot 0"),
        hint=f"write {trouble.key}: with a number up to {last}" if last else "write 0 or nothing",
    )


def _unmatched(ctx: Context, trouble: NotExpanded) -> None:
    name, hint = trouble.name, "write the two transfers out"
    if trouble.obstacle is Obstacle.HIDDEN:
        message = f"{name} is mapped twice, and a driver would get the other place than the frame"
        hint = "map it once"
    else:
        pair = trouble.pairs[0]
        if pair.sends is None or pair.takes is None:
            way = "to" if pair.sends is None else "from"
            message = f"slot {pair.slot} of {name} has no frame {way} the MainDevice"
            hint = "compare the PDOs of both directions; one is missing or has no frame structure"
        else:
            message = (
                f"slot {pair.slot} of {name}: by their object numbers {pair.sends.command.address} "
                f"and {pair.takes.command.address} belong to two connections"
            )
            hint = f"list the PDOs of both directions in one order, or {hint}"
    ctx.add("FSN236", trouble.facts.at(trouble.key), message, hint=hint)


def _lengths(ctx: Context, trouble: NotExpanded) -> None:
    facts, theirs = trouble.facts, trouble.partners
    ours = [p for p in trouble.pairs if facts.slot in (None, p.slot)]
    message = f"no slot of {facts.main} fits {facts.sub}"
    if len(ours) == 1:
        message = (
            f"slot {ours[0].slot} of {facts.main} sends {ours[0].sent_bytes} and takes "
            f"{counted(ours[0].taken_bytes, 'byte')}"
        )
    if len(theirs) == 1:
        message += (
            f"; {facts.sub} takes {theirs[0].taken_bytes} and sends "
            f"{counted(theirs[0].sent_bytes, 'byte')}"
        )
    elif len(ours) == 1:
        message += f"; no slot of {facts.sub} fits that"
    # The sizes may match another slot, which is the most frequent correction.
    fitting = [
        str(p.slot) for p in trouble.pairs if p.matched and any(p.fits(other) for other in theirs)
    ]
    hint = "the safety project must give this connection the frame sizes of both devices"
    if fitting:
        hint = f"slots of {facts.main} with these sizes: {few(fitting)}"
    ctx.add("FSN236", facts.at(trouble.key), message, hint=hint)


def _several(ctx: Context, trouble: NotExpanded) -> None:
    key = "slot" if trouble.key == "main" else "sub_slot"
    ctx.add(
        "FSN237",
        trouble.facts.at(trouble.key),
        f"several frame pairs of {trouble.name} could be meant: slots "
        f"{few([_named(p) for p in trouble.pairs])}",
        hint=f"add {key}: with the number it has in the safety project",
    )


def _named(pair: FramePair) -> str:
    return f"{pair.slot} ({', '.join(b.command.address for b in pair.blocks)})"


def _used(ctx: Context, trouble: NotExpanded) -> None:
    other = trouble.other
    what = "a transfer" if isinstance(other, Transfer) else "another connection"
    ctx.add(
        "FSN238",
        trouble.facts.at(trouble.key),
        f"slot {trouble.pairs[0].slot} of {trouble.name} is used by {what} already",
        hint="give each connection frames of its own, or delete one of the two",
        related=(Related(span=other.span, message="used here"),) if other is not None else (),
    )
