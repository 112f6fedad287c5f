"""The elapsed time of a long operation: after a second, only on a terminal."""

from __future__ import annotations

import io
import os
import pty
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from cli.tool import fsn

from fsoe_net.cli import progress
from fsoe_net.cli.progress import elapsed_time

ESTOP = Path(__file__).parents[2] / "examples" / "estop" / "network.yaml"


@contextmanager
def a_screen(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Make standard error a terminal; give its other end."""
    near, far = pty.openpty()
    monkeypatch.setenv("TERM", "xterm")
    with os.fdopen(far, "w") as stream:
        monkeypatch.setattr(sys, "stderr", stream)
        yield near
    os.close(near)


def _read_until(near: int, words: str) -> str:
    text = ""
    while words not in text:
        text += os.read(near, 4096).decode()
    return text


def test_a_long_operation_shows_its_time_and_removes_it(monkeypatch):
    monkeypatch.setattr(progress, "_QUIET_S", 0)
    with a_screen(monkeypatch) as screen:
        with elapsed_time("writing [red]r\x1b.pdf"):
            assert "writing [red]r\\u001b.pdf" in _read_until(screen, "0:00:01")
        sys.stderr.write("end")
        sys.stderr.flush()
        left = _read_until(screen, "end")
    # The cursor is visible again, and the line is erased.
    assert "\x1b[?25h" in left
    assert left.endswith("\x1b[2Kend")


def test_a_short_operation_shows_nothing(monkeypatch):
    with a_screen(monkeypatch) as screen:
        with elapsed_time("writing r.pdf"):
            pass
        sys.stderr.write("end")
        sys.stderr.flush()
        assert _read_until(screen, "end") == "end"


def test_an_error_of_the_operation_ends_the_clock(monkeypatch):
    monkeypatch.setattr(progress, "_QUIET_S", 0)

    def fail(screen: int) -> None:
        with elapsed_time("writing r.pdf"):
            _read_until(screen, "writing")
            raise KeyError

    with a_screen(monkeypatch) as screen:
        with pytest.raises(KeyError):
            fail(screen)
        assert _read_until(screen, "\x1b[?25h")


def test_nothing_is_shown_in_a_pipe(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(progress, "_QUIET_S", 0)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with elapsed_time("writing r.pdf"):
        pass
    assert sys.stderr.getvalue() == ""
    done = fsn("report", str(ESTOP), "-o", str(tmp_path / "r.html"))
    assert (done.returncode, done.stderr) == (0, "")
