"""What the cyclic thread lets others see, as plain values."""

from __future__ import annotations

import enum
from dataclasses import dataclass

__all__ = [
    "ConnectionSnapshot",
    "CoreEvent",
    "DirectionSnapshot",
    "OutsideState",
    "Snapshot",
    "Statistics",
]


class OutsideState(enum.Enum):
    """State of a connection as the commands on the wire show it; values are those of the core."""

    SILENT = 0
    RESET = 1
    SESSION = 2
    CONNECTION = 3
    PARAMETER = 4
    DATA_FAILSAFE = 5
    DATA_PROCESS = 6
    UNKNOWN = 7

    @property
    def word(self) -> str:
        """Lower-case word for files and tables, e.g. ``data_process``."""
        return self.name.lower()


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """Counters of the cyclic thread; times in nanoseconds.

    Entry ``n`` of ``latency_histogram`` counts wake-ups that came 2^(n-1) to 2^n ns late, entry 0
    those in time, the last one all above. Latencies stay 0 in virtual time.
    """

    cycles: int
    overruns: int
    wkc_errors: int
    bytes_copied: int
    now_ns: int
    latency_max_ns: int
    latency_mean_ns: int
    latency_min_ns: int
    latency_histogram: tuple[int, ...]
    cycle_max_ns: int
    copy_max_ns: int
    events_lost: int
    expected_wkc: int
    actual_wkc: int
    copies: int
    merged_copies: int
    realtime: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionSnapshot:
    """One direction of a connection; ``cycle_*`` is the time between new data frames."""

    command: int
    connection_id: int
    reset_code: int
    frames: int
    process_data: int
    failsafe_data: int
    resets: int
    last_new_ns: int
    cycle_last_ns: int
    cycle_min_ns: int
    cycle_mean_ns: int
    cycle_max_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionSnapshot:
    """One connection as seen from outside."""

    state: OutsideState
    to_sub: DirectionSnapshot
    to_main: DirectionSnapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """A consistent picture of one cycle; connections in plan order."""

    statistics: Statistics
    connections: tuple[ConnectionSnapshot, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoreEvent:
    """A change of state the core has seen on the wire."""

    now_ns: int
    connection: int
    before: OutsideState
    after: OutsideState
    reset_code: int
