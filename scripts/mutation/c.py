"""Mutants of the C core: one file compiled, one shared library linked, the tests that reach it."""

from __future__ import annotations

from pathlib import Path

from .c_build import Build, Slot
from .c_reach import Listed, Reach, Trial
from .c_syntax import changes
from .common import INVALID, KILLED, SURVIVED, Mutant, changed_lines

CORE = "master_core/src"
NAMES = ("rt", "plan-loader", "core", "control", "live", "segment", "scan", "client", "backends",
         "app")  # fmt: skip
PARTS = dict.fromkeys(NAMES, CORE)


def ask_quick_tests_only() -> None:
    """Ask the programs listed for a part, and leave out the parts of which they are slow."""
    Runner.reach = Listed
    for part in set(PARTS) - {"rt", "plan-loader"}:
        del PARTS[part]


def sources(part: str, root: Path) -> list[str]:
    """Return the C files of a part, relative to the root of the project."""
    folder = root / CORE
    if part == "plan-loader":
        found = [*(folder / "plan").glob("*.c"), folder / "core/activate.c"]
    elif part == "core":
        found = [p for p in (folder / "core").glob("*.c") if p.stem != "activate"]
        found.append(folder / "backends/emulated.c")
    else:
        found = list((folder.with_name("app") if part == "app" else folder / part).rglob("*.c"))
    return sorted(str(path.relative_to(root)) for path in found)


def mutants(part: str, root: Path) -> list[Mutant]:
    """Return every mutant of a part, in the order of files and places."""
    found = []
    for path in sources(part, root):
        source = (root / path).read_bytes()
        for change in changes(source):
            changed = source[: change.start] + change.text.encode() + source[change.end :]
            line, before, after = changed_lines(source.decode(), changed.decode())
            found.append(Mutant(path, line, change.operator, before, after, changed.decode()))
    return found


class Runner:
    """Tries mutants one after the other, in a folder of its own beside the shared build."""

    reach: type[Reach] | type[Listed] = Reach

    def __init__(self, part: str, work: Path, root: Path) -> None:
        self._build = Build(root.resolve() / "build/mutation/c", root, self.reach.targets(part))
        self._reach = self.reach(part, self._build)
        self._slot = Slot(work.resolve())
        self._bare = Slot(work.resolve().with_name(f"{work.name}-bare"))
        self._bare.clear()

    def run(self, mutant: Mutant) -> str:
        """Return "killed", "survived", or "invalid" for what compiles to the same or not at all."""
        self._slot.clear()
        if not self._build.compile(mutant.path, mutant.source, self._slot):
            return INVALID
        trials = self._reach.tests(mutant.path, mutant.line)
        return KILLED if any(self._notices(trial) for trial in trials) else SURVIVED

    def _notices(self, trial: Trial) -> bool:
        """Whether a trial fails, or is late, with the mutant and not without it."""
        return not trial.passes(self._slot) and trial.passes(self._bare)

    def close(self) -> None:
        """Leave nothing behind."""
        self._slot.clear()
        self._bare.clear()
