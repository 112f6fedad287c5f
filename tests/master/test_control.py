"""The control socket: every request, leases, arming, events, and who may connect."""

from __future__ import annotations

import json
import os
import pwd
import re
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from master.rig import ROOT, Client, running
from tied import tied

ROLES = ("observer", "operator", "maintainer")
MODE = "drive_1.0x6060:00"  # int8, stop value 8
LAMP = "el2904.standard_1"
START = "el6910.logic_control"  # restart relevant


def test_requests_on_a_running_bus() -> None:
    with running() as master, master.client() as client:
        hello = client.good("hello")
        assert (hello["protocol"], hello["client"], hello["lease_ms"]) == (1, 1, 1000)
        assert "no safety function" in hello["role"]
        status = client.good("#a1 status")
        assert (status["tag"], status["state"], status["backend"]) == ("a1", "running", "emulated")
        assert status["subdevices"] == {"planned": 5, "in_op": 0, "missing": 0}
        assert (status["cycle_ns"], status["clients"]) == (1_000_000, 1)
        symbols = {s["name"]: s for s in client.good("symbols")["symbols"]}
        assert symbols[MODE] == {
            "name": MODE,
            "subdevice": "drive_1",
            "index": 0x6060,
            "subindex": 0,
            "direction": "output",
            "type": "signed",
            "bits": 8,
            "factor": 1,
            "offset": 0,
            "open": True,
            "restart_relevant": False,
            "stop_value": 8,
            "client": None,
        }
        assert symbols[START]["restart_relevant"] is True
        assert len(client.good("subdevices")["subdevices"]) == 5
        assert {line.split(":")[0].split()[0] for line in client.good("help")["requests"]} == {
            *("hello", "status", "snapshot", "subdevices", "symbols", "get", "set", "lease"),
            *("arm", "events", "start", "stop", "restart", "shutdown", "help", "layout", "watch"),
            *("hold", "resume", "realtime"),
            "incident",
            *("sdo-read", "sdo-write", "sii-read", "alias-write", "history", "scan"),
        }


def test_every_request_is_in_the_reference() -> None:
    page = ROOT / "docs" / "reference" / "control-protocol.md"
    if not page.is_file():
        pytest.skip("needs the source tree")
    text = page.read_text()
    with running() as master, master.client() as client:
        for usage in client.good("help")["requests"]:
            assert f"| `{usage.split(':')[0].split()[0]}" in text
        for document in (client.good("status"), client.good("hello"), client.good("layout")):
            for key in document:
                assert f"`{key}`" in text


def test_the_layout_of_the_reference_is_accepted() -> None:
    page = ROOT / "docs" / "reference" / "control-protocol.md"
    if not page.is_file():
        pytest.skip("needs the source tree")
    (layout,) = re.findall(
        r"LAYOUT is the version of the shared memory \((\d+)\)", page.read_text()
    )
    with running() as master, master.client() as client:
        assert client.good(f"realtime {layout} any 0")["layout"] == int(layout)
        client.refused(f"realtime {int(layout) - 1} any 0", "FSN_E_ARG")


def test_a_snapshot_is_whole() -> None:
    with running() as master, master.client() as client:
        snapshot = client.good("snapshot")
        statistics = snapshot["statistics"]
        for name in ("latency", "period", "work", "copy", "round_trip", "dc_offset"):
            histogram = statistics[name]
            assert sum(count for _, count in histogram["buckets"]) == histogram["count"]
            floors = [floor for floor, _ in histogram["buckets"]]
            assert floors == sorted(set(floors))
            if histogram["count"]:
                marks = [*histogram["percentiles_ns"].values(), histogram["max_ns"]]
                assert marks == sorted(marks)
        assert statistics["latency"]["count"] == statistics["cycles"]
        connections = snapshot["connections"]
        assert len(connections) == 4
        assert {c["state"] for c in connections} == {"silent"}
        assert connections[0]["to_sub"]["reset_text"] == ""
        assert len(snapshot["subdevices"]) == 5


