"""All parts of the self-test, in the order of execution."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fsoe_net.errors import EnvironmentFault
from fsoe_net.project.installed import installed_files, versions
from fsoe_net.report.self_test_result import PART_NAMES
from fsoe_net.self_test import engines, formulas, installation, networks
from fsoe_net.self_test.model import PartResult, SelfTestPart, tried

_INSTALL = "install fsoe-net again, into an empty environment, and repeat the self-test"
_FILES = f"a file was changed, is missing or was added: {_INSTALL}"
_STOP = (
    f"do not use what this installation writes; {_INSTALL}; if it differs again, hand in the output"
    " of `fsoe-net doctor --self-test --format json`"
)
_MASTER = (
    "do not start this fsn-master on a machine; build it again: `fsoe-net install-master "
    "--overwrite`"
)
PARTS = tuple(
    SelfTestPart(name=name, compare=compare, next_step=next_step)
    for name, (compare, next_step) in zip(
        PART_NAMES,
        (
            (installation.recorded_files, _FILES),
            (networks.reference_networks, _STOP),
            (networks.broken_networks, _STOP),
            (formulas.crcs_of_fsoe, _STOP),
            (formulas.timing, _STOP),
            (networks.safety_functions, _STOP),
            (engines.known_conversations, _STOP),
            (engines.core_and_python, _STOP),
            (engines.copies, _STOP),
            (networks.emulated_runs, _STOP),
            (installation.master, _MASTER),
        ),
        strict=True,
    )
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SelfTest:
    """Result of the self-test, and the installation that it applies to.

    Attributes:
        versions: Versions of fsoe-net, Python, the system and each package, by name.
        build: SHA-256 over all installed files.
        files: Number of these files.
        kind: ``installed`` or ``source tree``.
        master: ``fsn-master`` with its SHA-256; ``None`` if there is none.
        parts: Results of the parts, in order.
    """

    versions: Mapping[str, str]
    build: str
    files: int
    kind: str
    master: tuple[str, str] | None
    parts: tuple[PartResult, ...]

    @property
    def passed(self) -> bool:
        """Whether all values match."""
        return all(part.result != "fail" for part in self.parts)

    def to_json(self) -> dict[str, object]:
        """Return the stable JSON document (``docs/reference/json-output.md``)."""
        master = self.master and {"version": self.master[0], "sha256": self.master[1]}
        return {
            "tool": "fsoe-net",
            "version": self.versions["fsoe-net"],
            "self_test": 1,
            "result": "pass" if self.passed else "fail",
            "build": {"sha256": self.build, "files": self.files, "kind": self.kind},
            "fsn_master": master,
            "versions": dict(self.versions),
            "parts": [_part_json(part) for part in self.parts],
        }


def _part_json(part: PartResult) -> dict[str, object]:
    return {
        "name": part.name,
        "result": part.result,
        "compared": part.compared,
        "not_tried": part.not_tried or None,
        "different": [
            {"what": d.what, "expected": str(d.expected), "got": str(d.got)} for d in part.different
        ],
        "next_step": part.next_step or None,
    }


def run_self_test() -> SelfTest:
    """Run every part; no file is written, no interface is opened.

    Raises:
        OSError: A file of the package cannot be read.
    """
    files = installed_files()
    return SelfTest(
        versions=versions(),
        build=files.build,
        files=len(files.hashes),
        kind="source tree" if files.is_tree else "installed",
        master=master_state(),
        parts=tuple(map(tried, PARTS)),
    )


def master_state() -> tuple[str, str] | None:
    """Return the version and SHA-256 of ``fsn-master``; ``None`` if there is none."""
    from fsoe_net.live.master import find_master

    try:
        program = find_master()
        version = installation.master_version(program)
        return version, hashlib.sha256(Path(program).read_bytes()).hexdigest()
    except EnvironmentFault:
        return None
    except (OSError, subprocess.SubprocessError) as exc:
        return f"cannot be started: {exc}", ""
