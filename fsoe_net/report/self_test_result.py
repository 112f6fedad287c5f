"""The result of ``fsoe-net doctor --self-test`` in a report."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass

from fsoe_net.document.model import Cell, Column, Heading, Level, Part, Table, Verdict, cell, code
from fsoe_net.errors import InputError
from fsoe_net.formats.shared.files import read_source
from fsoe_net.formats.shared.limits import MAX_PASTED_BYTES
from fsoe_net.model.network import SourceFile
from fsoe_net.report.model import Point, open_point

PART_NAMES = (
    "installed files",
    "reference networks",
    "broken networks",
    "CRCs of FSoE",
    "timing formulas",
    "safety function",
    "recorded run",
    "C core and Python",
    "copies",
    "emulated runs",
    "fsn-master",
)
_BUILD = re.compile(r"[0-9a-f]{64}")
_VERSION = re.compile(r"[\w.+-]{1,40}")
_RESULTS = ("pass", "fail", "not tried")
_NEXT = "`fsoe-net doctor --self-test --format json > self-test.json` writes one"


@dataclass(frozen=True, slots=True, kw_only=True)
class SelfTestResult:
    """A file with the result of a self-test.

    Attributes:
        source: The file.
        version: Version of the tested fsoe-net.
        build: SHA-256 over its files, in hex.
        here: The same for the fsoe-net that creates the report.
        parts: Result of each part by name: ``pass``, ``fail`` or ``not tried``.
    """

    source: SourceFile
    version: str
    build: str
    here: str
    parts: tuple[tuple[str, str], ...]

    def named(self, result: str) -> list[str]:
        """Return the parts with this result."""
        return [name for name, found in self.parts if found == result]

    @property
    def verdict(self) -> Verdict:
        """Verdict on the tool that creates the report."""
        failed = self.named("fail")
        if failed or not self.named("pass"):
            return Verdict(f"FAILED: {', '.join(failed) or 'nothing was tried'}", Level.ERROR)
        if self.build != self.here:
            return Verdict("of another build than this report", Level.OPEN)
        return Verdict("passed", Level.CLEAR)


def read_self_test(path: str, here: str) -> SelfTestResult:
    """Read the output of ``fsoe-net doctor --self-test --format json``.

    Args:
        path: Its file.
        here: Build of this installation, SHA-256 in hex.

    Raises:
        InputError: The file cannot be read, or has another content.
    """
    source, data = read_source(path, most=MAX_PASTED_BYTES)
    try:
        document = json.loads(data.decode("utf-8"))
        # Other tools also write JSON with parts and results.
        if document["tool"] != "fsoe-net" or document["self_test"] != 1:
            raise ValueError("it is of another tool or form")
        parts = tuple((str(p["name"]), str(p["result"])) for p in document["parts"])
        if any(result not in _RESULTS for _, result in parts):
            raise ValueError("a part has no known result")
        version, build = str(document["version"]), str(document["build"]["sha256"])
        # Without build and version the result cannot be assigned to an installation.
        if not _BUILD.fullmatch(build) or not _VERSION.fullmatch(version):
            raise ValueError("it does not state of which build it is")
        # The parts of another build may differ; those of this build are known.
        if build == here and [name for name, _ in parts] != list(PART_NAMES):
            raise ValueError("it does not have the parts of this build")
        # A result edited by hand does not match its parts.
        if document["result"] != ("fail" if "fail" in dict(parts).values() else "pass"):
            raise ValueError("its result does not fit its parts")
    except (ValueError, KeyError, TypeError, RecursionError) as exc:
        raise InputError(f"{path} is not the result of a self-test: {exc}; {_NEXT}") from exc
    return SelfTestResult(source=source, version=version, build=build, here=here, parts=parts)


def self_test_parts(result: SelfTestResult) -> tuple[list[Part], list[Point]]:
    """Return the statement of block 1 about the tool, and the open points."""
    verdict = result.verdict
    points = []
    if verdict.level is not Level.CLEAR:
        points.append(open_point(f"self-test of the tool: {verdict.word}"))
    not_tried = ", ".join(result.named("not tried"))
    rows: list[tuple[Cell, Cell]] = [
        (cell("Result"), cell(verdict)),
        (cell("Passed"), cell(", ".join(result.named("pass")))),
        (cell("Not tried"), cell(not_tried or "nothing")),
        (cell("Tried"), cell(f"fsoe-net {result.version}")),
        (cell("Build"), cell(code(result.build))),
        (cell("File"), cell(code(result.source.path))),
        (cell("SHA-256"), cell(code(result.source.sha256))),
    ]
    columns = (Column("What"), Column("Value"))
    table = Table(name="self-test", columns=columns, rows=tuple(rows))
    return [Heading("Self-test of the tool"), table], points
