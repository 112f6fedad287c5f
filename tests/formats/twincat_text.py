"""Writes small TwinCAT 3 projects for tests: a coupler, a safety logic, terminals behind it."""

from __future__ import annotations

from pathlib import Path

_IDENTITY = 'VendorId="#x00000002" ProductCode="#x{product:08x}" RevisionNo="#x00120000"'
MASTER = "Device 1 (EtherCAT)"
FSOE_TYPES = """<DataTypes><DataType><Name GUID="{6}">FSOE_6</Name><BitSize>48</BitSize></DataType>
<DataType><Name GUID="{7}">FSOE_7</Name><BitSize>56</BitSize></DataType></DataTypes>"""
BIG = 300


def sync_manager(start: int, length: int, control: int, use: int) -> str:
    first = start.to_bytes(2, "little") + length.to_bytes(2, "little")
    head = first + bytes((control, 0, 1, 0))
    return f"<SyncMan>{(head + use.to_bytes(4, 'little') + head + bytes(4)).hex()}</SyncMan>"


def box(number: int, name: str, order: str, product: int, inside: str = "", more: str = "") -> str:
    return (
        f'<Box Id="{number}" BoxType="9099"><Name>{name}</Name><EtherCAT PdiType="#x0005" '
        f'{_IDENTITY.format(product=product)} Desc="{order}" CoeType="3">{inside}</EtherCAT>'
        f"{more}</Box>\n"
    )


def entry(name: str, kind: str, index: int = 0, sub: int = 0, guid: str = "") -> str:
    place = f' Index="#x{index:04x}" Sub="#x{sub:02x}"' if index else ""
    word = f' GUID="{guid}"' if guid else ""
    return f'<Entry Name="{name}"{place}><Type{word}>{kind}</Type></Entry>'


def pdo(name: str, index: int, entries: str, *, sm: int, output: bool) -> str:
    way = ' InOut="1"' if output else ""
    return f'<Pdo Name="{name}" Index="#x{index:04x}"{way} SyncMan="{sm}">{entries}</Pdo>\n'


def frame(base: int, who: str) -> str:
    rows = [("CMD", "USINT", base, 1), ("data", "BYTE", base + 1, 1)]
    rows += [("CRC_0", "UINT", base, 3), ("ConnID", "UINT", base, 2)]
    return "".join(entry(f"FSOE__FSoE {who} {w}", k, i, s) for w, k, i, s in rows)


MAILBOX = sync_manager(0x1000, 256, 0x26, 1) + sync_manager(0x1100, 256, 0x22, 2)


def terminal(number: int, order: str, product: int, name: str = "") -> str:
    """A terminal with a module: a frame of 6 bytes each way."""
    inside = MAILBOX + sync_manager(0x1200, 6, 0x24, 3) + sync_manager(0x1900, 6, 0x20, 4)
    inside += pdo("TxPDO", 0x1A00, frame(0x6000, "Slave"), sm=3, output=False)
    inside += pdo("RxPDO", 0x1600, frame(0x7000, "Master"), sm=2, output=True)
    inside += (
        '<Slot><Module Class="190"><Name>Module 1 (FSOES)</Name><PdoIndex>6656</PdoIndex>'
        "<PdoIndex>5632</PdoIndex></Module></Slot>"
    )
    return box(number, name or f"Term {number} ({order})", order, product, inside)


def logic(number: int, messages: tuple[int, ...], size: int = 6) -> str:
    """An EL6910 with a message for each alias device, and signals of the standard program."""

    def rows(way: str, index: int) -> str:
        return "".join(
            entry(f"Message_{m} {way}", f"FSOE_{size}", index, n, f"{{{size}}}")
            for n, m in enumerate(messages, 1)
        )

    signals = entry("Standard In Var 1", "BIT", 0x6000, 1) + entry("", "ARRAY [0..6] OF BIT")
    state = entry("Safe Logic State", "USINT", 0xF100, 1) + entry(
        "Cycle Counter", "USINT", 0xF100, 2
    )
    bytes_ = size * len(messages)
    inside = MAILBOX + sync_manager(0x1200, bytes_ + 1, 0x64, 3)
    inside += sync_manager(0x1D00, bytes_ + 2, 0x20, 4)
    inside += pdo("ConnectionInputs", 0x1A00, rows("TxPDO", 0x7000), sm=3, output=False)
    inside += pdo("ConnectionOutputs", 0x1600, rows("RxPDO", 0x6000), sm=2, output=True)
    inside += pdo("StandardOutputs", 0x17F0, signals, sm=2, output=True)
    inside += pdo("FSLOGIC Inputs", 0x1BFF, state, sm=3, output=False)
    return box(number, f"Term {number} (EL6910)", "EL6910", 0x1AFE3052, inside)


