"""The live page on an emulated run started by the page, for learning FSoE."""

from __future__ import annotations

import dataclasses
import queue
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import TypeVar

from fsoe_net.core.bus_documents import SubDeviceSnapshot, read_subdevice
from fsoe_net.core.json_object import ReplyObject
from fsoe_net.errors import FsnError, InputError
from fsoe_net.live.health import bus_health, in_operation, subdevice_health
from fsoe_net.live.result import result_health, state_fields
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.scan import Scan
from fsoe_net.project.simulate import prepare
from fsoe_net.simulate.axis_program import AxisProgram
from fsoe_net.simulate.commands import CommandError
from fsoe_net.simulate.emulated_documents import subdevices_json
from fsoe_net.studio.live_feed import ALONE_S, PICTURE_S, LiveFeed, ScopeRing
from fsoe_net.studio.live_machine import EmulatedMachine
from fsoe_net.studio.live_rows import (
    Row,
    connection_row,
    health_row,
    statistics_row,
    subdevice_row,
)
from fsoe_net.studio.live_signals import first_signals, scope_signals
from fsoe_net.version import __version__

FORGOTTEN_S = 600.0
"""An emulated run ends if no page has listened for this time."""
MOST_HELD_MS = 10_000

_BEHIND_NS = 100_000_000  # larger delays are not caught up
_REPLY_S = 30.0

_T = TypeVar("_T")
_Order = tuple[Callable[[int], object], "Future[object]"]


