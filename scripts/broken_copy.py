"""A copy of the project that may be broken: build/broken. Neither recordings nor foreign programs
are found there, and its package is the one that its tests import."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPY = ROOT / "build" / "broken" / "tree"
C_BUILD = COPY.with_name("c")
# An editable installation would load the package of ROOT.
SITE = """import sys
sys.meta_path[:] = [f for f in sys.meta_path if "ScikitBuild" not in type(f).__name__]
"""
BUILT = ("build", "dist", ".venv", ".git", "__pycache__", ".hypothesis", "*_cache", "*.so", "*.pyc")
PASSED, NOTHING_RAN = 0, 5


def _copy(source: str, target: str) -> None:
    """Copy a file that differs; another keeps its time, so that C is not built again."""
    path, copied = Path(source), Path(target)
    is_same = copied.is_file() and path.is_file() and copied.read_bytes() == path.read_bytes()
    if path.is_file() and not is_same:
        shutil.copy(path, copied)


def make() -> None:
    """Make the copy again, of everything but what was built."""
    for old in COPY.rglob("*.py"):
        if not (ROOT / old.relative_to(COPY)).is_file():
            old.unlink()
    ignore = shutil.ignore_patterns(*BUILT)
    shutil.copytree(ROOT, COPY, ignore=ignore, copy_function=_copy, dirs_exist_ok=True)
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
