"""Access to the host: files below one root, commands, ioctls and attributes; all injected."""

from __future__ import annotations

import ctypes
import fcntl
import os
import shutil
import socket
import struct
import subprocess
from pathlib import Path
from typing import Protocol

_SIOCETHTOOL = 0x8946
_COMMAND_S = 5.0
_MOST_BYTES = 1 << 22


class Unreadable(Exception):
    """A fact of the host cannot be read; the text names it and the reason."""


class Seam(Protocol):
    """Access without files: commands, ioctls, extended attributes."""

    def command(self, *words: str) -> str | None:
        """Return the output of a command, or ``None`` if it is missing, failed or hung."""

    def ethtool(self, interface: str, request: bytes) -> bytes:
        """Return the answer to a SIOCETHTOOL request; raises `OSError`."""

    def attribute(self, path: str, name: str) -> bytes:
        """Return an extended attribute of a file; raises `OSError`."""


class RealSeam:
    """The machine that this program runs on."""

    def command(self, *words: str) -> str | None:
        """Run a read-only command; see `Seam`."""
        # sbin is often missing in the PATH of users.
        program = shutil.which(words[0], path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")
        if program is None:
            return None
        try:
            done = subprocess.run(  # noqa: S603  # a list, no shell
                [program, *words[1:]],
                capture_output=True,
                text=True,
                errors="replace",
                check=False,
                timeout=_COMMAND_S,
                # The output is parsed by its words, which a translation would change.
                env=os.environ | {"LC_ALL": "C"},
            )
        except (OSError, subprocess.TimeoutExpired):
            return None
        return done.stdout if done.returncode == 0 else None

    def ethtool(self, interface: str, request: bytes) -> bytes:
        """Ask the driver of an interface; see `Seam`."""
        data = ctypes.create_string_buffer(request, len(request))
        # IFNAMSIZ is 16, with the zero at the end.
        name = interface.encode()[:15]
        wanted = struct.pack("16sP16x", name, ctypes.addressof(data))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
            fcntl.ioctl(any_socket, _SIOCETHTOOL, wanted)
        return data.raw

    def attribute(self, path: str, name: str) -> bytes:
        """Read an attribute; see `Seam`."""
        return os.getxattr(path, name)


class Host:
    """A machine, represented by its files.

    Args:
        root: Folder used as ``/``, such as a test machine.
        seam: Access without files.
    """

    def __init__(self, root: Path | str = "/", seam: Seam | None = None) -> None:
        self.root = Path(root)
        self.seam: Seam = RealSeam() if seam is None else seam

    def path(self, path: str) -> Path:
        """Return the actual path of a path on the machine."""
        return self.root / path.lstrip("/")

    def data(self, path: str) -> bytes:
        """Return the bytes of a file.

        Raises:
            Unreadable: The file is missing or may not be read.
        """
        try:
            with open(self.path(path), "rb", buffering=0) as file:
                data = bytearray()
                # In pieces: some files of /proc allocate a buffer as large as the read.
                while len(data) < _MOST_BYTES and (more := file.read(1 << 16)):
                    data += more
                return bytes(data)
        except OSError as exc:
            raise Unreadable(f"{path}: {exc.strerror or exc}") from exc

    def read(self, path: str) -> str:
        """Return the text of a file without surrounding blanks; raises as in `data`."""
        # Some files of /proc and /sys end with a zero.
        return self.data(path).decode("utf-8", "replace").strip().strip("\0")

    def maybe(self, path: str) -> str | None:
        """Return the text of a file, or ``None`` if it cannot be read."""
        try:
            return self.read(path)
        except Unreadable:
            return None

    def number(self, path: str) -> int:
        """Return the number in a file.

        Raises:
            Unreadable: The file cannot be read or contains no number.
        """
        text = self.read(path)
        try:
            return int(text, 0)
        except ValueError as exc:
            raise Unreadable(f"{path} holds {text[:40]!r}, no number") from exc

    def names(self, path: str) -> list[str]:
        """Return the sorted names in a folder; none if it cannot be read."""
        try:
            return sorted(os.listdir(self.path(path)))
        except OSError:
            return []

    def exists(self, path: str) -> bool:
        """Return whether a file, a folder or a link with this name exists."""
        return os.path.lexists(self.path(path))

    def target(self, path: str) -> str | None:
        """Return the last part of the target of a link, or ``None`` if it is not a link."""
        link = self.link(path)
        return None if link is None else link.rstrip("/").rpartition("/")[2]

    def link(self, path: str) -> str | None:
        """Return the target of a link, or ``None`` if it is not a link or cannot be read."""
        try:
            return os.readlink(self.path(path))
        except OSError:
            return None

    def pids(self) -> list[int]:
        """Return the visible processes."""
        return [int(name) for name in self.names("/proc") if name.isdecimal()]

    def processes(self, name: str) -> list[int]:
        """Return the processes whose command name is or begins with ``name``."""
        return [p for p in self.pids() if (self.maybe(f"/proc/{p}/comm") or "").startswith(name)]
