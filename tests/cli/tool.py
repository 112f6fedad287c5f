"""Runs the command line as a user does.

A process of its own per call, but forked from one that has loaded everything: a fresh interpreter
takes several times as long as most commands.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import IO

import click
from tied import tied

from fsoe_net.cli.main import cli

_SERVE = "import sys; sys.path[:] = {path!r}; from cli.tool import serve; serve()"
_server: subprocess.Popen[str] | None = None


def commands(group: click.Group = cli, words: str = "") -> Iterator[tuple[str, click.Command]]:
    """Yield each command with its words, those of groups too."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from commands(command, f"{words}{name} ")
        else:
            yield f"{words}{name}", command


def fsn(
    *arguments: str, cwd: Path | None = None, env: Mapping[str, str] = os.environ
) -> subprocess.CompletedProcess[str]:
    with tempfile.TemporaryDirectory(prefix="fsn-call-") as folder:
        out, err = Path(folder, "out"), Path(folder, "err")
        request = {
            "arguments": arguments,
            "cwd": str(cwd or Path.cwd()),
            "env": dict(env),
            "out": str(out),
            "err": str(err),
        }
        code = _ask(json.dumps(request))
        done = subprocess.CompletedProcess(list(arguments), code, out.read_text(), err.read_text())
    assert "Traceback" not in done.stderr, done.stderr
    return done


def _ask(request: str) -> int:
    """Let the server run one command; returns how it ended, as `subprocess` does."""
    global _server
    if _server is not None and _server.poll() is not None:  # a test that hung has ended it
        for pipe in (_server.stdin, _server.stdout):
            with contextlib.suppress(BrokenPipeError):
                pipe.close()
        _server = None
    if _server is None:
        _server = subprocess.Popen(
            tied(sys.executable, "-c", _SERVE.format(path=sys.path)),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        atexit.register(_server.stdin.close)
    _server.stdin.write(request + "\n")
    _server.stdin.flush()
    return int(_server.stdout.readline())


def load() -> None:
    """Import all commands."""
    import fsoe_net.cli

    modules = [row.name for row in iter_modules(fsoe_net.cli.__path__) if row.name != "__main__"]
    for name in modules:
        import_module(f"fsoe_net.cli.{name}")


def serve() -> None:
    """Answer requests on standard input until it ends."""
    load()
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            _run(json.loads(line), sys.modules["fsoe_net.cli.main"].main)
        _, status = os.waitpid(child, 0)
        sys.stdout.write(f"{os.waitstatus_to_exitcode(status)}\n")
        sys.stdout.flush()


def _run(request: dict, main) -> None:
    code = 1
    try:
        os.chdir(request["cwd"])
        os.environ.clear()
        os.environ.update(request["env"])
        sys.stdin = _onto(os.devnull, 0, "r")
        sys.stdout = _onto(request["out"], 1, "w")
        sys.stderr = _onto(request["err"], 2, "w")
        sys.argv = ["fsoe-net", *request["arguments"]]
        try:
            main()
            code = 0
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
        except BaseException:
            sys.excepthook(*sys.exc_info())
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def _onto(path: str, number: int, mode: str) -> IO[str]:
    with open(path, mode) as file:
        os.dup2(file.fileno(), number)
    return os.fdopen(number, mode, closefd=False, encoding="utf-8", errors="strict")
