"""The intervention log as a document, and as JSON."""

from __future__ import annotations

from typing import Any

from fsoe_net.document.model import (
    Bullets,
    Cell,
    Column,
    Document,
    Level,
    Part,
    Section,
    Table,
    Verdict,
    cell,
    code,
    muted,
    words,
)
from fsoe_net.intervention_log.chain import LogCheck, LogEntry, LogSelection

_ENTRY_COLUMNS = (
    Column("Entry", number=True),
    Column("Time (UTC)"),
    Column("Event"),
    Column("Who", rank=1),
    Column("What", wraps=True),
)
_FILE_COLUMNS = (
    Column("File"),
    Column("Entries", number=True),
    Column("Bytes", number=True, rank=1),
    Column("SHA-256", rank=2),
)
_LEVELS = {"warning": Level.WARNING, "error": Level.ERROR}
_NO_END = (
    "The chain alone does not show that its last entry was changed, that its end was cut off, or "
    "that all of it was rewritten: compare it with a SHA-256 that was kept elsewhere (--last "
    "HASH)."
)
_EVIDENCE = (
    "A log that does not hold is evidence too: leave the files as they are, and compare them with "
    "a copy or an export."
)


def log_check_document(check: LogCheck, version: str) -> Document:
    """Return the result of `fsoe-net log verify`.

    Args:
        check: Result of the chain check.
        version: Version of fsoe-net.
    """
    return Document(
        title="Intervention log",
        version=version,
        verdict=_verdict(check),
        lead=_lead(check),
        sections=check_sections(check),
    )


def log_document(found: LogSelection, version: str) -> Document:
    """Return entries as a table, with the result of the chain check.

    Args:
        found: The entries to show.
        version: Version of fsoe-net.
    """
    more, check = found.left_out, found.check
    remark = f"{more} earlier entries are left out; --most shows more" if more else ""
    rows = tuple(map(_row, found.entries))
    table = Table(name="entries", columns=_ENTRY_COLUMNS, rows=rows, remark=remark)
    shown: Part = table if rows else words("No entry fits.")
    parts = () if check.holds else (words("fsoe-net log verify names every place.", note=True),)
    return Document(
        title="Intervention log",
        version=version,
        verdict=_verdict(check),
        lead=parts,
        sections=(Section(key="entries", title="Entries", parts=(shown,)),),
    )


def check_sections(check: LogCheck) -> tuple[Section, ...]:
    """Return findings, remarks and files of a log."""
    places = tuple(
        cell(code(f"{row.file}:{row.line}" if row.line else row.file), f": {row.text}")
        for row in check.findings
    )
    if check.more:
        places += (cell(f"and {check.more} more"),)
    files = tuple(
        (
            cell(code(file.name)),
            cell(f"{file.first} to {file.last}" if file.first else "none"),
            cell(str(file.size_bytes)),
            cell(code(file.sha256)),
        )
        for file in check.files
    )
    sections: list[tuple[str, str, tuple[Part, ...]]] = [
        ("findings", "What does not hold", (Bullets(places), words(_EVIDENCE, note=True))),
        ("remarks", "Remarks", (Bullets(tuple(cell(text) for text in check.remarks)),)),
        ("files", "Files", (Table(name="files", columns=_FILE_COLUMNS, rows=files),)),
    ]
    empty = {"findings": not places, "remarks": not check.remarks}
    return tuple(
        Section(key=key, title=title, parts=parts)
        for key, title, parts in sections
        if not empty.get(key)
    )


def selection_json(found: LogSelection) -> dict[str, Any]:
    """Return entries as in the log, with the findings."""
    return {
        "check": check_json(found.check),
        "left_out": found.left_out,
        "entries": [entry.row for entry in found.entries],
    }


def check_json(check: LogCheck) -> dict[str, Any]:
    """Return the result as JSON."""
    last = check.last
    return {
        "holds": check.holds,
        "entries": check.entries,
        "first": check.first,
        "last": None
        if last is None
        else {"number": last.number, "utc": last.utc, "sha256": last.sha256},
        "since_last": check.since_last,
        "findings": [{"file": f.file, "line": f.line, "text": f.text} for f in check.findings],
        "more_findings": check.more,
        "remarks": list(check.remarks),
        "files": [
            {
                "name": file.name,
                "bytes": file.size_bytes,
                "sha256": file.sha256,
                "first": file.first,
                "last": file.last,
            }
            for file in check.files
        ],
    }


def _verdict(check: LogCheck) -> Verdict:
    if check.holds:
        return Verdict("The chain holds", Level.CLEAR)
    count = len(check.findings) + check.more
    return Verdict(f"The chain does not hold: {count} finding{'s'[: count != 1]}", Level.ERROR)


def _lead(check: LogCheck) -> tuple[Part, ...]:
    last = check.last
    if last is None:
        return ()
    first = f"Entries {check.first} to {last.number}, the last one of {last.utc or 'no time'}. "
    parts: list[Part] = [words(first, "Its SHA-256: ", code(last.sha256))]
    if check.since_last is None:
        parts.append(words(_NO_END, note=True))
    else:
        since = f"Entries after the one with the SHA-256 of --last: {check.since_last}."
        parts.append(words(since))
    return tuple(parts)


def _row(entry: LogEntry) -> tuple[Cell, ...]:
    level = _LEVELS.get(entry.level)
    return (
        cell(str(entry.number)),
        cell(entry.utc[:19].replace("T", " ") or muted("no time")),
        cell(entry.event),
        cell(entry.who),
        cell(entry.text if level is None else Verdict(entry.text, level)),
    )
