"""Runs: virtual (one thread, fast and repeatable) and live (the core has its own thread)."""

from __future__ import annotations

import itertools
import secrets
import threading
import time
from collections import Counter
from collections.abc import Callable

from fsoe_net.capture.capture import CaptureWriter
from fsoe_net.capture.wire import LogicalImage
from fsoe_net.core.core import Core, EmulatedBus
from fsoe_net.core.snapshot import ConnectionSnapshot, Snapshot
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.pdu import reset_code_text
from fsoe_net.live.result import ConnectionResult, Run, RunUpdate
from fsoe_net.model.scenario import ScenarioStep
from fsoe_net.plan.model import Plan
from fsoe_net.simulate.engine import state_of
from fsoe_net.simulate.incidents import IncidentRecorder
from fsoe_net.simulate.port import Port
from fsoe_net.simulate.scenario_run import DEFAULT_CYCLE_NS, DeviceSide, ScenarioRun

_BACK_NS = 30_000  # a frame on a small segment returns after some microseconds


class BusCapture:
    """Converts the image of every cycle to EtherCAT frames, on their way out and back.

    Args:
        writer: Output of the frames.
        core: Core that runs the plan on the emulated bus; no other caller may run a cycle.
        plan: The same plan.
    """

    def __init__(self, writer: CaptureWriter, core: Core, plan: Plan) -> None:
        self._writer = writer
        self._core = core
        self._sizes = [sm.size_bytes for sm in plan.sync_managers]
        self._layout = LogicalImage(plan)
        self._image = bytearray(self._layout.size_bytes)
        self._cycle = 0
        self._sent_ns = 0

    def cycle(self, now_ns: int) -> None:
        """Record the cycle that has just run.

        Its inputs returned in the frame with the outputs of the previous cycle.
        """
        image = self._core.image()

        def read(sm: int) -> bytes:
            base = self._core.sm_base(sm) or 0
            return image[base : base + self._sizes[sm]]

        layout = self._layout
        layout.gather(read, outputs=False, into=self._image)
        if self._cycle > 0:
            s = self._core.snapshot().statistics
            missing = s.expected_wkc - s.actual_wkc
            for packet in layout.packets(self._image, self._cycle, back=True, missing=missing):
                self._writer.packet(min(self._sent_ns + _BACK_NS, now_ns), packet)
        layout.gather(read, outputs=True, into=self._image)
        self._cycle += 1
        for packet in layout.packets(self._image, self._cycle, back=False):
            self._writer.packet(now_ns, packet)
        self._sent_ns = now_ns


DEFAULT_DURATION_NS = 3_000_000_000
DEVICE_PERIOD_NS = 1_000_000
_INTERRUPTED = "interrupted by the user"


