"""``fsoe-net monitor``: watches a running ``fsn-master``, and captures its bus."""

from __future__ import annotations

import json
import sys
import threading
import time
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from fsoe_net import __version__
from fsoe_net.cli.monitor_output import bus_view
from fsoe_net.cli.options import (
    FILE,
    RUN_TIME,
    format_option,
    master_options,
    master_socket,
    overwrite_option,
)
from fsoe_net.cli.run_output import event_line, interesting, joined_events
from fsoe_net.cli.stop import ENDS_OR_HANGS_UP, stop_on
from fsoe_net.cli.terminal import echo, terminal
from fsoe_net.cli.write import check_target
from fsoe_net.diag.words import counted
from fsoe_net.errors import EnvironmentFault
from fsoe_net.run.attachment import Attachment, BusView
from fsoe_net.run.live_capture import LiveCapture
from fsoe_net.run.result import RunEvent

if TYPE_CHECKING:
    from rich.console import Console
    from rich.live import Live

__all__ = ["command"]

_EPILOG = """\b
Examples:
  fsoe-net monitor --interface eth1
  fsoe-net monitor --socket /run/fsn-master/fsn-master-eth1.sock --once
  fsoe-net monitor --interface eth1 --duration 60s --format json > minute.json
  fsoe-net monitor --interface eth1 --duration 10s --capture bus.pcapng

Exit code 0 when at the end every connection is in Data and every SubDevice in OP, else 1; 3 when
no fsn-master answers. Ctrl-C ends it; fsn-master goes on."""

_LOOK_S = 0.2
_WIDTH = 160


@click.command("monitor", epilog=_EPILOG)
@master_options
@click.option("--once", is_flag=True, help="Show what is known now, and end.")
@click.option(
    "--duration",
    "duration_ns",
    type=RUN_TIME,
    metavar="TIME",
    help="End after so long; default: when interrupted.",
)
@click.option("--capture", type=FILE, metavar="FILE", help="Write the EtherCAT frames (pcapng).")
@overwrite_option
@click.option("--rebuild", is_flag=True, help="Capture from the process image, not from the wire.")
@format_option
@click.pass_context
def command(
    ctx: click.Context,
    socket: str | None,
    interface: str | None,
    once: bool,
    duration_ns: int | None,
    capture: str | None,
    overwrite: bool,
    rebuild: bool,
    fmt: str,
) -> None:
    """Watch a bus that fsn-master drives, as one more client of it.

    Connections with their FSoE cycle times against the watchdog, held inputs, Resets with the cause
    in words; SubDevices not in OP, broken links; timing of the cycle. Changes nothing.
    """
    path = master_socket(socket, interface)
    if once and (duration_ns is not None or capture is not None):
        raise click.UsageError("--once looks once: leave out --duration and --capture")
    if rebuild and capture is None:
        raise click.UsageError("--rebuild belongs to --capture")
    check_target(capture, overwrite=overwrite)
    stop = stop_on(ENDS_OR_HANGS_UP)
    with Attachment(path) as attached:
        if once:
            view, recorded = attached.look(0.0), None
        else:
            recorder = _capture(attached, path, capture, rebuild=rebuild)
            try:
                view = _watch(attached, duration_ns, stop, live=fmt == "text")
            finally:
                if recorder is not None:
                    recorder.stop()
            recorded = recorder
    if fmt == "json":
        document = _document(view, path, capture, recorded)
        echo(json.dumps(document, indent=2, ensure_ascii=False))
    else:
        _console().print(bus_view(view))
        if recorded is not None:
            echo(_captured(recorded, capture))
    ctx.exit(0 if view.good else 1)


def _capture(
    attached: Attachment, path: str, capture: str | None, *, rebuild: bool
) -> LiveCapture | None:
    """Begin a capture where one is wanted.

    Raises:
        EnvironmentFault: It is not possible.
    """
    if capture is None:
        return None
    status = attached.look(0.0).status
    on_wire = status is not None and status.backend == "soem" and status.interface
    interface = status.interface if status is not None and on_wire else None
    try:
        recorder = LiveCapture(capture, path, interface, prefer_wire=not rebuild)
    except OSError as exc:
        raise EnvironmentFault(f"cannot write {capture}: {exc.strerror}") from exc
    if recorder.rebuilt and not rebuild:
        echo(f"the capture is rebuilt from the process image: {recorder.rebuilt}", err=True)
    return recorder


def _watch(
    attached: Attachment, duration_ns: int | None, stop: threading.Event, *, live: bool
) -> BusView:
    """Watch until the time is over or the user has had enough; return what was seen last."""
    until = None if duration_ns is None else time.monotonic() + duration_ns / 1e9
    if live and sys.stdout.isatty():
        from rich.live import Live

        with Live(refresh_per_second=10, transient=True, console=_console()) as display:
            return _follow(attached, until, stop, display)
    return _follow(attached, until, stop, None, tell=live)


def _follow(
    attached: Attachment,
    until: float | None,
    stop: threading.Event,
    display: Live | None,
    *,
    tell: bool = True,
) -> BusView:
    told = 0
    while True:
        left = _LOOK_S if until is None else min(_LOOK_S, until - time.monotonic())
        view = attached.look(max(0.0, left), stop)
        if tell:
            new = view.events[told:]
            shown = interesting(new)
            for event in joined_events(
                [e for e in new if e in shown or e.text.startswith("ports: ")]
            ):
                _tell(event, display)
        told = len(view.events)
        if stop.is_set() or (until is not None and time.monotonic() >= until):
            return view
        if display is not None:
            display.update(bus_view(view))


def _tell(event: RunEvent, display: Live | None) -> None:
    if display is None:
        echo(event_line(event))
        sys.stdout.flush()
    else:
        display.console.print(event_line(event), markup=False, highlight=False)


def _console() -> Console:
    return terminal(width=_WIDTH)


def _captured(recorder: LiveCapture, path: str | None) -> str:
    how = f"rebuilt: {recorder.rebuilt}" if recorder.rebuilt else "from the wire"
    lost = f", {recorder.skipped} missed" if recorder.skipped else ""
    text = f"{path}: {counted(recorder.packets, 'frame')}, {how}{lost}"
    if recorder.fault:
        text += f"; it ended early: {recorder.fault}"
    elif not recorder.packets and not recorder.rebuilt:
        text += "; is fsn-master in another network namespace? --rebuild needs none"
    return text


def _document(
    view: BusView, path: str, capture: str | None, recorder: LiveCapture | None
) -> dict[str, object]:
    """Return the stable JSON document (``docs/reference/json-output.md``)."""
    status, snapshot = view.status, view.snapshot
    captured = None
    if recorder is not None:
        captured = {
            "file": capture,
            "rebuilt": recorder.rebuilt or None,
            "frames": recorder.packets,
            "missed": recorder.skipped,
            "fault": recorder.fault or None,
        }
    return {
        "tool": "fsoe-net",
        "version": __version__,
        "socket": path,
        "result": "pass" if view.good else "fail",
        "state": None if status is None or view.away else status.state.value,
        "away": view.away or None,
        "status": None if status is None else asdict(status),
        "current": view.current,
        "duration_ms": view.now_s * 1000,
        "connections": [c.to_json() for c in view.connections],
        "subdevices": [] if snapshot is None else [asdict(s) for s in snapshot.subdevices],
        "statistics": None if snapshot is None else asdict(snapshot.cycle.statistics),
        "events": [asdict(e) for e in view.events],
        "events_lost": view.events_lost,
        "capture": captured,
    }
