"""FSN201 … FSN207, FSN213: whether ends of transfers refer to bytes in the right direction."""

from __future__ import annotations

from fsoe_net.diag.diagnostic import Edit, Fix, Related, Severity, Span
from fsoe_net.diag.guesses import one_of
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import Direction, SubDevice
from fsoe_net.model.layout import Placed, SmLayout
from fsoe_net.model.network import TransferKind
from fsoe_net.model.transfer_ends import Miss, ResolvedEnd, ResolvedTransfer
from fsoe_net.rules.context import Context, block_text, describe_end

_MAIN_DEVICE_WORDS = {
    "maindevice",
    "main_device",
    "master",
    "ethercat_master",
    "ec_master",
    "host",
    "pc",
    "self",
    "controller",
    "local",
}


def is_main_device(name: str) -> bool:
    """Whether a name that is not a SubDevice refers to the MainDevice itself."""
    return name.lower().replace("-", "_").replace(" ", "_") in _MAIN_DEVICE_WORDS


def check_ends(ctx: Context) -> None:
    """Check both ends of every transfer."""
    written = _written_by_transfers(ctx)
    for row in ctx.resolution.transfers:
        before = len(ctx.diagnostics)
        for end, wanted in ((row.source, Direction.INPUT), (row.destination, Direction.OUTPUT)):
            _lookup(ctx, row, end, wanted)
        if row.found:
            _direction(ctx, row, written)
            for end in (row.source, row.destination):
                _alignment(ctx, end)
        if row.source.subdevice is not None and row.destination.subdevice is not None:
            _masters(ctx, row)
        if len(ctx.diagnostics) > before:
            # Rules that follow skip blamed pairs: one mistake gets one finding.
            ctx.blame(row)


def _written_by_transfers(ctx: Context) -> dict[tuple[str, int, int], ResolvedTransfer]:
    """Map the entry written by each transfer to the transfer, to detect chains."""
    return {
        _address(r.destination): r
        for r in ctx.resolution.transfers
        if r.destination.placed is not None
    }


def _address(end: ResolvedEnd) -> tuple[str, int, int]:
    return end.endpoint.module, end.endpoint.index, end.endpoint.subindex


def _lookup(ctx: Context, row: ResolvedTransfer, end: ResolvedEnd, wanted: Direction) -> None:
    if end.miss is None or end.miss is Miss.DEVICE:
        return
    endpoint = end.endpoint
    if end.miss is Miss.MODULE:
        ctx.unsure_nets.add(row.net_number)
        _unknown_module(ctx, end)
        return
    if end.miss is Miss.ENTRY and ctx.is_unassigned(end):
        return  # FSN409 has reported the cause
    span = endpoint.at("index")
    if end.miss is Miss.GAP:
        ctx.add(
            "FSN207",
            span,
            f"{endpoint} is padding; it is never registered, so the copy would use an "
            "uninitialised pointer",
            hint=_better_start(ctx, end, wanted, row),
        )
    elif end.miss is Miss.SKIPPED:
        where = end.placed.entry.at("skip") if end.placed else span
        ctx.add(
            "FSN206",
            span,
            f"{endpoint} is marked skip: true, so the driver does not register it and would copy "
            "through an uninitialised pointer",
            hint="remove skip: true from this channel",
            related=(Related(span=where, message="skip: true"),),
        )
    elif end.miss is Miss.LAYOUT:
        ctx.add(
            "FSN406",
            span,
            f"the position of {endpoint} is not known offline: it follows a PDO without channels",
            hint="list the channels of every PDO of this sync manager",
        )
    else:
        _unknown_entry(ctx, row, end, wanted)


def _unknown_module(ctx: Context, end: ResolvedEnd) -> None:
    name = end.endpoint.module
    span = end.endpoint.at("ec_module")
    if is_main_device(name):
        _centralized(ctx, end, name)
    elif not ctx.resolution.network.partial:
        if ctx.name_twice:
            return  # the name is missing elsewhere
        hint = ctx.name_hint(ctx.nearest_names(name))
        ctx.add("FSN201", span, f"no module is named {name!r}", hint=hint)


def _centralized(ctx: Context, end: ResolvedEnd, name: str) -> None:
    ctx.add(
        "FSN226",
        end.endpoint.at("ec_module"),
        f"{name!r} means the MainDevice itself: an FSoE MainInstance on the MainDevice "
        "(centralized topology) needs certified software on certified hardware",
        hint="use a safety terminal on the bus (for example EL6910, EL1918) as MainInstance; the "
        "MainDevice then only copies frames",
    )


