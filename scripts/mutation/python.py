"""Mutants of the Python package: which there are, and which tests can notice one.

A mutant is a fork of a server that has pytest in memory (`server.py`). It runs the tests that ran
the changed line, the fast ones first; a line that no test runs is a survivor at once. What each
test runs is measured once and kept in build/mutation/covered until a source or test changes.
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
import subprocess
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from functools import cache
from itertools import accumulate
from pathlib import Path

from mutation.common import (
    INVALID,
    KILLED,
    SURVIVED,
    Mutant,
    changed_lines,
    left_out,
)

PACKAGE = "fsoe_net"
# What a server answers where only a new import puts a mutant in place.
NOT_HERE = 125
# What the tests of one mutant may cost; one that they do not notice by then has survived.
SECONDS = 40
# The rooms of a part that has more than the one of its name.
ROOMS: dict[str, tuple[str, ...]] = {
    "fsoe": ("fsoe", "campaign"),
    "simulate": ("simulate", "live", "test_record"),
    "incident": ("incident", "capture", "intervention_log"),
    "project": ("project", "acceptance", "compare", "proposal", "self_test"),
}
# Where the tests of a part are. Those that run in real time are not here: they take too long and
# notice little of what these parts do; nor those that draw whole runs for seconds (`fsoe`).
PARTS: dict[str, tuple[str, ...]] = {
    "rules": ("rules", "diagnostics", "timing/test_budget.py",
              "timing/test_parts.py", "model/test_expand.py"),
    "plan": ("plan", "core/test_core_plan.py", "cli/test_fingerprint.py", "cli/test_accept.py"),
    "fsoe": ("campaign", "fsoe/test_tables.py", "fsoe/test_chain.py", "fsoe/test_pdu.py",
             "fsoe/test_pair.py", "fsoe/test_main_table.py", "fsoe/test_sub_table.py",
             "core/test_monitor.py"),
    "timing": ("timing", "diagnostics", "cli/test_timing.py"),
    "formats": ("formats", "diagnostics", "cli/test_convert.py", "cli/test_write.py",
                "cli/test_init.py", "cli/test_fix.py", "test_record/test_protocol_file.py"),
    "project": ("cli", "report", "acceptance", "compare", "proposal", "self_test",
                "test_library.py"),
    "model": ("model", "proposal", "diagnostics", "rules/test_edges.py", "compare",
              "rules/test_hazards.py", "formats/test_cases.py",
              "formats/test_library.py", "plan/test_whole.py", "cli/test_init.py",
              "cli/test_outputs.py", "cli/test_connections.py", "cli/test_scan.py",
              "report/test_corners.py", "acceptance", "capture/test_names.py",
              "test_record/test_protocol.py", "test_record/test_protocol_file.py"),
    "report": ("report", "acceptance", "compare", "cli/test_report.py",
               "cli/test_report_protocol.py", "cli/test_diff.py",
               "cli/test_log.py", "self_test/test_self_test.py"),
    "simulate": ("simulate/test_run.py", "test_record/test_protocol.py",
                 "test_record/test_protocol_file.py", "test_record/test_protocol_watched.py",
                 "simulate/test_virtual.py", "simulate/test_edges.py", "live/test_scan_files.py",
                 "simulate/test_scenario_check.py", "simulate/test_device.py",
                 "simulate/test_drive_axis.py", "simulate/test_drive_plant.py",
                 "simulate/test_drive_power.py", "simulate/test_drive_wiring.py",
                 "simulate/test_logic.py", "simulate/test_network.py", "simulate/test_setup.py",
                 "simulate/test_signals.py", "live/test_client.py", "live/test_client_typed.py",
                 "live/test_console.py", "live/test_console_words.py",
                 "simulate/test_run_campaign.py", "live/test_monitor.py", "live/test_health.py",
                 "simulate/test_broken_devices.py", "live/test_live_run.py",
                 "live/test_whole_words.py", "live/test_corners.py", "incident/test_files.py",
                 "segment/test_emulate.py", "segment/test_commands.py",
                 "cli/test_outputs.py", "cli/test_install_master.py"),
    "cli": ("cli",),
    "incident": ("incident", "capture", "intervention_log"),
    "host": ("host",),
    "document": ("document", "report/test_whole.py", "report/test_blocks.py"),
    "studio": ("studio",),
    "ros2": ("ros2",),
}  # fmt: skip
# What a small sample asks instead: tests that are measured within seconds.
QUICK: dict[str, tuple[str, ...]] = {
    "rules": ("diagnostics/test_cases.py", "diagnostics/test_messages.py",
              "compare/test_references.py", "rules/test_edges.py"),
    "plan": ("plan/test_whole.py",),
    "fsoe": ("fsoe/test_pdu.py", "fsoe/test_chain.py", "fsoe/test_main_table.py",
             "fsoe/test_sub_table.py", "fsoe/test_tables.py", "campaign/test_campaign_whole.py"),
    "timing": ("timing/test_formulas.py", "timing/test_budget.py", "timing/test_parts.py"),
}  # fmt: skip
# What tests compare with; the names of the tests are in it, so another text changes no coverage.
_RECORDED = ("changed.txt",)
PRAGMA = re.compile(r"# pragma: no cover")


def mutants(part: str, root: Path) -> list[Mutant]:
    """Return all mutants of a part."""
    from mutation.operators import changes

    out = []
    rooms = (root / PACKAGE / room for room in ROOMS.get(part, (part,)))
    for file in sorted(file for room in rooms for file in room.rglob("*.py")):
        source = file.read_text("utf-8")
        lines = source.splitlines()
        excluded = _excluded(source)
        for operator, changed in changes(source):
            number, before, after = changed_lines(source, changed)
            span = range(number, number + before.count("\n") + 1)
            if excluded.isdisjoint(span) and not any(left_out(lines[n - 1]) for n in span):
                path = str(file.relative_to(root))
                out.append(Mutant(path, number, operator, before, after, changed))
    return out


def _statements(source: str) -> list[tuple[int, int, ast.stmt, ast.AST | None]]:
    """Return first and last line of each statement's own text, the statement, its function."""
    out = []

    def walk(node: ast.AST, function: ast.AST | None) -> None:
        for child in ast.iter_child_nodes(node):
            inner = function
            if isinstance(child, ast.stmt):
                decorators = getattr(child, "decorator_list", [])
                first = min([child.lineno, *(d.lineno for d in decorators)])
                body = getattr(child, "body", None)
                last = max(first, body[0].lineno - 1) if body else child.end_lineno
                out.append((first, last, child, function))
                if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                    inner = child
            walk(child, inner)

    walk(ast.parse(source), None)
    return sorted(out, key=lambda s: (s[1] - s[0], s[0]))


