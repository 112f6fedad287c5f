"""The installed files of fsoe-net with their hashes, and the versions of its environment."""

from __future__ import annotations

import base64
import csv
import hashlib
import importlib.metadata
import importlib.util
import os
import platform
import re
from collections.abc import Mapping
from pathlib import Path

from fsoe_net.dataclass import dataclass
from fsoe_net.version import __version__

_PACKAGE = Path(__file__).parents[1]
_NAME = re.compile(r"[A-Za-z0-9._-]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class InstalledFiles:
    """The current files of the package.

    Attributes:
        hashes: SHA-256 of each file in hex, by path below the parent folder of the package.
        recorded: The same, as recorded by the installer; empty if there is no record.
        is_tree: Whether it is a source tree, which has no record of an installer.
    """

    hashes: Mapping[str, str]
    recorded: Mapping[str, str]
    is_tree: bool

    @property
    def build(self) -> str:
        """SHA-256 over the output of ``sha256sum`` for all files, sorted by path."""
        lines = "".join(f"{self.hashes[path]}  {path}\n" for path in sorted(self.hashes))
        return hashlib.sha256(lines.encode("utf-8")).hexdigest()


def installed_files() -> InstalledFiles:
    """Read every file of the package and the compiled module; nothing is executed.

    Files written by Python itself (``__pycache__``) are excluded.

    Raises:
        OSError: A file cannot be read.
    """
    paths = {
        path.relative_to(_PACKAGE.parent).as_posix(): path
        for folder, _, names in os.walk(_PACKAGE)
        for path in (Path(folder, name) for name in names)
        if "__pycache__" not in path.parts
    }
    spec = importlib.util.find_spec("fsoe_net.core._core")
    if spec is not None and spec.origin is not None:
        module = Path(spec.origin)  # in a source tree, it is elsewhere
        paths[f"{_PACKAGE.name}/core/{module.name}"] = module
    hashes = {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in paths.items()}
    is_tree = (_PACKAGE.parent / "pyproject.toml").is_file()
    return InstalledFiles(hashes=hashes, recorded={} if is_tree else _recorded(), is_tree=is_tree)


def _recorded() -> dict[str, str]:
    """Return the installer's record of this package, if it belongs to this copy."""
    try:
        distribution = importlib.metadata.distribution("fsoe-net")
    except importlib.metadata.PackageNotFoundError:
        return {}
    # Not `distribution.files`, which leaves out files that are missing (from Python 3.12 on).
    rows = list(csv.reader((distribution.read_text("RECORD") or "").splitlines()))
    place = Path(str(distribution.locate_file(f"{_PACKAGE.name}/__init__.py")))
    if not place.is_file() or not place.samefile(_PACKAGE / "__init__.py"):
        return {}
    return {
        # RECORD has base64 without its padding.
        path: base64.urlsafe_b64decode(digest.removeprefix("sha256=") + "==").hex()
        for path, digest in (row[:2] for row in rows if len(row) > 1)
        if path.startswith(f"{_PACKAGE.name}/") and digest.startswith("sha256=")
    }


def shipped(name: str, in_source: str = "") -> Path:
    """Return a file or folder included in the package, or its counterpart in the source tree.

    Args:
        name: Its place in an installed package.
        in_source: Its place in a source tree, if different.
    """
    inside = _PACKAGE / name
    return inside if inside.exists() else _PACKAGE.parent / (in_source or name)


def versions() -> dict[str, str]:
    """Return the versions of fsoe-net, Python, the system and all required packages."""
    found = {
        "fsoe-net": __version__,
        "Python": f"{platform.python_implementation()} {platform.python_version()}",
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
    }
    try:
        needs = importlib.metadata.requires("fsoe-net") or []
    except importlib.metadata.PackageNotFoundError:
        needs = []
    for need in needs:
        name = _NAME.match(need)
        if name is None or "extra ==" in need:
            continue
        try:
            found[name[0]] = importlib.metadata.version(name[0])
        except importlib.metadata.PackageNotFoundError:
            found[name[0]] = "not installed"
    return found
