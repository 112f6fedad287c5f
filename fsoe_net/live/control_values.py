"""Replies of ``fsn-master`` as plain values.

Each ``read_…`` function converts a reply and raises KeyError, TypeError, ValueError or
AttributeError if its form is invalid; `Client` converts these to one message.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, TypeVar

from fsoe_net.diag.words import counted
from fsoe_net.errors import PlanFormatError
from fsoe_net.plan.fingerprint import Fingerprint, fingerprint_from_json

_Record = TypeVar("_Record", "Status", "ClocksStatus", "StandbyStatus", "BusStatus", "CycleClient")

Value = bool | int | float | None
"""A value of the process image; ``None`` for a real that is NaN."""


class BusState(enum.StrEnum):
    """State of ``fsn-master``."""

    STOPPED = "stopped"
    OPENING = "opening"
    STARTING = "starting"
    STANDBY = "standby"
    RUNNING = "running"
    STOPPING = "stopping"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class LogStatus:
    """The intervention log: its last ``entry``, with the SHA-256 of the line.

    ``fault``: why it cannot be written; empty if it can.
    """

    entry: int
    sha256: str
    fault: str


@dataclass(frozen=True, slots=True, kw_only=True)
class StandbyStatus:
    """The process that takes over the bus when the cycle stops, except while it is ``held``."""

    pid: int
    held: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RingStatus:
    """A bus between two interfaces: ``state`` is ``closed``, ``open``, ``one way`` or ``unknown``.

    ``ways``: for each interface, whether frames that enter there leave at the other one.
    ``breaks``: how often it was found open since the bus opened. ``place``: where it is open; empty
    if it is closed.
    """

    state: str
    ways: tuple[bool, bool]
    breaks: int
    place: str

    @property
    def text(self) -> str:
        """The status as one line of text."""
        return f"ring {self.state}" + f": {self.place}" * bool(self.place)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClocksStatus:
    """Distributed clocks.

    ``state``: ``synchronous``; ``apart``; ``no reference`` if no frame carries the time of the
    reference clock; ``unknown`` if there is nothing to compare. ``set_by``: ``bus`` if the
    cycle follows the clock of ``reference``, ``host`` if this machine sets it. ``subdevices``:
    number of compared clocks; ``outside`` of them are outside the window. ``place``: the
    furthest one, or the lost reference. ``leaves``: how often clocks left the window since the
    bus opened. The last frame reached the reference clock ``lead_ns`` before SYNC0; the target
    is ``shift_ns``.
    """

    state: str
    set_by: str
    reference: str
    subdevices: int
    outside: int
    leaves: int
    window_ns: int
    worst_ns: int
    shift_ns: int
    lead_ns: int
    place: str

    @property
    def text(self) -> str:
        """The status as one line of text."""
        within = f"all within {self.worst_ns} ns of {self.reference}" * bool(self.subdevices)
        detail = self.place or within
        return f"distributed clocks {self.state}" + f": {detail}" * bool(detail)


@dataclass(frozen=True, slots=True, kw_only=True)
class BusStatus:
    """One of several buses. Its cycle is in nanoseconds; counts are since the bus was opened."""

    name: str
    interface: str
    cycle_ns: int
    cycles: int
    overruns: int
    wkc_errors: int
    lost_frames: int
    expected_wkc: int
    actual_wkc: int
    realtime: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleClient:
    """A real-time client: its number, number of owned outputs, and statistics.

    ``state``: ``reads`` without outputs, otherwise ``waits`` before the first ones, ``runs`` or
    ``late``. ``on_time``: outputs sent with the frame after the inputs they answer; ``late``: sent
    with a later frame; ``missed``: cycles without new outputs, of which ``misses`` in a row are
    allowed; ``torn``: cycles in which the outputs were overwritten repeatedly.
    """

    client: int
    outputs: int
    misses: int
    state: str
    on_time: int
    late: int
    missed: int
    torn: int

    @property
    def text(self) -> str:
        """The client as one line of text."""
        if not self.outputs:
            return f"client {self.client} reads in the cycle"
        return (
            f"client {self.client} in the cycle: {self.state}, {counted(self.outputs, 'output')}; "
            f"sent {self.on_time} times in time, {self.late} late; "
            f"{counted(self.missed, 'cycle')} without, {self.misses} in a row allowed"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupStatus:
    """SubDevices that may be absent. ``place``: that of the alternatives; empty without any.

    ``state``: ``absent``, ``wrong`` (an unexpected device is attached), ``coming`` (not yet
        completely in OP), ``there``; empty while the bus is not open. ``detail``: the error.
    """

    name: str
    place: str
    state: str
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """State of program and bus; ``planned``, ``in_op`` and ``missing`` count SubDevices.

    ``fault``: why the bus did not open; empty if it did. ``fingerprint``: that of the plan as
    loaded by the core, ``None`` if the program does not report it; ``version``: that of the engine.
    ``None``: ``ring`` with one interface, ``clocks`` if none are in use, ``standby`` without a
    standby process, ``interventions`` without an intervention log, ``cpu`` if the cyclic thread may
    run on any CPU. ``xdp``: sockets of the host do not see the frames of the cycle. ``buses`` is
    empty with a single bus; with several, counts outside it are totals, in cycles of the first bus.
    ``in_cycle``: real-time clients. ``absent`` SubDevices
    belong to ``groups`` and are not ``missing``.
    """

    state: BusState
    fault: str
    backend: str
    interface: str
    redundant: str
    xdp: bool
    plan: str
    plan_sha256: str
    fingerprint: Fingerprint | None
    version: str
    accepted: bool
    interventions: LogStatus | None
    uptime_ns: int
    clients: int
    cycle_ns: int
    free_run: bool
    policy: str
    priority: int
    cpu: int | None
    ring: RingStatus | None
    clocks: ClocksStatus | None
    standby: StandbyStatus | None
    cycles: int
    overruns: int
    wkc_errors: int
    expected_wkc: int
    actual_wkc: int
    realtime: bool
    locked: bool
    planned: int
    in_op: int
    missing: int
    buses: tuple[BusStatus, ...] = ()
    in_cycle: tuple[CycleClient, ...] = ()
    absent: int = 0
    groups: tuple[GroupStatus, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Symbol:
    """A named input or output of the process image.

    ``name`` is unique among the inputs or among the outputs. ``index`` and ``subindex`` are those
    of its object; 0 for a part of one. ``kind`` is ``bool``, ``signed``, ``unsigned``, ``bits`` or
    ``real``. ``open``: an output that clients may write. ``client``: number of the client that
    writes it, or ``None``. ``factor`` and ``offset``: a typed value is ``factor * raw + offset``.
    """

    name: str
    subdevice: str
    is_output: bool
    index: int
    subindex: int
    kind: str
    bits: int
    open: bool
    restart_relevant: bool
    stop_value: Value
    client: int | None
    factor: float
    offset: float

    @property
    def entry(self) -> str:
        """Its name inside the SubDevice, e.g. ``0x6040:00``."""
        return self.name.removeprefix(f"{self.subdevice}.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Values:
    """Inputs and outputs of one cycle by name; an input and an output may share a name."""

    cycle: int
    inputs: Mapping[str, Value]
    outputs: Mapping[str, Value]

    def side(self, is_output: bool) -> Mapping[str, Value]:
        """Return the outputs or the inputs."""
        return self.outputs if is_output else self.inputs


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedCycle(Values):
    """One watched cycle: values or, with the whole image, ``image`` and its working counters.

    ``skipped``: number of requested cycles missing before this one, because this client or the
        recorder was too slow.
    """

    now_ns: int
    skipped: int
    image: bytes | None = None
    expected_wkc: int = 0
    actual_wkc: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SdoValue:
    """An object that was read; ``value`` is ``None`` if no type was given."""

    data: bytes
    value: Value | str


@dataclass(frozen=True, slots=True, kw_only=True)
class HistoryMessage:
    """One message of a SubDevice's diagnosis history, object 0x10F3."""

    number: int
    flags: int
    time_ns: int
    text_id: int
    kind: str
    parameters: tuple[Any, ...]
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanReply:
    """Result of a scan; ``document`` is the complete scan, see control-protocol.md."""

    utc: str
    interface: str
    backend: str
    states_changed: bool
    subdevices: tuple[Mapping[str, Any], ...]
    document: Mapping[str, Any]