def test_values_are_typed_and_all_or_none() -> None:
    with running() as master, master.client() as client:
        client.good("lease 0")
        assert client.value(MODE) == 8  # nobody writes it: its stop value
        client.good(f"set {MODE}=-3 {LAMP}=on")
        client.wait_for(MODE, -3)
        assert client.value(LAMP) is True
        assert "outside the range" in client.refused(f"set {LAMP}=off {MODE}=128", "FSN_E_ARG")
        client.refused(f"set {LAMP}=off nothing=1", "FSN_E_ARG")
        client.refused(f"set {LAMP}=off {LAMP}=on", "FSN_E_ARG")
        client.refused(f"set {LAMP}=off {START}=1", "FSN_E_CLOSED")
        assert client.value(LAMP) is True
        inputs = [s["name"] for s in client.good("symbols")["symbols"] if s["direction"] == "input"]
        assert "is an input" in client.refused(f"set {inputs[0]}=0", "FSN_E_CLOSED")


def test_an_output_belongs_to_one_client() -> None:
    with running() as master, master.client() as first, master.client() as second:
        second.good("events on")
        second.good("lease 0")
        first.good("lease 0")
        first.good(f"set {MODE}=1")
        assert "is written by client 1" in second.refused(f"set {MODE}=2", "FSN_E_CLOSED")
        second.good(f"set {LAMP}=on")
        owners = {s["name"]: s.get("client") for s in second.good("symbols")["symbols"]}
        assert (owners[MODE], owners[LAMP]) == (1, 2)
        first.close()
        event = second.event("fallback")
        assert (event["client"], event["why"], event["outputs"]) == (1, "disconnected", [MODE])
        second.wait_for(MODE, 8)
        second.good(f"set {MODE}=2")
        second.wait_for(MODE, 2)


@pytest.mark.shows("R20")
def test_silence_ends_a_lease_and_any_request_keeps_it() -> None:
    with running() as master, master.client() as client, master.client() as other:
        other.good("lease 0")
        other.good("events on")
        client.good("lease 600000")
        client.good(f"set {MODE}=1")
        client.good("lease 1")  # and not a word more
        event = other.event("fallback")
        assert (event["client"], event["why"], event["outputs"]) == (1, "silent", [MODE])
        other.wait_for(MODE, 8)
        assert client.good("hello")["client"] == 1  # it may go on
        for wrong in ("600001", "-1", "x", ""):
            client.refused(f"lease {wrong}", "FSN_E_ARG")


@pytest.mark.shows("R20")
def test_a_killed_client_loses_its_outputs() -> None:
    script = (
        "import socket, sys, time\n"
        "s = socket.socket(socket.AF_UNIX); s.connect(sys.argv[1])\n"
        f"s.sendall(b'lease 0\\nset {MODE}=5\\n')\n"
        "f = s.makefile(); f.readline(); f.readline()\n"
        "print(flush=True); time.sleep(600)\n"
    )
    with running() as master, master.client() as client:
        client.good("events on")
        with subprocess.Popen(
            tied(sys.executable, "-c", script, master.path), stdout=subprocess.PIPE
        ) as process:
            assert process.stdout is not None
            process.stdout.readline()
            client.wait_for(MODE, 5)
            process.send_signal(signal.SIGKILL)
        event = client.event("fallback")
        assert (event["pid"], event["outputs"]) == (process.pid, [MODE])
        client.wait_for(MODE, 8)
        assert master.logged("fallback")[0]["outputs"] == [MODE]


@pytest.mark.shows("R20")
def test_an_output_that_can_restart_a_machine_takes_one_edge() -> None:
    with running() as master, master.client() as client, master.client() as other:
        client.good("lease 0")
        other.good("events on")
        assert "not armed" in client.refused(f"set {START}=1", "FSN_E_CLOSED")
        client.refused(f"arm {MODE}", "FSN_E_ARG")
        client.good(f"arm {START}")
        assert other.event("arm")["output"] == START
        assert "armed by client 1" in other.refused(f"arm {START}", "FSN_E_CLOSED")
        client.good(f"set {START}=1")
        edge = other.event("edge")
        assert (edge["output"], edge["raw"], edge["uid"]) == (START, 1, os.geteuid())
        client.good(f"set {START}=0")
        client.refused(f"set {START}=1", "FSN_E_CLOSED")
        assert [e["event"] for e in master.logged("arm", "edge")][:2] == ["arm", "edge"]


