"""Time that a frame needs from one SubDevice to another.

On one bus a frame needs k cycles: it waits at most one cycle until its own bus fetches it, needs
one more, and with k = 3 a third one for a program that copies a cycle later. If it crosses buses,
each further bus fetches it in its own next cycle, which takes at most one cycle of that bus. The
two directions between two buses differ (`docs/explanation/timing.md`).
"""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.network import NetworkConfig

_COPIED_AT_ONCE = 2  # k of a program that copies in the cycle in which a frame arrives


@dataclass(frozen=True, slots=True)
class Transit:
    """Cycles of a network.

    Attributes:
        network: Its buses.
        given: Bus cycle in ms instead of those of the network.
        copy_cycles: Bus cycles that a frame needs per direction on one bus, k.
    """

    network: NetworkConfig
    given: float | None
    copy_cycles: int

    @property
    def first_cycle(self) -> float | None:
        """Cycle of the first bus, ms; ``None`` if not stated."""
        if self.given is not None:
            return self.given
        return self.network.cycle_ns / 1e6 if self.network.cycle_ns else None

    def cycles(self, source: SubDevice, destination: SubDevice) -> tuple[float, ...] | None:
        """Return the cycle of each bus on the path, ms; ``None`` if one is not stated."""
        if self.given is not None:
            return (self.given,) * len(self.network.way(source, destination))
        cycles = self.network.way_cycles_ns(source, destination)
        return None if cycles is None else tuple(ns / 1e6 for ns in cycles)

    def transfer(self, source: SubDevice, destination: SubDevice) -> float | None:
        """Return the longest time from the end that writes a frame to its arrival, ms."""
        cycles = self.cycles(source, destination)
        return None if cycles is None else transfer_time(cycles, self.copy_cycles)


def transfer_time(cycles: Sequence[float], copy_cycles: int) -> float:
    """Return the longest time from the end that writes a frame to its arrival, ms.

    Args:
        cycles: Cycle of each bus on the path, ms, that of the sender first.
        copy_cycles: Bus cycles that a frame needs per direction on one bus, k.
    """
    return cycles[0] + sum(cycles) + (copy_cycles - _COPIED_AT_ONCE) * max(cycles)
