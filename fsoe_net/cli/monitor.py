"""``fsoe-net monitor``: watches a running ``fsn-master``, and captures its bus."""

from __future__ import annotations

import json

import click

from fsoe_net.cli.monitor_output import bus_document, capture_text
from fsoe_net.cli.monitor_watch import begin_capture, watch
from fsoe_net.cli.options import (
    FILE,
    RUN_TIME,
    format_option,
    master_options,
    master_socket,
    overwrite_option,
)
from fsoe_net.cli.stop import ENDS_OR_HANGS_UP, stop_on
from fsoe_net.cli.terminal import echo, show
from fsoe_net.cli.write import check_target
from fsoe_net.live.attachment import Attachment
from fsoe_net.version import __version__

_EPILOG = """\b
Examples:
  fsoe-net monitor --interface eth1
  fsoe-net monitor --socket /run/fsn-master/fsn-master-eth1.sock --once
  fsoe-net monitor --interface eth1 --duration 60s --format json > minute.json
  fsoe-net monitor --interface eth1 --duration 10s --capture bus.pcapng

Exit codes: 0 at the end every connection is in Data and every SubDevice in OP, 1 otherwise, 3 no
fsn-master answers. Ctrl-C ends the command; fsn-master continues."""


@click.command("monitor", epilog=_EPILOG)
@master_options
@click.option("--once", is_flag=True, help="Print the current state once and exit.")
@click.option(
    "--duration",
    "duration_ns",
    type=RUN_TIME,
    metavar="TIME",
    help="Run time. Default: until Ctrl-C.",
)
@click.option(
    "--capture", type=FILE, metavar="FILE", help="Write the EtherCAT frames to this pcapng file."
)
@overwrite_option
@click.option(
    "--rebuild", is_flag=True, help="Capture from the process image instead of from the wire."
)
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
    """Watch the bus of a running fsn-master.

    Shows connections with their FSoE cycle times against the watchdog, held inputs, Resets with
    their cause, SubDevices that are not in OP, broken links and cycle timing. Changes nothing.
    """
    path = master_socket(socket, interface)
    if once and (duration_ns is not None or capture is not None):
        raise click.UsageError("--once looks once: leave out --duration and --capture")
    if rebuild and capture is None:
        raise click.UsageError("--rebuild belongs to --capture")
    # Before the bus is watched, because a capture of hours must not fail at its end.
    check_target(capture, overwrite=overwrite)
    stop = stop_on(ENDS_OR_HANGS_UP)
    with Attachment(path) as attached:
        if once:
            view, recorded = attached.look(0.0), None
        else:
            recorder = begin_capture(attached, path, capture, rebuild=rebuild)
            try:
                view = watch(attached, duration_ns, stop, live=fmt == "text")
            finally:
                # Also after Ctrl-C or an error: the file must be complete up to that point.
                if recorder is not None:
                    recorder.stop()
            recorded = recorder
    if fmt == "json":
        document = {
            "tool": "fsoe-net",
            "version": __version__,
            "socket": path,
            **view.to_json(),
            "capture": None if recorded is None else {"file": capture, **recorded.to_json()},
        }
        echo(json.dumps(document, indent=2, ensure_ascii=False))
    else:
        show(bus_document(view))
        if recorded is not None:
            echo(capture_text(recorded, capture))
    ctx.exit(0 if view.good else 1)
