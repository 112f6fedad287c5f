"""A description as an ENI, with ``CopyInfos`` for its copies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from fsoe_net.diag.words import listed
from fsoe_net.errors import InputError
from fsoe_net.formats.eni.write_commands import BRD, BWR, plain_text, register
from fsoe_net.formats.eni.write_layout import EniLayout, Piece, WrittenCommand, lay_out
from fsoe_net.formats.eni.write_subdevice import slave_lines
from fsoe_net.formats.shared.writers import Written, own_words_lost
from fsoe_net.model.bus import Direction
from fsoe_net.model.description import DescribedCopy, DescribedSubDevice, Description

_DEFAULT_CYCLE_US = 1000
_LRW = 12


def write_eni_file(description: Description, *, file: str) -> Written:
    """Return an ENI from `write_eni`, with notes on missing data."""
    notes = [*eni_notes(description), *own_words_lost(description, nets=True)]
    if any(c.address is not None or c.watchdog_ms for c in description.connections):
        notes.append("addresses and watchdogs of connections are not in this file")
    return Written(files={file: write_eni(description)}, notes=tuple(notes))


def write_eni(description: Description, *, header_bytes: int = 0) -> str:
    """Return an ENI for a bus.

    It contains addresses, FMMUs, process data, start-up SDOs, cyclic commands and copies. Data from
    an ESI are included if a SubDevice has `StartFacts`; `eni_notes` names missing data.

    Args:
        description: SubDevices with ring positions, copies.
        header_bytes: Bytes between the offset of a command and its data: 0 or 10, as expected by
            the MainDevice that reads it.

    Raises:
        InputError: A SubDevice without a ring position, two at one position, a copy outside its
            sync manager, data too long for a datagram.
    """
    if header_bytes not in (0, 10):
        raise InputError(f"an ENI has 0 or 10 header bytes, not {header_bytes}")
    _check_positions(description)
    description = replace(description, subdevices=tuple(map(_placed, description.subdevices)))
    layout = lay_out(description, header_bytes)
    copies: dict[int, list[tuple[int, int, int]]] = {}
    for copy in description.copies:
        address, bits = _copy_bits(copy, layout, description)
        copies.setdefault(address, []).append(bits)
    return "\n".join(_lines(description, layout, copies)) + "\n"


def _check_positions(description: Description) -> None:
    seen: set[int] = set()
    for sub in description.subdevices:
        if sub.position is None:
            raise InputError(f"{sub.name or 'a SubDevice'}: no ring position, which an ENI needs")
        if sub.position in seen:
            raise InputError(f"{sub.name}: a second SubDevice at ring position {sub.position}")
        seen.add(sub.position)
        if sub.device.assign_activate > 0xFFFF:
            raise InputError(
                f"{sub.name}: assign_activate 0x{sub.device.assign_activate:x} is more than 16 bits"
            )


def _placed(sub: DescribedSubDevice) -> DescribedSubDevice:
    """Add the start of sync managers if only the device type defines it."""
    starts = sub.start.starts if sub.start is not None else {}
    managers = tuple(
        replace(sm, start_byte=starts.get(sm.index)) if sm.start_byte is None else sm
        for sm in sub.device.sync_managers
    )
    return replace(sub, device=replace(sub.device, sync_managers=managers))


def _copy_bits(
    copy: DescribedCopy, layout: EniLayout, description: Description
) -> tuple[int, tuple[int, int, int]]:
    """Return the address of the command that contains the source, and the numbers to write."""
    bits = []
    address = 0
    for end, direction in (
        (copy.source, Direction.INPUT),
        (copy.destination, Direction.OUTPUT),
    ):
        found = layout.places.get((end.subdevice, end.sm_index))
        if found is None or found[0].direction is not direction:
            name = description.subdevices[end.subdevice].name
            raise InputError(f"{name}: Sm{end.sm_index} holds no {direction.value} to copy")
        piece, command = found
        # A MainDevice copies when the source command returns, so CopyInfos belong to that command.
        address = command.address if direction is Direction.INPUT else address
        if end.bit_offset + copy.bits > piece.layout.bits:
            name = description.subdevices[end.subdevice].name
            raise InputError(f"{name}: a copy runs past the end of Sm{end.sm_index}")
        bits.append(piece.first_bit + end.bit_offset)
    return address, (bits[0], bits[1], copy.bits)


def _lines(
    description: Description,
    layout: EniLayout,
    copies: dict[int, list[tuple[int, int, int]]],
) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield '<EtherCATConfig Version="1.3">'
    yield "<Config>"
    yield "<Master><Info><Name>Master</Name><Destination>ffffffffffff</Destination>"
    # Bytes in memory order: 0x88A4 is EtherCAT.
    yield "<Source>000000000000</Source><EtherType>a488</EtherType></Info>"
    yield from _master_commands()
    yield "</Master>"
    pieces: dict[int, list[Piece]] = {}
    for command in layout.commands:
        for piece in command.pieces:
            pieces.setdefault(piece.subdevice, []).append(piece)
    cycle_us = description.cycle_us or _DEFAULT_CYCLE_US
    clocked = [s.position or 0 for s in description.subdevices if s.device.assign_activate]
    for number, sub in enumerate(description.subdevices):
        # IgH and SOEM also take the first SubDevice with distributed clocks as the reference.
        reference = bool(clocked) and sub.position == min(clocked)
        yield from slave_lines(sub, pieces.get(number, []), cycle_us, reference=reference)
    yield "<Cyclic>"
    yield f"<CycleTime>{cycle_us}</CycleTime>"
    yield "<Frame>"
    for command in layout.commands:
        yield from _command(command, copies.get(command.address, []))
    yield "</Frame>"
    yield "</Cyclic>"
    yield "<ProcessImage>"
    for direction, name in ((Direction.INPUT, "Inputs"), (Direction.OUTPUT, "Outputs")):
        yield f"<{name}>"
        # An LRW has one offset in both images, so both have the same size.
        yield f"<ByteSize>{layout.size_bytes}</ByteSize>"
        for command in layout.commands:
            for piece in command.pieces:
                if piece.direction is direction:
                    yield from _variables(piece, description.subdevices[piece.subdevice])
        yield f"</{name}>"
    yield "</ProcessImage>"
    yield "</Config>"
    yield "</EtherCATConfig>"


def _master_commands() -> Iterator[str]:
    """Commands to all SubDevices that clear the state of an earlier start."""
    yield "<InitCmds>"
    for comment, code, ado, size in (
        # The working counter of any BRD is the number of SubDevices; the register does not matter.
        ("read the number of SubDevices", BRD, 0x0130, 2),
        ("clear station addresses", BWR, 0x0010, 2),
        ("clear FMMUs", BWR, 0x0600, 256),
        ("clear sync managers", BWR, 0x0800, 256),
    ):
        yield register("IP", code, 0, ado, bytes(size), comment=comment, before=True)
    yield "</InitCmds>"


def eni_notes(description: Description) -> list[str]:
    """Return notes on data of an ENI from other sources, and missing data."""
    bare = [s for s in description.subdevices if s.start is None]
    unnumbered = [s for s in description.subdevices if s.revision is None and _typed(s) is None]
    notes = []
    if unnumbered:
        notes.append(f"RevisionNo of {_names(unnumbered)} is not in this file; some tools need it")
    if bare:
        notes.append(
            "Physics, mailbox, control bytes and SYNC0 times "
            f"of {_names(bare)} are not in this file"
        )
    taken = [s for s in description.subdevices if s.revision is None and _typed(s) is not None]
    if notes:
        notes.append("name the ESI of the vendor as a further FILE to have that in it")
    if taken:
        notes.append(f"RevisionNo of {_names(taken)} is that of the ESI; compare with the devices")
    return notes


def _typed(sub: DescribedSubDevice) -> int | None:
    return None if sub.start is None else sub.start.revision


def _names(subs: list[DescribedSubDevice]) -> str:
    return listed([s.name or f"position {s.position}" for s in subs], 4)


def _command(command: WrittenCommand, copies: list[tuple[int, int, int]]) -> Iterator[str]:
    yield "<Cmd>"
    # Inputs are valid from SAFEOP on; outputs take effect in OP only (ETG.1000.6).
    yield f"<State>SAFEOP</State><State>OP</State><Cmd>{_LRW}</Cmd><Addr>{command.address}</Addr>"
    yield f"<DataLength>{command.length}</DataLength><Cnt>{command.counter}</Cnt>"
    yield f"<InputOffs>{command.offset}</InputOffs><OutputOffs>{command.offset}</OutputOffs>"
    if copies:
        yield "<CopyInfos>"
        for source, destination, bits in copies:
            yield (
                f"<CopyInfo><SrcBitOffs>{source}</SrcBitOffs>"
                f"<DstBitOffs>{destination}</DstBitOffs><BitSize>{bits}</BitSize></CopyInfo>"
            )
        yield "</CopyInfos>"
    yield "</Cmd>"


def _variables(piece: Piece, sub: DescribedSubDevice) -> Iterator[str]:
    for placed in piece.layout.placed:
        entry = placed.entry
        if entry.name and not entry.is_gap:
            name = plain_text(f"{sub.name}.{entry.name}")
            yield (
                f"<Variable><Name>{name}</Name><BitSize>{entry.bits}</BitSize>"
                f"<BitOffs>{piece.first_bit + placed.bit_offset}</BitOffs></Variable>"
            )
