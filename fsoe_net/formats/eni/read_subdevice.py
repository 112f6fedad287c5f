"""One ``Slave`` of an ENI: identity, sync managers with their PDOs, FMMUs, start-up SDOs."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.diag.words import counted
from fsoe_net.formats.eni.read_parts import Fmmu, Window, read_windows
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import xml_number
from fsoe_net.formats.shared.xml_tree import Element
from fsoe_net.model.bus import (
    SDO_BYTES,
    Device,
    Direction,
    Entry,
    Pdo,
    Sdo,
    SyncManager,
    Watchdog,
)
from fsoe_net.model.description import (
    ClockFacts,
    DescribedSubDevice,
    MailboxFacts,
    OfferedPdo,
    StartFacts,
)

_MAX_SM = 15
_FMMU_REGISTERS = range(0x0600, 0x0700)
_DC_ACTIVATION = 0x0980
_SM_REGISTERS = range(0x0800, 0x0900)  # an FMMU that maps these carries mailbox states
_TYPES = {"outputs": Direction.OUTPUT, "inputs": Direction.INPUT}
_PROTOCOLS = ("AoE", "EoE", "CoE", "FoE", "SoE", "VoE")
_WRITES = (2, 5)  # APWR, FPWR
_DOWNLOADS = (1, 2)
_ASSIGNED = range(0x1C10, 0x1C30)
_ASSIGNMENT = (range(0x1600, 0x1800), range(0x1A00, 0x1C00), _ASSIGNED)


@dataclass(frozen=True, slots=True, kw_only=True)
class EniSlave:
    """A SubDevice, and its place in the images."""

    described: DescribedSubDevice
    windows: tuple[Window, ...]
    fmmus: tuple[Fmmu, ...]
    span: Span
    hot_connect: bool = False


def read_slave(element: Element, number: int, out: Collector, path: str) -> EniSlave:
    """Read one ``Slave``.

    Args:
        element: The element, complete.
        number: Number of SubDevices before it; its position if the file states none.
        out: Takes FSN141 and FSN143.
        path: The file.
    """
    info = element.first("Info") or element
    notes: list[str] = []
    process_data = element.first("ProcessData")
    offered = _pdos(process_data, out)
    managers = () if process_data is None else _managers(process_data, offered, out, notes)
    assigned = {p.index for sm in managers for p in sm.pdos or ()}
    fmmus, activate = _registers(element.first("InitCmds"), out)
    hot = element.first("HotConnect") is not None
    if hot:
        notes.append("it belongs to a group that comes and goes, and has no ring position")
    dc = element.first("DC")
    sdos, objects = _sdos(element, out, notes)
    if dc is not None and not activate:
        notes.append("it has a DC section, but no start-up command writes register 0x0980")
    device = Device(
        span=element.span,
        path=path,
        vendor_id=_needed(info, "VendorId", out),
        product_code=_needed(info, "ProductCode", out),
        assign_activate=activate,
        sync_managers=managers,
        sdos=sdos,
    )
    revision = xml_number(info.first("RevisionNo"), out)
    described = DescribedSubDevice(
        span=info.span,
        fields={c.name: c.value_span for c in info.children},
        name=info.text_of("Name"),
        position=None if hot else _position(info, number, out),
        device=device,
        available=tuple(o.pdo for o in offered if o.index not in assigned),
        revision=revision,
        serial=xml_number(info.first("SerialNo"), out) or None,  # 0: any
        notes=tuple(notes),
        start=_start_facts(element, info, revision, objects),
    )
    windows = () if process_data is None else tuple(read_windows(process_data, out))
    return EniSlave(
        described=described, windows=windows, fmmus=fmmus, span=info.span, hot_connect=hot
    )


def _start_facts(
    element: Element, info: Element, revision: int | None, objects: Iterable[tuple[int, int]]
) -> StartFacts:
    """Return the facts needed to start the SubDevice; `objects` are those its SDOs write."""
    process_data = element.first("ProcessData")
    return StartFacts(
        revision=revision,
        physics=info.text_of("Physics")[:4],
        mailbox=_mailbox(element.first("Mailbox")),
        clock=_clock(element.first("DC")),
        starts=_of_managers(process_data, "StartAddress", 0xFFFF),
        controls=_of_managers(process_data, "ControlByte", 0xFF),
        assigns=any(index in _ASSIGNED for index, _ in objects),
        maps=frozenset(i for i, sub in objects if sub and i not in _ASSIGNED),
    )


def _of_managers(process_data: Element | None, name: str, high: int) -> dict[int, int]:
    """Return the numbers of sync managers; `_manager` reports invalid ones."""
    rows = {}
    for number in range(_MAX_SM + 1):
        sm = None if process_data is None else process_data.first(f"Sm{number}")
        value = None if sm is None else xml_number(sm.first(name), Collector(), high=high)
        if value is not None:
            rows[number] = value
    return rows


def _mailbox(element: Element | None) -> MailboxFacts | None:
    out = Collector()  # no rule reads a mailbox, so an unusual one is not a finding
    windows = []
    # Tools differ in the name of the second window.
    for names in (("Send",), ("Recv", "Receive")):
        window = next((w for n in names if element is not None and (w := element.first(n))), None)
        start = None if window is None else xml_number(window.first("Start"), out, high=0xFFFF)
        size = None if window is None else xml_number(window.first("Length"), out, high=0xFFFF)
        windows.append((start, size) if start is not None and size else None)
    if element is None or windows[0] is None or windows[1] is None:
        return None
    return MailboxFacts(
        to_sub=windows[0],
        from_sub=windows[1],
        protocols=tuple(
            dict.fromkeys(t for p in element.all("Protocol") if (t := p.words) in _PROTOCOLS)
        ),
    )


def _clock(element: Element | None) -> ClockFacts | None:
    out = Collector()
    cycle = None if element is None else xml_number(element.first("CycleTime0"), out)
    if element is None or cycle is None:
        return None
    shift = xml_number(element.first("ShiftTime"), out, low=-0x80000000)
    return ClockFacts(cycle_ns=cycle, shift_ns=shift or 0)


def _needed(info: Element, name: str, out: Collector) -> int:
    element = info.first(name)
    if element is None:
        out.add("FSN141", info.span, f"SubDevice without {name}", hint=f"add <{name}>")
        return 0
    return xml_number(element, out) or 0


def _position(info: Element, number: int, out: Collector) -> int:
    """Return the ring position. Auto-increment addresses are 0, 65535, 65534 ..., its negative."""
    address = xml_number(info.first("AutoIncAddr"), out, high=0xFFFF)
    return number if address is None else -address & 0xFFFF


# -- PDOs -----------------------------------------------------------------------------------------


def pdo_of(element: Element, out: Collector) -> Pdo | None:
    """Return an ``RxPdo`` or ``TxPdo`` with its entries, or ``None`` without an index."""
    index = xml_number(element.first("Index"), out, high=0xFFFF)
    if index is None:
        if element.first("Index") is None:
            out.add("FSN141", element.span, f"{element.name} without Index", hint="add <Index>")
        return None
    entries = []
    for child in element.all("Entry"):
        bits = xml_number(child.first("BitLen"), out, high=0xFFFF)
        entry_index = xml_number(child.first("Index"), out, high=0xFFFF)
        if bits is None or entry_index is None:
            if child.first("BitLen") is None or child.first("Index") is None:
                what = "entry without Index or BitLen"
                out.add("FSN141", child.span, what, hint="its PDO cannot be placed; export again")
            continue
        entries.append(
            Entry(
                span=child.span,
                index=entry_index,
                subindex=xml_number(child.first("SubIndex"), out, high=0xFF) or 0,
                bits=bits,
                type_name=child.text_of("DataType"),
                name=child.text_of("Name"),
            )
        )
    return Pdo(span=element.span, index=index, entries=tuple(entries))


def _pdos(process_data: Element | None, out: Collector) -> list[OfferedPdo]:
    offered: list[OfferedPdo] = []
    for element in process_data.children if process_data is not None else ():
        if element.name not in ("RxPdo", "TxPdo"):
            continue
        pdo = pdo_of(element, out)
        if pdo is not None:
            sm = element.attributes.get("Sm", "").strip()
            direction = Direction.OUTPUT if element.name == "RxPdo" else Direction.INPUT
            # isdigit() is also true for digits such as ², which int() rejects.
            number = int(sm) if sm.isascii() and sm.isdigit() and len(sm) < 4 else None
            offered.append(OfferedPdo(pdo=pdo, index=pdo.index, sm=number, direction=direction))
    return offered


def _managers(
    process_data: Element, offered: list[OfferedPdo], out: Collector, notes: list[str]
) -> tuple[SyncManager, ...]:
    managers = []
    # An RxPdo and a TxPdo may have the same number.
    by_index = {(o.direction, o.index): o.pdo for o in offered}
    for number in range(_MAX_SM + 1):
        sm = process_data.first(f"Sm{number}")
        direction = None if sm is None else _TYPES.get(sm.text_of("Type").lower())
        if sm is None or direction is None:
            continue
        listed = sm.all("Pdo")
        offered_here = {i: pdo for (d, i), pdo in by_index.items() if d is direction}
        pdos = _listed_pdos(listed, number, offered_here, out)
        marked = [o.pdo for o in offered if o.sm == number and o.direction is direction]
        if not listed and marked:
            notes.append(f"Sm{number} lists no PDOs; those marked Sm={number} are taken in order")
            pdos = marked
        elif marked:
            _compare_marked(sm, number, pdos, marked, out)
        managers.append(_manager(sm, number, direction, pdos, out, notes))
    return tuple(managers)


def _compare_marked(
    sm: Element, number: int, listed: list[Pdo], marked: list[Pdo], out: Collector
) -> None:
    if {p.index for p in marked} == {p.index for p in listed}:
        return
    out.add(
        "FSN143",
        sm.span,
        f"Sm{number} lists {_names(listed)}, but the PDOs marked Sm={number} are {_names(marked)}",
        hint="export the ENI again; the list of the sync manager is taken",
    )


def _listed_pdos(
    listed: list[Element], number: int, offered: Mapping[int, Pdo], out: Collector
) -> list[Pdo]:
    """Return the PDOs that a sync manager lists; the first invalid one is reported."""
    taken: dict[int, Pdo] = {}
    reported = False
    for element in listed:
        index = xml_number(element, out, high=0xFFFF)
        if index is None:
            continue
        pdo = offered.get(index)
        if pdo is not None and index not in taken:
            taken[index] = pdo
        elif not reported:
            reported = True
            why = "which this SubDevice does not have" if pdo is None else "a second time"
            out.add(
                "FSN143",
                element.value_span,
                f"Sm{number} lists PDO 0x{index:04x}, {why}",
                hint="export the ENI again; no entry after this PDO can be placed",
            )
    return list(taken.values())


def _manager(
    sm: Element,
    number: int,
    direction: Direction,
    pdos: list[Pdo],
    out: Collector,
    notes: list[str],
) -> SyncManager:
    empty = [p for p in pdos if not p.entries]
    if empty:
        notes.append(f"Sm{number}: {_names(empty)} has no entries and takes no room")
    control = xml_number(sm.first("ControlByte"), out, high=0xFF)
    return SyncManager(
        span=sm.span,
        index=number,
        direction=direction,
        watchdog=Watchdog.DEFAULT if control is None else Watchdog.of(control),
        pdos=tuple(p for p in pdos if p.entries),
        start_byte=xml_number(sm.first("StartAddress"), out, high=0xFFFF),
    )


def _names(pdos: list[Pdo]) -> str:
    return ", ".join(f"0x{p.index:04x}" for p in pdos) or "none"


# -- start-up commands ----------------------------------------------------------------------------


def _hex(element: Element | None, out: Collector) -> bytes:
    if element is None:
        return b""
    try:
        return bytes.fromhex(element.text)
    except ValueError:
        out.add(
            "FSN141",
            element.value_span,
            "this is not hexadecimal data",
            hint="two digits for each byte, lowest byte first",
        )
        return b""


def _registers(commands: Element | None, out: Collector) -> tuple[tuple[Fmmu, ...], int]:
    """Return the FMMUs and the DC activation word that result from the register writes."""
    fmmus: dict[int, Fmmu] = {}
    activate = 0
    for cmd in commands.all("InitCmd") if commands is not None else ():
        code = xml_number(cmd.first("Cmd"), out, high=0xFF)
        register = xml_number(cmd.first("Ado"), out, high=0xFFFF)
        if code not in _WRITES or register is None:
            continue
        if register == _DC_ACTIVATION:
            # Start-up first stops the clock with 0; only the value that starts it counts.
            activate = int.from_bytes(_hex(cmd.first("Data"), out)[:2], "little") or activate
        if register in _FMMU_REGISTERS and register % 16 == 0:
            data = _hex(cmd.first("Data"), out)
            # One write may set several FMMUs of 16 bytes; byte 12 of each activates it.
            for at in range(0, min(len(data), 256) - 12, 16):
                fmmu = _fmmu(data[at : at + 16])
                if fmmu is not None:
                    fmmus[register + at] = fmmu
    return tuple(fmmus[key] for key in sorted(fmmus)), activate


def _fmmu(data: bytes) -> Fmmu | None:
    logical, length, start, _end, physical, _bit, kind, active = struct.unpack_from(
        "<IHBBHBBB", data
    )
    if not active & 1 or not length or physical in _SM_REGISTERS or kind not in (1, 2):
        return None
    return Fmmu(
        logical=logical,
        start_bit=start,
        direction=Direction.INPUT if kind == 1 else Direction.OUTPUT,
    )


def _sdos(
    element: Element, out: Collector, notes: list[str]
) -> tuple[tuple[Sdo, ...], set[tuple[int, int]]]:
    """Return the CoE start-up SDOs except those that set PDOs, and the objects of the latter."""
    mailbox = element.first("Mailbox")
    coe = None if mailbox is None else mailbox.first("CoE")
    commands = None if coe is None else coe.first("InitCmds")
    sdos: list[Sdo] = []
    assigning = other = 0
    objects: set[tuple[int, int]] = set()
    for cmd in commands.all("InitCmd") if commands is not None else ():
        ccs = xml_number(cmd.first("Ccs"), out, high=0xFF)
        index = xml_number(cmd.first("Index"), out, high=0xFFFF)
        if index is None or (ccs is not None and ccs not in _DOWNLOADS):
            other += 1
            continue
        subindex = xml_number(cmd.first("SubIndex"), out, high=0xFF) or 0
        data = _hex(cmd.first("Data"), out)
        if any(index in group for group in _ASSIGNMENT):
            assigning += 1
            # Complete access begins at subindex 0 but also writes the entries.
            objects.add((index, max(subindex, int(_is_complete(cmd)))))
        elif len(data) not in SDO_BYTES or _is_complete(cmd):
            other += 1
        else:
            sdos.append(Sdo.of(index, subindex, data, cmd.span))
    if assigning:
        what = counted(assigning, "start-up SDO")
        notes.append(f"{what} left out that assign PDOs: the lists say it")
    if other:
        what = counted(other, "start-up command")
        notes.append(f"{what} left out: no plain download of 1, 2, 4 or 8 bytes")
    return tuple(sdos), objects


def _is_complete(cmd: Element) -> bool:
    return cmd.attributes.get("CompleteAccess", "").strip().lower() in ("1", "true")
