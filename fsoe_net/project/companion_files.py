"""Other files in the folder of a network, recognised by content and name."""

from __future__ import annotations

import enum
import os
import re
from collections.abc import Iterator

from fsoe_net.dataclass import dataclass
from fsoe_net.formats.own.acceptance import is_acceptance
from fsoe_net.formats.recognise import head_of, recognise
from fsoe_net.formats.shared.files import Collector
from fsoe_net.plan.codec import MAGIC

_MOST_FILES = 2000
_PROTOCOL = re.compile(rb"^plan_sha256\s*:", re.MULTILINE)
_NETWORK = re.compile(rb"^(nets|subdevices|buses)\s*:", re.MULTILINE)
_SCAN = re.compile(rb'"scan"\s*:')
_LOG = re.compile(r"interventions-.*\.jsonl")


class CompanionKind(enum.Enum):
    """The purpose of a file."""

    INCIDENT = "incident"
    LOG = "log"
    RECORD = "record"
    TEST_RECORD = "test_record"
    ROBOT = "robot"
    CONTROLLERS = "controllers"
    OTHER = "other"
    """A description of a bus, to compare with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CompanionFile:
    """A file next to a network, or the folder of an intervention log.

    Attributes:
        path: Path, starting with the searched folder.
        name: Path relative to that folder.
        kind: Purpose of the file.
        words: Description of the file.
    """

    path: str
    name: str
    kind: CompanionKind
    words: str


def files_beside(network: str) -> list[CompanionFile]:
    """Return the files in the folder of a network file and its subfolders, by name.

    Links are skipped, because they may lead out of the folder. Hidden folders and unreadable files
    are also skipped.

    Args:
        network: The network file, which is also skipped.
    """
    folder = os.path.dirname(network) or "."
    found: dict[str, CompanionFile] = {}
    for entry in _files(folder):
        name = os.path.relpath(entry.path, folder)
        if os.path.basename(network) == name:
            continue
        if _LOG.fullmatch(entry.name):
            path = os.path.dirname(entry.path)
            name = os.path.relpath(path, folder)
            row = CompanionFile(
                path=path, name=name, kind=CompanionKind.LOG, words="an intervention log"
            )
            found[path] = row
        elif entry.name.endswith(".fsnincident"):
            row = CompanionFile(
                path=entry.path, name=name, kind=CompanionKind.INCIDENT, words="an incident file"
            )
            found[entry.path] = row
        elif (known := _known(entry.path)) is not None:
            found[entry.path] = CompanionFile(
                path=entry.path, name=name, kind=known[0], words=known[1]
            )
    return sorted(found.values(), key=lambda row: row.name)


def _files(folder: str) -> Iterator[os.DirEntry[str]]:
    left = _MOST_FILES
    for here in (folder, *(e.path for e in _entries(folder) if _is_folder(e))):
        for entry in _entries(here):
            if not entry.is_file(follow_symlinks=False):
                continue
            if left == 0:
                return
            left -= 1
            yield entry


def _entries(folder: str) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as entries:
            return sorted(entries, key=lambda entry: entry.name)
    except OSError:
        return []


def _is_folder(entry: os.DirEntry[str]) -> bool:
    return entry.is_dir(follow_symlinks=False) and not entry.name.startswith(".")


def _known(path: str) -> tuple[CompanionKind, str] | None:
    try:
        head = head_of(path, Collector())
    except OSError:
        head = None
    if head is None:
        return None
    if head.startswith(MAGIC):
        return CompanionKind.OTHER, "a plan"
    if is_acceptance(head):
        return CompanionKind.RECORD, "an acceptance record"
    if _PROTOCOL.search(head):
        return CompanionKind.TEST_RECORD, "a test record"
    if head.lstrip()[:1] == b"{":
        return (CompanionKind.OTHER, "a scan") if _SCAN.search(head) else None
    known = recognise(head)
    if known is None or known.kind in ("", "capture", "ros-slaves"):
        return None
    if known.kind == "urdf":
        kind = CompanionKind.ROBOT if known.signature.root else CompanionKind.CONTROLLERS
        return kind, known.words
    if known.kind == "yaml" and not _NETWORK.search(head):
        return None  # of one device
    return CompanionKind.OTHER, known.words
