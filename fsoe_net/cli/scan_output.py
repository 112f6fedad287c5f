"""A scan as a table for people."""

from __future__ import annotations

from fsoe_net.diag.words import counted
from fsoe_net.model.scan import Scan, ScannedConnection, ScannedSubDevice

__all__ = ["scan_table"]

_COLUMNS = ("pos", "name", "vendor", "product", "revision", "state", "out/in", "FSoE", "links")

_STATES = {
    100: "Reset",
    101: "Session",
    102: "Connection",
    103: "Parameter",
    104: "Data",
    105: "Data, fail-safe",
}


def scan_table(scan: Scan) -> str:
    """Return one row per SubDevice, its FSoE connections and its problems below it."""
    rows = [_COLUMNS, *(_row(s) for s in scan.subdevices)]
    widths = [max(len(row[n]) for row in rows) for n in range(len(_COLUMNS))]
    lines: list[str] = []
    for number, row in enumerate(rows):
        cells = (cell.ljust(w) for cell, w in zip(row, widths, strict=True))
        lines.append("  ".join(cells).rstrip())
        if number:
            lines += [f"     {text}" for text in _details(scan.subdevices[number - 1])]
    count = counted(len(scan.subdevices), "SubDevice")
    changed = "brought to PREOP" if scan.states_changed else "no state was changed"
    return "\n".join([*lines, f"{scan.interface}: {count}, {changed}"])


def _row(s: ScannedSubDevice) -> tuple[str, ...]:
    name = f"{s.planned} ({s.name})" if s.planned and s.planned != s.name else s.name
    state = s.al or "-"
    if s.in_error:
        state += f" error 0x{s.al_code or 0:04x}"
    return (
        str(s.position),
        name + (f" alias {s.alias}" if s.alias else ""),
        _hex(s.vendor_id),
        _hex(s.product_code),
        _hex(s.revision),
        state,
        _sizes(s),
        _address(s),
        "".join("-" if p.link is None else "x" if p.link else "." for p in s.ports) or "-",
    )


def _hex(value: int | None) -> str:
    return "-" if value is None else f"0x{value:08x}"


def _sizes(s: ScannedSubDevice) -> str:
    """``SM2 6 / SM3 6``: bytes of outputs, of inputs."""
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
        lines += [_connection(c) for c in s.fsoe.given if c.connection_id]  # 0: nothing given
    for p in s.ports:
        if p.link_lost or p.rx_errors:
            lost = counted(p.link_lost, "lost link")
            lines.append(f"port {p.port}: {lost}, {counted(p.rx_errors, 'receive error')}")
    return lines + [f"problem: {text}" for text in s.problems]


def _connection(c: ScannedConnection) -> str:
    state = f", {_STATES[c.state]}" if c.state in _STATES else ""
    return (
        f"0x{c.object_index:04x}: FSoE address {_or_unknown(c.address)}, ConnID "
        f"{_or_unknown(c.connection_id)}, watchdog {_or_unknown(c.watchdog_ms)} ms{state}"
    )


def _or_unknown(value: int | None) -> str:
    return "?" if value is None else str(value)
