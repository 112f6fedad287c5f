"""Fixtures: a scheduler of Dask, and three workers of it, as processes of this machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from patience import PATIENCE_S

TESTS = Path(__file__).parent


def dask(command: str, *arguments: str) -> subprocess.Popen[bytes]:
    module = f"distributed.cli.dask_{command}"
    return subprocess.Popen(
        [sys.executable, "-m", module, *arguments, "--no-dashboard", "--host", "127.0.0.1"],
        env={**os.environ, "PYTHONPATH": str(TESTS)},  # for pieces of work of developers
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@pytest.fixture(name="scheduler")
def one_scheduler(tmp_path: Path) -> Iterator[tuple[str, Path]]:
    """A scheduler without workers: its address and its file."""
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    file = tmp_path / "scheduler.json"
    process = dask("scheduler", "--port", "0", "--scheduler-file", str(file))
    end = time.monotonic() + PATIENCE_S
    while not file.exists():
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.05)
    yield json.loads(file.read_text("utf-8"))["address"], file
    process.kill()
    process.wait()


@pytest.fixture(name="cluster")
def three_workers(
    scheduler: tuple[str, Path],
) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """The address of a scheduler, and the processes of its three workers."""
    from distributed import Client

    address, file = scheduler
    arguments = ("--scheduler-file", str(file), "--nthreads", "1", "--no-nanny")
    processes = [dask("worker", *arguments) for _ in range(3)]
    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(3, timeout=PATIENCE_S)
    yield address, processes
    for process in processes:
        process.kill()
        process.wait()
