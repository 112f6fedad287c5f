"""Runs a network on a live bus with ``fsn-master``; results are taken from the wire."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass

from fsoe_net.core.bus_documents import BusSnapshot, PlannedConnection
from fsoe_net.errors import ControlRefused, EnvironmentFault, InputError
from fsoe_net.live.bus_events import BusEvents, connection_result
from fsoe_net.live.client import Client
from fsoe_net.live.health import in_operation
from fsoe_net.live.master import Master
from fsoe_net.live.result import BusResult, ConnectionResult, Run, RunUpdate, result_health
from fsoe_net.model.resolve import Connection, Resolution

_UPDATE_S = 0.1
_GRACE_S = 10  # unless stopped, fsn-master continues this long after the given duration


@dataclass(frozen=True, slots=True, kw_only=True)
class BusOptions:
    """How ``fsn-master`` drives the bus; ``None`` for its own default.

    ``buses``: name and interface of each of several; ``interface`` is the first. ``wait_s``: how
        long to retry while SubDevices are missing. ``incidents``: folder for the files of
        connections that leave Data. ``intervention_log``: folder of the intervention log.
    """

    backend: str
    interface: str
    redundant: str | None = None
    cycle_ns: int | None = None
    priority: int | None = None
    cpu: int | None = None
    buses: tuple[tuple[str, str], ...] = ()
    wait_s: float = 0.0
    incidents: str | None = None
    intervention_log: str | None = None

    @property
    def _interfaces(self) -> list[str]:
        return [f"{name}={interface}" for name, interface in self.buses] or [self.interface]

    @property
    def where(self) -> str:
        """Its interfaces as text."""
        return ", ".join(self._interfaces)

    def arguments(self, duration_ns: int | None) -> list[str]:
        """Return the options of ``fsn-master``."""
        words = ["--bus", self.backend]
        for text in self._interfaces:
            words += ["--interface", text]
        if self.redundant is not None:
            words += ["--redundant", self.redundant]
        if self.cycle_ns is not None:
            words += ["--cycle", f"{self.cycle_ns}ns"]
        if self.priority is not None:
            # A priority counts only with a real-time policy.
            words += ["--policy", "fifo", "--priority", str(self.priority)]
        if self.cpu is not None:
            words += ["--cpu", str(self.cpu)]
        if self.wait_s > 0:
            words += ["--wait", f"{round(self.wait_s * 1000)}ms"]
        if self.incidents is not None:
            words += ["--incidents", self.incidents]
        if self.intervention_log is not None:
            words += ["--intervention-log", self.intervention_log]
        if duration_ns is not None:
            # fsn-master ends later than the client, so that the last snapshot is from a running
            # bus.
            words += ["--duration", f"{duration_ns // 1_000_000 + _GRACE_S * 1000}ms"]
        return words


class _LiveRun:
    """One run; see `run_on_bus`."""

    def __init__(
        self, resolution: Resolution, plan: bytes, options: BusOptions, master: Master
    ) -> None:
        self._resolution = resolution
        self._plan = plan
        self._options = options
        self._master = master
        self._facts = tuple(_facts(c) for c in resolution.connections)
        self._events = BusEvents(start_ns=time.monotonic_ns())
        self._client: Client | None = None
        self._last: BusSnapshot | None = None
        self._begin_ns: int | None = None
        self._end_ns: int | None = None

    def watch(
        self,
        duration_ns: int | None,
        on_update: Callable[[RunUpdate], None] | None,
        stop: threading.Event,
    ) -> Run:
        """Watch until the time is over or the user stops the run; return the result."""
        self._connect()
        while not self._over(duration_ns) and not stop.is_set():
            self._look(_UPDATE_S)
            if on_update is not None and self._last is not None:
                on_update(self._update(self._last))
        # Before the last read: these events belong to the run.
        if stop.is_set():
            self._events.log("run", "interrupted by the user")
        self._end_ns = time.monotonic_ns()
        current = self._look(0.0)
        if self._last is None:
            # An interrupt before the first snapshot has no result to report.
            raise KeyboardInterrupt  # the bus was not yet open: there is nothing to report
        return self._result(self._last, current)

    def close(self) -> None:
        """Disconnect from ``fsn-master``."""
        if self._client is not None:
            self._client.close()

    def _over(self, duration_ns: int | None) -> bool:
        return (
            duration_ns is not None
            and self._begin_ns is not None
            and time.monotonic_ns() - self._begin_ns >= duration_ns
        )

    def _connect(self) -> Client:
        self._client = client = self._master.connect()
        try:
            client.subscribe()
        except ControlRefused:
            raise
        except EnvironmentFault:
            if self._master.ended(2.0):  # it has just rejected the bus
                self._master.explain()
            raise
        return client

    def _look(self, wait_s: float) -> bool:
        """Read events and a snapshot; return whether the bus is running."""
        try:
            return self._ask(wait_s)
        except ControlRefused:
            raise
        except EnvironmentFault as fault:
            if self._master.ended(2.0):
                self._master.explain()
            # It is alive: it drops a client that did not read for some time.
            self._events.log("run", f"{fault}; connected again, events may be missing")
            self._events.events_lost += 1
            self._connect()
            return False

    def _ask(self, wait_s: float) -> bool:
        client = self._client or self._connect()
        until = time.monotonic() + wait_s
        while True:
            for event in client.events(max(0.0, until - time.monotonic())):
                self._events.take(event)
            if time.monotonic() >= until:
                break
        try:
            self._last = client.snapshot()
        except ControlRefused as refused:
            # Busy or between two states is normal; any other refusal is an error.
            if not (refused.bus_stopped or refused.busy):
                raise
            return refused.busy and self._last is not None
        # The run begins with the first snapshot, not with the connection, because the bus is
        # started in between.
        if self._begin_ns is None:
            self._begin_ns = time.monotonic_ns()
        return True

    def _update(self, snapshot: BusSnapshot) -> RunUpdate:
        return RunUpdate(
            connections=self._connections(snapshot),
            statistics=snapshot.cycle.statistics,
            subdevices=snapshot.subdevices,
            now_s=(time.monotonic_ns() - self._events.start_ns) / 1e9,
        )

    def _connections(self, snapshot: BusSnapshot) -> tuple[ConnectionResult, ...]:
        rows = zip(self._facts, snapshot.cycle.connections, strict=True)
        return tuple(connection_result(facts, wire, self._events) for facts, wire in rows)

    def _result(self, snapshot: BusSnapshot, current: bool) -> Run:
        events, end_ns = self._events, self._end_ns or time.monotonic_ns()
        if not current:
            events.log("run", "the bus was not running at the end; what is shown was seen last")
        connections = self._connections(snapshot)
        lost = self._client.events_lost if self._client is not None else 0
        return Run(
            mode="live",
            network=self._resolution.network.name,
            plan_sha256=hashlib.sha256(self._plan).hexdigest(),
            duration_ms=(end_ns - (self._begin_ns or end_ns)) / 1e6,
            connections=connections,
            # Events of the run itself and of the bus come from two sources.
            statistics=snapshot.cycle.statistics,
            events=tuple(sorted(events.events, key=lambda e: e.time_ms)),
            events_lost=events.events_lost + lost,
            verdicts=(),
            passed=current
            and in_operation(result_health(c, snapshot.subdevices) for c in connections),
            bus=BusResult(backend=self._options.backend, interface=self._options.interface),
            subdevices=snapshot.subdevices,
            stalled_ms=snapshot.cycle.statistics.period.max_ns / 1e6,
        )


def _facts(connection: Connection) -> PlannedConnection:
    stated = connection.stated
    return PlannedConnection(
        name=connection.name,
        net=connection.net.name,
        main=connection.main.name,
        sub=connection.sub.name,
        connection_id=stated.connection_id,
        address=stated.address,
        watchdog_ms=stated.watchdog_ms,
    )


def run_on_bus(
    resolution: Resolution,
    plan: bytes,
    options: BusOptions,
    duration_ns: int | None,
    *,
    on_start: Callable[[Master], None] | None = None,
    on_update: Callable[[RunUpdate], None] | None = None,
    stop: threading.Event | None = None,
) -> Run:
    """Start ``fsn-master``, watch it, and stop it in an orderly way.

    Args:
        resolution: The network that the plan was compiled from.
        plan: The plan.
        options: Bus and options.
        duration_ns: Duration from the first cycle; ``None`` to run until ``stop`` is set.
        on_start: Called once ``fsn-master`` has started.
        on_update: Called about ten times a second.
        stop: Event that ends the run; the result is still returned.

    If this process is killed, ``fsn-master`` continues; with a duration it ends some seconds after
    that time.

    Raises:
        InputError: Plan or bus was rejected: no SubDevice answers, or others than planned.
        EnvironmentFault: ``fsn-master`` is missing, lacks a permission or was ended from outside.
        KeyboardInterrupt: ``stop`` was set before the bus was open.
    """
    words = [*options.arguments(duration_ns), "--accepted", hashlib.sha256(plan).hexdigest()]
    with Master(plan, words) as master:
        if on_start is not None:
            on_start(master)
        run = _LiveRun(resolution, plan, options, master)
        try:
            return run.watch(duration_ns, on_update, stop or threading.Event())
        except InputError as refused:
            raise InputError(_located(str(refused), master.log.subdevices, resolution)) from refused
        finally:
            run.close()


def _located(text: str, names: Collection[str], resolution: Resolution) -> str:
    """Add the locations of SubDevices in the user's files."""
    rows = resolution.network.subdevices
    places = "".join(f"\n  {s.name} is at {s.span}" for s in rows if s.name in names)
    return text + places
