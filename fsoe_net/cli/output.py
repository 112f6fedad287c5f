"""Output formats of findings: text, JSON, SARIF 2.1.0, GitHub annotations."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from fsoe_net.cli.options import named_folders
from fsoe_net.cli.terminal import echo
from fsoe_net.diag.catalogue import CATALOGUE
from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.diag.words import counted, summary
from fsoe_net.project.check import Checked
from fsoe_net.rules.runtime import Runtime

if TYPE_CHECKING:
    from fsoe_net.model.scan import Scan

_MOST_OF_A_CODE = 100  # findings per code in text output

FORMATS = ("text", "json", "sarif", "github")

_COLOUR = {Severity.ERROR: "red", Severity.WARNING: "yellow", Severity.INFO: "cyan"}


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
        runtime: Adds how this runtime handles each mistake today.
    """
    if not diagnostics and fmt == "text":
        return
    # Imports what only findings need.
    from fsoe_net.project.findings import github_line, json_document, sarif_document

    if fmt in ("json", "sarif"):
        document = json_document if fmt == "json" else sarif_document
        echo(json.dumps(document(diagnostics, runtime), indent=2, ensure_ascii=False), err=err)
    elif fmt == "github":
        for diagnostic in diagnostics:
            echo(github_line(diagnostic), err=err)
    else:
        _print_text(diagnostics, runtime, err=err)


def _print_text(diagnostics: Sequence[Diagnostic], runtime: Runtime, *, err: bool) -> None:
    """Print the first findings of each code, then the number of further ones."""
    from fsoe_net.project.findings import finding_text

    counts: Counter[str] = Counter()
    for diagnostic in diagnostics:
        counts[diagnostic.code] += 1
        if counts[diagnostic.code] <= _MOST_OF_A_CODE:
            word = f"{diagnostic.level.value}[{diagnostic.code}]"
            level = click.style(word, fg=_COLOUR[diagnostic.level], bold=True)
            text = finding_text(diagnostic, runtime, level=level, folders=named_folders)
            click.echo(text, err=err)
    for code, count in sorted(counts.items()):
        if count > _MOST_OF_A_CODE:
            more = f"{code}: {count - _MOST_OF_A_CODE} more ({CATALOGUE[code].title})"
            echo(f"{more}; `fsoe-net check --format json` lists all", err=err)


def verdict_line(checked: Checked, scan: Scan | None) -> str:
    """Return the last line of a check: what was checked and compared, and the result."""
    counts = summary(checked.diagnostics)
    network = checked.network
    codes = sorted({d.code for d in checked.diagnostics if d.level is not Severity.INFO})
    more = f"; `fsoe-net explain {codes[0]}` explains it" if codes else ""
    if network is None or checked.resolution is None:
        return f"nothing checked: {counts}{more}"
    there = counted(len(scan.subdevices), "SubDevice") if scan else ""
    held = f", compared with {there} on the bus" if scan else ""
    if checked.references:
        held += f"{' and' if held else ', compared with'} "
        held += counted(len(checked.references), "other file")
    # A partial network has no verdict on the whole.
    if network.partial:
        return f"{network.name}: checked as far as this file goes{held}" + (
            f"; {counts}{more}" if counts else ", no findings"
        )
    size = (
        f"{counted(len(network.subdevices), 'SubDevice')}, "
        f"{counted(len(checked.resolution.connections), 'FSoE connection')}"
    )
    return f"{network.name}: {'' if counts else 'no findings, '}{size}{held}" + (
        f"; {counts}{more}" if counts else ""
    )
