"""The build of the C core for mutants: shared libraries, one of which is exchanged per mutant."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

PLAIN = "-O1"
COVERED = "-O0 --coverage -fprofile-update=atomic"
_REAL_ERRORS = [
    "-Werror=incompatible-pointer-types",
    "-Werror=int-conversion",
    "-Werror=implicit-function-declaration",
]
_SITE = """import sys
sys.meta_path[:] = [f for f in sys.meta_path if "ScikitBuild" not in type(f).__name__]
"""


@dataclass(frozen=True, slots=True)
class Slot:
    """A place where one mutant lives: its library and programs go before the built ones."""

    folder: Path

    @property
    def libraries(self) -> Path:
        """Where its library and programs are."""
        return self.folder / "lib"

    def clear(self) -> None:
        """Make it empty."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self.libraries.mkdir(parents=True)


class Build:
    """Everything compiled once, or only what some targets need; `work` holds it."""

    def __init__(self, work: Path, root: Path, targets: Sequence[str]) -> None:
        self.work = work.resolve()
        self.root = root.resolve()
        self.plain = self._make("plain", PLAIN, targets)
        self._commands: dict[str, list[dict[str, str]]] = {}
        for entry in json.loads((self.plain / "compile_commands.json").read_text()):
            file = Path(entry["file"]).resolve()
            if file.is_relative_to(self.root) and (
                _is_library(entry["output"]) or _is_in_programs(file)
            ):
                path = str(file.relative_to(self.root))
                self._commands.setdefault(path, []).append(entry)

    def covered(self) -> Path:
        """Return the build that counts which lines run."""
        return self._make("covered", COVERED)

    def _make(self, name: str, flags: str, targets: Sequence[str] = ("all",)) -> Path:
        folder = self.work / name
        configure = [
            *("cmake", "-S", str(self.root), "-B", str(folder), "-DCMAKE_BUILD_TYPE=None"),
            *(f"-DCMAKE_C_FLAGS={flags}", "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON"),
            *("-DFSN_EXCHANGEABLE=ON", "-DFSN_BUILD_TESTS=ON", "-DFSN_MASTER=ON"),
            *("-DFSN_INSTALL=OFF", f"-DPython_EXECUTABLE={sys.executable}"),
        ]
        with self.locked():
            quiet(configure)
            quiet(["cmake", "--build", str(folder), "-j2", "--target", *targets])
            self._site(folder)
        return folder

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runners out: they share what is built here."""
        self.work.mkdir(parents=True, exist_ok=True)
        with (self.work / "lock").open("w") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            yield

    def _site(self, folder: Path) -> None:
        """Make a package that loads this build's module, whatever is installed."""
        site = folder / "site"
        if site.exists():
            return
        core = site / "fsoe_net" / "core"
        core.mkdir(parents=True)
        (site / "sitecustomize.py").write_text(_SITE)
        for name in ("schemas", "docs"):
            (site / name).symlink_to(self.root / name)
        for path in (self.root / "fsoe_net").iterdir():
            if path.name not in ("core", "__pycache__"):
                (site / "fsoe_net" / path.name).symlink_to(path)
        for path in (self.root / "fsoe_net/core").iterdir():
            if path.name != "__pycache__":
                (core / path.name).symlink_to(path)
        (core / "_core.abi3.so").symlink_to(folder / "_core.abi3.so")

    def compile(self, path: str, source: str, slot: Slot) -> bool:
        """Build what this file is in with the file changed; false if that makes no difference."""
        changed = slot.folder / Path(path).name
        changed.write_text(source)
        return all(self._compile(path, changed, slot, entry) for entry in self._commands[path])

    def _compile(self, path: str, changed: Path, slot: Slot, entry: dict[str, str]) -> bool:
        command = [w for w in shlex.split(entry["command"]) if not w.startswith("-W")]
        command[command.index("-c") + 1] = str(changed)
        made, out = slot.folder / "changed.o", command.index("-o") + 1
        original = Path(entry["directory"]) / command[out]
        command[out] = str(made)
        # Headers beside the file, as if it stood in its own folder; no path of it in the object.
        command += [*_REAL_ERRORS, "-iquote", str((self.root / path).parent)]
        done = subprocess.run(command, cwd=entry["directory"], capture_output=True, check=False)
        if done.returncode != 0 or _code(made) == _code(original):
            return False
        self._link(original, made, slot)
        return True

    def _link(self, original: Path, made: Path, slot: Slot) -> None:
        directory = self.plain / "master_core"
        name = str(original.relative_to(directory))
        for text in directory.glob("CMakeFiles/*.dir/link.txt"):
            command = shlex.split(text.read_text())
            if name in command and "-o" in command:
                library = command[command.index("-o") + 1]
                command[command.index("-o") + 1] = str(slot.libraries / library)
                command[command.index(name)] = str(made)
                quiet(command, directory)
                return
        raise AssertionError(f"{name} is in no library or program")


def _is_in_programs(file: Path) -> bool:
    """Whether programs and tests have a file compiled in, beside or instead of a library."""
    return "app" in file.parts or file.parent.name in ("client", "igh")


def _is_library(output: str) -> bool:
    return any(f"CMakeFiles/fsn_{part}.dir/" in output for part in _LIBRARIES)


_LIBRARIES = ("rt", "setup", "segment", "control", "soem", "client", "igh")


def _code(path: Path) -> bytes:
    """Return an object without the name of its source."""
    stripped = path.with_suffix(".code")
    quiet(["objcopy", "--strip-all", "--keep-symbol=none", str(path), str(stripped)])
    return stripped.read_bytes()


def quiet(command: list[str], directory: Path | None = None) -> None:
    """Run what must succeed; its output is shown only where it does not."""
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")


def environment(build: Path, **more: str) -> dict[str, str]:
    """Return what a test needs to load this build."""
    path = f"{build / 'master_core'}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    return {
        **os.environ,
        "PATH": path,
        "PYTHONPATH": str(build / "site"),
        "PYTHONDONTWRITEBYTECODE": "1",
        **more,
    }
