"""FSN208 … FSN214, FSN222, FSN233, FSN307: whether a transfer copies exactly one frame."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.diag.diagnostic import Edit, Fix, Related
from fsoe_net.diag.words import counted
from fsoe_net.fsoe.pdu import is_frame_length
from fsoe_net.model.bus import Direction, Entry
from fsoe_net.model.layout import FsoeBlock, SmLayout
from fsoe_net.model.network import TransferKind
from fsoe_net.model.transfer_ends import ResolvedEnd, ResolvedTransfer
from fsoe_net.rules.context import Context, block_text, describe_end, touched_bytes


def check_frames(ctx: Context) -> None:
    """Check size, start and content of every transfer whose ends are known."""
    for row in ctx.resolution.transfers:
        before = len(ctx.diagnostics)
        _one(ctx, row)
        if len(ctx.diagnostics) > before:
            ctx.blame(row)


def _one(ctx: Context, row: ResolvedTransfer) -> None:
    size = row.transfer.size_bytes
    before = len(ctx.diagnostics)
    if size == 0:
        ctx.add(
            "FSN222",
            row.transfer.at("size"),
            "a transfer of size 0 copies nothing",
            hint=_right_size(row) or "write the length of the frame in bytes",
        )
        return
    # An end that does not resolve is reported by another rule; only the length can be judged.
    if not row.usable:
        _size_alone(ctx, row)
        return
    if row.transfer.kind is TransferKind.STANDARD:
        if not any(_standard(ctx, row, end) for end in (row.source, row.destination)):
            _ends(ctx, row)
    else:
        starts = [_start(ctx, row, end) for end in (row.source, row.destination)]
        if all(starts):
            _sizes(ctx, row)
    # Only without other findings: a wrong length overwrites entries as a consequence.
    if len(ctx.diagnostics) == before or all(d.code == "FSN307" for d in ctx.diagnostics[before:]):
        _overwritten(ctx, row)  # the effect of a wrong length is not a separate finding


def _right_size(row: ResolvedTransfer) -> str:
    lengths = {b.frame_bytes for b in (row.source.block, row.destination.block) if b is not None}
    return f"write size: {lengths.pop()}" if len(lengths) == 1 else ""


def _size_alone(ctx: Context, row: ResolvedTransfer) -> None:
    """FSN208 for a size that no FSoE frame has, even if an end is unknown."""
    size = row.transfer.size_bytes
    fsoe = row.transfer.kind is TransferKind.FSOE
    if fsoe and not is_frame_length(size):
        ctx.add(
            "FSN208",
            row.transfer.at("size"),
            f"no FSoE frame has {counted(size, 'byte')}",
            hint=_right_size(row)
            or f"nearest: {_near_lengths(size)}; kind: standard marks other data",
        )


def _near_lengths(size: int) -> str:
    lengths = sorted((n for n in range(6, 256) if is_frame_length(n)), key=lambda n: abs(n - size))
    return " or ".join(str(n) for n in sorted(lengths[:2]))


def _start(ctx: Context, row: ResolvedTransfer, end: ResolvedEnd) -> bool:
    """Return whether the end starts a frame, or there is no evidence against it."""
    if end.sm is None or end.placed is None:
        return False
    block = end.block
    if block is None:
        return _unrecognised(ctx, row, end, end.sm)
    if block.command is end.placed.entry:
        return True
    ctx.add(
        "FSN211",
        end.endpoint.at("index"),
        f"{end.endpoint} lies {counted(end.byte_offset - block.byte_offset, 'byte')} inside a "
        "frame; the copy would be shifted",
        hint=f"start at its command, {block_text(end.endpoint.module, block)}",
    )
    return False


def _unrecognised(ctx: Context, row: ResolvedTransfer, end: ResolvedEnd, sm: SmLayout) -> bool:
    """Handle an end without a recognised frame: is it a mistake or only unusual?"""
    endpoint, size = end.endpoint, row.transfer.size_bytes
    frames = end.layout.blocks if end.layout is not None else ()
    has_frames = any(b.direction is sm.sm.direction for b in frames)
    # A frame that no transfer uses is the most probable intention.
    free = ctx.free_frames(end, sm.sm.direction)
    intruder = _intruder(end, sm, size)
    # A command is one byte: any other entry cannot start a frame.
    is_no_command = end.placed is not None and end.placed.entry.bits != 8
    misses_frames = end.placed is not None and has_frames and intruder is None
    if is_no_command or misses_frames:
        better = min(free, key=lambda b: b.frame_bytes != size) if free else None
        ctx.add(
            "FSN211",
            endpoint.at("index"),
            f"{describe_end(end)}, but is not the command byte of an FSoE frame",
            hint=(f"start at {block_text(endpoint.module, better)}; " if better else "")
            + "mark ordinary data with kind: standard",
        )
        return False
    if intruder is not None:
        ctx.add(
            "FSN212",
            endpoint.at("index"),
            f"{intruder} inside the {counted(size, 'byte')} from {endpoint}, so they are not "
            "an FSoE frame as mapped here",
            hint="compare the PDO with `ethercat pdos` or the ESI; an entry is missing, too long "
            "or too short",
        )
        return True
    ctx.add(
        "FSN307",
        endpoint.at("index"),
        f"no frame structure (command, data, CRC, connection ID) is visible at {endpoint}; its "
        "length cannot be checked",
        hint="map the entries of the frame one by one to have them checked",
    )
    return True


def _intruder(end: ResolvedEnd, sm: SmLayout, size: int) -> str | None:
    """Return the object at the place of a CRC or connection ID, if the rest resembles a frame."""
    # Without a valid length there is no place to look for a CRC.
    if end.placed is None or not is_frame_length(size):
        return None
    entry, base = end.placed.entry, end.placed.bit_offset
    starts = {p.bit_offset: p.entry for p in sm.placed}
    # Without another entry of the same object, this is not a frame at all.
    inside = range(base + 1, base + 8 * size)
    alone = not any(p.bit_offset in inside and p.entry.index == entry.index for p in sm.placed)
    words = []
    for byte, what in [*((b, "CRC") for b in _crc_bytes(size)), (size - 2, "connection ID")]:
        found = starts.get(base + 8 * byte)
        if found is not None and found.bits == 16 and not found.is_gap:
            words.append(found)
            continue
        there = "no entry starts"
        if found is not None:
            there = f"{found.address} of {counted(found.bits, 'bit')} stands"
        return None if alone else f"{there} where the {what} is expected (byte {byte})"
    # All words are present, so one of them has a wrong index.
    return _wrong_word(words, entry.index)


def _crc_bytes(size: int) -> Sequence[int]:
    """Return the places of the CRCs of a frame."""
    return [2] if size == 6 else range(3, size - 2, 4)


def _wrong_word(words: list[Entry], index: int) -> str | None:
    """Return which word of a frame with this index is duplicated or has another index."""
    addresses = [e.address for e in words]
    repeated = [a for a in addresses if addresses.count(a) > 1]
    if repeated:
        return f"{repeated[0]} stands twice"
    foreign = [e for e in words if e.index != index]
    if foreign and len(foreign) < len(words):
        return f"{foreign[0].address} stands where a CRC is expected"
    return None


def _sizes(ctx: Context, row: ResolvedTransfer) -> None:
    source, destination = row.source.block, row.destination.block
    size = row.transfer.size_bytes
    # If only one end is known, its length is the right one.
    if source is None or destination is None:
        known = source or destination
        if known is not None and size != known.frame_bytes:
            _wrong_size(ctx, row, known.frame_bytes)
        elif known is None:
            _size_alone(ctx, row)
            _ends(ctx, row)
        else:
            _ends(ctx, row)
        return
    if source.frame_bytes != destination.frame_bytes:
        ctx.add(
            "FSN210",
            row.transfer.at("size"),
            f"{row.transfer.source} sends a frame of {counted(source.frame_bytes, 'byte')}, "
            # Another slot of the right size is the usual correction.
            f"{row.transfer.destination} takes one of {destination.frame_bytes}",
            hint=_matching_block(ctx, row, source)
            or "the slot of the safety master must have the size "
            "of this device; correct its project or PDO list",
        )
    elif size != source.frame_bytes:
        _wrong_size(ctx, row, source.frame_bytes)


def _matching_block(ctx: Context, row: ResolvedTransfer, source: FsoeBlock) -> str:
    """Return a free slot of the receiver with the right length, if there is exactly one."""
    fits = ctx.free_frames(row.destination, Direction.OUTPUT, source.frame_bytes)
    if len(fits) != 1:
        return ""
    return (
        f"{block_text(row.transfer.destination.module, fits[0])} takes "
        f"{counted(source.frame_bytes, 'byte')}"
    )


def _wrong_size(ctx: Context, row: ResolvedTransfer, frame_bytes: int) -> None:
    size = row.transfer.size_bytes
    if size > frame_bytes:
        end = row.destination
        following = _entry_after(end, frame_bytes)
        ctx.add(
            "FSN209",
            row.transfer.at("size"),
            f"size {size} runs {counted(size - frame_bytes, 'byte')} past the {frame_bytes}-byte "
            "frame" + (f" and would overwrite {following}" if following else ""),
            hint=_size_fix(row, frame_bytes),
        )
        return
    no_frame = "" if is_frame_length(size) else "; no FSoE frame has that length"
    ctx.add(
        "FSN208",
        row.transfer.at("size"),
        f"size {size} cuts a frame of {counted(frame_bytes, 'byte')}{no_frame}",
        hint=_size_fix(row, frame_bytes),
    )


def _size_fix(row: ResolvedTransfer, frame_bytes: int) -> Fix:
    edit = Edit(span=row.transfer.at("size"), key="size", text=str(frame_bytes))
    return Fix(hint=f"write size: {frame_bytes}", edits=(edit,))


def _entry_after(end: ResolvedEnd, frame_bytes: int) -> str:
    if end.sm is None:
        return ""
    bit = 8 * (end.byte_offset + frame_bytes)
    hit = next((p for p in end.sm.placed if p.bit_offset <= bit < p.end_bit), None)
    if hit is None:
        return f"the bytes after SM{end.sm.sm.index} of {end.endpoint.module}"
    return f"{end.endpoint.module} {hit.entry.address}" if not hit.entry.is_gap else "padding"


def _ends(ctx: Context, row: ResolvedTransfer) -> None:
    """FSN209 for the end of the sync manager, if no frame limits the copy."""
    size = row.transfer.size_bytes
    for end in (row.source, row.destination):
        if end.sm is None:
            continue
        _, end_byte = touched_bytes(end, size)
        if end_byte > end.sm.size_bytes:
            ctx.add(
                "FSN209",
                row.transfer.at("size"),
                f"size {size} from {end.endpoint} runs "
                f"{counted(end_byte - end.sm.size_bytes, 'byte')} past the end of "
                f"SM{end.sm.sm.index} ({counted(end.sm.size_bytes, 'byte')})",
                hint="there is room for at most "
                f"{counted(end.sm.size_bytes - end.byte_offset, 'byte')}",
            )


def _standard(ctx: Context, row: ResolvedTransfer, end: ResolvedEnd) -> bool:
    """Return whether FSN233 was found."""
    if end.sm is None:
        return False
    first, end_byte = touched_bytes(end, row.transfer.size_bytes)
    for block in end.sm.blocks:
        if first < block.end_byte and block.byte_offset < end_byte:
            ctx.add(
                "FSN233",
                row.transfer.at("kind"),
                f"this transfer is marked standard but touches the FSoE frame at "
                f"{block_text(end.endpoint.module, block)}",
                hint="remove kind: standard when the frame itself is meant, else copy other bytes",
            )
            return True
    return False


def _overwritten(ctx: Context, row: ResolvedTransfer) -> None:
    """FSN214: entries within the destination that the driver also writes."""
    end = row.destination
    if end.sm is None:
        return
    first, end_byte = touched_bytes(end, row.transfer.size_bytes)
    if end.block is not None:
        end_byte = min(end_byte, end.block.end_byte)  # an excessive size is a separate finding
    # Only entries that the driver writes: others keep the copied value.
    for placed in end.sm.written:
        inside = placed.bit_offset < 8 * end_byte and 8 * first < placed.end_bit
        why = placed.entry.written_by
        if inside and why is not None:
            ctx.add(
                "FSN214",
                placed.entry.at(why),
                f"{why} on {placed.entry.address} lets the driver overwrite a byte that this "
                "transfer has copied",
                hint=f"remove {why} from this channel"
                if row.transfer.kind is TransferKind.FSOE
                else f"remove {why}, or copy fewer bytes",
                related=(Related(span=row.transfer.span, message="copied by this transfer"),),
            )