def _excluded(source: str) -> set[int]:
    """Return the lines that no test can reach, as coverage knows them."""
    marked = {i for i, x in enumerate(source.splitlines(), 1) if PRAGMA.search(x)}
    out = set(marked)
    for first, last, statement, _ in _statements(source):
        if any(first <= n <= last for n in marked):
            out |= set(range(first, statement.end_lineno + 1))
    return out


@dataclass
class Covered:
    """Which tests run which lines, and how long each takes."""

    seconds: dict[str, float] = field(default_factory=dict)
    kills: Counter[str] = field(default_factory=Counter)
    lines: dict[str, dict[int, set[str]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(set))
    )

    def add(self, document: dict) -> None:
        """Take in what one measurement found; what failed without a mutant is no measure."""
        names, failed = document["tests"], set(document["failed"])
        self.seconds |= dict(zip(names, document["seconds"], strict=True))
        for file, rows in document["lines"].items():
            for line, tests in rows.items():
                self.lines[file][int(line)] |= {names[i] for i in tests} - failed

    def naming(self, words: list[str], root: Path) -> set[str]:
        """Return the tests whose functions have one of the names in their text."""
        texts = {f: _functions(root / f) for f in {t.partition("::")[0] for t in self.seconds}}
        wanted = re.compile(rf"\b({'|'.join(map(re.escape, words))})\b") if words else None
        return {
            test
            for test in self.seconds
            for file, _, name in [test.partition("[")[0].partition("::")]
            if wanted and wanted.search(texts[file].get(name.rpartition("::")[2], ""))
        }

    def at(self, path: str, first: int, last: int) -> set[str]:
        """Return the tests that run a line between two of a file, both included."""
        rows = self.lines.get(path, {})
        return set().union(*(rows.get(n, ()) for n in range(first, last + 1)))

    def ordered(self, tests: set[str]) -> list[str]:
        """Return the fast tests first, those that have noticed mutants, few of one function."""
        cost = {t: (0.01 + round(self.seconds[t], 2)) / (0.1 + self.kills[t]) for t in tests}
        before: Counter[str] = Counter()
        for test in sorted(tests, key=lambda t: (cost[t], t)):
            function = test.partition("[")[0]
            before[function] += 1
            cost[test] *= before[function]
        return sorted(tests, key=lambda t: (cost[t], t))

    def affordable(self, tests: list[str]) -> list[str]:
        """Return the first of them that need no more than `SECONDS` together, and one at least."""
        sums = accumulate(self.seconds[t] for t in tests)
        return [t for n, (t, s) in enumerate(zip(tests, sums, strict=True)) if s < SECONDS or not n]