def test_stop_start_restart() -> None:
    with running() as master, master.client() as client:
        client.good("events on")
        client.good("lease 0")
        client.good(f"set {MODE}=1")
        client.refused("start", "FSN_E_STATE")
        client.good("stop")
        assert client.event("fallback")["outputs"] == [MODE]
        states = [client.event("state")["state"] for _ in range(2)]
        assert states == ["stopping", "stopped"]
        for request in ("snapshot", f"get {MODE}", f"set {MODE}=1", f"arm {START}"):
            assert "stopped" in client.refused(request, "FSN_E_STATE")
        client.refused("stop", "FSN_E_STATE")
        assert client.good("status")["state"] == "stopped"
        client.good("start")
        while client.event("state")["state"] != "running":
            pass
        assert client.value(MODE) == 8
        before = client.good("status")["cycles"]
        assert before >= 0
        client.good("restart")
        seen = []
        while not seen or seen[-1] != "running":
            seen.append(client.event("state")["state"])
        assert [s for s in seen if s in ("stopping", "stopped", "opening")] == [
            *("stopping", "stopped", "opening"),
        ]
        client.good("shutdown")
        assert master.wait() == 0


def test_the_socket_is_for_its_owner() -> None:
    with running() as master:
        assert stat.S_IMODE(master.path.stat().st_mode) == 0o600


