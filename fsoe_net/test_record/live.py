"""A test record on a live bus: only results that a running ``fsn-master`` can show.

``fsn-master`` observes frames and AL states, not terminals and outputs, so triggers are left to
people. It causes no disturbance itself; a SubDevice is disconnected by hand, after a confirmation
for each step that the area is guarded.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any
from typing import Protocol as Interface

from fsoe_net.core.bus_documents import SubDeviceSnapshot
from fsoe_net.core.snapshot import ConnectionSnapshot
from fsoe_net.diag.words import counted
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.live.control_values import Status
from fsoe_net.live.in_use import check_in_use, emulated_bus
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.test_record import (
    EMULATED_NOTE,
    StepKind,
    StepOutcome,
    StepResult,
    TestRecord,
    TestStep,
)
from fsoe_net.plan.fingerprint import Fingerprint
from fsoe_net.test_record.steps import connections_of


class LossTimes:
    """Times from the first bus cycle without a SubDevice until its connections have left Data.

    ``now_ns`` of these events is the start of the bus cycle that showed them. The reaction of a
    connection with both ends off the bus is not visible: it only becomes silent, and has no time.

    Args:
        own: Names of the connections of the SubDevice.
    """

    def __init__(self, own: Iterable[str]) -> None:
        self._own = frozenset(own)
        self._lost_ns: int | None = None
        self._left_ns: dict[str, int] = {}
        self._silent: set[str] = set()
        self.interruptions = 0
        """How often the working counter was incomplete and complete again before the loss."""

    def take(self, event: Mapping[str, Any]) -> None:
        """Process an event."""
        kind, now_ns = event.get("event"), event.get("now_ns")
        if not isinstance(now_ns, int):
            return
        if kind == "wkc":
            self._working_counter(bool(event.get("complete")), now_ns)
        elif kind == "connection":
            self._connection(event, now_ns)

    def _working_counter(self, complete: bool, now_ns: int) -> None:
        if not complete:
            self._lost_ns = now_ns if self._lost_ns is None else self._lost_ns
        # Complete again: this was a disturbance and not yet the loss.
        elif self._lost_ns is not None:
            self._lost_ns = None
            self.interruptions += 1

    def _connection(self, event: Mapping[str, Any], now_ns: int) -> None:
        name = str(event.get("connection"))
        before, after = (
            ConnectionState.from_event(str(event.get(key))) for key in ("before", "after")
        )
        # Only the first departure from Data counts; states before it are the start-up.
        if name not in self._own or not before.in_data or after.in_data:
            return
        # Silence is reported later than a Reset, and has no time of its own.
        if after is ConnectionState.SILENT:
            self._silent.add(name)
        else:
            self._left_ns[name] = now_ns

    @property
    def silent(self) -> list[str]:
        """Connections that only became silent."""
        return sorted(self._silent - self._left_ns.keys())

    def doubts(self) -> list[str]:
        """Return what makes the time uncertain or hides it, in words."""
        words = []
        if self.silent:
            names = ", ".join(self.silent)
            words.append(f"{names} fell silent with both ends off the bus: no time seen")
        if self.interruptions:
            words.append(
                f"{counted(self.interruptions, 'time')} the bus lost frames before it: the time is "
                "uncertain"
            )
        return words

    def took_ms(self) -> float | None:
        """Return the time of the slowest connection, ms; ``None`` if it was not observed."""
        if self._lost_ns is None or not self._left_ns:
            return None
        if self._left_ns.keys() | self._silent != self._own:
            return None
        took_ns = max(self._left_ns.values()) - self._lost_ns
        return took_ns / 1e6 if took_ns >= 0 else None


_PERSON_S = 300.0  # for an action of a person at the machine
_SETTLE_S = 20.0  # for reactions of connections
_POLL_S = 0.02


class Observer(Interface):
    """The required interface of a running ``fsn-master``, as in `fsoe_net.live.client.Client`."""

    def status(self) -> Status:
        """Return state and plan."""

    def connections(self) -> tuple[ConnectionSnapshot, ...]:
        """Return the connections."""

    def subdevices(self) -> tuple[SubDeviceSnapshot, ...]:
        """Return the SubDevices."""

    def subscribe(self) -> None:
        """Subscribe to every change."""

    def events(self, wait_s: float = 0.0) -> list[dict[str, Any]]:
        """Return the events, after waiting at most ``wait_s`` for the first one."""


class Person(Interface):
    """The person at the machine."""

    def guarded(self, step: TestStep) -> bool:
        """Return whether the person confirms for this step that the area is guarded."""

    def tell(self, text: str) -> None:
        """Tell the person the next action."""


def run_tests_live(
    test_record: TestRecord,
    resolution: Resolution,
    observer: Observer,
    person: Person,
    *,
    fingerprint: Fingerprint | None = None,
    person_s: float = _PERSON_S,
    settle_s: float = _SETTLE_S,
    clock: Callable[[], float] = time.monotonic,
    on_step: Callable[[TestRecord, TestStep], None] | None = None,
) -> TestRecord:
    """Return the test record with the results of the live bus filled in, where available.

    Args:
        test_record: Test record of this network.
        resolution: A network without errors.
        observer: A running ``fsn-master``.
        person: Person who confirms and causes each loss.
        fingerprint: Fingerprint of the files; without it the hashes of the plans are compared.
        person_s: Timeout for each action of a person.
        settle_s: Timeout for reactions of connections.
        clock: Clock in seconds.
        on_step: Called after each processed step with the current test record, so that results are
            kept if a later step is interrupted.

    Raises:
        InputError: ``fsn-master`` runs another configuration.
        EnvironmentFault: ``fsn-master`` does not answer.
    """
    status = observer.status()
    # Results of another configuration must not be added to this record.
    check_in_use(status, fingerprint, test_record.plan_sha256)
    rig = emulated_bus(status)
    if rig:
        person.tell(f"{EMULATED_NOTE}: {rig}.")
    observer.subscribe()
    watch = _Watch(resolution, observer, person, status, person_s, settle_s, clock)
    bus = f"{status.backend} on {status.interface}" if status.interface else status.backend
    # A result of an emulated bus must never look like one of the machine.
    mark = f"{EMULATED_NOTE}: {rig}" if rig else bus
    for number, step in enumerate(test_record.steps):
        seen = watch.seen(step)
        if seen is None:
            continue
        seen = replace(seen, remark=f"{mark}; {seen.remark}")
        tried = replace(step, live=_kept(step.live, seen))
        steps = (*test_record.steps[:number], tried, *test_record.steps[number + 1 :])
        test_record = replace(test_record, steps=steps)
        if on_step is not None:
            on_step(test_record, replace(tried, live=seen))
    return test_record


def _kept(before: StepResult | None, now: StepResult) -> StepResult:
    """Keep the results of the last run for a skipped step."""
    if before is not None and now.outcome is StepOutcome.NOT_RUN:
        return before
    return now


class _Watch:
    """Observes a running bus, step by step."""

    def __init__(
        self,
        resolution: Resolution,
        observer: Observer,
        person: Person,
        status: Status,
        person_s: float,
        settle_s: float,
        clock: Callable[[], float],
    ) -> None:
        self._resolution = resolution
        self._observer = observer
        self._person = person
        self._cycle_ms = status.cycle_ns / 1e6
        self._person_s = person_s
        self._settle_s = settle_s
        self._clock = clock

    def seen(self, step: TestStep) -> StepResult | None:
        """Return the result of this step, or ``None`` if the bus cannot show any."""
        if step.kind is StepKind.START_UP:
            return self._start_up(step.subject)
        if step.kind is StepKind.LOSS:
            return self._loss(step)
        return None

    def _idle(self, own: set[str]) -> str:
        states = self._states()
        idle = (name for name in own if states.get(name) is ConnectionState.DATA_FAILSAFE)
        return ", ".join(sorted(idle))

    def _states(self) -> dict[str, ConnectionState]:
        return {c.name: c.state for c in self._observer.connections()}

    def _start_up(self, name: str) -> StepResult:
        if name not in self._states():
            return _not_run("fsn-master has no connection of this name")
        reached = self._until(lambda: self._states()[name].in_data, self._settle_s)
        return StepResult(
            outcome=StepOutcome.AS_EXPECTED if reached else StepOutcome.NOT_AS_EXPECTED,
            remark=f"now {self._states()[name].text}; outputs before a reset are not seen here",
        )

    # -- loss -------------------------------------------------------------------------------------

    def _loss(self, step: TestStep) -> StepResult:
        own = {c.name for c in connections_of(self._resolution, step.subject)}
        if why := self._unfit(step.subject, own):
            return _not_run(why)
        # If no outputs are switched on, the loss would show nothing.
        if idle := self._idle(own):
            self._person.tell(
                f"{idle} sends FailSafeData: outputs are off already. Press reset before you go on."
            )
        if not self._person.guarded(step):
            return _not_run("it was not confirmed that the area is guarded")
        # Checked twice: a person needs time, and the bus may have changed in the meantime.
        if why := self._unfit(step.subject, own):
            return _not_run(why)
        before, away = self._states(), self._off()
        # Cleared, because events from before the loss must not count.
        self._observer.events()
        times = LossTimes(own)
        self._person.tell(f"Take {step.subject} off the bus now.")
        if why := self._taken(step.subject, away, times):
            return _not_run(why)
        left = self._until(lambda: not any(s.in_data for s in self._of(own)), self._settle_s, times)
        stayed = sum(s.in_data for s in self._states().values())
        self._person.tell(f"Put {step.subject} back.")
        back = self._back(before, away)
        return self._judged(step, before, own, times, left=left, back=back, stayed=stayed)

    def _judged(
        self,
        step: TestStep,
        before: Mapping[str, ConnectionState],
        own: set[str],
        times: LossTimes,
        *,
        left: bool,
        back: bool,
        stayed: int,
    ) -> StepResult:
        took = times.took_ms()
        time_is = ""
        if took is not None:
            took += self._cycle_ms  # from the last bus cycle with it, as on the emulated bus
            time_is = (
                "from the last bus cycle with it until its connections had left Data on the bus, "
                f"to the bus cycle of {self._cycle_ms:g} ms; devices and outputs not in it"
            )
        words = [f"{stayed} of {counted(len(before), 'connection')} in Data without it"]
        # A connection that sent FailSafeData proves nothing about its outputs.
        if idle := sorted(n for n in own if before[n] is ConnectionState.DATA_FAILSAFE):
            words.append(f"{', '.join(idle)} sent FailSafeData before, so outputs were off already")
        words += times.doubts()
        wrong = []
        if not left:
            wrong.append("its connections stayed in Data")
        if not back:
            wrong.append("not all came back into Data")
        if took is not None and step.limit_ms is not None and took > step.limit_ms:
            wrong.append(f"later than {step.limit_ms:g} ms")
        return StepResult(
            outcome=StepOutcome.NOT_AS_EXPECTED if wrong else StepOutcome.AS_EXPECTED,
            measured_ms=took,
            time_is=time_is,
            remark="; ".join([*words, *wrong, "outputs are not seen here"]),
        )

    def _unfit(self, name: str, own: set[str]) -> str:
        states = self._states()
        if missing := sorted(own - states.keys()):
            return f"fsn-master has no connection {missing[0]}"
        if idle := sorted(n for n in own if not states[n].in_data):
            return f"its connections were not in Data: {idle[0]} in {states[idle[0]].text}"
        return f"{name} was not in OP" if name in self._off() else ""

    def _taken(self, name: str, away: set[str], times: LossTimes) -> str:
        """Wait until it is disconnected; return the reason if it was not."""
        others: set[str] = set()

        def gone() -> bool:
            off = self._off() - away
            if name not in off and off - others:
                others.update(off)
                self._person.tell(f"{', '.join(sorted(off))} left the bus, {name} is still there.")
            return name in off

        if self._until(gone, self._person_s, times):
            return ""
        self._person.tell(f"{name} has not left the bus: leave it as it is. Next step.")
        wrong = f"; {', '.join(sorted(others))} left instead" if others else ""
        return f"{name} stayed on the bus{wrong}"

    def _back(self, before: Mapping[str, ConnectionState], away: set[str]) -> bool:
        """Wait until all SubDevices and connections have returned, including those after it."""
        inside = [name for name, state in before.items() if state.in_data]
        return self._until(
            lambda: self._off() <= away and all(s.in_data for s in self._of(inside)), self._person_s
        )

    def _of(self, names: set[str] | list[str]) -> list[ConnectionState]:
        states = self._states()
        return [states[name] for name in names]

    def _off(self) -> set[str]:
        return {sub.name for sub in self._observer.subdevices() if not sub.in_op}

    def _until(
        self, done: Callable[[], bool], wait_s: float, times: LossTimes | None = None
    ) -> bool:
        """Poll until the condition is met, and record the times of events in the meantime."""
        end = self._clock() + wait_s
        while True:
            # The condition is checked before the time: a result at the last moment counts.
            found = done()
            over = self._clock() >= end
            for event in self._observer.events(0.0 if found or over else _POLL_S):
                if times is not None:
                    times.take(event)
            if found or over:
                return found


def _not_run(why: str) -> StepResult:
    return StepResult(outcome=StepOutcome.NOT_RUN, remark=why)
