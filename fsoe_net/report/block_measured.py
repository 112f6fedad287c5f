"""What was measured of the bus cycle, for the block on timing."""

from __future__ import annotations

from fsoe_net.core import Histogram
from fsoe_net.report.document import (
    Cell,
    Column,
    Heading,
    Level,
    Part,
    Table,
    Verdict,
    cell,
    code,
    stated,
)
from fsoe_net.report.inputs import ReportInputs

__all__ = ["measured_cycle"]

_KEYS = ("min_ns", "mean_ns", "p99_ns", "p999_ns", "max_ns")


def measured_cycle(inputs: ReportInputs) -> list[Part]:
    """Return the bus cycle as measured by each piece of evidence; nothing when there is none."""
    rows: list[tuple[Cell, ...]] = []
    for e in inputs.evidence:
        if e.run is not None and e.run.period_ns.get("max_ns"):
            rows.append(_row(e.source.path, e.run.period_ns, emulated=e.run.emulated))
    if inputs.live is not None and inputs.live.snapshot.cycle.statistics.period.count:
        found = _named(inputs.live.snapshot.cycle.statistics.period)
        emulated = inputs.live.status.backend == "emulated"
        rows.append(_row(inputs.live.socket, found, emulated=emulated))
    if not rows:
        return []
    heads = ("Least", "Mean", "99 %", "99.9 %", "Most")
    columns = (Column("Measured in"), *(Column(h, number=True) for h in heads))
    return [
        Heading("Bus cycle as measured"),
        Table(name="bus cycle as measured", columns=columns, rows=tuple(rows)),
    ]


def _named(h: Histogram) -> dict[str, int]:
    return {key: getattr(h, key) for key in _KEYS}


def _row(path: str, values: object, *, emulated: bool) -> tuple[Cell, ...]:
    found = values if isinstance(values, dict) else {}
    cells = []
    for key in _KEYS:
        ns = found.get(key)
        cells.append(cell(stated(None if ns is None else ns / 1e6, "ms", path, _ms(ns))))
    head = cell(code(path))
    if emulated:
        head = (*head, Verdict("EMULATED, not evidence for this machine", Level.NOTE))
    return (head, *cells)


def _ms(ns: int | None) -> str:
    return "" if ns is None else f"{ns / 1e6:.4f}"
