"""State of a running bus: the documents ``snapshot`` and ``layout``, as plain values.

`fsn-master` writes them as replies and into incident files (``master_core/src/control/reports``),
`fsoe_net.simulate.emulated_documents` for an emulated run; this module reads them all.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from typing import Any, TypeVar

from fsoe_net.core.json_object import JsonObject
from fsoe_net.core.snapshot import (
    ConnectionSnapshot,
    DirectionSnapshot,
    Histogram,
    Snapshot,
    Statistics,
)
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.parameters import NOT_OBSERVED, STATED_PARAMETERS, FsoeParameters
from fsoe_net.fsoe.pdu import is_frame_length

_Record = TypeVar(
    "_Record", Statistics, DirectionSnapshot, Histogram, "SubDeviceSnapshot", "LayoutSm"
)
_STATES = tuple(ConnectionState)


class Found(enum.IntEnum):
    """The device at the position of a SubDevice: ``enum fsn_found``."""

    UNKNOWN = 0
    NOTHING = 1
    RIGHT = 2
    IDENTITY = 3
    MAPPING = 4
    ADDRESS = 5
    SDO = 6
    STATE = 7
    CLOCK = 8
    ABSENT = 9
    MAILBOX = 10

    @classmethod
    def of(cls, number: int | None) -> Found:
        """Return the member with this number, or `UNKNOWN`."""
        return next((member for member in cls if member == number), cls.UNKNOWN)

    @property
    def text(self) -> str:
        """The same text as ``fsn_found_text()``."""
        return _FOUND[self]


_FOUND = {
    Found.UNKNOWN: "not looked at yet",
    Found.NOTHING: "does not answer",
    Found.RIGHT: "the SubDevice of the plan",
    Found.IDENTITY: "another device",
    Found.MAPPING: "other process data",
    Found.ADDRESS: "another FSoE address",
    Found.SDO: "refused a start-up SDO",
    Found.STATE: "refused a state",
    Found.CLOCK: "its clock cannot be set",
    Found.ABSENT: "absent, as it may be",
    Found.MAILBOX: "does not answer an SDO",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SubDeviceSnapshot:
    """State of one SubDevice of the plan.

    ``al`` is its AL state as a word, ``none`` if it does not answer, followed by ``+ERROR`` when
    the error flag is set; ``al_code`` its AL status code, ``None`` if not read. ``found``: the
    device at its position. ``detail``: the problem in words, e.g. the location of a broken cable;
    may be empty. ``fsoe_address``: its actual address if it differs from the plan, else 0;
    ``link_down``: it does not answer and the link before it is down. ``link``, ``link_lost``,
    ``rx_errors``: one number per port, empty if not counted. ``returns``: how often it was lost and
    answered again. ``known`` is false while the bus is not open.
    """

    name: str
    bus: int
    alias: int
    position: int
    known: bool
    al: str
    al_code: int | None
    found: Found
    detail: str
    vendor_id: int
    product_code: int
    revision: int
    returns: int
    stale_cycles: int
    link: tuple[int, ...]
    link_lost: tuple[int, ...]
    rx_errors: tuple[int, ...]
    fsoe_address: int = 0
    link_down: bool = False

    @property
    def found_text(self) -> str:
        """The device at its position, in words; empty if not checked."""
        return self.found.text if self.known else ""

    def to_json(self) -> dict[str, Any]:
        """Return the values in the form that documents of ``run`` and ``monitor`` use."""
        return asdict(self) | {"found": self.found_text, "found_code": int(self.found)}

    @property
    def identity(self) -> tuple[int, int]:
        """Vendor and product of the device found at its position."""
        return self.vendor_id, self.product_code

    @property
    def in_op(self) -> bool:
        """Whether it is in OP without an error."""
        return self.al == "OP"

    @property
    def is_absent(self) -> bool:
        """Whether it belongs to an absent group, which is not a fault."""
        return self.found is Found.ABSENT

    @property
    def answers(self) -> bool:
        """Whether it answers; true if not checked."""
        return not self.known or self.al != "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class BusSnapshot:
    """One cycle of a live bus and its SubDevices; connections and SubDevices in plan order."""

    cycle: Snapshot
    subdevices: tuple[SubDeviceSnapshot, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutSm:
    """A sync manager's place in the image."""

    subdevice: str
    sm: int
    is_output: bool
    offset_bytes: int
    size_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutDatagram:
    """A datagram's place in the image; ``expected_wkc`` is ``None`` while unknown."""

    offset_bytes: int
    size_bytes: int
    expected_wkc: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutCopy:
    """Bytes that are copied each cycle; ``name`` may be empty."""

    name: str = ""
    source_byte: int
    destination_byte: int
    size_bytes: int


