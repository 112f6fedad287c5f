"""Live runs: the core in its own thread. No assertion here measures time."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from live.support import ESTOP, ROBOT, needs_core, session_of

from fsoe_net.cli.run_output import _stall_text, print_result
from fsoe_net.live.result import Run
from fsoe_net.simulate.session import run_live

pytestmark = needs_core

MS = 1_000_000


def long_enough(run: Callable[[int], Run], came: Callable[[Run], bool]) -> Run:
    """Runs for a time, then for a multiple of it, until what must come has come.

    A busy machine may let the devices wait for most of a short run.
    """
    for times in (1, 4, 16):
        result = run(times)
        if came(result):
            break
    return result


@pytest.fixture
def _leaves_no_thread() -> Iterator[None]:
    """A library that another test has imported may have threads of its own."""
    before = set(threading.enumerate())
    yield
    assert set(threading.enumerate()) <= before


def in_data(result: Run) -> bool:
    return all(c.time_to_data_ms is not None for c in result.connections)


@pytest.mark.usefixtures("_leaves_no_thread")
@pytest.mark.parametrize("folder", [ESTOP, ROBOT], ids=["estop", "el6910"])
def test_connections_come_up_and_reset_is_pressed(folder: Path):
    updates: list[float] = []

    def run(times: int) -> Run:
        updates.clear()
        return run_live(
            session_of(folder),
            times * 1500 * MS,
            on_update=lambda update: updates.append(update.now_s),
        )

    result = long_enough(run, in_data)
    assert result.mode == "live"
    assert in_data(result)
    assert any(e.text.startswith("no scenario: reset pressed") for e in result.events)
    assert result.statistics.cycles > 100
    assert all(c.fsoe_cycle_ms["mean"] > 0 for c in result.connections)
    assert updates == sorted(updates)
    assert updates


def test_devices_slower_than_the_bus():
    result = long_enough(
        lambda times: run_live(session_of(ESTOP), times * 1000 * MS, device_period_ns=5 * MS),
        in_data,
    )
    (row,) = result.connections
    assert row.time_to_data_ms is not None
    assert row.fsoe_cycle_ms["mean"] > 5


def test_unplugged_for_good(tmp_path: Path):
    def run(times: int) -> Run:
        text = (
            f"duration_s: {times}\nsteps: [{{at_ms: {300 * times}, break: ek1914}}]\n"
            f"expect: [{{at_ms: {900 * times}, safe_outputs: {{ek1914.0x7001:01: 0}}, "
            "min_resets: 1}]\n"
        )
        session = session_of(ESTOP, text, tmp=tmp_path)
        return run_live(session, session.duration_ns)

    result = long_enough(run, lambda r: r.passed)
    assert result.passed
    assert result.statistics.wkc_errors > 0


@pytest.mark.usefixtures("_leaves_no_thread")
def test_error_in_the_device_thread_comes_out(monkeypatch: pytest.MonkeyPatch):
    session = session_of(ESTOP)

    def broken(now_ns: int) -> None:
        raise RuntimeError("device is on fire")

    monkeypatch.setattr(session, "step_devices", broken)
    with pytest.raises(RuntimeError, match="on fire"):
        run_live(session, 60_000 * MS)


@pytest.mark.usefixtures("_leaves_no_thread")
def test_error_in_the_display_stops_the_threads():
    session = session_of(ESTOP)

    def broken(update: object) -> None:
        raise RuntimeError("no terminal")

    with pytest.raises(RuntimeError, match="no terminal"):
        run_live(session, 60_000 * MS, on_update=broken)
    before = session.core.snapshot().statistics.cycles
    session.core.cycle(time.monotonic_ns())  # refused while the cyclic thread runs
    assert session.core.snapshot().statistics.cycles == before + 1


# The child interrupts itself once the run is under way, however slow the machine is. A job in the
# background ignores the signal from birth on; Python then installs no handler of its own.
_MAIN = """\
import os, signal
import fsoe_net.project.simulate as command
from fsoe_net.cli.main import main

signal.signal(signal.SIGINT, signal.default_int_handler)
run_live = command.run_live

def interrupted(session, duration_ns, *, on_update=None, **options):
    def shown(*seen):
        if on_update is not None:
            on_update(*seen)
        os.kill(os.getpid(), signal.SIGINT)

    return run_live(session, duration_ns, on_update=shown, **options)

command.run_live = interrupted
main()
"""


def test_ctrl_c_prints_the_result():
    command = [sys.executable, "-c", _MAIN, "run", str(ESTOP / "network.yaml")]
    done = subprocess.run(
        [*command, "--duration", "600"], capture_output=True, text=True, check=False
    )
    assert "run: interrupted by the user" in done.stdout
    assert "bus cycles in" in done.stdout
    assert done.stderr == ""


def test_a_machine_that_stood_still_is_blamed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """The devices' thread is held up, as by a busy processor, for longer than the watchdog."""
    session = session_of(ESTOP)
    steps: list[int] = []
    step = session.step_devices

    def held_up(now_ns: int) -> None:
        steps.append(now_ns)
        if len(steps) == 5:
            time.sleep(0.25)  # the stall itself, not a wait for something
        step(now_ns)

    monkeypatch.setattr(session, "step_devices", held_up, raising=False)
    result = run_live(session, 600 * MS)
    assert result.stalled_ms >= 250
    for passed, said in ((False, True), (True, False)):
        print_result(replace(result, passed=passed))
        text = capsys.readouterr().out
        assert ("this machine stood still for " in text) is said
    assert ", longer than an FSoE watchdog (100 ms)" in _stall_text(result)
    assert _stall_text(replace(result, stalled_ms=99.0)) == ""
