"""``scan`` and ``check`` with a bus: who is asked, what is said before, what comes out.

The bus is a program in place of fsn-master that prints a document, or a socket that answers.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import PLAIN
from scans import scan_of

from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import resolve

ROOT = Path(__file__).parents[2]
NETWORK = PLAIN / "el6910" / "network.yaml"


def document() -> dict:
    network = load_network([NETWORK]).network
    assert network is not None
    return scan_of(resolve(network))


class Bus:
    """A folder with a program in place of fsn-master, and an environment that finds only it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.env = os.environ | {
            "FSN_MASTER": str(folder / "fsn-master"),
            "XDG_RUNTIME_DIR": str(folder),
            "TMPDIR": str(folder),
        }
        self.env.pop("RUNTIME_DIRECTORY", None)
        self.program(json.dumps(document()))

    def program(self, out: str, err: str = "", code: int = 0) -> None:
        (self.folder / "out").write_text(out, "utf-8")
        (self.folder / "err").write_text(err, "utf-8")
        path = self.folder / "fsn-master"
        path.write_text(
            f"#!/bin/sh\necho \"$@\" >> '{self.folder}/asked'\n/bin/cat '{self.folder}/out'\n"
            f"/bin/cat '{self.folder}/err' >&2\nexit {code}\n",
            "utf-8",
        )
        path.chmod(0o755)

    @property
    def asked(self) -> str:
        path = self.folder / "asked"
        return path.read_text("utf-8") if path.exists() else ""

    def fsn(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return fsn(*arguments, cwd=self.folder, env=self.env)

    @contextlib.contextmanager
    def master(self, *, interface: str = "eth1", name: str = "fsn-master-eth1.sock", **scan):
        """Serve a socket as a running fsn-master does."""
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        asked: list[str] = []
        answers = {
            "hello": {"ok": True, "program": "fsn-master", "protocol": 1},
            "status": {"ok": True, "interface": interface},
            "scan": {"ok": True} | document() | {"states_changed": False} | scan,
        }
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(path))
            listener.listen()

            def serve() -> None:
                with contextlib.suppress(OSError):
                    while True:
                        peer, _ = listener.accept()
                        with peer, peer.makefile("rb") as lines:
                            for line in lines:
                                asked.append(line.decode().strip())
                                peer.sendall(json.dumps(answers[asked[-1]]).encode() + b"\n")

            thread = threading.Thread(target=serve, daemon=True)
            thread.start()
            yield asked
            listener.shutdown(socket.SHUT_RDWR)
            thread.join()
        path.unlink()


@pytest.fixture
def bus() -> Iterator[Bus]:
    folder = Path(tempfile.mkdtemp(prefix="fsn-"))  # the path of a socket must be short
    yield Bus(folder)
    shutil.rmtree(folder)


def test_own_scan_states_before_what_it_does_and_prints_a_table(bus: Bus):
    done = bus.fsn("scan", "--interface", "eth1", "--yes")
    assert done.returncode == 0, done.stderr
    assert "every SubDevice on it goes to PREOP" in done.stderr
    assert bus.asked == "--scan --log json --interface eth1\n"
    rows = [line.split() for line in done.stdout.splitlines()]
    assert rows[0][:3] == ["pos", "name", "vendor"]
    assert done.stdout.splitlines()[-1] == "eth1: 6 SubDevices, brought to PREOP"
    assert "0x07703052" in done.stdout
    assert "address 101" in done.stdout
    assert "0xe921: FSoE address 201, ConnID 3, watchdog 100 ms" in done.stdout


def test_nothing_happens_without_a_person_to_ask(bus: Bus):
    done = bus.fsn("scan", "--interface", "eth1")
    assert done.returncode == 2
    assert "--yes" in done.stderr
    assert bus.asked == ""


def test_no_bus_named(bus: Bus):
    done = bus.fsn("scan")
    assert (done.returncode, "--interface IF" in done.stderr) == (2, True)


@pytest.mark.parametrize("name", ["fsn-master-eth1.sock", "fsoe-net-x/control.sock"])
def test_a_running_master_is_asked_and_no_state_changes(bus: Bus, name: str):
    with bus.master(name=name) as asked:
        done = bus.fsn("scan", "--interface", "eth1")
    assert done.returncode == 0, done.stderr
    assert "no SubDevice changes its state" in done.stderr
    assert done.stdout.splitlines()[-1] == "eth1: 6 SubDevices, no state was changed"
    assert asked[-1] == "scan"
    assert bus.asked == ""


