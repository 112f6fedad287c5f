"""One connection to the control socket of ``fsn-master``: lines, replies, events.

Each request is one line, each reply is one line of JSON, in the same order; events are lines
between them.
"""

from __future__ import annotations

import json
import socket
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self, TypeVar

from fsoe_net.errors import ControlRefused, EnvironmentFault

PROTOCOL = 1
_MAX_LINE = 16 << 20
_MOST_PAGES = 1000  # of 128 KiB each
_MAX_EVENTS = 10_000
_CYCLE_EVENTS = ("values", "image")
_T = TypeVar("_T")


class ControlLink:
    """A connection to one ``fsn-master``; a context manager. One thread at a time.

    Args:
        path: Control socket of ``fsn-master``.
        timeout_s: Timeout of a connection attempt or a reply.

    Attributes:
        path: The control socket.
        hello: The first reply of ``fsn-master``.
        events_lost: Events dropped on this side because they were not read.

    Raises:
        EnvironmentFault: No answer, no permission to connect, or the peer uses another protocol.
            Every call raises it if the connection breaks or a reply is late.
    """

    def __init__(self, path: str | Path, *, timeout_s: float = 5.0) -> None:
        self.path = str(path)
        self.events_lost = 0
        self._timeout_s = timeout_s
        self._ended = ""
        self._received = bytearray()
        self._events: deque[dict[str, Any]] = deque()
        self._cycles: deque[dict[str, Any]] = deque()
        self._cycles_lost = 0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.settimeout(timeout_s)
            self._socket.connect(self.path)
            self.hello = self.request("hello")
            if self.hello.get("protocol") != PROTOCOL:
                raise EnvironmentFault(
                    f"{self.path} uses protocol {self.hello.get('protocol')}, this fsoe-net "
                    f"{PROTOCOL}; install fsoe-net and fsn-master of one version"
                )
        except OSError as exc:
            self.close()
            raise EnvironmentFault(
                f"no answer on {self.path}: {exc.strerror or exc}; is fsn-master running, and "
                "as which user?"
            ) from exc
        except EnvironmentFault:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def closed(self) -> bool:
        """Whether this connection has ended."""
        return self._socket.fileno() < 0

    def close(self) -> None:
        """Close the connection; outputs written by this client fall back."""
        self._socket.close()

    def request(self, *words: str, timeout_s: float | None = None) -> dict[str, Any]:
        """Send one request and return its reply.

        Args:
            words: The request and its arguments.
            timeout_s: Timeout for the reply; default: that of the connection.

        Raises:
            ControlRefused: The request was refused; the message gives the reason and what to do.
        """
        line = " ".join(quoted(word) for word in words) + "\n"
        wait_s = self._timeout_s if timeout_s is None else timeout_s
        # One time limit for the whole reply: events in between must not extend it.
        until = time.monotonic() + wait_s
        try:
            self._socket.settimeout(wait_s)
            self._socket.sendall(line.encode())
        except OSError as exc:
            raise self._broken(exc) from exc
        while True:
            reply = self._line(until)
            if reply is None:
                self.close()  # a later reply would answer the wrong request
                raise EnvironmentFault(
                    f"fsn-master has not answered {words[0]} within {wait_s:g} s on "
                    f"{self.path}; is it stopped?"
                )
            # Events and replies share the socket; an event may arrive before the reply.
            if "event" in reply:
                self._keep(reply)
                continue
            if reply.get("ok") is not True:
                hint = f"; {reply['hint']}" if reply.get("hint") else ""
                text = f"{words[0]}: {reply.get('text', 'refused')}{hint}"
                raise ControlRefused(text, str(reply.get("error", "")))
            return reply

    def request_all(self, word: str) -> dict[str, Any]:
        """Return a report with the rows of all its pages.

        Other values, such as statistics, are from the first page; each page is from one cycle.

        Raises:
            ControlRefused: A page was refused.
            EnvironmentFault: There are too many pages.
        """
        reply = self.request(word)
        for _ in range(_MOST_PAGES):
            row = reply.pop("next", None)
            if row is None:
                # A page is appended to lists only: all other values belong to the cycle of the
                # first page.
                return reply
            for key, rows in self.request(word, str(row)).items():
                if isinstance(rows, list) and isinstance(reply.get(key), list):
                    reply[key] += rows
                elif key == "next":
                    reply["next"] = rows
        raise self._broken(f"a {word} of more than {_MOST_PAGES} pages")

    def subscribe(self) -> None:
        """Subscribe to every change; `events` returns them."""
        self.request("events", "on")

    def events(self, wait_s: float = 0.0) -> list[dict[str, Any]]:
        """Return the events received, after waiting at most ``wait_s`` for the first one."""
        return self._arrived(self._events, wait_s)

    def _wait_cycles(self, wait_s: float) -> tuple[list[dict[str, Any]], int]:
        """Return the watched cycles received, and how many were dropped on this side."""
        found = self._arrived(self._cycles, wait_s)
        lost, self._cycles_lost = self._cycles_lost, 0
        return found, lost

    def _arrived(self, kept: deque[dict[str, Any]], wait_s: float) -> list[dict[str, Any]]:
        # With stored events there is no need to wait; the socket is only emptied.
        until = time.monotonic() + (0.0 if kept else wait_s)
        try:
            for _ in range(_MAX_EVENTS):  # a flood must not block the caller
                if (line := self._line(until)) is None:
                    break
                self._keep(line)
                # After the first event only what has already arrived is taken.
                until = 0.0 if kept else until
        except EnvironmentFault:
            if not kept:
                raise  # first return these; the next call reports the broken connection
        found = list(kept)
        kept.clear()
        return found

    def _keep(self, event: dict[str, Any]) -> None:
        if event.get("event") in _CYCLE_EVENTS:
            if len(self._cycles) >= _MAX_EVENTS:
                # The oldest is dropped: a program that is too slow needs the current values.
                self._cycles.popleft()
                self._cycles_lost += 1
            self._cycles.append(event)
            return
        if len(self._events) >= _MAX_EVENTS:
            self._events.popleft()
            self.events_lost += 1
        self._events.append(event)

    def _line(self, until: float) -> dict[str, Any] | None:
        """Return the next line, or ``None`` if it has not arrived by then."""
        # Already searched bytes contain no line end: a long line must not be searched repeatedly.
        searched = 0
        while (end := self._received.find(b"\n", searched)) < 0:
            searched = len(self._received)
            # A server that sends no line end must not fill the memory.
            if searched > _MAX_LINE:
                raise self._broken("a line without an end")
            left = until - time.monotonic()
            try:
                self._socket.settimeout(max(0.0, left))
                got = self._socket.recv(1 << 16)
            # A timeout of 0 makes the socket non-blocking, which raises a different exception.
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
            raise self._broken("a line that is not JSON") from exc
        if not isinstance(found, dict):
            raise self._broken("a line that is not a JSON object")
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
        self._ended = self._ended or f"the connection to {self.path} broke: {text}"
        self.close()
        return EnvironmentFault(self._ended)


def quoted(word: str) -> str:
    """Return a word in the notation of the socket.

    Raises:
        ValueError: No request can contain it.
    """
    # A line end in a word would begin a second request.
    if any(ord(c) < 0x20 or ord(c) == 0x7F for c in word):
        raise ValueError(f"{word!r} has a control character")
    if word and not any(c in word for c in ' \t"\\'):
        return word
    escaped = word.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
