"""Result of a run: connections, statistics, events, verdicts; and its JSON form."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from fsoe_net.core.bus_documents import SubDeviceSnapshot
from fsoe_net.core.snapshot import Statistics
from fsoe_net.diag.words import counted
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.parameters import NOT_OBSERVED, FsoeParameters, differences
from fsoe_net.live.health import (
    NO_CHANGES,
    Changes,
    FsoeHealth,
    connection_health,
    watchdog_share,
)


class RunEventKind(enum.StrEnum):
    """The subject of an event."""

    STATE = "state"
    """A new state of an end, or of the wire."""
    RESET = "reset"
    """An end resets its connection."""
    WORKING_COUNTER = "wkc"
    LINKS = "links"
    """Ports of a SubDevice gained or lost their link; its AL state is unchanged."""
    OTHER = "other"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEvent:
    """An event; ``text`` is for people and carries no decisions.

    ``code``: reset code of reset events, otherwise ``None``. ``end``: ``main``, ``sub`` or ``wire``
    of a state or reset; ``state``: the new state for people; ``in_data``: whether it is Data. Empty
    and false for other events.
    """

    time_ms: float
    source: str
    text: str
    code: int | None = None
    kind: RunEventKind = RunEventKind.OTHER
    end: str = ""
    state: str = ""
    in_data: bool = False


def state_fields(end: str, state: str, *, in_data: bool) -> dict[str, Any]:
    """Return the fields of a `RunEvent` about a new state."""
    return {"kind": RunEventKind.STATE, "end": end, "state": state, "in_data": in_data}


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionResult:
    """One connection at the end of a run, or currently. Times in milliseconds.

    ``state`` is that of the end that lags, ``wire_state`` the state derived by the core from the
    copied frames, ``wrong_…`` the number of frames with a wrong CRC; ``gaps`` counts missed frames.
    ``chosen`` lists facts that no file states. ``data_to_sub`` and ``data_to_main``: what each end
    receives: ``process``, ``failsafe`` or ``none``.

    ``configured``: parameters of the plan. ``observed``: parameters that the MainInstance sent in
    its last start-up. ``differs``: names of those that differed when last observed.

    On a live bus all values come from the wire: ``state`` equals ``wire_state``, and ``None`` marks
    values that neither the wire nor a file provides.
    """

    name: str
    net: str
    main: str
    sub: str
    state: ConnectionState
    wire_state: ConnectionState
    connection_id: int | None
    address: int | None
    watchdog_ms: int | None
    chosen: tuple[str, ...]
    time_to_data_ms: float | None
    fsoe_cycle_ms: Mapping[str, float]
    frames_to_sub: int
    frames_to_main: int
    wrong_to_sub: int
    wrong_to_main: int
    gaps: int
    resets: int
    last_reset_code: int | None
    last_reset_text: str
    data_to_sub: str
    data_to_main: str
    safe_to_sub: str | None
    safe_to_main: str | None
    configured: FsoeParameters = NOT_OBSERVED
    observed: FsoeParameters = NOT_OBSERVED
    differs: tuple[str, ...] = ()

    @property
    def differences(self) -> tuple[str, ...]:
        """Differences from the plan, such as ``watchdog 4000 ms, 400 ms in the plan``."""
        return differences(self.differs, self.configured, self.observed)


def result_health(
    result: ConnectionResult,
    subdevices: Iterable[SubDeviceSnapshot],
    *,
    share: float | None = None,
    changes: Changes = NO_CHANGES,
    current: bool = True,
) -> FsoeHealth:
    """Return the health of a connection like `connection_health`.

    Without ``share``, that of the FSoE cycle in the result is used.
    """
    if share is None:
        share = watchdog_share(result.fsoe_cycle_ms["max"], result.watchdog_ms)
    return connection_health(result, subdevices, share=share, changes=changes, current=current)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectationResult:
    """An expectation of the scenario and whether it was met."""

    place: str
    text: str
    held: bool
    seen: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class BusResult:
    """The bus of a run: ``emulated`` without an interface, or a backend of ``fsn-master``."""

    backend: str = "emulated"
    interface: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A complete run. ``passed``: every expectation was met or, without any, all reached Data.

    ``subdevices``: only on a live bus. ``stalled_ms``: longest time in which the bus or the
    emulated devices stopped because this machine did; 0 in virtual time.
    """

    mode: str
    network: str
    plan_sha256: str
    duration_ms: float
    connections: tuple[ConnectionResult, ...]
    statistics: Statistics
    events: tuple[RunEvent, ...]
    events_lost: int
    verdicts: tuple[ExpectationResult, ...]
    passed: bool
    bus: BusResult = BusResult()
    subdevices: tuple[SubDeviceSnapshot, ...] = ()
    stalled_ms: float = 0.0

    def __repr__(self) -> str:
        """Return one line: the network, the duration and whether it passed."""
        verdict = "passed" if self.passed else "failed"
        connections = counted(len(self.connections), "connection")
        facts = f"{self.mode}, {self.duration_ms:g} ms, {connections}, {verdict}"
        return f"<Run of {self.network!r}: {facts}>"

    def to_json(self, version: str) -> dict[str, object]:
        """Return the stable JSON document (``docs/reference/run-output.md``)."""
        return {
            "tool": "fsoe-net",
            "version": version,
            "network": self.network,
            "plan_sha256": self.plan_sha256,
            "mode": self.mode,
            "bus": asdict(self.bus),
            "duration_ms": self.duration_ms,
            "stalled_ms": self.stalled_ms,
            "result": "pass" if self.passed else "fail",
            "connections": [asdict(c) for c in self.connections],
            "subdevices": [s.to_json() for s in self.subdevices],
            "statistics": self.statistics.to_json(),
            "expectations": [asdict(v) for v in self.verdicts],
            "events": [asdict(e) for e in self.events],
            "events_lost": self.events_lost,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class RunUpdate:
    """Observations during a run.

    Attributes:
        connections: Current state of all connections.
        statistics: Statistics of the bus cycle.
        now_s: Seconds since the start.
        subdevices: SubDevices of a live bus; empty for an emulated bus.
    """

    connections: tuple[ConnectionResult, ...]
    statistics: Statistics
    now_s: float
    subdevices: tuple[SubDeviceSnapshot, ...] = ()