@cache
def _functions(file: Path) -> dict[str, str]:
    """Return the text of each function of a file, with its decorators."""
    text = file.read_text("utf-8")
    lines = text.splitlines()
    return {
        node.name: "\n".join(lines[node.lineno - 1 - len(node.decorator_list) : node.end_lineno])
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef)
    }


_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


class _Choice:
    """Which tests can notice a change of a line."""

    def __init__(self, root: Path, covered: Covered) -> None:
        self._root, self._covered = root, covered
        self._statements = cache(self._read)
        self._texts = {
            str(f.relative_to(root)): f.read_text("utf-8").splitlines()
            for f in sorted((root / PACKAGE).rglob("*.py"))
        }

    def _read(self, path: str) -> list[tuple[int, int, ast.stmt, ast.AST | None]]:
        return _statements("\n".join(self._texts[path]) + "\n")

    def _all(self, path: str) -> set[str]:
        return self._covered.at(path, 1, len(self._texts[path]))

    def _around(self, mutant: Mutant) -> tuple[int, int, ast.stmt | None, ast.AST | None]:
        last = mutant.line + mutant.before.count("\n")
        around = (s for s in self._statements(mutant.path) if s[0] <= mutant.line and last <= s[1])
        return next(around, (mutant.line, last, None, None))

    def ran_before(self, mutant: Mutant) -> bool:
        """Return whether no test runs the function of a mutant: it ran at import, if ever."""
        function = self._around(mutant)[3]
        return isinstance(function, _FUNCTIONS) and not self._covered.at(
            mutant.path, function.body[0].lineno, function.end_lineno or 0
        )

    def tests(self, mutant: Mutant) -> list[str]:
        first, end, statement, function = self._around(mutant)
        definition = isinstance(statement, (*_FUNCTIONS, ast.ClassDef))
        once = function is None or _is_cached(function) or self.ran_before(mutant)
        if not once and not definition:
            return self._covered.ordered(self._covered.at(mutant.path, first, end))
        # It runs when the module is imported, or once for all: whoever uses its names can notice.
        words = _names(function if function is not None and once else statement)
        words += [
            s.name
            for _, _, s, _ in self._statements(mutant.path)
            if isinstance(s, ast.ClassDef) and s.lineno <= mutant.line <= (s.end_lineno or 0)
        ]
        found = self._covered.naming(words, self._root)
        for path, lines in self._texts.items():
            for number, line in enumerate(lines, 1):
                if any(re.search(rf"\b{re.escape(w)}\b", line) for w in words):
                    found |= self._covered.at(path, number, number)
        if definition and statement is not None:
            found |= self._covered.at(mutant.path, first, statement.end_lineno)
        rest = self._all(mutant.path)
        if not rest:
            module = _module(mutant.path).replace(".", r"\.")
            users = (p for p, x in self._texts.items() if re.search(rf"\b{module}\b", "\n".join(x)))
            rest = set().union(*map(self._all, users))
        rest -= found
        return self._covered.ordered(found) + self._covered.ordered(rest)


def _is_cached(function: ast.AST | None) -> bool:
    return any("cache" in ast.unparse(d) for d in getattr(function, "decorator_list", ()))


def _names(statement: ast.AST | None) -> list[str]:
    if statement is None:
        return []
    if hasattr(statement, "name"):
        return [statement.name]
    targets = getattr(statement, "targets", None) or [getattr(statement, "target", None)]
    return [n.id for t in targets if t is not None for n in ast.walk(t) if isinstance(n, ast.Name)]


def ask_quick_tests_only() -> None:
    """Replace the tests of each part; parts without quick ones go."""
    PARTS.clear()
    PARTS.update(QUICK)


class Server:
    """A process that has pytest in memory, and the tests below some paths if there are any."""

    def __init__(self, root: Path, work: Path, paths: list[str] | None = None) -> None:
        work.mkdir(parents=True, exist_ok=True)
        self._work = work
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", str(Path(__file__).parent / "server.py")]
            + ([str(work), *paths] if paths else []),
            cwd=root,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, paths: list[str], **options: object) -> int | None:
        """Return the exit code of pytest, None when the time was over; options: see server.py."""
        empty = {"tests": None, "seconds": None, "mutant": None, "record": None}
        (self._work / "failed").write_text("", "utf-8")
        request = {**empty, **options, "paths": paths, "work": str(self._work)}
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise SystemExit(f"mutate: the tests cannot be collected: {self._work}/output.txt")
        return json.loads(answer)["code"]

    def failed(self) -> str:
        """Return which test the last request ended at, empty without one."""
        return (self._work / "failed").read_text("utf-8")

    def close(self) -> None:
        """End the process."""
        with self._process:
            pass


