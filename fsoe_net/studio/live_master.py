"""The live page on a running ``fsn-master``: one more client, which only reads."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict

from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.attachment import Attachment, BusView
from fsoe_net.live.client import Client
from fsoe_net.live.control_values import Status, Symbol, WatchedCycle
from fsoe_net.live.health import bus_health
from fsoe_net.live.result import RunEvent
from fsoe_net.model.drives import is_controlword
from fsoe_net.model.kinds import SubDeviceKind
from fsoe_net.model.symbols import directed_names
from fsoe_net.studio.live_cabling import bus_row
from fsoe_net.studio.live_feed import ALONE_S, PICTURE_S, LiveFeed, ScopeRing
from fsoe_net.studio.live_rows import (
    Row,
    connection_row,
    health_row,
    statistics_row,
    subdevice_row,
)
from fsoe_net.version import __version__


class MasterFeed(LiveFeed):
    """Follows ``fsn-master`` across stops and restarts, and waits while there is none.

    Args:
        path: Control socket of ``fsn-master``.
    """

    def __init__(self, path: str) -> None:
        super().__init__("master")
        self.path = path
        self._start_ns = time.monotonic_ns()
        self._last: BusView | None = None
        self._scope_thread = threading.Thread(target=self._watch, name="scope", daemon=True)

    def start(self) -> None:
        """Start reading."""
        super().start()
        self._scope_thread.start()

    def close(self) -> None:
        """Stop; ``fsn-master`` continues."""
        super().close()
        if self._scope_thread.is_alive():
            self._scope_thread.join()

    def signals(self) -> list[Row]:
        """Return the named inputs and outputs.

        Raises:
            EnvironmentFault: ``fsn-master`` does not answer, or its bus is stopped.
        """
        with Client(self.path) as client:
            return [
                {"name": name, "label": "", "kind": "output" if symbol.is_output else "input"}
                for name, symbol in _signals(client).items()
            ]

    def machine(self) -> Row:
        """Return the picture of the bus: SubDevices of the plan, with their links.

        Raises:
            EnvironmentFault: ``fsn-master`` does not answer, or its bus is stopped.
        """
        with Client(self.path) as client:
            buses = [bus.name for bus in client.status().buses]
            return bus_row(client.subdevices(), _kinds(client), buses)

    def note(self, text: str) -> None:
        """Add an action of a page to the events."""
        now_ms = (time.monotonic_ns() - self._start_ns) / 1e6
        self.history.add([RunEvent(time_ms=now_ms, source="page", text=text)])

    def document(self) -> Row:
        """Return the document of `fsoe-net monitor --format json`."""
        events, gone = self.history.kept()
        view = {} if self._last is None else self._last.to_json()
        lost = 0 if self._last is None else self._last.events_lost
        return {
            "tool": "fsoe-net",
            "version": __version__,
            "socket": self.path,
            **view,
            "events": [asdict(e) for e in events],
            "events_lost": lost + gone,
            "capture": None,
        }

    def _run(self) -> None:
        attached: Attachment | None = None
        due = 0.0
        while not self.closed:
            self._wake.clear()
            if attached is None:
                attached = self._attach()
                continue
            due = max(due, time.monotonic() - PICTURE_S)
            due += PICTURE_S if self.listeners else ALONE_S
            view = attached.look(max(0.0, due - time.monotonic()), self._wake)
            self.history.add(attached.take_events())
            self._last = view
            self._publish(_view(self.path, view))
        if attached is not None:
            attached.close()

    def _attach(self) -> Attachment | None:
        try:
            attached = Attachment(self.path, details=True)
        except EnvironmentFault as fault:
            self._publish(_nobody(self.path, str(fault)))
            self._wake.wait(ALONE_S)
            return None
        self._start_ns = attached.start_ns
        return attached

    # -- the scope has a separate connection, for every cycle independent of the updates
    # --------------

    def _watch(self) -> None:
        while not self.closed:
            ring = self.scope
            # Cycles are requested only while a page is open: each subscription costs fsn-master
            # time.
            if not ring.names or not self.listeners:
                self._ending.wait(PICTURE_S)
                continue
            try:
                with Client(self.path) as client:
                    symbols = _chosen(client, ring)
                    client.watch_on(*{s.name for s in symbols}, every=1, typed=True)
                    ring.fault = ""
                    self._take(client, ring, symbols)
            # fsn-master may be restarted; the page then continues with the next one.
            except EnvironmentFault as fault:
                ring.fault = str(fault)
                self._ending.wait(ALONE_S)

    def _take(self, client: Client, ring: ScopeRing, symbols: Sequence[Symbol]) -> None:
        """Read cycles while a page listens and needs these signals."""
        # A new selection of signals replaces the ring; this subscription then ends.
        while ring is self.scope and self.listeners and not self.closed:
            for cycle in client.watched(PICTURE_S):
                ring.skipped += cycle.skipped
                time_ms = (cycle.now_ns - self._start_ns) / 1e6
                ring.add(round(time_ms, 3), (_value(cycle, symbol) for symbol in symbols))


def _kinds(client: Client) -> dict[str, SubDeviceKind]:
    """Return the kind of each SubDevice, by its process data and connections in the plan."""
    mains = {connection.main for connection in client.connections()}
    drives = {s.subdevice for s in client.symbols() if s.is_output and is_controlword(s.index)}
    with_data = {sm.subdevice for sm in client.layout().sms if sm.size_bytes}

    def kind(name: str) -> SubDeviceKind:
        if name in mains:
            return SubDeviceKind.LOGIC
        if name in drives:
            return SubDeviceKind.DRIVE
        return SubDeviceKind.TERMINAL if name in with_data else SubDeviceKind.COUPLER

    return {s.name: kind(s.name) for s in client.subdevices()}


def _signals(client: Client) -> dict[str, Symbol]:
    symbols = client.symbols()
    names = directed_names([(s.is_output, s.name) for s in symbols])
    return dict(zip(names, symbols, strict=True))


def _chosen(client: Client, ring: ScopeRing) -> list[Symbol]:
    """Return the signals of a scope.

    Raises:
        EnvironmentFault: The running plan lacks one of them.
    """
    known = _signals(client)
    missing = [name for name in ring.names if name not in known]
    if missing:
        raise EnvironmentFault(f"the plan that runs now has no signal {missing[0]}")
    return [known[name] for name in ring.names]


def _value(cycle: WatchedCycle, symbol: Symbol) -> float | None:
    value = cycle.side(symbol.is_output).get(symbol.name)
    return int(value) if isinstance(value, bool) else value


def _nobody(path: str, fault: str) -> Row:
    return {
        "title": path,
        "state": "away",
        "away": fault,
        "current": False,
        "good": False,
        "ended": False,
        "now_ms": 0.0,
        "pace": None,
        "content": None,
        "notes": [],
        "machine": None,
        "connections": [],
        "subdevices": [],
        "bus": health_row(bus_health(None, None, away=fault)),
        "statistics": None,
    }


def _view(path: str, view: BusView) -> Row:
    snapshot, status = view.snapshot, view.status
    health = view.health
    statistics = None if snapshot is None else statistics_row(snapshot.cycle.statistics.to_json())
    return {
        "title": path if status is None else _title(status),
        "state": "away" if view.away or status is None else status.state.value,
        "away": view.away or view.refused,
        "current": view.current,
        "good": view.good,
        "ended": False,
        "now_ms": round(view.now_s * 1000, 1),
        "pace": None,
        "content": None,
        "notes": [] if status is None else list(_notes(status)),
        "machine": None,
        "connections": [
            connection_row(c.result, h, cause=c.cause, held=c.held_main + c.held_sub)
            for c, h in zip(view.connections, health.connections, strict=True)
        ],
        "subdevices": [subdevice_row(h) for h in health.subdevices],
        "bus": health_row(health.bus),
        "statistics": statistics,
    }


def _title(status: Status) -> str:
    where = ", ".join(b.interface for b in status.buses if b.interface) or status.interface
    return f"fsn-master, {status.backend} on {where}" if where else f"fsn-master, {status.backend}"


def _notes(status: Status) -> Iterator[str]:
    """Yield the texts next to the tables, one per line."""
    if status.ring is not None:
        yield status.ring.text
    if status.clocks is not None:
        yield status.clocks.text
    for bus in status.buses:
        yield f"bus {bus.name}: working counter {bus.actual_wkc} of {bus.expected_wkc}"
    for group in status.groups:
        yield f"group {group.name}: {group.state}"
    for client in status.in_cycle:
        yield client.text
