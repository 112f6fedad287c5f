"""Client of the control socket of ``fsn-master``: one line per request, one of JSON per reply."""

from __future__ import annotations

import json
import socket
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

from fsoe_net.errors import ControlRefused, EnvironmentFault
from fsoe_net.run.live_snapshot import (
    LiveSnapshot,
    SubDeviceSnapshot,
    read_snapshot,
    read_subdevice,
)

__all__ = ["PROTOCOL", "Client"]

PROTOCOL = 1
_MAX_LINE = 16 << 20
_MAX_EVENTS = 10_000
_T = TypeVar("_T")


class Client:
    """A connection to one ``fsn-master``; a context manager. One thread at a time.

    Args:
        path: Its control socket.
        timeout_s: How long to wait for a connection or a reply.

    Raises:
        EnvironmentFault: Nobody answers there, the user may not connect, or what answers speaks
            another protocol. Every call raises it when the connection breaks or a reply is late.
    """

    def __init__(self, path: str | Path, *, timeout_s: float = 5.0) -> None:
        self.path = str(path)
        self.events_lost = 0
        self._timeout_s = timeout_s
        self._received = bytearray()
        self._events: deque[dict[str, Any]] = deque()
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.settimeout(timeout_s)
            self._socket.connect(self.path)
            self.hello = self.request("hello")
            if self.hello.get("protocol") != PROTOCOL:
                raise EnvironmentFault(
                    f"{self.path} speaks protocol {self.hello.get('protocol')}, this fsoe-net "
                    f"{PROTOCOL}; install fsoe-net and fsn-master of one version"
                )
        except OSError as exc:
            self.close()
            raise EnvironmentFault(
                f"nobody answers on {self.path}: {exc.strerror or exc}; is fsn-master running, and "
                "as which user?"
            ) from exc
        except EnvironmentFault:
            self.close()
            raise

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the connection; what this client has written falls back."""
        self._socket.close()

    def request(self, *words: str) -> dict[str, Any]:
        """Send one request and return its reply.

        Raises:
            ControlRefused: The request was refused; the message says why and what to do.
        """
        line = " ".join(_quoted(word) for word in words) + "\n"
        until = time.monotonic() + self._timeout_s
        try:
            self._socket.settimeout(self._timeout_s)
            self._socket.sendall(line.encode())
        except OSError as exc:
            raise self._broken(exc) from exc
        while True:
            reply = self._line(until)
            if reply is None:
                self.close()  # a reply that came later would answer the wrong request
                raise EnvironmentFault(
                    f"fsn-master has not answered {words[0]} within {self._timeout_s:g} s on "
                    f"{self.path}; is it stopped?"
                )
            if "event" in reply:
                self._keep(reply)
                continue
            if reply.get("ok") is not True:
                hint = f"; {reply['hint']}" if reply.get("hint") else ""
                text = f"{words[0]}: {reply.get('text', 'refused')}{hint}"
                raise ControlRefused(text, str(reply.get("error", "")))
            return reply

    def snapshot(self) -> LiveSnapshot:
        """Return counters, connections and SubDevices of one cycle.

        Raises:
            ControlRefused: The bus is stopped.
        """
        return self._read(self.request("snapshot"), read_snapshot)

    def subdevices(self) -> tuple[SubDeviceSnapshot, ...]:
        """Return what is known about each SubDevice."""
        return self._read(
            self.request("subdevices"),
            lambda reply: tuple(read_subdevice(row) for row in reply["subdevices"]),
        )

    def subscribe(self) -> None:
        """Have every change told from now on; `events` returns them."""
        self.request("events", "on")

    def events(self, wait_s: float = 0.0) -> list[dict[str, Any]]:
        """Return the events that have come, after waiting for the first one at most ``wait_s``."""
        until = time.monotonic() + (0.0 if self._events else wait_s)
        try:
            while len(self._events) < _MAX_EVENTS and (line := self._line(until)) is not None:
                self._keep(line)
                until = 0.0
        except EnvironmentFault:
            if not self._events:
                raise  # else these first; the next call says that it broke
        found = list(self._events)
        self._events.clear()
        return found

    def _keep(self, event: dict[str, Any]) -> None:
        if len(self._events) >= _MAX_EVENTS:
            self._events.popleft()
            self.events_lost += 1
        self._events.append(event)

    def _line(self, until: float) -> dict[str, Any] | None:
        """Return the next line; ``None`` when it has not come until then."""
        searched = 0
        while (end := self._received.find(b"\n", searched)) < 0:
            searched = len(self._received)
            if searched > _MAX_LINE:
                raise self._broken("a line without an end")
            left = until - time.monotonic()
            try:
                self._socket.settimeout(max(0.0, left))
                got = self._socket.recv(1 << 16)
            except (BlockingIOError, TimeoutError):
                return None
            except OSError as exc:
                raise self._broken(exc) from exc
            if not got:
                raise self._broken("fsn-master has closed it")
            self._received += got
        line = bytes(self._received[:end])
        del self._received[: end + 1]
        try:
            found = json.loads(line)
        except ValueError as exc:
            raise self._broken("a line that is no JSON") from exc
        if not isinstance(found, dict):
            raise self._broken("a line that is no JSON object")
        return found

    def _read(self, reply: dict[str, Any], read: Callable[[Mapping[str, Any]], _T]) -> _T:
        try:
            return read(reply)
        except (KeyError, TypeError, ValueError, AttributeError) as exc:
            raise EnvironmentFault(
                f"{self.path}: a reply has not the form it should have ({exc!r}); install fsoe-net "
                "and fsn-master of one version"
            ) from exc

    def _broken(self, why: object) -> EnvironmentFault:
        text = getattr(why, "strerror", None) or why
        return EnvironmentFault(f"the connection to {self.path} broke: {text}")


def _quoted(word: str) -> str:
    """Return a word as the socket takes it.

    Raises:
        ValueError: No request can hold it.
    """
    if any(ord(c) < 0x20 or ord(c) == 0x7F for c in word):
        raise ValueError(f"{word!r} has a control character")
    if word and not any(c in word for c in ' \t"\\'):
        return word
    escaped = word.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
