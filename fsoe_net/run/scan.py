"""A scan of a live bus: by the ``fsn-master`` that drives it, else by one started for it."""

from __future__ import annotations

import glob
import json
import os
import socket as socketlib
import struct
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.load import parse_scan
from fsoe_net.model import Scan
from fsoe_net.run.client import Client
from fsoe_net.run.master import REFUSED, USAGE, find_master, last_error

__all__ = ["ScanSource", "TakenScan", "find_socket", "scan_source"]

_ANSWER_S = 2.0
_SCAN_S = 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TakenScan:
    """A scan: the document as ``fsn-master`` gave it, and what it says."""

    document: dict[str, Any]
    scan: Scan


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanSource:
    """Who will scan a bus.

    Attributes:
        attached: It drives the bus already; no state of a SubDevice changes.
        announcement: What the scan will do to the bus, for the user to read before.
        take: Makes the scan.
    """

    attached: bool
    announcement: str
    take: Callable[[], TakenScan]


def scan_source(
    interface: str | None, *, socket: str | None = None, bus: str | None = None
) -> ScanSource:
    """Find out who can scan a bus; nothing is sent to it yet.

    Args:
        interface: Network interface (soem) or number of the master (igh); ``None`` with a socket.
        socket: Control socket of the ``fsn-master`` to ask; looked for when ``None``.
        bus: Backend of a scan of our own.

    Raises:
        EnvironmentFault: Nobody answers on the socket that was named, it drives another bus, or
            ``fsn-master`` is not there.
    """
    if socket is not None:
        drives = _interface_of(socket)
        if interface is not None and drives != interface:
            raise EnvironmentFault(f"{socket} drives {drives}, not {interface}")
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


def find_socket(interface: str) -> str | None:
    """Return the control socket of the ``fsn-master`` that drives an interface, if one answers.

    Raises:
        EnvironmentFault: There is one, but this user may not connect.
    """
    for path in _sockets(interface):
        if not os.access(path, os.W_OK):
            if os.path.basename(path) != "control.sock":
                raise EnvironmentFault(
                    f"{path}: an fsn-master may drive {interface}, but you may not connect; "
                    "--allow-user NAME of fsn-master permits it"
                )
            continue
        try:
            if _same_network(path) and _interface_of(path) == interface:
                return path
        except EnvironmentFault:
            continue  # left behind by one that is dead, or of another version
    return None


def _sockets(interface: str) -> Iterator[str]:
    """Yield the places of `fsn-master`'s own choice, and those of `fsoe-net run`."""
    folders = [os.environ.get("RUNTIME_DIRECTORY"), os.environ.get("XDG_RUNTIME_DIR"), "/run"]
    places = dict.fromkeys(f for f in folders if f)
    for folder in places:
        path = os.path.join(folder, f"fsn-master-{interface}.sock")
        if os.path.exists(path):
            yield path
    for folder in dict.fromkeys((*places, tempfile.gettempdir())):
        yield from sorted(glob.glob(os.path.join(glob.escape(folder), "fsoe-net-*/control.sock")))


def _interface_of(socket: str) -> str:
    with Client(socket, timeout_s=_ANSWER_S) as client:
        return str(client.request("status").get("interface", ""))


def _same_network(path: str) -> bool:
    """Whether who listens has our interfaces: a container can have another of the same name."""
    with socketlib.socket(socketlib.AF_UNIX) as probe:
        try:
            probe.settimeout(_ANSWER_S)
            probe.connect(path)
            peer = probe.getsockopt(socketlib.SOL_SOCKET, socketlib.SO_PEERCRED, 12)
            pid, _, _ = struct.unpack("3i", peer)
            return os.readlink(f"/proc/{pid}/ns/net") == os.readlink("/proc/self/ns/net")
        except OSError:
            return True  # the client will tell, or nobody can


def _attached(socket: str) -> TakenScan:
    with Client(socket, timeout_s=_SCAN_S) as client:
        reply = client.request("scan")
    reply.pop("ok", None)
    reply.pop("tag", None)
    return _taken(json.dumps(reply).encode(), socket)


def _own(program: str, interface: str, bus: str | None) -> TakenScan:
    command = [program, "--scan", "--interface", interface, *(["--bus", bus] if bus else [])]
    try:
        done = subprocess.run(  # noqa: S603  # a list, no shell
            command, stdin=subprocess.DEVNULL, capture_output=True, check=False
        )
    except OSError as exc:
        raise EnvironmentFault(f"{program} cannot be started: {exc.strerror}") from exc
    if done.returncode == 0:
        return _taken(done.stdout, program)
    said = last_error(done.stderr.decode("utf-8", "replace").splitlines())
    if done.returncode == REFUSED:
        raise InputError(said or "fsn-master refused the bus and did not say why")
    if done.returncode == USAGE:
        raise EnvironmentFault(
            f"{program} does not take its options: {said or 'no reason given'}; install fsoe-net "
            "and fsn-master of one version"
        )
    if "setcap" in said:
        said += f" (here: {program})"
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
