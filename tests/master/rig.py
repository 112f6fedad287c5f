"""Starts the built ``fsn-master`` on its emulated bus, and talks to its control socket."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from networks import example, resolved
from patience import PATIENCE_S
from tied import tied

from fsoe_net.plan.compile import compile_plan

ROOT = Path(__file__).parents[2]
NOBODY = 65534
"""Longer than a busy machine ever takes; the tests do not measure time."""
JsonObject = dict[str, Any]


def program() -> str:
    """Return the executable, or skip the test."""
    found = shutil.which("fsn-master")
    built = sorted(ROOT.glob("build/*/fsn-master"))
    if found is None and not built:
        if "master" in os.environ.get("FSN_REQUIRE", "").split(","):
            pytest.fail("fsn-master is not built")
        pytest.skip("fsn-master is not built: make master")
    return found or str(built[0])


class Client:
    """One connection; replies and events come in the order they were sent."""

    def __init__(self, path: Path | str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.settimeout(PATIENCE_S)
        try:
            self.socket.connect(str(path))
        except OSError:
            self.socket.close()
            raise
        self._file = self.socket.makefile("rb")
        self.events: list[JsonObject] = []

    def line(self) -> JsonObject:
        """Return the next line; raises `EOFError` when there is none."""
        raw = self._file.readline()
        if not raw:
            raise EOFError
        found = json.loads(raw.decode("utf-8", "strict"))
        assert isinstance(found, dict)
        return found

    def ask(self, request: str | bytes) -> JsonObject:
        """Send a request and return its reply; events before it are kept."""
        raw = request.encode() if isinstance(request, str) else request
        self.socket.sendall(raw + b"\n")
        while True:
            found = self.line()
            if "event" not in found:
                return found
            self.events.append(found)

    def good(self, request: str) -> JsonObject:
        reply = self.ask(request)
        assert reply["ok"] is True, reply
        return reply

    def refused(self, request: str, error: str) -> str:
        reply = self.ask(request)
        assert (reply["ok"], reply["error"]) == (False, error), reply
        return str(reply["text"])

    def event(self, name: str) -> JsonObject:
        """Wait for an event."""
        while True:
            for number, found in enumerate(self.events):
                if found["event"] == name:
                    return self.events.pop(number)
            found = self.line()
            assert "event" in found
            self.events.append(found)

    def value(self, name: str) -> Any:
        """Return the value of an input or output; the name must be that of one of them alone."""
        reply = self.good(f"get {name}")
        (value,) = [*reply["inputs"].values(), *reply["outputs"].values()]
        return value

    def wait_for(self, name: str, value: object) -> None:
        """Ask until an output has a value: it is written in the next cycle."""
        while self.value(name) != value:
            pass

    def close(self) -> None:
        self._file.close()
        self.socket.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Master:
    """A running process; `log` gets its lines."""

    def __init__(self, directory: Path, process: subprocess.Popen[bytes], path: Path) -> None:
        self.directory = directory
        self.process = process
        self.path = path
        self.log: list[JsonObject] = []
        self._grown = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stderr is not None
        for raw in self.process.stderr:
            with self._grown:
                self.log.append(json.loads(raw))
                self._grown.notify_all()

    def client(self) -> Client:
        return Client(self.path)

    def wait(self) -> int:
        """Wait for the end and return the exit code; then the log is whole."""
        code = self.process.wait(PATIENCE_S)
        self._reader.join(PATIENCE_S)
        return code

    def logged(self, *events: str) -> list[JsonObject]:
        """Wait until each of the events is in the log, which may come after the socket's answer."""

        def lines() -> list[JsonObject]:
            return [line for line in self.log if line["event"] in events]

        with self._grown:
            self._grown.wait_for(lambda: {e["event"] for e in lines()} == set(events), PATIENCE_S)
            return lines()


def end(process: subprocess.Popen[bytes]) -> None:
    """Ask it to end, for a counting build writes its counts then; kill it if it does not."""
    process.terminate()
    try:
        process.wait(PATIENCE_S)
    finally:
        process.kill()


@contextlib.contextmanager
def killed_at_the_end(process: subprocess.Popen[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    """A process that a failing test does not wait for for ever."""
    with process:
        try:
            yield process
        finally:
            process.kill()


def when_it_listens(path: Path, process: subprocess.Popen[bytes]) -> Client:
    """Connect as soon as somebody listens: the file of a socket is there a moment before."""
    while True:
        try:
            return Client(path)
        except (FileNotFoundError, ConnectionRefusedError):
            assert process.poll() is None


def write_plan(directory: Path, name: str = "el6910", network: Path | None = None) -> Path:
    """Compile an example, or a network of its own."""
    path = directory / f"{name}.fsnplan"
    resolution = example(name) if network is None else resolved(network)
    path.write_bytes(compile_plan(resolution).to_bytes())
    return path


def run_to_end(*arguments: object, **more: Any) -> subprocess.CompletedProcess[str]:
    """Run it with arguments that let it end by itself."""
    return subprocess.run(
        [program(), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
        **more,
    )


def notifications(listener: socket.socket, last: str) -> list[str]:
    """Return what the service manager was told, up to the line `last`."""
    lines: list[str] = []
    while last not in lines:
        lines += listener.recv(4096).decode().splitlines()
    return lines


@contextlib.contextmanager
def notify_socket(directory: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.settimeout(PATIENCE_S)
        listener.bind(str(directory / "notify"))
        yield listener


@contextlib.contextmanager
def running(
    *arguments: object, name: str = "el6910", network: Path | None = None
) -> Iterator[Master]:
    """Run it until it is ready. The directory is short: a socket's path has 107 bytes."""
    with tempfile.TemporaryDirectory(prefix="fsn-") as text:
        directory = Path(text)
        path = directory / "s"
        with notify_socket(directory) as listener:
            plan = write_plan(directory, name, network)
            command = tied(program(), plan, "--bus", "emulated")
            command += ["--policy", "other", "--socket", str(path), "--log", "json"]
            process = subprocess.Popen(
                [*command, *map(str, arguments)],
                stderr=subprocess.PIPE,
                env=os.environ | {"NOTIFY_SOCKET": str(directory / "notify")},
            )
            master = Master(directory, process, path)
            try:
                notifications(listener, "READY=1")
                yield master
            finally:
                end(process)
                master.wait()
                assert process.stderr is not None
                process.stderr.close()
