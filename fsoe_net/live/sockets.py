"""Location of the control socket of the ``fsn-master`` that drives an interface."""

from __future__ import annotations

import glob
import os
import socket as socketlib
import struct
import tempfile
from collections.abc import Iterator

from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.client import Client

_ANSWER_S = 2.0
_SERVICE = "/run/fsn-master"  # of the example unit


def control_socket(interface: str) -> str:
    """Return the socket of the ``fsn-master`` that drives an interface, or its default location.

    Raises:
        EnvironmentFault: There is one, but this user has no permission to connect.
    """
    found = find_socket(interface)
    if found is not None:
        return found
    choices = _own_choices(interface)
    return next(p for p in choices if os.path.dirname(p) != _SERVICE)


def find_socket(interface: str) -> str | None:
    """Return the control socket of the ``fsn-master`` that drives an interface, if one answers.

    Raises:
        EnvironmentFault: There is one, but this user has no permission to connect.
    """
    for path in _sockets(interface):
        if not os.access(path, os.W_OK):
            # The default name is used for any interface: only a socket named after this one
            # certainly belongs to it.
            if os.path.basename(path) != "control.sock":
                raise EnvironmentFault(
                    f"{path}: an fsn-master may drive {interface}, but you may not connect; "
                    "--allow-user NAME of fsn-master permits it"
                )
            continue
        try:
            # A socket in a shared folder may belong to another network namespace with an interface
            # of the same name.
            if _same_network(path) and interface_of(path) == interface:
                return path
        except EnvironmentFault:
            continue  # left by a dead process, or one of another version
    return None


def _folders() -> list[str]:
    # systemd lists several folders, separated by colons.
    own = os.environ.get("RUNTIME_DIRECTORY", "").partition(":")[0]
    folders = [own, os.environ.get("XDG_RUNTIME_DIR", ""), _SERVICE, "/run"]
    return list(dict.fromkeys(f for f in folders if f))


def _own_choices(interface: str) -> list[str]:
    name = f"fsn-master-{interface.replace('/', '_')}.sock"
    return [os.path.join(folder, name) for folder in _folders()]


def _sockets(interface: str) -> Iterator[str]:
    """Yield the default sockets of `fsn-master`, and those of `fsoe-net run`."""
    for path in _own_choices(interface):
        if os.path.exists(path):
            yield path
    # `fsoe-net run` uses the temporary folder if the user has no runtime directory.
    for folder in dict.fromkeys((*_folders(), tempfile.gettempdir())):
        yield from sorted(glob.glob(os.path.join(glob.escape(folder), "fsoe-net-*/control.sock")))


def interface_of(socket: str) -> str:
    """Return the interface driven by the ``fsn-master`` on a socket.

    Raises:
        EnvironmentFault: No answer on the socket.
    """
    with Client(socket, timeout_s=_ANSWER_S) as client:
        return str(client.request("status").get("interface", ""))


def _same_network(path: str) -> bool:
    """Whether the listening process has our interfaces: a container can reuse a name."""
    with socketlib.socket(socketlib.AF_UNIX) as probe:
        try:
            probe.settimeout(_ANSWER_S)
            probe.connect(path)
            peer = probe.getsockopt(socketlib.SOL_SOCKET, socketlib.SO_PEERCRED, 12)
            pid, _, _ = struct.unpack("3i", peer)
            if pid == 0:  # not visible: in another container
                return False
            return os.readlink(f"/proc/{pid}/ns/net") == os.readlink("/proc/self/ns/net")
        except OSError:
            return True  # the client reports it, or it cannot be determined
