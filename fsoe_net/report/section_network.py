"""Blocks 3 and 4: the SubDevices on the bus, and their FSoE connections."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

from fsoe_net.diag.words import counted, listed, noun
from fsoe_net.document.model import (
    BLANK,
    Bullets,
    Cell,
    Column,
    Heading,
    Item,
    Level,
    Number,
    Paragraph,
    Part,
    Picture,
    Table,
    Text,
    Verdict,
    cell,
    code,
    muted,
    number_of,
    stated,
    strong,
)
from fsoe_net.formats.own.library import builtin_library
from fsoe_net.fsoe.crc import sra_crc
from fsoe_net.fsoe.pdu import safe_data_length
from fsoe_net.model.bus import Device, SubDevice
from fsoe_net.model.library import Library
from fsoe_net.model.network import MOST_COMBINATIONS, Bus, NetworkConfig
from fsoe_net.model.resolve import Connection
from fsoe_net.model.scan import ScannedSubDevice
from fsoe_net.model.test_record import DeviceEntry
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.report.model import Point, ReportSection, assumption, open_point
from fsoe_net.report.svg import topology_picture

_READ = {
    "firmware": "firmware",
    "serial": "serial number",
    "safety_project_crc": "CRC of the safety project",
}
_FACTS = "connections of the network file"
_NET = "network files"
_LAYOUT = "process data of the slave configs"
_MOST_PLAIN = 60
_ADDRESS_MOST = 65534
_ID_MOST = 65535


def architecture(inputs: ReportInputs) -> ReportSection:
    """Return the topology, and every SubDevice with its identity and its role in FSoE."""
    resolution = inputs.resolution
    if resolution is None:
        return ReportSection(key="architecture", title="Architecture", parts=(_nothing(),))
    network = resolution.network
    mains = {c.main.name for c in resolution.connections}
    subs = {c.sub.name for c in resolution.connections}
    parts: list[Part] = []
    if inputs.plan is not None:
        buses = f"{len(network.buses)} buses" if network.buses else "the bus"
        words = (
            f"{counted(len(network.subdevices), 'SubDevice')} on {buses}, "
            f"{counted(len(resolution.connections), 'FSoE connection')} between them"
        )
        parts.append(
            Picture(
                title="Topology",
                words=words,
                svg=topology_picture(inputs.plan),
                narrow=topology_picture(inputs.plan, per_row=2),
            )
        )
    # In a large network only SubDevices with FSoE are listed; all others are counted.
    shown = [s for s in network.subdevices if s.name in mains | subs]
    if len(network.subdevices) <= _MOST_PLAIN:
        shown = list(network.subdevices)
    entries = _entries(inputs, mains, subs)
    parts += [Heading("SubDevices"), _subdevices(shown, inputs, mains, subs)]
    parts += _groups(network)
    points = []
    for key, word in _READ.items():
        names = [e.subdevice for e in entries if key in e.blank()]
        if names:
            words = f"{word} to be read at the device: {listed(names)}"
            points.append(open_point(words))
    return ReportSection(
        key="architecture", title="Architecture", parts=tuple(parts), points=tuple(points)
    )


def _groups(network: NetworkConfig) -> list[Part]:
    """Return the SubDevices that may be absent, and those that may be present together."""
    if not network.groups:
        return []
    rows = tuple(
        (
            cell(strong(g.name)),
            cell(g.place or muted("no alternatives")),
            cell(", ".join(g.subdevices)),
        )
        for g in network.groups
    )
    found = network.combinations()
    # The number of combinations grows exponentially and is limited.
    more = "; further ones are not listed" if len(found) == MOST_COMBINATIONS else ""
    return [
        Heading("Groups that may be absent"),
        Table(
            name="groups",
            columns=(Column("Group"), Column("Place"), Column("SubDevices")),
            rows=rows,
            remark="Groups of one place are never there together. While one is absent, its "
            "connections are not in Data, which is not a fault.",
        ),
        Heading("Combinations"),
        Bullets(tuple((Text(", ".join(names) or "none of them"),) for names in found)),
        *([Paragraph((Text(f"The first {len(found)}{more}."),))] if more else []),
    ]


def _entries(inputs: ReportInputs, mains: set[str], subs: set[str]) -> list[DeviceEntry]:
    """Return the data read by people at each SubDevice with an FSoE end, in bus order."""
    resolution, tried = inputs.resolution, inputs.tried
    if resolution is None:
        return []
    devices = () if tried is None or not tried.fits else tried.test_record.devices
    read = {d.subdevice: d for d in devices}
    names = dict.fromkeys(s.name for s in resolution.network.subdevices)
    # SubDevices without an FSoE end have no data to read; only a MainInstance has a project CRC.
    blank = {
        name: DeviceEntry(subdevice=name, safety_project_crc="" if name in mains else None)
        for name in names
        if name in mains | subs
    }
    return [read.get(name, entry) for name, entry in blank.items()]


def _by_hand(entry: DeviceEntry | None) -> tuple[Cell, ...]:
    """Return the data read by people at a SubDevice; none without an FSoE end."""
    if entry is None:
        return ((), (), ())
    blank = set(entry.blank())
    row = []
    for key in _READ:
        text = getattr(entry, key)
        if text is None:
            row.append(cell(muted("no MainInstance")))
        else:
            row.append(BLANK if key in blank else cell(text))
    return tuple(row)


def _observed(inputs: ReportInputs) -> dict[str, ScannedSubDevice]:
    """Return the scanned devices at the position of each SubDevice, by its name."""
    scans = [e.scan for e in inputs.evidence if e.scan is not None]
    return {s.planned or s.name: s for scan in scans for s in scan.subdevices}


def _seen(value: int | None) -> Cell:
    if value is None:
        return ()
    number = Number(value=value, text=f"0x{value:08x}", unit="", source="scan")
    return cell(muted("observed"), number)


def _nothing() -> Paragraph:
    return Paragraph((Text("No network could be read; the findings say why."),))


def _subdevices(
    shown: Sequence[SubDevice], inputs: ReportInputs, mains: set[str], subs: set[str]
) -> Table:
    observed = _observed(inputs)
    entries = {e.subdevice: e for e in _entries(inputs, mains, subs)}
    library = builtin_library(frozenset(s.device.product_code for s in shown if s.device))
    rows = []
    buses = () if inputs.resolution is None else inputs.resolution.network.buses
    for s in shown:
        parts = [
            w for w, names in (("MainInstance", mains), ("SubInstance", subs)) if s.name in names
        ]
        device = s.device
        vendor: Item = Verdict("not stated", Level.OPEN)
        product: Cell = (vendor,)
        if device is not None:
            vendor = _identity(device.vendor_id)
            product = (_identity(device.product_code), *_type_name(device, library))
        # Without a revision each one is accepted at the start.
        revision = cell(muted("any")) if s.revision is None else (_identity(s.revision),)
        found = observed.get(s.name)
        firmware, serial, project = _by_hand(entries.get(s.name))
        rows.append(
            (
                _place(s, buses),
                cell(strong(s.name), " and ".join(parts) or muted("no FSoE")),
                (vendor, *product),
                (*revision, *_seen(None if found is None else found.revision)),
                firmware,
                (*serial, *_seen(None if found is None else found.serial)),
                project,
            )
        )
    every = () if inputs.resolution is None else inputs.resolution.network.subdevices
    hidden = len(every) - len(shown)
    return Table(
        name="subdevices",
        columns=(
            Column("Position", share=9),
            Column("SubDevice", share=20),
            Column("Vendor, product", share=18),
            Column("Revision accepted", share=13),
            Column("Firmware", share=13),
            Column("Serial number", share=14),
            Column("CRC of the safety project", share=13),
        ),
        rows=tuple(rows),
        remark="Firmware, serial number and CRC are read at the device and written by hand; "
        "observed: read over the bus by a scan."
        + (f" {hidden} SubDevices without FSoE are not listed." if hidden else ""),
    )


def _place(s: SubDevice, buses: Sequence[Bus]) -> Cell:
    place: list[Item] = [Number(value=s.position, text=str(s.position), unit="", source=_NET)]
    if buses:
        place.append(muted(f"bus {buses[s.master_id].name}"))
    if s.alias:
        place.append(Number(value=s.alias, text=f"alias {s.alias}", unit="", source=_NET))
    return tuple(place)


def _type_name(device: Device, library: Library) -> Cell:
    """Return the name of a type in the device library; empty if unknown."""
    known = library.find(*device.identity)
    return () if known is None else (muted(f"library: {known.name}"),)


def _identity(value: int) -> Number:
    return Number(value=value, text=f"0x{value:08x}", unit="", source="slave configs")


# -- connections ----------------------------------------------------------------------------------


def connections(inputs: ReportInputs) -> ReportSection:
    """Return every connection with its facts and the verdicts on their uniqueness."""
    rows = () if inputs.resolution is None else inputs.resolution.connections
    title = "FSoE connections"
    if not rows:
        return ReportSection(
            key="connections",
            title=title,
            parts=(Paragraph((Text("No FSoE connection resolves."),)),),
            points=(open_point("there is no FSoE connection to judge"),),
        )
    points: list[Point] = []
    # Addresses belong to SubInstances, connection IDs to connections: they are unique in different
    # sets.
    owners = _owners(rows, lambda c: c.stated.address, by_sub=True)
    ids = _owners(rows, lambda c: c.stated.connection_id, by_sub=False)
    for c in rows:
        points += _open_facts(c)
    parts: tuple[Part, ...] = (
        Table(
            name="connections",
            columns=(
                Column("Connection"),
                Column("From MainInstance to SubInstance"),
                Column("ConnID", number=True),
                Column("FSoE address", number=True),
                Column("Watchdog", number=True),
                Column("Safe data", number=True),
                Column("Frames", number=True),
                Column("Parameters"),
            ),
            rows=tuple(_row(c) for c in rows),
        ),
        Heading("Uniqueness and ranges"),
        Table(
            name="uniqueness",
            columns=(Column("Connection"), Column("ConnID"), Column("FSoE address")),
            rows=tuple(
                (
                    cell(strong(c.name)),
                    cell(_unique(c.stated.connection_id, ids, _ID_MOST)),
                    cell(_unique(c.stated.address, owners, _ADDRESS_MOST)),
                )
                for c in rows
            ),
            remark="Judged over the whole bus, with all MainInstances on it. Addresses go from 1 "
            f"to {_ADDRESS_MOST}, connection IDs from 1 to {_ID_MOST}. A SubDevice keeps its "
            "address in all of its connections.",
        ),
    )
    points.append(
        assumption(
            "connection IDs, addresses, watchdogs and parameters are as the network file states "
            "them; the devices and the safety project have to hold the same"
        )
    )
    return ReportSection(key="connections", title=title, parts=parts, points=tuple(points))


def _owners(
    rows: Sequence[Connection], value_of: Callable[[Connection], int | None], *, by_sub: bool
) -> Counter[int]:
    """Count connections or SubDevices with a value."""
    pairs = {
        (value, c.sub.name if by_sub else c.name)
        for c in rows
        if (value := value_of(c)) is not None
    }
    return Counter(value for value, _ in pairs)


def _unique(value: int | None, owners: Counter[int], most: int) -> Verdict:
    if value is None:
        return Verdict("not judged: not stated", Level.OPEN)
    if not 1 <= value <= most:
        return Verdict("out of range", Level.ERROR)
    if owners[value] > 1:
        return Verdict(f"used {owners[value]} times", Level.ERROR)
    return Verdict("once on the bus, in range", Level.CLEAR)


def _open_facts(c: Connection) -> list[Point]:
    facts = c.stated
    missing = [
        what
        for what, value in (
            ("connection ID", facts.connection_id),
            ("FSoE address", facts.address),
            ("watchdog", facts.watchdog_ms),
        )
        if value is None
    ]
    points = []
    if missing:
        words = f"{c.name}: {', '.join(missing)} not stated"
        points.append(open_point(words))
    if facts.unconfirmed is not None:
        reason = f": {facts.unconfirmed}" if facts.unconfirmed else ""
        points.append(open_point(f"{c.name} is unconfirmed{reason}"))
    return points


def _row(c: Connection) -> tuple[Cell, ...]:
    facts = c.stated
    address = facts.address
    frames = (c.to_sub.transfer.size_bytes, c.to_main.transfer.size_bytes)
    return (
        cell(strong(c.name), muted(f"net {c.net.name}")),
        cell(c.main.name, f"→ {c.sub.name}"),
        cell(stated(facts.connection_id, "", _FACTS)),
        cell(
            stated(address, "", _FACTS, "" if address is None else f"{address} (0x{address:04x})")
        ),
        cell(stated(facts.watchdog_ms, "ms", _FACTS)),
        tuple(
            Number(value=n, text=str(n), unit=_bytes_to(n, to), source=_LAYOUT)
            for n, to in ((_safe_bytes(frames[0]), "sub"), (_safe_bytes(frames[1]), "main"))
        ),
        tuple(
            Number(value=n, text=str(n), unit=f"bytes to {to}", source=_LAYOUT)
            for n, to in ((frames[0], "sub"), (frames[1], "main"))
        ),
        _parameters(facts.app_parameters),
    )


def _bytes_to(number: int, end: str) -> str:
    return f"{noun(number, 'byte')} to {end}"


def _safe_bytes(frame_bytes: int) -> int:
    try:
        return safe_data_length(frame_bytes)
    # A different length has its own finding.
    except ValueError:
        return 0


_SHOWN_BYTES = 16


def _parameters(parameters: bytes) -> Cell:
    if not parameters:
        return cell(muted("none stated"))
    return cell(
        number_of(len(parameters), "byte", _FACTS),
        code(parameters[:_SHOWN_BYTES].hex(" ") + " …" * (len(parameters) > _SHOWN_BYTES)),
        _sra(parameters),
    )


def _sra(parameters: bytes) -> Item:
    """Return whether they begin with the SRA CRC of the rest (§12); an odd rest may be padded."""
    stated_crc = int.from_bytes(parameters[:4], "little")
    rest = parameters[4:]
    crcs = {sra_crc(rest), sra_crc(rest + bytes(len(rest) % 2))}
    if rest and stated_crc in crcs:
        return Text(f"begin with their SRA CRC 0x{stated_crc:08x}")
    return muted("do not begin with an SRA CRC of the rest")
