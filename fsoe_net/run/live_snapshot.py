"""What ``fsn-master`` says about its bus, as plain values; made from the replies of its socket."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from fsoe_net.core.snapshot import (
    ConnectionSnapshot,
    DirectionSnapshot,
    Histogram,
    Snapshot,
    Statistics,
)
from fsoe_net.fsoe.monitor import OutsideState

__all__ = [
    "LiveSnapshot",
    "SubDeviceSnapshot",
    "read_connection",
    "read_snapshot",
    "read_subdevice",
]

_HISTOGRAMS = ("latency", "period", "work", "copy", "round_trip", "dc_offset")


@dataclass(frozen=True, slots=True, kw_only=True)
class SubDeviceSnapshot:
    """What is known about one SubDevice of the plan.

    ``al`` is its AL state as a word, ``none`` when it does not answer, with ``+ERROR`` behind it
    when the error flag is set; ``al_code`` its AL status code. ``found``: what stands in its place,
    in words; ``detail``: what is wrong with it, e.g. where a cable is broken; empty when nothing
    is. ``link``, ``link_lost``, ``rx_errors``: one number per port. ``returns``: how often it was
    lost and came back. ``known`` is false while the bus is not open.
    """

    name: str
    alias: int
    position: int
    known: bool
    al: str
    al_code: int
    found: str
    detail: str
    vendor_id: int
    product_code: int
    revision: int
    returns: int
    stale_cycles: int
    link: tuple[int, ...]
    link_lost: tuple[int, ...]
    rx_errors: tuple[int, ...]

    @property
    def in_op(self) -> bool:
        """Whether it is in OP without an error."""
        return self.al == "OP"


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSnapshot:
    """One cycle of a live bus, and its SubDevices; both in plan order."""

    cycle: Snapshot
    subdevices: tuple[SubDeviceSnapshot, ...]


def read_snapshot(reply: Mapping[str, Any]) -> LiveSnapshot:
    """Return the values of a ``snapshot`` reply.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: The reply has not the form it should have.
    """
    return LiveSnapshot(
        cycle=Snapshot(
            statistics=_statistics(reply["statistics"]),
            connections=tuple(read_connection(c) for c in reply["connections"]),
        ),
        subdevices=tuple(read_subdevice(s) for s in reply["subdevices"]),
    )


def read_subdevice(row: Mapping[str, Any]) -> SubDeviceSnapshot:
    """Return the values of one SubDevice; raises as `read_snapshot`."""
    known = bool(row["known"])
    return SubDeviceSnapshot(
        name=str(row["name"]),
        alias=int(row["alias"]),
        position=int(row["position"]),
        known=known,
        al=str(row["al"]) if known else "none",
        al_code=int(row["al_code"]) if known else 0,
        found=str(row["found_text"]) if known else "",
        detail=str(row["detail"]) if known else "",
        vendor_id=int(row["vendor_id"]) if known else 0,
        product_code=int(row["product_code"]) if known else 0,
        revision=int(row["revision"]) if known else 0,
        returns=int(row["returns"]) if known else 0,
        stale_cycles=int(row["stale_cycles"]),
        link=_numbers(row["link"]) if known else (),
        link_lost=_numbers(row["link_lost"]) if known else (),
        rx_errors=_numbers(row["rx_errors"]) if known else (),
    )


def _numbers(row: Sequence[Any]) -> tuple[int, ...]:
    return tuple(int(n) for n in row)


def _statistics(row: Mapping[str, Any]) -> Statistics:
    values: dict[str, Any] = {}
    for field in fields(Statistics):
        if field.name in _HISTOGRAMS:
            values[field.name] = _histogram(row[field.name])
        elif field.name in ("realtime", "locked"):
            values[field.name] = bool(row[field.name])
        else:
            values[field.name] = int(row[field.name])
    return Statistics(**values)


def _histogram(row: Mapping[str, Any]) -> Histogram:
    count = int(row["count"])
    percentiles = row["percentiles_ns"]
    return Histogram(
        count=count,
        min_ns=int(row["min_ns"]),
        mean_ns=int(row["sum_ns"]) // count if count else 0,
        p50_ns=int(percentiles["p50"]),
        p99_ns=int(percentiles["p99"]),
        p999_ns=int(percentiles["p999"]),
        max_ns=int(row["max_ns"]),
        buckets=tuple((int(floor), int(times)) for floor, times in row["buckets"]),
    )


def read_connection(row: Mapping[str, Any]) -> ConnectionSnapshot:
    """Return the values of one connection; raises as `read_snapshot`."""
    return ConnectionSnapshot(
        state=OutsideState(row["outside"]),
        to_sub=_direction(row["to_sub"]),
        to_main=_direction(row["to_main"]),
        gaps=int(row["gaps"]),
    )


def _direction(row: Mapping[str, Any]) -> DirectionSnapshot:
    intervals = int(row["intervals"])
    return DirectionSnapshot(
        command=int(row["command"]),
        connection_id=int(row["connection_id"]),
        reset_code=int(row["reset_code"]),
        frames=int(row["frames"]),
        process_data=int(row["process_data"]),
        failsafe_data=int(row["failsafe_data"]),
        right=int(row["right"]),
        wrong=int(row["wrong"]),
        unchecked=int(row["unchecked"]),
        resets=int(row["resets"]),
        last_new_ns=int(row["last_new_ns"]),
        cycle_last_ns=int(row["interval_last_ns"]),
        cycle_min_ns=int(row["interval_min_ns"]),
        cycle_mean_ns=int(row["interval_sum_ns"]) // intervals if intervals else 0,
        cycle_max_ns=int(row["interval_max_ns"]),
    )
