"""Watches a bus on a terminal, and captures it at the same time."""

from __future__ import annotations

import sys
import threading
import time
from typing import TYPE_CHECKING

from fsoe_net.cli.monitor_output import bus_document
from fsoe_net.cli.run_output import event_line, interesting, joined_events
from fsoe_net.cli.terminal import echo, is_screen, terminal
from fsoe_net.document.write_terminal import TerminalView
from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.attachment import Attachment, BusView
from fsoe_net.live.live_capture import LiveCapture
from fsoe_net.live.result import RunEvent, RunEventKind

if TYPE_CHECKING:
    from rich.live import Live

_LOOK_S = 0.2


def begin_capture(
    attached: Attachment, path: str, capture: str | None, *, rebuild: bool
) -> LiveCapture | None:
    """Begin a capture if one is requested.

    Raises:
        EnvironmentFault: It is not possible.
    """
    if capture is None:
        return None
    status = attached.look(0.0).status
    # Only SOEM uses a network interface of the kernel, whose sockets see nothing of AF_XDP.
    on_wire = status is not None and status.backend == "soem" and not status.xdp
    interface = (status.interface or None) if status is not None and on_wire else None
    try:
        recorder = LiveCapture(capture, path, interface, prefer_wire=not rebuild)
    except OSError as exc:
        raise EnvironmentFault(f"cannot write {capture}: {exc.strerror}") from exc
    if recorder.rebuilt and not rebuild:
        echo(f"the capture is rebuilt from the process image: {recorder.rebuilt}", err=True)
    return recorder


def watch(
    attached: Attachment, duration_ns: int | None, stop: threading.Event, *, live: bool
) -> BusView:
    """Watch until the time is over or the user stops; return the last view."""
    until = None if duration_ns is None else time.monotonic() + duration_ns / 1e9
    if live and is_screen():
        from rich.live import Live

        with Live(refresh_per_second=10, transient=True, console=terminal()) as display:
            return _follow(attached, until, stop, display)
    return _follow(attached, until, stop, None, prints=live)


def _follow(
    attached: Attachment,
    until: float | None,
    stop: threading.Event,
    display: Live | None,
    *,
    prints: bool = True,
) -> BusView:
    shown_events = 0
    while True:
        left = _LOOK_S if until is None else min(_LOOK_S, until - time.monotonic())
        view = attached.look(max(0.0, left), stop)
        if prints:
            new = view.events[shown_events:]
            shown = interesting(new)
            for event in joined_events(
                [e for e in new if e in shown or e.kind is RunEventKind.LINKS]
            ):
                _print_event(event, display)
        # Set even if nothing is printed, so that these events are not shown later.
        shown_events = len(view.events)
        if stop.is_set() or (until is not None and time.monotonic() >= until):
            return view
        if display is not None:
            display.update(TerminalView(bus_document(view)))


def _print_event(event: RunEvent, display: Live | None) -> None:
    if display is None:
        echo(event_line(event))
        sys.stdout.flush()
    else:
        display.console.print(event_line(event), markup=False, highlight=False)
