"""The FSoE devices of a network on an emulated EtherCAT segment, for any MainDevice."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fsoe_net.core.segment import AlStatus, Segment, SegmentCounts, SegmentLink, sum_counts
from fsoe_net.diag.words import counted
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.live.result import ExpectationResult, RunEvent
from fsoe_net.model.scenario import ScenarioStep
from fsoe_net.simulate.drive_objects import DriveObjects
from fsoe_net.simulate.engine import state_of
from fsoe_net.simulate.faults import apply_step
from fsoe_net.simulate.live_objects import LiveObjects
from fsoe_net.simulate.scenario_run import DeviceSide, ScenarioRun
from fsoe_net.simulate.session import DEVICE_PERIOD_NS


@dataclass(frozen=True, slots=True, kw_only=True)
class EmulateResult:
    """Observations while a segment was served.

    ``states`` are AL states by SubDevice, ``connections`` the states by connection. ``passed``:
    every expectation was met; without any, every connection is in Data.
    """

    duration_ms: float
    states: dict[str, AlStatus]
    connections: dict[str, ConnectionState]
    counts: SegmentCounts
    events: tuple[RunEvent, ...]
    verdicts: tuple[ExpectationResult, ...]
    passed: bool


class SegmentSession(ScenarioRun):
    """A network on an emulated segment, ready to be served; see `ScenarioRun` for the arguments."""

    has_segment = True

    def _open(self) -> DeviceSide:
        self.segments = tuple(map(Segment, self.plan.parts()))
        self._objects = LiveObjects(self._of, self.network)
        self._objects.update()
        self._drives = DriveObjects(self._of, self.network)
        return self.segment if len(self.segments) == 1 else _Sides(self.segments)

    @property
    def segment(self) -> Segment:
        """The first bus."""
        return self.segments[0]

    def _of(self, name: str) -> Segment:
        return next(segment for segment in self.segments if name in segment.names)

    def set_present(self, name: str, present: bool) -> None:
        """Unplug a SubDevice or plug it in."""
        segment = self._of(name)
        segment.set_present(segment.position(name), present)
        if present:  # a reconnected device starts as after power-on, including its FSoE end
            self.network.devices[name].power_cycle()

    def _is_operational(self, name: str) -> bool:
        segment = self._of(name)
        return segment.al_status(segment.position(name)).state == "OP"

    def _on_bus(self, step: ScenarioStep) -> None:
        apply_step(self.segments, step)

    def _set_output(self, name: str, _value: int) -> None:
        self.engine.log(0, "run", f"{name} left alone: standard outputs are the MainDevice's")

    def step_devices(self, now_ns: int) -> None:
        """Advance all devices by one step, and report the result to them."""
        super().step_devices(now_ns)
        self._objects.update()
        self._drives.update()

    def states(self) -> dict[str, AlStatus]:
        """Return the AL state of every SubDevice."""
        return {
            name: segment.al_status(segment.position(name))
            for name in self.plan.subdevice_names
            for segment in [self._of(name)]
        }

    def counts(self) -> SegmentCounts:
        """Return the observations of all buses."""
        return sum_counts(segment.counts() for segment in self.segments)

    def connections(self) -> dict[str, ConnectionState]:
        """Return the state of every connection."""
        network = self.network
        return {n: state_of(main, network.subs[n]) for n, main in network.mains.items()}

    def command(self, line: str, number: int, now_ns: int) -> str:
        """Run a line as a step of a scenario now.

        Returns:
            The answer: empty if there is nothing to do, otherwise ``ok``, a status or the error.
        """
        try:
            command = self.do_command(line, number, now_ns)
        except ValueError as fault:
            return f"refused: {fault}"
        if command is None:
            return ""
        return "ok" if command.step is not None else self._status()

    def _status(self) -> str:
        rows = [
            f"{name} {status.state}{f' error 0x{status.code:04x}' if status.error else ''}"
            for name, status in self.states().items()
        ]
        rows += [f"{name} {state}" for name, state in self.connections().items()]
        counts = self.counts()
        return "\n".join([*rows, f"{counted(counts.frames, 'frame')}, {counts.lost} lost"])

    def result(self, duration_ns: int) -> EmulateResult:
        """Return the observations."""
        engine = self.engine
        engine.finish(duration_ns)
        verdicts = engine.verdicts()
        connections = self.connections()
        in_data = all(connections[name].in_data for name in connections if self.is_due(name))
        return EmulateResult(
            duration_ms=duration_ns / 1e6,
            states=self.states(),
            connections=connections,
            counts=self.counts(),
            events=tuple(engine.events),
            verdicts=verdicts,
            passed=all(v.held for v in verdicts) if verdicts else in_data,
        )


class _Sides:
    """Several segments with consecutively numbered sync managers."""

    def __init__(self, segments: Sequence[Segment]) -> None:
        self._places = [(s, sm) for s in segments for sm in range(s.sm_count)]

    def read_outputs(self, sm: int) -> bytes:
        segment, number = self._places[sm]
        return segment.read_outputs(number)

    def write_inputs(self, sm: int, data: bytes) -> None:
        segment, number = self._places[sm]
        segment.write_inputs(number, data)


def serve(
    session: SegmentSession,
    link: SegmentLink,
    duration_ns: int | None,
    *,
    further: Sequence[SegmentLink] = (),
    period_ns: int = DEVICE_PERIOD_NS,
    on_update: Callable[[SegmentSession, int], None] | None = None,
    on_step: Callable[[SegmentSession, int], None] | None = None,
    on_link: Callable[[], None] | None = None,
    stop: threading.Event | None = None,
) -> EmulateResult:
    """Answer on an interface until the time is over or the user interrupts.

    Args:
        session: A fresh session.
        link: Interface of the bus, or of the first one.
        duration_ns: Duration; ``None`` until interrupted.
        further: Interfaces of the further buses, in their order.
        period_ns: Time between two steps of the devices; late steps are not caught up.
        on_step: Called before every step of the devices with the time since the start.
        on_update: Called about ten times a second with the time since the start.
        on_link: Called when the interface is ready.
        stop: Event that ends it, like a keyboard interrupt.

    Raises:
        EnvironmentFault: The interface cannot be used.
    """
    with contextlib.ExitStack() as linked:
        for segment, where in zip(session.segments, (link, *further), strict=True):
            linked.enter_context(segment).link(where)
        if on_link is not None:
            on_link()
        start = time.monotonic_ns()
        now = next_ns = shown = 0
        # An interrupt is the usual end; the result of the run is still returned.
        try:
            while duration_ns is None or now < duration_ns:
                if stop is not None and stop.is_set():
                    raise KeyboardInterrupt
                if on_step is not None:
                    on_step(session, now)
                session.step_devices(now)
                if on_update is not None and now >= shown:
                    on_update(session, now)
                    shown = now + 100_000_000
                # Late steps are skipped: catching up would make the devices faster than the bus.
                next_ns = max(next_ns + period_ns, now)
                time.sleep(max(0, next_ns - (time.monotonic_ns() - start)) / 1e9)
                now = time.monotonic_ns() - start
        except KeyboardInterrupt:
            session.engine.log(now, "run", "interrupted by the user")
        return session.result(now)
