"""Serves the metrics of masters over HTTP."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

from prometheus_client import CollectorRegistry, generate_latest, start_http_server

from fsoe_net.errors import EnvironmentFault
from fsoe_net.fleet.metrics import MasterCollector
from fsoe_net.fleet.watcher import MasterWatcher

Masters = Mapping[str, Callable[[], str]]
"""Name of each master, with a function that returns its control socket."""


class Exporter:
    """Watches masters and serves their metrics; a context manager.

    Args:
        masters: The masters.
        address: Local address of the server.
        port: Port of the server; 0 for any free one.

    Attributes:
        port: Port of the server.

    Raises:
        EnvironmentFault: The address cannot be used.
    """

    def __init__(self, masters: Masters, *, address: str, port: int) -> None:
        self._watchers = _watchers(masters)
        self._stop = threading.Event()
        registry = _registry(self._watchers)
        try:
            self._server, self._thread = start_http_server(port, address, registry)
        except (OSError, OverflowError) as exc:
            reason = exc.strerror if isinstance(exc, OSError) else exc
            raise EnvironmentFault(f"{address} port {port}: {reason}") from exc
        self.port: int = self._server.server_port
        self._followers = [
            threading.Thread(target=w.follow, args=(self._stop,), daemon=True)
            for w in self._watchers
        ]

    def __enter__(self) -> Exporter:
        for thread in self._followers:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._server.shutdown()
        self._server.server_close()
        for thread in (self._thread, *self._followers):
            thread.join()


def metrics_once(masters: Masters) -> str:
    """Return the metrics of one look at each master, in the text format of Prometheus."""
    watchers = _watchers(masters)
    for watcher in watchers:
        watcher.look_once()
    return generate_latest(_registry(watchers)).decode("utf-8")


def _watchers(masters: Masters) -> list[MasterWatcher]:
    return [MasterWatcher(name, locate) for name, locate in masters.items()]


def _registry(watchers: list[MasterWatcher]) -> CollectorRegistry:
    registry = CollectorRegistry()
    registry.register(MasterCollector(lambda: [w.reading() for w in watchers]))
    return registry
