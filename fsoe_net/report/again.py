"""Which steps of the test protocol a change calls for again."""

from __future__ import annotations

import re
from collections.abc import Iterable

from fsoe_net.model import ProtocolStep, Resolution, StepKind
from fsoe_net.report.diff_types import Change

__all__ = ["steps_again"]

_ENDS = {"copy": 2, "connection": 2}


def steps_again(
    changes: Iterable[Change], resolution: Resolution, steps: Iterable[ProtocolStep]
) -> tuple[str, ...]:
    """Return the ids of the steps to do again, in their order.

    A change of a SubDevice, its process data, a copy or a connection touches every connection and
    every safety function with an end there. A change of what all share, of something that is no
    more, or of a place that this network does not name, touches everything: nothing is taken to
    be harmless.

    Args:
        changes: What differs from what was accepted.
        resolution: The network of today.
        steps: The protocol of that network.
    """
    network = resolution.network
    steps = tuple(steps)
    words = {s.name: _word(s.name) for s in network.subdevices if s.name}
    functions: set[str] = set()
    subdevices: set[str] = set()
    everything = tuple(step.id for step in steps)
    for change in changes:
        if change.area == "safety_function":
            functions.add(change.where)  # one that is no more has no step
            if not change.where:
                return everything
            continue
        here = {name for name, word in words.items() if word.search(change.where)}
        if change.kind == "removed" or len(here) < _ENDS.get(change.area, 1):
            return everything
        subdevices |= here
    functions |= {
        f.name for f in network.safety_functions if subdevices & {e.sub for e in f.elements}
    }
    connections = {c.name for c in resolution.connections if subdevices & {c.main.name, c.sub.name}}
    touched = {
        StepKind.START_UP: connections,
        StepKind.TRIGGER: functions,
        StepKind.LOSS: subdevices,
    }
    return tuple(s.id for s in steps if s.subject in touched.get(s.kind, ()))


def _word(name: str) -> re.Pattern[str]:
    return re.compile(rf"(?<!\w){re.escape(name)}(?!\w)")
