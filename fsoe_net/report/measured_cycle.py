"""Measurements of the bus cycle T_Com, for the block on timing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fsoe_net.document.model import (
    Cell,
    Column,
    Heading,
    Level,
    Paragraph,
    Part,
    Table,
    Text,
    Verdict,
    cell,
    code,
    muted,
    number_of,
    stated,
)
from fsoe_net.report.inputs import ReportInputs

if TYPE_CHECKING:
    from fsoe_net.core.snapshot import Histogram

_SHARES = (990_000, 999_000, 999_990)
_HEADS = ("Cycles", "Min", "Mean", "p99", "p99.9", "p99.999", "Max")
_REMARK = (
    "From one cycle to the next. Min, mean and max are exact. A percentile is the upper end of the "
    "histogram bucket in which it fell, never above max: the true one is at most 1.6 % less. "
    "It is stated when so many cycles were measured that one of them may lie above it."
)


def measured_cycle(inputs: ReportInputs) -> list[Part]:
    """Return the measured bus cycle from each piece of evidence."""
    rows: list[tuple[Cell, ...]] = []
    # A run in virtual time has no measured period.
    for e in inputs.evidence:
        if e.run is not None and e.run.period is not None:
            rows.append(_row(e.source.path, e.run.period, emulated=e.run.emulated))
    if inputs.live is not None and inputs.live.snapshot.cycle.statistics.period.count:
        found = inputs.live.snapshot.cycle.statistics.period
        emulated = inputs.live.status.backend == "emulated"
        rows.append(_row(inputs.live.socket, found, emulated=emulated))
    title = Heading("Bus cycle T_Com as measured")
    if not rows:
        words = "Not measured: no run in real time and no running bus among the evidence."
        return [title, Paragraph((Text(words),))]
    columns = (Column("Measured in"), *(Column(h, number=True) for h in _HEADS))
    name = "bus cycle as measured"
    return [title, Table(name=name, columns=columns, rows=tuple(rows), remark=_REMARK)]


def _row(path: str, h: Histogram, *, emulated: bool) -> tuple[Cell, ...]:
    head = cell(code(path))
    if emulated:
        head = (*head, Verdict("EMULATED, not evidence for this machine", Level.NOTE))
    return (
        head,
        cell(number_of(h.count, "cycle", path)),
        _exact(h.min_ns, path),
        _exact(h.mean_ns, path),
        *(_share(h, per_million, path) for per_million in _SHARES),
        _exact(h.max_ns, path),
    )


def _exact(ns: int, path: str) -> Cell:
    return cell(stated(ns / 1e6, "ms", path, f"{ns / 1e6:.4f}"))


def _share(h: Histogram, per_million: int, path: str) -> Cell:
    """Return a percentile; with too few cycles there is none, as it would be the maximum."""
    least = 1_000_000 // (1_000_000 - per_million)
    if h.count < least:
        return cell(muted(f"not stated: fewer than {least:_} cycles".replace("_", " ")))
    ns = h.at_most(per_million)
    source = f"{path}, upper end of a histogram bucket"
    return cell(stated(ns / 1e6, "ms", source, f"{ns / 1e6:.4f}"))
