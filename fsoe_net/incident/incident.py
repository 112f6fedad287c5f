"""Content of an incident file (``.fsnincident``) as plain values.

Line 1 is the head, every further line one cycle, the last one marks a complete file; see
``docs/reference/incident-file.md``. `incident_read` reads such files, `incident_write` writes them.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass

from fsoe_net.core.bus_documents import Layout, SubDeviceSnapshot
from fsoe_net.core.snapshot import ConnectionSnapshot, Statistics
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.plan.model import Plan


class TriggerKind(enum.Enum):
    """Why the file was written."""

    LEFT_DATA = "left_data"
    """A connection was in Data and no longer is."""
    NOT_CONNECTED = "not_connected"
    """A connection did not come to Data though every SubDevice was in OP."""
    REFUSED = "refused"
    """A SubDevice is not as planned, or refuses a state or an object, while the bus runs."""
    BUS_FAILED = "bus_failed"
    """The bus did not open; the file has no cycles."""
    REQUEST = "request"
    """A client requested it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BusFault:
    """Why the bus did not open.

    ``status``: name of an ``fsn_status``; ``subdevice``: the first that is not as planned, may be
    empty; ``link_down``: an interface has no link.
    """

    status: str
    subdevice: str = ""
    link_down: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Trigger:
    """The moment. ``before`` and ``after`` are ``None`` where no connection is the cause.

    ``reset_by`` is ``main`` or ``sub``. ``subdevice`` is the one that refuses; empty with every
    other kind. ``fault`` is that of `TriggerKind.BUS_FAILED`, ``None`` with every other kind.
    """

    kind: TriggerKind
    connection: str = ""
    subdevice: str = ""
    before: ConnectionState | None = None
    after: ConnectionState | None = None
    reset_by: str = ""
    reset_code: int | None = None
    cycle: int = 0
    now_ns: int = 0
    text: str = ""
    fault: BusFault | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class IncidentEvent:
    """One event as subscribers get it; ``keys`` are its further values as text."""

    event: str
    now_ns: int
    level: str
    text: str
    keys: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeSetting:
    """One connection as a device itself holds it; ``None`` is not read."""

    address: int | None
    connection_id: int | None
    watchdog_ms: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeFacts:
    """Report of a SubDevice about its FSoE ends."""

    subdevice: str
    address: int | None
    connections: tuple[FsoeSetting, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleRecord:
    """One cycle of the window.

    ``wkc`` is expected and actual working counter, ``None`` when complete. ``image`` is the process
    data at the end of the cycle: inputs as received, outputs as sent; ``None`` when not known.
    """

    cycle: int
    now_ns: int
    late_ns: int = 0
    work_ns: int = 0
    round_ns: int = 0
    lost: int = 0
    old: int = 0
    foreign: int = 0
    wkc: tuple[int, int] | None = None
    image: bytes | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class IncidentHead:
    """First line of the file. ``plan`` is ``None`` when its bytes cannot be used: see ``remarks``.

    ``counters`` are ``None`` and the layout is empty when the bus did not open. ``ring_place``:
    where the ring was open when the file was written; empty when it was closed, or no ring.
    """

    utc: str
    version: str
    interface: str
    backend: str
    plan_file: str
    plan_sha256: str
    plan: Plan | None
    cycle_ns: int
    trigger: Trigger
    counters: Statistics | None
    connections: tuple[ConnectionSnapshot, ...]
    subdevices: tuple[SubDeviceSnapshot, ...]
    events: tuple[IncidentEvent, ...]
    layout: Layout
    fsoe: tuple[FsoeFacts, ...]
    remarks: tuple[str, ...] = ()
    ring_place: str = ""
