"""The signed report, read from its JSON form and its pages."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fsoe_net.diag.diagnostic import Diagnostic, Severity, Span
from fsoe_net.document.model import Level
from fsoe_net.errors import InputError
from fsoe_net.model.network import SourceFile

_HASH = re.compile(rb"(?<![0-9a-f])[0-9a-f]{64}(?![0-9a-f])")


@dataclass(frozen=True, slots=True, kw_only=True)
class SignedReport:
    """The signed report, with the findings of its JSON form.

    Attributes:
        sources: Its files.
        whole: The fingerprint in it; empty without one.
        findings: Its findings, including errors and notes.
        open_points: Number of open points, and
        assumptions: number of assumptions.
        of_machine: Whether it contains data from the machine: a scan, a run, a running bus.
        against: Its verdict if that is negative; empty otherwise.
        pages: Number of its files that are pages for people.
        not_of: Pages without that fingerprint.
        hashes: SHA-256 values named in each file except a PDF.
    """

    sources: tuple[SourceFile, ...]
    whole: str
    findings: tuple[Diagnostic, ...]
    open_points: int
    assumptions: int
    of_machine: bool = True
    against: str = ""
    pages: int = 0
    not_of: tuple[str, ...] = ()
    hashes: Mapping[str, frozenset[str]] = field(default_factory=dict)


def read_signed_report(files: Sequence[tuple[SourceFile, bytes]]) -> SignedReport:
    """Read the report: the JSON form for facts, the other files only for the fingerprint.

    Raises:
        InputError: No JSON form among the files, or it is invalid.
    """
    source, data = _json_form(files)
    try:
        document = json.loads(data)
        whole = str((document["fingerprint"] or {}).get("whole", ""))
        findings = tuple(_finding(f) for f in document["findings"])
        kinds = [p["kind"] for p in document["points"]]
        # Only a real `true`: any other value must not pass as evidence of the machine.
        of_machine = document.get("of_machine") is True
        verdict = document["verdict"]
        against = str(verdict["word"]) if verdict["level"] == Level.ERROR.value else ""
    except (
        ArithmeticError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        RecursionError,
    ) as exc:
        raise InputError(f"{source.path} is not a report of fsoe-net in JSON") from exc
    # A PDF cannot be searched for hashes; its JSON form has them.
    pages = [(s.path, d) for s, d in files if s is not source and not d.startswith(b"%PDF")]
    hashes = {
        path: frozenset(found.decode("ascii") for found in _HASH.findall(text))
        for path, text in ((source.path, data), *pages)
    }
    return SignedReport(
        sources=tuple(s for s, _ in files),
        whole=whole,
        findings=findings,
        open_points=kinds.count("open"),
        assumptions=kinds.count("assumption"),
        of_machine=of_machine,
        against=against,
        pages=len(files) - 1,
        not_of=tuple(path for path, _ in pages if whole not in hashes[path]),
        hashes=hashes,
    )


def _json_form(files: Sequence[tuple[SourceFile, bytes]]) -> tuple[SourceFile, bytes]:
    documents = [(source, data) for source, data in files if data.lstrip()[:1] == b"{"]
    if len(documents) != 1:
        names = ", ".join(source.path for source, _ in files)
        raise InputError(
            f"{names}: {'no' if not documents else 'more than one'} report in JSON; write it with "
            "`fsoe-net report … -o report.json` in addition to the page, with the same options, "
            "and name both with --report"
        )
    return documents[0]


def _finding(row: dict[str, Any]) -> Diagnostic:
    return Diagnostic(
        code=str(row["code"]),
        severity=Severity(row["severity"]),
        message=str(row["message"]),
        span=Span(str(row["file"]), int(row["line"]), int(row["column"])),
    )
