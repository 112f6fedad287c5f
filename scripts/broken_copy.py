"""A copy of the project that may be broken: build/broken. Neither recordings nor foreign programs
are found there, and its package is the one that its tests import."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPY = ROOT / "build" / "broken" / "tree"
C_BUILD = COPY.with_name("c")
# An editable installation would load the package of ROOT.
SITE = """import sys
sys.meta_path[:] = [f for f in sys.meta_path if "ScikitBuild" not in type(f).__name__]
"""
BUILT = ("build", "dist", ".venv", ".git", "__pycache__", ".hypothesis")
PASSED, NOTHING_RAN = 0, 5


def _sources() -> Iterator[str]:
    """Yield the files of the project, relative to it; nothing that was built."""
    for folder, inner, files in os.walk(ROOT):
        inner[:] = [n for n in inner if n not in BUILT and not n.endswith("_cache")]
        for name in files:
            path = Path(folder, name)
            if path.suffix not in (".so", ".pyc") and path.is_file():
                yield str(path.relative_to(ROOT))


def make() -> None:
    """Make the copy again; unchanged files keep their time, so that C is not built again."""
    names = set(_sources())
    for old in COPY.rglob("*.py"):
        if str(old.relative_to(COPY)) not in names:
            old.unlink()
    for name in names:
        source, target = ROOT / name, COPY / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if not target.is_file() or target.read_bytes() != source.read_bytes():
            shutil.copy(source, target)
    (COPY / "sitecustomize.py").write_text(SITE)
    core = subprocess.run(
        [sys.executable, "-c", "from fsoe_net.core import _core; print(_core.__file__)"],
        cwd=tempfile.gettempdir(), capture_output=True, text=True, check=True,
    ).stdout.strip()  # fmt: skip
    link = COPY / "fsoe_net" / "core" / Path(core).name
    link.unlink(missing_ok=True)
    link.symlink_to(core)


def python_fails(tests: Iterable[str], *options: str, seconds: float | None = None) -> bool:
    """Whether one of these tests fails, or does not end in time."""
    env = {"PYTHONPATH": str(COPY), "FSN_TEST_DATA": str(COPY / "none")}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    command += ["-p", "no:xdist", "--hypothesis-seed=0", *options]
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
        file.write("".join(f"{test}\n" for test in tests))
        file.flush()
        try:
            done = subprocess.run(
                [*command, f"@{file.name}"],
                cwd=COPY, env=os.environ | env | {"PYTHONDONTWRITEBYTECODE": "1"},
                capture_output=True, text=True, check=False, timeout=seconds,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return True
    return done.returncode not in (PASSED, NOTHING_RAN)


def build_c(names: Iterable[str]) -> bool:
    """Build test programs of the C core; false where the compiler refuses."""
    options = ("-DFSN_BUILD_TESTS=ON", "-DFSN_MASTER=ON", "-DFSN_INSTALL=OFF")
    for command in (
        ("cmake", "-S", COPY / "master_core", "-B", C_BUILD, *options),
        ("cmake", "--build", C_BUILD, "-j2", "--target", *(f"test_{n}" for n in names)),
    ):
        if subprocess.run(command, capture_output=True, check=False).returncode:
            return False
    return True


def c_fails(names: Iterable[str]) -> bool:
    """Whether a built test program fails, or does not end in time."""
    pattern = f"^({'|'.join(names)})$"
    command = ("ctest", "--test-dir", C_BUILD, "-R", pattern, "--timeout", "60")
    return subprocess.run(command, capture_output=True, check=False).returncode != 0
