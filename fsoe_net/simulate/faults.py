"""Effects of steps on an emulated segment: cables, identities, mailboxes, frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fsoe_net.core.segment import Segment
from fsoe_net.model.scenario import Action, ScenarioStep

_MS = 1_000_000


def apply_step(segments: Sequence[Segment], step: ScenarioStep) -> None:
    """Apply a step to the segment; steps without an effect on it are ignored.

    With several buses, it applies to the one with the SubDevice of the step, or to all of them.

    Raises:
        CoreError: More SDO aborts than a SubDevice can store.
    """
    # Values of several SubDevices in one step; each can be on a different bus.
    if step.action in _EACH:
        for name, value in step.values.items():
            for segment in _with(segments, name):
                _EACH[step.action](segment, segment.position(name), value)
        return
    for segment in _with(segments, step.target):
        if step.action in _FRAMES:
            _FRAMES[step.action](segment, step.number)
        elif step.action in _ONE:
            _ONE[step.action](segment, step)


def _with(segments: Sequence[Segment], name: str) -> list[Segment]:
    return [s for s in segments if name in s.names] or list(segments)


def _swap(segment: Segment, step: ScenarioStep) -> None:
    segment.swap(segment.position(step.target), segment.position(step.other))


def _wrong(segment: Segment, step: ScenarioStep) -> None:
    v = step.values
    identity = v.get("vendor", 0), v.get("product", 0), v.get("revision", 0)
    segment.set_identity(segment.position(step.target), identity)


def _sdo_abort(segment: Segment, step: ScenarioStep) -> None:
    v, position = step.values, segment.position(step.target)
    segment.set_sdo_abort(position, v.get("index", 0), v.get("sub"), v.get("code", 0))


def _cable(segment: Segment, step: ScenarioStep) -> None:
    by_name = step.target in segment.names
    position = segment.position(step.target) if by_name else None  # "main"
    segment.set_link(position, step.action is Action.SPLICE)


_FRAMES: dict[Action, Callable[[Segment, int], None]] = {
    Action.LOSE: Segment.lose,
    Action.LOSE_EVERY: Segment.lose_every,
    Action.REPEAT: Segment.repeat,
    Action.DELAY: lambda segment, us: segment.set_delay(us * 1000),
    Action.STALL: lambda segment, ms: segment.stall(ms * _MS),
}
_EACH: dict[Action, Callable[[Segment, int, int], None]] = {
    Action.MAILBOX_DELAY: lambda segment, at, ms: segment.set_mailbox_delay(at, ms * _MS),
    Action.AL_DELAY: lambda segment, at, ms: segment.set_al_delay(at, ms * _MS),
    Action.RX_ERRORS: lambda segment, at, errors: segment.rx_errors(at, 0, errors),
}
_ONE: dict[Action, Callable[[Segment, ScenarioStep], None]] = {
    Action.CUT: _cable,
    Action.SPLICE: _cable,
    Action.SWAP: _swap,
    Action.WRONG: _wrong,
    Action.RIGHT: lambda segment, step: segment.set_identity(segment.position(step.target), None),
    # The clock of a controller has 64 bits, that of some 32 (ETG.1000.4).
    Action.NARROW_CLOCK: lambda segment, step: segment.set_clock_bits(
        segment.position(step.target), 32
    ),
    Action.SDO_ABORT: _sdo_abort,
    Action.POWER_CYCLE: lambda segment, step: segment.power_cycle(segment.position(step.target)),
}