def test_a_master_of_another_bus_is_left_alone(bus: Bus):
    with bus.master(interface="eth9", name="fsoe-net-x/control.sock") as asked:
        done = bus.fsn("scan", "--interface", "eth1", "--yes")
        named = bus.fsn("scan", "--interface", "eth1", "--socket", "fsoe-net-x/control.sock")
    assert done.returncode == 0
    assert "scan" not in asked
    assert bus.asked == "--scan --log json --interface eth1\n"
    assert named.returncode == 3
    assert "drives eth9, not eth1" in named.stderr


def test_a_dead_socket_is_passed_over(bus: Bus):
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(bus.folder / "fsn-master-eth1.sock"))
    assert bus.fsn("scan", "--interface", "eth1", "--yes").returncode == 0
    assert bus.asked


def test_refusal_and_misuse_and_machine(bus: Bus):
    said = {"event": "log", "level": "error"}
    refusal = json.dumps(said | {"text": "another MainDevice talks on eth1"}) + "\n"
    permission = json.dumps(said | {"text": "setcap cap_net_raw"}) + "\n"
    for code, err, expected, words in (
        (1, refusal, 1, "another MainDevice talks on eth1"),
        (2, "fsn-master: unknown option --scan\n", 3, "install fsoe-net and fsn-master of one"),
        (3, permission, 3, "setcap cap_net_raw"),
        (77, "", 3, "ended with 77"),
    ):
        bus.program("", err, code)
        done = bus.fsn("scan", "--interface", "eth1", "--yes")
        assert (done.returncode, words in done.stderr) == (expected, True), done.stderr


def test_a_document_that_cannot_be_read(bus: Bus):
    bus.program("{")
    done = bus.fsn("scan", "--interface", "eth1", "--yes")
    assert done.returncode == 3
    assert "cannot be read" in done.stderr


def test_json_is_the_document(bus: Bus):
    done = bus.fsn("scan", "--interface", "eth1", "--yes", "--format", "json")
    assert json.loads(done.stdout) == document()


def test_files_are_written_once(bus: Bus):
    done = bus.fsn("scan", "--interface", "eth1", "--yes", "-o", "found")
    assert done.returncode == 0, done.stderr
    assert "6 files in found" in done.stderr
    checked = bus.fsn("check", "found/network.yaml", "--scan", "found/scan.json")
    assert [r for r in checked.stdout.splitlines() if "[FSN5" in r] == []
    assert "FSN125" in checked.stdout
    again = bus.fsn("scan", "--interface", "eth1", "--yes", "-o", "found")
    assert again.returncode == 1
    assert "--overwrite" in again.stderr
    more = bus.fsn("scan", "--interface", "eth1", "--yes", "-o", "found", "--overwrite")
    assert more.returncode == 0
    lone = bus.fsn("scan", "--interface", "eth1", "--yes", "--overwrite")
    assert lone.returncode == 2


def test_check_with_a_clean_bus(bus: Bus):
    done = bus.fsn("check", str(NETWORK), "--interface", "eth1", "--yes")
    assert done.returncode == 0, done.stdout
    assert ": no findings, " in done.stdout
    assert " on the bus" in done.stdout


def test_check_names_each_difference(bus: Bus):
    rows = document()
    rows["subdevices"][2]["fsoe"]["address"] = 7
    (bus.folder / "scan.json").write_text(json.dumps(rows), "utf-8")
    file = bus.fsn("check", str(NETWORK), "--scan", "scan.json", "--format", "json")
    with bus.master(subdevices=rows["subdevices"]):
        live = bus.fsn("check", str(NETWORK), "--interface", "eth1", "--format", "json")
    assert (file.returncode, live.returncode) == (1, 1)
    assert json.loads(file.stdout) == json.loads(live.stdout)
    (found,) = [d for d in json.loads(file.stdout)["diagnostics"] if d["severity"] != "info"]
    assert (found["code"], found["line"]) == ("FSN508", 42)


def test_check_refuses_what_cannot_be_compared(bus: Bus):
    (bus.folder / "scan.json").write_text("{", "utf-8")
    damaged = bus.fsn("check", str(NETWORK), "--scan", "scan.json")
    assert damaged.returncode == 1
    assert "scan.json:1:2" in damaged.stderr + damaged.stdout
    both = bus.fsn("check", str(NETWORK), "--scan", "scan.json", "--interface", "eth1")
    assert both.returncode == 2
    (bus.folder / "scan.json").write_text(json.dumps(document()), "utf-8")
    part = bus.fsn("check", str(NETWORK.parent / "devices/el1904.yaml"), "--scan", "scan.json")
    assert part.returncode == 1
    assert "whole network" in part.stderr
