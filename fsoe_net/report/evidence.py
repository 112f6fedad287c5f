"""Files about the machine: scans, results of runs, incident files; and a running bus."""

from __future__ import annotations

import hashlib
import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from fsoe_net.core.snapshot import Histogram
from fsoe_net.errors import InputError
from fsoe_net.formats.own.scan import parse_scan
from fsoe_net.formats.shared.files import open_file
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.parameters import NOT_OBSERVED, STATED_PARAMETERS, FsoeParameters
from fsoe_net.model.network import SourceFile
from fsoe_net.model.scan import Scan

if TYPE_CHECKING:
    from fsoe_net.core.bus_documents import BusSnapshot
    from fsoe_net.incident.incident import IncidentHead
    from fsoe_net.live.control_values import Status

_NEXT = "evidence is a scan.json, a result of fsoe-net run --format json, or an incident file"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRow:
    """One connection of a run; times in ms."""

    name: str
    state: ConnectionState
    cycle_mean: float | None
    cycle_max: float | None
    watchdog: float | None
    resets: int
    reset_text: str
    configured: FsoeParameters = NOT_OBSERVED
    observed: FsoeParameters = NOT_OBSERVED
    differs: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEvidence:
    """Content of the JSON document of a run; ``period`` of the bus cycle only in real time."""

    mode: str
    backend: str
    plan_sha256: str
    duration_ms: float
    passed: bool
    cycles: int
    overruns: int
    wkc_errors: int
    period: Histogram | None
    rows: tuple[RunRow, ...]

    @property
    def emulated(self) -> bool:
        """Whether it contains no evidence about a machine."""
        return self.backend == "emulated"


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """One file; exactly one of the three is not ``None``."""

    source: SourceFile
    scan: Scan | None = None
    run: RunEvidence | None = None
    incident: IncidentHead | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveEvidence:
    """Data of the ``fsn-master`` on a socket; ``names`` of its connections."""

    socket: str
    status: Status
    snapshot: BusSnapshot
    names: tuple[str, ...]


def read_evidence(path: str) -> Evidence:
    """Read a file about the machine; its type is recognised by content.

    Raises:
        InputError: The file cannot be read, has another type, or is damaged.
    """
    with open_file(path) as stream:
        data = stream.read()
    source = SourceFile(path=path, sha256=hashlib.sha256(data).hexdigest())
    document = _document(data)
    # Results of runs also have `subdevices`, but only they name a plan.
    if document is None or ("subdevices" in document and "plan_sha256" not in document):
        if document is not None and "interface" in document:
            scan, found = parse_scan(data, path)
            if scan is None:
                raise InputError(f"{path} is a damaged scan", found)
            return Evidence(source=source, scan=scan)
    elif "statistics" in document and "plan_sha256" in document and "connections" in document:
        # Three keys, because other JSON files of this tool have one or two of them.
        try:
            return Evidence(source=source, run=_run(document))
        except (KeyError, TypeError, ValueError, AttributeError) as exc:
            raise InputError(f"{path} is not a complete result of a run: {exc}; {_NEXT}") from exc
    from fsoe_net.incident.incident_read import IncidentReader  # most reports do not need it

    try:
        return Evidence(source=source, incident=IncidentReader(path, io.BytesIO(data)).head)
    except InputError as exc:
        raise InputError(f"{path} is not evidence: {exc}; {_NEXT}") from exc


