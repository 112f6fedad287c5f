"""Cases of `live_rig.py` with ``fsoe-net test-record --live`` beside the run, at a terminal."""

from __future__ import annotations

import os
import pty
import select
import signal
import subprocess
import sys
from pathlib import Path

from live.live_rig import CASES, FSN, Emulator, Running, main


class AtTerminal:
    """A program at a pseudo terminal, and a person who reads it and writes."""

    def __init__(self, *words):
        self._end, other = pty.openpty()
        self.process = subprocess.Popen(
            [*FSN, *map(str, words)],
            stdin=other,
            stdout=other,
            stderr=other,
            start_new_session=True,
        )
        os.close(other)
        self.told = ""
        self._read = 0

    def until(self, *texts):
        """Return the first of the texts that comes, from where reading has come to."""
        while True:
            new = self.told[self._read :]
            found = [(new.index(text), text) for text in texts if text in new]
            if found:
                place, text = min(found)
                self._read += place + len(text)
                return text
            if not self._more():
                return ""

    def _more(self):
        """Wait for more of it; False once the program has ended."""
        try:
            got = os.read(self._end, 1 << 16)
        except OSError:
            return False
        self.told += got.decode("utf-8", "replace")
        return bool(got)

    def write(self, text):
        os.write(self._end, text.encode())

    def press_ctrl_c(self):
        """Press it again while nothing comes: one just before it reads is seen at the next."""
        self.process.send_signal(signal.SIGINT)
        while not select.select([self._end], [], [], 5.0)[0]:
            self.process.send_signal(signal.SIGINT)

    def ended(self):
        while self._more():
            pass
        code = self.process.wait()
        os.close(self._end)
        return {"code": code, "told": self.told.replace("\r\n", "\n")}


def started(running, network):
    where = ("--live", "--socket", running.socket, "-o", "test-record.yaml", "--overwrite")
    return AtTerminal("test-record", network, *where)


ASKED, TAKE, PUT = "leave this step out: ", "off the bus now.", "Put "


def loss(terminal, emulator):
    """Do one loss as it is asked; False when no more comes."""
    found = terminal.until(ASKED)
    while found == ASKED:  # again where the bus has failed by itself meanwhile
        name = terminal.told.rpartition("write ")[2].split()[0]
        terminal.write(name + "\n")
        found = terminal.until(TAKE, ASKED)
    if found == TAKE:
        emulator.do(f"break {name}")
        if terminal.until(PUT, ASKED) != PUT:
            sys.exit(f"not put back: {terminal.told}")
        emulator.do(f"heal {name}")
    return found == TAKE


def text():
    return Path("test-record.yaml").read_text("utf-8")


def whole(network, other):
    """Everything is done that is asked."""
    emulator = Emulator(network)
    running = Running(network)
    terminal = started(running, network)
    while loss(terminal, emulator):
        pass
    seen = terminal.ended() | {"file": text()}
    running.end(signal.SIGINT)
    emulator.end()
    return seen


def broken_off(network, other):
    """Ctrl-C after the first loss; then everything is left out; then fsn-master goes."""
    emulator = Emulator(network)
    running = Running(network)
    terminal = started(running, network)
    loss(terminal, emulator)
    terminal.until(ASKED)
    terminal.press_ctrl_c()
    seen = {"interrupt": terminal.ended() | {"file": text()}}
    terminal = started(running, network)
    for answer in ("", "yes", "io"):  # nothing, and what does not name the step
        terminal.until(ASKED)
        terminal.write(answer + "\n")
    seen["left_out"] = terminal.ended() | {"file": text()}
    terminal = started(running, network)
    terminal.until(ASKED)
    running.client.request("shutdown")
    running.process.communicate()
    terminal.write("io\n")
    seen["gone"] = terminal.ended() | {"file": text()}
    emulator.end()
    return seen


def refused(network, other):
    """Another configuration runs; and nobody is at a terminal."""
    emulator = Emulator(network)
    running = Running(network)
    terminal = started(running, other)
    seen = {"other": terminal.ended()}
    done = subprocess.run(
        [
            *FSN,
            "test-record",
            network,
            "--live",
            "--socket",
            running.socket,
            "-o",
            "test-record.yaml",
        ],
        input="io\nio2\nlogic\n",
        capture_output=True,
        text=True,
        check=False,
    )
    seen["no_terminal"] = {"code": done.returncode, "told": done.stdout + done.stderr}
    seen["written"] = Path("test-record.yaml").exists()
    running.end(signal.SIGINT)
    emulator.end()
    return seen


CASES |= {f.__name__: f for f in (whole, broken_off, refused)}


if __name__ == "__main__":
    Path("test-record.yaml").unlink(
        missing_ok=True
    )  # of an attempt before, whose steps would be kept
    main()
