"""Hostile clients of the studio: many connections, requests without an end, many passwords."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from patience import PATIENCE_S
from starlette.requests import Request
from studio.server_rig import Browser, running

from fsoe_net.studio import connections, login
from fsoe_net.studio.connections import LimitedSocket, client_network

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    folder = tmp_path / "estop"
    shutil.copytree(EXAMPLES / "estop", folder)
    with running(folder / "network.yaml") as studio:
        browser = Browser(studio.url)
        browser.enter()
        yield browser


def connect(browser: Browser, sent: bytes) -> socket.socket:
    host, _, port = browser.host.partition(":")
    connection = socket.create_connection((host, int(port)), PATIENCE_S)
    connection.sendall(sent)
    return connection


def is_closed(connection: socket.socket) -> bool:
    connection.setblocking(False)
    try:
        return connection.recv(1) == b""
    except BlockingIOError:
        return False
    except ConnectionResetError:
        return True


def wait_until_closed(rows: list[socket.socket], count: int) -> None:
    end = time.monotonic() + PATIENCE_S
    while sum(map(is_closed, rows)) < count:
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.shows("R26")
def test_connections_of_one_client_are_limited(browser: Browser) -> None:
    with contextlib.ExitStack() as stack:
        rows = [stack.enter_context(connect(browser, b"GET / HT")) for _ in range(100)]
        wait_until_closed(rows, 100 - connections.MOST_OF_ONE_CLIENT)
        assert sum(map(is_closed, rows)) == 100 - connections.MOST_OF_ONE_CLIENT
        for row in rows[:40]:
            row.close()
        wait = time.monotonic() + PATIENCE_S
        while True:
            with contextlib.suppress(ConnectionError):
                assert browser.ask("/api/state")[0] == 200
                break
            assert time.monotonic() < wait


@pytest.mark.shows("R26")
@pytest.mark.parametrize(
    "sent",
    [
        b"",
        b"GET / HTTP/1.1\r\nHost: x\r\n",
        b"POST /api/text HTTP/1.1\r\nHost: HOST\r\nCookie: COOKIE\r\nOrigin: http://HOST\r\n"
        b"X-Fsoe-Net: 1\r\nContent-Length: 9\r\n\r\n{",
        b"POST /api/text HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999\r\n\r\n{",
        b"GET /api/state HTTP/1.1\r\nHost: HOST\r\nCookie: COOKIE\r\n\r\nGET / HT",
    ],
    ids=["nothing", "half a head", "half a body", "half a refused body", "half a second head"],
)
def test_a_request_without_an_end_is_closed(
    sent: bytes, browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "_REQUEST_S", 0.3)
    sent = sent.replace(b"HOST", browser.host.encode()).replace(b"COOKIE", browser.cookie.encode())
    begin = time.monotonic()
    with connect(browser, sent) as connection, contextlib.suppress(ConnectionResetError):
        while connection.recv(65536):
            pass
    assert time.monotonic() - begin > 0.25


def test_a_long_body_has_the_time_that_its_length_needs(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "_REQUEST_S", 0.2)
    monkeypatch.setattr(connections, "_LEAST_BYTES_PER_S", 1000)
    head = (
        f"POST /api/undo HTTP/1.1\r\nHost: {browser.host}\r\nCookie: {browser.cookie}\r\n"
        f"Origin: http://{browser.host}\r\nX-Fsoe-Net: 1\r\nContent-Length: 9000\r\n\r\n"
    )
    body = b'{"version": 1}'.ljust(9000)
    with connect(browser, head.encode() + body[:100]) as connection:
        time.sleep(0.6)
        connection.sendall(body[100:])
        assert connection.recv(100).startswith(b"HTTP/1.1 200")


def test_a_stream_of_events_is_not_closed(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "_REQUEST_S", 0.2)
    with browser.events() as answer:
        lines = [answer.readline() for _ in range(6)]
    assert lines[2:] == [b": still there\n", b"\n"] * 2


def test_connections_of_all_clients_together_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "MOST_CONNECTIONS", 3)
    with LimitedSocket(socket.AF_INET) as listener, contextlib.ExitStack() as stack:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        port = listener.getsockname()[1]

        def accept(host: str) -> socket.socket:
            stack.enter_context(socket.create_connection(("127.0.0.1", port), 5, (host, 0)))
            return stack.enter_context(listener.accept()[0])

        first = accept("127.0.0.1")
        for number in (2, 3):
            accept(f"127.0.0.{number}")
        with pytest.raises(ConnectionAbortedError):
            accept("127.0.0.4")
        first.close()
        accept("127.0.0.5")


@pytest.mark.parametrize(
    ("host", "network"),
    [
        ("10.0.0.7", "10.0.0.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("::ffff:10.0.0.7", "10.0.0.7"),
        ("testclient", "testclient"),
    ],
)
def test_addresses_that_one_client_can_choose_are_one(host: str, network: str) -> None:
    assert client_network(host) == network


def test_one_password_is_hashed_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tries from many addresses: few wait, all others are refused at once and cost nothing."""
    now, most = [0], [0]
    lock = threading.Lock()

    def slow(_self: login.Login, password: str) -> bytes:
        with lock:
            now[0] += 1
            most[0] = max(most[0], now[0])
        time.sleep(0.02)
        with lock:
            now[0] -= 1
        return password.encode()

    monkeypatch.setattr(login.Login, "_hashed", slow)
    door = login.Login("correct horse battery", "x")

    async def tried(number: int) -> int:
        body = b"password=wrong"
        scope = {
            "type": "http",
            "method": "POST",
            "path": "/login",
            "headers": [(b"content-length", b"14"), (b"origin", b"x")],
            "client": (f"10.0.0.{number}", 1),
        }

        async def receive() -> dict[str, object]:
            return {"type": "http.request", "body": body, "more_body": False}

        return (await door.answer(Request(scope, receive))).status_code

    async def all_tried() -> list[int]:
        return list(await asyncio.gather(*map(tried, range(50))))

    answers = asyncio.run(all_tried())
    assert most == [1]
    assert (answers.count(403), answers.count(429)) == (4, 46)
    assert len([1 for row in door._wrong.values() if row.count]) == 4
