"""Limits of connections to the studio: their number, and the duration of a request."""

from __future__ import annotations

import asyncio
import ipaddress
import socket
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_CONNECTIONS = 128
MOST_OF_ONE_CLIENT = 32  # a browser opens six per origin
_REQUEST_S = 20.0  # for a complete request, without its body
_LEAST_BYTES_PER_S = 65_536  # of a body


def client_network(host: str) -> str:
    """Return the key of a client: an IPv4 address, or the /64 network of an IPv6 address."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if isinstance(address, ipaddress.IPv4Address):
        return host
    mapped = address.ipv4_mapped
    # One customer has a whole /64 network, so a limit per address would have no effect.
    return str(mapped or ipaddress.ip_network((int(address) >> 64 << 64, 64)))


class LimitedSocket(socket.socket):
    """A listening socket that closes connections beyond the limits, before any TLS handshake."""

    _accepted: list[tuple[str, socket.socket]]

    def listen(self, backlog: int = 100, /) -> None:
        """Start listening, without any connection."""
        self._accepted = []
        super().listen(backlog)

    def accept(self) -> tuple[socket.socket, Any]:
        """Return the next connection.

        Raises:
            ConnectionAbortedError: It was closed because too many are open.
        """
        connection, address = super().accept()
        client = client_network(str(address[0]))
        self._accepted = [row for row in self._accepted if row[1].fileno() >= 0]
        of_client = sum(other == client for other, _ in self._accepted)
        if len(self._accepted) >= MOST_CONNECTIONS or of_client >= MOST_OF_ONE_CLIENT:
            connection.close()
            # asyncio accepts the next connection after this exception.
            raise ConnectionAbortedError("too many connections")
        self._accepted.append((client, connection))
        return connection, address


class LimitedProtocol(H11Protocol):
    """HTTP/1.1 that closes a connection whose request does not arrive in time."""

    _due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Wait for the first request."""
        super().connection_made(transport)
        self._expect(_REQUEST_S)

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop waiting."""
        self._expect(None)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Wait for the rest of a request; the time for a body depends on its length."""
        before = self.cycle
        super().data_received(data)
        cycle = self.cycle
        # The request is complete: a slow answer is not the fault of the client.
        if cycle is not None and not cycle.response_complete and not cycle.more_body:
            self._expect(None)
        # Time in proportion to the body: a large upload over a slow line must not be interrupted.
        elif cycle is not before:
            self._expect(_REQUEST_S + self._body_bytes() / _LEAST_BYTES_PER_S)
        # Endless headers would block one of the few connections.
        elif self._due is None:
            self._expect(_REQUEST_S)

    def on_response_complete(self) -> None:
        """Wait for the next request, or for the rest of an unread body."""
        super().on_response_complete()
        self._expect(_REQUEST_S)

    def _body_bytes(self) -> int:
        lengths = (int(value) for name, value in self.headers if name == b"content-length")
        return next(lengths, 0)

    def _expect(self, seconds: float | None) -> None:
        if self._due is not None:
            self._due.cancel()
        self._due = None if seconds is None else self.loop.call_later(seconds, self._close)

    def _close(self) -> None:
        self.transport.abort()
