"""A test protocol on a live bus: what a running ``fsn-master`` can show, and no more.

It sees frames and AL states, no terminals and no outputs: triggers are left to people. It disturbs
nothing by itself; a SubDevice is taken off the bus by hand, after a confirmation for each step that
the area is guarded.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol as Interface

from fsoe_net.errors import InputError
from fsoe_net.model import Outcome, Protocol, ProtocolStep, Resolution, Seen, StepKind
from fsoe_net.run.control_values import NamedConnection, Status
from fsoe_net.run.live_snapshot import SubDeviceSnapshot
from fsoe_net.run.protocol import connections_of

__all__ = ["Asked", "Observer", "run_protocol_live"]

_WAIT_S = 60.0
_POLL_S = 0.02


class Observer(Interface):
    """What is asked of a running ``fsn-master``; `fsoe_net.run.Client` is one."""

    def status(self) -> Status:
        """Return state and plan."""

    def connections(self) -> tuple[NamedConnection, ...]:
        """Return the connections."""

    def subdevices(self) -> tuple[SubDeviceSnapshot, ...]:
        """Return the SubDevices."""


class Asked(Interface):
    """The person at the machine."""

    def guarded(self, step: ProtocolStep) -> bool:
        """Return whether the person confirms for this step that the area is guarded."""

    def tell(self, text: str) -> None:
        """Say what to do now."""


def run_protocol_live(
    protocol: Protocol,
    resolution: Resolution,
    observer: Observer,
    person: Asked,
    *,
    wait_s: float = _WAIT_S,
    sleep: Callable[[float], None] = time.sleep,
) -> Protocol:
    """Return the protocol with the column of the live bus filled in where it shows something.

    Args:
        protocol: Of this network.
        resolution: A network without errors.
        observer: A running ``fsn-master``.
        person: Confirms each loss, and does it.
        wait_s: How long to wait for each thing a person does.
        sleep: Waits between two looks.

    Raises:
        InputError: ``fsn-master`` runs another plan.
        EnvironmentFault: It does not answer.
    """
    running = observer.status().plan_sha256
    if running != protocol.plan_sha256:
        raise InputError(
            f"fsn-master runs another plan ({running[:16]}) than these files give "
            f"({protocol.plan_sha256[:16]}); start it with the plan of these files"
        )
    watch = _Watch(resolution, observer, person, wait_s, sleep)
    steps = tuple(replace(step, live=watch.seen(step) or step.live) for step in protocol.steps)
    return replace(protocol, steps=steps)


class _Watch:
    """Looks at a running bus, step by step."""

    def __init__(
        self,
        resolution: Resolution,
        observer: Observer,
        person: Asked,
        wait_s: float,
        sleep: Callable[[float], None],
    ) -> None:
        self._resolution = resolution
        self._observer = observer
        self._person = person
        self._looks = max(1, round(wait_s / _POLL_S))
        self._sleep = sleep

    def seen(self, step: ProtocolStep) -> Seen | None:
        """Return what this step shows; ``None`` when it cannot show anything."""
        if step.kind is StepKind.START_UP:
            return self._start_up(step.subject)
        if step.kind is StepKind.LOSS:
            return self._loss(step)
        return None

    def _states(self) -> dict[str, str]:
        return {c.name: c.seen.state.word for c in self._observer.connections()}

    def _start_up(self, name: str) -> Seen:
        state = self._states().get(name, "not there")
        reached = state.startswith("data")
        return Seen(
            outcome=Outcome.AS_EXPECTED if reached else Outcome.NOT_AS_EXPECTED,
            remark=f"now {state}; outputs before a reset are not seen here",
        )

    def _loss(self, step: ProtocolStep) -> Seen:
        name = step.subject
        own = {c.name for c in connections_of(self._resolution, name)}
        if not self._ready(own):
            return Seen(outcome=Outcome.NOT_RUN, remark="its connections were not in Data")
        if not self._person.guarded(step):
            return Seen(outcome=Outcome.NOT_RUN, remark="nobody confirmed that the area is guarded")
        self._person.tell(f"Take {name} off the bus now.")
        if not self._until(lambda: self._gone(name)):
            return Seen(outcome=Outcome.NOT_RUN, remark=f"{name} stayed on the bus")
        left = self._until(lambda: not any(self._in_data(own)))
        stayed = sum(state.startswith("data") for state in self._states().values())
        self._person.tell(f"Put {name} back.")
        back = self._until(lambda: not self._gone(name) and self._ready(own))
        words = f"{stayed} connections in Data without it; outputs are not seen here"
        if not back:
            words += "; its connections did not come back"
        fine = left and back
        return Seen(outcome=Outcome.AS_EXPECTED if fine else Outcome.NOT_AS_EXPECTED, remark=words)

    def _in_data(self, names: set[str]) -> list[bool]:
        return [s.startswith("data") for name, s in self._states().items() if name in names]

    def _ready(self, names: set[str]) -> bool:
        return all(self._in_data(names))

    def _gone(self, name: str) -> bool:
        found = [sub for sub in self._observer.subdevices() if sub.name == name]
        return not any(sub.in_op for sub in found)

    def _until(self, done: Callable[[], bool]) -> bool:
        for _ in range(self._looks):
            if done():
                return True
            self._sleep(_POLL_S)
        return done()
