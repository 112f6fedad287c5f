"""Writes ESI files for tests, from descriptions of the model."""

from __future__ import annotations

from xml.sax.saxutils import escape, quoteattr

from fsoe_net.model.bus import Direction, Entry, Pdo
from fsoe_net.model.description import DescribedSubDevice


def _entry(entry: Entry) -> str:
    if entry.is_gap:
        return f"<Entry><Index>0</Index><BitLen>{entry.bits}</BitLen></Entry>"
    return (
        f"<Entry><Index>#x{entry.index:04x}</Index><SubIndex>{entry.subindex}</SubIndex>"
        f"<BitLen>{entry.bits}</BitLen><Name>{escape(entry.name)}</Name>"
        f"<DataType>{escape(entry.type_name)}</DataType></Entry>"
    )


def pdo_text(pdo: Pdo, direction: Direction, sm: int | None, attributes: str = "") -> str:
    tag = "RxPdo" if direction is Direction.OUTPUT else "TxPdo"
    place = "" if sm is None else f' Sm="{sm}"'
    return (
        f'<{tag} Fixed="1"{place}{attributes}><Index>#x{pdo.index:x}</Index>'
        f"<Name>{escape(pdo.name)}</Name>{''.join(map(_entry, pdo.entries))}</{tag}>\n"
    )


def device_text(device: DescribedSubDevice, more: str = "") -> str:
    made = device.device
    revision = "" if device.revision is None else f' RevisionNo="#x{device.revision:x}"'
    managers, pdos = "", ""
    for sm in made.sync_managers:
        out = sm.direction is Direction.OUTPUT
        start = sm.start_byte or 0
        managers += (
            f'<Sm StartAddress="#x{start:x}" ControlByte="#x{0x24 if out else 0x20:x}">'
            f"{'Outputs' if out else 'Inputs'}</Sm>"
        )
        pdos += "".join(pdo_text(p, sm.direction, sm.index) for p in sm.pdos or ())
    offered = "".join(pdo_text(p, Direction.INPUT, None) for p in device.available)
    sdos = "".join(
        f"<InitCmd><Transition>PS</Transition><Index>#x{s.index:x}</Index>"
        f"<SubIndex>{s.subindex}</SubIndex>"
        f"<Data>{s.value.to_bytes(s.size_bytes, 'little').hex()}</Data></InitCmd>"
        for s in made.sdos
    )
    return (
        f'<Device Physics="YY"><Type ProductCode="#x{made.product_code:x}"{revision}>'
        f"{escape(device.order)}</Type><Name>{escape(device.name)}</Name>"
        f"<Profile><Dictionary><Objects/></Dictionary></Profile>\n{managers}{pdos}{offered}"
        f"<Mailbox><CoE>{sdos}</CoE></Mailbox><Dc><OpMode><Name>DC</Name>"
        f"<AssignActivate>#x{made.assign_activate:x}</AssignActivate></OpMode></Dc>{more}</Device>\n"
    )


def module_text(ident: int, inside: str, name: str = "M") -> str:
    return f"<Module><Type ModuleIdent={quoteattr(str(ident))}>{name}</Type>{inside}</Module>\n"


def esi_text(devices: str, *, vendor: str = "#x00000a5f", modules: str = "", head: str = "") -> str:
    return (
        f"{head}<EtherCATInfo><Vendor><Id>{vendor}</Id><Name>Maker</Name></Vendor>\n"
        f"<Descriptions><Devices>\n{devices}</Devices><Modules>\n{modules}</Modules>"
        "</Descriptions></EtherCATInfo>\n"
    )
