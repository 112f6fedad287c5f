"""The speed of an emulated run: simulated time follows the clock."""

from __future__ import annotations

import threading
import time

_BEHIND_NS = 100_000_000  # larger delays are not caught up


class Pace:
    """Simulated time compared with the clock."""

    def __init__(self) -> None:
        self._begun_ns = time.monotonic_ns()
        self._marks: list[tuple[int, int]] = []

    def keep(self, now_ns: int, end: threading.Event) -> None:
        """Wait until the clock reaches a simulated time; lost time is not caught up."""
        clock_ns = time.monotonic_ns() - self._begun_ns
        if now_ns > clock_ns:
            end.wait((now_ns - clock_ns) / 1e9)
        elif clock_ns - now_ns > _BEHIND_NS:
            self._begun_ns += clock_ns - now_ns

    def share(self, now_ns: int) -> float | None:
        """Return the speed of simulated time relative to the clock, over the last second; 1: equal.

        ``None`` until a second has passed.
        """
        clock_ns = time.monotonic_ns()
        self._marks.append((clock_ns, now_ns))
        while len(self._marks) > 1 and self._marks[1][0] <= clock_ns - 1_000_000_000:
            del self._marks[0]
        begun_ns, from_ns = self._marks[0]
        past_ns = clock_ns - begun_ns
        return round((now_ns - from_ns) / past_ns, 3) if past_ns >= 1_000_000_000 else None
