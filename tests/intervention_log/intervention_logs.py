"""Writes intervention logs as ``fsn-master`` does, to be damaged."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

Log = list[list[bytes]]
"""Lines of each file, with their newlines."""


def a_log(*files: int) -> Log:
    """Return files with so many entries each, chained."""
    log: Log = []
    previous = None
    number = 0
    for count in files:
        lines = []
        for n in range(count):
            number += 1
            row: dict[str, Any] = {
                "number": number,
                "event": "file" if n == 0 else "request" if n % 2 else "state",
                "utc": f"2026-11-23T16:52:{number % 60:02}.111178Z",
                **({"user": "anna", "uid": 1000, "pid": 7, "program": "fsoe-net"} if n % 2 else {}),
                "level": "info",
                "text": f"what happened {number}",
                "previous": previous,
            }
            line = json.dumps(row, separators=(",", ":")).encode()
            previous = hashlib.sha256(line).hexdigest()
            lines.append(line + b"\n")
        log.append(lines)
    return log


def chained(line: bytes, **changed: object) -> bytes:
    """Return the entry that follows a line."""
    row = {"event": "state", "utc": "2026-11-23T17:00:00.000000Z", "level": "info", "text": "x"}
    row |= {"number": json.loads(line)["number"] + 1, **changed}
    row["previous"] = hashlib.sha256(line.rstrip(b"\n")).hexdigest()
    return json.dumps(row, separators=(",", ":")).encode() + b"\n"


def hash_of(line: bytes) -> str:
    return hashlib.sha256(line.rstrip(b"\n")).hexdigest()


def written(folder: Path, log: Log) -> Path:
    """Write a log into a folder."""
    folder.mkdir(exist_ok=True)
    for n, lines in enumerate(log, 1):
        (folder / f"interventions-{n:06}.jsonl").write_bytes(b"".join(lines))
    return folder
