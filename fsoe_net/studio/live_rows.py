"""Rows of the live page for a running bus, an emulated run or a recorded one; see types.d.ts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any

from fsoe_net.core.bus_documents import Found, SubDeviceSnapshot
from fsoe_net.core.snapshot import bars_of
from fsoe_net.errors import InputError
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.parameters import FsoeParameters
from fsoe_net.live.health import (
    FsoeHealth,
    Health,
    HealthReason,
    SubDeviceHealth,
    health_texts,
    subdevice_health,
)
from fsoe_net.live.result import (
    ConnectionResult,
    RunEvent,
    RunEventKind,
    result_health,
)
from fsoe_net.model.kinds import SubDeviceKind
from fsoe_net.studio.live_cabling import bus_row

Row = dict[str, object]

_COUNTERS = (
    "cycles",
    "overruns",
    "wkc_errors",
    "expected_wkc",
    "actual_wkc",
    "lost_frames",
)
_HISTOGRAMS = ("period", "latency", "work", "round_trip")
_MOST_EVENTS = 100_000


def event_row(event: RunEvent) -> Row:
    """Return an event."""
    return {
        "time_ms": round(event.time_ms, 3),
        "source": event.source,
        "text": event.text,
        "kind": event.kind,
        "end": event.end,
        "state": event.state,
    }


def connection_row(result: ConnectionResult, health: FsoeHealth, *, cause: str, held: int) -> Row:
    """Return a connection.

    Args:
        result: The connection in a run or on the wire.
        health: Health of the connection.
        cause: Cause of its last Reset, in words.
        held: Cycles in which inputs of its ends contained old bytes.
    """
    return {
        "name": result.name,
        "main": result.main,
        "sub": result.sub,
        "state": result.state.text,
        "in_data": result.state.in_data,
        "absent": HealthReason.END_ABSENT in health.reasons,
        **health_row(health),
        "connection_id": result.connection_id,
        "address": result.address,
        "watchdog_ms": result.watchdog_ms,
        "last_ms": round(result.fsoe_cycle_ms["last"], 3),
        "mean_ms": round(result.fsoe_cycle_ms["mean"], 3),
        "max_ms": round(result.fsoe_cycle_ms["max"], 3),
        "share": health.share,
        "wrong": result.wrong_to_sub + result.wrong_to_main,
        "gaps": result.gaps,
        "held": held,
        "resets": result.resets,
        "cause": cause,
        "differences": list(result.differences),
        "chosen": list(result.chosen),
    }


def health_row(health: Health) -> Row:
    """Return the level of a subject, and its reasons in words."""
    return {"level": health.level.name.lower(), "reasons": health_texts(health)}


def subdevice_row(health: SubDeviceHealth) -> Row:
    """Return a SubDevice: AL state, health and links."""
    subdevice = health.seen
    links = [
        {"port": port, "up": bool(up), "lost": lost}
        for port, (up, lost) in enumerate(
            zip(subdevice.link, subdevice.link_lost or (0,) * len(subdevice.link), strict=False)
        )
    ]
    return {
        "name": subdevice.name,
        "known": subdevice.known,
        "al": subdevice.al,
        "al_code": subdevice.al_code,
        **health_row(health),
        "returns": subdevice.returns,
        "held": subdevice.stale_cycles,
        "links": links,
        "rx_errors": sum(subdevice.rx_errors),
    }


def statistics_row(statistics: Mapping[str, Any]) -> Row:
    """Return counters and histograms of a bus cycle, from `Statistics.to_json`."""
    histograms = {
        name: {
            **{key: int(h[key]) for key in ("count", "mean_ns", "p99_ns", "max_ns")},
            "bars": [
                [first, times]
                for first, _, times in bars_of((int(f), int(n)) for f, n in h["buckets"])
            ],
        }
        for name in _HISTOGRAMS
        if (h := statistics[name])["buckets"]
    }
    return {name: int(statistics[name]) for name in _COUNTERS} | {"histograms": histograms}


# -- a recorded run -------------------------------------------------------------------------------


def recorded_view(document: object) -> Row:
    """Return the view of a document of ``fsoe-net run`` or ``monitor --format json``.

    Raises:
        InputError: It is another type of document, or damaged.
    """
    try:
        if not isinstance(document, dict) or document["tool"] != "fsoe-net":
            raise ValueError("it names another tool")
        return _recorded(document)
    except (KeyError, TypeError, ValueError, AttributeError) as exc:
        raise InputError(
            f"this is not a recorded run ({type(exc).__name__}: {exc}); `fsoe-net run network.yaml "
            "--format json > run.json` and `fsoe-net monitor --format json` write one"
        ) from exc


def _recorded(document: dict[str, Any]) -> Row:
    events = [_event(row) for row in document["events"]]
    # A file of a user: its size must not determine the memory used by the page.
    if len(events) > _MOST_EVENTS:
        raise ValueError(f"more than {_MOST_EVENTS} events")
    subdevices = [_subdevice(row) for row in document["subdevices"]]
    statistics = document["statistics"]
    mains = {str(row["main"]): SubDeviceKind.LOGIC for row in document["connections"]}
    return {
        "title": str(document.get("network") or document.get("socket") or ""),
        "state": "recorded",
        "away": str(document.get("away") or ""),
        "current": True,
        "good": document["result"] == "pass",
        "ended": True,
        "now_ms": float(document["duration_ms"]),
        "pace": None,
        "content": None,
        "notes": [],
        "machine": None,
        "connections": [_connection(row, subdevices) for row in document["connections"]],
        "subdevices": [subdevice_row(subdevice_health(s)) for s in subdevices],
        "bus": None,
        "statistics": None if statistics is None else statistics_row(statistics),
        "first": 0,
        "left_out": int(document["events_lost"]),
        "events": [event_row(event) for event in events],
        "picture": bus_row(subdevices, mains),
    }


def _event(row: Mapping[str, Any]) -> RunEvent:
    code = row.get("code")
    return RunEvent(
        time_ms=float(row["time_ms"]),
        source=str(row["source"]),
        text=str(row["text"]),
        code=None if code is None else int(code),
        kind=RunEventKind(row.get("kind", "other")),
        end=str(row.get("end", "")),
        state=str(row.get("state", "")),
        in_data=bool(row.get("in_data")),
    )


def _subdevice(row: Mapping[str, Any]) -> SubDeviceSnapshot:
    facts = {"fsoe_address": 0, "link_down": False, **row, "found": row.get("found_code")}
    return SubDeviceSnapshot(**_values(SubDeviceSnapshot, facts))


def _optional(make: Callable[[Any], object]) -> Callable[[Any], object]:
    return lambda value: None if value is None else make(value)


# By the type of a field: the value in the document is converted to it, or rejected.
_MAKE: dict[str, Callable[[Any], object]] = {
    "str": str,
    "int": int,
    "bool": bool,
    "Found": Found.of,
    "str | None": _optional(str),
    "int | None": _optional(int),
    "float | None": _optional(float),
    "tuple[str, ...]": lambda rows: tuple(map(str, rows)),
    "tuple[int, ...]": lambda rows: tuple(map(int, rows)),
    "Mapping[str, float]": lambda row: {str(key): float(ms) for key, ms in row.items()},
    "ConnectionState": ConnectionState,
    "FsoeParameters": lambda row: FsoeParameters(**row),
}


def _values(
    kind: type[SubDeviceSnapshot] | type[ConnectionResult], row: Mapping[str, Any]
) -> dict[str, Any]:
    return {f.name: _MAKE[str(f.type)](row[f.name]) for f in fields(kind)}


def _connection(row: Mapping[str, Any], subdevices: Sequence[SubDeviceSnapshot]) -> Row:
    result = ConnectionResult(**_values(ConnectionResult, row))
    share = row.get("watchdog_share")
    return connection_row(
        result,
        result_health(result, subdevices, share=None if share is None else float(share)),
        cause=str(row.get("cause") or result.last_reset_text),
        held=int(row.get("held_main", 0)) + int(row.get("held_sub", 0)),
    )
