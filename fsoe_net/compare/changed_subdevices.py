"""Finds the SubDevices that differ between two plans in any content of the fingerprint.

The comparison by meaning ignores details such as the type of an entry. Steps of a test record must
not be skipped for such a change, so this module compares the canonical text.
"""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.plan.fingerprint import canonical_section
from fsoe_net.plan.model import NONE, Plan

_Row = tuple[object, ...]


def changed_subdevices(before: Plan, now: Plan) -> frozenset[str] | None:
    """Return the current names of SubDevices whose tables, copies or connections differ.

    Args:
        before: The accepted plan.
        now: The current plan.

    Returns:
        Their names, or ``None`` if all may be affected: the cycle of a bus or a group differs, or
        SubDevices were reordered, removed, or have no unique name.
    """
    old, new = ([s.name for s in plan.subdevices] for plan in (before, now))
    staying = set(new)
    if _of_all(before) != _of_all(now) or len(set(old)) != len(old) or len(staying) != len(new):
        return None
    if old != [name for name in new if name in set(old)]:
        return None
    first, second = _own(before), _own(now)
    touched = {name for name in new if first.get(name) != second.get(name)}
    for row in set(_shared(before)) ^ set(_shared(now)):
        touched |= {name for name in row[:2] if isinstance(name, str)}
    return frozenset(touched & staying)


def _of_all(plan: Plan) -> tuple[object, ...]:
    """Return the facts of the plan that do not concern a single SubDevice."""
    return (
        plan.cycle_ns,
        [(bus.name, bus.cycle_ns) for bus in plan.buses],
        [(group.name, group.place) for group in plan.groups],
    )


def _own(plan: Plan) -> dict[str, list[_Row]]:
    """Return bus, group and lines of each SubDevice, without its number."""
    names = [s.name for s in plan.subdevices]
    own: dict[str, list[_Row]] = {
        name: [(plan.bus_number(n), plan.group_number(n))] for n, name in enumerate(names)
    }
    at = 0
    for section in ("devices", "process_data"):
        for line in canonical_section(plan, section).splitlines()[1:]:
            kind, _, rest = line.partition(" ")
            if kind in ("bus", "group"):
                continue
            # Other lines follow the line of their sync manager and have no SubDevice number.
            if kind in ("device", "sm", "frame", "symbol"):
                number, _, rest = rest.partition(" " if kind == "device" else ".")
                at = int(number)
            own[names[at]].append((kind, rest))
    return own


def _shared(plan: Plan) -> Iterator[_Row]:
    """Yield copies and connections, preceded by the names of their two ends."""
    names = {n: s.name for n, s in enumerate(plan.subdevices)}

    def end(number: int, bit: int) -> tuple[str, _Row]:
        sm = plan.sync_managers[number]
        return names[sm.subdevice], (sm.index, bit)

    for c in plan.copies:
        source, source_at = end(c.source_sm, c.source_bit)
        destination, destination_at = end(c.destination_sm, c.destination_bit)
        # A connection number changes when connections are added; whether it exists does not.
        paired = c.connection != NONE
        yield source, destination, source_at, destination_at, c.bits, c.net, c.kind, paired
    for k in plan.connections:
        down, up = plan.copies[k.copy_to_sub], plan.copies[k.copy_to_main]
        ends = (
            end(down.source_sm, down.source_bit),
            end(down.destination_sm, down.destination_bit),
            end(up.source_sm, up.source_bit),
            end(up.destination_sm, up.destination_bit),
        )
        facts = (k.connection_id, k.address, k.watchdog_ms, k.app_parameters)
        yield names.get(k.main), names.get(k.sub), ends, facts, k.safe_to_sub, k.safe_to_main
