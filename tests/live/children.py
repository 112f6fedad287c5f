"""Child processes of a test."""

from __future__ import annotations

import multiprocessing
import time

from patience import PATIENCE_S


def none_left() -> bool:
    """Whether every child process has ended.

    A pool has a thread that joins its processes too. When it was the one that reaped a process, it
    notes so a moment later than everybody else can go on.
    """
    end = time.monotonic() + PATIENCE_S
    while multiprocessing.active_children() and time.monotonic() < end:
        time.sleep(0.01)
    return not multiprocessing.active_children()
