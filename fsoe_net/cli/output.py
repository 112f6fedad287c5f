"""How findings are printed: text, JSON, SARIF 2.1.0, GitHub annotations."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from urllib.parse import quote

import click

from fsoe_net import __version__
from fsoe_net.cli.terminal import echo
from fsoe_net.diag import CATALOGUE, Diagnostic, Severity, printable
from fsoe_net.rules import Runtime, effect_today

__all__ = ["FORMATS", "exit_code", "print_diagnostics"]

_MOST_OF_A_CODE = 100  # shown as text; one mistake made everywhere is read once

FORMATS = ("text", "json", "sarif", "github")

_COLOUR = {Severity.ERROR: "red", Severity.WARNING: "yellow", Severity.INFO: "cyan"}
_DOCS = "https://fsoe-net.readthedocs.io/diagnostics"


def exit_code(diagnostics: Sequence[Diagnostic]) -> int:
    """Return 1 when there is an error or a warning, else 0."""
    return int(any(d.level is not Severity.INFO for d in diagnostics))


def print_diagnostics(
    diagnostics: Sequence[Diagnostic],
    fmt: str = "text",
    *,
    err: bool = False,
    runtime: Runtime = Runtime.FSN,
) -> None:
    """Print findings in one of `FORMATS`.

    Args:
        diagnostics: Sorted findings.
        fmt: ``text``, ``json``, ``sarif`` or ``github``.
        err: Print to standard error.
        runtime: Adds what this runtime does today with each mistake.
    """
    if fmt == "json":
        echo(json.dumps(_json(diagnostics, runtime), indent=2, ensure_ascii=False), err=err)
    elif fmt == "sarif":
        echo(json.dumps(_sarif(diagnostics, runtime), indent=2, ensure_ascii=False), err=err)
    elif fmt == "github":
        for diagnostic in diagnostics:
            echo(_github(diagnostic, runtime), err=err)
    else:
        _print_text(diagnostics, runtime, err=err)


def _print_text(diagnostics: Sequence[Diagnostic], runtime: Runtime, *, err: bool) -> None:
    """Print the first findings of each code, then how many more there are."""
    counts: Counter[str] = Counter()
    for diagnostic in diagnostics:
        counts[diagnostic.code] += 1
        if counts[diagnostic.code] <= _MOST_OF_A_CODE:
            click.echo(_text(diagnostic, runtime), err=err)
    for code, count in sorted(counts.items()):
        if count > _MOST_OF_A_CODE:
            more = f"{code}: {count - _MOST_OF_A_CODE} more ({CATALOGUE[code].title})"
            echo(f"{more}; `fsoe-net check --format json` lists all", err=err)


def _text(d: Diagnostic, runtime: Runtime) -> str:
    level = click.style(f"{d.level.value}[{d.code}]", fg=_COLOUR[d.level], bold=True)
    lines = [f"{printable(str(d.span))}: {level}: {printable(d.message)}"]
    lines += [printable(f"  see {r.span}: {r.message}") for r in d.related]
    if d.hint:
        lines.append(printable(f"  hint: {d.hint}"))
    today = effect_today(d.code, runtime)
    if today and d.level is not Severity.INFO:
        lines.append(f"  today: {runtime.value} {today}")
    return "\n".join(lines)


def _json(diagnostics: Sequence[Diagnostic], runtime: Runtime) -> dict[str, object]:
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


def _github(d: Diagnostic, _runtime: Runtime) -> str:
    """GitHub workflow command; `%`, newlines and separators are escaped as GitHub asks."""
    word = {"error": "error", "warning": "warning", "info": "notice"}[d.level.value]
    place = f"file={_escape(d.span.file, prop=True)}"
    if d.span.line:
        place += f",line={d.span.line},col={d.span.column}"
    text = d.message + (f"\nhint: {d.hint}" if d.hint else "")
    return f"::{word} {place},title={d.code}::{_escape(text)}"


def _escape(text: str, *, prop: bool = False) -> str:
    text = text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
    return text.replace(":", "%3A").replace(",", "%2C") if prop else text


def _sarif(diagnostics: Sequence[Diagnostic], runtime: Runtime) -> dict[str, object]:
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
    """Return what the present runtime does, as a property bag of SARIF."""
    today = effect_today(d.code, runtime)
    return {"properties": {"runtime": runtime.value, "today": today}} if today else {}


def _sarif_place(file: str, line: int, column: int) -> dict[str, object]:
    place: dict[str, object] = {"artifactLocation": {"uri": quote(file)}}
    if line:
        place["region"] = {"startLine": line, "startColumn": column}
    return {"physicalLocation": place}
