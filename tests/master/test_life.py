"""Start and end of the process: signals, service manager, sockets of the dead."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import tempfile
from pathlib import Path

import pytest
from master.rig import (
    killed_at_the_end,
    notifications,
    notify_socket,
    program,
    run_to_end,
    running,
    when_it_listens,
    write_plan,
)
from tied import tied

MODE = "drive_1.0x6060:00"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_stops_in_order(number: signal.Signals) -> None:
    with running() as master, master.client() as client:
        client.good("lease 0")
        client.good(f"set {MODE}=1")
        client.good("events on")
        master.process.send_signal(number)
        seen = []
        with contextlib.suppress(EOFError):
            while True:
                seen.append(client.line())
        assert master.wait() == 0
        seen = [e for e in seen if e["event"] != "wkc"]  # a busy machine leaves cycles out
        assert [(e["event"], e["state"] if "state" in e else e["outputs"]) for e in seen] == [
            ("state", "running"),  # it ends
            ("fallback", [MODE]),
            ("state", "stopping"),
            ("state", "stopped"),
        ]
        assert not master.path.exists()
        assert [line["text"] for line in master.log][-1] == "the bus is closed"


def test_copying_continues_while_it_stops() -> None:
    """Three more cycles send the stop values: more than a cycle time, however late one is."""
    with running("--cycle", "50ms") as master, master.client() as client:
        client.good("events on")
        client.good("stop")
        told = [client.event("state") for _ in range(2)]
        assert [e["state"] for e in told] == ["stopping", "stopped"]
        assert told[1]["now_ns"] - told[0]["now_ns"] > 50_000_000
        client.good("shutdown")
        assert master.wait() == 0
        # Said when it gave up to wait for them.
        assert not [line for line in master.log if "the cycle stands still" in line["text"]]


def test_a_second_signal_ends_at_once() -> None:
    with running("--cycle", "1s") as master, master.client() as client:
        client.good("events on")
        master.process.terminate()
        while client.event("state")["state"] != "stopping":
            pass
        master.process.terminate()
        assert master.wait() == 1
        assert "a second signal" in master.log[-1]["text"]


def test_the_run_time_ends_it(tmp_path: Path) -> None:
    with tempfile.TemporaryDirectory(prefix="fsn-") as folder:  # short, as a socket's path must be
        common = [write_plan(tmp_path), "--bus", "emulated", "--policy", "other"]
        done = run_to_end(*common, "--socket", f"{folder}/s", "--duration", "100ms")
        assert done.returncode == 0
        assert "run time is over" in done.stderr
        assert os.listdir(folder) == []


def test_a_dead_masters_socket_is_replaced_and_a_living_ones_is_not() -> None:
    with running() as master:
        plan = master.directory / "el6910.fsnplan"
        common = [plan, "--bus", "emulated", "--policy", "other", "--socket", master.path]
        done = run_to_end(*common)
        assert done.returncode == 1
        assert "another process answers on" in done.stderr
        assert f"; it is held by pid {master.process.pid} (fsn-master), uid " in done.stderr
        with master.client() as client:
            client.good("hello")
        master.process.kill()
        master.wait()
        assert master.path.exists()
        done = run_to_end(*common, "--duration", "10ms")
        assert done.returncode == 0, done.stderr
        assert not master.path.exists()


def test_a_socket_that_another_has_taken_is_left_alone() -> None:
    with running() as master:
        master.path.unlink()
        master.path.write_text("another's")
        master.process.terminate()
        assert master.wait() == 0
        assert master.path.read_text() == "another's"


def test_the_service_manager_is_reported(tmp_path: Path) -> None:
    with running() as other:  # for its plan
        plan = other.directory / "el6910.fsnplan"
        directory = other.directory / "n"
        directory.mkdir()
        with notify_socket(directory) as listener:
            env = {"NOTIFY_SOCKET": str(directory / "notify"), "WATCHDOG_USEC": "20000"}
            command = tied(program(), plan, "--bus", "emulated", "--policy", "other")
            with killed_at_the_end(
                subprocess.Popen(
                    [*command, "--socket", str(directory / "s")],
                    env=os.environ | env,
                    stderr=subprocess.DEVNULL,
                )
            ) as process:
                assert "STATUS=opening: opens the bus" in notifications(listener, "READY=1")
                notifications(listener, "WATCHDOG=1")
                notifications(listener, "WATCHDOG=1")
                process.terminate()
                notifications(listener, "STOPPING=1")
                assert process.wait() == 0


def test_an_unread_log_stops_nothing(tmp_path: Path) -> None:
    with running() as other:
        plan = other.directory / "el6910.fsnplan"
        path = other.directory / "s2"
        command = tied(program(), plan, "--bus", "emulated", "--policy", "other")
        with killed_at_the_end(
            subprocess.Popen(
                [*command, "--socket", str(path)],
                stderr=subprocess.PIPE,  # and nobody reads it
            )
        ) as process:
            with when_it_listens(path, process) as client:
                client.good("lease 0")
                while client.good("status")["state"] != "running":
                    pass
                for _ in range(2000):
                    client.good("arm el6910.logic_control")
            process.terminate()
            assert process.wait() == 0
