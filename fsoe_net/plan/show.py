"""A plan for people and for programs: table of copies, JSON document."""

from __future__ import annotations

import hashlib
from dataclasses import asdict

from fsoe_net.diag.words import counted
from fsoe_net.document.model import Cell, Column, Document, Part, Table, cell, words
from fsoe_net.document.write_terminal import document_text
from fsoe_net.plan.fingerprint import fingerprint_of
from fsoe_net.plan.image import igh_image
from fsoe_net.plan.model import NONE, Plan, PlanConnection, PlanCopy


def copy_end(plan: Plan, sm_number: int, bit: int) -> str:
    """Return ``ek1914 SM3 byte 0 (0x6000:01)``; the entry only if one starts there."""
    sm = plan.sync_managers[sm_number]
    name = plan.subdevices[sm.subdevice].name
    entry = entry_at(plan, sm_number, bit)
    return f"{name} SM{sm.index} byte {bit // 8}" + (f" ({entry})" if entry else "")


def entry_at(plan: Plan, sm_number: int, bit: int) -> str:
    """Return the address of the entry that starts at a bit of a sync manager, or an empty text."""
    sm = plan.sync_managers[sm_number]
    for pdo in plan.pdos[sm.first_pdo : sm.first_pdo + sm.pdo_count]:
        for entry in plan.entries[pdo.first_entry : pdo.first_entry + pdo.entry_count]:
            # Entries without a length share the bit of the one that follows.
            if entry.bit_offset == bit and entry.bits:
                return f"0x{entry.index:04x}:{entry.subindex:02x}"
    return ""


def plan_text(plan: Plan) -> str:
    """Return `plan_document` as text."""
    return document_text(plan_document(plan), width=None).rstrip("\n")


def plan_document(plan: Plan) -> Document:
    """Return the plan for people: connections, then copies with names, offsets and lengths."""
    cycle = f"{plan.cycle_ns / 1000:g} us" if plan.cycle_ns else "not stated"
    fingerprint = fingerprint_of(plan)
    parts: list[Part] = [
        words(
            f"plan format {plan.format}, {counted(len(plan.subdevices), 'SubDevice')}, "
            f"{counted(len(plan.copies), 'copy')}, "
            f"{sum(c.size_bytes for c in plan.copies)} bytes per cycle, bus cycle {cycle}"
        ),
        *(
            words(
                f"bus {bus.name}: {counted(bus.subdevice_count, 'SubDevice')}, cycle "
                f"{bus.cycle_ns / 1000:g} us"
            )
            for bus in plan.buses
        ),
        *(
            words(
                f"group {group.name}: {counted(group.subdevice_count, 'SubDevice')} that may be "
                + (f"absent, at {group.place}" if group.place else "absent")
            )
            for group in plan.groups
        ),
        words(f"fingerprint {fingerprint.short} ({fingerprint.whole})"),
        words(f"SHA-256 {hashlib.sha256(plan.to_bytes()).hexdigest()}"),
    ]
    if plan.connections:
        rows = tuple(_connection_row(plan, c) for c in plan.connections)
        parts.append(Table(name="connections", columns=_CONNECTIONS, rows=rows))
    copies = tuple(_copy_row(plan, number, copy) for number, copy in enumerate(plan.copies))
    return Document(lead=(*parts, Table(name="copies", columns=_COPIES, rows=copies)))


_CONNECTIONS = (
    Column("connection"),
    Column("main", rank=4),
    Column("sub", rank=5),
    Column("ConnID", number=True, rank=1),
    Column("address", number=True, rank=2),
    Column("watchdog", number=True, rank=3),
    Column("safe bytes", rank=6),
)
_COPIES = (
    Column("#", number=True, rank=3),
    Column("bytes", number=True, rank=1),
    Column("from"),
    Column("to"),
    Column("connection", rank=2),
)


def _connection_row(plan: Plan, c: PlanConnection) -> tuple[Cell, ...]:
    texts = (
        c.name,
        plan.subdevices[c.main].name,
        plan.subdevices[c.sub].name,
        "-" if c.connection_id is None else str(c.connection_id),
        "-" if c.address is None else str(c.address),
        "-" if c.watchdog_ms is None else f"{c.watchdog_ms} ms",
        f"{c.safe_to_sub} to sub, {c.safe_to_main} to main",
    )
    return tuple(cell(text) for text in texts)


def _copy_row(plan: Plan, number: int, copy: PlanCopy) -> tuple[Cell, ...]:
    name = "standard data"
    if copy.connection != NONE:
        name = plan.connections[copy.connection].name
    return (
        cell(str(number)),
        cell(str(copy.size_bytes)),
        cell(copy_end(plan, copy.source_sm, copy.source_bit)),
        cell(copy_end(plan, copy.destination_sm, copy.destination_bit)),
        cell(name),
    )


def plan_json(plan: Plan) -> dict[str, object]:
    """Return the stable JSON form: every record with names resolved, and the IgH image."""
    domain = igh_image(plan)
    bases = {f.sm: f.offset_bytes for f in domain.fmmus}
    return {
        "format": plan.format,
        "sha256": hashlib.sha256(plan.to_bytes()).hexdigest(),
        "fingerprint": fingerprint_of(plan).to_json(),
        "cycle_ns": plan.cycle_ns,
        "subdevices": [s._asdict() for s in plan.subdevices],
        "sync_managers": [s._asdict() | {"size_bytes": s.size_bytes} for s in plan.sync_managers],
        "connections": [
            c._asdict() | {"main": plan.subdevices[c.main].name, "sub": plan.subdevices[c.sub].name}
            for c in plan.connections
        ],
        "copies": [
            {
                "number": number,
                "net": c.net,
                "kind": "fsoe" if c.kind == 1 else "standard",
                "size_bytes": c.size_bytes,
                "connection": None if c.connection == NONE else plan.connections[c.connection].name,
                "source": _end_json(plan, c.source_sm, c.source_bit, bases),
                "destination": _end_json(plan, c.destination_sm, c.destination_bit, bases),
            }
            for number, c in enumerate(plan.copies)
        ],
        "symbols": [asdict(s) for s in plan.symbols],
        "blocks": [b._asdict() for b in plan.blocks],
        "igh_image": {
            "size_bytes": domain.size_bytes,
            "working_counter": domain.working_counter,
            "fmmus": [asdict(f) for f in domain.fmmus],
        },
    }


def _end_json(plan: Plan, sm_number: int, bit: int, bases: dict[int, int]) -> dict[str, object]:
    sm = plan.sync_managers[sm_number]
    return {
        "subdevice": plan.subdevices[sm.subdevice].name,
        "sm": sm.index,
        "entry": entry_at(plan, sm_number, bit),
        "byte_offset": bit // 8,
        "igh_byte": bases[sm_number] + bit // 8 if sm_number in bases else None,
    }
