"""The control client against a socket that answers as told; nothing may hang or surprise."""

import contextlib
import json
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from fsoe_net.errors import ControlRefused, EnvironmentFault, InputError
from fsoe_net.live.client import Client
from fsoe_net.live.control_link import quoted
from fsoe_net.live.master import Master, find_master

HELLO = {"ok": True, "program": "fsn-master", "protocol": 1}


@pytest.fixture
def folder():
    path = Path(tempfile.mkdtemp(prefix="fsn-"))  # the path of a socket must be short
    yield path
    shutil.rmtree(path)


@contextlib.contextmanager
def server(folder, *answers):
    """Answer each line with the next of the answers; then close."""
    path = folder / "s"
    asked = []
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()

        def serve():
            peer, _ = listener.accept()
            with peer, peer.makefile("rb") as lines:
                for answer in answers:
                    asked.append(lines.readline())
                    with contextlib.suppress(OSError):
                        peer.sendall(answer)
                if answers[-1] == b"":
                    lines.readline()  # stay, and say nothing, until the client goes

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield path, asked
        thread.join()


def line(document):
    return json.dumps(document).encode() + b"\n"


def test_missing_socket_is_reported(folder):
    with pytest.raises(EnvironmentFault, match="is fsn-master running"):
        Client(folder / "none")
    with pytest.raises(EnvironmentFault):
        Client(folder / ("x" * 300))


def test_requests_and_refusals(folder):
    refusal = {"ok": False, "error": "FSN_E_STATE", "text": "stopped", "hint": "send start first"}
    answers = [line(HELLO), line({"ok": True, "n": 1}), line(refusal)]
    with server(folder, *answers) as (path, asked):
        with Client(path) as client:
            assert client.request("get", "a b", 'c"d\\')["n"] == 1
            with pytest.raises(ControlRefused, match="stopped; send start first") as caught:
                client.snapshot()
        assert caught.value.status == "FSN_E_STATE"
    assert asked == [b"hello\n", b'get "a b" "c\\"d\\\\"\n', b"snapshot\n"]


def test_events_come_between_replies(folder):
    event = {"event": "state", "text": "ready"}
    answers = [line(event) + line(HELLO), line({"ok": True}) + line(event | {"text": "two"})]
    with server(folder, *answers) as (path, _), Client(path) as client:
        client.subscribe()
        told = client.events(5.0)
        while len(told) < 2:
            told += client.events(5.0)
    assert [e["text"] for e in told] == ["ready", "two"]


def test_a_flood_is_bounded_and_counted(folder, monkeypatch):
    """The oldest are dropped; what is dropped is told, events and watched cycles apart."""
    monkeypatch.setattr("fsoe_net.live.control_link._MAX_EVENTS", 3)
    told = b"".join(
        line({"event": kind, "cycle": n, "now_ns": n}) for n in range(5) for kind in ("x", "image")
    )
    with server(folder, told + line(HELLO)) as (path, _):
        client = Client(path)
        assert [e["cycle"] for e in client._wait_cycles(0.0)[0]] == [2, 3, 4]
        assert [e["cycle"] for e in client.events()] == [2, 3, 4]
        assert client.events_lost == 2
        # Now nothing is left, and the server is gone.
        for ask in (lambda: client.events(5.0), lambda: client._wait_cycles(5.0)):
            with pytest.raises(EnvironmentFault, match="has closed it"):
                ask()
        client.close()


def test_events_before_the_end_are_still_reported(folder):
    told = line({"event": "image", "cycle": 1, "now_ns": 1}) + line({"event": "state"})
    with server(folder, line(HELLO) + told) as (path, _):
        client = Client(path)
        assert [e["event"] for e in client.events(5.0)] == ["state"]
        cycles, lost = client._wait_cycles(5.0)
        assert ([c["cycle"] for c in cycles], lost) == ([1], 0)
        client.close()


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ([line(HELLO | {"protocol": 2})], "uses protocol 2"),
        ([b"what?\n"], "not JSON"),
        ([b"[]\n"], "not a JSON object"),
        ([b'{"ok":'], "has closed it"),
        ([b"x" * ((16 << 20) + (1 << 17))], "broke: a line without an end"),
        ([line({"ok": False, "text": "this user may not connect"})], "may not connect"),
    ],
)
def test_invalid_server_is_reported(folder, answers, message):
    with server(folder, *answers) as (path, _), pytest.raises(EnvironmentFault, match=message):
        Client(path)