def _unknown_entry(
    ctx: Context, row: ResolvedTransfer, end: ResolvedEnd, wanted: Direction
) -> None:
    endpoint = end.endpoint
    ctx.add(
        "FSN202",
        endpoint.at("index"),
        f"{endpoint} is not mapped in any PDO; the driver would copy through an uninitialised "
        "pointer",
        hint=_better_start(ctx, end, wanted, row),
    )


def _better_start(ctx: Context, end: ResolvedEnd, wanted: Direction, row: ResolvedTransfer) -> Fix:
    """Return the probably meant entry: a frame's command first, with the right direction."""
    if end.layout is None:
        return Fix(hint="")
    choices: list[tuple[int, str, SmLayout, Placed]] = []
    fsoe = row.transfer.kind is TransferKind.FSOE
    for sm in end.layout.managers:
        if sm.sm.direction is not wanted:
            continue
        for placed in sm.placed:
            if placed.entry.registered:
                score = _distance(end, sm, placed, row, fsoe)
                choices.append((score, _name(end, sm, placed), sm, placed))
    if not choices:
        return Fix(hint=f"{end.endpoint.module} maps no entry in this direction")
    least = min(score for score, *_ in choices)
    best = [choice[1:] for choice in choices if choice[0] == least]
    _, sm, placed = best[0]
    edits = _start_at(ctx, end, sm, placed, row) if fsoe else ()
    names = [name for name, _, _ in (best[:1] if edits else best[:3])]
    return Fix(hint=f"nearest: {one_of(names)}", edits=edits)


def _start_at(
    ctx: Context, end: ResolvedEnd, sm: SmLayout, placed: Placed, row: ResolvedTransfer
) -> tuple[Edit, ...]:
    """Return the edits that let an end start at a frame, if it can refer to no other frame."""
    free = ctx.free_frames(end, sm.sm.direction, row.transfer.size_bytes)
    # `--fix` applies these edits: with two unused frames of this size, either could be meant.
    if len(free) != 1 or free[0].command is not placed.entry:
        return ()
    endpoint, entry = end.endpoint, placed.entry
    edits = []
    if entry.index != endpoint.index:
        text = f"0x{entry.index:04x}"
        edits.append(Edit(span=endpoint.at("index"), key="index", text=text))
    if entry.subindex != endpoint.subindex:
        text = str(entry.subindex)
        edits.append(Edit(span=endpoint.at("subindex"), key="subindex", text=text))
    return tuple(edits)


def _distance(
    end: ResolvedEnd, sm: SmLayout, placed: Placed, row: ResolvedTransfer, fsoe: bool
) -> int:
    index, subindex = end.endpoint.index, end.endpoint.subindex
    text_a, text_b = (
        f"{index:04x}{subindex:02x}",
        f"{placed.entry.index:04x}{placed.entry.subindex:02x}",
    )
    # A wrong digit (4) is more likely than another frame size (6) or kind of entry (20).
    score = 4 * sum(a != b for a, b in zip(text_a, text_b, strict=True))
    block = sm.block_at(placed.bit_offset)
    is_command = block is not None and block.command is placed.entry
    if fsoe is not is_command:  # other data do not belong in a frame
        score += 20
    if fsoe and block is not None and block.frame_bytes != row.transfer.size_bytes:
        score += 6
    return score


def _name(end: ResolvedEnd, sm: SmLayout, placed: Placed) -> str:
    block = sm.block_at(placed.bit_offset)
    text = f"{end.endpoint.module} {placed.entry.address}"
    if block is not None and block.command is placed.entry:
        return f"{text}, the command of a {block.frame_bytes}-byte frame in SM{sm.sm.index}"
    return f"{text} in SM{sm.sm.index}"


def _direction(
    ctx: Context,
    row: ResolvedTransfer,
    written: dict[tuple[str, int, int], ResolvedTransfer],
) -> None:
    source, destination = row.source, row.destination
    if source.sm is None or destination.sm is None:
        return
    if ctx.is_exchanged(source) or ctx.is_exchanged(destination):
        return  # FSN401 has reported the cause
    reads_output = source.sm.sm.direction is Direction.OUTPUT
    writes_input = destination.sm.sm.direction is Direction.INPUT
    # First: with equal ends, findings about the direction would name the wrong mistake.
    if reads_output and source.subdevice is destination.subdevice and _overlap(row):
        ctx.unsure_nets.add(row.net_number)
        ctx.add(
            "FSN216",
            row.transfer.span,
            f"source and destination are the same bytes of {source.endpoint.module}",
            hint="in is the frame one SubDevice sends, out the place where another receives it",
        )
        return
    if not reads_output and not writes_input:
        _mapped_both_ways(ctx, source)
    if reads_output:
        other = written.get(_address(source))
        if other is not None and other is not row and not writes_input:
            _chain(ctx, row, other)
            return
        ctx.add(
            "FSN203",
            row.transfer.source.at("index"),
            f"transfer reads an output: {describe_end(source)}",
            hint=_mend_direction(row, reads_output, writes_input),
        )
    elif writes_input:
        ctx.add(
            "FSN205",
            row.transfer.destination.at("index"),
            f"transfer writes an input: {describe_end(destination)}; nothing would reach the "
            "SubDevice",
            hint=_mend_direction(row, reads_output, writes_input),
        )