class Session(ScenarioRun):
    """A network on the emulated bus, ready to run; see `ScenarioRun` for the arguments."""

    def _open(self) -> DeviceSide:
        self.absent: set[str] = set(self.away)
        self.returns: Counter[str] = Counter()
        self.bus = EmulatedBus(self.plan)
        self.core = Core(self.plan, self.bus)
        return self.bus

    @property
    def cycle_ns(self) -> int:
        """Bus cycle of the plan, or 1 ms if not stated."""
        return self.plan.cycle_ns or DEFAULT_CYCLE_NS

    @property
    def duration_ns(self) -> int:
        """Duration of the scenario, or 3 s."""
        stated = self.scenario.duration_ns if self.scenario else None
        return stated or DEFAULT_DURATION_NS

    def set_present(self, name: str, present: bool) -> None:
        """Unplug a SubDevice or plug it in."""
        self.returns[name] += present and name in self.absent
        (self.absent.discard if present else self.absent.add)(name)
        self.bus.set_present(self.plan.subdevice_names.index(name), present)

    def _is_operational(self, name: str) -> bool:
        return name not in self.absent

    def _set_output(self, name: str, value: int) -> None:
        self.core.set_output(self.plan.outputs[name], value)

    def _on_bus(self, _step: ScenarioStep) -> None:
        """Do nothing: the emulated bus only carries process data."""

    def connections(self, snapshot: Snapshot) -> tuple[ConnectionResult, ...]:
        """Return every connection in the current view of devices and core."""
        rows = zip(self.network.setups, snapshot.connections, strict=True)
        return tuple(self._connection(n, wire) for n, (_, wire) in enumerate(rows))

    def _connection(self, number: int, wire: ConnectionSnapshot) -> ConnectionResult:
        setup = self.network.setups[number]
        connection = setup.connection
        name = connection.name
        main, sub = self.network.mains[name], self.network.subs[name]
        engine = self.engine
        to_data = engine.time_to_data_ns.get(name)
        code = engine.last_reset.get(name)
        down = wire.to_sub
        return ConnectionResult(
            name=name,
            net=connection.net.name,
            main=connection.main.name,
            sub=connection.sub.name,
            state=state_of(main, sub),
            wire_state=wire.state,
            connection_id=setup.main.connection_id,
            address=setup.main.address,
            watchdog_ms=setup.main.watchdog_ms,
            chosen=setup.chosen,
            time_to_data_ms=None if to_data is None else to_data / 1e6,
            fsoe_cycle_ms={
                "last": down.interval_last_ns / 1e6,
                "min": down.interval_min_ns / 1e6,
                "mean": down.interval_mean_ns / 1e6,
                "max": down.interval_max_ns / 1e6,
            },
            frames_to_sub=down.frames,
            frames_to_main=wire.to_main.frames,
            wrong_to_sub=down.wrong,
            wrong_to_main=wire.to_main.wrong,
            gaps=wire.gaps,
            resets=engine.resets[name],
            last_reset_code=code,
            last_reset_text="" if code is None else reset_code_text(code),
            data_to_sub=_data_kind(sub),
            data_to_main=_data_kind(main),
            safe_to_sub=sub.instance.received_safe_data.hex(),
            safe_to_main=main.instance.received_safe_data.hex(),
            configured=self.records.connections[number].parameters,
            observed=wire.observed,
            differs=wire.differs,
        )

    def result(self, mode: str, duration_ns: int, *, devices_stood_ns: int = 0) -> Run:
        """Return the result of a completed run.

        Args:
            mode: ``live`` or ``virtual``.
            duration_ns: Duration of the run.
            devices_stood_ns: Longest time between two steps of the devices.
        """
        self.engine.finish(duration_ns)
        snapshot = self.core.snapshot()
        connections = self.connections(snapshot)
        verdicts = self.engine.verdicts()
        reached = all(c.state.in_data or {c.main, c.sub} & self.away for c in connections)
        passed = all(v.held for v in verdicts) if verdicts else reached
        return Run(
            mode=mode,
            network=self.resolution.network.name,
            plan_sha256=self.plan_sha256,
            duration_ms=duration_ns / 1e6,
            connections=connections,
            statistics=snapshot.statistics,
            events=tuple(self.engine.events),
            events_lost=self.engine.events_lost,
            verdicts=verdicts,
            passed=passed,
            stalled_ms=max(devices_stood_ns, snapshot.statistics.period.max_ns) / 1e6,
        )


def _data_kind(receiver: Port) -> str:
    """Return the data that an end receives: ``process``, ``failsafe``, or ``none`` outside Data."""
    if receiver.instance.state is not State.DATA:
        return "none"
    return "process" if receiver.instance.data_valid else "failsafe"


def counted_session_ids() -> Callable[[], int]:
    """Return a source of session ids that is the same in every run."""
    numbers = itertools.count(0x1234, 0x1357)
    return lambda: next(numbers) & 0xFFFF


def random_session_ids() -> Callable[[], int]:
    """Return a source of random session ids."""
    return lambda: secrets.randbelow(0x10000)


