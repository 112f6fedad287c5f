"""FSN204, FSN215, FSN218 … FSN232: whether the transfers of a net form complete connections."""

from __future__ import annotations

from collections import defaultdict

from fsoe_net.diag.diagnostic import Related
from fsoe_net.diag.guesses import Guesses, guesses, one_of
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import Direction, SubDevice
from fsoe_net.model.network import ConnectionFacts, Net, TransferKind
from fsoe_net.model.resolve import Connection, main_instance_of, partner_block, shared_modules
from fsoe_net.model.transfer_ends import ResolvedTransfer
from fsoe_net.rules.context import (
    Context,
    block_text,
    few,
    module_pair,
    touched_bytes,
)
from fsoe_net.rules.transfer_ends import add_main_device, is_main_device


def check_nets(ctx: Context) -> None:
    """Check complete nets, after the single transfers, so that one mistake is reported once."""
    _destinations(ctx)
    _names(ctx)
    rows: dict[int, list[ResolvedTransfer]] = defaultdict(list)
    for row in ctx.resolution.transfers:
        if row.transfer.kind is TransferKind.FSOE:
            rows[row.net_number].append(row)
    for number, net in enumerate(ctx.resolution.network.nets):
        if net.incomplete:
            ctx.unsure_nets.add(number)
        _main_instance(ctx, number, net, rows[number])
    lonely = [
        # Without a known MainInstance, the transfers of a net cannot be paired.
        row
        for row in ctx.resolution.single
        if row.net_number not in ctx.unsure_nets and not ctx.is_blamed(row)
    ]
    for row in lonely:
        _missing_direction(ctx, row)
        ctx.blame(row)
    for connection in ctx.resolution.connections:
        _crossed(ctx, connection)
    _facts(ctx)
    _unserved(ctx)


def _destinations(ctx: Context) -> None:
    """FSN204, by a sweep over all destinations of a sync manager."""
    by_sm: dict[tuple[str, int], list[tuple[int, int, ResolvedTransfer]]] = defaultdict(list)
    for row in ctx.resolution.transfers:
        end = row.destination
        if not row.found or end.sm is None or end.subdevice is None:
            continue
        # A transfer with its own error would overlap as a consequence.
        if ctx.is_blamed(row):
            continue  # its length or place is already wrong
        first, end_byte = touched_bytes(end, row.transfer.size_bytes)
        by_sm[end.subdevice.name, end.sm.sm.index].append((first, end_byte, row))
    for group in by_sm.values():
        # Sorted by place: overlaps are found between neighbours in one pass.
        group.sort(key=lambda item: (item[0], item[1], item[2].transfer.span))
        reach, owner = -1, group[0][2]
        for first, end_byte, row in group:
            if first < reach:
                _overlap(ctx, owner, row, min(reach, end_byte) - first)
            # The one that extends furthest can also overlap the next ones.
            if end_byte > reach:
                reach, owner = end_byte, row


def _overlap(ctx: Context, one: ResolvedTransfer, two: ResolvedTransfer, count: int) -> None:
    # In the order of the file: the finding is at the later one.
    early, late = sorted((one, two), key=lambda r: r.transfer.span)
    ctx.blame(early)
    ctx.blame(late)
    same_source = early.transfer.source == late.transfer.source
    hint = "delete one of the two" if same_source else _other_slot(ctx, late)
    ctx.add(
        "FSN204",
        late.transfer.destination.at("index"),
        f"{late.transfer.destination}: another transfer writes {counted(count, 'byte')} of it; "
        "the last one would win",
        hint=hint,
        related=(Related(span=early.transfer.span, message="the other transfer"),),
    )


def _other_slot(ctx: Context, row: ResolvedTransfer) -> str:
    """Return an unused slot of the receiver with the required size."""
    end, source = row.destination, row.source.block
    size = None if source is None else source.frame_bytes
    for block in ctx.free_frames(end, Direction.OUTPUT, size):
        return f"{block_text(end.endpoint.module, block)} is free and has the right size"
    return "let each transfer write a place of its own"


def _names(ctx: Context) -> None:
    seen: dict[str, Net] = {}
    for net in ctx.resolution.network.nets:
        first = seen.setdefault(net.name, net)
        if first is not net:
            ctx.add(
                "FSN224",
                net.at("name"),
                f"net name {net.name!r} is used twice",
                hint="give each net a name of its own; logs and reports show it",
                related=(Related(span=first.at("name"), message="first used here"),),
            )


