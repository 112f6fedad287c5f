"""Clients in the cycle of a running ``fsn-master``: Python, C and C++, and those that misbehave."""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from master import rig
from master.kill_clients import HOW, LAMP, MODE, kill_clients
from networks import EXAMPLES
from patience import PATIENCE_S
from tied import tied

import fsoe_net
from fsoe_net import ControlRefused, EnvironmentFault
from fsoe_net.live.client import Client
from fsoe_net.live.realtime import RealTime

START = "el6910.logic_control"


def to_the_end(realtime: RealTime) -> None:
    """Wait for cycles until there are none."""
    while True:
        realtime.wait(PATIENCE_S)


def enter(client: Client) -> None:
    """Enter the cycle again and again."""
    while True:
        client.realtime().close()


@pytest.fixture(scope="module")
def master() -> Iterator[rig.Master]:
    with rig.running() as found:
        yield found


@pytest.fixture
def client(master: rig.Master) -> Iterator[Client]:
    with fsoe_net.connect(str(master.path)) as found:
        yield found


def test_values_by_name(client: Client) -> None:
    with client.realtime("drive_1.*", LAMP, misses=1000) as realtime:
        assert realtime.cycle_ns == 1_000_000
        first = realtime.wait(PATIENCE_S)
        assert first.skipped == 0
        assert 0 < first.next_ns - first.now_ns <= 1_000_000
        realtime[MODE] = -3
        realtime[LAMP] = True
        assert realtime.sent(MODE) == 8  # what is there now
        realtime.send()
        while realtime.sent(MODE) != -3:
            realtime.wait(PATIENCE_S)
        assert realtime.sent(LAMP) is True
        assert client.get(MODE, LAMP).outputs == {MODE: -3, LAMP: True}
        symbol = realtime.outputs[MODE]
        assert (symbol.kind, symbol.bits, symbol.owned) == ("signed", 8, True)
        assert realtime.image[symbol.bit_offset // 8] == 0xFD
        with pytest.raises(ValueError, match="8 bits signed: 128"):
            realtime[MODE] = 128
        with pytest.raises(ValueError, match=r"8 bits signed: 1000\.0"):
            realtime[MODE] = 1000.0
        with pytest.raises(ControlRefused, match="not an output of this client"):
            realtime[START] = 1
        with pytest.raises(KeyError):
            realtime["nothing"]
        counts = realtime.counts()
        assert counts.on_time + counts.late == 1
        (seen,) = client.status().in_cycle
        assert (seen.misses, seen.state, seen.on_time + seen.late) == (1000, "runs", 1)
        assert seen.outputs == len([s for s in realtime.outputs.values() if s.owned])
    while client.status().in_cycle:
        pass
    while client.get(MODE).outputs[MODE] != 8:
        pass
    with pytest.raises(ValueError, match="has left the cycle"):
        realtime.wait()


def test_a_view_of_numpy(client: Client) -> None:
    pytest.importorskip("numpy")
    with client.realtime(MODE, misses=1000) as realtime:
        view = realtime.view(outputs=True)
        assert LAMP not in view.dtype.names  # one bit
        realtime.wait(PATIENCE_S)
        assert view[MODE] == 8
        realtime[MODE] = 5
        realtime.send()
        while realtime.wait(PATIENCE_S) and realtime.sent(MODE) != 5:
            pass
        assert view[MODE] == 5  # no copy
        with pytest.raises(ValueError, match="read-only"):
            view[MODE] = 1


def test_rejected_clients(client: Client) -> None:
    plan = client.status().plan_sha256
    client.realtime(plan_sha256=plan).close()
    with pytest.raises(ControlRefused, match=r"was made for plan 00.*build it for this plan"):
        client.realtime(plan_sha256="00" * 32)
    with pytest.raises(ControlRefused, match="can restart a machine"):
        client.realtime(START)
    with pytest.raises(ControlRefused, match="0 to 1000 cycles"):
        client.realtime(misses=-1)
    with pytest.raises(EnvironmentFault, match="is fsn-master running"):
        RealTime("/no/such")


@pytest.mark.shows("R20")
def test_a_late_client_has_to_join_again(client: Client) -> None:
    client.subscribe()
    with client.realtime(MODE, misses=0) as realtime:
        realtime.wait(PATIENCE_S)
        realtime[MODE] = 1
        realtime.send()
        with pytest.raises(ControlRefused, match="were taken back"):
            to_the_end(realtime)
        events = client.events(PATIENCE_S)
        while not any(e["event"] == "fallback" for e in events):
            events = client.events(PATIENCE_S)
        (fallback,) = [e for e in events if e["event"] == "fallback"]
        assert (fallback["why"], fallback["outputs"]) == ("late", [MODE])
        assert client.get(MODE).outputs[MODE] == 8
        client.set({MODE: 2})  # it is free again


@pytest.mark.shows("R20", "R26")
def test_clients_that_misbehave_and_are_killed() -> None:
    moved = kill_clients(len(HOW), seed=7)
    assert moved["run"] == 1
    assert moved["on_time"] + moved["late"] > 0


def test_a_stop_and_the_end() -> None:
    with rig.running() as master, fsoe_net.connect(str(master.path)) as client:
        with client.realtime() as realtime:
            realtime.wait(PATIENCE_S)
            client.stop()
            with pytest.raises(EnvironmentFault, match="the bus was stopped"):
                to_the_end(realtime)
        with pytest.raises(ControlRefused, match="the bus is stopped"):
            enter(client)
        client.start()
        while client.status().state != "running":
            pass
        with client.realtime() as realtime:
            realtime.wait(PATIENCE_S)
            master.process.kill()
            with pytest.raises(EnvironmentFault, match="has ended"):
                to_the_end(realtime)


def test_an_observer_is_not_in_the_cycle(master: rig.Master) -> None:
    if os.geteuid() != 0:
        pytest.skip("needs root, to be somebody else")
    nobody = pwd.getpwuid(rig.NOBODY).pw_name
    with rig.running("--allow-user", f"{nobody}:observer") as other:
        os.chmod(other.directory, 0o711)
        script = (
            "import os, socket, sys\n"
            f"os.setuid({rig.NOBODY})\n"
            "s = socket.socket(socket.AF_UNIX); s.connect(sys.argv[1])\n"
            "s.sendall(b'realtime 2 any 3\\n'); print(s.recv(4096).decode())\n"
        )
        command = tied(shutil.which("python3") or "python3", "-c", script, other.path)
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert "only for the role operator; this client is observer" in done.stdout


@pytest.mark.parametrize(("language", "program"), [("c11", "cc"), ("c++17", "g++")])
def test_the_example_in_c_and_c_plus_plus(
    client: Client, tmp_path: Path, language: str, program: str
) -> None:
    if shutil.which(program) is None or shutil.which("cc") is None:
        pytest.skip(f"no {program}")
    core = rig.ROOT / "master_core"
    include = ["-I", core / "include"]
    library = ["cc", "-c", core / "src/client/client.c", "-I", core / "src", *include]
    words = [program, "-x", "c" if language == "c11" else "c++", EXAMPLES / "clients/follow.c"]
    warnings = ["-Wall", "-Wextra", "-Werror", "-Wpedantic", f"-std={language}"]
    for command in (
        [*library, "-o", tmp_path / "client.o"],
        [*words, *warnings, *include, "-x", "none", tmp_path / "client.o", "-o", tmp_path / "a"],
    ):
        subprocess.run([str(word) for word in command], check=True)
    name = next(s.name for s in client.symbols() if not s.is_output)
    run = [tmp_path / "a", client.path, name, MODE, "20"]
    end = time.monotonic() + PATIENCE_S
    taken_back = True
    while taken_back and time.monotonic() < end:  # three cycles without a turn are a busy machine
        done = subprocess.run(list(map(str, run)), capture_output=True, text=True, check=False)
        taken_back = done.stderr == "follow: the outputs were taken back\n"
    assert (done.returncode, done.stderr) == (0, "")
    assert " outputs in time, " in done.stdout
    wrong = subprocess.run(
        [str(tmp_path / "a"), client.path, name, START], capture_output=True, text=True, check=False
    )
    assert wrong.returncode == 1
    assert "can restart a machine" in wrong.stderr
