"""What an incident file (``.fsnincident``) holds, as plain values.

Line 1 is the head, every further line one cycle, the last one says that the file is whole; see
``docs/reference/incident-file.md``. `incident_read` reads such files, `incident_write` writes them.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass

from fsoe_net.core.snapshot import Histogram
from fsoe_net.plan.model import Plan

__all__ = [
    "Area",
    "Counters",
    "CycleRecord",
    "DirectionSeen",
    "FsoeFacts",
    "FsoeSetting",
    "IncidentEvent",
    "IncidentHead",
    "LinkSeen",
    "Places",
    "SubDeviceSeen",
    "Trigger",
    "TriggerKind",
]


class TriggerKind(enum.Enum):
    """Why the file was written."""

    LEFT_DATA = "left_data"
    """A connection was in Data and no longer is."""
    NOT_CONNECTED = "not_connected"
    """A connection did not come to Data though every SubDevice was in OP."""
    REFUSED = "refused"
    """A SubDevice is not as planned, or refuses a state or an object, while the bus runs."""
    BUS_FAILED = "bus_failed"
    """The bus did not open; there are no cycles."""
    REQUEST = "request"
    """Somebody asked for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trigger:
    """The moment. ``before`` and ``after`` are state words; ``reset_by`` is ``main`` or ``sub``.

    ``subdevice`` is the one that refuses; empty with every other kind.
    """

    kind: TriggerKind
    connection: str = ""
    subdevice: str = ""
    before: str = ""
    after: str = ""
    reset_by: str = ""
    reset_code: int | None = None
    cycle: int = 0
    now_ns: int = 0
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Counters:
    """Statistics of the cyclic thread that matter here; histograms are those it has filled."""

    cycles: int = 0
    overruns: int = 0
    wkc_errors: int = 0
    lost_frames: int = 0
    old_replies: int = 0
    foreign_frames: int = 0
    unsent_frames: int = 0
    send_errno: int = 0
    expected_wkc: int = 0
    actual_wkc: int = 0
    realtime: bool = False
    histograms: Mapping[str, Histogram]


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionSeen:
    """One direction of a connection since the start; times between new data frames."""

    frames: int = 0
    wrong: int = 0
    resets: int = 0
    reset_code: int = 0
    interval_mean_ns: int = 0
    interval_max_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSeen:
    """One connection as the MainDevice saw it when the file was written."""

    name: str
    main: str
    sub: str
    state: str
    to_sub: DirectionSeen
    to_main: DirectionSeen


@dataclass(frozen=True, slots=True, kw_only=True)
class SubDeviceSeen:
    """One SubDevice as the bus knew it; ``al`` is a word, ``none`` when it does not answer.

    ``found`` and ``detail`` are the bus's own words; ``known`` is false when it never looked.
    ``identity``: vendor, product and revision as found.
    """

    name: str
    position: int
    known: bool
    al: str
    al_code: int
    found: str
    detail: str
    returns: int
    stale_cycles: int
    identity: tuple[int, int, int]
    link_lost: tuple[int, ...]
    rx_errors: tuple[int, ...]

    @property
    def answers(self) -> bool:
        """Whether it answered at the end; true when nobody looked."""
        return not self.known or self.al != "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class IncidentEvent:
    """One event as subscribers were told; ``keys`` are its further values as text."""

    event: str
    now_ns: int
    level: str
    text: str
    keys: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Area:
    """Where the frames of one direction lie in the process image."""

    source_byte: int
    destination_byte: int
    size_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Places:
    """Both directions of one connection in the process image."""

    name: str
    to_sub: Area
    to_main: Area


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeSetting:
    """One connection as a device itself holds it; ``None`` is not read."""

    address: int | None
    connection_id: int | None
    watchdog_ms: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeFacts:
    """What a SubDevice says about its FSoE ends."""

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

    ``places`` are those of the layout the bus had, ``areas`` its sync managers as first byte and
    length; both empty when it had none.
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
    counters: Counters
    connections: tuple[LinkSeen, ...]
    subdevices: tuple[SubDeviceSeen, ...]
    events: tuple[IncidentEvent, ...]
    image_bytes: int
    places: tuple[Places, ...]
    areas: tuple[tuple[int, int], ...]
    fsoe: tuple[FsoeFacts, ...]
    remarks: tuple[str, ...] = ()
