"""A scan of a live bus, by the ``fsn-master`` that drives it or by one started for the scan."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.formats.own.scan import parse_scan
from fsoe_net.live.client import Client
from fsoe_net.live.master import LOG, REFUSED, USAGE, find_master, read_log
from fsoe_net.live.sockets import find_socket, interface_of
from fsoe_net.model.scan import Scan

_SCAN_S = 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TakenScan:
    """A scan: the document returned by ``fsn-master``, and its content."""

    document: dict[str, Any]
    scan: Scan


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanSource:
    """The process that will scan a bus.

    Attributes:
        attached: Whether it already drives the bus; then no SubDevice changes state.
        announcement: Effect of the scan on the bus, shown to the user beforehand.
        take: Runs the scan.
    """

    attached: bool
    announcement: str
    take: Callable[[], TakenScan]


def scan_source(
    interface: str | None, *, socket: str | None = None, bus: str | None = None
) -> ScanSource:
    """Find the process that can scan a bus; nothing is sent to the bus yet.

    Args:
        interface: Network interface (soem) or number of the master (igh); ``None`` with a socket.
        socket: Control socket of the ``fsn-master`` to ask; ``None``: search for it.
        bus: Backend for a scan by a new process.

    Raises:
        EnvironmentFault: No answer on the given socket, its process drives another bus, or
            ``fsn-master`` is missing.
    """
    if socket is not None:
        # An explicit socket of another bus would scan the wrong machine.
        drives = interface_of(socket)
        if interface is not None and drives != interface:
            raise EnvironmentFault(f"{socket} drives {drives}, not {interface}")
    # The process that drives the bus must scan it: a second MainDevice would disturb the cycle.
    elif interface is not None:
        socket = find_socket(interface)
    if socket is not None:
        path = socket
        return ScanSource(
            attached=True,
            announcement=f"the fsn-master of {path} reads the bus while it drives it; no SubDevice "
            "changes its state",
            take=lambda: _attached(path),
        )
    if interface is None:
        raise EnvironmentFault("no bus: name an interface or the socket of an fsn-master")
    program, on = find_master(), interface
    return ScanSource(
        attached=False,
        announcement=f"fsn-master --scan listens on {on} and stops when another MainDevice talks "
        "there; else every SubDevice on it goes to PREOP: process data ends, outputs fall back",
        take=lambda: _own(program, on, bus),
    )


def _attached(socket: str) -> TakenScan:
    with Client(socket, timeout_s=_SCAN_S) as client:
        reply = client.request("scan")
    # The rest is the document that `fsn-master --scan` writes.
    reply.pop("ok", None)
    reply.pop("tag", None)
    return _taken(json.dumps(reply).encode(), socket)


def _own(program: str, interface: str, bus: str | None) -> TakenScan:
    command = [program, "--scan", *LOG, "--interface", interface, *(["--bus", bus] if bus else [])]
    try:
        done = subprocess.run(  # noqa: S603  # a list, no shell
            # Without a timeout: a bus of hundreds of SubDevices needs minutes, and Ctrl-C reaches
            # the child.
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
        )
    except OSError as exc:
        raise EnvironmentFault(f"{program} cannot be started: {exc.strerror}") from exc
    if done.returncode == 0:
        return _taken(done.stdout, program)
    said = read_log(done.stderr.decode("utf-8", "replace").splitlines()).error
    if done.returncode == REFUSED:
        raise InputError(said or "fsn-master refused the bus and did not say why")
    if done.returncode == USAGE:
        raise EnvironmentFault(
            f"{program} does not take its options: {said or 'no reason given'}; install fsoe-net "
            "and fsn-master of one version"
        )
    raise EnvironmentFault(said or f"{program} ended with {done.returncode} and did not say why")


def _taken(data: bytes, source: str) -> TakenScan:
    scan, found = parse_scan(data, source)
    if scan is None:
        why = found[0].message if found else "empty"
        raise EnvironmentFault(
            f"{source} gave a scan that cannot be read ({why}); install fsoe-net and fsn-master of "
            "one version"
        )
    return TakenScan(document=json.loads(data), scan=scan)
