"""Builds ``fsn-master`` with SOEM, and ``fsn-bench``, from the C source in this package."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

from fsoe_net.errors import EnvironmentFault

# SOEM 1.4 is part of the source distribution of pysoem in the package index.
_PYSOEM = "1.1.13"
_SHA256 = "4be98d8531e492f2ee5d21f6ef51e51493a10ee1322ed22e909c91a8bcfff950"

SOEM_TERMS = (
    f"SOEM 1.4 (from pysoem {_PYSOEM}) drives the bus. It is under the GPL, version 2, with an "
    "exception for linking. A copy of fsn-master that is built with it contains SOEM. "
    "EtherCAT is a patented technology of Beckhoff Automation GmbH: using a MainDevice needs the "
    "licence that the EtherCAT Technology Group arranges."
)


def master_place() -> Path:
    """Return the install path of ``fsn-master``, next to the interpreter; searched first."""
    return Path(sys.executable).parent / "fsn-master"


def fetch_soem(folder: Path) -> Path:
    """Download the source of SOEM once.

    Args:
        folder: Folder for the archive and its content.

    Returns:
        The folder for ``SOEM_SOURCE_DIR``.

    Raises:
        EnvironmentFault: The package index does not answer, or returns another file.
    """
    source = folder / f"pysoem-{_PYSOEM}" / "soem"
    if (source / "soem" / "ethercatmain.h").is_file():
        return source
    folder.mkdir(parents=True, exist_ok=True)
    _pip(
        ["download", "--no-deps", "--no-binary", "pysoem", "--dest", str(folder)],
        f"pysoem=={_PYSOEM}",
        "the source of SOEM cannot be fetched",
    )
    archive = folder / f"pysoem-{_PYSOEM}.tar.gz"
    if hashlib.sha256(archive.read_bytes()).hexdigest() != _SHA256:
        # pip reuses an existing file, so it would be rejected each time.
        archive.unlink()
        raise EnvironmentFault(f"{archive}: not the file that was expected (SHA-256); deleted")
    with tarfile.open(archive) as tar:
        # Not as an argument: Python 3.11 of Debian 12 does not support it.
        tar.extraction_filter = getattr(tarfile, "data_filter", None)
        tar.extractall(folder)  # noqa: S202 - the filter above
    return source


def build_master(
    target: Path, *, soem: Path | None = None, with_soem: bool = True, build: Path | None = None
) -> str:
    """Build ``fsn-master`` and install it; with SOEM also ``fsn-bench``, in the same folder.

    Args:
        target: Path of the program; replaces an old one, while running instances continue.
        soem: Source of SOEM 1.4; downloaded by default.
        with_soem: ``False``: only buses whose libraries are installed here (IgH).
        build: Build folder to keep, for faster rebuilds; default: a temporary folder.

    Returns:
        The output of ``fsn-master --version``.

    Raises:
        EnvironmentFault: A tool or the source of SOEM is missing, or the build failed.
    """
    if shutil.which("cc") is None and shutil.which("gcc") is None:
        raise EnvironmentFault("no C compiler: sudo apt-get install build-essential")
    with tempfile.TemporaryDirectory(prefix="fsn-master-") as temporary:
        work = Path(temporary)
        folder = build or work / "build"
        cmake, env = _cmake(work)
        options = ["-DFSN_BUILD_TESTS=OFF", "-DFSN_INSTALL=OFF"]
        if with_soem:
            # The source is checked first: with SOEM 2 the build fails late, with compiler errors
            # only.
            given = None if soem is None else _is_soem_1(soem)
            soem = given or fetch_soem(build.parent / "soem" if build else work / "soem")
            options += ["-DFSN_SOEM=ON", f"-DSOEM_SOURCE_DIR={soem.resolve()}"]
        else:
            options += ["-DFSN_SOEM=OFF"]
        _run([*cmake, "-S", str(_source()), "-B", str(folder), *options], "cmake", env)
        jobs = str(os.cpu_count() or 1)
        targets = {"fsn-master": target}
        if with_soem:
            targets["fsn-bench"] = target.with_name("fsn-bench")
        _run(
            [*cmake, "--build", str(folder), "-j", jobs, "--target", *targets], "the compiler", env
        )
        for name, place in targets.items():
            _install(folder / name, place)
    # Runs the result once, so that a missing library is reported here and not at the bus.
    return _run([str(target), "--version"], str(target), {})


def _install(program: Path, target: Path) -> None:
    # Copy, then rename: overwriting the file of a running program fails with "text file busy".
    fresh = target.with_name(f".{target.name}.new")
    try:
        shutil.copy2(program, fresh)
        fresh.replace(target)
    except OSError as exc:
        raise EnvironmentFault(f"{target}: {exc.strerror}; --output FILE names a place") from exc


def _is_soem_1(folder: Path) -> Path:
    """Return the folder; reject one that is not the source of SOEM 1.4."""
    if (folder / "soem" / "ethercatmain.h").is_file():
        return folder
    if (folder / "include" / "soem").is_dir():
        found = "SOEM 2, which is not supported"
    else:
        found = "not the source of SOEM: it has no soem/ethercatmain.h"
    raise EnvironmentFault(
        f"{folder}: {found}; fsn-master is built with SOEM 1.4, fetched without --soem"
    )


def _source() -> Path:
    package = Path(__file__).parents[1]
    for folder in (package.parent / "master_core", package / "master_core"):
        if (folder / "CMakeLists.txt").is_file():
            return folder
    raise EnvironmentFault("the C source is not part of this installation; install it again")


def _cmake(work: Path) -> tuple[list[str], dict[str, str]]:
    """Return the command for CMake and its environment; CMake is fetched if it is missing."""
    # This environment need not be active, so its folder may be missing from PATH.
    beside = Path(sys.executable).parent / "cmake"
    found = str(beside) if beside.is_file() else shutil.which("cmake")
    if found is not None:
        return [found], {}
    _pip(
        ["install", "--target", str(work / "cmake")],
        "cmake",
        "there is no CMake (sudo apt-get install cmake), and it cannot be fetched",
    )
    return [str(work / "cmake" / "bin" / "cmake")], {"PYTHONPATH": str(work / "cmake")}


def _pip(arguments: Sequence[str], package: str, refusal: str) -> None:
    if importlib.util.find_spec("pip") is None:
        raise EnvironmentFault(f"{refusal}: this Python has no pip")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    _run([*pip, *arguments, package], refusal, {})


def _run(command: Sequence[str], what: str, env: dict[str, str]) -> str:
    done = subprocess.run(  # noqa: S603 - our own arguments, no shell
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=os.environ | {"NO_COLOR": "1"} | env,  # under make on a terminal, CMake uses colours
        check=False,
    )
    text = done.stdout.decode("utf-8", "replace")
    if done.returncode != 0:
        lines = text.strip().splitlines() or ["no word why"]
        # The first error counts: later errors result from it, and make only adds that it stopped.
        at = next((n for n, line in enumerate(lines) if "error" in line.lower()), len(lines) - 1)
        # CMake gives the reason on the following lines, up to an empty one.
        rest = takewhile(str.strip, lines[at:]) if lines[at].startswith("CMake") else [lines[at]]
        reason = " ".join(" ".join(rest).split())
        raise EnvironmentFault(f"{what}: exit code {done.returncode}: {reason}")
    return text
