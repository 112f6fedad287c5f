"""Network namespaces for tests: each with nothing but ``lo`` and cables of its own.

A cable is a veth pair: ``near``, where a MainDevice is, and ``far``, where SubDevices are; the
second one has ``near2`` and ``far2``. As a program, ``wires.py COMMAND…`` runs a command beside the
first one.
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tied import tied

TESTS = Path(__file__).parent
ROOT = TESTS.parent
# As root, or as an ordinary user where the system lets it.
NAMESPACE = ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-rn"]
_RCVBUFFORCE = 33  # beyond net.core.rmem_max, which holds 40 ms of a busy machine
# The first process of a PID namespace takes all others with it.
ALONE = ["unshare", "--pid", "--fork", "--kill-child", "--mount-proc"]


def command_inside(*command: str | Path, cables: int = 1, parent: int = 0) -> list[str]:
    """Return how a command is run in a namespace of its own; `parent` as `tied` takes it."""
    steps = ["ip link set lo up"]
    for near, far in [("near", "far"), ("near2", "far2")][:cables]:
        steps.append(f"ip link add {near} type veth peer name {far}")
        steps += [f"ip link set {end} up" for end in (near, far)]
    script = " && ".join([*steps, 'exec "$@"'])
    return tied(*NAMESPACE, "sh", "-c", script, "sh", *command, parent=parent)


def make_room(own: socket.socket, size_bytes: int) -> None:
    """Let the packets of a busy machine wait in a socket, for an ordinary user fewer of them."""
    try:
        own.setsockopt(socket.SOL_SOCKET, _RCVBUFFORCE, size_bytes)
    except PermissionError:
        own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size_bytes)


def run_inside(
    *command: str | Path,
    cables: int = 1,
    cwd: Path | None = None,
    text: str = "",
    limit_s: float | None = None,
) -> subprocess.CompletedProcess[str]:
    """Run a command there, and return what it wrote; programs of ours find ours and their own.

    All that it starts ends with it, processes in sessions of their own as well; it has a folder of
    its own for what is only there meanwhile, with a short path, as those of sockets must be.

    Args:
        command: it and its arguments.
        cables: how many there are.
        cwd: the folder it is run in.
        text: its standard input.
        limit_s: after which it is killed.

    Raises:
        subprocess.TimeoutExpired: It was killed.
    """
    with tempfile.TemporaryDirectory(prefix="fsn-") as own:
        ours = {"PYTHONPATH": f"{ROOT}:{TESTS}", "TMPDIR": own, "XDG_RUNTIME_DIR": own}
        return subprocess.run(
            command_inside(*ALONE, *command, cables=cables),
            input=text,
            capture_output=True,
            text=True,
            check=False,
            cwd=cwd,
            env=os.environ | ours,
            timeout=limit_s,
        )


def run_program(
    program: str, *arguments: str | Path, cables: int = 1, **how: object
) -> subprocess.CompletedProcess[str]:
    """Run one of the programs of the tests there, such as ``live/live_rig.py``."""
    return run_inside(sys.executable, TESTS / program, *arguments, cables=cables, **how)


def attempts(folder: Path, times: int) -> Iterator[int]:
    """Count attempts; each finds the folder as the first did, without what others have written."""
    given = set(folder.iterdir())
    for number in range(times):
        for made in set(folder.iterdir()) - given:
            shutil.rmtree(made) if made.is_dir() else made.unlink()
        yield number


def missing() -> str:
    """Return why there is no such namespace here, or an empty text."""
    if shutil.which("unshare") is None or shutil.which("ip") is None:
        return "unshare and ip are needed for a network namespace"
    done = run_inside("true")
    return "" if done.returncode == 0 else f"no network namespace with veth: {done.stderr.strip()}"


if __name__ == "__main__":
    command = command_inside(*sys.argv[1:], parent=os.getppid())
    os.execvp(command[0], command)
