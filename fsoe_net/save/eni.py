"""A description as an ENI, with ``CopyInfos`` for its copies."""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

from fsoe_net.errors import InputError
from fsoe_net.model import (
    DescribedCopy,
    DescribedSubDevice,
    Description,
    Direction,
    Pdo,
    SyncManager,
    Watchdog,
)
from fsoe_net.save.eni_layout import EniLayout, Piece, WrittenCommand, lay_out

__all__ = ["write_eni"]

_FIRST_ADDRESS = 1001
_DEFAULT_CYCLE_US = 1000
_LRW, _APWR, _FPWR = 12, 2, 5
_CONTROL = {Direction.OUTPUT: 0x24, Direction.INPUT: 0x20}
_WATCHDOG_BIT = 0x40
_STATES = (("IP", 0x02), ("PS", 0x04), ("SO", 0x08))
_NOT_XML = dict.fromkeys(
    (*range(0x09), 0x0B, 0x0C, *range(0x0E, 0x20), 0xFFFE, 0xFFFF, *range(0xD800, 0xE000)), " "
)


def write_eni(description: Description, *, header_bytes: int = 0) -> str:
    """Return an ENI for a bus.

    Addresses, FMMUs, process data, start-up SDOs, cyclic commands and copies are in it. Mailbox
    addresses are not, because no description holds them.

    Args:
        description: SubDevices with ring positions, copies.
        header_bytes: Bytes between the offset of a command and its data: 0 or 10, as the MainDevice
            that reads it has them.

    Raises:
        InputError: A SubDevice without a ring position, two at one position, a copy out of its
            sync manager, data too long for a datagram.
    """
    if header_bytes not in (0, 10):
        raise InputError(f"an ENI has 0 or 10 header bytes, not {header_bytes}")
    _check_positions(description)
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


def _copy_bits(
    copy: DescribedCopy, layout: EniLayout, description: Description
) -> tuple[int, tuple[int, int, int]]:
    """Return the address of the command that brings the source, and the numbers to write."""
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
    yield "<Source>000000000000</Source><EtherType>a488</EtherType></Info></Master>"
    pieces: dict[int, list[Piece]] = {}
    for command in layout.commands:
        for piece in command.pieces:
            pieces.setdefault(piece.subdevice, []).append(piece)
    for number, sub in enumerate(description.subdevices):
        yield from _slave(sub, pieces.get(number, []))
    yield "<Cyclic>"
    yield f"<CycleTime>{description.cycle_us or _DEFAULT_CYCLE_US}</CycleTime>"
    yield "<Frame>"
    for command in layout.commands:
        yield from _command(command, copies.get(command.address, []))
    yield "</Frame>"
    yield "</Cyclic>"
    yield "<ProcessImage>"
    for direction, name in ((Direction.INPUT, "Inputs"), (Direction.OUTPUT, "Outputs")):
        yield f"<{name}>"
        yield f"<ByteSize>{layout.size_bytes}</ByteSize>"
        for command in layout.commands:
            for piece in command.pieces:
                if piece.direction is direction:
                    yield from _variables(piece, description.subdevices[piece.subdevice])
        yield f"</{name}>"
    yield "</ProcessImage>"
    yield "</Config>"
    yield "</EtherCATConfig>"


def _text(text: str) -> str:
    return escape(text.translate(_NOT_XML))


def _command(command: WrittenCommand, copies: list[tuple[int, int, int]]) -> Iterator[str]:
    yield "<Cmd>"
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
            name = _text(f"{sub.name}.{entry.name}")
            yield (
                f"<Variable><Name>{name}</Name><BitSize>{entry.bits}</BitSize>"
                f"<BitOffs>{piece.first_bit + placed.bit_offset}</BitOffs></Variable>"
            )


# -- one SubDevice --------------------------------------------------------------------------------


def _slave(sub: DescribedSubDevice, pieces: list[Piece]) -> Iterator[str]:
    position = sub.position or 0
    yield "<Slave>"
    yield "<Info>"
    yield f"<Name>{_text(sub.name)}</Name>"
    yield f"<PhysAddr>{_station(position)}</PhysAddr>"
    yield f"<AutoIncAddr>{-position & 0xFFFF}</AutoIncAddr>"
    yield f"<VendorId>{sub.device.vendor_id}</VendorId>"
    yield f"<ProductCode>{sub.device.product_code}</ProductCode>"
    if sub.revision is not None:
        yield f"<RevisionNo>{sub.revision}</RevisionNo>"
    if sub.serial is not None:
        yield f"<SerialNo>{sub.serial}</SerialNo>"
    yield "</Info>"
    if sub.device.sync_managers or sub.available:
        yield from _process_data(sub, pieces)
    if sub.device.sdos:
        yield from _sdos(sub)
    yield from _init_commands(sub, pieces, position)
    if sub.device.assign_activate:
        yield "<DC><ReferenceClock>0</ReferenceClock></DC>"
    yield "</Slave>"


def _control(sm: SyncManager) -> int:
    """Return the control byte: direction, and the watchdog where it is on."""
    return _CONTROL[sm.direction] | (_WATCHDOG_BIT if sm.watchdog is Watchdog.ENABLE else 0)


def _station(position: int) -> int:
    """Return a station address for a ring position: 1001 for the first, never 0."""
    return (_FIRST_ADDRESS - 1 + position) % 0xFFFF + 1