def link(message: int, one: str, two: str, *, turned: bool = False) -> str:
    """Both links of a message, as TwinCAT writes them below the owner of the terminal."""
    tx, rx = (
        f"ConnectionInputs^Message_{message} TxPDO",
        f"ConnectionOutputs^Message_{message} RxPDO",
    )
    outputs, inputs = "Module 1 (FSOES)^RxPDO^FSOE", "Module 1 (FSOES)^TxPDO^FSOE"
    rows = [(f"{one}^{tx}", outputs), (f"{one}^{rx}", inputs)]
    if turned:
        rows = [(f"{two}^{outputs}", tx), (f"{two}^{inputs}", rx)]
        two = one
    links = "".join(f'<Link VarA="{a}" VarB="{b}"/>\n' for a, b in rows)
    owner = f'<OwnerB Name="TIID^{MASTER}^{two}">\n{links}</OwnerB>'
    return f'<OwnerA Name="TIID^{MASTER}">{owner}</OwnerA>\n'


def project(boxes: str, mappings: str, *, safety: str = "", more: str = "") -> str:
    listed = f'<Safety><Project Name="S" PrjFilePath="{safety}"/></Safety>' if safety else ""
    return (
        '<?xml version="1.0"?>\n<TcSmProject TcSmVersion="1.0">\n'
        f"{FSOE_TYPES}<Project>{listed}<Io>\n"
        f'<Device Id="1" DevType="111"><Name>{MASTER}</Name>\n{boxes}<EtherCAT/></Device>\n{more}'
        f"</Io></Project>\n<Mappings>\n{mappings}</Mappings></TcSmProject>\n"
    )


def alias(number: int, address: int, connection: int, watchdog: int, mode: str = "master") -> str:
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<SafetyDeviceDesc>\n<AliasDeviceType>'
        f"<Type>4</Type><SubType>190</SubType><VendorId>2</VendorId></AliasDeviceType>\n<SDSID>{number}</SDSID>\n"
        f"<SafetyAliasDevice>\n<ConnectionId>{connection}</ConnectionId>\n"
        f"<ConnectionMode>{mode}</ConnectionMode><ConnectionType>FSoE</ConnectionType>\n"
        f"<SafeAddress>{address}</SafeAddress>\n<Watchdog>{watchdog}</Watchdog>\n"
        "</SafetyAliasDevice></SafetyDeviceDesc>\n"
    )


def standard_alias(number: int) -> str:
    return f"<SafetyDeviceDesc><SDSID>{number}</SDSID><StandardAliasDevice/></SafetyDeviceDesc>\n"


COUPLER = "Term 1 (EK1100)"


def machine(*, turned: bool = False, safety: str = "Safe\\Safe.splcproj") -> str:
    """A coupler, a logic, an EL1904, an EL2904 and an end terminal, which is no SubDevice."""
    end = '<Box Id="9"><Name>Term 9 (EL9011)</Name><EtherCAT Desc="EL9011"/></Box>\n'
    inside = logic(2, (3, 7)) + terminal(3, "EL1904", 0x07703052)
    inside += terminal(4, "EL2904", 0x0B583052) + end
    boxes = box(1, COUPLER, "EK1100", 0x044C2C52, more=inside)
    brain = f"{COUPLER}^Term 2 (EL6910)"
    mappings = link(3, brain, f"{COUPLER}^Term 3 (EL1904)", turned=turned)
    mappings += link(7, brain, f"{COUPLER}^Term 4 (EL2904)")
    mappings += (
        f'<OwnerA Name="TIPC^Plc^Plc Instance"><OwnerB Name="TIID^{MASTER}^{brain}">'
        '<Link VarA="PlcTask Outputs^MAIN.restart" VarB="StandardOutputs^Standard In Var 1"/>'
        "</OwnerB></OwnerA>\n"
    )
    return project(boxes, mappings, safety=safety)


def write(folder: Path, *, turned: bool = False) -> Path:
    """Write the machine with its safety project; return the .tsproj."""
    devices = folder / "Safe" / "Group1" / "Alias Devices"
    devices.mkdir(parents=True)
    files = {
        "Term 3 (EL1904) - Module 1 (FSOES).sds": alias(3, 5, 11, 120),
        "Term 4 (EL2904) - Module 1 (FSOES).sds": alias(7, 6, 12, 140),
        "Restart.sds": standard_alias(1),
    }
    for name, text in files.items():
        (devices / name).write_text(text, "utf-8")
    (devices / "bak").mkdir()
    (devices / "bak" / "old.sds").write_text(alias(3, 99, 99, 99), "utf-8")
    (folder / "Safe" / "Group1" / "Group1.sal").write_text("<safetyApplication/>\n", "utf-8")
    (folder / "Safe" / "Safe.splcproj").write_text(
        "<Project><PropertyGroup><TargetSystem>EL6910</TargetSystem></PropertyGroup></Project>\n",
        "utf-8",
    )
    (folder / "Safe" / "TargetSystemConfig.xml").write_text(
        "<TargetSystemConfig><TargetSystemSubType>EL6910</TargetSystemSubType>"
        "<TargetSystemObjectName>Term 2 (EL6910)</TargetSystemObjectName>"
        "<FSOEAddress>1</FSOEAddress></TargetSystemConfig>\n",
        "utf-8",
    )
    path = folder / "machine.tsproj"
    path.write_text(machine(turned=turned), "utf-8")
    return path