class EmulatedFeed(LiveFeed):
    """A network on the emulated bus, in real time as far as this machine allows.

    Args:
        resolution: The network.
        content: Hash of the content of its files.
        scan: Scan that shows the cables of its first bus, or ``None``.

    Raises:
        InputError: There is nothing to run.
        CoreMissing: The compiled part is missing.
    """

    def __init__(self, resolution: Resolution, content: str, scan: Scan | None = None) -> None:
        super().__init__("emulated")
        self._session = prepare(resolution, None, None, virtual=False)
        self._content = content
        self._orders: queue.SimpleQueue[_Order] = queue.SimpleQueue()
        self._door = threading.Lock()  # for orders: released while the thread serves them
        self._over = False
        self._now_ns = self._held_until_ns = 0
        self._pace = Pace()
        self._fault = ""
        self._machine = EmulatedMachine(self._session, scan)
        self._axes = AxisProgram(self._session)
        self._signals = scope_signals(self._session, self._machine.label)
        self.scope = ScopeRing(first_signals(self._session, self._signals), 1)
        self._look(ended=False)

    def names(self) -> Row:
        """Return the names on the buttons of the page, in the words of the commands."""
        session = self._session
        names, network = session.names(), session.network
        watched = {name for d in network.masters for _, name in d.logic_inputs}
        buses = {s.name: s.master_id for s in session.resolution.network.subdevices}
        ports = network.safe_inputs
        return {
            "inputs": [
                {
                    "name": name,
                    "label": self._machine.label(ports[name].sends[name]),
                    "subdevice": ports[name].setup.connection.sub.name,
                    "most": most,
                    "watched": name in watched,
                }
                for name, (_, most) in names.safe_inputs.items()
                # A mirrored input follows another one, so a separate button would have no effect.
                if name not in ports[name].mirrored
            ],
            "subdevices": [
                {"name": s.name, "bus": buses.get(s.name, 0), "powered": s.name in names.devices}
                for s in session.records.subdevices
            ],
            "connections": [c.name for c in session.records.connections],
            "groups": [g.name for g in session.records.groups],
        }

    def signals(self) -> list[Row]:
        """Return safe inputs and outputs of the devices, and the named process data."""
        return [
            {"name": name, "label": signal.label, "kind": signal.kind}
            for name, signal in self._signals.items()
        ]

    def command(self, lines: Sequence[str]) -> None:
        """Run lines, one per cycle, like lines of `fsoe-net emulate`.

        Raises:
            InputError: A line is not a command, is invalid for the network, or the run has ended.
        """
        for number, line in enumerate(lines, 1):

            def obey(now_ns: int, line: str = line, number: int = number) -> None:
                self._session.do_command(line, number, now_ns)
                # A SubDevice after a cut cable does not return by `heal` or `plug`.
                self._machine.apply_cables()

            try:
                self._order(obey)
            except CommandError as exc:
                raise InputError(str(exc)) from exc

    def hold(self, ms: int) -> None:
        """Exchange no frames for this time from now on, as if frames were lost or late.

        The devices continue, including their FSoE watchdogs.

        Args:
            ms: 1 to `MOST_HELD_MS` milliseconds.

        Raises:
            InputError: The run has ended.
        """

        def obey(now_ns: int) -> None:
            self._held_until_ns = now_ns + ms * 1_000_000
            self._session.engine.log(now_ns, "bus", f"no frames for {ms} ms")

        self._order(obey)

    def set_cable(self, cable: int, *, whole: bool) -> None:
        """Cut a cable of the picture, or repair it.

        Raises:
            InputError: Unknown cable, or the run has ended.
        """

        def obey(now_ns: int) -> None:
            ends = self._machine.set_cable(cable, whole=whole)
            text = f"{ends} {'repaired' if whole else 'cut'}"
            self._session.engine.log(now_ns, "bus", text)

        self._order(obey)

    def turn_axes(self, *, run: bool) -> None:
        """Start or stop the program that turns the axes.

        Raises:
            InputError: There is no axis to turn, or the run has ended.
        """
        if not self._axes.can_run:
            raise InputError("this network has no drive with controlword, mode and target velocity")

        def obey(now_ns: int) -> None:
            (self._axes.start if run else self._axes.stop)()
            self._session.engine.log(now_ns, "axes", "start" if run else "stop")

        self._order(obey)

    def machine(self) -> Row:
        """Return the picture of the network."""
        return self._machine.row() | {"has_axes": self._axes.can_run}

    def document(self) -> Row:
        """Return the document of `fsoe-net run --format json`."""

        def made(now_ns: int) -> Row:
            self._collect()
            run = self._session.result("live", now_ns)
            events, gone = self.history.kept()
            whole = dataclasses.replace(
                run,
                events=events,
                events_lost=run.events_lost + gone,
                subdevices=tuple(self._subdevices()),
            )
            return whole.to_json(__version__)

        return self._ask(made)

    def _order(self, work: Callable[[int], None]) -> None:
        """Call a function with an active run."""
        if self._over:
            raise InputError("the run has ended; start another one")
        self._ask(work)

    def _ask(self, work: Callable[[int], _T]) -> _T:
        """Call a function between two cycles."""
        with self._door:
            # No thread steps the run any longer, so this thread may read it.
            if self._over or not self._thread.is_alive():
                return work(self._now_ns)
            answer: Future[object] = Future()
            self._orders.put((work, answer))
        return answer.result(_REPLY_S)  # type: ignore[return-value]

    def _obey(self) -> None:
        """Serve one order."""
        try:
            work, answer = self._orders.get_nowait()
        except queue.Empty:
            return
        try:
            answer.set_result(work(self._now_ns))
        except Exception as exc:  # raised again in the calling thread
            answer.set_exception(exc)

    def _run(self) -> None:
        try:
            self._cycles()
        except FsnError as exc:
            self._fault = str(exc)
        finally:
            with self._door:
                self._over = True
                # Otherwise an order that has just arrived would wait until it times out.
                while not self._orders.empty():
                    self._obey()
                self._ending.set()
                self._look(ended=True)

    def _cycles(self) -> None:
        session, cycle_ns = self._session, self._session.cycle_ns
        due = heard = time.monotonic()
        while not self.closed:
            self._pace.keep(self._now_ns, self._ending)
            self._now_ns += cycle_ns
            self._obey()
            # Held frames: the devices continue without the bus, as with a real MainDevice that
            # hangs.
            if self._now_ns >= self._held_until_ns:
                session.core.cycle(self._now_ns)
            session.step_devices(self._now_ns)
            self._axes.step()
            self._on_the_wire()
            # One object for the whole step: a page may select other signals at any time.
            ring = self.scope
            if ring.names:
                image = session.core.image()
                values = [self._signals[name].read(image) for name in ring.names]
                ring.add(round(self._now_ns / 1e6, 3), values)
            now = time.monotonic()
            # Between two updates for people, the bus runs without building any text.
            if now < due and not self._wake.is_set():
                continue
            self._wake.clear()
            # A page that is open keeps the run alive; a forgotten browser tab must not use a
            # processor for days.
            heard = now if self.listeners else heard
            # After a delay, missed updates are not repeated.
            due = max(due, now - PICTURE_S) + (PICTURE_S if self.listeners else ALONE_S)
            self._look(ended=False)
            if now - heard > FORGOTTEN_S:
                session.engine.log(self._now_ns, "run", "ended: no page has listened for long")
                return

    def _on_the_wire(self) -> None:
        """Record each state that the copied frames show, as a live bus reports it."""
        session = self._session
        for event in session.core.events():
            if not event.by and event.before is not event.after:
                name = session.plan.connection_names[event.connection]
                state = event.after.text
                facts = state_fields("wire", state, in_data=event.after.in_data)
                session.engine.log(event.now_ns, name, f"wire: {state}", **facts)

    def _collect(self) -> None:
        """Move the events of the engine to the history, which keeps the newest."""
        engine = self._session.engine
        self.history.add(engine.events)
        engine.events.clear()

    def _look(self, *, ended: bool) -> None:
        session = self._session
        self._collect()
        snapshot = session.core.snapshot()
        results = session.connections(snapshot)
        subdevices = self._subdevices()
        health = [result_health(c, subdevices) for c in results]
        self._publish(
            {
                "title": session.resolution.network.name,
                "state": "ended" if ended else "running",
                "away": self._fault,
                "current": not ended,
                "good": in_operation(health),
                "ended": ended,
                "now_ms": self._now_ns / 1e6,
                "pace": self._pace.share(self._now_ns),
                "content": self._content,
                "notes": [],
                "machine": self._machine.view() | {"turning": self._axes.runs},
                "connections": [
                    connection_row(c, h, cause=c.last_reset_text, held=0)
                    for c, h in zip(results, health, strict=True)
                ],
                "subdevices": [subdevice_row(subdevice_health(s)) for s in subdevices],
                "bus": health_row(bus_health(None, snapshot.statistics)),
                "statistics": statistics_row(snapshot.statistics.to_json()),
            }
        )

    def _subdevices(self) -> list[SubDeviceSnapshot]:
        session = self._session
        rows = subdevices_json(session.core, session.records, session.absent, session.returns)
        return [read_subdevice(ReplyObject(row)) for row in rows]


class Pace:
    """The speed of an emulated run: simulated time follows the clock."""

    def __init__(self) -> None:
        self._begun_ns = time.monotonic_ns()
        self._marks: list[tuple[int, int]] = []

    def keep(self, now_ns: int, end: threading.Event) -> None:
        """Wait until the clock reaches a simulated time; lost time is not caught up."""
        clock_ns = time.monotonic_ns() - self._begun_ns
        if now_ns > clock_ns:
            end.wait((now_ns - clock_ns) / 1e9)
        elif clock_ns - now_ns > _BEHIND_NS:
            self._begun_ns += clock_ns - now_ns

    def share(self, now_ns: int) -> float | None:
        """Return the speed of simulated time relative to the clock, over the last second; 1: equal.

        ``None`` until a second has passed.
        """
        clock_ns = time.monotonic_ns()
        self._marks.append((clock_ns, now_ns))
        while len(self._marks) > 1 and self._marks[1][0] <= clock_ns - 1_000_000_000:
            del self._marks[0]
        begun_ns, from_ns = self._marks[0]
        past_ns = clock_ns - begun_ns
        return round((now_ns - from_ns) / past_ns, 3) if past_ns >= 1_000_000_000 else None
