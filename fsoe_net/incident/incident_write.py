"""Writes incident files: complete under their name, or as far as a full disk allows."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fsoe_net.incident.incident import CycleRecord

_SUFFIX = ".fsnincident"


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenIncident:
    """Outcome of a write. ``path`` is ``None`` if no file was written; ``fault`` is the reason."""

    path: Path | None
    fault: str = ""


def incident_name(utc: str, what: str) -> str:
    """Return a file name, e.g. ``incident-20261121T154612.123Z-el1918-ek1914.fsnincident``.

    Args:
        utc: Time as ``2026-11-21T15:46:12.123Z``.
        what: Connection, or another word; characters unsuitable for file names become ``_``.
    """
    stamp = utc.replace("-", "").replace(":", "")
    word = re.sub(r"[^A-Za-z0-9._-]", "_", what)[:80] or "incident"
    return f"incident-{stamp}-{word}{_SUFFIX}"


def incident_lines(head: Mapping[str, Any], cycles: Iterable[CycleRecord]) -> Iterator[str]:
    """Yield the lines of a file, each with its newline; unchanged values are omitted."""
    yield _line({"incident": 1} | dict(head))
    image: bytes | None = None
    count = 0
    for record in cycles:
        row: dict[str, Any] = {"cycle": record.cycle, "t": record.now_ns}
        numbers = {
            "late": record.late_ns,
            "work": record.work_ns,
            "round": record.round_ns,
            "lost": record.lost,
            "old": record.old,
            "foreign": record.foreign,
        }
        # Zeros are omitted: most cycles have only zeros, and every cycle adds to the file.
        row |= {key: value for key, value in numbers.items() if value}
        if record.wkc is not None:
            row["wkc"] = list(record.wkc)
        # The image is written only if it changes; the reader keeps the last one.
        if record.image is not None and record.image != image:
            image = record.image
            row["image"] = image.hex()
        count += 1
        yield _line(row)
    yield _line({"end": True, "cycles": count})


def write_incident(
    folder: Path, name: str, head: Mapping[str, Any], cycles: Iterable[CycleRecord]
) -> WrittenIncident:
    """Write a file under a temporary name, then rename it; never raises for disk errors.

    A file truncated by a full disk keeps its name if its head is complete, so that the rest can be
    read. If the name exists, a number is added.
    """
    temporary = folder / f".{name}.part"
    whole_head = False
    fault = ""
    try:
        with open(temporary, "w", encoding="utf-8", newline="\n") as file:
            for number, line in enumerate(incident_lines(head, cycles)):
                file.write(line)
                if number == 0:
                    # From here on the file is readable, even if it is truncated.
                    file.flush()
                    whole_head = True
            file.flush()
            # Before the rename: the name must not exist without its content after a power failure.
            os.fsync(file.fileno())
    except OSError as exc:
        fault = f"{folder / name}: {exc.strerror or exc}"
    try:
        # A file without a head has no facts to show.
        if not whole_head:
            temporary.unlink(missing_ok=True)
            return WrittenIncident(path=None, fault=f"{fault}; no incident file was written")
        path = _free(folder / name)
        os.replace(temporary, path)
    except OSError as exc:
        return WrittenIncident(path=None, fault=f"{folder / name}: {exc.strerror or exc}")
    if fault:
        fault += f"; {path.name} was cut off and can be read as far as it goes"
    return WrittenIncident(path=path, fault=fault)


def _free(path: Path) -> Path:
    number = 1
    found = path
    while found.exists():
        number += 1
        found = path.with_name(f"{path.name.removesuffix(_SUFFIX)}-{number}{_SUFFIX}")
    return found


def _line(row: Mapping[str, Any]) -> str:
    return json.dumps(row, ensure_ascii=False, separators=(",", ":")) + "\n"
