"""The intervention log of ``fsn-master``: reading, verification, and export as an archive."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import zipfile
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO

from fsoe_net.document.write_terminal import document_text
from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.formats.shared.files import open_file
from fsoe_net.formats.shared.write_files import refuse_present
from fsoe_net.intervention_log.chain import (
    LogChain,
    LogCheck,
    LogEntry,
    LogFilter,
    LogSelection,
    log_lines,
)
from fsoe_net.intervention_log.document import check_json, log_check_document
from fsoe_net.version import __version__

_FILES = "interventions-*.jsonl"
_MOST_KEPT_BYTES = 64 << 20


def log_files(paths: Sequence[str]) -> list[str]:
    """Return the files of a log in order: the given ones, and all files of a given folder.

    Raises:
        InputError: A folder contains none.
    """
    files: list[str] = []
    for path in paths:
        if not Path(path).is_dir():
            files.append(path)
            continue
        # A longer name has a number with more digits, so it is newer.
        found = sorted(Path(path).glob(_FILES), key=lambda p: (len(p.name), p.name))
        if not found:
            raise InputError(
                f"{path} holds no {_FILES}: name the folder that fsn-master got with "
                "--intervention-log, or its files"
            )
        files += map(str, found)
    return files


def read_log(
    files: Sequence[str],
    chain: LogChain,
    each: Callable[[LogEntry], None] = lambda entry: None,
    archive: zipfile.ZipFile | None = None,
) -> LogCheck:
    """Follow the chain across files, in their order.

    Args:
        files: Names of the files.
        chain: A new chain.
        each: Called with each entry.
        archive: Receives an exact copy of each file, numbered if two share a name.

    Raises:
        InputError: A file cannot be read.
    """
    for name, packed in zip(files, _packed_names(files), strict=True):
        file = chain.begin(name)
        with contextlib.ExitStack() as stack:
            source = _Copying(stack.enter_context(open_file(name, regular=False)))
            if archive is not None:
                # Without a timestamp, so that equal logs give equal archives.
                info = zipfile.ZipInfo(packed)
                info.compress_type = zipfile.ZIP_DEFLATED
                # The length is unknown until the log has been read.
                source.copy = stack.enter_context(archive.open(info, "w", force_zip64=True))
            for line in log_lines(source):
                file.size_bytes += line.size_bytes
                if (entry := chain.take(line)) is not None:
                    each(entry)
            file.sha256 = source.digest.hexdigest()
    return chain.end()


def select_entries(files: Sequence[str], wanted: LogFilter) -> LogSelection:
    """Return the matching entries of a log; at most 64 MiB of them are kept in memory.

    Raises:
        InputError: A file cannot be read.
    """
    kept: deque[LogEntry] = deque()
    fitting = kept_bytes = 0

    def keep(entry: LogEntry) -> None:
        nonlocal fitting, kept_bytes
        if not wanted.fits(entry):
            return
        fitting += 1
        kept.append(entry)
        kept_bytes += entry.size_bytes
        while len(kept) > wanted.most or kept_bytes > _MOST_KEPT_BYTES:
            kept_bytes -= kept.popleft().size_bytes

    check = read_log(files, LogChain(), keep)
    return LogSelection(check=check, entries=tuple(kept), left_out=fitting - len(kept))


def export_log(
    files: Sequence[str],
    chain: LogChain,
    target: str,
    *,
    overwrite: bool,
) -> LogCheck:
    """Pack files of a log into a ZIP file with their SHA-256, and the findings as text and JSON.

    Args:
        files: Names of the files.
        chain: A new chain.
        target: The file to write.
        overwrite: Whether to replace an existing file.

    Raises:
        InputError: A file cannot be read, or the target exists.
        EnvironmentFault: The target cannot be written; the existing content is unchanged.
    """
    path = Path(target)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with zipfile.ZipFile(part, "x") as archive:
            check = read_log(files, chain, archive=archive)
            texts = {
                "verification.txt": document_text(
                    log_check_document(check, __version__), width=100
                ),
                "verification.json": json.dumps(check_json(check), indent=2) + "\n",
            }
            sums = dict(zip(_packed_names(files), (f.sha256 for f in check.files), strict=True))
            sums |= {name: _sha256(text) for name, text in texts.items()}
            texts["SHA256SUMS"] = "".join(f"{sha}  {name}\n" for name, sha in sums.items())
            for name, text in texts.items():
                archive.writestr(zipfile.ZipInfo(name), text.encode("utf-8"))
        if not overwrite:
            refuse_present(path)
        part.replace(path)
    except OSError as exc:
        raise EnvironmentFault(f"cannot write {target}: {exc.strerror or exc}") from exc
    finally:
        part.unlink(missing_ok=True)
    return check


class _Copying:
    """A stream of bytes that is hashed and copied while it is read."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self.copy: IO[bytes] | None = None
        self.digest = hashlib.sha256()

    def readline(self, most: int) -> bytes:
        data = self._stream.readline(most)
        self.digest.update(data)
        if self.copy is not None:
            self.copy.write(data)
        return data


def _packed_names(files: Sequence[str]) -> list[str]:
    """Return a name for each file in an archive; equal names get a number in front."""
    names = [Path(name).name for name in files]
    return [
        name if names.count(name) == 1 and name != "-" else f"{n}-{name}"
        for n, name in enumerate(names, 1)
    ]


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()
