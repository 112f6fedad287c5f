"""Follows a running ``fsn-master`` as an additional client, across stops and restarts."""

from __future__ import annotations

import threading
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from fsoe_net.core.bus_documents import BusSnapshot, PlannedConnection, SubDeviceSnapshot
from fsoe_net.core.snapshot import ConnectionSnapshot
from fsoe_net.errors import ControlRefused, EnvironmentFault
from fsoe_net.fsoe.pdu import reset_code_text
from fsoe_net.live.bus_events import ENDS, BusEvents, connection_result
from fsoe_net.live.client import Client
from fsoe_net.live.control_values import BusState, Status
from fsoe_net.live.health import (
    NO_CHANGES,
    Changes,
    HealthReport,
    RecentChanges,
    bus_health,
    in_operation,
    subdevice_health,
    watchdog_share,
)
from fsoe_net.live.result import ConnectionResult, RunEvent, result_health

_REPLY_S = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedConnection:
    """A connection as `ConnectionResult`, with the values that only a monitor reports.

    Attributes:
        result: The connection as in the result of a run.
        resets_to_sub: Resets sent by the main after another command, including answers.
        resets_to_main: Resets sent by the sub.
        cause: Cause of the last Reset in words, with the end that began it, if observed.
        watchdog_share: Longest FSoE cycle as a share of the watchdog; ``None`` if unknown.
        held_main: Cycles in which the inputs of the main's SubDevice were old.
        held_sub: Same for the SubDevice of the sub.
        silent_to_sub_ms: Time since the main's last new frame.
        silent_to_main_ms: Time since the sub's last new frame.
    """

    result: ConnectionResult
    resets_to_sub: int
    resets_to_main: int
    cause: str
    watchdog_share: float | None
    held_main: int
    held_sub: int
    silent_to_sub_ms: float | None
    silent_to_main_ms: float | None

    def to_json(self) -> dict[str, object]:
        """Return the keys of the connection and of the monitor in one object."""
        row = asdict(self)
        result: dict[str, object] = row.pop("result")
        return result | row


@dataclass(frozen=True, slots=True, kw_only=True)
class BusView:
    """The current state of the bus.

    ``away``: why ``fsn-master`` does not answer; empty if it does. ``refused``: why it returns no
    snapshot of a running bus. ``snapshot`` is the last one, ``current`` whether it is up to date.
    ``changes`` are counters that increased recently. Times of ``events`` count from the start of
    the monitor.
    """

    away: str
    refused: str
    status: Status | None
    connections: tuple[WatchedConnection, ...]
    snapshot: BusSnapshot | None
    current: bool
    now_s: float
    events: tuple[RunEvent, ...]
    events_lost: int
    changes: Changes = NO_CHANGES

    @property
    def health(self) -> HealthReport:
        """The health of the bus, of each SubDevice and of each connection."""
        snapshot, current, changes = self.snapshot, self.current, self.changes
        subdevices = snapshot.subdevices if snapshot is not None else ()
        return HealthReport(
            bus=bus_health(
                self.status,
                snapshot.cycle.statistics if snapshot is not None else None,
                changes=changes,
                current=current,
                away=self.away,
                refused=self.refused,
            ),
            subdevices=tuple(
                subdevice_health(s, changes=changes, current=current) for s in subdevices
            ),
            connections=tuple(
                result_health(
                    c.result, subdevices, share=c.watchdog_share, changes=changes, current=current
                )
                for c in self.connections
            ),
        )

    @property
    def good(self) -> bool:
        """Whether every connection is in Data and every SubDevice in OP, or may be absent."""
        rows = self.health
        return self.current and in_operation((*rows.subdevices, *rows.connections))

    def to_json(self) -> dict[str, object]:
        """Return the view as ``fsoe-net monitor`` writes it (``docs/reference/json-output.md``)."""
        status, snapshot = self.status, self.snapshot
        return {
            "result": "pass" if self.good else "fail",
            "state": None if status is None or self.away else status.state.value,
            "away": self.away or None,
            "refused": self.refused or None,
            "status": None if status is None else asdict(status),
            "current": self.current,
            "duration_ms": self.now_s * 1000,
            "connections": [c.to_json() for c in self.connections],
            "subdevices": [] if snapshot is None else [s.to_json() for s in snapshot.subdevices],
            "statistics": None if snapshot is None else snapshot.cycle.statistics.to_json(),
            "events": [asdict(e) for e in self.events],
            "events_lost": self.events_lost,
        }


