"""One ``Slave`` of an ENI."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from xml.sax.saxutils import quoteattr

from fsoe_net.formats.eni.write_commands import (
    APWR,
    FPWR,
    al_state,
    download,
    pdo_assignment,
    pdo_mapping,
    plain_text,
    register,
)
from fsoe_net.formats.eni.write_layout import Piece
from fsoe_net.model.bus import WATCHDOG_BIT, Direction, Pdo, SyncManager, Watchdog
from fsoe_net.model.description import DescribedSubDevice, StartFacts

# Station address of position 0, as in ENIs of TwinCAT.
_FIRST_ADDRESS = 1001
# Control byte (ETG.1000.4): bit 2 is written by the MainDevice, bit 5 signals the application.
_CONTROL = {Direction.OUTPUT: 0x24, Direction.INPUT: 0x20}
# The same, but bits 0 and 1 are 2: one buffer with handshake instead of three.
_MAILBOX_CONTROL = (0x26, 0x22)
_POLL_MS = 20
_SYNC0 = 0x0200  # of AssignActivate: SYNC0 is generated
_MOST_BITS = 0xFF  # of an entry in a mapping object


def slave_lines(
    sub: DescribedSubDevice, pieces: list[Piece], cycle_us: int, *, reference: bool
) -> Iterator[str]:
    """Write a SubDevice.

    Args:
        sub: The SubDevice, with a ring position.
        pieces: Its process data.
        cycle_us: Bus cycle, microseconds.
        reference: Whether it has the reference clock.
    """
    start = sub.start or StartFacts()
    position = sub.position or 0
    revision = start.revision if sub.revision is None else sub.revision
    yield "<Slave>"
    yield "<Info>"
    yield f"<Name>{plain_text(sub.name)}</Name>"
    yield f"<PhysAddr>{_station(position)}</PhysAddr>"
    # Each SubDevice adds 1, and the SubDevice that reads 0 is addressed (ETG.1000.4).
    yield f"<AutoIncAddr>{-position & 0xFFFF}</AutoIncAddr>"
    if start.physics:
        yield f"<Physics>{plain_text(start.physics)}</Physics>"
    yield f"<VendorId>{sub.device.vendor_id}</VendorId>"
    yield f"<ProductCode>{sub.device.product_code}</ProductCode>"
    if revision is not None:
        yield f"<RevisionNo>{revision}</RevisionNo>"
    yield f"<SerialNo>{sub.serial or 0}</SerialNo>"
    yield "</Info>"
    if sub.device.sync_managers or sub.available:
        yield from _process_data(sub, pieces, start)
    yield from _mailbox(sub, start)
    period = _period_ns(sub, cycle_us)
    yield from _init_commands(sub, pieces, start, period)
    if sub.device.assign_activate:
        yield f"<DC><ReferenceClock>{str(reference).lower()}</ReferenceClock>"
        if period is not None and start.clock is not None:
            yield f"<CycleTime0>{period}</CycleTime0><CycleTime1>0</CycleTime1>"
            yield f"<ShiftTime>{start.clock.shift_ns}</ShiftTime>"
        yield "</DC>"
    yield "</Slave>"


def _period_ns(sub: DescribedSubDevice, cycle_us: int) -> int | None:
    """Return the period of SYNC0; ``None`` if unused or not stated."""
    clock = sub.start.clock if sub.start is not None else None
    if clock is None or not sub.device.assign_activate & _SYNC0:
        return None
    return min(clock.period_ns(cycle_us), 0x7FFFFFFF)


def _control(sm: SyncManager, start: StartFacts) -> int | None:
    """Return the control byte; ``None`` if neither type nor watchdog is known."""
    control = start.controls.get(sm.index)
    if sm.watchdog is Watchdog.DEFAULT:
        return control
    control = (_CONTROL[sm.direction] if control is None else control) & ~WATCHDOG_BIT
    return control | (WATCHDOG_BIT if sm.watchdog is Watchdog.ENABLE else 0)


def _station(position: int) -> int:
    """Return a station address for a ring position: 1001 for the first, never 0."""
    return (_FIRST_ADDRESS - 1 + position) % 0xFFFF + 1


def _process_data(sub: DescribedSubDevice, pieces: list[Piece], start: StartFacts) -> Iterator[str]:
    yield "<ProcessData>"
    for direction, name in ((Direction.OUTPUT, "Send"), (Direction.INPUT, "Recv")):
        for piece in (p for p in pieces if p.direction is direction):
            yield (
                f"<{name}><BitStart>{piece.first_bit}</BitStart>"
                f"<BitLength>{piece.layout.bits}</BitLength></{name}>"
            )
    managers = sorted(sub.device.sync_managers, key=lambda sm: sm.index)
    if start.mailbox is not None:  # its sync managers carry no process data
        managers = [m for m in managers if m.index > 1 or sub.device.pdos_of(m)]
    for sm in managers:
        yield from _sync_manager(sm, sub.device.pdos_of(sm), _control(sm, start))
    for sm in managers:
        kind = "RxPdo" if sm.direction is Direction.OUTPUT else "TxPdo"
        for pdo in sub.device.pdos_of(sm):
            yield from _pdo(pdo, kind, f" Sm={quoteattr(str(sm.index))}")
    for pdo in sub.available:
        # Without a sync manager only the number shows the direction: 0x1A00 … 0x1BFF are TxPDOs.
        yield from _pdo(pdo, "TxPdo" if 0x1A00 <= pdo.index < 0x1C00 else "RxPdo", "")
    yield "</ProcessData>"


def _sync_manager(sm: SyncManager, pdos: Sequence[Pdo], control: int | None) -> Iterator[str]:
    kind = "Outputs" if sm.direction is Direction.OUTPUT else "Inputs"
    size = (sum(p.bits for p in pdos) + 7) // 8
    yield f"<Sm{sm.index}><Type>{kind}</Type><DefaultSize>{size}</DefaultSize>"
    if sm.start_byte is not None:
        yield f"<StartAddress>{sm.start_byte}</StartAddress>"
    if control is not None:
        yield f"<ControlByte>{control}</ControlByte>"
    yield f"<Enable>{int(bool(size))}</Enable>"
    for pdo in pdos:
        yield f"<Pdo>{pdo.index}</Pdo>"
    yield f"</Sm{sm.index}>"


def _pdo(pdo: Pdo, kind: str, attribute: str) -> Iterator[str]:
    yield f"<{kind}{attribute}><Index>#x{pdo.index:04x}</Index><Name></Name>"
    for entry in pdo.entries:
        line = f"<Entry><Index>#x{entry.index:04x}</Index>"
        if not entry.is_gap:
            line += f"<SubIndex>{entry.subindex}</SubIndex>"
        line += f"<BitLen>{entry.bits}</BitLen>"
        if entry.name:
            line += f"<Name>{plain_text(entry.name)}</Name>"
        if entry.type_name:
            line += f"<DataType>{plain_text(entry.type_name)}</DataType>"
        yield line + "</Entry>"
    yield f"</{kind}>"


def _mailbox(sub: DescribedSubDevice, start: StartFacts) -> Iterator[str]:
    """Write the windows of the mailbox and the SDOs, beginning with those that set PDOs."""
    commands = [*_pdo_commands(sub, start), *map(download, sub.device.sdos)]
    box = start.mailbox
    if box is None and not commands:
        return
    yield "<Mailbox>"
    if box is not None:
        first, size = box.to_sub
        yield f"<Send><Start>{first}</Start><Length>{size}</Length></Send>"
        first, size = box.from_sub
        yield f"<Recv><Start>{first}</Start><Length>{size}</Length>"
        yield f"<PollTime>{_POLL_MS}</PollTime></Recv>"
    # Start-up SDOs need CoE, even if the source does not list it.
    protocols = dict.fromkeys((*(box.protocols if box else ()), *(("CoE",) if commands else ())))
    for protocol in protocols:
        yield f"<Protocol>{protocol}</Protocol>"
    if commands:
        yield "<CoE><InitCmds>"
        yield from commands
        yield "</InitCmds></CoE>"
    yield "</Mailbox>"


def _pdo_commands(sub: DescribedSubDevice, start: StartFacts) -> Iterator[str]:
    if not start.assigns:
        return
    managers = [sm for sm in sub.device.sync_managers if sub.device.pdos_of(sm)]
    for sm in managers:
        for pdo in sub.device.pdos_of(sm):
            if pdo.index in start.maps and all(e.bits <= _MOST_BITS for e in pdo.entries):
                yield from pdo_mapping(pdo)
        yield from pdo_assignment(sm.index, sub.device.pdos_of(sm))


def _init_commands(
    sub: DescribedSubDevice, pieces: list[Piece], start: StartFacts, period_ns: int | None
) -> Iterator[str]:
    position = sub.position or 0
    address = _station(position)
    yield "<InitCmds>"
    station = address.to_bytes(2, "little")
    yield register(
        "IP", APWR, -position & 0xFFFF, 0x0010, station, comment="set the station address"
    )
    # PREOP needs the mailbox, so its windows are written before that state is requested.
    if start.mailbox is not None:
        windows = (start.mailbox.to_sub, start.mailbox.from_sub)
        for number, ((first, size), usual) in enumerate(
            zip(windows, _MAILBOX_CONTROL, strict=True)
        ):
            data = _sm_register(first, size, start.controls.get(number, usual))
            yield register(
                "IP", FPWR, address, 0x0800 + 8 * number, data, comment=f"mailbox SM{number}"
            )
    yield from al_state("IP", address)
    # A SubDevice checks process data when SAFEOP is requested, so the following comes first.
    for number, piece in enumerate(pieces):
        yield register(
            "PS", FPWR, address, 0x0600 + 16 * number, _fmmu(piece), comment=f"FMMU {number}"
        )
    for piece in pieces:
        sm = piece.layout.sm
        if sm.start_byte is not None:
            control = _control(sm, start)
            usual = _CONTROL[sm.direction] if control is None else control
            data = _sm_register(sm.start_byte, piece.layout.size_bytes, usual)
            yield register(
                "PS", FPWR, address, 0x0800 + 8 * sm.index, data, comment=f"SM{sm.index}"
            )
    if period_ns is not None:
        # Written before 0x0980, which starts SYNC0 with the period that is set at that time.
        data = period_ns.to_bytes(4, "little") + bytes(4)
        yield register("PS", FPWR, address, 0x09A0, data, comment="SYNC0 period")
    if sub.device.assign_activate:
        word = sub.device.assign_activate.to_bytes(2, "little")
        yield register("PS", FPWR, address, 0x0980, word, comment="start the clock")
    yield from al_state("PS", address)
    yield from al_state("SO", address)
    yield "</InitCmds>"


def _sm_register(start: int, size: int, control: int) -> bytes:
    # Start, length, control, status, activate (1: enabled), PDI control.
    return start.to_bytes(2, "little") + size.to_bytes(2, "little") + bytes((control, 0, 1, 0))


def _fmmu(piece: Piece) -> bytes:
    sm = piece.layout.sm
    # Access as in an FMMU: 1 is read, 2 is write by the MainDevice.
    kind = 1 if sm.direction is Direction.INPUT else 2
    last_bit = 7 if piece.layout.bits % 8 == 0 else piece.layout.bits % 8 - 1
    return (
        piece.logical.to_bytes(4, "little")
        + piece.layout.size_bytes.to_bytes(2, "little")
        + bytes((0, last_bit))
        + (sm.start_byte or 0).to_bytes(2, "little")
        + bytes((0, kind, 1, 0, 0, 0))
    )