def _mapped_both_ways(ctx: Context, source: ResolvedEnd) -> None:
    """FSN203 for a driver that searches for the first place of an entry, which is the output."""
    if source.layout is None or source.sm is None:
        return
    first = source.layout.by_address[source.endpoint.index, source.endpoint.subindex][0]
    if first.sm is not source.sm:
        ctx.add(
            "FSN203",
            source.endpoint.at("index"),
            f"{source.endpoint} is an output and an input: fsn-master copies the input, "
            f"ethercat_driver_ros2 the output (SM{first.sm.sm.index})",
            severity=Severity.INFO,
            hint="with ethercat_driver_ros2, copy another entry, or map this one as an input only",
        )


def _overlap(row: ResolvedTransfer) -> bool:
    size = row.transfer.size_bytes
    same_sm = row.source.sm is row.destination.sm
    return same_sm and abs(row.source.byte_offset - row.destination.byte_offset) < max(size, 1)


def _chain(ctx: Context, row: ResolvedTransfer, other: ResolvedTransfer) -> None:
    ctx.add(
        "FSN217",
        row.transfer.source.at("index"),
        f"{row.transfer.source} is what another transfer writes; the copy would depend on the "
        "order of the transfers",
        hint=f"read from {other.transfer.source} instead",
        related=(Related(span=other.transfer.span, message="written by this transfer"),),
    )


def _mend_direction(row: ResolvedTransfer, reads_output: bool, writes_input: bool) -> Fix:
    source, destination, size = row.source, row.destination, row.transfer.size_bytes
    if reads_output and writes_input:
        edits = tuple(
            Edit(span=row.transfer.at(key), key=key, text=other, renames=True)
            for key, other in (("in", "out"), ("out", "in"))
        )
        return Fix(
            hint=f"in and out look exchanged; the opposite copy {destination.endpoint} -> "
            f"{source.endpoint} would fit ({counted(size, 'byte')})",
            edits=edits,
        )
    wrong = source if reads_output else destination
    if wrong.partner is None:
        return Fix(hint="in must be an entry of a TxPDO, out an entry of an RxPDO")
    key = "in" if reads_output else "out"
    return Fix(hint=f"write {block_text(wrong.endpoint.module, wrong.partner)} as {key}")


def _alignment(ctx: Context, end: ResolvedEnd) -> None:
    if end.placed is not None and end.placed.bit_offset % 8:
        ctx.add(
            "FSN213",
            end.endpoint.at("index"),
            f"{end.endpoint} starts at bit {end.placed.bit_offset % 8} of byte {end.byte_offset} "
            "of its sync manager; copies move whole bytes, so its neighbours would move too",
            hint="start at the first entry of that byte",
        )


def _masters(ctx: Context, row: ResolvedTransfer) -> None:
    source, destination = row.source.subdevice, row.destination.subdevice
    if source is None or destination is None:
        return
    if not ctx.resolution.network.has_way(source, destination):
        add_two_masters(ctx, row.transfer.span, source, destination)


def add_two_masters(ctx: Context, span: Span, one: SubDevice, two: SubDevice) -> None:
    """Add FSN129 for two SubDevices between which nothing can be copied."""
    ctx.add(
        "FSN129",
        span,
        f"{one.name} is on master {one.master_id}, {two.name} on master {two.master_id}; a copy "
        "moves bytes inside one process image",
        hint="put both SubDevices on one master",
    )


def add_main_device(ctx: Context, span: Span, name: str) -> None:
    """Add FSN226 for a MainInstance that would be on the MainDevice."""
    ctx.add(
        "FSN226",
        span,
        f"{name!r} means the MainDevice itself: an FSoE MainInstance on the MainDevice "
        "(centralized topology) needs certified software on certified hardware, which this "
        "PC is not",
        hint="name the safety terminal on the bus (for example EL6910, EL1918) that holds it",
    )
