"""Signals that end a running command, which then prints its result."""

from __future__ import annotations

import signal
import threading

ENDS = (signal.SIGINT, signal.SIGTERM)
ENDS_OR_HANGS_UP = (*ENDS, signal.SIGHUP)


def stop_on(signals: tuple[signal.Signals, ...]) -> threading.Event:
    """Return an event that these signals set from now on.

    No exception is raised, because in the middle of a request it would leave half a reply. A signal
    that was ignored before stays ignored, such as Ctrl-C for a background job.
    """
    stop = threading.Event()
    for number in signals:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: stop.set())
    return stop