def _files(root: Path, part: str) -> list[Path]:
    """Return the files with tests of a part; each is measured by itself."""
    places = [root / "tests" / name for name in PARTS[part]]
    return [
        file
        for place in places
        for file in ([place] if place.is_file() else sorted(place.rglob("test_*.py")))
    ]


def _digests(root: Path, tests: Path, lines: dict[str, dict]) -> dict[str, str]:
    """Return the digest of each file that decides what the tests of a file run.

    Those are the file, what its folder and all tests share and, of the package, what they ran.
    """
    shared = [f for f in sorted(tests.parent.rglob("*")) if not f.match("test_*.py")]
    files = [tests, *shared, *sorted((root / "tests").glob("*.py")), *(root / p for p in lines)]
    return {
        str(file.relative_to(root)): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in files
        if file.is_file() and file.suffix != ".pyc" and file.name not in _RECORDED
    }


def covered_by(part: str, root: Path, server: Server) -> Covered:
    """Return what the tests of a part run; measured where a source or a test has changed."""
    out = Covered()
    for tests in _files(root, part):
        name = str(tests.relative_to(root))
        kept = root / "build" / "mutation" / "covered" / f"{name.replace('/', '-')}.json"
        document = json.loads(kept.read_text("utf-8")) if kept.is_file() else {"lines": {}}
        if document.get("digests") != _digests(root, tests, document["lines"]):
            code = server.ask([name], record=str(kept))
            if code not in (0, 1, 5):
                raise SystemExit(f"mutate: pytest {name} ended with {code}")
            document = json.loads(kept.read_text("utf-8"))
            document["digests"] = _digests(root, tests, document["lines"])
            for failed in document["failed"]:
                print(f"mutate: {failed} fails without a mutant and is left out", file=sys.stderr)
            kept.write_text(json.dumps(document), "utf-8")
        out.add(document)
    return out


def _module(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _asked(
    server: Server, tests: list[str], seconds: float, mutant: list[str] | None
) -> int | None:
    files = list(dict.fromkeys(t.partition("::")[0] for t in tests))
    return server.ask(files, tests=tests, seconds=seconds, mutant=mutant)


def _until(tests: list[str], last: str) -> list[str]:
    """Return the tests up to one: it may fail only behind the others."""
    return tests[: tests.index(last) + 1]


class Runner:
    """Runs mutants of one part, one after the other."""

    def __init__(self, part: str, work: Path, root: Path) -> None:
        self._root, self._work = root, work
        self._bare = Server(root, work / "bare")
        self._collected = Server(root, work, [f"tests/{t}" for t in PARTS[part]])
        self._covered = covered_by(part, root, self._collected)
        self._choice = _Choice(root, self._covered)

    def run(self, mutant: Mutant) -> str:
        """Return what becomes of a mutant."""
        original = (self._root / mutant.path).read_text("utf-8")
        try:
            if ast.dump(ast.parse(mutant.source)) == ast.dump(ast.parse(original)):
                return INVALID
            compile(mutant.source, mutant.path, "exec")
        except SyntaxError:
            return INVALID
        tests = self._covered.affordable(self._choice.tests(mutant))
        if not tests:
            return SURVIVED
        text = self._work / "mutant.py"
        text.write_text(mutant.source, "utf-8")
        code = NOT_HERE
        servers = [] if self._choice.ran_before(mutant) else [self._collected]
        for server in (*servers, self._bare):
            if code == NOT_HERE:
                code = self._noticed(server, tests, mutant, text)
        # 5: the mutant changed which tests there are, and none that ran the line is left.
        return SURVIVED if code in (0, 5) else KILLED

    def _noticed(self, server: Server, tests: list[str], mutant: Mutant, text: Path) -> int | None:
        """Return the exit code; what fails, or is late, without the mutant too notices nothing."""
        changed = [_module(mutant.path), str(self._root / mutant.path), str(text)]
        seconds = 30 + 10 * sum(self._covered.seconds[t] for t in tests)
        while tests:
            code = _asked(server, tests, seconds, changed)
            failed = server.failed()
            if code is None:
                if _asked(server, tests, seconds, None) is not None:
                    return code
                seconds *= 2
            elif not failed or _asked(server, _until(tests, failed), seconds, None) == 0:
                self._covered.kills[failed] += 1
                return code
            else:
                tests = [t for t in tests if t != failed]
        return 0

    def close(self) -> None:
        """End the servers."""
        self._bare.close()
        self._collected.close()
