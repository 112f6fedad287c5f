"""What a test that is ended for its time was doing: stacks of all threads, and its processes.

pytest-timeout ends a test by a signal. Where that comes too late to help, the report gets what all
threads and all processes below were at; a Python process there is asked for its own stacks.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import select
import signal
import stat
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

# A Python process that is sent SIGABRT writes the stacks of its threads, and ends.
os.environ.setdefault("PYTHONFAULTHANDLER", "1")
_ANSWER_S = 5.0
_MOST_BYTES = 64 * 1024
# Of the last limit of one test: so long no worker has said anything.
_SILENCE_FACTOR = 2


@pytest.hookimpl(hookwrapper=True)
def pytest_timeout_set_timer(item: pytest.Item) -> Iterator[None]:
    """Put what hung into the report before pytest-timeout ends the test."""
    yield
    end = signal.getsignal(signal.SIGALRM)
    if not callable(end):
        return

    def tell_and_end(number: int, frame: object) -> None:
        item.add_report_section("call", "stacks of all threads", stacks())
        item.add_report_section("call", "processes of the test", processes(os.getpid()))
        end(number, frame)

    signal.signal(signal.SIGALRM, tell_and_end)


def pytest_configure(config: pytest.Config) -> None:
    """End pytest itself, with its stacks, when its workers have not ended a test for long."""
    limit_s = float(config.getini("faulthandler_timeout"))
    if limit_s and config.getoption("numprocesses", None):
        config.pluginmanager.register(_Watch(_SILENCE_FACTOR * limit_s), "fsn-workers")


class _Watch:
    """Runs in the process that only collects what the workers say."""

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self._error = os.dup(2)
        self.pytest_runtest_logreport()

    def pytest_runtest_logreport(self) -> None:
        faulthandler.dump_traceback_later(self._limit_s, exit=True, file=self._error)

    def pytest_unconfigure(self) -> None:
        faulthandler.cancel_dump_traceback_later()
        os.close(self._error)


def stacks() -> str:
    """Return the stacks of all threads of this process."""
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as file:
        faulthandler.dump_traceback(file)
        file.seek(0)
        return file.read()


def processes(root: int) -> str:
    """Return what all processes below ``root`` are at, with what they said that nobody read."""
    return "\n".join(_about(pid) for pid in _below(root)) or "none"


def _below(root: int) -> list[int]:
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parent = (folder / "stat").read_text().rpartition(")")[2].split()[1]
            children.setdefault(int(parent), []).append(int(folder.name))
    found = [root]
    for pid in found:
        found += sorted(children.get(pid, []))
    return found[1:]


def _about(pid: int) -> str:
    folder = Path("/proc", str(pid))
    lines = [f"{pid}: {_text(folder / 'cmdline').replace(chr(0), ' ').strip()}"]
    for task in sorted((folder / "task").glob("*"), key=lambda at: int(at.name)):
        state = _text(task / "stat").rpartition(")")[2].split()[:1]
        where, call = _text(task / "wchan").strip("0\n"), _text(task / "syscall").split()[:1]
        lines.append(f"  thread {task.name} {' '.join(state)} {where} syscall {' '.join(call)}")
    said = _said(pid, folder)
    return "\n".join([*lines, *(f"  | {line}" for line in said.splitlines())])


def _said(pid: int, folder: Path) -> str:
    """Return what is in the pipes it writes to; a Python process adds its stacks, and ends."""
    pipes = []
    for number in ("1", "2"):
        with contextlib.suppress(OSError):
            path = folder / "fd" / number
            if stat.S_ISFIFO(path.stat().st_mode):
                pipes.append(os.open(path, os.O_RDONLY | os.O_NONBLOCK))
    asked = "PYTHONFAULTHANDLER=1" in _text(folder / "environ").split(chr(0))
    asked = asked and "python" in os.path.basename(os.path.realpath(folder / "exe"))
    try:
        if asked and pipes:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGABRT)
        return "".join(_unread(pipe, _ANSWER_S if asked else 0.0) for pipe in reversed(pipes))
    finally:
        for pipe in pipes:
            os.close(pipe)


def _unread(pipe: int, patience_s: float) -> str:
    found = b""
    until = time.monotonic() + patience_s
    while len(found) < _MOST_BYTES:
        if not select.select([pipe], [], [], max(0.0, until - time.monotonic()))[0]:
            break
        more = os.read(pipe, _MOST_BYTES)
        if not more:
            break
        found += more
    return found.decode(errors="replace")


def _text(path: Path) -> str:
    try:
        return path.read_text(errors="replace")
    except OSError:
        return ""
