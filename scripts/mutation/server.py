"""A pytest that is there already: each run of tests is a fork of this process.

    server.py                what takes long to import is imported, but nothing of fsoe_net: a fork
                             collects tests and imports it anew, with a mutant in a module's place
    server.py WORK PATH…     the tests below the paths are collected; a fork gives the functions of
                             one module the code of a mutant

Reads one request a line and answers with one line, both JSON:

    {"paths": [...], "tests": [...], "seconds": n or null, "mutant": [...] or null,
     "record": path or null, "work": folder}           -> {"code": exit code of pytest or null}

`tests` null: all below the paths. `record` writes what each test covers. The code is null when the
time was over, 125 where the mutant cannot be put in place in a process with collected tests.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import json
import os
import resource
import select
import shutil
import signal
import sys
import traceback
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

CHILD = Path(__file__).parent / "child"
MEMORY = 6 << 30
NOT_HERE = 125
# It runs in a process that gets no environment: there its text is the program.
CONFINED = "fsoe_net.formats.ros2.xacro_child"
# What tests and product import; one that is missing here costs time only.
EARLY = (
    "pytest _pytest.assertion.rewrite _pytest.config _pytest.fixtures _pytest.python "
    "hypothesis hypothesis.stateful hypothesis.strategies hypothesis.internal.conjecture.engine "
    "yaml jsonschema click rich.console rich.table rich.progress cffi numpy crcmod xacro "
    "xml.etree.ElementTree xml.sax xml.dom.minidom subprocess asyncio socket coverage json "
    "importlib.resources importlib.metadata decimal fractions statistics html tomllib"
)
# What is imported early is no test, its asserts may stay as they are.
OPTIONS = ["-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning"]


class Chooser:
    """Runs the wanted tests only, in their order; hypothesis tries the same examples each time."""

    def __init__(self, request: dict) -> None:
        self.request = request
        self.cov = None
        self.seconds: dict[str, float] = {}
        self.begin = 0.0
        self.failed: set[str] = set()
        # Lines that commands of a test ran: the test, a file, lines of it.
        self.called: list[tuple[str, str, list[int]]] = []

    def pytest_collection(self, session: object) -> None:
        """Load the profile after the conftest loaded its own, before a test module is imported."""
        from hypothesis import settings

        settings.register_profile("mutation", settings.default, derandomize=True, database=None)
        settings.load_profile("mutation")

    def pytest_runtestloop(self, session: object) -> None:
        """Keep the wanted tests, in their order; pytest's own loop runs them."""
        tests, paths = self.request["tests"], tuple(self.request["paths"])
        if tests is None:
            session.items = [i for i in session.items if i.nodeid.startswith(paths)]
        else:
            place = {name: i for i, name in enumerate(tests)}
            kept = [item for item in session.items if item.nodeid in place]
            session.items = sorted(kept, key=lambda item: place[item.nodeid])
        session.testscollected = len(session.items)
        if self.request["record"]:
            import coverage

            self.cov = coverage.Coverage(
                data_file=None, include=["fsoe_net/*"], config_file=False, messages=False
            )
            self.cov.start()
        else:
            session.config.option.maxfail = 1

    def pytest_runtest_logstart(self, nodeid: str, location: object) -> None:
        """What is covered from here on is covered by this test."""
        self.begin = _spent()
        self.test = nodeid
        if self.cov is not None:
            self.cov.switch_context(nodeid)

    def pytest_runtest_logreport(self, report: object) -> None:
        """Note the time of the processor, which other processes do not change, and what fails."""
        self.seconds[report.nodeid] = _spent() - self.begin
        if report.failed:
            self.failed.add(report.nodeid)
            (Path(self.request["work"]) / "failed").write_text(report.nodeid, "utf-8")

    def run_command(self, request: str) -> int:
        """Run a command of a test in a fork, where a mutant is in its place; its exit code."""
        tool, lines = sys.modules["cli.tool"], Path(self.request["work"]) / "called"
        child = os.fork()
        if child == 0:
            # What this process does at its end is not the fork's to do.
            atexit._clear()
            if self.cov is not None:
                atexit.register(self._write_called, lines)
            tool._run(json.loads(request), sys.modules["fsoe_net.cli.main"].main)
        _, status = os.waitpid(child, 0)
        if self.cov is not None and lines.is_file():
            rows = json.loads(lines.read_text("utf-8"))
            self.called += [(self.test, file, numbers) for file, numbers in rows.items()]
            lines.unlink()
        return os.waitstatus_to_exitcode(status)

    def _write_called(self, path: Path) -> None:
        self.cov.stop()
        data = self.cov.get_data()
        path.write_text(json.dumps({f: data.lines(f) for f in data.measured_files()}), "utf-8")

    def write_covered(self) -> None:
        """Write which tests ran which lines: files with lines with indices of tests."""
        self.cov.stop()
        data = self.cov.get_data()
        names = list(self.seconds)
        index = {name: i for i, name in enumerate(names)}
        found = defaultdict(lambda: defaultdict(set))
        for file in data.measured_files():
            for line, contexts in data.contexts_by_lineno(file).items():
                found[file][line].update(index[c] for c in contexts if c in index)
        for test, file, numbers in self.called:
            for line in numbers:
                found[file][line].add(index[test])
        lines = {
            os.path.relpath(file): {line: sorted(tests) for line, tests in rows.items() if tests}
            for file, rows in sorted(found.items())
        }
        document = {
            "tests": names,
            "seconds": [round(self.seconds[name], 4) for name in names],
            "failed": sorted(self.failed),
            "lines": lines,
        }
        path = Path(self.request["record"])
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(document), "utf-8")


