"""Converts a network to a description, the input of the writers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from fsoe_net.errors import InputError
from fsoe_net.model.description import (
    DescribedConnection,
    DescribedCopy,
    DescribedEnd,
    DescribedSubDevice,
    Description,
)
from fsoe_net.model.network import ConnectionFacts, NetworkConfig, TransferKind
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.model.transfer_ends import ResolvedEnd


def describe(network: NetworkConfig) -> Description:
    """Return the description of a network, with a copy for each of its transfers.

    Raises:
        InputError: The network has several buses, masters or groups; a SubDevice has no device
            description; a transfer does not resolve; or a connection is unconfirmed or has no
            frames.
    """
    # Rejected instead of omitted: a file without the groups would look complete.
    if network.groups:
        raise InputError(
            f"{network.at('groups')}: this network has groups that may be absent, and no other "
            "format holds them; write a network file for each combination"
        )
    if network.buses:
        raise InputError(
            f"{network.at('buses')}: this network has {len(network.buses)} buses, and no other "
            "format holds more than one; write a network file for each bus"
        )
    _refuse_several_masters(network)
    rows = []
    for sub in network.subdevices:
        if sub.device is None:
            raise InputError(f"{sub.name}: its slave config could not be read; check the network")
        rows.append(
            DescribedSubDevice(
                span=sub.span,
                name=sub.name,
                # A position relative to an alias has no meaning in other formats.
                position=sub.position if not sub.alias else None,
                alias=sub.alias,
                device=sub.device,
                components=sub.components,
                plugin=sub.plugin,
            )
        )
    resolution = resolve(network)
    # A connection that was not expanded has no transfers, so they would be missing in the file.
    for trouble in resolution.troubles:
        place = trouble.facts.span
        raise InputError(f"{place}: {trouble.obstacle.value}; run fsoe-net check first")
    for net in resolution.network.nets:
        for stated in net.connections:
            if stated.unconfirmed is not None:  # no other format can express it
                raise InputError(
                    f"{stated.at('unconfirmed')}: the connection {stated.main}-{stated.sub} is "
                    "marked unconfirmed; compare it with the safety project first"
                )
    numbers = resolution.numbers
    copies = []
    for transfer in resolution.transfers:
        if not transfer.usable:
            ends = f"{transfer.transfer.source} to {transfer.transfer.destination}"
            raise InputError(f"the transfer from {ends} means no bytes; run fsoe-net check first")
        copies.append(
            DescribedCopy(
                span=transfer.transfer.span,
                source=_end(transfer.source, numbers),
                destination=_end(transfer.destination, numbers),
                bits=8 * transfer.transfer.size_bytes,
                fsoe=transfer.transfer.kind is TransferKind.FSOE,
                name=transfer.net.name,
            )
        )
    return Description(
        span=network.span,
        format="network",
        path=network.span.file,
        subdevices=tuple(rows),
        copies=tuple(copies),
        connections=described_connections(resolution),
        cycle_us=None if network.cycle_ns is None else network.cycle_ns // 1000,
    )


def _refuse_several_masters(network: NetworkConfig) -> None:
    """Reject several masters, because each master has its own ring."""
    names: dict[int, list[str]] = {}
    for sub in network.subdevices:
        row = names.setdefault(sub.master_id, [str(sub.master_id)])
        if sub.system not in ("", *row):
            row.append(sub.system)
    if len(names) > 1:
        known = ", ".join(" or ".join(row) for row in names.values())
        raise InputError(
            f"{network.span}: the SubDevices of {len(names)} EtherCAT masters are not one bus; "
            f"choose one with --master: {known}"
        )


def described_connections(resolution: Resolution) -> tuple[DescribedConnection, ...]:
    """Return the connections of a network with the facts stated in its files."""
    return tuple(
        replace(
            described_facts(c.stated, c.name),
            main=resolution.numbers[c.main.name],
            sub=resolution.numbers[c.sub.name],
            slot=c.slot,
        )
        for c in resolution.connections
    )


def described_facts(facts: ConnectionFacts, name: str) -> DescribedConnection:
    """Return stated facts under a name, without the SubDevices that they are about."""
    return DescribedConnection(
        name=name,
        slot=facts.slot,
        address=facts.address,
        connection_id=facts.connection_id,
        watchdog_ms=facts.watchdog_ms,
        app_parameters=facts.app_parameters,
    )


def _end(end: ResolvedEnd, numbers: Mapping[str, int]) -> DescribedEnd:
    return DescribedEnd(
        span=end.endpoint.span,
        subdevice=numbers[end.endpoint.module],
        sm_index=-1 if end.sm is None else end.sm.sm.index,
        bit_offset=8 * end.byte_offset,
    )
