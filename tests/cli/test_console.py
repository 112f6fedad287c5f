"""`fsoe-net console` as a user starts it: scripts, exit codes, a prompt on a terminal."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time

import pytest
from cli.tool import fsn
from patience import PATIENCE_S
from tied import tied

from fsoe_net.testing.fake_master import FakeMaster

CONSOLE = [sys.executable, "-m", "fsoe_net.cli", "console"]


@pytest.fixture
def master():
    with FakeMaster() as found:
        yield found


def console(master, *arguments, text=None):
    command = [*CONSOLE, "--socket", str(master.path), *arguments]
    done = subprocess.run(command, input=text or "", capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, done.stdout, done.stderr


def test_commands_of_the_line(master):
    assert console(master, "-c", "set drive_1 0x6040 6; get drive_1.0x6040; start") == (
        0,
        "1 set: drive_1.0x6040:00\ndrive_1.0x6040:00  6  0x0006\nalready running\n",
        "this is the end: 1 output falls back to stop values: drive_1.0x6040:00\n",
    )


def test_a_script_names_where_it_failed(master, tmp_path):
    path = tmp_path / "a.fsn"
    path.write_text("echo drive_1\nget drive_1.0x6041\n\n  get drive_9; echo no\n", "utf-8")
    code, out, err = console(master, "--run", str(path))
    assert (code, out) == (1, "drive_1\ndrive_1.0x6041:00  39  0x0027\n")
    assert err.startswith(f"error: {path}:4:3: no input or output is called drive_9")


def test_standard_input_is_a_script(master):
    code, out, err = console(master, text="# a\n\necho a; quit\necho b\n")
    assert (code, out, err) == (0, "a\n", "")
    code, out, err = console(master, text="on-error continue\nget nothing\necho b\n")
    assert (code, out) == (1, "b\n")
    assert err == "error: stdin:2:1: no input or output is called nothing; list shows the names\n"


def test_standard_input_of_any_bytes(master):
    command = [*CONSOLE, "--socket", str(master.path)]
    done = subprocess.run(command, input=b"echo a\n\xff\n", capture_output=True, check=False)
    assert (done.returncode, done.stdout) == (2, b"a\n")
    assert done.stderr == b"error: stdin:2: no UTF-8 text\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-c", "stat"], r"error: -c:1:1: unknown command stat; did you mean"),
        (["-c", "echo 'a"], r"error: -c:1:6: this quote ' has no end"),
        (["-c", "state", "--run", "x"], "exclude each other"),
        (["x"], "unexpected extra argument"),
        (["--lease", "-1"], "--lease"),
    ],
)
def test_console_reports_usage_errors(master, arguments, message):
    code, out, err = console(master, *arguments)
    assert (code, out) == (2, "")
    assert re.search(message, err)


def test_a_script_that_cannot_be_read(master):
    code, out, err = console(master, "--run", "/no/such")
    assert (code, out) == (1, "")
    assert err.startswith("error: /no/such: No such file")


def test_missing_socket_has_exit_code_3(tmp_path):
    done = fsn("console", "--socket", str(tmp_path / "no"), "-c", "state")
    assert done.returncode == 3
    assert "is fsn-master running" in done.stderr
    assert fsn("console").returncode == 2


def test_a_lost_connection_ends_a_script(master):
    process = subprocess.Popen(
        [*tied(*CONSOLE), "--socket", str(master.path), "-c", "echo a; wait 1h"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "a\n"
    master.close()
    _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 3
    assert err.startswith("error: -c:1:9: the connection to ")


def test_ctrl_c_ends_a_script(master):
    process = subprocess.Popen(
        [*tied(*CONSOLE), "--socket", str(master.path), "-c", "set drive_1 0x6040 1; wait 1h"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert "1 output falls back to stop values: drive_1.0x6040:00\n" in err
    assert err.endswith("interrupted\n")


class Terminal:
    """A console on a pseudo terminal."""

    def __init__(self, path, home):
        self.process_id, self._fd = pty.fork()
        if self.process_id == 0:
            os.environ.update(XDG_STATE_HOME=str(home), TERM="dumb")
            os.execv(CONSOLE[0], [*CONSOLE, "--socket", str(path)])
        self.seen = ""

    def send(self, text):
        os.write(self._fd, text.encode())

    def until(self, text, again=""):
        """Wait for a text and return what stood before it; what is pressed again meanwhile."""
        end = time.monotonic() + PATIENCE_S
        while text not in self.seen:
            assert time.monotonic() < end, self.seen
            if select.select([self._fd], [], [], 5.0)[0]:
                with contextlib.suppress(OSError):
                    self.seen += os.read(self._fd, 4096).decode()
            elif again:
                self.send(again)
        before, _, self.seen = self.seen.partition(text)
        return before

    def end(self):
        self.send("quit\n")
        with contextlib.suppress(OSError):
            while os.read(self._fd, 4096):
                pass
        _, status = os.waitpid(self.process_id, 0)
        os.close(self._fd)
        return os.waitstatus_to_exitcode(status)


def test_prompt_completes_names_and_keeps_a_private_history(master, tmp_path):
    terminal = Terminal(master.path, tmp_path)
    terminal.until("fsn> ")
    terminal.send("set drive_1.0x604\t 7\n")  # completed
    terminal.until("1 set: drive_1.0x6040:00")
    terminal.send("stat\n")
    terminal.until("did you mean state?")
    assert terminal.end() == 0
    history = tmp_path / "fsoe-net" / "console_history"
    assert history.stat().st_mode & 0o777 == 0o600
    assert "stat\n" in history.read_text("utf-8")


# Where Ctrl-C meets what counts lines, a lock of that stays closed.
@pytest.mark.uncounted
def test_ctrl_c_at_the_prompt_ends_the_command_only(master, tmp_path):
    terminal = Terminal(master.path, tmp_path)
    terminal.until("fsn> ")
    terminal.send("wait 1h\n")
    terminal.until("\n")
    terminal.send("\x03")  # which may come before the command has begun
    terminal.until("fsn> ", again="\x03")
    terminal.send("echo still here\n")
    terminal.until("\r\nstill here")
    assert terminal.end() == 0


def test_the_prompt_survives_a_restart_of_fsn_master(master, tmp_path):
    terminal = Terminal(master.path, tmp_path)
    terminal.until("fsn> ")
    master.close()
    terminal.send("state\n")
    terminal.until("fsn> ")
    terminal.send("state\n")
    terminal.until("error: ")
    master.path.unlink()
    again = FakeMaster(master.path)
    terminal.send("\nstate\n")
    terminal.until("running, cycle 1 ms")
    terminal.until("connected again")
    assert terminal.end() == 0
    again.close()
