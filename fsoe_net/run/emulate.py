"""The FSoE devices of a network on an emulated EtherCAT segment, for any MainDevice."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from fsoe_net.core import AlStatus, CorePlan, Segment, SegmentCounts
from fsoe_net.diag import Diagnostic
from fsoe_net.emul import build_network
from fsoe_net.model import LogicChoice, Resolution, Scenario
from fsoe_net.plan import decode_plan
from fsoe_net.run.engine import Engine, state_word
from fsoe_net.run.fit import Names, check_scenario
from fsoe_net.run.result import RunEvent, Verdict

__all__ = ["EmulateResult", "SegmentSession", "serve"]


class _Port:
    """Process data of one SubDevice on the segment; sync managers by their SM number."""

    def __init__(self, segment: Segment, numbers: dict[int, int]) -> None:
        self._segment = segment
        self._numbers = numbers

    def read_outputs(self, sm: int) -> bytes:
        return self._segment.read_outputs(self._numbers[sm])

    def write_inputs(self, sm: int, data: bytes) -> None:
        self._segment.write_inputs(self._numbers[sm], data)


@dataclass(frozen=True, slots=True, kw_only=True)
class EmulateResult:
    """What was seen while a segment was served.

    ``states`` are AL states by SubDevice, ``connections`` state words by connection. ``passed``:
    every expectation held; without any, every connection is in Data.
    """

    duration_ms: float
    states: dict[str, AlStatus]
    connections: dict[str, str]
    counts: SegmentCounts
    events: tuple[RunEvent, ...]
    verdicts: tuple[Verdict, ...]
    passed: bool


class SegmentSession:
    """A network on an emulated segment, ready to be served.

    Args:
        resolution: A network without errors.
        plan_bytes: Its plan.
        scenario: What happens and what must be seen, or ``None``.
        session_ids: Source of FSoE session ids.

    Raises:
        CoreMissing: The compiled part is not there.
    """

    def __init__(
        self,
        resolution: Resolution,
        plan_bytes: bytes,
        scenario: Scenario | None,
        *,
        session_ids: Callable[[], int],
    ) -> None:
        self.resolution = resolution
        self.scenario = scenario
        self.plan = CorePlan.load(plan_bytes)
        self.records = decode_plan(plan_bytes)
        self.segment = Segment(self.plan)
        self.network = build_network(resolution, session_ids)
        if scenario is None:
            self.network.choose_logic(LogicChoice())
        self._ports = {
            sub.name: _Port(
                self.segment,
                {
                    self.records.sync_managers[n].index: n
                    for n in range(sub.first_sm, sub.first_sm + sub.sm_count)
                },
            )
            for sub in self.records.subdevices
        }
        self._engine: Engine | None = None

    def scenario_findings(self) -> list[Diagnostic]:
        """Return what the scenario names that the network does not have."""
        if self.scenario is None:
            return []
        return check_scenario(self.scenario, Names.of(self.network, self.records))

    @property
    def engine(self) -> Engine:
        """The engine; made on first use, after the scenario was found good."""
        if self._engine is None:
            self._engine = Engine(
                self.network,
                self.scenario,
                set_present=self._set_present,
                set_output=self._set_output,
                set_input=self._set_input,
            )
        return self._engine

    def _set_present(self, name: str, present: bool) -> None:
        self.segment.set_present(self.segment.position(name), present)

    def _set_output(self, name: str, _value: int) -> None:
        self.engine.log(0, "run", f"{name} left alone: standard outputs are the MainDevice's")

    def _set_input(self, name: str, value: int) -> None:
        symbol = self.records.symbols[self.plan.symbols[name]]
        sm = self.records.sync_managers[symbol.sm]
        device = self.network.devices[self.records.subdevices[sm.subdevice].name]
        device.set_input(sm.index, symbol.bit_offset, symbol.bits, value)

    def step(self, now_ns: int) -> None:
        """Let the scenario act, every device take one step, and look at what came out."""
        engine = self.engine
        engine.act(now_ns)
        for name, device in self.network.devices.items():
            device.step(now_ns, self._ports[name])
        engine.watch(now_ns)

    def result(self, duration_ns: int) -> EmulateResult:
        """Return what was seen."""
        engine = self.engine
        engine.finish(duration_ns)
        verdicts = engine.verdicts()
        connections = {
            name: state_word(main, self.network.subs[name])
            for name, main in self.network.mains.items()
        }
        in_data = all(word.startswith("data") for word in connections.values())
        return EmulateResult(
            duration_ms=duration_ns / 1e6,
            states={
                name: self.segment.al_status(self.segment.position(name))
                for name in self.plan.subdevice_names
            },
            connections=connections,
            counts=self.segment.counts(),
            events=tuple(engine.events),
            verdicts=verdicts,
            passed=all(v.held for v in verdicts) if verdicts else in_data,
        )


def serve(
    session: SegmentSession,
    interface: str,
    duration_ns: int | None,
    *,
    period_ns: int = 1_000_000,
    on_update: Callable[[SegmentSession, int], None] | None = None,
) -> EmulateResult:
    """Answer on an interface until the time is over or the user interrupts.

    Args:
        session: A fresh session.
        interface: A veth or tap interface.
        duration_ns: How long; ``None`` until interrupted.
        period_ns: Time between two steps of the devices; late steps are not caught up.
        on_update: Called about ten times a second with the time since the start.

    Raises:
        EnvironmentFault: The interface cannot be used.
    """
    with session.segment as segment:
        segment.link(interface)
        start = time.monotonic_ns()
        now = next_ns = shown = 0
        try:
            while duration_ns is None or now < duration_ns:
                session.step(now)
                if on_update is not None and now >= shown:
                    on_update(session, now)
                    shown = now + 100_000_000
                next_ns = max(next_ns + period_ns, now)
                time.sleep(max(0, next_ns - (time.monotonic_ns() - start)) / 1e9)
                now = time.monotonic_ns() - start
        except KeyboardInterrupt:
            session.engine.log(now, "run", "interrupted by the user")
        return session.result(now)