def _spent() -> float:
    return sum(os.times()[:4])


class Waiting(Chooser):
    """Collects its tests, then forks for each request; only a fork goes on to run tests."""

    def __init__(self, serve: Callable) -> None:
        super().__init__({})
        self.serve = serve

    def pytest_runtestloop(self, session: object) -> None:
        """Answer requests here; returns in a fork only."""
        if tool := sys.modules.get("cli.tool"):
            tool.load()
            tool._ask = self.run_command
        if not self.serve(self.prepare):
            os._exit(0)
        super().pytest_runtestloop(session)

    def prepare(self, request: dict) -> None:
        """Put the mutant in its place; ends the fork where that cannot be."""
        from swap import swap

        self.request = request
        name, path, text = request["mutant"] or ("", "", "")
        if not name:
            return
        announce(request["mutant"])
        if name in sys.modules and not swap(
            path, Path(path).read_text("utf-8"), Path(text).read_text("utf-8")
        ):
            os._exit(NOT_HERE)


def announce(mutant: list[str]) -> None:
    """Let this process and its children import a module's mutant instead of it."""
    os.environ["FSN_MUTANT"] = json.dumps(mutant)
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join([str(CHILD), *([before] if before else [])])
    sys.path.insert(0, str(CHILD))
    sys.modules.pop("sitecustomize", None)
    importlib.import_module("sitecustomize")
    name, _, text = mutant
    if name == CONFINED:
        expand = importlib.import_module("fsoe_net.formats.ros2.xacro_expand")
        expand._CHILD = Path(text).read_text("utf-8") + "\nmain()\n"


def _waited(pid: int, request: dict) -> int | None:
    fd = os.pidfd_open(pid)
    ready, _, _ = select.select([fd], [], [], request["seconds"])
    os.close(fd)
    # Also what the tests started and did not end.
    for end in (os.killpg, os.kill):
        with contextlib.suppress(ProcessLookupError):
            end(pid, signal.SIGKILL)
    _, status = os.waitpid(pid, 0)
    shutil.rmtree(Path(request["work"]) / "tmp", ignore_errors=True)
    return os.waitstatus_to_exitcode(status) if ready else None


class Serving:
    """Reads requests and forks for each."""

    def __init__(self) -> None:
        # pytest takes 0 to 2 for itself.
        self._requests = os.fdopen(os.dup(0), encoding="utf-8")
        self._answers = os.fdopen(os.dup(1), "w", encoding="utf-8")

    def serve(self, prepare: Callable[[dict], None]) -> bool:
        """Return True in each fork, False here when there are no more requests."""
        for line in self._requests:
            request = json.loads(line)
            pid = os.fork()
            if pid == 0:
                os.setsid()
                # Also without a mutant: what needs more of it fails then too, and is left out.
                resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
                prepare(request)
                return True
            code = _waited(pid, request)
            self._answers.write(json.dumps({"code": code}) + "\n")
            self._answers.flush()
        return False


def _quiet(work: Path) -> None:
    out = os.open(work / "output.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for fd in (1, 2):
        os.dup2(out, fd)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)


def _tests(chooser: Chooser, paths: list[str], work: Path) -> int:
    import pytest

    args = [*paths, *OPTIONS, "--basetemp", str(work / "tmp")]
    code = int(pytest.main(args, plugins=[chooser]))
    if chooser.cov is not None:
        chooser.write_covered()
    return code


def main(arguments: list[str]) -> int:
    """Answer until the input ends; the exit code of a fork is that of pytest."""
    for name in EARLY.split():
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    serving = Serving()
    if arguments:
        work = Path(arguments[0])
        _quiet(work)
        return _tests(Waiting(serving.serve), arguments[1:], work)
    asked: dict = {}
    if not serving.serve(asked.update):
        return 0
    work = Path(asked["work"])
    _quiet(work)
    if asked["mutant"]:
        announce(asked["mutant"])
    return _tests(Chooser(asked), asked["paths"], work)


if __name__ == "__main__":
    end = 3
    try:
        end = main(sys.argv[1:])
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(end)