def as_nobody(path: str, *lines: str) -> str:
    script = (
        "import os, socket, sys\n"
        "os.setgroups([]); os.setgid(65534); os.setuid(65534)\n"
        "s = socket.socket(socket.AF_UNIX)\n"
        "try: s.connect(sys.argv[1])\n"
        "except PermissionError: print('no permission')\n"
        "else:\n"
        "    f = s.makefile('rwb'); f.write(sys.argv[2].encode())\n"
        "    try: f.flush()\n"
        "    except BrokenPipeError: pass\n"
        "    for _ in sys.argv[2].splitlines(): print(f.readline().decode(), end='')\n"
    )
    done = subprocess.run(
        [sys.executable, "-I", "-c", script, path, "".join(f"{w}\n" for w in lines or ("hello",))],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


@pytest.mark.skipif(os.geteuid() != 0, reason="becomes another user, which takes root")
def test_other_users_are_refused_unless_allowed() -> None:
    for options, answer in (
        ((), "no permission"),
        (("--allow-group", "daemon"), "may not connect"),
        (("--allow-user", "nobody"), '"ok":true'),
        (("--allow-group", "nogroup"), '"access":"observer"'),
        (("--allow-user", "nobody:operator"), '"access":"operator"'),
        (("--allow-user", "nobody", "--allow-group", "nogroup:maintainer"), '"maintainer"'),
    ):
        with running(*options) as master:
            master.directory.chmod(0o755)
            assert answer in as_nobody(str(master.path)), options
            if answer == "may not connect":
                (told,) = master.logged("turned_away")
                assert (told["uid"], told["user"], told["times"]) == (65534, "nobody", 1)
                assert told["program"] is not None


@pytest.mark.skipif(os.geteuid() != 0, reason="becomes another user, which takes root")
@pytest.mark.parametrize("role", ROLES)
def test_a_role_allows_what_the_reference_states(role: str) -> None:
    page = ROOT / "docs" / "reference" / "control-protocol.md"
    if not page.is_file():
        pytest.skip("needs the source tree")
    row = r"^\| `([\w-]+).*? \| (observer|operator|maintainer) \|"
    least = dict(re.findall(row, page.read_text(), re.MULTILINE))
    names = sorted(least, key=["restart", "stop", "start", "shutdown"].count)
    with running("--allow-user", f"nobody:{role}") as master, master.client() as root:
        master.directory.chmod(0o755)
        usages = root.good("help")["requests"]
        assert {usage.split(":")[0].split()[0] for usage in usages} == {*least}
        answers = [json.loads(a) for a in as_nobody(str(master.path), *names).splitlines()]
        asked = zip(names, answers, strict=True)
        refused = {n: a["error"] for n, a in asked if "only for" in a.get("text", "")}
        above = [n for n in names if ROLES.index(least[n]) > ROLES.index(role)]
        assert refused == dict.fromkeys(above, "FSN_E_CLOSED")


DROPPED = {
    "ok": False,
    "error": "FSN_E_BUSY",
    "text": "dropped: silent, and its place was needed for another client",
    "hint": "connect again when there is something to ask",
}


PLACES = 68


def closed(clients: list[Client]) -> None:
    for client in clients:
        client.close()


def test_too_many_clients() -> None:
    with running() as master:
        clients = [master.client() for _ in range(PLACES)]
        try:
            for client in clients:
                client.good("events on")  # who listens is not idle
            with master.client() as one_more:
                assert one_more.line() == {
                    "ok": False,
                    "error": "FSN_E_BUSY",
                    "text": "too many clients",
                    "hint": "close one of them",
                }
                with pytest.raises(EOFError):
                    one_more.line()
            clients.pop().close()
            while True:  # its place is free as soon as its end was seen
                with master.client() as one_more:
                    if one_more.ask("hello")["ok"]:
                        break
        finally:
            closed(clients)


@pytest.mark.shows("R26")
def test_idle_clients_lock_no_other_client_out() -> None:
    with running() as master, master.client() as other, master.client() as writer:
        other.good("events on")
        writer.good("lease 0")
        writer.good(f"set {MODE}=1")
        idle = [master.client() for _ in range(PLACES + 14)]
        try:
            first = other.event("dropped")
            assert first == {
                "event": "dropped",
                "utc": first["utc"],
                "level": "warning",
                "now_ns": first["now_ns"],
                "text": first["text"],
                "client": 3,
                "pid": os.getpid(),
                "uid": os.getuid(),
                "user": pwd.getpwuid(os.getuid()).pw_name,
                "program": Path("/proc/self/comm").read_text().strip(),
                "access": "maintainer",
                "why": "makes room",
                "times": 1,
            }
            assert idle[0].line() == DROPPED
            with pytest.raises(EOFError):
                idle[0].line()
            for client in idle[2 - PLACES :]:  # all places but those of the two that do something
                assert client.good("hello")["ok"]
            assert writer.value(MODE) == 1
        finally:
            closed(idle)


_IDLE = """
import os, socket, sys
os.setgroups([]); os.setgid(65534); os.setuid(65534)
idle = []
while True:
    idle.append(socket.socket(socket.AF_UNIX))
    idle[-1].connect(sys.argv[1])
    try:
        idle[-1].sendall(b"hello\\n")
    except BrokenPipeError:
        pass  # turned away already
    if len(idle) > 64:
        print(idle[-1].makefile().readline(), end="", flush=True)
        if input() == "end":
            break
        idle.pop()
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="becomes another user, which takes root")
def test_root_always_gets_in() -> None:
    """Of all places four are for root and the user of fsn-master."""
    with running("--allow-user", "nobody") as master:
        master.directory.chmod(0o755)
        words = tied(sys.executable, "-I", "-c", _IDLE, master.path)
        with subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as nobody:
            assert nobody.stdin is not None
            assert nobody.stdout is not None
            assert '"text":"too many clients"' in nobody.stdout.readline()
            clients = [master.client() for _ in range(4)]
            assert [c.good("status")["clients"] for c in clients][-1] == PLACES
            # Others wait until somebody has been silent for some seconds.
            answer = ""
            while '"ok":true' not in answer:
                nobody.stdin.write("again\n")
                nobody.stdin.flush()
                answer = nobody.stdout.readline()
            nobody.communicate("end\n")
            closed(clients)


@pytest.mark.shows("R26")
def test_busy_clients_take_no_cycle() -> None:
    """Every due cycle is run or counted as left out, whatever clients do."""
    ends = threading.Event()

    def ask(client: Client) -> None:
        while not ends.is_set():
            for request in ("snapshot", "symbols", "status", "nonsense"):
                client.ask(request)

    with running() as master, master.client() as client:
        busy = [master.client() for _ in range(20)]
        threads = [threading.Thread(target=ask, args=(one,), daemon=True) for one in busy]
        before = client.good("snapshot")["statistics"]
        for thread in threads:
            thread.start()
        after = before
        while after["cycles"] < before["cycles"] + 500:
            after = client.good("snapshot")["statistics"]
        ends.set()
        for thread, one in zip(threads, busy, strict=True):
            thread.join()
            one.close()
        due = (after["now_ns"] - before["now_ns"]) / 1_000_000
        counted = sum(after[k] - before[k] for k in ("cycles", "overruns"))
        # A wake-up may be late by less than a cycle at either end, and one cycle is under way.
        assert abs(counted - due) < 3