def _main_instance(ctx: Context, number: int, net: Net, rows: list[ResolvedTransfer]) -> None:
    # A misspelt master is one finding, not one more for each transfer of its net.
    if net.safety_master is not None and net.safety_master not in ctx.names:
        _unknown_master(ctx, number, net, rows)
        return
    ends = [(r.transfer.source.module, r.transfer.destination.module) for r in rows]
    main = main_instance_of(net, ends)
    if main is None and rows:
        ctx.add(
            "FSN218",
            net.span,
            f"net {net.name!r} does not say which SubDevice holds the FSoE MainInstance, and its "
            "transfers share none",
            hint=f"add safety_master: with one of {few(_known(ctx, _modules(rows)), 20)}",
        )
        return
    _foreign_rows(ctx, number, net, rows, main)


def _foreign_rows(
    ctx: Context, number: int, net: Net, rows: list[ResolvedTransfer], main: str | None
) -> None:
    """FSN219: transfers that do not include the MainInstance of their net."""
    span = net.at("transfer_master" if "transfer_master" in net.fields else "safety_master")
    foreign = [r for r in rows if main not in module_pair(r)]
    # The net of a transfer with an unknown end is unclear.
    foreign = [r for r in foreign if module_pair(r) <= ctx.names]
    if not foreign:
        return
    ends = [(r.transfer.source.module, r.transfer.destination.module) for r in rows]
    shared = shared_modules(ends) & ctx.names
    # All transfers share another SubDevice: the stated master is the mistake.
    if len(shared) == 1 and net.safety_master is not None:
        # All transfers share one SubDevice, but not the stated one.
        ctx.unsure_nets.add(number)
        other = shared.pop()
        ctx.add(
            "FSN219",
            span,
            f"{net.safety_master} is stated as safety master, but all transfers of net "
            f"{net.name!r} meet in {other}",
            hint=f"write {other}",
        )
        return
    for row in foreign:
        if module_pair(row) in ctx.blamed_pairs:
            continue
        ctx.add(
            "FSN219",
            row.transfer.span,
            f"{row.transfer.source} -> {row.transfer.destination}: neither end is {main}, which "
            f"holds the MainInstance of net {net.name!r}",
            hint="put it into the net of its own safety master, or mark it kind: standard",
            related=(Related(span=span, message="safety master of the net"),),
        )


def _modules(rows: list[ResolvedTransfer]) -> list[str]:
    """Return the names in these transfers."""
    return sorted({name for row in rows for name in module_pair(row)})


def _known(ctx: Context, names: list[str]) -> list[str]:
    """Return the names that exist; if none does, all existing names."""
    return [n for n in names if n in ctx.names] or sorted(ctx.names)


def _unknown_master(ctx: Context, number: int, net: Net, rows: list[ResolvedTransfer]) -> None:
    stated = net.safety_master or ""
    used = _modules(rows)
    ctx.unsure_nets.add(number)
    span = net.at("transfer_master" if "transfer_master" in net.fields else "safety_master")
    # FSoE ends need certified hardware; the PC that runs the bus is not an FSoE end.
    if is_main_device(stated):
        add_main_device(ctx, span, stated)
        return
    # In a partial network the file with this module is missing.
    if ctx.resolution.network.partial and (stated in used or not ctx.names):
        return
    ends = [(r.transfer.source.module, r.transfer.destination.module) for r in rows]
    shared = shared_modules(ends) & ctx.names
    everywhere = stated in used  # misspelt in the transfers as well: they do not help
    meant = guesses(stated, shared) if shared and not everywhere else ctx.nearest_names(stated)
    if not meant and len(shared) == 1 and not everywhere:
        meant = tuple(shared)
    ctx.add(
        "FSN218",
        span,
        f"safety_master {stated!r} is not a module of this network",
        hint=ctx.name_hint(meant),
    )


def _missing_direction(ctx: Context, row: ResolvedTransfer) -> None:
    source, destination = row.transfer.source, row.transfer.destination
    ctx.add(
        "FSN215",
        row.transfer.span,
        f"{source.module} -> {destination.module} is copied, but not {destination.module} -> "
        f"{source.module}; FSoE needs both directions",
        hint=_mend_missing(row),
    )


def _mend_missing(row: ResolvedTransfer) -> str:
    """Return the missing transfer as text, if both devices have the partner frames."""
    back_in, back_out = row.destination.partner, row.source.partner
    if back_in is None or back_out is None:
        return "add the opposite transfer, or mark ordinary data with kind: standard"
    if back_in.frame_bytes != back_out.frame_bytes:
        return "add the opposite transfer"
    there, here = row.transfer.destination.module, row.transfer.source.module
    return (
        f"add: {{size: {back_in.frame_bytes}, "
        f"in: {{ec_module: {there}, index: 0x{back_in.command.index:04x}, "
        f"subindex: 0x{back_in.command.subindex:02x}}}, "
        f"out: {{ec_module: {here}, index: 0x{back_out.command.index:04x}, "
        f"subindex: 0x{back_out.command.subindex:02x}}}}}"
    )