def test_a_silent_server_does_not_hang(folder):
    with server(folder, line(HELLO), b"") as (path, _):
        client = Client(path, timeout_s=0.2)
        with pytest.raises(EnvironmentFault, match="has not answered status within"):
            client.request("status")
        with pytest.raises(EnvironmentFault):  # a late reply must not answer the next request
            client.request("status")


@pytest.mark.parametrize("reply", [{"ok": True}, {"ok": True, "subdevices": [{"name": 1}]}])
def test_a_reply_of_another_version(folder, reply):
    with (
        server(folder, line(HELLO), line(reply)) as (path, _),
        Client(path) as client,
        pytest.raises(EnvironmentFault, match="of one version"),
    ):
        client.subdevices()


def test_words_no_request_can_hold():
    assert quoted("") == '""'
    with pytest.raises(ValueError, match="control character"):
        quoted("a\nshutdown")


def program(folder, text):
    """Return a stand-in for fsn-master."""
    path = folder / "fsn-master"
    path.write_text(f"#!{sys.executable}\n{text}", "utf-8")
    path.chmod(0o755)
    return str(path)


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        (
            """import sys; print('{"event":"state","level":"error","text":"no bus"}',
                                 file=sys.stderr); sys.exit(1)""",
            InputError,
            "no bus",
        ),
        ("import sys; sys.exit('fsn-master: --x: unknown')", InputError, "--x: unknown"),
        (
            "import sys; print('fsn-master: --x: what', file=sys.stderr); sys.exit(2)",
            EnvironmentFault,
            "does not take its options: --x: what",
        ),
        (
            """import sys; print('{"event":"log","level":"error","text":"it takes: setcap x"}',
                                 file=sys.stderr); sys.exit(3)""",
            EnvironmentFault,
            "it takes: setcap x",
        ),
        ("import os; os.kill(os.getpid(), 11)", EnvironmentFault, "killed by SIGSEGV"),
        ("", EnvironmentFault, "ended from outside"),
    ],
)
def test_a_master_that_ends(folder, monkeypatch, text, error, message):
    monkeypatch.setenv("FSN_MASTER", program(folder, text))
    with Master(b"plan", []) as master:
        with pytest.raises(error, match=message):
            master.connect()
        assert master.socket.parent.exists()
    assert not master.socket.parent.exists()


def test_a_master_that_cannot_be_started(folder, monkeypatch):
    path = program(folder, "")
    Path(path).write_text("#!/no/such/interpreter\n", "utf-8")
    monkeypatch.setenv("FSN_MASTER", path)
    said = f"^{re.escape(path)} cannot be started: No such file or directory$"
    with pytest.raises(EnvironmentFault, match=said):
        Master(b"plan", [])


BOUND = """
import os, signal, socket, sys, time
path = sys.argv[sys.argv.index("--socket") + 1]
signal.signal(signal.SIGTERM, signal.SIG_IGN)
if {binds}:
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path)
print("T info ready", file=sys.stderr, flush=True)
time.sleep(600)
"""


@pytest.mark.parametrize(("binds", "message"), [(True, "no answer on"), (False, "has not opened ")])
def test_a_master_that_never_answers_is_killed(folder, monkeypatch, binds, message):
    monkeypatch.setenv("FSN_MASTER", program(folder, BOUND.format(binds=binds)))
    monkeypatch.setattr("fsoe_net.live.master._CONNECT_S", 1.0)
    with Master(b"plan", []) as master:
        while not master._lines:  # from now on it does not listen to SIGTERM
            assert not master.ended(0.01)
        with pytest.raises(EnvironmentFault, match=message):
            master.connect()
        monkeypatch.setattr("fsoe_net.live.master._STOP_S", 0.1)
    assert master._process.returncode == -signal.SIGKILL


def test_a_master_of_the_path(folder, monkeypatch):
    path = program(folder, "")
    monkeypatch.delenv("FSN_MASTER", raising=False)
    monkeypatch.setattr(sys, "executable", str(folder / "elsewhere" / "python"))
    monkeypatch.setenv("PATH", str(folder))
    assert find_master() == path


def test_the_command_stays_quick():
    """`fsoe-net check` needs nothing of a live bus."""
    code = "import sys, fsoe_net.cli.check; sys.exit('fsoe_net.live.client' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