def read_state(reply: Mapping[str, Any]) -> BusState:
    """Return the state of a reply."""
    return BusState(reply["state"])


def read_status(reply: Mapping[str, Any]) -> Status:
    """Return the values of a ``status`` reply."""
    row = {**reply, **reply["subdevices"], "state": BusState(reply["state"])}
    # C reports `null` for an empty text; the fields of `Status` are plain strings.
    row |= {k: row[k] or "" for k in ("fault", "interface", "redundant", "plan")}
    row["ring"] = None if (ring := reply.get("ring")) is None else _ring(ring)
    clocks = reply.get("clocks")
    row["clocks"] = None if clocks is None else _known(ClocksStatus, clocks)
    standby = reply.get("standby")
    row["standby"] = None if standby is None else _known(StandbyStatus, standby)
    row["interventions"] = _log_status(reply.get("interventions"))
    reported = reply.get("fingerprint")
    row["fingerprint"] = None if reported is None else _fingerprint(reported)
    row["version"] = "" if reported is None else str(reported["version"])
    row["buses"] = tuple(map(_bus_status, reply.get("buses", ())))
    row["in_cycle"] = tuple(_known(CycleClient, client) for client in reply.get("in_cycle", ()))
    row["absent"] = int(reply["subdevices"].get("absent", 0))
    row["groups"] = tuple(map(_group_status, reply.get("groups", ())))
    return _known(Status, row)


