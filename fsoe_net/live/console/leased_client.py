"""Holds one connection to ``fsn-master`` and renews its lease while idle.

A separate thread owns the connection. Therefore, Ctrl-C in the main thread never interrupts a
reply, outputs stay leased at a prompt and in a waiting script, and a dead server does not block a
caller.
"""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, TypeVar

from fsoe_net.errors import ControlRefused, EnvironmentFault
from fsoe_net.live.client import Client

_T = TypeVar("_T")
_MOST_EVENTS = 1_000
# Renewals per lease: some of them may be late.
_PARTS_OF_A_LEASE = 4
# A very short lease must not become a flood of requests.
_LEAST_RENEW_S = 0.02
_MOST_RENEW_S = 1.0
_END_S = 1.0


class LeasedClient:
    """A persistent connection; all calls must come from one thread, the main thread.

    Args:
        path: The control socket.
        lease_ms: Requested lease; ``None`` for that of the server, 0 for an unlimited one.
        reconnect: Whether a call connects again after the connection broke.
        timeout_s: Timeout for a reply.

    Raises:
        EnvironmentFault: No process answers. Every call raises it if the connection breaks.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        lease_ms: int | None = None,
        reconnect: bool = False,
        timeout_s: float = 5.0,
    ) -> None:
        self.path = str(path)
        self.notices: deque[str] = deque(maxlen=_MOST_EVENTS)
        self.client_number = 0
        self._lease_ms = lease_ms
        self._reconnect = reconnect
        self._timeout_s = timeout_s
        self._subscribed = False
        self._events: deque[dict[str, Any]] = deque(maxlen=_MOST_EVENTS)
        self._jobs: queue.SimpleQueue[tuple[Callable[[Client], Any], Future[Any]] | None]
        self._jobs = queue.SimpleQueue()
        self._client: Client | None = None
        self._lost = ""
        self._renew_s = _MOST_RENEW_S
        self._renewed = 0.0
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()
        try:
            # Connects now, so that a wrong path is reported here and not at the first command.
            self.call(lambda _: None)
        except BaseException:
            self.close()
            raise

    def call(self, job: Callable[[Client], _T], *, wait_s: float | None = None) -> _T:
        """Call a function with the connection and return its result.

        Ctrl-C returns immediately; the thread still completes the request.

        Raises:
            EnvironmentFault: No result within ``wait_s``, or the connection broke.
        """
        try:
            return self.post(job).result(wait_s)
        except TimeoutError as exc:
            raise EnvironmentFault(f"fsn-master does not answer on {self.path}") from exc

    def post(self, job: Callable[[Client], _T]) -> Future[_T]:
        """Queue a call without waiting for it."""
        future: Future[_T] = Future()
        self._jobs.put((job, future))
        return future

    def aside(self, job: Callable[[Client], _T]) -> _T:
        """Run a slow operation with a separate connection, while this one keeps its lease."""
        future: Future[_T] = Future()

        def work() -> None:
            try:
                with Client(self.path, timeout_s=self._timeout_s) as client:
                    future.set_result(job(client))
            except BaseException as exc:  # passed to the caller
                future.set_exception(exc)

        threading.Thread(target=work, daemon=True).start()
        return future.result()

    def subscribe(self, on: bool) -> None:
        """Start or stop collecting events."""
        self._subscribed = on
        self.call(lambda client: client.request("events", "on" if on else "off"))

    def events(self) -> list[dict[str, Any]]:
        """Return the events received since the last call, at most the last 1000."""
        found = []
        while self._events:
            found.append(self._events.popleft())
        return found

    def lease(self, lease_ms: int) -> int:
        """Request another lease; return the lease granted by the server."""
        given = self.call(lambda client: client.lease(lease_ms))
        self._lease_ms = given
        self._pace(given)
        return given

    def close(self) -> None:
        """Close the connection; outputs set by this client fall back."""
        self._jobs.put(None)
        # Bounded: a server that hangs must not keep the caller, and the thread is a daemon.
        self._thread.join(_END_S)

    def _work(self) -> None:
        while True:
            left = self._renewed + self._renew_s - time.monotonic()
            try:
                item = self._jobs.get(timeout=max(0.0, left))
            except queue.Empty:
                # The queue was empty for a whole period: renew now, because no request did.
                item = (_renew, Future())
                self._renewed = time.monotonic()
                # Without a connection there is no lease; a renewal must not open one.
                if self._client is None:
                    continue
            if item is None:
                break
            self._do(*item)
            # A series of jobs leaves no idle time: without this the lease would expire under load.
            if self._client is not None and self._overdue():
                self._do(_renew, Future())
        self._drop()

    def _overdue(self) -> bool:
        return time.monotonic() - self._renewed >= self._renew_s

    def _do(self, job: Callable[[Client], _T], future: Future[_T]) -> None:
        """Run a job; its result or exception is passed to the future."""
        is_renewal = job is _renew
        if is_renewal:
            self._renewed = time.monotonic()
        try:
            client = self._connected()
            result = job(client)
            self._events += client.events()
            future.set_result(result)
        except ControlRefused as exc:
            future.set_exception(exc)
        except EnvironmentFault as exc:
            self._break(str(exc), tell=is_renewal)
            future.set_exception(exc)
        except BaseException as exc:  # passed to the caller
            future.set_exception(exc)

    def _connected(self) -> Client:
        if self._client is not None:
            return self._client
        # Outputs fell back with the old connection. A script must not continue as if they were set.
        if self._lost and not self._reconnect:
            raise EnvironmentFault(self._lost)
        client = Client(self.path, timeout_s=self._timeout_s)
        try:
            given = int(client.hello.get("lease_ms", 1000))
            # The server may limit the lease; the renewal interval follows the granted one.
            if self._lease_ms is not None:
                given = client.lease(self._lease_ms)
            if self._subscribed:
                client.subscribe()
        # Even on Ctrl-C: a half-open client would hold outputs until its lease expires.
        except BaseException:
            client.close()
            raise
        if self._lost:
            self.notices.append(
                f"connected again to {self.path}; what was set before has fallen back"
            )
            self._lost = ""
        self._client = client
        self.client_number = int(client.hello.get("client", 0))
        self._renewed = time.monotonic()
        self._pace(given)
        return client

    def _pace(self, lease_ms: int) -> None:
        each_s = lease_ms / 1000 / _PARTS_OF_A_LEASE if lease_ms else _MOST_RENEW_S
        self._renew_s = min(_MOST_RENEW_S, max(_LEAST_RENEW_S, each_s))

    def _break(self, text: str, *, tell: bool) -> None:
        had = self._client is not None
        self._drop()
        if had:
            self._lost = text
            if tell:
                self.notices.append(text)

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client = None


def _renew(client: Client) -> None:
    client.renew()
