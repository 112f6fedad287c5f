"""A device of the library as text and as a JSON document."""

from __future__ import annotations

from collections.abc import Iterable

from fsoe_net.diag.words import counted
from fsoe_net.document.model import Column, Document, Table, cell, words
from fsoe_net.model.bus import Direction, Entry, Pdo, SyncManager
from fsoe_net.model.library import LibraryDevice, LibraryMapping


def device_list(devices: Iterable[LibraryDevice]) -> Document:
    """Return a row for each device, with the lengths of its frames."""
    columns = (
        Column("device"),
        Column("roles", rank=2),
        Column("frames", rank=1),
        Column("", wraps=True),
    )
    rows = []
    for d in devices:
        sizes = ", ".join(dict.fromkeys(_sizes(m) for m in d.mappings))
        texts = (d.name, "/".join(d.roles), sizes or "by project", d.about)
        rows.append(tuple(cell(text) for text in texts))
    head = words("frame bytes: MainDevice to device / device to MainDevice")
    return Document(lead=(head, Table(name="devices", columns=columns, rows=tuple(rows))))


def _sizes(mapping: LibraryMapping) -> str:
    """Return ``6/7``, or ``6 x 6/6`` for several connections of one size."""
    lengths = {
        way: [
            f.frame_bytes
            for s in mapping.sync_managers
            if s.direction is way
            for f in mapping.frames
            if f.sm_index == s.index
        ]
        for way in Direction
    }
    # Devices list outputs and inputs in the same order; one list may be shorter.
    pairs = list(zip(lengths[Direction.OUTPUT], lengths[Direction.INPUT], strict=False))
    texts = [f"{a}/{b}" for a, b in pairs]
    return "  ".join(
        f"{texts.count(t)} x {t}" if texts.count(t) > 1 else t for t in dict.fromkeys(texts)
    )


def device_text(device: LibraryDevice) -> list[str]:
    """Return all known facts about a device as lines."""
    lines = [f"{device.name}: {device.about}", ""]
    lines += [
        f"{i.order}: vendor 0x{i.vendor_id:08x}, product 0x{i.product_code:08x}"
        for i in device.identities
    ]
    for mapping in device.mappings:
        lines += ["", *_mapping(device, mapping)]
    # The layout of such a device depends on its safety project, so the library has none.
    if not device.mappings:
        lines += ["", f"Process data ({_side(device.role)}): made by its safety project"]
        lines += [f"  source: {text}" for text in device.sources.values()]
    if device.figures:
        lines += ["", "Figures, unverified; only the manual of the revision in use counts:"]
        lines += [f"  {f.name} {f.value:g} ({device.sources[f.source]})" for f in device.figures]
    if device.notes:
        lines += ["", "Notes:", *(f"  - {n}" for n in device.notes)]
    return lines


def _mapping(device: LibraryDevice, mapping: LibraryMapping) -> list[str]:
    side = _side(mapping.role)
    slots = f", {counted(mapping.slots, 'slot')}" if mapping.slots else ""
    lines = [f"{mapping.name} ({side}{slots})", f"  source: {device.sources[mapping.source]}"]
    if mapping.revision_from is not None:
        upto = "" if mapping.revision_to is None else f" to 0x{mapping.revision_to:08x}"
        lines.append(f"  revision: from 0x{mapping.revision_from:08x}{upto}")
    for sm in mapping.sync_managers:
        lines.append(f"  sync manager {sm.index}, {sm.direction.value}")
        lines += [f"    {_pdo(p)}" for p in sm.pdos or ()]
        lines += [
            f"    frame at byte {f.byte_offset}: {f.frame_bytes} bytes, {f.safe_bytes} of them safe"
            for f in mapping.frames
            if f.sm_index == sm.index
        ]
    if mapping.restart_relevant:
        words = ", ".join(_address(*a) for a in mapping.restart_relevant)
        lines.append(f"  restart relevant: {words}")
    lines += [f"  note: {n}" for n in mapping.notes]
    return lines


def _side(role: str) -> str:
    return "MainInstance" if role == "main" else "SubInstance"


def _pdo(pdo: Pdo) -> str:
    if pdo.index == 0:
        return f"PDOs that are not known here, {pdo.bits // 8} bytes"
    return f"0x{pdo.index:04x}: {' '.join(_entry(e) for e in pdo.entries)}"


def _entry(entry: Entry) -> str:
    where = "-" if entry.is_gap else f"{entry.index:04X}:{entry.subindex:02X}"
    return f"{where}/{entry.bits}"


def _address(index: int, subindex: int) -> str:
    return f"0x{index:04x}:{subindex:02x}"


def device_json(device: LibraryDevice) -> dict[str, object]:
    """Return the device as the stable JSON document (``docs/reference/json-output.md``)."""
    return {
        "name": device.name,
        "about": device.about,
        "roles": list(device.roles),
        "identities": [
            {"order": i.order, "vendor_id": i.vendor_id, "product_code": i.product_code}
            for i in device.identities
        ],
        "sources": device.sources,
        "mappings": [_json_mapping(m) for m in device.mappings],
        "figures": [
            {"name": f.name, "value": f.value, "source": f.source, "unverified": True}
            for f in device.figures
        ],
        "notes": list(device.notes),
    }


def _json_mapping(mapping: LibraryMapping) -> dict[str, object]:
    return {
        "name": mapping.name,
        "role": mapping.role,
        "slots": mapping.slots,
        "source": mapping.source,
        "revision_from": mapping.revision_from,
        "revision_to": mapping.revision_to,
        "module_ident": mapping.module_ident,
        "sync_managers": [_json_manager(s) for s in mapping.sync_managers],
        "frames": [
            {
                "sm": f.sm_index,
                "byte": f.byte_offset,
                "frame_bytes": f.frame_bytes,
                "safe_bytes": f.safe_bytes,
            }
            for f in mapping.frames
        ],
        "restart_relevant": [_address(*a) for a in mapping.restart_relevant],
        "notes": list(mapping.notes),
    }


def _json_manager(sm: SyncManager) -> dict[str, object]:
    return {
        "sm": sm.index,
        "direction": sm.direction.value,
        "pdos": [
            {
                "index": p.index,
                "entries": [
                    {"index": e.index, "subindex": e.subindex, "bits": e.bits} for e in p.entries
                ],
            }
            for p in sm.pdos or ()
        ],
    }
