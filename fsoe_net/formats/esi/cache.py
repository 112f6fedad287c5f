"""Catalogues of ESI files kept in the user's cache directory, by content.

A cache file is never trusted: it begins with a hash of the rest, and anything unexpected is treated
as absent.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from fsoe_net.formats.esi.catalogue import MAX_ROWS, EsiCatalogue, EsiRow
from fsoe_net.formats.shared.limits import MAX_CACHED_BYTES

_VERSION = 1  # increase it when the rows, or the code that fills them, change
_MAX_FILES = 64
_ROW_KEYS = {f.name: f.type for f in fields(EsiRow)}


def cache_folder() -> Path | None:
    """Return the folder for catalogues, or ``None`` if the user has no home directory.

    ``$XDG_CACHE_HOME/fsoe-net/esi``, otherwise ``~/.cache/fsoe-net/esi``.
    """
    base = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(base):
        return Path(base, "fsoe-net", "esi")
    try:
        return Path.home() / ".cache" / "fsoe-net" / "esi"
    except RuntimeError:
        return None


def cached_catalogue(sha256: str, size: int) -> EsiCatalogue | None:
    """Return the catalogue of a file with this content, or ``None``.

    Args:
        sha256: SHA-256 of the file, in hex.
        size: Bytes of the file; no offset may exceed it.
    """
    path = _path(sha256)
    if path is None:
        return None
    try:
        if path.stat().st_size > MAX_CACHED_BYTES:
            return None
        head, _, body = path.read_bytes().partition(b"\n")
        if head != hashlib.sha256(body).hexdigest().encode():
            return None
        document = json.loads(body)
    except (OSError, ValueError, RecursionError):
        return None
    return _from_json(document, sha256, size)


def keep_catalogue(sha256: str, catalogue: EsiCatalogue) -> None:
    """Store a catalogue for later runs; write errors are ignored."""
    path = _path(sha256)
    if path is None:
        return
    document = {
        "version": _VERSION,
        "sha256": sha256,
        "encoding": catalogue.encoding,
        "is_list": catalogue.is_list,
        "references": list(catalogue.references),
        "rows": [asdict(row) for row in catalogue.rows],
    }
    with contextlib.suppress(OSError, ValueError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".new")
        try:
            body = json.dumps(document).encode()
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(body).hexdigest().encode() + b"\n" + body)
            os.replace(temporary, path)  # readers find the old file or the complete new one
        # Also on Ctrl-C, so that no temporary files accumulate in the folder.
        except BaseException:
            os.unlink(temporary)
            raise
        _prune(path.parent)


def _path(sha256: str) -> Path | None:
    folder = cache_folder()
    return folder / f"{sha256}.json" if folder is not None else None


def _prune(folder: Path) -> None:
    """Keep only the newest files."""
    files = sorted(folder.glob("*.json"), key=lambda p: p.stat().st_mtime, reverse=True)
    for old in files[_MAX_FILES:]:
        old.unlink(missing_ok=True)


def _from_json(document: Any, sha256: str, size: int) -> EsiCatalogue | None:
    if not isinstance(document, dict):
        return None
    if document.get("version") != _VERSION or document.get("sha256") != sha256:
        return None
    encoding, references = document.get("encoding"), document.get("references")
    rows = document.get("rows")
    if not (isinstance(encoding, str) and isinstance(rows, list)):
        return None
    if not isinstance(references, list) or not all(isinstance(r, str) for r in references):
        return None
    read = [_row(row, size) for row in rows[: MAX_ROWS + 1]]
    whole = [row for row in read if row is not None]
    if len(whole) != len(rows):
        return None
    return EsiCatalogue(
        encoding=encoding,
        is_list=document.get("is_list") is True,
        references=tuple(references),
        rows=tuple(whole),
    )


def _row(row: Any, size: int) -> EsiRow | None:
    if not isinstance(row, dict) or set(row) != set(_ROW_KEYS):
        return None
    for key, kind in _ROW_KEYS.items():
        value = row[key]
        if kind == "str":
            right = isinstance(value, str)
        elif value is None:
            right = kind == "int | None"
        else:
            right = type(value) is int and value >= 0
        if not right:
            return None
    # The offsets divide the ESI file, so they must be inside it.
    if row["kind"] not in ("device", "module") or not row["offset"] < row["end"] <= size:
        return None
    return EsiRow(**row)