def run_virtual(
    session: Session,
    duration_ns: int,
    *,
    capture: CaptureWriter | None = None,
    incidents: IncidentRecorder | None = None,
    until_settled: bool = False,
) -> Run:
    """Run in virtual time: one cycle and one step of every device after the other.

    The same session gives the same result, byte for byte. A keyboard interrupt ends the run early;
    its result is still returned. ``capture`` receives the frames of an equivalent bus;
    ``incidents`` writes a file if a connection fails; ``until_settled`` ends the run as soon as it
    has nothing more to show (`Engine.is_settled`).
    """
    bus = None if capture is None else BusCapture(capture, session.core, session.records)
    cycle_ns = session.cycle_ns
    cycles = max(1, duration_ns // cycle_ns)
    # Looked up once, because this loop runs a million times.
    cycle, step = session.core.cycle, session.step_devices
    now_ns = 0
    try:
        for number in range(1, cycles + 1):
            now_ns = number * cycle_ns
            cycle(now_ns)
            # After the cycle and before the devices answer, so that these are the frames of this
            # cycle.
            if bus is not None:
                bus.cycle(now_ns)
            if incidents is not None:
                incidents.cycle(now_ns)
            step(now_ns)
            if until_settled and session.engine.is_settled(now_ns):
                break
    except KeyboardInterrupt:
        session.engine.log(now_ns, "run", _INTERRUPTED)
    if incidents is not None:
        incidents.finish(now_ns)
    return session.result("virtual", now_ns)


def run_live(
    session: Session,
    duration_ns: int,
    *,
    device_period_ns: int = DEVICE_PERIOD_NS,
    on_update: Callable[[RunUpdate], None] | None = None,
    incidents: IncidentRecorder | None = None,
) -> Run:
    """Run in real time: the core runs in its own C thread, the devices have their own cycle.

    Args:
        session: A fresh session.
        duration_ns: Duration.
        device_period_ns: Time between two steps of the devices.
        on_update: Called about ten times a second with the current observations.
        incidents: Writes a file if a connection fails; records one cycle per step of the devices.

    A keyboard interrupt ends the run early; its result is still returned. An error in the device
    thread is raised here.
    """
    live = _Live(session, device_period_ns, incidents)
    return live.run(duration_ns, on_update)


class _Live:
    """The threads of a live run."""

    def __init__(
        self, session: Session, device_period_ns: int, incidents: IncidentRecorder | None
    ) -> None:
        self._session = session
        self._incidents = incidents
        self._period_ns = device_period_ns
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._error: BaseException | None = None
        self._start_ns = 0
        self._stood_ns = 0

    def run(
        self,
        duration_ns: int,
        on_update: Callable[[RunUpdate], None] | None,
    ) -> Run:
        session = self._session
        session.core.start(cycle_ns=session.cycle_ns)
        self._start_ns = time.monotonic_ns()
        thread = threading.Thread(target=self._devices, name="devices", daemon=True)
        thread.start()
        try:
            self._wait(duration_ns, on_update)
        except KeyboardInterrupt:
            session.engine.log(self._now(), "run", _INTERRUPTED)
        finally:
            self._stop.set()
            # Must happen before the core stops: devices use its bus until their thread ends.
            thread.join()
            session.core.stop()
        if self._incidents is not None:
            self._incidents.finish(self._now())
        if self._error is not None:
            raise self._error
        duration_ns = min(self._now(), duration_ns)
        return session.result("live", duration_ns, devices_stood_ns=self._stood_ns)

    def _now(self) -> int:
        return time.monotonic_ns() - self._start_ns

    def _wait(
        self,
        duration_ns: int,
        on_update: Callable[[RunUpdate], None] | None,
    ) -> None:
        while (left := duration_ns - self._now()) > 0 and not self._stop.wait(min(0.1, left / 1e9)):
            if on_update is not None:
                snapshot = self._session.core.snapshot()
                with self._lock:
                    rows = self._session.connections(snapshot)
                on_update(
                    RunUpdate(
                        connections=rows,
                        statistics=snapshot.statistics,
                        now_s=self._now() / 1e9,
                    )
                )

    def _devices(self) -> None:
        """Step all devices at their period; late steps are skipped."""
        try:
            next_ns = last_ns = self._now()
            while not self._stop.is_set():
                with self._lock:
                    now_ns = self._now()
                    self._stood_ns, last_ns = max(self._stood_ns, now_ns - last_ns), now_ns
                    self._session.step_devices(now_ns)
                    if self._incidents is not None:
                        self._incidents.cycle(now_ns)
                next_ns = max(next_ns + self._period_ns, self._now())
                self._stop.wait(max(0.0, (next_ns - self._now()) / 1e9))
        except BaseException as exc:  # raised again in the main thread, so it is not lost
            self._error = exc
            self._stop.set()
