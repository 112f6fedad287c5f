"""`fsn-master` tells the fingerprint of what it has loaded, and `verify --socket` asks for it."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli.tool import fsn
from master.rig import running
from networks import PLAIN, example

from fsoe_net.live.client import Client
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import fingerprint_from_json, fingerprint_of
from fsoe_net.version import __version__

ESTOP = str(PLAIN / "estop" / "network.yaml")


def test_status_snapshot_and_client_tell_it() -> None:
    for name in ("estop", "el6910"):
        wanted = fingerprint_of(compile_plan(example(name)))
        with running(name=name) as master, master.client() as client:
            for request in ("status", "snapshot"):
                told = client.good(request)["fingerprint"]
                assert fingerprint_from_json(told) == wanted
                assert (told["short"], told["cycle_ns"]) == (wanted.short, 1_000_000)
            with Client(master.path) as typed:
                status = typed.status()
            assert (status.fingerprint, status.version) == (wanted, __version__)


@pytest.mark.shows("R4")
def test_verify_asks_the_running_core(tmp_path: Path) -> None:
    with running(name="estop") as master:
        done = fsn("acceptance", "verify", ESTOP, "--socket", str(master.path), "--accepted", ESTOP)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.count("the same") == 2
        other = str(PLAIN / "el6910" / "network.yaml")
        done = fsn("acceptance", "verify", "--socket", str(master.path), "--accepted", other)
        assert done.returncode == 1
        assert "DIFFERS in devices, process_data, copies, connections\n" in done.stdout


@pytest.mark.shows("R4")
def test_another_cycle_than_that_of_the_plan_differs() -> None:
    with running("--cycle", "2ms", name="estop") as master:
        done = fsn("acceptance", "verify", "--socket", str(master.path), "--accepted", ESTOP)
    assert done.returncode == 1
    observed = "parameters of 0 of 1 connection observed"
    assert f"cycle 2 ms, {observed}): DIFFERS in cycle\n" in done.stdout
