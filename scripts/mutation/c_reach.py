"""Which tests run a line of C: measured once, by gcov, per test program and per Python file."""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .c_build import Build, Slot, environment
from .c_syntax import function_lines

# Test programs by part; what is named nowhere counts for all.
_PROGRAMS = {
    "rt": "access copy cycle groups monitor outputs page_faults realtime record rt several "
    "snapshot wire wire_time fuzz_wire",
    "plan-loader": "access activate acyclic copy fields fingerprint memory outputs plan "
    "plan_file rules texts fuzz_plan",
    "core": "access activate acyclic check cycle groups igh_open igh_cycle igh_objects memory "
    "outputs plan plan_file realtime record several snapshot texts thread wire wire_time",
    "control": "control incident jobs lease listen master memory realtime replies "
    "server stream watch fuzz_control",
    "live": "check igh_open igh_cycle igh_objects memory pdo port sdo wire wire_time soem "
    "soem_odd hostile_soem",
    "segment": "dialogue link memory segment segment_describe segment_faults",
    "scan": "fuzz_scan",
    "client": "realtime",
    "backends": "access activate check cycle groups igh_open igh_cycle igh_objects memory outputs "
    "pdo port sdo several soem soem_odd wire wire_time hostile_soem",
    "app": "master memory",
}
_ELSEWHERE = "test_rig fuzz_monitor"
# Python tests that load the core or run `fsn-master`.
_PYTHON = {
    "rt": ("tests/core/test_core.py", "tests/core/test_monitor.py"),
    "plan-loader": ("tests/core/test_core_plan.py", "tests/master/test_fingerprint.py"),
    "core": ("tests/core",),
    "control": (
        "tests/master/test_control.py",
        "tests/master/test_incidents.py",
        "tests/incident",
    ),
    "live": ("tests/master/test_acyclic.py",),
    "segment": ("tests/segment",),
    "scan": ("tests/core/test_scan_frames.py",),
    "client": ("tests/master/test_realtime.py", "tests/master/test_axis.py"),
    "backends": ("tests/core",),
    "app": ("tests/master", "tests/incident"),
}
_SKIPPED = 77
_COUNTED = re.compile(r"CMakeFiles/fsn[_-]|/app/|/src/client/|/backends/igh/")
_LONGEST_S = 600.0


@dataclass(frozen=True, slots=True)
class Trial:
    """One command that passes or does not."""

    name: str
    command: tuple[str, ...]
    build: Path
    seconds: float = _LONGEST_S / 10

    def passes(self, slot: Slot) -> bool:
        """Run it with the library of the slot; a time-out is no pass."""
        patience = max(5.0 + 8 * self.seconds, 10.0)
        env = environment(self.build, LD_LIBRARY_PATH=str(slot.libraries))
        env["PATH"] = f"{slot.libraries}:{env['PATH']}"
        own = slot.libraries / Path(self.command[0]).name
        trial = replace(self, command=(str(own), *self.command[1:])) if own.exists() else self
        return run(trial, slot.folder, env, patience) == 0


def _is_for(part: str, name: str) -> bool:
    listed = {part: names.split() for part, names in _PROGRAMS.items()}
    elsewhere = {*_ELSEWHERE.split(), *(n for names in listed.values() for n in names)}
    return name in listed[part] or name not in elsewhere


def _by_exit_code(test: dict[str, Any]) -> bool:
    """Whether a test of ctest passes by its exit code, and not by what it says."""
    return not any(p["name"] == "PASS_REGULAR_EXPRESSION" for p in test["properties"])


