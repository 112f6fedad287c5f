"""The timing budget of a network: each watchdog with its admissible interval, each safety function.

    fsoe_net.timing.reaction    response times of a safety function
    fsoe_net.timing.watchdogs   the interval of a watchdog

A value that is not stated stays open and is reported; a missing value never counts as zero.
"""

from __future__ import annotations

from collections.abc import Mapping

from fsoe_net.dataclass import dataclass
from fsoe_net.model.library import Library
from fsoe_net.model.resolve import Resolution
from fsoe_net.timing.elements import parts_of
from fsoe_net.timing.reaction import FunctionBudget, function_budget
from fsoe_net.timing.transit import Transit
from fsoe_net.timing.watchdogs import WatchdogBudget, connection_budget

COPY_CYCLES = 2  # this core copies in the cycle in which a frame arrives


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """All watchdogs and safety functions of a network.

    Attributes:
        cycle: Bus cycle in ms; with several buses, of the first one; ``None`` if the network does
            not state it.
        copy_cycles: Bus cycles per direction on one bus, k; a frame that crosses buses waits for
            one more cycle of each bus that fetches it.
        drift: Relative error by which a device clock may be slow; watchdogs count as longer by this
            share.
        buses: Name and cycle in ms of each of several buses that state one.
        connections: In the order of the resolution.
        functions: In the order of the network file.
    """

    cycle: float | None
    copy_cycles: int
    drift: float
    connections: tuple[WatchdogBudget, ...]
    functions: tuple[FunctionBudget, ...]
    buses: tuple[tuple[str, float], ...] = ()


def make_budget(
    resolution: Resolution,
    library: Library,
    *,
    cycle: float | None = None,
    copy_cycles: int = COPY_CYCLES,
    drift: float = 0.0,
    measured: Mapping[str, float] | None = None,
) -> Budget:
    """Calculate the budget of a network.

    Args:
        resolution: The network.
        library: Device times and PFH if the network states none; they count as unverified.
        cycle: Bus cycle in ms instead of that of the network.
        copy_cycles: Bus cycles that a frame needs per direction: 2 for this core, 3 for a program
            that copies one cycle later.
        drift: Relative error by which device clocks may be slow, such as 0.01.
        measured: Longest observed FSoE round trip in ms, by name of the connection. It replaces a
            shorter value of the formulas, but never a longer one.
    """
    network = resolution.network
    bus = Transit(network, cycle, copy_cycles)
    rows = [
        function_budget(f, parts_of(f, resolution, library), bus, drift)
        for f in network.safety_functions
    ]
    connections = tuple(
        connection_budget(c, rows, bus.cycles(c.main, c.sub), (measured or {}).get(c.name), drift)
        for c in resolution.connections
    )
    return Budget(
        cycle=bus.first_cycle,
        copy_cycles=copy_cycles,
        drift=drift,
        connections=connections,
        functions=tuple(rows),
        # Each bus has its own cycle; a cycle given by the caller replaces all of them.
        buses=tuple((b.name, cycle or b.cycle_ns / 1e6) for b in network.buses if b.cycle_ns),
    )
