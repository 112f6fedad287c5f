"""A studio that runs in this process, and requests to it as a browser sends them."""

from __future__ import annotations

import http.client
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from studio.browser import needed

from fsoe_net.studio.begin import empty_network
from fsoe_net.studio.workspace import Workspace

needed("starlette", "studio")

from fsoe_net.studio.server import Studio  # noqa: E402


@contextmanager
def running(
    path: Path, control_socket: Path | None = None, *, allow_control: bool = False
) -> Iterator[Studio]:
    """Serve a network file, or one that is still to be made, until the block ends."""
    studio = Studio(
        Workspace(str(path), new_text=empty_network(str(path))),
        control_socket=None if control_socket is None else str(control_socket),
        allow_control=allow_control,
    )
    thread = threading.Thread(target=studio.run, daemon=True)
    thread.start()
    try:
        yield studio
    finally:
        studio.stop()
        thread.join()


class Browser:
    """What a browser remembers of one studio: address, cookie.

    Args:
        url: As it was printed.
    """

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self.host = parts.netloc
        self.first = f"{parts.path}?{parts.query}"
        self.cookie = ""

    def ask(
        self, path: str, method: str = "GET", body: bytes | None = None, **headers: str | None
    ) -> tuple[int, http.client.HTTPMessage, bytes]:
        """Send a request; a header that is ``None`` is left out.

        Returns:
            Status, headers, body.
        """
        sent: dict[str, str | None] = {"Host": self.host, "Cookie": self.cookie or None}
        sent |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPConnection(self.host)
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            for name, value in sent.items():
                if value is not None:
                    connection.putheader(name, value)
            if body is not None and "Content-Length" not in sent:
                connection.putheader("Content-Length", str(len(body)))
            connection.endheaders(body)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()

    def enter(self) -> None:
        """Open the page for the first time."""
        status, headers, _ = self.ask(self.first)
        assert status == 303
        self.cookie = headers["Set-Cookie"].partition(";")[0]

    def json(self, path: str) -> dict[str, object]:
        """Return an answer that is a JSON document."""
        status, _, data = self.ask(path)
        assert status == 200, data
        return json.loads(data)

    def give(self, name: str, data: bytes, **headers: str | None) -> tuple[int, bytes]:
        """Send a file as the page does."""
        own = {"Origin": f"http://{self.host}", "X_Fsoe_Net": "1"} | headers
        status, _, answer = self.ask(f"/api/files?name={name}", "POST", data, **own)
        return status, answer

    def post(self, act: str, body: object, **headers: str | None) -> tuple[int, dict[str, object]]:
        """Send a change as the page does."""
        own = {"Origin": f"http://{self.host}", "X_Fsoe_Net": "1"} | headers
        status, answer, data = self.ask(f"/api/{act}", "POST", json.dumps(body).encode(), **own)
        is_json = answer["Content-Type"].startswith("application/json")
        return status, json.loads(data) if is_json else {"error": data.decode()}

    def get(self, what: str) -> tuple[int, dict[str, Any]]:
        """Ask as the page does."""
        status, _, data = self.ask(f"/api/{what}")
        return status, json.loads(data)

    @contextmanager
    def events(self, path: str = "/api/events") -> Iterator[http.client.HTTPResponse]:
        """Follow the versions, or another stream, as an open page does."""
        connection = http.client.HTTPConnection(self.host)
        try:
            connection.request("GET", path, headers={"Cookie": self.cookie})
            answer = connection.getresponse()
            assert answer.status == 200
            yield answer
        finally:
            connection.close()
