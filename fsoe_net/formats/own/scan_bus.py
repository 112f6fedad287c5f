"""A scan as a description: SubDevices in ring order, and FSoE data reported by devices."""

from __future__ import annotations

from collections.abc import Mapping

from fsoe_net.model.bus import Device, Direction, SyncManager
from fsoe_net.model.description import DescribedConnection, DescribedSubDevice, Description
from fsoe_net.model.scan import Scan, ScannedSm, ScannedSubDevice


def describe_scan(scan: Scan, path: str) -> Description:
    """Return the content of a scan.

    A connection reported by a MainInstance names its SubInstance by FSoE address; it is omitted
    unless exactly one other SubDevice has that address.

    Args:
        scan: The scan.
        path: Its file or interface, for comments.
    """
    subs = tuple(_subdevice(s, path) for s in scan.subdevices)
    owners: dict[int | None, list[int]] = {}  # positions by FSoE address
    for sub in scan.subdevices:
        for address in dict.fromkeys(() if sub.fsoe is None else sub.fsoe.addresses):
            owners.setdefault(address, []).append(sub.position)
    return Description(
        span=scan.span,
        format="scan",
        path=path,
        subdevices=subs,
        connections=tuple(c for s in scan.subdevices for c in _connections(s, owners)),
    )


def _subdevice(sub: ScannedSubDevice, path: str) -> DescribedSubDevice:
    half = [s for s in sub.process_data if not _is_whole(s)]
    notes = (*sub.remarks, *(f"SM{s.index} was not read completely" for s in half))
    # An unknown length of one sync manager would move copies, so no layout is given.
    managers = sub.sms or () if not half else ()
    return DescribedSubDevice(
        span=sub.span,
        fields=sub.fields,
        # The SII has the order number and a description as one name.
        name=sub.planned or sub.name.split(" ")[0],
        order=sub.name.split(" ")[0],
        position=sub.position,
        device=Device(
            span=sub.span,
            path=path,
            vendor_id=sub.vendor_id or 0,
            product_code=sub.product_code or 0,
            sync_managers=tuple(described_manager(s) for s in managers),
        ),
        revision=sub.revision,
        serial=sub.serial,
        fsoe_address=None if sub.fsoe is None or len(sub.fsoe.addresses) > 1 else sub.fsoe.address,
        notes=notes,
    )


def _is_whole(sm: ScannedSm) -> bool:
    known = all(p.is_read for p in sm.pdos or ())
    return bool(sm.pdos) and known and sm.complete


def described_manager(sm: ScannedSm) -> SyncManager:
    """Return a sync manager with its PDOs."""
    out = sm.kind in ("outputs", "mailbox_out")
    return SyncManager(
        span=sm.span,
        index=sm.index,
        direction=Direction.OUTPUT if out else Direction.INPUT,
        pdos=sm.pdos or () if sm.is_process_data else (),
        start_byte=sm.start_byte,
    )


def _connections(
    sub: ScannedSubDevice, owners: Mapping[int | None, list[int]]
) -> list[DescribedConnection]:
    if sub.fsoe is None:
        return []
    found = []
    # Objects of connections are numbered in the order of the slots.
    rows = sorted(sub.fsoe.connections, key=lambda c: c.object_index)
    for slot, row in enumerate(rows):
        ends = [position for position in owners.get(row.address, ()) if position != sub.position]
        if row.address is None or len(ends) != 1:
            continue
        found.append(
            DescribedConnection(
                span=row.span,
                fields=row.fields,
                main=sub.position,
                sub=ends[0],
                slot=slot,
                address=row.address,
                connection_id=row.connection_id,
                watchdog_ms=row.watchdog_ms,
            )
        )
    return found
