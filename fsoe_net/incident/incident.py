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
    """Reason why the file was written."""

    LEFT_DATA = "left_data"
    """A connection has left Data."""
    NOT_CONNECTED = "not_connected"
    """A connection did not reach Data although every SubDevice was in OP."""
    REFUSED = "refused"
    """A SubDevice differs from the plan, or rejects a state or an object, while the bus runs."""
    BUS_FAILED = "bus_failed"
    """The bus did not open; the file has no cycles."""
    REQUEST = "request"
    """A client requested it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BusFault:
    """Reason why the bus did not open.

    ``status``: name of an ``fsn_status``; ``subdevice``: the first that differs from the plan; may
    be empty; ``link_down``: an interface has no link.
    """

    status: str
    subdevice: str = ""
    link_down: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Trigger:
    """The moment. ``before`` and ``after`` are ``None`` if no connection is the cause.

    ``reset_by`` is ``main`` or ``sub``. ``subdevice`` is set for `TriggerKind.REFUSED` only,
    otherwise empty. ``fault`` is set for `TriggerKind.BUS_FAILED` only, otherwise ``None``.
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
    """One event as received by subscribers; ``keys`` are its further values as text."""

    event: str
    now_ns: int
    level: str
    text: str
    keys: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeSetting:
    """One connection as stored in the device itself; ``None`` if not read."""

    address: int | None
    connection_id: int | None
    watchdog_ms: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeFacts:
    """The report of a SubDevice about its FSoE ends."""

    subdevice: str
    address: int | None
    connections: tuple[FsoeSetting, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleRecord:
    """One cycle of the window.

    ``wkc`` is expected and actual working counter, ``None`` if complete. ``image`` is the process
    data at the end of the cycle: inputs as received, outputs as sent; ``None`` if unknown.
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
    """First line of the file. ``plan`` is ``None`` if its bytes are invalid: see ``remarks``.

    ``counters`` is ``None`` and the layout is empty if the bus did not open. ``ring_place``: where
    the ring was open when the file was written; empty if it was closed, or there is no ring.
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
