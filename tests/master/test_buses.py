"""fsn-master with a plan of two buses: its options, its status, its log; in memory."""

from __future__ import annotations

from pathlib import Path

import pytest
from master.rig import run_to_end, running, write_plan

CELL, DRIVES = ("--interface", "cell=a"), ("--interface", "drives=b")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--interface", "a"], "this plan has several buses; write BUS=IF for each, with its name"),
        (["--interface", "robot=a"], "write BUS=IF for each"),
        (["--interface", "=a"], "write BUS=IF for each"),
        ([*CELL, "--interface", "cell=c"], "cell=c: this bus has one already"),
        ([*CELL, "--interface", "drives=a"], "a: two buses on one interface"),
        (["--cycle", "2ms"], "of several buses the plan states the cycles"),
        (["--free-run"], "--free-run: goes with a plan of one bus"),
        (["--policy", "deadline"], "deadline: goes with a plan of one bus"),
    ],
)
def test_options_of_several_buses(options: list[str], text: str, tmp_path: Path):
    plan = write_plan(tmp_path, "two-buses")
    done = run_to_end(plan, "--bus", "emulated", *options)
    assert done.returncode == 2
    assert text in done.stderr


def test_one_bus_has_one_interface(tmp_path: Path):
    plan = write_plan(tmp_path)
    done = run_to_end(plan, "--bus", "emulated", *CELL, *DRIVES)
    assert done.returncode == 2
    assert "--interface drives=b: the plan has one bus" in done.stderr


def test_a_live_bus_needs_each_interface(tmp_path: Path):
    plan = write_plan(tmp_path, "two-buses")
    for given, missing in ((CELL, "drives"), (DRIVES, "cell")):
        done = run_to_end(plan, "--bus", "soem", *given)
        assert done.returncode in (1, 2)  # 1: this build has no soem
        if done.returncode == 2:
            assert f"bus {missing} has none; --interface BUS=IF" in done.stderr


def test_a_scan_looks_at_one_bus():
    done = run_to_end("--scan", "--bus", "soem", *CELL, *DRIVES)
    assert done.returncode == 2
    assert "--scan: reads one bus: give one --interface" in done.stderr


def test_there_are_sixteen_buses_at_most():
    many = [word for n in range(17) for word in ("--interface", f"b{n}=eth{n}")]
    done = run_to_end("PLAN", "--bus", "emulated", *many)
    assert done.returncode == 2
    assert "--interface b16=eth16: more than there can be buses" in done.stderr


def test_each_bus_has_its_cycles_in_the_status():
    with running(*CELL, *DRIVES, name="two-buses") as master, master.client() as client:
        first = client.good("status")
        while client.good("status")["buses"][1]["cycles"] < first["buses"][1]["cycles"] + 10:
            pass
        status = client.good("status")
        assert [(b["name"], b["interface"], b["cycle_ns"]) for b in status["buses"]] == [
            ("cell", "a", 1_000_000),
            ("drives", "b", 2_000_000),
        ]
        assert status["interface"] == "a"
        for bus in status["buses"]:
            assert bus["expected_wkc"] > 0
            assert bus["actual_wkc"] == bus["expected_wkc"]
        rows = client.good("subdevices")["subdevices"]
        assert [row["bus"] for row in rows] == [0, 0, 0, 1, 1]
        client.good("stop")
        while client.good("status")["state"] != "stopped":
            pass
        stopped = client.good("status")
        assert [b["cycles"] for b in stopped["buses"]] == [0, 0]
        client.good("start")
        while client.good("status")["state"] != "running":
            pass
        while client.good("status")["buses"][1]["cycles"] < 2:
            pass
