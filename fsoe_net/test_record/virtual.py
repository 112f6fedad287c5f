"""Executes a test record on the emulated bus, in virtual time: fills in the column EMULATED."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace

from fsoe_net.campaign.trials import CampaignConfig, ClassResult
from fsoe_net.diag.diagnostic import Span
from fsoe_net.diag.words import counted
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.safety import ElementKind, SafetyFunction
from fsoe_net.model.scenario import Action, Scenario, ScenarioStep
from fsoe_net.model.test_record import StepKind, StepOutcome, StepResult, TestRecord, TestStep
from fsoe_net.simulate.campaign import campaign_links, run_campaign
from fsoe_net.simulate.engine import state_of
from fsoe_net.simulate.session import Session, counted_session_ids
from fsoe_net.test_record.steps import connection_is_due

_MS = 1_000_000
_PATIENCE_NS = 10_000 * _MS  # until Data is reached for the first time
_SETTLE_NS = 100 * _MS
_PHASES = 4  # points in the bus cycle at which a trigger is tested
_FAULTS = 200  # per class

Progress = Callable[[str], None]


def run_tests_virtual(
    test_record: TestRecord,
    resolution: Resolution,
    plan_bytes: bytes,
    *,
    faults: int = _FAULTS,
    on_step: Progress | None = None,
) -> TestRecord:
    """Return the test record with the column EMULATED filled in; the result is repeatable.

    Args:
        test_record: Test record of this network.
        resolution: A network without errors.
        plan_bytes: Its plan.
        faults: Faults per class.
        on_step: Called before each step with its id.

    Raises:
        PlanFormatError: The core rejects the plan.
        CoreMissing: The compiled part is missing.
    """
    emulation = _Emulation(resolution, plan_bytes, faults)
    steps = []
    for step in test_record.steps:
        if on_step is not None:
            on_step(step.id)
        steps.append(replace(step, emulated=emulation.seen(step)))
    return replace(test_record, steps=tuple(steps))


class _Emulation:
    """The emulated bus of one network; restarted for every step."""

    def __init__(self, resolution: Resolution, plan_bytes: bytes, faults: int) -> None:
        self._resolution = resolution
        self._plan_bytes = plan_bytes
        self._faults = faults
        self._prelude: tuple[ScenarioStep, ...] = ()
        self._early = False
        self._to_data_ns: dict[str, int] = {}
        first = self._session(())
        self._start(first)
        for connection in resolution.connections:
            if connection.name not in self._to_data_ns and not first.is_due(connection.name):
                self._plug_for({connection.main.name, connection.sub.name})
                self._start(self._session(()))
        self._prelude = ()
        self._cycle_ns = first.cycle_ns
        settled = max(self._to_data_ns.values(), default=0) + _SETTLE_NS
        self._act_ns = settled // self._cycle_ns * self._cycle_ns + 4 * _SETTLE_NS
        self._press = (
            _step(settled, Action.PRESS, "reset"),
            _step(settled + _SETTLE_NS, Action.RELEASE, "reset"),
        )
        self._watchdog_ns = max(s.main.watchdog_ms for s in first.network.setups) * _MS

    def _start(self, session: Session) -> None:
        """Run until all connections with both ends present have reached Data."""
        due = {name for name in session.network.mains if session.is_due(name)}
        for _now in _cycles(session, _PATIENCE_NS):
            self._early = self._early or bool(_on(session, session.network.safe_outputs))
            if due <= session.engine.time_to_data_ns.keys():
                break
        self._to_data_ns = session.engine.time_to_data_ns | self._to_data_ns

    def _plug_for(self, names: Collection[str]) -> None:
        """Begin every session with the groups of these SubDevices, without conflicting ones."""
        groups = self._resolution.network.groups
        wanted = [g for g in groups if set(names) & set(g.subdevices)]
        places = {g.place for g in wanted if g.place}
        # Groups of one place exclude each other: the other ones must be removed first.
        rivals = [g for g in groups if g.place in places and g not in wanted]
        self._prelude = (
            *(_step(0, Action.PULL, g.name) for g in rivals),
            *(_step(0, Action.PLUG, g.name) for g in wanted),
        )

    def _combination(self, step: TestStep) -> StepResult:
        present = [name for name in step.subject.split("+") if name]
        network = self._resolution.network
        self._prelude = tuple(
            _step(0, Action.PLUG if g.name in present else Action.PULL, g.name)
            for g in network.groups
        )
        session = self._session(())
        rows = self._resolution.connections
        due = {c.name for c in rows if connection_is_due(c, network, present)}
        for _now in _cycles(session, self._act_ns):
            pass
        ends = session.network
        in_data = {n for n, main in ends.mains.items() if state_of(main, ends.subs[n]).in_data}
        return StepResult(
            outcome=StepOutcome.AS_EXPECTED if in_data == due else StepOutcome.NOT_AS_EXPECTED,
            remark=f"{len(in_data)} of {counted(len(due), 'connection')} in Data",
        )

    def seen(self, step: TestStep) -> StepResult:
        """Execute one step."""
        if step.kind is StepKind.COMBINATION:
            return self._combination(step)
        functions = {f.name: f for f in self._resolution.network.safety_functions}
        function = functions.get(step.subject) if step.kind is StepKind.TRIGGER else None
        parts = {e.sub for e in function.elements if e.sub} if function else set()
        self._plug_for({step.subject} | parts)
        if step.kind is StepKind.START_UP:
            return self._start_up(step)
        if step.kind is StepKind.FAULT:
            return self._fault(step)
        # Without Data, a loss or a trigger shows nothing.
        if len(self._to_data_ns) < len(self._resolution.connections):
            return _not_run("not all connections reached Data")
        if step.kind is StepKind.LOSS:
            return self._loss(step)
        return self._trigger(step, functions[step.subject])

    def _session(self, steps: Iterable[ScenarioStep]) -> Session:
        scenario = Scenario(
            span=Span("test record"), path="", duration_ns=None, steps=(*self._prelude, *steps)
        )
        return Session(
            self._resolution, self._plan_bytes, scenario, session_ids=counted_session_ids()
        )

    def _start_up(self, step: TestStep) -> StepResult:
        reached = self._to_data_ns.get(step.subject)
        if reached is None:
            return StepResult(outcome=StepOutcome.NOT_AS_EXPECTED, remark="never reached Data")
        if self._early:
            return StepResult(
                outcome=StepOutcome.NOT_AS_EXPECTED, remark="an output was on before a reset"
            )
        return StepResult(
            outcome=StepOutcome.AS_EXPECTED,
            measured_ms=reached / _MS,
            time_is=self._time_is("from the first bus cycle until Data"),
        )

    def _time_is(self, words: str) -> str:
        return f"{words}; to the bus cycle of {self._cycle_ns / _MS:g} ms"

    # -- trigger ----------------------------------------------------------------------------------

    def _trigger(self, step: TestStep, function: SafetyFunction) -> StepResult:
        slowest = 0
        # The time depends on the moment of the trigger within the FSoE cycle.
        for phase in range(_PHASES):
            found = self._triggered(function, self._act_ns + phase * self._cycle_ns)
            if isinstance(found, StepResult):
                return found
            slowest = max(slowest, found)
        return _within(
            step,
            slowest,
            self._time_is(
                "from safe inputs 0 to safe outputs 0, both at the emulated devices, which answer "
                "within a bus cycle; sensor and actuator not in it"
            ),
            f"longest of {_PHASES} tries, each a bus cycle later",
        )

    def _triggered(self, function: SafetyFunction, act_ns: int) -> StepResult | int:
        network = self._session(()).network
        inputs = _subs(function, ElementKind.INPUT)
        outputs = _subs(function, ElementKind.OUTPUT)
        pressed = {
            name: 0
            for name in network.default_inputs()
            if network.safe_inputs[name].setup.connection.sub.name in inputs
        }
        if not pressed:
            return _not_run(f"{', '.join(inputs) or 'its input'} has no emulated safe input bits")
        away_ns = act_ns + 2 * self._watchdog_ns + _SETTLE_NS
        back = dict.fromkeys(pressed, 1)
        session = self._session(
            (
                *self._press,
                _step(act_ns, Action.SET, values=pressed),
                _step(away_ns, Action.SET, values=back),
            )
        )
        names = [
            name
            for name, port in session.network.safe_outputs.items()
            if port.setup.connection.sub.name in outputs
        ]
        return self._reaction(session, names, act_ns, away_ns + 4 * _SETTLE_NS)

    def _reaction(
        self, session: Session, names: Iterable[str], act_ns: int, end_ns: int
    ) -> StepResult | int:
        """Return the time in ns from an action until all outputs are off; they must stay off."""
        watched: list[str] = []
        off_ns: int | None = None
        for now in _cycles(session, end_ns):
            if now < act_ns:
                watched = _on(session, names)
                # A function whose outputs are off from the start would pass wrongly.
                if now + session.cycle_ns >= act_ns and not watched:
                    return _not_run("none of its outputs was on")
            elif off_ns is None:
                off_ns = now if not _on(session, watched) else None
            # Outputs that switch on again by themselves are the worst result.
            elif again := _on(session, watched):
                return StepResult(
                    outcome=StepOutcome.NOT_AS_EXPECTED,
                    measured_ms=(off_ns - act_ns) / _MS,
                    time_is=self._time_is("until it went off"),
                    remark=f"{again[0]} came on again without a reset",
                )
        if off_ns is None:
            left = ", ".join(_on(session, watched)[:3])
            return StepResult(outcome=StepOutcome.NOT_AS_EXPECTED, remark=f"still on: {left}")
        return off_ns - act_ns

    # -- loss -------------------------------------------------------------------------------------

    def _loss(self, step: TestStep) -> StepResult:
        name = step.subject
        act_ns = self._act_ns
        # Long enough for the watchdog to expire, then for all to settle.
        back_ns = act_ns + 2 * self._watchdog_ns + 2 * _SETTLE_NS
        end_ns = back_ns + 2 * max(self._to_data_ns.values()) + 2 * self._watchdog_ns
        session = self._session(
            (
                *self._press,
                _step(act_ns, Action.BREAK, name),
                _step(back_ns, Action.HEAL, name),
            )
        )
        if name not in session.plan.subdevice_names:
            return _not_run(f"{name} carries no process data that is copied")
        own = [c for c in self._resolution.connections if name in (c.main.name, c.sub.name)]
        if not own:
            return self._bystander(session, back_ns)
        mains = {c.main.name for c in own}
        names = [
            signal
            for signal, port in session.network.safe_outputs.items()
            if port.setup.connection.main.name in mains
        ]
        found = self._reaction(session, names, act_ns, end_ns)
        if isinstance(found, StepResult):
            return found
        words = "from the last bus cycle with it until all safe outputs of its logic are 0"
        return _within(step, found, self._time_is(words), "one try")

    def _bystander(self, session: Session, end_ns: int) -> StepResult:
        network, came_on, before = session.network, False, 0
        for now in _cycles(session, end_ns):
            count = len(_on(session, network.safe_outputs))
            came_on = came_on or (now > self._act_ns and count > before)
            before = count
        stayed = sum(
            state_of(main, network.subs[name]).in_data for name, main in network.mains.items()
        )
        return StepResult(
            outcome=StepOutcome.NOT_AS_EXPECTED if came_on else StepOutcome.AS_EXPECTED,
            remark=f"{stayed} of {counted(len(network.mains), 'connection')} in Data without it",
        )

    # -- faults -----------------------------------------------------------------------------------

    def _fault(self, step: TestStep) -> StepResult:
        # A fixed seed: the same network gives the same result.
        config = CampaignConfig(links=campaign_links(self._resolution), seed=0)
        result = run_campaign(config, (step.subject,), self._faults)
        # After Ctrl-C a campaign returns partial results, which would count as a complete step.
        if result.interrupted:
            raise KeyboardInterrupt
        (row,) = result.classes
        return StepResult(
            outcome=StepOutcome.AS_EXPECTED if row.passed else StepOutcome.NOT_AS_EXPECTED,
            measured_ms=row.latency_max_ns / _MS if row.detected else None,
            time_is="the longest from a fault until it was detected" if row.detected else "",
            remark=_counts(row),
        )


def _counts(row: ClassResult) -> str:
    return (
        f"{row.injected} faults: {row.detected} detected, {row.tolerated} tolerated, "
        f"{row.collisions} CRC collisions, {row.wrongly_accepted} wrongly accepted, "
        f"{row.wrong_reactions} wrong reactions"
    )


def _cycles(session: Session, end_ns: int) -> Iterable[int]:
    """Run cycle by cycle until a time; yields the time of each."""
    for now in range(session.cycle_ns, end_ns + 1, session.cycle_ns):
        session.core.cycle(now)
        session.step_devices(now)
        yield now


def _on(session: Session, names: Iterable[str]) -> list[str]:
    return [name for name in names if session.network.safe_output(name)]


def _subs(function: SafetyFunction, kind: ElementKind) -> list[str]:
    return [e.sub for e in function.elements if e.kind is kind and e.sub]


def _step(
    at_ns: int, action: Action, target: str = "", values: dict[str, int] | None = None
) -> ScenarioStep:
    return ScenarioStep(
        span=Span("test record"), at_ns=at_ns, action=action, target=target, values=values or {}
    )


def _not_run(why: str) -> StepResult:
    return StepResult(outcome=StepOutcome.NOT_RUN, remark=why)


def _within(step: TestStep, took_ns: int, time_is: str, remark: str) -> StepResult:
    took = took_ns / _MS
    late = step.limit_ms is not None and took > step.limit_ms
    return StepResult(
        outcome=StepOutcome.NOT_AS_EXPECTED if late else StepOutcome.AS_EXPECTED,
        measured_ms=took,
        time_is=time_is,
        remark=f"later than {step.limit_ms:g} ms; {remark}" if late else remark,
    )
