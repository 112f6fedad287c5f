"""A try of the network on the emulated bus, in simulated time: does it come up?"""

from __future__ import annotations

from fsoe_net.live.result import ConnectionResult
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.model import Plan
from fsoe_net.project.check import Checked, whole_network
from fsoe_net.project.simulate import simulate

TRIAL_MS = 1000
"""Simulated time of a try."""

_MOST_EVENTS = 500

Row = dict[str, object]


def try_network(checked: Checked) -> Row:
    """Run a network; nothing is sent to a bus.

    Args:
        checked: The network, with everything found in it.

    Returns:
        Plain JSON values: connections with how they ended, and what happened, in order.

    Raises:
        InputError: The network has errors, or moves nothing.
        CoreMissing: The compiled part is not there.
    """
    resolution = whole_network(checked, "not tried")
    run = simulate(resolution, duration_ns=TRIAL_MS * 1_000_000)
    absent = _absent(compile_plan(resolution))
    return {
        "passed": run.passed,
        "duration_ms": TRIAL_MS,
        "connections": [_connection(row, absent) for row in run.connections],
        "events": [
            {"time_ms": event.time_ms, "source": event.source, "text": event.text}
            for event in run.events[:_MOST_EVENTS]
        ],
        "events_left_out": max(0, len(run.events) - _MOST_EVENTS),
    }


def _absent(plan: Plan) -> dict[str, str]:
    """Return the group of each SubDevice that an emulation leaves out."""
    return {
        sub.name: group.name
        for group in plan.groups
        if not plan.is_first_choice(group)
        for sub in plan.subdevices[group.first_subdevice :][: group.subdevice_count]
    }


def _connection(row: ConnectionResult, absent: dict[str, str]) -> Row:
    group = absent.get(row.main) or absent.get(row.sub)
    return {
        "name": row.name,
        "state": f"absent: {group}" if group else row.state.text,
        "absent": bool(group),
        "in_data": row.state.in_data,
        "time_to_data_ms": row.time_to_data_ms,
        "resets": row.resets,
        "chosen": list(row.chosen),
    }