_NO_COPY = LayoutCopy(source_byte=0, destination_byte=0, size_bytes=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedConnection:
    """Facts about a connection from files, a plan or a layout; ``None`` if not stated.

    ``safe_bytes``: lengths of the safe data to the sub and to the main, 0 without a plan;
    ``to_sub`` and ``to_main``: the copies of its frames, empty without a layout. ``cycle_ns``: the
    longest bus cycle between its ends, 0 with a single bus.
    """

    name: str
    net: str = ""
    main: str = ""
    sub: str = ""
    connection_id: int | None = None
    address: int | None = None
    watchdog_ms: int | None = None
    safe_bytes: tuple[int, int] = (0, 0)
    to_sub: LayoutCopy = _NO_COPY
    to_main: LayoutCopy = _NO_COPY
    cycle_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """The process image of the running plan; empty if the bus did not open."""

    image_bytes: int
    sms: tuple[LayoutSm, ...]
    datagrams: tuple[LayoutDatagram, ...]
    copies: tuple[LayoutCopy, ...]
    connections: tuple[PlannedConnection, ...]


# -- snapshot -------------------------------------------------------------------------------------


def read_snapshot(reply: JsonObject) -> BusSnapshot:
    """Return the values of a ``snapshot``; an invalid value raises `JsonObject.bad`."""
    return BusSnapshot(
        cycle=Snapshot(
            statistics=read_statistics(reply.child("statistics")),
            connections=read_connections(reply),
        ),
        subdevices=tuple(read_subdevice(row) for row in reply.children("subdevices")),
    )


def read_statistics(row: JsonObject) -> Statistics:
    """Return the counters of the cyclic thread; errors as in `read_snapshot`."""
    return _filled(Statistics, row)


def read_connections(reply: JsonObject) -> tuple[ConnectionSnapshot, ...]:
    """Return the connections of a ``snapshot``; errors as in `read_snapshot`."""
    return tuple(
        ConnectionSnapshot(
            **{key: row.label(key) for key in ("name", "net", "main", "sub")},
            state=_state(row),
            to_sub=_filled(DirectionSnapshot, row.child("to_sub")),
            to_main=_filled(DirectionSnapshot, row.child("to_main")),
            gaps=row.count("gaps"),
            observed=_parameters(row, "observed"),
            configured=_parameters(row, "configured"),
            differs=row.words("differs", STATED_PARAMETERS) if row.has("differs") else (),
        )
        for row in reply.children("connections")
    )


def _parameters(row: JsonObject, key: str) -> FsoeParameters:
    """Return parameters; an older `fsn-master` reports none."""
    if not row.has(key):
        return NOT_OBSERVED
    stated = row.child(key)
    return FsoeParameters(**{f.name: stated.optional(f.name) for f in fields(FsoeParameters)})


def _state(row: JsonObject) -> ConnectionState:
    number = row.whole("observed_state")
    if number >= len(_STATES):
        raise row.bad("observed_state", f"is {number}, not a state")
    return _STATES[number]


def _filled(kind: type[_Record], row: JsonObject, **values: Any) -> _Record:
    """Return a record whose fields are named like the keys, except the given ones."""
    read: dict[str, Callable[[str], Any]] = {
        "int": row.count,
        "int | None": row.optional,
        "bool": row.flag,
        "str": row.label,
        "tuple[int, ...]": row.numbers,
        "Histogram": lambda key: _histogram(row.child(key)),
    }
    return kind(
        **{f.name: read[str(f.type)](f.name) for f in fields(kind) if f.name not in values},
        **values,
    )


def _histogram(row: JsonObject) -> Histogram:
    percentiles = row.child("percentiles_ns")
    buckets = row.pairs("buckets")
    floors = [floor for floor, _ in buckets]
    # `Histogram.at_most` sums them up in this order.
    if floors != sorted(set(floors)) or any(times == 0 for _, times in buckets):
        raise row.bad("buckets", "do not rise")
    shares = {f"{key}_ns": percentiles.count(key) for key in ("p50", "p99", "p999")}
    return _filled(Histogram, row, buckets=buckets, **shares)


def read_subdevice(row: JsonObject) -> SubDeviceSnapshot:
    """Return the values of one SubDevice; errors as in `read_snapshot`."""
    known = row.flag("known")
    facts = row if known else row.empty()
    return _filled(
        SubDeviceSnapshot,
        facts,
        name=row.label("name"),
        bus=row.optional("bus") or 0,
        alias=row.count("alias"),
        position=row.count("position"),
        known=known,
        al=facts.label("al") or "none",
        al_code=facts.optional("al_code") if known else 0,
        found=Found.of(facts.optional("found")),
        stale_cycles=row.count("stale_cycles"),
    )


# -- layout ---------------------------------------------------------------------------------------


def read_layout(reply: JsonObject) -> Layout:
    """Return the values of a ``layout``; errors as in `read_snapshot`."""
    image_bytes = reply.count("image_bytes")
    return Layout(
        image_bytes=image_bytes,
        sms=tuple(_sm(row) for row in reply.children("sms")),
        datagrams=tuple(_datagram(row) for row in reply.children("datagrams")),
        copies=tuple(_copy(row, image_bytes) for row in reply.children("copies")),
        connections=tuple(_connection(row, image_bytes) for row in reply.children("connections")),
    )


def _sm(row: JsonObject) -> LayoutSm:
    return _filled(
        LayoutSm,
        row,
        is_output=row.label("direction") == "output",
        offset_bytes=row.whole("byte"),
        size_bytes=row.whole("bytes"),
    )


def _datagram(row: JsonObject) -> LayoutDatagram:
    return LayoutDatagram(
        offset_bytes=row.whole("byte"),
        size_bytes=row.whole("bytes"),
        expected_wkc=row.optional("expected_wkc"),
    )


def _copy(row: JsonObject, image_bytes: int) -> LayoutCopy:
    copy = LayoutCopy(
        name=row.label("name") if row.has("name") else "",
        source_byte=row.whole("source_byte"),
        destination_byte=row.whole("destination_byte"),
        size_bytes=row.whole("bytes"),
    )
    if max(copy.source_byte, copy.destination_byte) + copy.size_bytes > image_bytes:
        raise row.bad("source_byte", "lies outside the image")
    return copy


def _connection(row: JsonObject, image_bytes: int) -> PlannedConnection:
    return PlannedConnection(
        name=row.label("name"),
        main=row.label("main"),
        sub=row.label("sub"),
        address=row.optional("address"),
        connection_id=row.optional("connection_id"),
        watchdog_ms=row.optional("watchdog_ms"),
        to_sub=_frames(row.child("to_sub"), image_bytes),
        to_main=_frames(row.child("to_main"), image_bytes),
    )


def _frames(row: JsonObject, image_bytes: int) -> LayoutCopy:
    copy = _copy(row, image_bytes)
    if not is_frame_length(copy.size_bytes):
        raise row.bad("bytes", f"is {copy.size_bytes}: no FSoE frame has this length")
    return copy