def _known(kind: type[_Record], row: Mapping[str, Any]) -> _Record:
    """Return a record from its keys: a newer fsn-master may report more than this version reads."""
    return kind(**{f.name: row[f.name] for f in fields(kind)})


def _ring(row: Mapping[str, Any]) -> RingStatus:
    first, second = row["ways"]
    return RingStatus(
        state=str(row["state"]),
        ways=(bool(first), bool(second)),
        breaks=int(row["breaks"]),
        place=str(row["place"]),
    )


def _bus_status(row: Mapping[str, Any]) -> BusStatus:
    return _known(BusStatus, {**row, "interface": row["interface"] or ""})


def _group_status(row: Mapping[str, Any]) -> GroupStatus:
    return GroupStatus(**{f.name: str(row[f.name] or "") for f in fields(GroupStatus)})


def _log_status(row: Mapping[str, Any] | None) -> LogStatus | None:
    if row is None:
        return None
    return LogStatus(
        entry=int(row["entry"]), sha256=str(row["hash"] or ""), fault=str(row["error"] or "")
    )


def _fingerprint(reported: object) -> Fingerprint:
    try:
        return fingerprint_from_json(reported)
    except PlanFormatError as exc:
        raise ValueError(str(exc)) from exc


def read_symbols(reply: Mapping[str, Any]) -> tuple[Symbol, ...]:
    """Return the values of a ``symbols`` reply."""
    return tuple(_symbol(row) for row in reply["symbols"])


def _symbol(row: Mapping[str, Any]) -> Symbol:
    client = row.get("client")
    return Symbol(
        name=str(row["name"]),
        subdevice=str(row["subdevice"]),
        is_output=row["direction"] == "output",
        index=int(row["index"]),
        subindex=int(row["subindex"]),
        kind=str(row["type"]),
        bits=int(row["bits"]),
        open=bool(row["open"]),
        restart_relevant=bool(row.get("restart_relevant", False)),
        stop_value=row.get("stop_value"),
        client=None if client is None else int(client),
        factor=float(row.get("factor", 1.0)),
        offset=float(row.get("offset", 0.0)),
    )


def read_values(reply: Mapping[str, Any]) -> Values:
    """Return the values of a ``get`` reply."""
    return Values(
        cycle=int(reply["cycle"]), inputs=dict(reply["inputs"]), outputs=dict(reply["outputs"])
    )


def read_watched(event: Mapping[str, Any], dropped: int = 0) -> WatchedCycle:
    """Return one event of ``watch``; ``dropped`` more were dropped on this side."""
    image = event.get("image")
    return WatchedCycle(
        cycle=int(event["cycle"]),
        now_ns=int(event["now_ns"]),
        skipped=int(event.get("skipped", 0)) + dropped,
        inputs=dict(event.get("inputs", {})),
        outputs=dict(event.get("outputs", {})),
        image=None if image is None else bytes.fromhex(image),
        expected_wkc=int(event.get("expected_wkc", 0)),
        actual_wkc=int(event.get("actual_wkc", 0)),
    )


def read_sdo(reply: Mapping[str, Any]) -> SdoValue:
    """Return the values of an ``sdo-read`` reply."""
    return SdoValue(data=bytes.fromhex(reply["data"]), value=reply.get("value"))


def read_history(reply: Mapping[str, Any]) -> tuple[HistoryMessage, ...]:
    """Return the values of a ``history`` reply."""
    return tuple(
        HistoryMessage(
            number=int(row["id"]),
            flags=int(row["flags"]),
            time_ns=int(row["time_ns"]),
            text_id=int(row["text_id"]),
            kind=str(row["kind"]),
            parameters=tuple(row["parameters"]),
            data=bytes.fromhex(row["data"]),
        )
        for row in reply["messages"]
    )


def read_scan(reply: Mapping[str, Any]) -> ScanReply:
    """Return the values of a ``scan`` reply."""
    return ScanReply(
        utc=str(reply["utc"]),
        interface=str(reply.get("interface") or ""),
        backend=str(reply["backend"]),
        states_changed=bool(reply["states_changed"]),
        subdevices=tuple(dict(row) for row in reply["subdevices"]),
        document={k: v for k, v in reply.items() if k not in ("ok", "tag")},
    )
