"""Metrics of masters, as `prometheus_client` collects them.

A master that does not answer has ``fsoe_master_up 0`` and its health, and no other value: an old
value would look like a present one. Levels and reasons are those of `fsoe_net.live.health`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector

from fsoe_net.core.snapshot import Histogram, Statistics, bucket_end
from fsoe_net.fleet.labels import RESET_CODES, bounded, distinct_labels
from fsoe_net.fleet.watcher import RESET_ENDS, MasterReading, ResetCause
from fsoe_net.live.attachment import WatchedConnection
from fsoe_net.live.control_values import Status
from fsoe_net.live.health import Health, HealthReport, SubDeviceHealth, bus_health

MOST_SUBJECTS = 500
"""Connections, and SubDevices, of one master that have metrics; the rest is only counted."""

TIME_BOUNDS_NS = tuple(
    digit * 10**power for power in range(4, 8) for digit in (1, 2, 5)
)  # 10 us ... 50 ms

_Row = TypeVar("_Row")


@dataclass(frozen=True, slots=True)
class _Value(Generic[_Row]):
    """A metric with one value for each row; a row without the value is left out."""

    kind: type[Metric]
    name: str
    text: str
    read: Callable[[_Row], float | None]


def _seconds(milliseconds: float | None) -> float | None:
    """Return seconds; ``None`` also for 0, which means that nothing was measured."""
    return milliseconds / 1e3 if milliseconds else None


_STATUS: tuple[_Value[Status], ...] = (
    _Value(GaugeMetricFamily, "fsoe_bus_period_seconds", "Configured period of the bus cycle.",
           lambda s: s.cycle_ns / 1e9),
    _Value(GaugeMetricFamily, "fsoe_subdevices_missing", "SubDevices that do not answer.",
           lambda s: s.missing),
)  # fmt: skip
_STATISTICS: tuple[_Value[Statistics], ...] = (
    _Value(CounterMetricFamily, "fsoe_bus_cycles_total", "Bus cycles since the bus was opened.",
           lambda s: s.cycles),
    _Value(CounterMetricFamily, "fsoe_bus_overruns_total", "Cycles that began late.",
           lambda s: s.overruns),
    _Value(CounterMetricFamily, "fsoe_bus_wkc_errors_total",
           "Cycles with an incomplete working counter.", lambda s: s.wkc_errors),
    _Value(CounterMetricFamily, "fsoe_bus_lost_frames_total", "Frames that did not return.",
           lambda s: s.lost_frames),
)  # fmt: skip
_TIMES: tuple[tuple[str, str, Callable[[Statistics], Histogram]], ...] = (
    ("fsoe_bus_wakeup_latency_seconds", "Delay of the wake-up of each cycle (jitter).",
     lambda s: s.latency),
    ("fsoe_bus_round_trip_seconds", "From sending to the last reply.", lambda s: s.round_trip),
)  # fmt: skip
_CONNECTION: tuple[_Value[WatchedConnection], ...] = (
    _Value(GaugeMetricFamily, "fsoe_connection_in_data", "Whether the connection is in Data.",
           lambda c: c.result.wire_state.in_data),
    _Value(CounterMetricFamily, "fsoe_connection_resets_total",
           "Resets since the bus was opened, without the one at the start.",
           lambda c: c.result.resets),
    _Value(CounterMetricFamily, "fsoe_connection_wrong_crc_frames_total",
           "Frames whose CRC does not match the chain.",
           lambda c: c.result.wrong_to_sub + c.result.wrong_to_main),
    _Value(CounterMetricFamily, "fsoe_connection_gaps_total",
           "How often frames were not observed and the CRC chain was lost.",
           lambda c: c.result.gaps),
    _Value(GaugeMetricFamily, "fsoe_connection_cycle_mean_seconds",
           "Mean time between new frames of the MainInstance since the bus was opened.",
           lambda c: _seconds(c.result.fsoe_cycle_ms["mean"])),
    _Value(GaugeMetricFamily, "fsoe_connection_cycle_longest_seconds",
           "Longest time between new frames of the MainInstance since the bus was opened.",
           lambda c: _seconds(c.result.fsoe_cycle_ms["max"])),
    _Value(GaugeMetricFamily, "fsoe_connection_watchdog_seconds", "FSoE watchdog of the plan.",
           lambda c: _seconds(c.result.watchdog_ms)),
    _Value(GaugeMetricFamily, "fsoe_connection_watchdog_margin_ratio",
           "Share of the watchdog that the longest FSoE cycle of both directions left.",
           lambda c: 1 - c.watchdog_share if c.watchdog_share else None),
    _Value(GaugeMetricFamily, "fsoe_connection_parameter_differences",
           "Number of FSoE parameters that differ from the plan.",
           lambda c: len(c.result.differs)),
)  # fmt: skip
_SUBDEVICE: tuple[_Value[SubDeviceHealth], ...] = (
    _Value(GaugeMetricFamily, "fsoe_subdevice_in_op", "Whether the SubDevice is in OP.",
           lambda s: s.seen.in_op if s.seen.known else None),
    _Value(CounterMetricFamily, "fsoe_subdevice_returns_total",
           "How often the SubDevice was lost and answered again.", lambda s: s.seen.returns),
    _Value(CounterMetricFamily, "fsoe_subdevice_links_lost_total", "Lost links of all ports.",
           lambda s: sum(s.seen.link_lost)),
    _Value(CounterMetricFamily, "fsoe_subdevice_receive_errors_total",
           "Receive errors of all ports.", lambda s: sum(s.seen.rx_errors)),
)  # fmt: skip


class MasterCollector(Collector):
    """Collects the metrics of several masters at each request."""

    def __init__(self, read: Callable[[], Sequence[MasterReading]]) -> None:
        self._read = read

    def collect(self) -> Iterator[Metric]:
        """Yield all metrics."""
        readings = self._read()
        names = distinct_labels(r.name for r in readings)
        yield from metrics_of([_Master(n, r) for n, r in zip(names, readings, strict=True)])


class _Master:
    """One master with the labels of its parts; without values that are not current."""

    def __init__(self, label: str, reading: MasterReading) -> None:
        view = reading.view
        self.label, self.reading = label, reading
        self.status = view.status if view is not None and reading.up else None
        bus = bus_health(None, None, away="no recent answer")
        self.health = HealthReport(bus=bus, subdevices=(), connections=())
        self.statistics: Statistics | None = None
        self.connections: tuple[WatchedConnection, ...] = ()
        self.omitted = 0
        if view is not None:
            self.health = view.health
        if view is not None and reading.up and view.current and view.snapshot is not None:
            self.statistics = view.snapshot.cycle.statistics
            self.connections = view.connections[:MOST_SUBJECTS]
            subjects = (len(view.connections), len(self.health.subdevices))
            self.omitted = sum(max(0, n - MOST_SUBJECTS) for n in subjects)
        rows = MOST_SUBJECTS if self.statistics is not None else 0
        self.subdevice_health = self.health.subdevices[:rows]
        self.connection_health = self.health.connections[:rows]
        self.subdevice_labels = distinct_labels(h.name for h in self.subdevice_health)
        self.connection_labels = distinct_labels(c.result.name for c in self.connections)

    @property
    def subjects(self) -> Iterator[tuple[str, str, Health]]:
        """Kind and label of each subject, with its health."""
        yield "bus", "", self.health.bus
        for name, subdevice in zip(self.subdevice_labels, self.subdevice_health, strict=True):
            yield "subdevice", name, subdevice
        for name, connection in zip(self.connection_labels, self.connection_health, strict=True):
            yield "connection", name, connection


def metrics_of(masters: Sequence[_Master]) -> Iterator[Metric]:
    """Yield the metrics of all masters; each metric once, as the format requires."""
    yield from _of_masters(masters)
    yield from _of_health(masters)
    bus = [((m.label,), m.status) for m in masters if m.status is not None]
    yield from _values(_STATUS, ("master",), bus)
    cycles = [((m.label,), m.statistics) for m in masters if m.statistics is not None]
    yield from _values(_STATISTICS, ("master",), cycles)
    yield from (_histogram(name, text, read, cycles) for name, text, read in _TIMES)
    connections = [
        ((m.label, name), row)
        for m in masters
        for name, row in zip(m.connection_labels, m.connections, strict=True)
    ]
    yield from _values(_CONNECTION, ("master", "connection"), connections)
    yield _resets_by_cause(masters)
    subdevices = [
        ((m.label, name), row)
        for m in masters
        for name, row in zip(m.subdevice_labels, m.subdevice_health, strict=True)
    ]
    yield from _values(_SUBDEVICE, ("master", "subdevice"), subdevices)


def _values(
    metrics: Iterable[_Value[_Row]], labels: Sequence[str], rows: Sequence[tuple[Any, _Row]]
) -> Iterator[Metric]:
    for metric in metrics:
        family: Any = metric.kind(metric.name, metric.text, labels=labels)  # type: ignore[call-arg]
        for words, row in rows:
            value = metric.read(row)
            if value is not None:
                family.add_metric(words, float(value))
        yield family


def _of_masters(masters: Sequence[_Master]) -> Iterator[Metric]:
    up = GaugeMetricFamily("fsoe_master_up", "Whether fsn-master answers.", labels=["master"])
    about = GaugeMetricFamily(
        "fsoe_master_info",
        "Always 1: interface, version and plan of a master.",
        labels=["master", "interface", "backend", "version", "plan_sha256"],
    )
    omitted = GaugeMetricFamily(
        "fsoe_master_omitted_subjects",
        f"SubDevices and connections beyond {MOST_SUBJECTS}, which have no metrics.",
        labels=["master"],
    )
    lost = CounterMetricFamily(
        "fsoe_master_events_lost_total", "Events that the exporter missed.", labels=["master"]
    )
    for m in masters:
        up.add_metric([m.label], float(m.reading.up))
        if m.status is None or m.reading.view is None:
            continue
        s = m.status
        words = (s.interface, s.backend, s.version, s.plan_sha256)
        about.add_metric([m.label, *map(bounded, words)], 1.0)
        omitted.add_metric([m.label], m.omitted)
        lost.add_metric([m.label], m.reading.view.events_lost)
    yield from (up, about, omitted, lost)


def _of_health(masters: Sequence[_Master]) -> Iterator[Metric]:
    labels = ["master", "subject", "name"]
    level = GaugeMetricFamily(
        "fsoe_health_level", "0 good, 1 unknown, 2 warning, 3 error.", labels=labels
    )
    reasons = GaugeMetricFamily(
        "fsoe_health_reason", "Always 1: a reason for the level.", labels=[*labels, "reason"]
    )
    for m in masters:
        for subject, name, health in m.subjects:
            level.add_metric([m.label, subject, name], health.level)
            for reason in health.reasons:
                reasons.add_metric([m.label, subject, name, reason.key], 1.0)
    yield from (level, reasons)


def _histogram(
    name: str,
    text: str,
    read: Callable[[Statistics], Histogram],
    rows: Sequence[tuple[Sequence[str], Statistics]],
) -> Metric:
    family = HistogramMetricFamily(name, text, labels=["master"])
    for words, statistics in rows:
        times = read(statistics)
        family.add_metric(words, _cumulative(times), times.sum_ns / 1e9)
    return family


def _cumulative(times: Histogram) -> list[tuple[str, float]]:
    """Return the number of times up to each bound; a bucket counts only if it is whole below."""
    rows = [
        (str(bound / 1e9), sum(n for floor, n in times.buckets if bucket_end(floor) - 1 <= bound))
        for bound in TIME_BOUNDS_NS
    ]
    return [*rows, ("+Inf", times.count)]


def _resets_by_cause(masters: Sequence[_Master]) -> Metric:
    family = CounterMetricFamily(
        "fsoe_connection_resets_by_cause_total",
        "Resets that the exporter observed, with the end that began them and their code.",
        labels=["master", "connection", "end", "code"],
    )
    for m in masters:
        for label, row in zip(m.connection_labels, m.connections, strict=True):
            for end in RESET_ENDS:
                # Also the zeros: a series that begins at 1 has no increase.
                for code in RESET_CODES:
                    times = m.reading.resets.get(ResetCause(row.result.name, end, code), 0)
                    family.add_metric([m.label, label, end, code], times)
    return family
