"""Scenario and devices in step with time; the same engine drives virtual and live runs."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from fsoe_net.diag.words import counted
from fsoe_net.fsoe.event import EventKind, State
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.pdu import reset_code_text
from fsoe_net.live.result import ExpectationResult, RunEvent, RunEventKind, state_fields
from fsoe_net.model.scenario import RESET_OF_ALL, Action, Expectation, Scenario, ScenarioStep
from fsoe_net.simulate.bus import EmulatedDevices
from fsoe_net.simulate.drive.axis import EmulatedAxis
from fsoe_net.simulate.drive.power import PdsState
from fsoe_net.simulate.port import Port

_MAX_EVENTS = 20_000
_AUTO_PRESS_NS = 100_000_000


def state_of(main: Port, sub: Port) -> ConnectionState:
    """Return the state of a connection: that of the end that lags, and for Data the kind."""
    # The enum has the states in the order of the start-up.
    order = list(State)
    state = min(main.instance.state, sub.instance.state, key=order.index)
    if state is not State.DATA:
        return ConnectionState[state.name]
    if main.instance.data_valid and sub.instance.data_valid:
        return ConnectionState.DATA_PROCESS
    return ConnectionState.DATA_FAILSAFE


class Engine:
    """Runs steps when they are due, watches expectations, collects events.

    Args:
        network: The emulated devices.
        scenario: Steps and expectations, or ``None``: then reset is pressed once when all
            connections are in Data.
        set_present: Unplugs a SubDevice by name or plugs it in.
        plug: Attaches or removes a group by name.
        is_due: Whether a connection can be in Data, because its ends do not belong to an absent
            group.
        set_output: Sets a standard output by symbol name.
        set_input: Sets a standard input by symbol name.
        on_bus: Applies a step to the bus itself.
    """

    def __init__(
        self,
        network: EmulatedDevices,
        scenario: Scenario | None,
        *,
        set_present: Callable[[str, bool], None],
        plug: Callable[[str, bool], None],
        is_due: Callable[[str], bool],
        set_output: Callable[[str, int], None],
        set_input: Callable[[str, int], None],
        on_bus: Callable[[ScenarioStep], None],
    ) -> None:
        self.network = network
        self.events: list[RunEvent] = []
        self.events_lost = 0
        self.time_to_data_ns: dict[str, int] = {}
        self.resets: dict[str, int] = dict.fromkeys(network.mains, 0)
        self.last_reset: dict[str, int] = {}
        self._scenario = scenario
        self._set_present = set_present
        self._plug = plug
        self._is_due = is_due
        self._set_input = set_input
        self._on_bus = on_bus
        self._setters: dict[Action, Callable[[str, int], None]] = {
            Action.SET: self._set_value,
            Action.OUTPUT: set_output,
            Action.DRIVE_FAULT: self._trip,
            Action.FSOE_ADDRESS: network.set_address,
        }
        self._steps = list(scenario.steps) if scenario else []
        self._next_step = 0
        self._open = list(scenario.expectations) if scenario else []
        self._failed: dict[int, str] = {}
        self._done: set[int] = set()
        self._auto_release_ns: int | None = None
        self._auto_pressed = False
        self._was_on = dict.fromkeys((d.name for d in network.masters), False)
        for name in network.default_inputs():
            network.set_good(name)
        self._drive_states: dict[str, tuple[PdsState, bool]] = {}
        if scenario is not None:
            network.choose_logic(scenario.logic)
            network.choose_drives(scenario.drives)
            for name in scenario.logic.inputs or ():
                network.set_good(name)
            for name, value in scenario.initial.items():
                # After the defaults, because initial values of the scenario have priority.
                network.set_safe_input(name, value)

    # -- before the devices step ----------------------------------------------------------------

    def act(self, now_ns: int) -> None:
        """Execute every step that is due."""
        while self._next_step < len(self._steps) and self._steps[self._next_step].at_ns <= now_ns:
            step = self._steps[self._next_step]
            self._next_step += 1
            self.do(step, now_ns)
        if self._scenario is None:
            self._press_once(now_ns)

    def do(self, step: ScenarioStep, now_ns: int, source: str = "scenario") -> None:
        """Execute one step that is valid for the network."""
        self.log(now_ns, source, _step_text(step))
        if step.action in (Action.PRESS, Action.RELEASE):
            self._press(step.action is Action.PRESS, step.target)
        elif step.action in (Action.BREAK, Action.HEAL, Action.PLUG, Action.PULL):
            is_group = step.action in (Action.PLUG, Action.PULL)
            change = self._plug if is_group else self._set_present
            change(step.target, step.action in (Action.HEAL, Action.PLUG))
        elif step.action is Action.POWER_CYCLE:
            # The FSoE ends restart with the device; the segment loses its AL state.
            self.network.devices[step.target].power_cycle()
            self._on_bus(step)
        elif step.action is Action.LOCAL_RESET:
            self.network.mains[step.target].instance.request_reset()
        elif step.action in self._setters:
            for name, value in step.values.items():
                self._setters[step.action](name, value)
            # The address is also in an object that the MainDevice can read.
            if step.action is Action.FSOE_ADDRESS:
                self._on_bus(step)
        else:
            self._on_bus(step)

    def _set_value(self, name: str, value: int) -> None:
        if self.network.has_safe_input(name):
            self.network.set_safe_input(name, value)
        else:
            self._set_input(name, value)

    def _trip(self, name: str, error_code: int) -> None:
        self.network.axes[name].axis.trip(error_code)

    def _press(self, pressed: bool, target: str = RESET_OF_ALL) -> None:
        for device in self.network.masters:
            if target in (RESET_OF_ALL, device.name):
                device.logic.pressed = pressed

    def _press_once(self, now_ns: int) -> None:
        """Press reset as an operator; without a scenario, nothing would switch on otherwise."""
        # Released in a later step than pressed, because the logic must see both levels.
        if self._auto_release_ns is not None and now_ns >= self._auto_release_ns:
            self._press(False)
            self._auto_release_ns = None
        if not self.network.mains:
            return  # nothing has a reset
        times = self.time_to_data_ns
        # All expected connections, and a little later: an earlier press would be ignored.
        settled = all(n in times for n in self.network.mains if self._is_due(n)) and (
            now_ns >= max(times.values(), default=0) + _AUTO_PRESS_NS
        )
        if not self._auto_pressed and settled:
            self._auto_pressed = True
            self._press(True)
            self._auto_release_ns = now_ns + _AUTO_PRESS_NS
            self.log(now_ns, "run", "no scenario: reset pressed once, all connections in Data")

    def is_settled(self, now_ns: int) -> bool:
        """Return whether a run without a scenario has nothing more to show.

        Reset has been pressed and released, no connection was reset, and each FSoE watchdog could
        have expired twice since all connections came to Data.
        """
        if not self._auto_pressed or self._auto_release_ns is not None:
            return False
        if any(self.resets.values()):
            return False
        longest_ms = max(port.setup.main.watchdog_ms for port in self.network.mains.values())
        return now_ns >= max(self.time_to_data_ns.values()) + 2 * longest_ms * 1_000_000

    # -- after the devices have stepped -----------------------------------------------------------

    def watch(self, now_ns: int) -> None:
        """Collect events and judge expectations."""
        for name, main in self.network.mains.items():
            sub = self.network.subs[name]
            self._instance_events(name, main, now_ns)
            self._instance_events(name, sub, now_ns)
            # Only the first time counts, because it is the start-up time.
            if name not in self.time_to_data_ns and state_of(main, sub).in_data:
                self.time_to_data_ns[name] = now_ns
        for device in self.network.masters:
            if device.logic.on is not self._was_on[device.name]:
                self._was_on[device.name] = device.logic.on
                self.log(now_ns, device.name, f"outputs {'on' if device.logic.on else 'off'}")
        for name, wired in self.network.axes.items():
            self._drive_events(name, wired.axis, now_ns)
        if self._open:
            self._judge(now_ns)

    def _drive_events(self, name: str, axis: EmulatedAxis, now_ns: int) -> None:
        seen = axis.power.state, axis.safe.torque_off
        before = self._drive_states.get(name, (PdsState.NOT_READY, True))
        if seen == before:
            return
        self._drive_states[name] = seen
        if seen[0] is not before[0]:
            code = axis.power.error_code
            with_code = f", error 0x{code:04x}" if code else ""
            self.log(now_ns, name, f"{seen[0].words}{with_code}")

    def _instance_events(self, name: str, port: Port, now_ns: int) -> None:
        end, side = ("MainInstance", "main") if port.is_main else ("SubInstance", "sub")
        for event in port.instance.take_events():
            if event.kind is EventKind.STATE:
                state = event.state_after
                facts = state_fields(side, state.value, in_data=state is State.DATA)
                self.log(now_ns, name, f"{end}: {state.value}", **facts)
                continue
            if event.kind is EventKind.RESET_LOCAL:
                # Reset 0 in state Reset is how each connection starts; it is not a disturbance.
                first = port.is_main and event.state_before is State.RESET and event.code == 0
                if not first:
                    self.resets[name] += 1
                    self.last_reset[name] = event.code
                text = f"{end} resets: {reset_code_text(event.code)}"
                self.log(now_ns, name, text, code=event.code, kind=RunEventKind.RESET, end=side)
            # The same reset at the other end: it is counted once.
            else:
                text = f"{end} was reset by its peer: {reset_code_text(event.code)}"
                self.log(now_ns, name, text, code=event.code)

    def _judge(self, now_ns: int) -> None:
        for number, expectation in enumerate(self._open):
            if number in self._done or now_ns < expectation.from_ns:
                continue
            # The first mismatch is kept; later ones are often consequences.
            if number not in self._failed:
                seen = self._mismatch(expectation)
                if seen:
                    self._failed[number] = f"{seen} at {now_ns / 1e6:g} ms"
            # At its end and not before: an expectation must be met during the whole interval.
            if now_ns >= expectation.to_ns:
                self._done.add(number)

    def _mismatch(self, expectation: Expectation) -> str:
        """Return the actual observation, or an empty text."""
        most = math.inf if expectation.max_resets is None else expectation.max_resets
        # A connection that is absent by design has no state.
        due = filter(self._is_due, self.network.mains)
        names = [expectation.connection] if expectation.connection else list(due)
        for name in names:
            state = state_of(self.network.mains[name], self.network.subs[name])
            if not _agrees(expectation.state, state):
                return f"{name} was in {state}"
            resets = self.resets[name]
            if not (expectation.min_resets or 0) <= resets <= most:
                return f"{name} had {counted(resets, 'reset')}"
        for name, value in expectation.safe_outputs.items():
            got = self.network.safe_output(name)
            if got != value:
                return f"{name} was {got}"
        for name, wanted in expectation.drives.items():
            axis = self.network.axes[name].axis
            if axis.power.state.key != wanted:
                return f"{name} was in {axis.power.state.key}"
        if expectation.outputs_on is not None:
            for device in self.network.masters:
                if device.logic.on is not expectation.outputs_on:
                    return f"outputs of {device.name} were {'on' if device.logic.on else 'off'}"
        return ""

    def finish(self, now_ns: int) -> None:
        """Judge steps due after the last one, and report steps that were never reached."""
        self._judge(now_ns)
        left = len(self._steps) - self._next_step
        if left:
            self.log(
                now_ns, "run", f"the run ended before {left} of {counted(len(self._steps), 'step')}"
            )

    def verdicts(self) -> tuple[ExpectationResult, ...]:
        """Return the verdict on every expectation; one that was never due has failed."""
        rows = []
        for number, expectation in enumerate(self._open):
            seen = self._failed.get(number, "")
            if not seen and number not in self._done:
                seen = "the run ended before"
            rows.append(
                ExpectationResult(
                    place=str(expectation.span),
                    text=_expectation_text(expectation),
                    held=not seen,
                    seen=seen,
                )
            )
        return tuple(rows)

    def log(self, now_ns: int, source: str, text: str, **facts: Any) -> None:
        """Add an event; above a limit only count it, so that a reset loop cannot exhaust memory.

        Args:
            now_ns: Time of the run.
            source: Subject of the event.
            text: Description.
            facts: Further fields of `RunEvent`.
        """
        if len(self.events) >= _MAX_EVENTS:
            self.events_lost += 1
            return
        self.events.append(RunEvent(time_ms=now_ns / 1e6, source=source, text=text, **facts))


def _values_text(values: object) -> str:
    return ", ".join(f"{k} = {v}" for k, v in dict(values).items())  # type: ignore[call-overload]


def _step_text(step: ScenarioStep) -> str:
    word = step.action.value
    if step.other:
        return f"{word} {step.target} and {step.other}"
    if step.values:
        return f"{word} {f'{step.target}: ' * bool(step.target)}{_values_text(step.values)}"
    return f"{word.replace('_', ' ')} {step.target or step.number}"


def _expectation_text(e: Expectation) -> str:
    when = f"at {e.from_ns / 1e6:g} ms"
    # A moment is an interval of length 0.
    if e.to_ns != e.from_ns:
        when = f"from {e.from_ns / 1e6:g} to {e.to_ns / 1e6:g} ms"
    parts = []
    if e.state:
        parts.append(f"{e.connection or 'every connection'} in {e.state}")
    if e.safe_outputs:
        parts.append(_values_text(e.safe_outputs))
    parts += [f"{name} in {state}" for name, state in e.drives.items()]
    if e.outputs_on is not None:
        parts.append(f"outputs {'on' if e.outputs_on else 'off'}")
    who = e.connection or "every connection"
    if e.min_resets is not None:
        parts.append(f"{who} with at least {counted(e.min_resets, 'reset')}")
    if e.max_resets is not None:
        parts.append(f"{who} with at most {counted(e.max_resets, 'reset')}")
    return f"{when}: {', '.join(parts)}"


def _agrees(wanted: str, state: ConnectionState) -> bool:
    """Whether a connection is in the expected state; ``data`` matches any Data state."""
    if wanted == "data" and state.in_data:
        return True
    return wanted in ("", state)