def _process_data(sub: DescribedSubDevice, pieces: list[Piece]) -> Iterator[str]:
    yield "<ProcessData>"
    for direction, name in ((Direction.OUTPUT, "Send"), (Direction.INPUT, "Recv")):
        for piece in (p for p in pieces if p.direction is direction):
            yield (
                f"<{name}><BitStart>{piece.first_bit}</BitStart>"
                f"<BitLength>{piece.layout.bits}</BitLength></{name}>"
            )
    managers = sorted(sub.device.sync_managers, key=lambda sm: sm.index)
    for sm in managers:
        control = _control(sm)
        pdos = sub.device.pdos_of(sm)
        kind = "Outputs" if sm.direction is Direction.OUTPUT else "Inputs"
        size = (sum(p.bits for p in pdos) + 7) // 8
        yield f"<Sm{sm.index}><Type>{kind}</Type><DefaultSize>{size}</DefaultSize>"
        if sm.start_byte is not None:
            yield f"<StartAddress>{sm.start_byte}</StartAddress>"
        if sm.watchdog is not Watchdog.DEFAULT:
            yield f"<ControlByte>{control}</ControlByte>"
        yield f"<Enable>{int(bool(size))}</Enable>"
        for pdo in pdos:
            yield f"<Pdo>{pdo.index}</Pdo>"
        yield f"</Sm{sm.index}>"
    for sm in managers:
        kind = "RxPdo" if sm.direction is Direction.OUTPUT else "TxPdo"
        for pdo in sub.device.pdos_of(sm):
            yield from _pdo(pdo, kind, f" Sm={quoteattr(str(sm.index))}")
    for pdo in sub.available:
        yield from _pdo(pdo, "TxPdo" if 0x1A00 <= pdo.index < 0x1C00 else "RxPdo", "")
    yield "</ProcessData>"


def _pdo(pdo: Pdo, kind: str, attribute: str) -> Iterator[str]:
    yield f"<{kind}{attribute}><Index>#x{pdo.index:04x}</Index><Name></Name>"
    for entry in pdo.entries:
        line = f"<Entry><Index>#x{entry.index:04x}</Index>"
        if not entry.is_gap:
            line += f"<SubIndex>{entry.subindex}</SubIndex>"
        line += f"<BitLen>{entry.bits}</BitLen>"
        if entry.name:
            line += f"<Name>{_text(entry.name)}</Name>"
        if entry.type_name:
            line += f"<DataType>{_text(entry.type_name)}</DataType>"
        yield line + "</Entry>"
    yield f"</{kind}>"


def _sdos(sub: DescribedSubDevice) -> Iterator[str]:
    yield "<Mailbox><Protocol>CoE</Protocol><CoE><InitCmds>"
    for sdo in sub.device.sdos:
        value = sdo.value & ((1 << 8 * sdo.size_bytes) - 1)
        data = value.to_bytes(sdo.size_bytes, "little").hex()
        yield (
            f"<InitCmd><Transition>PS</Transition><Timeout>3000</Timeout><Ccs>1</Ccs>"
            f"<Index>{sdo.index}</Index><SubIndex>{sdo.subindex}</SubIndex>"
            f"<Data>{data}</Data></InitCmd>"
        )
    yield "</InitCmds></CoE></Mailbox>"


def _init_commands(sub: DescribedSubDevice, pieces: list[Piece], position: int) -> Iterator[str]:
    address = _station(position)
    yield "<InitCmds>"
    station = address.to_bytes(2, "little")
    yield _register("IP", _APWR, -position & 0xFFFF, 0x0010, station)
    for number, piece in enumerate(pieces):
        sm = piece.layout.sm
        size = piece.layout.size_bytes
        start = sm.start_byte or 0
        kind = 1 if sm.direction is Direction.INPUT else 2
        last_bit = 7 if piece.layout.bits % 8 == 0 else piece.layout.bits % 8 - 1
        fmmu = piece.logical.to_bytes(4, "little") + size.to_bytes(2, "little")
        fmmu += bytes((0, last_bit)) + start.to_bytes(2, "little") + bytes((0, kind, 1, 0, 0, 0))
        yield _register("PS", _FPWR, address, 0x0600 + 16 * number, fmmu)
    for piece in pieces:
        sm = piece.layout.sm
        if sm.start_byte is not None:
            data = sm.start_byte.to_bytes(2, "little")
            data += piece.layout.size_bytes.to_bytes(2, "little")
            data += bytes((_control(sm), 0, 1, 0))
            yield _register("PS", _FPWR, address, 0x0800 + 8 * sm.index, data)
    if sub.device.assign_activate:
        word = sub.device.assign_activate.to_bytes(2, "little")
        yield _register("PS", _FPWR, address, 0x0980, word)
    for transition, state in _STATES:
        yield _register(transition, _FPWR, address, 0x0120, state.to_bytes(2, "little"))
    yield "</InitCmds>"


def _register(transition: str, code: int, address: int, register: int, data: bytes) -> str:
    return (
        f"<InitCmd><Transition>{transition}</Transition><Requires>cycle</Requires><Cmd>{code}</Cmd>"
        f"<Adp>{address}</Adp><Ado>{register}</Ado><Data>{data.hex()}</Data><Cnt>1</Cnt>"
        "<Retries>3</Retries></InitCmd>"
    )