def _document(data: bytes) -> dict[str, Any] | None:
    try:
        found = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _run(document: Mapping[str, Any]) -> RunEvidence:
    statistics = document["statistics"]
    return RunEvidence(
        mode=str(document["mode"]),
        backend=str((document.get("bus") or {}).get("backend", "emulated")),
        plan_sha256=str(document["plan_sha256"]),
        duration_ms=measured_ms(document["duration_ms"]) or 0.0,
        passed=document["result"] == "pass",
        cycles=int(statistics["cycles"]),
        overruns=int(statistics["overruns"]),
        wkc_errors=int(statistics["wkc_errors"]),
        period=_period(statistics.get("period") or {}),
        rows=tuple(
            # Files can be written by any version: the conversion of each field checks it.
            RunRow(
                name=str(c["name"]),
                state=ConnectionState(c["state"]),
                cycle_mean=measured_ms(c["fsoe_cycle_ms"].get("mean")),
                cycle_max=measured_ms(c["fsoe_cycle_ms"].get("max")),
                watchdog=measured_ms(c["watchdog_ms"]),
                resets=int(c["resets"]),
                reset_text=str(c["last_reset_text"]),
                configured=_parameters(c.get("configured")),
                observed=_parameters(c.get("observed")),
                # Only known names: text from a file must not appear in the report as a fact.
                differs=tuple(n for n in STATED_PARAMETERS if n in (c.get("differs") or ())),
            )
            for c in document["connections"]
        ),
    )


def _parameters(row: Mapping[str, Any] | None) -> FsoeParameters:
    """Return parameters; a run from before they were observed has none.

    Raises:
        AttributeError, TypeError, ValueError: They are not integers.
    """
    values = {f.name: (row or {}).get(f.name) for f in fields(FsoeParameters)}
    return FsoeParameters(**{k: None if v is None else int(v) for k, v in values.items()})


def _period(row: Mapping[str, Any]) -> Histogram | None:
    """Return the times from cycle to cycle; ``None`` in virtual time.

    Raises:
        KeyError, TypeError, ValueError: The histogram is incomplete.
    """
    if not row.get("count"):
        return None
    keys = [f.name for f in fields(Histogram) if f.name not in ("sum_ns", "buckets")]
    values = {key: int(row[key]) for key in keys}
    values["sum_ns"] = int(row["mean_ns"]) * values["count"]  # a run states only the mean
    buckets = tuple((int(floor), int(times)) for floor, times in row["buckets"])
    floors = [floor for floor, _ in buckets]
    # A damaged histogram would give percentiles that were not measured.
    if floors != sorted(set(floors)) or sum(times for _, times in buckets) != values["count"]:
        raise ValueError("buckets of the bus cycle do not rise or are not all there")
    period = Histogram(**values, buckets=buckets)
    # The percentile is calculated again from the buckets: both must have the same resolution.
    if period.at_most(500_000) != period.p50_ns:
        raise ValueError("an earlier version counted its times in wider buckets: run it again")
    return period


def measured_ms(value: Any) -> float | None:
    """Return a time of a document, ms; ``None`` if not measured.

    Raises:
        TypeError, ValueError: The value is not a number. NaN in particular must be rejected,
        because every comparison with it would pass.
    """
    ms = None if value is None else float(value)
    if ms is not None and not 0 <= ms < math.inf:
        raise ValueError(f"{value} is not a time in ms")
    return ms


def ask_live(socket: str) -> LiveEvidence:
    """Query a running ``fsn-master`` once; the bus is not written.

    Raises:
        EnvironmentFault: No process answers, or the bus is stopped.
    """
    from fsoe_net.live.client import Client

    with Client(socket) as client:
        status, snapshot = client.status(), client.snapshot()
        names = tuple(c.name for c in client.connections())
    return LiveEvidence(socket=socket, status=status, snapshot=snapshot, names=names)


def longest_round_trips(
    evidence: tuple[Evidence, ...], live: LiveEvidence | None
) -> dict[str, float]:
    """Return the longest FSoE cycle in ms of each connection that was observed on a real bus."""
    longest: dict[str, float] = {}

    def seen(name: str, ms: float | None) -> None:
        # Zero means that no frame was observed, and is not a time.
        if ms:
            longest[name] = max(ms, longest.get(name, 0.0))

    # Emulated runs prove nothing about the machine.
    for run in (e.run for e in evidence if e.run is not None and not e.run.emulated):
        for row in run.rows:
            seen(row.name, row.cycle_max)
    # The same applies to a running bus that is emulated.
    if live is not None and live.status.backend != "emulated":
        for name, c in zip(live.names, live.snapshot.cycle.connections, strict=False):
            seen(name, max(c.to_sub.interval_max_ns, c.to_main.interval_max_ns) / 1e6)
    return longest
