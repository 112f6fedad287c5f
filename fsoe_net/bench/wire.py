"""Measures cycles over a wire with ``fsn-bench``, which is built with SOEM."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import yaml

from fsoe_net.bench.result import Loop, Measured, Times, WireLoop, WireResult
from fsoe_net.core.json_object import clean
from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.master import find_master
from fsoe_net.network import load
from fsoe_net.project.installed import shipped

_CELLS = 5
_PROGRAM = "fsn-bench"
_LOOPS = 8  # four, with the cycle and free
_START_S = 120.0  # for starts and ends of the bus between their turns


def find_bench() -> str:
    """Return the path of ``fsn-bench``.

    Raises:
        EnvironmentFault: It is missing, or ``fsn-master`` is.
    """
    program = Path(find_master()).with_name(_PROGRAM)
    if not os.access(program, os.X_OK):
        raise EnvironmentFault(
            f"{program} is missing, which measures frames on a wire: `fsoe-net install-master` "
            "builds it with fsn-master and SOEM"
        )
    return str(program)


def write_cells(folder: Path) -> Path:
    """Write the e-stop cell five times over: ten SubDevices, five connections."""
    devices = shipped("examples") / "estop" / "devices"
    subdevices, nets = [], []
    for cell in range(_CELLS):
        sub, main = f"ek1914_{cell}", f"el1918_{cell}"
        for place, name in enumerate((sub, main)):
            config = str(devices / f"{name.partition('_')[0]}.yaml")
            subdevices.append({"name": name, "position": 2 * cell + place, "config": config})
        facts = {"address": 14 + cell, "connection_id": 1 + cell, "watchdog_ms": 100}
        connection = {"main": main, "sub": sub, **facts}
        nets.append({"name": f"net_{cell}", "safety_master": main, "connections": [connection]})
    text = {"version": 1, "name": "ten", "cycle_us": 1000, "subdevices": subdevices, "nets": nets}
    path = folder / "network.yaml"
    path.write_text(yaml.safe_dump(text), "utf-8")
    return path


def measure_wire(
    cycle_ns: int, seconds: float, interface: str | None
) -> tuple[WireResult, dict[Measured, Times]]:
    """Measure bare system calls, SOEM's functions and the core of fsn-master in turn.

    Args:
        cycle_ns: The cycle; with a veth pair they also run free.
        seconds: Time of each of them.
        interface: Carries frames with one NOP datagram, without the core; ``None``: a veth pair
            in a network namespace, with emulated SubDevices at its other end.

    Raises:
        EnvironmentFault: ``fsn-bench`` is missing, or needs what this machine does not permit.
    """
    program, cpu = find_bench(), max(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory(prefix="fsn-bench-") as text:
        folder = Path(text)
        plan = folder / "cells.fsnplan"
        plan.write_bytes(load(write_cells(folder)).compile().to_bytes())
        words = [program, str(plan), f"{seconds:g}", str(cycle_ns), str(cpu)]
        words += [] if interface is None else [interface]
        most_s = _LOOPS * seconds + _START_S
        try:
            done = subprocess.run(  # noqa: S603  # a list, no shell
                words, stdin=subprocess.DEVNULL, capture_output=True, check=False, timeout=most_s
            )
        except subprocess.TimeoutExpired as exc:
            raise EnvironmentFault(
                f"{_PROGRAM} did not end within {most_s:.0f} s and was stopped; repeat it on a "
                "machine with less load"
            ) from exc
    if done.returncode != 0:
        reason = clean(done.stderr.decode("utf-8", "replace").strip())
        raise EnvironmentFault(f"{_PROGRAM}: {reason or f'exit code {done.returncode}'}")
    row = json.loads(done.stdout)
    wire = WireResult(
        interface=interface or "",
        paced=_loops(row["paced"]),
        free=_loops(row.get("free", {})),
    )
    return wire, _times(row["paced"])


def _loops(row: dict[str, Any]) -> dict[Loop, WireLoop]:
    return {
        Loop(name): WireLoop(
            cycles=loop["cycles"],
            incomplete=loop["incomplete"],
            left_out=loop["left_out"],
            per_s=tuple(loop["per_s"]),
        )
        for name, loop in row.items()
    }


def _times(paced: dict[str, Any]) -> dict[Measured, Times]:
    rows = {
        Measured.WIRE_BARE: paced[Loop.BARE]["work"],
        Measured.WIRE_SOEM: paced[Loop.SOEM]["work"],
    }
    if Loop.CORE in paced:
        rows[Measured.WIRE_CORE] = paced[Loop.CORE]["work"]
        rows[Measured.WIRE_ROUND_TRIP] = paced[Loop.CORE].get("round_trip")
    if Loop.XDP in paced:
        rows[Measured.WIRE_XDP] = paced[Loop.XDP]["work"]
    return {name: Times(**times) for name, times in rows.items() if times is not None}
