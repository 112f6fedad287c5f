"""What a session on the emulated bus knows at the moment of an incident, as `fsn-master` tells it.

The keys are those of the requests ``snapshot`` and ``layout`` (``docs/reference``).
"""

from __future__ import annotations

import base64
from collections.abc import Collection, Mapping
from dataclasses import asdict
from typing import Any

from fsoe_net.core.core import Core, CorePlan
from fsoe_net.core.snapshot import DirectionSnapshot, Histogram, Snapshot
from fsoe_net.emul.bus import EmulatedDevices
from fsoe_net.fsoe.pdu import command_text, reset_code_text
from fsoe_net.fsoe.sub_instance import SubInstance
from fsoe_net.plan.image import igh_image
from fsoe_net.plan.model import Plan, PlanCopy

__all__ = ["fsoe_json", "layout_json", "plan_text", "snapshot_json", "subdevices_json"]

_HISTOGRAMS = ("latency", "period", "work", "copy", "round_trip", "dc_offset")


def plan_text(data: bytes) -> str:
    """Return the bytes of a plan as base64."""
    return base64.b64encode(data).decode("ascii")


def snapshot_json(snapshot: Snapshot, plan: Plan) -> dict[str, Any]:
    """Return ``statistics`` and ``connections``."""
    statistics = asdict(snapshot.statistics)
    for name in _HISTOGRAMS:
        statistics[name] = _histogram(getattr(snapshot.statistics, name))
    connections = [
        {
            "name": row.name,
            "net": row.net,
            "main": plan.subdevices[row.main].name,
            "sub": plan.subdevices[row.sub].name,
            "outside": seen.state.value,
            "state": seen.state.word,
            "gaps": seen.gaps,
            "to_sub": _direction(seen.to_sub),
            "to_main": _direction(seen.to_main),
        }
        for row, seen in zip(plan.connections, snapshot.connections, strict=True)
    ]
    return {"statistics": statistics, "connections": connections}


def _histogram(h: Histogram) -> dict[str, Any]:
    return {
        "count": h.count,
        "sum_ns": h.mean_ns * h.count,
        "min_ns": h.min_ns,
        "max_ns": h.max_ns,
        "percentiles_ns": {"p50": h.p50_ns, "p99": h.p99_ns, "p999": h.p999_ns},
        "buckets": [list(row) for row in h.buckets],
    }


def _direction(d: DirectionSnapshot) -> dict[str, Any]:
    # The snapshot holds the mean only; with one interval more than none it stays right.
    intervals = max(0, d.process_data + d.failsafe_data - 1) if d.cycle_mean_ns else 0
    return {
        "frames": d.frames,
        "process_data": d.process_data,
        "failsafe_data": d.failsafe_data,
        "right": d.right,
        "wrong": d.wrong,
        "unchecked": d.unchecked,
        "resets": d.resets,
        "last_new_ns": d.last_new_ns,
        "interval_last_ns": d.cycle_last_ns,
        "interval_min_ns": d.cycle_min_ns,
        "interval_max_ns": d.cycle_max_ns,
        "interval_sum_ns": d.cycle_mean_ns * intervals,
        "intervals": intervals,
        "connection_id": d.connection_id,
        "command": d.command,
        "command_text": command_text(d.command) if d.command else "",
        "reset_code": d.reset_code,
        "reset_text": reset_code_text(d.reset_code) if d.resets else "",
    }


def layout_json(core: Core, core_plan: CorePlan, plan: Plan, image_bytes: int) -> dict[str, Any]:
    """Return ``layout``: where everything lies in the process image."""
    sms = []
    for number, sm in enumerate(plan.sync_managers):
        base = core.sm_base(number)
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
    plan: Plan, absent: Collection[str], returns: Mapping[str, int]
) -> list[dict[str, Any]]:
    """Return ``subdevices``: on the emulated bus a SubDevice answers or it does not."""
    rows = []
    for number, sub in enumerate(plan.subdevices):
        gone = sub.name in absent
        rows.append(
            {
                "number": number,
                "name": sub.name,
                "alias": sub.alias,
                "position": sub.position,
                "known": True,
                "al": "none" if gone else "OP",
                "al_code": 0,
                "found_text": "does not answer" if gone else "the SubDevice of the plan",
                "detail": "",
                "vendor_id": sub.vendor_id,
                "product_code": sub.product_code,
                "revision": sub.revision_low,
                "returns": returns.get(sub.name, 0),
                "link": [],
                "link_lost": [],
                "rx_errors": [],
                "stale_cycles": 0,
            }
        )
    return rows


def fsoe_json(network: EmulatedDevices) -> list[dict[str, Any]]:
    """Return ``fsoe``: what the devices would tell of their FSoE ends over CoE."""
    rows = []
    for device in network.devices.values():
        if not device.ports:
            continue
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
                        "connection_id": p.setup.connection_id,
                        "watchdog_ms": p.setup.watchdog_ms,
                    }
                    for number, p in enumerate(mains)
                ],
            }
        )
    return rows
