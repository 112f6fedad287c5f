"""The installed files compared with the installer's record; fsn-master with a reference plan."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

from fsoe_net.project.installed import installed_files, shipped
from fsoe_net.self_test.model import NotTried, TriedValue, reference
from fsoe_net.version import __version__

_TIMEOUT_S = 30


def recorded_files() -> Iterator[TriedValue]:
    """Compare the hash of each file with the installer's record."""
    found = installed_files()
    if found.is_tree:
        raise NotTried("a source tree: no installer recorded its files")
    if not found.recorded:
        yield TriedValue("record of the installer", "fsoe_net-*.dist-info/RECORD", "not there")
        return
    for path in sorted({*found.hashes, *found.recorded}):
        expected = found.recorded.get(path, "no such file")
        yield TriedValue(path, expected, found.hashes.get(path, "no such file"))


def master_version(program: str) -> str:
    """Return the first line printed by ``fsn-master --version``.

    Raises:
        OSError, subprocess.SubprocessError: The program cannot be started, or does not end.
    """
    code, text = _run(program, "--version")
    return text.partition("\n")[0] if code == 0 else f"exit code {code}"


def master() -> Iterator[TriedValue]:
    """Let fsn-master open a reference plan on a bus in memory, and reject others.

    The bus is an image in memory: no interface is opened.
    """
    from fsoe_net.errors import EnvironmentFault
    from fsoe_net.live.master import find_master
    from fsoe_net.network import load

    try:
        program = find_master()
    except EnvironmentFault as exc:
        raise NotTried(str(exc)) from exc
    yield TriedValue("version", f"fsn-master {__version__}", master_version(program))
    data = load(shipped("examples") / "estop" / "network.yaml").compile().to_bytes()
    accepted = reference()["networks"]["estop"]["fingerprint"]
    other = accepted[:-1] + ("0" if accepted[-1] != "0" else "1")
    with tempfile.TemporaryDirectory(prefix="fsoe-net-") as folder:
        plan = Path(folder, "estop.fsnplan")
        options = [str(plan), "--bus", "emulated", "--interface", "self-test", "--policy", "other"]
        options += ["--duration", "20ms", "--socket", str(Path(folder, "s.sock"))]
        for what, fingerprint, changed, code in (
            ("the accepted plan", accepted, 0, 0),
            ("a plan with another fingerprint", other, 0, 1),
            ("a plan with a byte changed", accepted, 1, 1),
        ):
            plan.write_bytes(data[:-1] + bytes([data[-1] ^ changed]))
            got, _ = _run(program, *options, "--accepted", fingerprint)
            yield TriedValue(f"exit code for {what}", code, got)


def _run(program: str, *options: str) -> tuple[int, str]:
    done = subprocess.run(  # noqa: S603 - a list, no shell
        [program, *options],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=_TIMEOUT_S,
        check=False,
    )
    return done.returncode, done.stdout.decode("utf-8", "replace")
