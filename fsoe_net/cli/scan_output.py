"""A scan as a table for people."""

from __future__ import annotations

from fsoe_net.diag.words import counted
from fsoe_net.document.model import Cell, Column, Document, Table, cell, words
from fsoe_net.model.scan import Scan, ScannedConnection, ScannedSubDevice

_COLUMNS = (
    Column("pos"),
    Column("name"),
    Column("vendor", rank=5),
    Column("product", rank=3),
    Column("revision", rank=6),
    Column("state", rank=1),
    Column("out/in", rank=4),
    Column("FSoE", rank=2),
    Column("links", rank=7),
)

_STATES = {
    100: "Reset",
    101: "Session",
    102: "Connection",
    103: "Parameter",
    104: "Data",
    105: "Data, fail-safe",
}


def scan_document(scan: Scan) -> Document:
    """Return one row per SubDevice, with its FSoE connections and problems below the table."""
    details = [
        words(f"{s.position} {s.planned or s.name}".rstrip() + f": {text}")
        for s in scan.subdevices
        for text in _details(s)
    ]
    count = counted(len(scan.subdevices), "SubDevice")
    changed = "brought to PREOP" if scan.states_changed else "no state was changed"
    table = Table(columns=_COLUMNS, rows=tuple(_row(s) for s in scan.subdevices))
    return Document(lead=(table, *details, words(f"{scan.interface}: {count}, {changed}")))


def _row(s: ScannedSubDevice) -> tuple[Cell, ...]:
    name = f"{s.planned} ({s.name})" if s.planned and s.planned != s.name else s.name
    state = s.al or "-"
    if s.in_error:
        state += f" error 0x{s.al_code or 0:04x}"
    texts = (
        str(s.position),
        name + (f" alias {s.alias}" if s.alias else ""),
        _hex(s.vendor_id),
        _hex(s.product_code),
        _hex(s.revision),
        state,
        _sizes(s),
        _address(s),
        "".join(_link(p.link) for p in s.ports) or "-",
    )
    return tuple(cell(t) for t in texts)


def _link(link: bool | None) -> str:
    if link is None:
        return "-"
    return "x" if link else "."


def _hex(value: int | None) -> str:
    return "-" if value is None else f"0x{value:08x}"


def _sizes(s: ScannedSubDevice) -> str:
    """Return bytes of outputs and of inputs, such as ``SM2 6 / SM3 6``."""
    # Unread is different from empty.
    if s.sms is None:
        return "-"
    parts = []
    for kind in ("outputs", "inputs"):
        rows = [m for m in s.process_data if m.kind == kind]
        parts.append("+".join(f"SM{m.index} {_or_unknown(m.size_bytes)}" for m in rows) or "0")
    return " / ".join(parts) if parts != ["0", "0"] else "0"


def _address(s: ScannedSubDevice) -> str:
    if s.fsoe is None:
        return "-"
    if s.fsoe.address is not None:
        return f"address {s.fsoe.address}"
    return counted(len(s.fsoe.connections), "connection") if s.fsoe.connections else "not read"


def _details(s: ScannedSubDevice) -> list[str]:
    lines = []
    if s.fsoe is not None:
        lines += [_connection(c) for c in s.fsoe.connections]
        lines += [_connection(c) for c in s.fsoe.given if c.connection_id]  # 0: none
    for p in s.ports:
        if p.link_lost or p.rx_errors:
            lost = counted(p.link_lost, "lost link")
            lines.append(f"port {p.port}: {lost}, {counted(p.rx_errors, 'receive error')}")
    return lines + [f"problem: {text}" for text in s.remarks]


def _connection(c: ScannedConnection) -> str:
    state = f", {_STATES[c.state]}" if c.state in _STATES else ""
    return (
        f"0x{c.object_index:04x}: FSoE address {_or_unknown(c.address)}, ConnID "
        f"{_or_unknown(c.connection_id)}, watchdog {_or_unknown(c.watchdog_ms)} ms{state}"
    )


def _or_unknown(value: int | None) -> str:
    return "?" if value is None else str(value)
