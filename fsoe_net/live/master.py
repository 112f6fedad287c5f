"""Starts and stops ``fsn-master``, the process that drives a live bus."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, cast

from fsoe_net.core.json_object import clean
from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.live.client import Client

_PROGRAM = "fsn-master"
_SHIPPED = Path(__file__).parents[1] / "bin" / _PROGRAM
_CONNECT_S = 20.0
_STOP_S = 15.0  # fsn-master limits its own shutdown to 10 s
_MOST_TEXT = 2000
REFUSED, USAGE = 1, 2
LOG = ("--log", "json")
"""Options for a log that `read_log` can read."""


def find_master() -> str:
    """Return the path of ``fsn-master``.

    In this order: ``FSN_MASTER``, next to the interpreter, on ``PATH``, in the wheel. The last one
    has no SOEM: it drives the emulated bus only.

    Raises:
        EnvironmentFault: ``fsn-master`` was not found.
    """
    stated = os.environ.get("FSN_MASTER")
    if stated:
        # A wrong value of the variable is an error: falling back would run another program than
        # requested.
        if os.access(stated, os.X_OK) and os.path.isfile(stated):
            return stated
        raise EnvironmentFault(f"FSN_MASTER={stated} is not an executable program")
    # First the environment of this Python: its fsn-master has the version of this package.
    beside = Path(sys.executable).parent / _PROGRAM
    if os.access(beside, os.X_OK) and beside.is_file():
        return str(beside)
    found = shutil.which(_PROGRAM) or shutil.which(_SHIPPED)
    if found is None:
        raise EnvironmentFault(
            "fsn-master, which drives a live bus, is not there: `fsoe-net install-master` builds "
            "it; FSN_MASTER=PATH names another"
        )
    return found


class Master:
    """A running ``fsn-master`` in its own session; a context manager that stops it.

    Only `stop` or an error in this process ends it. If this process is killed, ``fsn-master``
    continues; its socket stays usable and its log is no longer read.

    Args:
        plan: The plan to load.
        options: Its options, without the plan and the socket.

    Raises:
        EnvironmentFault: ``fsn-master`` is missing or cannot be started.
    """

    def __init__(self, plan: bytes, options: Sequence[str]) -> None:
        self.program = find_master()
        self.directory = Path(tempfile.mkdtemp(prefix="fsoe-net-", dir=_runtime_directory()))
        self.socket = self.directory / "control.sock"
        self._lines: deque[str] = deque(maxlen=200)
        plan_file = self.directory / "network.fsnplan"
        try:
            plan_file.write_bytes(plan)
            self._process = subprocess.Popen(  # noqa: S603  # a list, no shell
                [self.program, str(plan_file), *options, *LOG, "--socket", str(self.socket)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                # Otherwise a Ctrl-C at the terminal would kill it before `stop` ends it in order.
                start_new_session=True,
            )
        except OSError as exc:
            self._clean()
            raise EnvironmentFault(f"{self.program} cannot be started: {exc.strerror}") from exc
        self._reader = threading.Thread(target=self._read, name="fsn-master log", daemon=True)
        self._reader.start()

    def __enter__(self) -> Master:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    @property
    def log(self) -> MasterLog:
        """Its log messages so far about its end."""
        return read_log(self._lines)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def connect(self) -> Client:
        """Return a client as soon as its socket exists.

        Raises:
            InputError: It rejected the plan or the bus.
            EnvironmentFault: It ended for another reason, or does not open its socket.
        """
        until = time.monotonic() + _CONNECT_S
        while True:
            if self.ended(0.01):
                self.explain()
            # The file exists before the server listens, so a refused connection is retried.
            if self.socket.exists():
                try:
                    return Client(self.socket)
                except EnvironmentFault:
                    # It may have ended just now; the next round then reports its reason instead of
                    # "cannot connect".
                    if not self.ended(0.5) and time.monotonic() > until:
                        raise
            if time.monotonic() > until:
                raise EnvironmentFault(f"{self.program} has not opened {self.socket}")

    def ended(self, wait_s: float = 0.0) -> bool:
        """Return whether it has ended, after waiting for at most this time."""
        try:
            self._process.wait(wait_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def explain(self) -> None:
        """Raise the exception with the reason why it ended.

        Raises:
            InputError: It rejected the plan or the bus.
            EnvironmentFault: Any other reason.
        """
        # The reason is in the last lines of the log: wait until the reader has them all.
        self._reader.join(1.0)
        code = self._process.returncode
        log = self.log
        # A negative code is a signal: the program could not log a reason.
        if code is not None and code < 0:
            name = _signal_name(-code)
            raise EnvironmentFault(
                f"fsn-master (process {self.pid}) was killed by {name} while it drove the bus: "
                "without it no frame is sent, the watchdogs of the SubDevices and of FSoE expire; "
                "the kernel log (`dmesg`) shows whether memory ran out"
            )
        if code == REFUSED:
            findings = "".join(f"\n  {text}" for text in log.findings)
            why = log.error or "fsn-master refused the bus and did not say why"
            raise InputError(why + findings)
        if code == USAGE:
            raise EnvironmentFault(
                f"{self.program} does not take its options: {log.error or 'no reason given'}; "
                "install fsoe-net and fsn-master of one version"
            )
        raise EnvironmentFault(
            log.error or f"fsn-master (process {self.pid}) was ended from outside during the run"
        )

    def stop(self) -> None:
        """Stop: set the stop values, leave OP while copying continues. Idempotent."""
        if not self.ended():
            self._process.send_signal(signal.SIGTERM)
        if not self.ended(_STOP_S):
            self._process.kill()
            self.ended(_STOP_S)
        self._reader.join(1.0)
        self._clean()

    def _read(self) -> None:
        stream = cast(IO[bytes], self._process.stderr)  # a pipe, see Popen
        with stream, contextlib.suppress(OSError, ValueError):
            for line in stream:
                self._lines.append(line.decode("utf-8", "replace").rstrip())

    def _clean(self) -> None:
        shutil.rmtree(self.directory, ignore_errors=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class MasterLog:
    """Log messages of ``fsn-master`` about its end.

    Attributes:
        error: Its last error, printable; empty if there is none.
        findings: Its findings about single SubDevices, printable.
        subdevices: Their names, one for each finding.
    """

    error: str = ""
    findings: tuple[str, ...] = ()
    subdevices: tuple[str, ...] = ()


def read_log(lines: Iterable[str]) -> MasterLog:
    """Read a log in JSON; other lines, such as about wrong options, count if it has no error."""
    errors, others, findings = [], [], {}
    for line in lines:
        try:
            row = json.loads(line)
            level, text = row["level"], clean(row["text"], _MOST_TEXT)
        # Messages of the loader, of a sanitizer or about a wrong option are not JSON.
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
            others.append(clean(line.removeprefix(f"{_PROGRAM}: "), _MOST_TEXT))
            continue
        if level == "error":
            errors.append(text)
        # A dictionary, because the same finding can be logged at each attempt to start.
        elif row["event"] == "log" and "subdevice" in row:
            findings[text] = str(row["subdevice"])
    return MasterLog(
        # The last error is the reason; earlier ones are from attempts that were repeated.
        error=next(reversed(errors or others), ""),
        findings=tuple(findings),
        subdevices=tuple(findings.values()),
    )


def _runtime_directory() -> str | None:
    """Return the user's runtime directory, or ``None`` to use the one for temporary files."""
    found = os.environ.get("XDG_RUNTIME_DIR")
    # The path of a socket has at most 107 bytes.
    usable = found and len(found) < 60 and os.path.isdir(found) and os.access(found, os.W_OK)
    return found if usable else None


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
