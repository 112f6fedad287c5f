"""What a network consists of, for programs: SubDevices, FSoE connections, transfers."""

from __future__ import annotations

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.network import Endpoint, NetworkConfig, TransferKind
from fsoe_net.model.resolve import Connection, Resolution


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkSubDevice:
    """One SubDevice as the files state it.

    Attributes:
        name: Its name, unique in the network.
        bus: Name of its bus; empty if the network has one bus.
        alias: Station alias, 0 for none.
        position: Position on the bus from 0, or counted from the SubDevice with the alias.
        vendor_id: Vendor, or ``None`` if its device file could not be read.
        product_code: Product, or ``None`` likewise.
        frame_pairs: Number of FSoE frame pairs in its process data.
        group: Name of its group if it may be absent, otherwise empty.
    """

    name: str
    bus: str
    alias: int
    position: int
    vendor_id: int | None
    product_code: int | None
    frame_pairs: int
    group: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkConnection:
    """One FSoE connection; ``None`` for each fact that the files do not state.

    Attributes:
        name: Its name in plans, runs and reports.
        net: Name of its net.
        main: SubDevice with the MainInstance.
        sub: SubDevice with the SubInstance.
        slot: Frame pair of ``main``, from 0.
        address: FSoE address of the SubInstance.
        connection_id: Connection ID.
        watchdog_ms: FSoE watchdog, ms.
        is_confirmed: Whether a person compared it with the safety project (no ``unconfirmed``).
    """

    name: str
    net: str
    main: str
    sub: str
    slot: int | None
    address: int | None
    connection_id: int | None
    watchdog_ms: int | None
    is_confirmed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkTransfer:
    """One copy of every bus cycle.

    Attributes:
        net: Name of its net.
        size_bytes: Bytes copied.
        source: SubDevice whose inputs are copied.
        source_entry: Index and subindex of the first entry there.
        destination: SubDevice whose outputs are written.
        destination_entry: Index and subindex of the first entry there.
        is_fsoe: Whether it is an FSoE frame; otherwise ordinary process data.
    """

    net: str
    size_bytes: int
    source: str
    source_entry: tuple[int, int]
    destination: str
    destination_entry: tuple[int, int]
    is_fsoe: bool


def subdevices_of(network: NetworkConfig) -> tuple[NetworkSubDevice, ...]:
    """Return the SubDevices in the order of the process image."""
    return tuple(_subdevice(network, sub) for sub in network.subdevices)


def connections_of(resolution: Resolution) -> tuple[NetworkConnection, ...]:
    """Return the FSoE connections in the order of the plan."""
    return tuple(map(_connection, resolution.connections))


def transfers_of(resolution: Resolution) -> tuple[NetworkTransfer, ...]:
    """Return the transfers, those that are made from connections included."""
    return tuple(
        NetworkTransfer(
            net=row.net.name,
            size_bytes=row.transfer.size_bytes,
            source=row.transfer.source.module,
            source_entry=_entry(row.transfer.source),
            destination=row.transfer.destination.module,
            destination_entry=_entry(row.transfer.destination),
            is_fsoe=row.transfer.kind is TransferKind.FSOE,
        )
        for row in resolution.transfers
    )


def _entry(end: Endpoint) -> tuple[int, int]:
    return end.index, end.subindex


def _subdevice(network: NetworkConfig, sub: SubDevice) -> NetworkSubDevice:
    group = network.group_of(sub.name)
    layout = sub.layout
    return NetworkSubDevice(
        name=sub.name,
        bus=network.buses[sub.master_id].name if network.buses else "",
        alias=sub.alias,
        position=sub.position,
        vendor_id=None if sub.device is None else sub.device.vendor_id,
        product_code=None if sub.device is None else sub.device.product_code,
        frame_pairs=0 if layout is None else len(layout.frame_pairs),
        group="" if group is None else group.name,
    )


def _connection(row: Connection) -> NetworkConnection:
    facts = row.stated
    return NetworkConnection(
        name=row.name,
        net=row.net.name,
        main=row.main.name,
        sub=row.sub.name,
        slot=row.slot,
        address=facts.address,
        connection_id=facts.connection_id,
        watchdog_ms=facts.watchdog_ms,
        is_confirmed=facts.unconfirmed is None,
    )
