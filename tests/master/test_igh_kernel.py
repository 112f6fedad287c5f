"""The igh backend on the real IgH EtherCAT Master, next to emulated networks on veth pairs.

It loads kernel modules, so it needs root and the kernel that they were built for: a virtual machine
or a test machine. docs/reference/igh.md describes how to build IgH, and how to run this.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import logging
import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from live.live_rig import Emulator
from master.rig import ROOT, killed_at_the_end, program, write_plan

from fsoe_net.core.bus_documents import Found
from fsoe_net.errors import FsnError
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.live.client import Client

TREE = Path(os.environ.get("FSN_IGH_TREE", ""))
PREFIX = Path(os.environ.get("FSN_IGH_PREFIX", ""))
_LOG = logging.getLogger(__name__)
LIMIT_S = 900.0  # of each step: IgH reads every EEPROM again when a SubDevice comes back
pytestmark = [
    pytest.mark.timeout(5400),
    pytest.mark.skipif(
        "FSN_IGH_TREE" not in os.environ,
        reason="FSN_IGH_TREE and FSN_IGH_PREFIX are not set: IgH, built and installed",
    ),
]


def run(*command: str | Path) -> str:
    """Run a command that must succeed; return what it wrote."""
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def stretched(name: str, folder: Path) -> Path:
    """Copy an example; a slow virtual machine needs longer cycles and watchdogs."""
    shutil.copytree(ROOT / "examples", folder, dirs_exist_ok=True)
    network = folder / name / "network.yaml"
    text = re.sub(r"watchdog_ms: \d+", "watchdog_ms: 5000", network.read_text("utf-8"))
    text = re.sub(r"reaction_ms: \d+", "reaction_ms: 60000", text)
    network.write_text(re.sub(r"(cycle_us: \d+)", r"\g<1>0", text), "utf-8")
    return network


@contextlib.contextmanager
def loaded(buses: int, subdevices: int) -> Iterator[None]:
    """Load the modules of IgH, with a master for each bus; wait until all SubDevices are read."""
    macs = [run("cat", f"/sys/class/net/near{bus}/address").strip() for bus in range(buses)]
    run("insmod", TREE / "master/ec_master.ko", f"main_devices={','.join(macs)}")
    try:
        run("insmod", TREE / "devices/ec_generic.ko")
        tool = PREFIX / "bin/ethercat"
        # IgH waits half a millisecond for a reply while it scans: on a busy machine a scan fails.
        for attempt in itertools.count(1):
            found = subprocess.run([tool, "slaves"], capture_output=True, text=True, check=False)
            if len(re.findall(r"PREOP  \+  \S*[a-z]", found.stdout)) >= subdevices or attempt > 30:
                break
            if attempt % 5 == 0:
                run(tool, "rescan")
            time.sleep(1)
        yield
    finally:
        subprocess.run(["rmmod", "ec_generic"], check=False)
        run("rmmod", "ec_master")


@contextlib.contextmanager
def cables(count: int) -> Iterator[None]:
    """Make a veth pair for each bus."""
    try:
        for number in range(count):
            run("ip", "link", "add", f"near{number}", "type", "veth", "peer", f"far{number}")
            for side in (f"near{number}", f"far{number}"):
                run("ip", "link", "set", side, "addrgenmode", "none", "up")
        yield
    finally:
        for number in range(count):
            run("ip", "link", "del", f"near{number}")


class Bus:
    """A running fsn-master, and the emulated network."""

    def __init__(self, folder: Path, master: subprocess.Popen[bytes], emulator: Emulator) -> None:
        self._folder, self._master, self.emulator = folder, master, emulator

    def log(self) -> list[Any]:
        """Return the log of fsn-master; libethercat writes lines of its own to it."""
        lines = (self._folder / "log").read_text("utf-8").splitlines()
        return [json.loads(line) for line in lines if line.startswith("{")]

    def states(self) -> list[str]:
        """Return the states that fsn-master has had."""
        return [row["state"] for row in self.log() if row["event"] == "state"]

    def wait(self, what: str, holds: Callable[[Any], bool], order: str = "") -> Any:
        """Wait until a snapshot is as wanted; repeat an order of the emulation until then."""
        seen = None
        until = time.monotonic() + LIMIT_S
        while time.monotonic() < until:
            assert self._master.poll() is None, self.log()[-40:]
            with contextlib.suppress(FsnError), Client(self._folder / "s", timeout_s=20) as client:
                seen = client.snapshot()
                if holds(seen):
                    states = {c.name: str(c.state) for c in seen.cycle.connections}
                    _LOG.info(
                        "%s: %s, %s", what, states, [(s.al, s.returns) for s in seen.subdevices]
                    )
                    return seen
            if order:
                self.emulator.give(order)
                time.sleep(0.25)
            else:
                time.sleep(1)
        pytest.fail(f"not in {LIMIT_S} s: {what}; {seen}; {self.log()[-40:]}")

    def in_data(self) -> None:
        """Wait for Data, then press reset until all outputs are on."""
        self.wait("Data", lambda seen: all(c.state.in_data for c in seen.cycle.connections))

        def process(seen: Any) -> bool:
            states = {c.state for c in seen.cycle.connections}
            # An edge of reset; after a loss another one.
            self.emulator.give("release")
            time.sleep(1)
            self.emulator.give("press")
            return states == {ConnectionState.DATA_PROCESS}

        self.wait("process data", process)

    def unplug(self, *names: str, stay: bool = False) -> None:
        """Unplug SubDevices, and plug them in again; with `stay` other connections stay in Data."""

        def named(seen: Any) -> list[Any]:
            return [s for s in seen.subdevices if s.name in names]

        for name in names:
            self.emulator.give(f"break {name}")
        self.wait("lost", lambda seen: all(s.found is Found.NOTHING for s in named(seen)))
        if stay:
            seen = self.wait(
                "only these",
                lambda seen: all(
                    c.state.in_data != (c.sub in names) for c in seen.cycle.connections
                ),
            )
            others = [c for c in seen.cycle.connections if c.sub not in names]
            assert others
            assert [c.name for c in others if c.to_sub.resets > 1] == []
        for name in names:
            self.emulator.give(f"heal {name}")
        self.wait(
            "back",
            lambda seen: all(s.found is Found.RIGHT and s.in_op and s.returns for s in named(seen)),
        )
        self.in_data()


@contextlib.contextmanager
def running(name: str, buses: list[str], subdevices: int, folder: Path) -> Iterator[Bus]:
    """Run an example over IgH; `buses` are their names, with "=", or nothing for the only one."""
    network = stretched(name, folder)
    far = [f"{bus}far{number}" for number, bus in enumerate(buses)]
    interfaces = [w for number, bus in enumerate(buses) for w in ("--interface", f"{bus}{number}")]
    with cables(len(buses)), contextlib.ExitStack() as stack:
        emulator = Emulator(str(network), "--priority", "50", interfaces=far)
        stack.callback(emulator.end)
        stack.enter_context(loaded(len(buses), subdevices))
        command = [program(), write_plan(folder, network=network), "--bus", "igh", *interfaces]
        command += ["--policy", "other", "--wait", f"{LIMIT_S:.0f}s", "--log", "json"]
        log = stack.enter_context((folder / "log").open("wb"))
        process = subprocess.Popen([*command, "--socket", folder / "s"], stderr=log)
        stack.enter_context(killed_at_the_end(process))
        bus = Bus(folder, process, emulator)
        yield bus
        process.terminate()
        assert process.wait(LIMIT_S) == 0, bus.log()[-40:]


def test_each_subdevice_is_lost_and_comes_back(tmp_path: Path) -> None:
    with running("estop", [""], 2, tmp_path) as bus:
        bus.in_data()
        bus.unplug("el1918")
        bus.unplug("ek1914")


def test_answers_come_late_while_the_bus_opens(tmp_path: Path) -> None:
    with running("el6910", [""], 6, tmp_path) as bus:
        bus.wait("cycles", lambda _: "starting" in bus.states(), order="stall 50ms")
        assert bus.states()[:2] == ["opening", "starting"]  # it did not begin again
        bus.in_data()
        bus.unplug("drive_2")


def test_a_lost_bus_takes_only_its_own_connections(tmp_path: Path) -> None:
    with running("two-buses", ["cell=", "drives="], 5, tmp_path) as bus:
        bus.in_data()
        bus.unplug("drive_1", "drive_2", stay=True)
