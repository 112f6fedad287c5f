"""The result of a measurement, to and from JSON."""

from __future__ import annotations

import enum
import json
import statistics
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from fsoe_net.core.snapshot import Histogram
from fsoe_net.errors import InputError
from fsoe_net.formats.own.json_schema import schema_errors
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.version import __version__

FORM = 1
BUSY_SHARE = 0.1
"""Share of the processors used by other processes above which a result is of little use."""
MOST_ADDED_NS = 2_000
"""Goal: time that a cycle of fsn-master takes longer at the median than its frames by bare
``send()`` and ``recv()``."""
LEAST_FREE_SHARE = 0.97
"""Goal: rate of the cycle without a period, of that of bare ``send()`` and ``recv()``."""
_MOST_BYTES = 1 << 20


class Measured(enum.StrEnum):
    """What a row of times measures."""

    TIMER = "empty_timer"
    """Delay of the wake-up of a loop that only sleeps; the limit for the next rows."""
    WAKE_UP = "cycle_wake_up"
    WORK = "cycle_work"
    COPY = "cycle_copy"
    MONITORED_WAKE_UP = "monitored_wake_up"
    MONITORED_WORK = "monitored_work"
    """The same while a monitor takes ten snapshots a second."""
    CLIENT = "client_wake_up"
    """From the start of a cycle until a real-time client in Python has its inputs."""
    WIRE_BARE = "wire_bare"
    """Frames on a wire: sent and received by bare system calls; the limit for the next rows."""
    WIRE_SOEM = "wire_soem"
    WIRE_CORE = "wire_core"
    WIRE_XDP = "wire_xdp"
    """The core with ``--xdp``, where the kernel permits it."""
    WIRE_ROUND_TRIP = "wire_round_trip"
    """From a frame of fsn-master to its reply, as the kernel stamps it."""


class Loop(enum.StrEnum):
    """A loop that exchanges frames on a wire."""

    BARE = "bare"
    SOEM = "soem"
    CORE = "core"
    XDP = "xdp"


@dataclass(frozen=True, slots=True, kw_only=True)
class Times:
    """Times in nanoseconds."""

    count: int
    p50_ns: int
    p99_ns: int
    p999_ns: int
    max_ns: int

    @classmethod
    def of_histogram(cls, h: Histogram) -> Times:
        """Return the times of a histogram of the core."""
        return cls(
            count=h.count, p50_ns=h.p50_ns, p99_ns=h.p99_ns, p999_ns=h.p999_ns, max_ns=h.max_ns
        )

    @classmethod
    def of_samples(cls, samples: list[int]) -> Times:
        """Return the times of single values; at least one."""
        rows = sorted(samples)

        def at_most(per_mille: int) -> int:
            return rows[max(0, -(-len(rows) * per_mille // 1000) - 1)]

        return cls(
            count=len(rows),
            p50_ns=at_most(500),
            p99_ns=at_most(990),
            p999_ns=at_most(999),
            max_ns=rows[-1],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class WireLoop:
    """Cycles of one loop.

    Attributes:
        cycles: Their number.
        incomplete: Cycles of which a frame, or a working counter, was missing.
        left_out: Cycles that were too late to run.
        per_s: Cycles per second in each turn, by the median period.
    """

    cycles: int
    incomplete: int
    left_out: int
    per_s: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class WireResult:
    """Loops that took turns on a wire, with the cycle and free; `interface` "": a veth pair."""

    interface: str
    paced: Mapping[Loop, WireLoop]
    free: Mapping[Loop, WireLoop]

    def free_share(self, loop: Loop) -> float | None:
        """Return the free rate of a loop as a share of that of bare system calls.

        It is the median of all turns; ``None`` if one of them was not measured.
        """
        if not {loop, Loop.BARE} <= self.free.keys():
            return None
        pairs = zip(self.free[loop].per_s, self.free[Loop.BARE].per_s, strict=False)
        return statistics.median(own / bare for own, bare in pairs)


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchHost:
    """The machine. ``others_share``: processor time of other processes before and after."""

    kernel: str
    processor: str
    cpus: int
    warnings: int
    realtime: bool
    others_share: float

    @property
    def is_busy(self) -> bool:
        """Whether other processes disturbed the measurement."""
        return self.others_share > BUSY_SHARE


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchResult:
    """A whole measurement; ``emulated_per_s``: bus cycles per second in virtual time."""

    utc: str
    host: BenchHost
    cycle_ns: int
    seconds: float
    times: Mapping[Measured, Times]
    emulated_per_s: float
    wire: WireResult | None = None
    version: str = __version__

    def added_ns(self, cycle: Measured) -> int | None:
        """Return how much longer a cycle takes than its frames; ``None``: not measured."""
        if not {cycle, Measured.WIRE_BARE} <= self.times.keys():
            return None
        return self.times[cycle].p50_ns - self.times[Measured.WIRE_BARE].p50_ns

    def to_json(self) -> dict[str, object]:
        """Return the document of ``schemas/bench.schema.json``."""
        row = {name: value for name, value in asdict(self).items() if value is not None}
        times = {name.value: asdict(times) for name, times in self.times.items()}
        return {"bench": FORM, **row, "times": times}


def read_result(path: str) -> BenchResult:
    """Return the result in a file.

    Raises:
        InputError: The file cannot be read, or is not a result of this form.
    """
    out = Collector()
    data = read_bytes(path, out, most=_MOST_BYTES)
    if data is None:
        raise InputError(f"{path} cannot be read", out.diagnostics)
    try:
        row = json.loads(data)
    except (ValueError, RecursionError) as exc:
        raise InputError(f"{path} is not valid JSON") from exc
    for error in schema_errors(row, "bench"):
        place = ".".join(map(str, error.path)) or "the document"
        raise InputError(f"{path} is not a result of fsoe-net bench: {place} ({error.keyword})")
    return _result(row)


def _result(row: Mapping[str, Any]) -> BenchResult:
    values = {k: v for k, v in row.items() if k != "bench"}
    times = {Measured(name): Times(**times) for name, times in row["times"].items()}
    wire = _wire(row["wire"]) if "wire" in row else None
    host = BenchHost(**row["host"])
    return BenchResult(**values | {"host": host, "times": times, "wire": wire})


def _wire(row: Mapping[str, Any]) -> WireResult:
    def loops(name: str) -> dict[Loop, WireLoop]:
        rows = row[name].items()
        return {Loop(k): WireLoop(**v | {"per_s": tuple(v["per_s"])}) for k, v in rows}

    return WireResult(interface=row["interface"], paced=loops("paced"), free=loops("free"))
