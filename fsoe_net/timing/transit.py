"""How long a frame is on its way: the bus cycle that counts, and how many of them.

On one bus a frame needs k cycles per direction. Where it crosses buses each exchange between two
cycles costs one cycle more of the side that takes it, at most; every cycle counts as the longest
on the way (`docs/explanation/timing.md`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.resolve import Connection

__all__ = ["Transit"]


@dataclass(frozen=True, slots=True)
class Transit:
    """Cycles of a network.

    Attributes:
        network: Its buses.
        given: Bus cycle in ms instead of those of the network.
        copy_cycles: Bus cycles that a frame needs per direction on one bus.
    """

    network: NetworkConfig
    given: float | None
    copy_cycles: int

    def cycle(self, connections: Iterable[Connection]) -> float | None:
        """Return the longest bus cycle on the way of some connections, ms.

        Without connections that of the first bus; ``None`` when one is not stated.
        """
        if self.given is not None:
            return self.given
        ways = [self.network.way_cycle_ns(c.main, c.sub) for c in connections]
        cycles = [ns / 1e6 for ns in ways or [self.network.cycle_ns] if ns]
        return max(cycles) if cycles and len(cycles) == max(1, len(ways)) else None

    def cycles(self, connections: Iterable[Connection]) -> int:
        """Return how many of them a frame needs per direction; 0 without connections."""
        found = [len(self.network.way(c.main, c.sub)) - 1 for c in connections]
        return self.copy_cycles + max(found) if found else 0
