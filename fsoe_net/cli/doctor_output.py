"""Prints what `fsoe-net doctor` has found."""

from __future__ import annotations

from fsoe_net.diag.words import counted
from fsoe_net.document.model import (
    Column,
    Document,
    Level,
    Lines,
    Part,
    Table,
    Verdict,
    cell,
    words,
)
from fsoe_net.host.doctor import Examination
from fsoe_net.host.finding import MachineFinding, MachineLevel

_LEVELS = {
    MachineLevel.GOOD: Level.CLEAR,
    MachineLevel.NOTE: Level.NOTE,
    MachineLevel.WARNING: Level.WARNING,
    MachineLevel.BAD: Level.ERROR,
    MachineLevel.UNKNOWN: Level.OPEN,
}


def examination_document(found: Examination) -> Document:
    """Return all findings as a table, then the advice for each."""
    rows = tuple(
        (cell(Verdict(f.level.value, _LEVELS[f.level])), cell(f.name), cell(f.text))
        for f in found.findings
    )
    columns = (Column(""), Column("check"), Column("found", wraps=True))
    parts: list[Part] = [Table(columns=columns, rows=rows)]
    for level in (MachineLevel.BAD, MachineLevel.WARNING, MachineLevel.NOTE):
        for f in found.findings:
            if f.level is level:
                parts += _advice(f)
    parts.append(words(_verdict(found)))
    title = f"Linux {found.release} · {counted(found.cpus, 'CPU')}"
    return Document(title=title, lead=tuple(parts))


def _advice(finding: MachineFinding) -> list[Part]:
    """Return the advice for a finding; commands stay on one line so that they can be copied."""
    head = Verdict(f"{finding.level.value}[{finding.name}]", _LEVELS[finding.level])
    # Commands stay on one line, so that they can be copied.
    commands = [
        f"  {f'{word}:' if n == 0 else '':5} {text}"
        for word, texts in (("now", finding.now), ("keep", finding.keep))
        for n, text in enumerate(texts)
    ]
    parts: list[Part] = [words(head, f": {finding.text}")]
    if finding.why:
        parts.append(words(f"why: {finding.why}"))
    return [*parts, Lines(tuple(commands))] if commands else parts


def _verdict(found: Examination) -> str:
    parts = [
        counted(n, word) if word != "unknown" else f"{n} not known"
        for level, word in (
            (MachineLevel.BAD, "bad finding"),
            (MachineLevel.WARNING, "warning"),
            (MachineLevel.NOTE, "note"),
            (MachineLevel.UNKNOWN, "unknown"),
        )
        if (n := found.count(level))
    ]
    counts = ", ".join(parts) or "nothing to fix"
    more = "" if found.interface else "; --interface IF looks at the one of the bus too"
    return f"{counts}{more}"