def run(trial: Trial, folder: Path, env: dict[str, str], patience_s: float) -> int | None:
    """Return the exit code, None after the time-out; nothing of it stays behind."""
    process = subprocess.Popen(
        trial.command,
        cwd=folder,
        env=env,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return process.wait(patience_s)
    except subprocess.TimeoutExpired:
        return None
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


class Listed:
    """The programs listed for a part, for each line: to see what runs it takes minutes."""

    def __init__(self, part: str, build: Build) -> None:
        self._trials = [
            Trial(target, (str(build.plain / "master_core" / target),), build.plain, seconds=2)
            for target in self.targets(part)
        ]

    @staticmethod
    def targets(part: str) -> list[str]:
        """Return what is to be built."""
        return [f"test_{n}" for n in _PROGRAMS[part].split() if not n.startswith("fuzz_")]

    def tests(self, path: str, line: int) -> list[Trial]:
        """Return all trials."""
        return self._trials


class Reach:
    """The trials of a part, and the lines that each of them runs."""

    def __init__(self, part: str, build: Build) -> None:
        self._build = build
        self._covered = build.covered()
        self._gcno = {str(p.relative_to(self._covered)): p for p in self._covered.rglob("*.gcno")}
        self._functions: dict[str, list[range]] = {}
        self._trials: list[tuple[Trial, dict[str, list[int]]]] = []
        for trial in [*self._programs(part), *self._python(part)]:
            with build.locked():
                measured = self._measure(trial)
            if measured is not None:
                seconds, lines = measured
                slower = Trial(trial.name, trial.command, build.plain, seconds)
                self._trials.append((slower, lines))
        self._trials.sort(key=lambda t: t[0].seconds)

    @staticmethod
    def targets(part: str) -> list[str]:
        """Return what is to be built: everything, as Python tests need more than their part."""
        return ["all"]

    def tests(self, path: str, line: int) -> list[Trial]:
        """Return the trials that run a line, the quickest first; for data, all of its file."""
        if path not in self._functions:
            self._functions[path] = function_lines((self._build.root / path).read_bytes())
        body = next((f for f in self._functions[path] if line in f), None)
        known = {n for _, lines in self._trials for n in lines.get(path, ())}
        if body is None:
            return [t for t, lines in self._trials if path in lines]
        # A statement counts where it begins.
        begin = max((n for n in known if body.start <= n <= line), default=None)
        near = [t for t, lines in self._trials if begin in lines.get(path, ())]
        if not near:
            near = [t for t, lines in self._trials if set(body) & set(lines.get(path, ()))]
        return near or [t for t, lines in self._trials if path in lines]

    def _programs(self, part: str) -> list[Trial]:
        shown = subprocess.run(
            ["ctest", "--test-dir", str(self._build.plain / "master_core"), "--show-only=json-v1"],
            capture_output=True,
            text=True,
            check=True,
        )
        return [
            Trial(test["name"], tuple(test["command"]), self._build.plain)
            for test in json.loads(shown.stdout)["tests"]
            if _is_for(part, test["name"]) and _by_exit_code(test)
        ]

    def _python(self, part: str) -> list[Trial]:
        root = self._build.root
        files: list[Path] = []
        for name in _PYTHON[part]:
            path = root / name
            files += sorted(path.glob("test_*.py")) if path.is_dir() else [path]
        found = []
        for path in files:
            command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
            command += ["--hypothesis-seed=0", f"--rootdir={root}", "-c", f"{root}/pyproject.toml"]
            name = str(path.relative_to(root))
            found.append(Trial(name, (*command, str(path)), self._build.plain))
        return found

    def _measure(self, trial: Trial) -> tuple[float, dict[str, list[int]]] | None:
        """Return time and lines of a trial, from the last time while nothing has changed."""
        folder = self._build.work / "reach" / trial.name.replace("/", "_")
        kept = folder / "lines.json"
        if kept.exists():
            found = json.loads(kept.read_text())
            if found["key"] == self._key(trial, list(found["lines"])):
                return (found["seconds"], found["lines"]) if found["passed"] else None
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "counts").mkdir(parents=True)
        command = tuple(w.replace(str(trial.build), str(self._covered)) for w in trial.command)
        env = environment(self._covered, GCOV_PREFIX=str(folder / "counts"))
        code = run(Trial(trial.name, command, self._covered), folder, env, _LONGEST_S)
        if code not in (0, _SKIPPED):
            print(f"mutate: {trial.name} fails without a mutant (exit {code}) and is left out")
        lines = self._lines(folder / "counts")
        shutil.rmtree(folder / "counts")
        begin = time.monotonic()
        if code == 0:
            code = run(trial, folder, environment(self._build.plain), _LONGEST_S)
        seconds = time.monotonic() - begin
        key = self._key(trial, list(lines))
        record = {"key": key, "passed": code == 0, "seconds": seconds, "lines": lines}
        kept.write_text(json.dumps(record))
        return (seconds, lines) if code == 0 else None

    def _key(self, trial: Trial, ran: list[str]) -> str:
        """Return what the reach of a trial depends on: its own files and those that it ran."""
        found = hashlib.sha256(repr(trial.command).encode())
        core = self._build.root / "master_core"
        used = [self._build.root / path for path in ran]
        if trial.command[0] == sys.executable:
            used += Path(trial.command[-1]).parent.glob("*.py")
        else:
            stem = Path(trial.command[0]).name
            used += [p for p in core.rglob("*.[ch]") if p.stem == stem or p.stem.endswith("_rig")]
        for path in sorted(used):
            found.update(path.read_bytes() if path.exists() else b"")
        return found.hexdigest()

    def _lines(self, counts: Path) -> dict[str, list[int]]:
        inside = counts / self._covered.relative_to("/")
        found: dict[str, set[int]] = {}
        for data in inside.rglob("*.gcda"):
            note = self._gcno.get(str(data.relative_to(inside).with_suffix(".gcno")))
            if note is None or not _COUNTED.search(str(note)):
                continue
            shutil.copy(note, data.with_suffix(".gcno"))
            subprocess.run(
                ["gcov", "--json-format", data.name],
                cwd=data.parent,
                capture_output=True,
                check=True,
            )
        for report in inside.rglob("*.gcov.json.gz"):
            for file in json.loads(gzip.decompress(report.read_bytes()))["files"]:
                path = Path(file["file"]).resolve()
                if path.is_relative_to(self._build.root):
                    ran = {entry["line_number"] for entry in file["lines"] if entry["count"] > 0}
                    name = str(path.relative_to(self._build.root))
                    found.setdefault(name, set()).update(ran)
        return {name: sorted(lines) for name, lines in found.items() if lines}
