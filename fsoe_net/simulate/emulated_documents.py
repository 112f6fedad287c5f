"""State of a session on the emulated bus, as the documents that `fsn-master` writes.

The keys are those of the requests ``snapshot`` and ``layout`` (``docs/reference``); values that an
emulated run does not have are ``null`` or omitted. `fsoe_net.core.bus_documents` reads them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields
from typing import Any

from fsoe_net.core.bus_documents import Found
from fsoe_net.core.core import Core, CorePlan
from fsoe_net.core.snapshot import DirectionSnapshot, Histogram, Snapshot, Statistics
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.pdu import command_text, reset_code_text
from fsoe_net.fsoe.sub_instance import SubInstance
from fsoe_net.plan.image import igh_image
from fsoe_net.plan.model import Plan, PlanCopy
from fsoe_net.simulate.bus import EmulatedDevices


def snapshot_json(snapshot: Snapshot, plan: Plan) -> dict[str, Any]:
    """Return ``statistics`` and ``connections``."""
    statistics = _counters(snapshot.statistics)
    for name, histogram in snapshot.statistics.histograms.items():
        statistics[name] = _histogram(histogram)
    connections = [
        {
            "name": row.name,
            "net": row.net,
            "main": plan.subdevices[row.main].name,
            "sub": plan.subdevices[row.sub].name,
            "observed_state": list(ConnectionState).index(seen.state),
            "state": seen.state.event_word,
            "gaps": seen.gaps,
            "configured": row.parameters.to_json(),
            "observed": seen.observed.to_json(),
            "differs": list(seen.differs),
            "to_sub": _direction(seen.to_sub),
            "to_main": _direction(seen.to_main),
        }
        for row, seen in zip(plan.connections, snapshot.connections, strict=True)
    ]
    return {"statistics": statistics, "connections": connections}


def _counters(row: Statistics | DirectionSnapshot | Histogram) -> dict[str, Any]:
    return {f.name: getattr(row, f.name) for f in fields(row)}


def _histogram(h: Histogram) -> dict[str, Any]:
    row = _counters(h)
    percentiles = {name: row.pop(f"{name}_ns") for name in ("p50", "p99", "p999")}
    return row | {"percentiles_ns": percentiles, "buckets": [list(b) for b in h.buckets]}


def _direction(d: DirectionSnapshot) -> dict[str, Any]:
    return _counters(d) | {
        "command_text": command_text(d.command) if d.command else "",
        "reset_text": reset_code_text(d.reset_code) if d.has_reset else "",
    }


def layout_json(core: Core, core_plan: CorePlan, plan: Plan, image_bytes: int) -> dict[str, Any]:
    """Return ``layout``: the layout of the process image."""
    sms = []
    for number, sm in enumerate(plan.sync_managers):
        base = core.sm_base(number)
        # Absent or without process data: fsn-master also omits it.
        if base is None or not core_plan.sm_sizes[number]:
            continue
        sms.append(
            {
                "subdevice": plan.subdevices[sm.subdevice].name,
                "sm": sm.index,
                "direction": "output" if sm.is_output else "input",
                "byte": base,
                "bytes": sm.size_bytes,
            }
        )

    def area(copy: PlanCopy) -> dict[str, int]:
        return {
            "source_byte": (core.sm_base(copy.source_sm) or 0) + copy.source_bit // 8,
            "destination_byte": (core.sm_base(copy.destination_sm) or 0)
            + copy.destination_bit // 8,
            "bytes": copy.size_bytes,
        }

    connections = [
        {
            "name": c.name,
            "main": plan.subdevices[c.main].name,
            "sub": plan.subdevices[c.sub].name,
            "address": c.address,
            "connection_id": c.connection_id,
            "watchdog_ms": c.watchdog_ms,
            "to_sub": area(plan.copies[c.copy_to_sub]),
            "to_main": area(plan.copies[c.copy_to_main]),
        }
        for c in plan.connections
    ]
    return {
        "image_bytes": image_bytes,
        "sms": sms,
        "datagrams": [
            {"byte": d.offset_bytes, "bytes": d.size_bytes, "expected_wkc": d.working_counter}
            for d in igh_image(plan).datagrams
        ],
        "copies": [area(c) for c in plan.copies],
        "connections": connections,
    }


def subdevices_json(
    core: Core, plan: Plan, absent: Collection[str], returns: Mapping[str, int]
) -> list[dict[str, Any]]:
    """Return ``subdevices``: on the emulated bus, a SubDevice either answers or not."""
    rows = []
    for number, sub in enumerate(plan.subdevices):
        gone = sub.name in absent
        found = Found.RIGHT
        # Absent by design and missing are different states for every reader.
        if gone:
            found = Found.NOTHING if plan.group_number(number) is None else Found.ABSENT
        sms = range(sub.first_sm, sub.first_sm + sub.sm_count)
        rows.append(
            {
                "number": number,
                "name": sub.name,
                "alias": sub.alias,
                "position": sub.position,
                "known": True,
                "al": "none" if gone else "OP",
                "al_code": None,
                "found": int(found),
                "found_text": found.text,
                "detail": "",
                "vendor_id": sub.vendor_id,
                "product_code": sub.product_code,
                "revision": sub.revision_low,
                "fsoe_address": 0,
                "link_down": False,
                "returns": returns.get(sub.name, 0),
                "link": None,
                "link_lost": None,
                "rx_errors": None,
                "stale_cycles": sum(core.stale_cycles(sm) for sm in sms),
            }
        )
    return rows


def fsoe_json(network: EmulatedDevices) -> list[dict[str, Any]]:
    """Return ``fsoe``: the report of the devices about their FSoE ends over CoE."""
    rows = []
    for device in network.devices.values():
        if not device.ports:
            continue
        # Only devices with an FSoE end have these objects.
        subs = [p for p in device.ports if isinstance(p.instance, SubInstance)]
        mains = [p for p in device.ports if p.is_main]
        rows.append(
            {
                "subdevice": device.name,
                "address": subs[0].instance.config.address if subs else None,
                "connections": [
                    {
                        "object": 0xE901 + 0x10 * number,
                        "address": p.instance.config.address,
                        "connection_id": p.setup.main.connection_id,
                        "watchdog_ms": p.setup.main.watchdog_ms,
                    }
                    for number, p in enumerate(mains)
                ],
            }
        )
    return rows