def _crossed(ctx: Context, connection: Connection) -> None:
    down, up = connection.to_sub, connection.to_main
    # A reported pair is not reported again.
    if module_pair(down) in ctx.blamed_pairs:
        return
    for out_row, in_row in ((up, down), (down, up)):
        sends, key = in_row.source.block, partner_block(out_row.destination)
        # Without a known partner, the slot cannot be judged.
        if sends is None or key is None or key == sends.key:
            continue
        wanted = out_row.destination.partner
        if wanted is None:
            continue
        module = in_row.transfer.source.module
        ctx.add(
            "FSN225",
            in_row.transfer.source.at("index"),
            f"{connection.name}: {module} receives this connection at "
            f"{out_row.transfer.destination} but sends it from {in_row.transfer.source}, which is "
            "another slot",
            hint=f"write {block_text(module, wanted)} here, or change the opposite transfer",
            related=(Related(span=out_row.transfer.span, message="the opposite transfer"),),
        )


def _facts(ctx: Context) -> None:
    if not ctx.resolution.unmatched_facts:
        return
    pairs = {(c.main.name, c.sub.name) for c in ctx.resolution.connections}
    ours = Guesses(f"{main}-{sub}" for main, sub in sorted(pairs))
    singles = {module_pair(row) for row in ctx.resolution.single}
    for row in ctx.resolution.unmatched_facts:
        net, fact = row.net, row.facts
        named = frozenset((fact.main, fact.sub))
        if row.twin is not None:
            ctx.add(
                "FSN227",
                fact.at("sub"),
                f"the connection {fact.main}-{fact.sub} is stated twice",
                hint="correct main or sub; slot distinguishes several connections of the same two",
                related=(Related(span=row.twin.span, message="first stated here"),),
            )
            continue
        # Facts of a pair with a reported transfer are not errors themselves.
        if row.net_number in ctx.unsure_nets or named in ctx.blamed_pairs or named in singles:
            continue
        keys = [("slot", fact.slot), ("sub_slot", fact.sub_slot)]
        stated = ", ".join(f"{key} {value}" for key, value in keys if value is not None)
        slot = f" ({stated})" if stated else ""
        ctx.add(
            "FSN227",
            fact.at("main"),
            f"net {net.name!r} has no pair of transfers between {fact.main} and {fact.sub}{slot}",
            hint=_meant(fact, pairs, ours),
        )


def _meant(fact: ConnectionFacts, pairs: set[tuple[str, str]], ours: Guesses) -> str:
    """Return the hint about facts of a missing connection."""
    if is_main_device(fact.main):
        return "name the safety terminal on the bus that holds the MainInstance"
    if (fact.sub, fact.main) in pairs:
        return "main and sub look exchanged"
    close = ours.of(f"{fact.main}-{fact.sub}")
    if close:
        return f"did you mean {one_of(close)}?"
    known = few([f"{main}-{sub}" for main, sub in sorted(pairs)], 20)
    return f"connections: {known or 'none'}"


def _unserved(ctx: Context) -> None:
    """FSN232: frames in the PDOs that are not copied."""
    network = ctx.resolution.network
    # In a partial network the missing part may have these transfers.
    if not network.nets or network.partial or ctx.unsure_nets:
        return
    used = ctx.used_blocks()
    blamed = set().union(*ctx.blamed_pairs)
    served = {name for name, _ in used}
    without: list[SubDevice] = []
    for sub in network.subdevices:
        frames = sub.layout.blocks if sub.layout is not None else ()
        if not frames or sub.name in blamed:
            continue
        # A SubDevice without any connection has another finding than a single idle slot.
        if sub.name not in served:
            without.append(sub)
            continue
        idle = [b.command.address for b in frames if (sub.name, b.key) not in used]
        if idle:
            ctx.add(
                "FSN232",
                sub.span,
                f"{sub.name}: no transfer serves the FSoE frames at {few(idle)}",
                hint="fine for unused slots; else add the transfers",
            )
    if without:
        ctx.add(
            "FSN232",
            without[0].span,
            f"no transfer serves any FSoE frame of {few([s.name for s in without])}",
            hint="fine when they are not part of a safety function; else add the transfers",
        )