class Attachment:
    """A monitor's connection to ``fsn-master``; a context manager.

    Args:
        path: Control socket.
        details: Keep every Reset of a connection that resets again and again.

    Raises:
        EnvironmentFault: No process answers; after the first connection, this is not an error.
    """

    def __init__(self, path: str | Path, *, details: bool = False) -> None:
        self._path = str(path)
        self._events = BusEvents(start_ns=time.monotonic_ns(), details=details)
        self._facts: tuple[PlannedConnection, ...] = ()
        self._snapshot: BusSnapshot | None = None
        self._recent = RecentChanges()
        self._status: Status | None = None
        self._away = self._refused = ""
        self._missed = 0
        self._client: Client | None = None
        self._attach(_REPLY_S)

    def __enter__(self) -> Attachment:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect; ``fsn-master`` continues."""
        if self._client is not None:
            self._client.close()
            self._client = None

    @property
    def start_ns(self) -> int:
        """Monotonic time in nanoseconds from which the times of events count."""
        return self._events.start_ns

    def take_events(self) -> list[RunEvent]:
        """Return and discard the stored events; for programs that watch for a long time."""
        taken = self._events.events
        self._events.events = []
        return taken

    def look(self, wait_s: float, stop: threading.Event | None = None) -> BusView:
        """Collect reports for the given time, then take a snapshot.

        Never raises when ``fsn-master`` stops, ends or returns: the view and its events report it.
        Setting ``stop`` ends the wait early.
        """
        current = False
        try:
            client = self._client or self._attach(max(0.1, wait_s))
            current = self._ask(client, wait_s, stop)
        except EnvironmentFault as fault:
            self._lost(fault)
            (stop or threading.Event()).wait(wait_s)
        return self._view(current)

    def _attach(self, timeout_s: float) -> Client:
        client = Client(self._path, timeout_s=timeout_s)
        try:
            client.subscribe()
            self._status = client.status()
        except EnvironmentFault:
            client.close()
            raise
        if self._away:
            self._events.log("monitor", f"fsn-master answers again; {self._away}")
            self._away = ""
        self._client = client
        # An fsn-master that was restarted may have another plan.
        self._facts = ()
        return client

    def _lost(self, fault: EnvironmentFault) -> None:
        if self._client is not None:
            # The counter exists only as long as the connection.
            self._missed += self._client.events_lost
            self._client.close()
            self._client = None
        if not self._away:
            self._away = str(fault)
            self._events.log("monitor", f"fsn-master is gone, waiting for it: {fault}")
            self._events.events_lost += 1  # its last messages may not have been read

    def _ask(self, client: Client, wait_s: float, stop: threading.Event | None) -> bool:
        until = time.monotonic() + wait_s
        while True:
            # Pauses of at most 0.1 s: `stop` must be able to end a long wait, and events can arrive
            # any time.
            for event in client.events(min(0.1, max(0.0, until - time.monotonic()))):
                self._events.take(event)
            if time.monotonic() >= until or (stop is not None and stop.is_set()):
                break
        self._status = client.status()
        self._refused = ""
        if self._status.state not in (BusState.RUNNING, BusState.STARTING):
            return False
        try:
            # The facts come from the plan. They are read once, and again after each new connection.
            if not self._facts:
                self._facts = _facts(client)
            self._snapshot = client.snapshot()
        except ControlRefused as refused:
            if not (refused.bus_stopped or refused.busy):
                self._refused = str(refused)
            # Between two states, or the cycle leaves no time for a snapshot.
            return refused.busy and self._snapshot is not None
        return True

    def _view(self, current: bool) -> BusView:
        rows: list[WatchedConnection] = []
        # A new plan has other connections: until its facts are read, rows would be paired wrongly.
        if self._snapshot is not None and len(self._facts) == len(self._snapshot.cycle.connections):
            held = {s.name: s for s in self._snapshot.subdevices}
            for facts, wire in zip(self._facts, self._snapshot.cycle.connections, strict=True):
                rows.append(self._connection(facts, wire, held, self._snapshot))
        lost = self._client.events_lost if self._client is not None else 0
        now_s = (time.monotonic_ns() - self._events.start_ns) / 1e9
        changes = NO_CHANGES
        if self._snapshot is not None:
            changes = self._recent.take(self._snapshot, now_s)
        return BusView(
            away=self._away,
            refused=self._refused,
            status=self._status,
            connections=tuple(rows),
            snapshot=self._snapshot,
            current=current,
            now_s=now_s,
            events=tuple(self._events.events),
            events_lost=self._events.events_lost + self._missed + lost,
            changes=changes,
        )

    def _connection(
        self,
        facts: PlannedConnection,
        wire: ConnectionSnapshot,
        subdevices: dict[str, SubDeviceSnapshot],
        snapshot: BusSnapshot,
    ) -> WatchedConnection:
        now_ns = snapshot.cycle.statistics.now_ns
        longest_ms = max(wire.to_sub.interval_max_ns, wire.to_main.interval_max_ns) / 1e6
        ends = [subdevices.get(name) for name in (facts.main, facts.sub)]
        silent = [
            # Before the first frame there is no time to count from.
            (now_ns - d.last_new_ns) / 1e6 if d.frames and now_ns >= d.last_new_ns else None
            for d in (wire.to_sub, wire.to_main)
        ]
        return WatchedConnection(
            result=connection_result(facts, wire, self._events),
            resets_to_sub=wire.to_sub.resets,
            resets_to_main=wire.to_main.resets,
            cause=_cause(facts.name, wire, self._events),
            watchdog_share=watchdog_share(longest_ms, facts.watchdog_ms),
            held_main=ends[0].stale_cycles if ends[0] else 0,
            held_sub=ends[1].stale_cycles if ends[1] else 0,
            silent_to_sub_ms=silent[0],
            silent_to_main_ms=silent[1],
        )


def _facts(client: Client) -> tuple[PlannedConnection, ...]:
    """Return the connections by name, with plan values if this fsn-master reports them."""
    names = client.connections()
    try:
        stated = {c.name: c for c in client.layout().connections}
    except ControlRefused:  # an fsn-master without this request
        stated = {}
    unknown = PlannedConnection(name="")
    return tuple(
        replace(stated.get(c.name, unknown), name=c.name, net=c.net, main=c.main, sub=c.sub)
        for c in names
    )


def _cause(name: str, wire: ConnectionSnapshot, events: BusEvents) -> str:
    """Return the cause of the last reset, from the counters if no event gives it."""
    if name in events.last_reset:
        text = reset_code_text(events.last_reset[name])
        return f"{events.last_reset_by.get(name, 'one end')}: {text}"
    rows = ((ENDS["main"], wire.to_sub), (ENDS["sub"], wire.to_main))
    sent = [(end, d.reset_code) for end, d in rows if d.has_reset]
    # Reset code 0 is the plain reset of a start; the end that gives a reason is the cause.
    reported = [row for row in sent if row[1]] or sent
    if len(reported) == 2 and reported[0][1] == reported[1][1]:
        return f"both ends sent: {reset_code_text(reported[0][1])}"
    return "; ".join(f"{end} sent: {reset_code_text(code)}" for end, code in reported)
