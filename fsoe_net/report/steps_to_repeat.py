"""Steps of the test record to repeat after a change."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from fsoe_net.compare.changed_subdevices import changed_subdevices
from fsoe_net.compare.diff_types import Change, ChangeArea, ChangeKind
from fsoe_net.model.network import TransferKind
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.safety import SafetyFunction
from fsoe_net.model.test_record import StepKind, TestStep
from fsoe_net.plan.fingerprint import safety_text
from fsoe_net.plan.model import Plan


def steps_to_repeat(
    changes: Iterable[Change],
    resolution: Resolution,
    steps: Iterable[TestStep],
    *,
    plans: tuple[Plan, Plan] | None = None,
    functions: Sequence[SafetyFunction] | None = None,
) -> tuple[str, ...]:
    """Return the ids of the steps to repeat, in their order.

    A change of a SubDevice, its process data, a copy or a connection affects every connection and
    every safety function with an end there. A change of shared data, of a removed or renamed item,
    or of an unknown place affects everything: no change is assumed to be harmless.

    Args:
        changes: Differences from the accepted state.
        resolution: The current network.
        steps: The test record of that network.
        plans: The accepted plan, and the current one: differences of their fingerprints count even
            if ``changes`` does not contain them.
        functions: The accepted safety functions, if known.
    """
    steps = tuple(steps)
    named = _named(tuple(changes), resolution)
    more = frozenset() if plans is None else changed_subdevices(*plans)
    # A change that cannot be assigned to a part affects every step.
    if named is None or more is None:
        return tuple(step.id for step in steps)
    subdevices, touched_functions = named[0] | more, named[1]
    # Safety functions are not part of the plan, so a plan alone cannot show their change.
    if functions is not None:
        accepted = {f.name: safety_text((f,)) for f in functions}
        # A new function has no accepted text and is also tested.
        for f in resolution.network.safety_functions:
            if accepted.get(f.name) != safety_text((f,)):
                touched_functions.add(f.name)
    touched_functions |= _functions_over(subdevices, resolution)
    connections = {c.name for c in resolution.connections if subdevices & {c.main.name, c.sub.name}}
    touched: dict[StepKind, Collection[str]] = {
        StepKind.START_UP: connections,
        StepKind.TRIGGER: touched_functions,
        StepKind.LOSS: subdevices,
    }
    return tuple(s.id for s in steps if s.subject in touched.get(s.kind, ()))


def _named(changes: Sequence[Change], resolution: Resolution) -> tuple[set[str], set[str]] | None:
    """Return the SubDevices and safety functions named by changes, or ``None`` for all."""
    known = {s.name for s in resolution.network.subdevices if s.name}
    functions: set[str] = set()
    subdevices: set[str] = set()
    for change in changes:
        if change.area is ChangeArea.SAFETY_FUNCTION:
            functions.add(change.where)  # a removed function has no step
            # A change without a name may concern any function.
            if not change.where:
                return None
            continue
        here = set(change.subdevices)
        renamed = change.area is ChangeArea.SUBDEVICE and change.what == "name"
        # A removed or renamed SubDevice can no longer be found in the current network.
        if renamed or change.kind is ChangeKind.REMOVED or not here or not here <= known:
            return None
        subdevices |= here
    return subdevices, functions


def _functions_over(subdevices: Collection[str], resolution: Resolution) -> set[str]:
    """Return the safety functions whose signal passes one of these SubDevices."""
    if not subdevices:
        return set()
    mains: dict[str, set[str]] = {}
    for c in resolution.connections:
        mains.setdefault(c.sub.name, set()).add(c.main.name)
    feeds: dict[str, set[str]] = {}
    for row in resolution.transfers:
        source, destination = row.source.subdevice, row.destination.subdevice
        # FSoE copies belong to connections; only standard data can affect another function.
        standard = row.transfer.kind is TransferKind.STANDARD
        if standard and source is not None and destination is not None:
            feeds.setdefault(destination.name, set()).add(source.name)
    found = set()
    for function in resolution.network.safety_functions:
        used = {e.sub for e in function.elements if e.sub}
        waiting = list(used)
        while waiting:  # its logic is part of it, even if it is not an element
            new = mains.get(waiting.pop(), set()) - used
            used |= new
            waiting += new
        for name in tuple(used):  # a reset, for example
            used |= feeds.get(name, set())
        # A function without SubDevices cannot be assigned, so it is tested in any case.
        if not used or not used.isdisjoint(subdevices):
            found.add(function.name)
    return found
