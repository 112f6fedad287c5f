"""Findings as a whole: errors, and their text and documents."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import overload
from urllib.parse import quote

from fsoe_net.diag.catalogue import CATALOGUE
from fsoe_net.diag.diagnostic import Diagnostic, Severity, sort_diagnostics
from fsoe_net.diag.printable import printable
from fsoe_net.diag.words import summary
from fsoe_net.project.excerpt import excerpt
from fsoe_net.rules.effects import effect_today
from fsoe_net.rules.runtime import Runtime
from fsoe_net.version import __version__

_DOCS = "https://fsoe-net.github.io/fsoe-net/diagnostics"


class Findings(Sequence[Diagnostic]):
    """The findings of a network, sorted by file, line and column.

    Args:
        diagnostics: Findings in any order.
        runtime: Runtime whose current handling of each mistake is added to the documents.
    """

    def __init__(self, diagnostics: Iterable[Diagnostic], runtime: Runtime = Runtime.FSN) -> None:
        self._rows = tuple(sort_diagnostics(diagnostics))
        self._runtime = runtime

    @overload
    def __getitem__(self, index: int) -> Diagnostic: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Diagnostic, ...]: ...
    def __getitem__(self, index: int | slice) -> Diagnostic | tuple[Diagnostic, ...]:
        return self._rows[index]

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(self._rows)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Findings) and self._rows == other._rows

    def __hash__(self) -> int:
        return hash(self._rows)

    def __repr__(self) -> str:
        return f"<Findings: {summary(self._rows) or 'none'}>"

    def __str__(self) -> str:
        """Return the output of ``fsoe-net check``, without colours and lines of files."""
        return "\n".join(finding_text(row, self._runtime) for row in self._rows)

    @property
    def errors(self) -> tuple[Diagnostic, ...]:
        """Findings that prevent the network from being compiled."""
        return self._of(Severity.ERROR)

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """Findings that a person must judge."""
        return self._of(Severity.WARNING)

    @property
    def notes(self) -> tuple[Diagnostic, ...]:
        """Notes for information."""
        return self._of(Severity.INFO)

    @property
    def ok(self) -> bool:
        """Whether there are no errors; warnings are allowed."""
        return not self.errors

    def to_json(self) -> dict[str, object]:
        """Return the document of ``fsoe-net check --format json``."""
        return json_document(self._rows, self._runtime)

    def _of(self, level: Severity) -> tuple[Diagnostic, ...]:
        return tuple(row for row in self._rows if row.level is level)


def finding_text(
    d: Diagnostic,
    runtime: Runtime = Runtime.FSN,
    *,
    level: str | None = None,
    folders: Iterable[str] = (),
) -> str:
    """Return a finding as lines: place, message, line of the file, related places, hint, effect.

    Args:
        d: The finding.
        runtime: Adds how this runtime handles the mistake today.
        level: Replacement for ``error[FSN202]``, such as the same text in colour.
        folders: Folders whose files may be shown, see `excerpt`.
    """
    level = level or f"{d.level.value}[{d.code}]"
    lines = [f"{printable(str(d.span))}: {level}: {printable(d.message)}"]
    lines += excerpt(d.span, folders)
    for r in d.related:
        place = "" if r.span == d.span else f"see {r.span}: "
        lines.append(printable(f"  {place}{r.message}"))
    if d.hint:
        lines.append(printable(f"  hint: {d.hint}"))
    today = effect_today(d.code, runtime)
    if today and d.level is not Severity.INFO:
        lines.append(f"  today: {runtime.value} {today}")
    return "\n".join(lines)


def json_document(diagnostics: Sequence[Diagnostic], runtime: Runtime) -> dict[str, object]:
    """Return the stable JSON document of findings."""
    rows = []
    for d in diagnostics:
        row = d.to_json()
        today = effect_today(d.code, runtime)
        if today:
            row["today"] = today
        rows.append(row)
    return {
        "tool": "fsoe-net",
        "version": __version__,
        "runtime": runtime.value,
        "errors": sum(d.level is Severity.ERROR for d in diagnostics),
        "warnings": sum(d.level is Severity.WARNING for d in diagnostics),
        "diagnostics": rows,
    }


def github_line(d: Diagnostic) -> str:
    """Return a GitHub workflow command; `%`, newlines and separators are escaped."""
    word = {"error": "error", "warning": "warning", "info": "notice"}[d.level.value]
    place = f"file={_escape(d.span.file, prop=True)}"
    if d.span.line:
        place += f",line={d.span.line},col={d.span.column}"
    text = d.message + (f"\nhint: {d.hint}" if d.hint else "")
    return f"::{word} {place},title={d.code}::{_escape(text)}"


def _escape(text: str, *, prop: bool = False) -> str:
    text = text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
    return text.replace(":", "%3A").replace(",", "%2C") if prop else text


def sarif_document(diagnostics: Sequence[Diagnostic], runtime: Runtime) -> dict[str, object]:
    """Return findings as SARIF 2.1.0."""
    level = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "note"}
    codes = sorted({d.code for d in diagnostics})
    return {
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [
            {
                "tool": {
                    "driver": {
                        "name": "fsoe-net",
                        "version": __version__,
                        "rules": [
                            {
                                "id": code,
                                "shortDescription": {"text": CATALOGUE[code].title},
                                "helpUri": f"{_DOCS}/{code}.html",
                            }
                            for code in codes
                        ],
                    }
                },
                "results": [
                    {
                        "ruleId": d.code,
                        "ruleIndex": codes.index(d.code),
                        "level": level[d.level],
                        "message": {"text": d.message + (f"\nhint: {d.hint}" if d.hint else "")},
                        **_today(d, runtime),
                        "locations": [_sarif_place(d.span.file, d.span.line, d.span.column)],
                        "relatedLocations": [
                            {
                                **_sarif_place(r.span.file, r.span.line, r.span.column),
                                "message": {"text": r.message},
                            }
                            for r in d.related
                        ],
                    }
                    for d in diagnostics
                ],
            }
        ],
    }


def _today(d: Diagnostic, runtime: Runtime) -> dict[str, object]:
    """Return how the runtime handles it today, as a property bag of SARIF."""
    today = effect_today(d.code, runtime)
    return {"properties": {"runtime": runtime.value, "today": today}} if today else {}


def _sarif_place(file: str, line: int, column: int) -> dict[str, object]:
    # SARIF requires a URI, so blanks and other signs are escaped.
    place: dict[str, object] = {"artifactLocation": {"uri": quote(file)}}
    # Line 0 is the whole file; SARIF counts from 1.
    if line:
        place["region"] = {"startLine": line, "startColumn": column}
    return {"physicalLocation": place}
