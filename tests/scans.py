"""The scan document a faultless bus would give for a network; tests change it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fsoe_net.model.bus import Direction
from fsoe_net.model.resolve import Resolution

COUPLER = {"vendor_id": 2, "product_code": 0x044C2C52, "name": "EK1100"}


def subdevice(position: int, **keys: Any) -> dict[str, Any]:
    return {
        "position": position,
        "alias": 0,
        "station": 4097 + position,
        "vendor_id": 0,
        "product_code": 0,
        "revision": 1,
        "serial": 0,
        "name": "",
        "al_status": 2,
        "al": "PREOP",
        "al_code": 0,
        "mailbox": ["coe"],
        "dc": True,
        "ports": [
            {"port": 0, "link": True, "link_lost": 0, "rx_errors": 0},
            {"port": 1, "link": True, "link_lost": 0, "rx_errors": 0},
        ],
        "sms": [],
        "fsoe": None,
        "planned": None,
        "problems": [],
    } | keys


def scan_of(resolution: Resolution) -> dict[str, Any]:
    """Return the document of a bus that is as the network says; free places are couplers."""
    network = resolution.network
    count = max(s.position for s in network.subdevices) + 1
    rows = [subdevice(n, **COUPLER) for n in range(count)]
    for sub in network.subdevices:
        device = sub.device
        assert device is not None
        rows[sub.position] = subdevice(
            sub.position,
            alias=sub.alias,
            vendor_id=device.vendor_id,
            product_code=device.product_code,
            name=Path(device.path).stem.upper(),
            sms=[_sm(device, sm) for sm in device.layout.managers if device.pdos_of(sm.sm)],
            fsoe=_fsoe(network, sub.name),
        )
    return {
        "scan": 1,
        "utc": "2026-11-21T12:00:00Z",
        "interface": "eth1",
        "backend": "soem",
        "states_changed": True,
        "subdevices": rows,
    }


def _sm(device: Any, sm: Any) -> dict[str, Any]:
    return {
        "sm": sm.sm.index,
        "kind": "outputs" if sm.sm.direction is Direction.OUTPUT else "inputs",
        "start": 0x1000 + 0x400 * sm.sm.index,
        "bytes": sm.size_bytes,
        "source": "coe",
        "pdos": [
            {
                "index": pdo.index,
                "entries": [
                    {"index": e.index, "subindex": e.subindex, "bits": e.bits} for e in pdo.entries
                ],
            }
            for pdo in device.pdos_of(sm.sm)
        ],
    }


def _fsoe(network: Any, name: str) -> dict[str, Any] | None:
    facts = [f for net in network.nets for f in net.connections]
    address = next((f.address for f in facts if f.sub == name), None)
    rows = [
        {
            "object": 0xE901 + 16 * n,
            "address": f.address,
            "connection_id": f.connection_id,
            "watchdog_ms": f.watchdog_ms,
            "state": 100,
        }
        for n, f in enumerate([f for f in facts if f.main == name])
    ]
    return {"address": address, "connections": rows} if rows or address is not None else None
