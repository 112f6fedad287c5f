"""Malformed requests and clients that do not read: an answer, or the end of that client only."""

from __future__ import annotations

import contextlib
import signal
import socket
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from master.rig import Client, running
from weekly import examples

WORDS = [
    *("hello", "status", "get", "set", "lease", "arm", "events", "symbols", "help", "#1", "#"),
    *("drive_1.0x6060:00=1", "drive_1.0x6060:00", "el6910.logic_control=1", "on", "off", "=", "0x"),
    *(
        '"',
        "\\",
        '"a b"',
        "-1",
        "1e999",
        "nan",
        "\u00e9",
        "\u2028",
        "\ud83d".encode("utf-8", "replace").decode(),
    ),
]


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with running() as master, master.client() as one:
        yield one
        assert one.good("status")["state"] == "running"


def ask_and_synchronise(client: Client, line: bytes) -> None:
    """One line, then a tagged one: exactly one reply for each, all of them JSON."""
    client.socket.sendall(line + b"\n#sync hello\n")
    replies = 0
    while True:
        found = client.line()
        if found.get("tag") == "sync":
            break
        replies += "event" not in found
        if found.get("ok") is False:
            assert found["error"].startswith("FSN_E_")
            assert found["text"]
    assert replies == 1


@pytest.mark.shows("R26")
@settings(max_examples=examples(500), deadline=None)
@given(st.binary(max_size=300).filter(lambda b: b"\n" not in b))
def test_any_bytes_get_one_answer(client: Client, line: bytes) -> None:
    ask_and_synchronise(client, line)


@settings(max_examples=examples(500), deadline=None)
@given(st.lists(st.sampled_from(WORDS), max_size=12))
def test_any_words_get_one_answer(client: Client, words: list[str]) -> None:
    ask_and_synchronise(client, " ".join(words).encode())


@pytest.mark.parametrize("size", [8191, 8192, 8193, 8194, 100_000, 1_000_000])
def test_a_line_of_any_length_gets_one_answer(client: Client, size: int) -> None:
    ask_and_synchronise(client, b"x" * size)
    ask_and_synchronise(client, b"get" + b" a" * (size // 2))


def test_lines_may_come_in_pieces_and_several_at_once(client: Client) -> None:
    for byte in b"#sy":
        client.socket.sendall(bytes([byte]))
    client.socket.sendall(b"nc hello\r\n" + b"#n hello\n" * 100)
    assert client.line()["tag"] == "sync"
    assert [client.line()["tag"] for _ in range(100)] == ["n"] * 100


@pytest.mark.shows("R26")
def test_a_client_that_does_not_read_is_dropped_without_delay_for_others() -> None:
    with running() as master, master.client() as other:
        other.good("events on")
        with master.client() as slow:
            slow.good("lease 0")
            slow.good("set drive_1.0x6060:00=1")
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                while True:
                    slow.socket.sendall(b"snapshot\n" * 100)
            dropped = other.event("dropped")
            assert (dropped["client"], dropped["why"]) == (2, "does not read")
            fallback = other.event("fallback")
            assert fallback["outputs"] == ["drive_1.0x6060:00"]
        other.wait_for("drive_1.0x6060:00", 8)


def test_a_subscriber_that_does_not_read_is_dropped() -> None:
    with running() as master, master.client() as busy, master.client() as other:
        busy.good("lease 0")
        with master.client() as deaf:
            deaf.good("events on")
            while other.good("status")["clients"] == 3:
                busy.socket.sendall(b"arm el6910.logic_control\n" * 200)
                for _ in range(200):
                    busy.line()
            assert busy.good("hello")["client"] == 1


@pytest.mark.parametrize("held_up", [False, True])
def test_half_a_line_and_an_abrupt_end(held_up: bool) -> None:
    """Also where all of them have gone before the first is served: nobody else loses a place."""
    with running() as master, master.client() as other:
        other.good("hello")  # it has its place
        if held_up:
            master.process.send_signal(signal.SIGSTOP)
        for _ in range(50):
            with socket.socket(socket.AF_UNIX) as one:
                one.connect(str(master.path))
                with contextlib.suppress(BrokenPipeError):
                    one.sendall(b"status\nsnapshot\nget")
        master.process.send_signal(signal.SIGCONT)
        with master.client() as last:
            assert last.good("status")["state"] == "running"  # all before it have been served
        assert other.good("status")["state"] == "running"
