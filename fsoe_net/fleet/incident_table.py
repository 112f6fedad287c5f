"""Incident files of many machines as one Parquet file: a row for each incident.

The SHA-256 of the content identifies an incident: the same file, found again or elsewhere, changes
nothing.
"""

from __future__ import annotations

import contextlib
import glob
import hashlib
import os
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import duckdb

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.fleet.labels import bounded, reset_code_name
from fsoe_net.formats.shared.files import open_file
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.incident.causes import judge
from fsoe_net.incident.evidence import gather
from fsoe_net.incident.incident_read import IncidentReader

SUFFIX = ".fsnincident"
_TYPES = {
    "str": "VARCHAR",
    "int": "BIGINT",
    "int | None": "BIGINT",
    "bool": "BOOLEAN",
    "datetime | None": "TIMESTAMP",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class IncidentRow:
    """One incident; each attribute is a column. Texts are empty, numbers null if unknown.

    ``machine``: folder of the file, or the given name. ``utc``: time of the trigger. ``kind``: that
    of the trigger. ``reset_cause``: name of ``reset_code``. ``cause`` and ``cause_score``: the
    likely cause and its rank of 50 to 99. ``complete``: whether the file has its end.
    """

    sha256: str
    machine: str
    file: str
    utc: datetime | None
    kind: str
    connection: str
    main: str
    sub: str
    reset_by: str
    reset_code: int | None
    reset_cause: str
    cause: str
    cause_score: int | None
    interface: str
    plan_sha256: str
    cycle_ns: int
    incomplete_cycles: int
    lost_frames: int
    late_cycles: int
    complete: bool


COLUMNS = {f.name: _TYPES[str(f.type)] for f in fields(IncidentRow)}
"""Name and type of each column."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TableResult:
    """Number of rows; of new rows; why files could not be read."""

    rows: int
    added: int
    failures: tuple[InputError, ...]


def incident_files(paths: Iterable[str]) -> Iterator[Path]:
    """Yield incident files, also those in folders, in order; links in folders are not followed."""
    for path in map(Path, paths):
        if not path.is_dir():
            yield path
            continue
        for folder, subfolders, names in os.walk(path):
            subfolders.sort()
            found = (Path(folder, name) for name in sorted(names) if name.endswith(SUFFIX))
            yield from (file for file in found if not file.is_symlink())


def incident_row(path: Path, sha256: str, machine: str = "") -> IncidentRow:
    """Return the row of a file.

    Raises:
        InputError: The file cannot be read, or is not an incident file.
    """
    with open_file(path) as stream:
        e = gather(IncidentReader(str(path), stream))
    likely = judge(e).likely
    return IncidentRow(
        sha256=sha256,
        machine=bounded(machine or path.resolve().parent.name),
        file=bounded(path.name),
        utc=_moment(e.head.utc),
        kind=e.head.trigger.kind.value,
        connection=bounded(e.name),
        main=bounded(e.plan.main if e.plan else ""),
        sub=bounded(e.plan.sub if e.plan else ""),
        reset_by=e.by,
        reset_code=e.code,
        reset_cause="" if e.code is None else reset_code_name(e.code),
        cause=likely.key if likely else "",
        cause_score=likely.score if likely else None,
        interface=bounded(e.head.interface),
        plan_sha256=bounded(e.head.plan_sha256),
        cycle_ns=e.bus.cycle_ns,
        incomplete_cycles=sum(r.cycles for r in e.bus.short),
        lost_frames=e.bus.lost_frames,
        late_cycles=e.bus.late_cycles,
        complete=not e.cut,
    )


def _moment(text: str) -> datetime | None:
    with contextlib.suppress(ValueError, OverflowError):
        moment = datetime.fromisoformat(text)
        return moment.astimezone(UTC).replace(tzinfo=None) if moment.tzinfo else moment
    return None


def update_table(output: Path, paths: Iterable[str], machine: str = "") -> TableResult:
    """Add the incidents that the Parquet file does not have; without any, it is not changed.

    Args:
        output: The Parquet file; created if it is missing.
        paths: Incident files, and folders with them.
        machine: Name of the machine; default: the folder of each file.

    Raises:
        InputError: The file exists and is not such a table.
        EnvironmentFault: It cannot be written.
    """
    with duckdb.connect(":memory:") as database:
        names = ", ".join(f"{name} {kind}" for name, kind in COLUMNS.items())
        database.execute(f"CREATE TABLE incidents ({names})")
        if output.exists():
            _load(database, output)
        known = {row[0] for row in database.execute("SELECT sha256 FROM incidents").fetchall()}
        before = len(known)
        failures: list[InputError] = []
        for path in incident_files(paths):
            try:
                with open_file(path) as stream:
                    sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
                if sha256 not in known:
                    _insert(database, incident_row(path, sha256, machine))
                    known.add(sha256)
            except InputError as exc:
                failures.append(exc)
        if len(known) > before or not (output.exists() or failures):
            _store(database, output)
    return TableResult(rows=len(known), added=len(known) - before, failures=tuple(failures))


def _load(database: Any, output: Path) -> None:
    # DuckDB expands patterns in a file name.
    place = [glob.escape(str(output))]
    try:
        rows = database.execute("DESCRIBE SELECT * FROM read_parquet(?)", place).fetchall()
        if {row[0]: row[1] for row in rows} != COLUMNS:
            raise InputError(f"{output} is a Parquet file, but not a table of incidents")
        database.execute("INSERT INTO incidents BY NAME SELECT * FROM read_parquet(?)", place)
    except duckdb.Error as exc:
        raise InputError(f"{output} is not a Parquet file; name another one") from exc


def _insert(database: Any, row: IncidentRow) -> None:
    marks = ", ".join("?" * len(COLUMNS))
    values = [getattr(row, name) for name in COLUMNS]
    database.execute(f"INSERT INTO incidents VALUES ({marks})", values)  # noqa: S608 - marks only


def _store(database: Any, output: Path) -> None:
    with tempfile.TemporaryDirectory(prefix="fsn-") as folder:
        part = Path(folder, "incidents.parquet")
        quoted = str(part).replace("'", "''")
        # One order for the same incidents, whatever the order of the files was.
        try:
            database.execute(
                f"COPY (FROM incidents ORDER BY sha256) TO '{quoted}' (FORMAT parquet)"
            )
        except duckdb.Error as exc:
            raise EnvironmentFault(f"cannot write {part}: {exc}") from exc
        write_whole(output, part.read_bytes(), overwrite=True)
