"""Writes an ESI file as large as those of vendors: many devices, most of it dictionaries."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

_HEAD = """<?xml version="1.0" encoding="ISO-8859-1"?>
<EtherCATInfo Version="1.11"><Vendor><Id>#x00000a5f</Id><Name>Gr\u00f6\u00dfe</Name></Vendor>
<Descriptions><Groups/><Devices>
"""
_TAIL = """</Devices><Modules>
<Module><Type ModuleIdent="#x10">Frame</Type><Name>Frame</Name></Module>
</Modules></Descriptions></EtherCATInfo>
"""
_SM = (
    '<Sm StartAddress="#x1000" ControlByte="#x26" DefaultSize="128" Enable="1">MBoxOut</Sm>'
    '<Sm StartAddress="#x1080" ControlByte="#x22" DefaultSize="128" Enable="1">MBoxIn</Sm>'
    '<Sm StartAddress="#x1100" ControlByte="#x24" DefaultSize="6" Enable="1">Outputs</Sm>'
    '<Sm StartAddress="#x1180" ControlByte="#x20" DefaultSize="6" Enable="1">Inputs</Sm>\n'
)


def _entry(index: int, sub: int, bits: int, name: str) -> str:
    return (
        f"<Entry><Index>#x{index:04x}</Index><SubIndex>{sub}</SubIndex><BitLen>{bits}</BitLen>"
        f"<Name>{name}</Name><DataType>UINT</DataType></Entry>\n"
    )


def _pdo(tag: str, index: int, base: int, sm: int) -> str:
    entries = (
        _entry(base, 1, 8, "FSoE CMD")
        + _entry(base + 1, 1, 8, "Data")
        + _entry(base, 3, 16, "FSoE CRC_0")
        + _entry(base, 2, 16, "FSoE ConnID")
    )
    head = f'<{tag} Fixed="1" Mandatory="1" Sm="{sm}"><Index>#x{index:04x}</Index><Name>FSoE</Name>'
    return f"{head}\n{entries}</{tag}>\n"


def _dictionary(objects: int) -> str:
    rows = "".join(
        f"<Object><Index>#x{0x2000 + n:04x}</Index><Name>Parameter {n}</Name><Type>UDINT</Type>\n"
        "<BitSize>32</BitSize><Info><DefaultData>00000000</DefaultData></Info>\n"
        "<Flags><Access>rw</Access><Category>o</Category></Flags></Object>\n"
        for n in range(objects)
    )
    return (
        "<Profile><ProfileNo>5001</ProfileNo><Dictionary><Objects>\n"
        f"{rows}</Objects></Dictionary></Profile>\n"
    )


def _devices(objects: int) -> Iterator[str]:
    dictionary = _dictionary(objects)
    number = 0
    while True:
        yield (
            f'<Device Physics="YY"><Type ProductCode="#x{number // 2:08x}" '
            f'RevisionNo="#x{(number % 2 + 1) << 16:08x}">BIG{number // 2:04}</Type>\n'
            f'<Name LcId="1031">Ger\u00e4t {number}</Name>'
            f'<Name LcId="1033">Device {number}</Name>\n'
            f"{dictionary}<Fmmu>Outputs</Fmmu><Fmmu>Inputs</Fmmu>{_SM}"
            f"{_pdo('RxPdo', 0x1600, 0x7000, 2)}{_pdo('TxPdo', 0x1A00, 0x6000, 3)}</Device>\n"
        )
        number += 1


def write_big_esi(path: Path, size: int, objects: int = 300) -> int:
    """Write a file of at least ``size`` bytes; return its devices."""
    written = devices = 0
    with path.open("w", encoding="iso-8859-1", newline="") as file:
        written += file.write(_HEAD)
        for device in _devices(objects):
            written += file.write(device)
            devices += 1
            if written >= size:
                break
        file.write(_TAIL)
    return devices
