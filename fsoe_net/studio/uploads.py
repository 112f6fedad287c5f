"""Files uploaded by a person, and the parts of their content that can be added to the network.

They are in a folder of this process until it ends or they are removed. Their content is unknown
until the readers of ``fsoe-net init`` have checked it.
"""

from __future__ import annotations

import os
import re
import tempfile
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from fsoe_net.diag.diagnostic import Diagnostic, FindingList, Severity
from fsoe_net.diag.printable import printable
from fsoe_net.errors import FsnError, InputError
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.limits import MAX_LARGE_BYTES
from fsoe_net.model.answers import Answers
from fsoe_net.model.scan import Scan
from fsoe_net.project.installed import shipped
from fsoe_net.proposal.draft import Draft, Inputs, make_draft
from fsoe_net.proposal.gather import Gathered, gather
from fsoe_net.proposal.offers import Addition, Offer, addition_of, list_offers
from fsoe_net.studio.subdevices import added
from fsoe_net.studio.workspace import Workspace

MAX_UPLOAD_BYTES = MAX_LARGE_BYTES
"""Maximum size of all files together."""

_MOST_FILES = 200
_MOST_OFFERS = 3000
_LONGEST_NAME = 120
_DEEPEST = 4

Row = dict[str, object]


@dataclass(slots=True)
class _Content:
    """Content of the uploaded files."""

    offers: tuple[Offer, ...]
    draft: Draft | None = None
    findings: list[Diagnostic] = field(default_factory=list)
    error: str = ""


class Upload:
    """A file being received; it is added by `Uploads.put`.

    Attributes:
        name: Its name in the uploads, including uploaded folders.
        path: Path of its content.
    """

    def __init__(self, name: str, path: str) -> None:
        self.name, self.path = name, path
        self._stream = open(path, "xb")  # noqa: SIM115 - closed by `close`

    def write(self, data: bytes) -> None:
        """Add bytes."""
        self._stream.write(data)

    def close(self, *, keep: bool) -> None:
        """Complete the file; without ``keep`` all files are removed."""
        self._stream.close()
        if not keep:
            os.unlink(self.path)


class Uploads:
    """The uploaded files; every method may be called from any thread.

    Attributes:
        scan: The first scan among them, with the name of its file.
        esis: Paths of the ESI files among them.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._files: dict[str, str] = {}  # path by displayed name
        self._count = 0
        self._content: _Content | None = None
        self.scan: tuple[str, Scan] | None = None
        self.esis: tuple[str, ...] = ()

    def begin(self, name: str) -> Upload:
        """Begin receiving a file.

        Args:
            name: Name given by the browser, with folders if uploaded; it cannot lead out of the
                folder.

        Raises:
            InputError: There are too many files.
        """
        with self._lock:
            if len(self._files) >= _MOST_FILES:
                raise InputError(f"{_MOST_FILES} files are here; put them away first")
            if self._folder is None:
                self._folder = tempfile.TemporaryDirectory(prefix="fsoe-net-studio-")
            self._count += 1
            # Programs that read a folder skip names that begin with a dot.
            return Upload(_safe(name), os.path.join(self._folder.name, f".part{self._count}"))

    def room_bytes(self) -> int:
        """Return the free space in bytes."""
        with self._lock:
            sizes = sum(os.path.getsize(path) for path in self._files.values())
        return max(0, MAX_UPLOAD_BYTES - sizes)

    def put(self, upload: Upload) -> None:
        """Add a completely received file; it replaces one with the same name.

        Raises:
            OSError: A file and a folder would have the same name.
        """
        with self._lock:
            root = os.path.dirname(upload.path)
            path = os.path.join(root, upload.name)
            try:
                os.makedirs(os.path.dirname(path), exist_ok=True)
                os.replace(upload.path, path)
            except OSError:
                os.unlink(upload.path)
                raise
            self._files[upload.name] = path
            self._content = None

    def clear(self) -> None:
        """Remove all files."""
        with self._lock:
            if self._folder is not None:
                self._folder.cleanup()
            self._folder, self._content, self.scan, self.esis = None, None, None, ()
            self._files.clear()

    def shown(self) -> Row:
        """Return the available offers, as plain JSON values; shape: ``assets/types.d.ts``."""
        with self._lock:
            content = self._read()
            return {
                "error": printable(content.error),
                "files": [printable(name) for name in self._files],
                "offers": [
                    self._offer(n, row) for n, row in enumerate(content.offers[:_MOST_OFFERS])
                ],
                "offers_left_out": max(0, len(content.offers) - _MOST_OFFERS),
                "findings": [
                    {
                        "severity": row.level.value,
                        "place": self.place(str(row.span)),
                        "message": self.place(row.message),
                        "hint": self.place(row.hint),
                    }
                    for row in content.findings
                ],
                "proposal": self._proposal(content.draft),
            }

    def add(
        self, workspace: Workspace, version: int, body: Mapping[str, object]
    ) -> tuple[str, ...]:
        """Add SubDevices of ``offers``, numbers of `shown`, to ``bus`` of the network.

        ``connections`` has the bytes to and from safety logic with connections to choose.

        Returns:
            Notes and tasks for the user.

        Raises:
            StaleVersion: ``version`` is not the current one.
            InputError: A SubDevice cannot be added; with the reason.
        """
        numbers, bus = body.get("offers"), body.get("bus", 0)
        # `bool` is an `int` in Python: `true` is not a bus.
        if not isinstance(numbers, list) or type(bus) is not int or bus < 0:
            raise InputError("offers is a list of numbers, and bus a number")
        # Only the reading needs the lock: the change checks the whole network and takes time.
        with self._lock:
            known = self._read().offers
            chosen = [known[n] for n in numbers if type(n) is int and 0 <= n < len(known)]
        # Another page may have removed the files after this page listed them.
        if not chosen or len(chosen) < len(numbers):
            raise InputError("what was to be added is not here any more; look at the list again")
        lengths = _lengths(body.get("connections", []))
        rows = [_possible(row, lengths) for row in chosen]
        resolution = workspace.checked.resolution
        if resolution is None:
            raise InputError("the text is not a valid network at present: correct it first")
        files = [(row.config, self._named(row.config_text)) for row in rows]
        workspace.change_with_files(version, files, added(resolution, rows, bus))
        said = (f"{row.name}: {note}" for row in rows for note in row.notes)
        return tuple(self.place(text) for text in said)

    def take(self, workspace: Workspace, version: int, _: Mapping[str, object]) -> None:
        """Use the network proposed from the files as the text; undo restores the previous one.

        Raises:
            StaleVersion: ``version`` is not the current one.
            InputError: The proposal is missing.
        """
        with self._lock:
            draft = self._read().draft
        if draft is None or draft.proposal is None:
            raise InputError("these files propose no network; add SubDevices one by one")
        # A draft with errors would be a network that cannot be saved.
        if any(row.level is Severity.ERROR for row in draft.findings):
            raise InputError("a file has errors, see above; put it away, or correct it")
        network = workspace.checked.network
        # Files that do not name a network keep the current name.
        if network is not None and not draft.inputs.found.name:
            draft = replace(draft, name=network.name)
        files = {name: self._named(text) for name, text in draft.files().files.items()}
        _take(workspace, version, files.pop("network.yaml"), files)

    @staticmethod
    def example(workspace: Workspace, version: int, _: Mapping[str, object]) -> None:
        """Use the e-stop example of the package as the text.

        Raises:
            StaleVersion: ``version`` is not the current one.
        """
        folder = shipped("examples") / "estop"
        texts = {
            f"devices/{path.name}": path.read_text("utf-8")
            for path in sorted((folder / "devices").glob("*.yaml"))
        }
        _take(workspace, version, (folder / "network.yaml").read_text("utf-8"), texts)

    def _read(self) -> _Content:
        if self._content is None:
            self._content = self._gathered()
        return self._content

    def _gathered(self) -> _Content:
        self.scan, self.esis = None, ()
        # Emptied first: if reading fails, no scan of an earlier upload may remain.
        out = FindingList()
        if not self._files:
            return _Content(list_offers(Gathered(), out))
        try:
            # A single file must be valid; of several, an unreadable one is omitted with a note.
            paths = list(self._files.values())
            found = gather(paths if len(paths) == 1 else [self._root], LoadOptions())
            self.esis = tuple(found.esis)
            for path, scan in found.scans.items():
                self.scan = self.scan or (self.place(path), scan)
            draft = make_draft(Inputs.of(found), Answers()) if found.buses else None
            offers = list_offers(found, out)
            rows = [*found.out.diagnostics, *(draft.findings if draft else ()), *out.diagnostics]
            return _Content(offers, draft, _worth_a_word(rows))
        except FsnError as exc:
            # Input errors have a list of findings; other errors have only their text.
            rows = list(exc.diagnostics) if isinstance(exc, InputError) else []
            error = exc.message if isinstance(exc, InputError) else str(exc)
            return _Content(list_offers(Gathered(), out), findings=rows, error=error)

    def _offer(self, number: int, row: Offer) -> Row:
        return {
            "number": number,
            "order": printable(row.order),
            "about": printable(row.about),
            "file": self.place(row.path),
            "position": row.position,
            "revision": row.revision,
            "process_data": printable(row.process_data),
            "frames": [list(pair) for pair in row.frames],
            "role": row.role,
            "functions": [function.value for function in row.functions],
            "most_connections": row.most_connections,
            "obstacle": printable(row.obstacle),
        }

    def _proposal(self, draft: Draft | None) -> Row | None:
        if draft is None or draft.proposal is None:
            return None
        bus = draft.proposal.bus
        return {
            "name": printable(draft.name),
            "subdevices": len(bus.subdevices),
            "connections": len(bus.connections),
            "unconfirmed": sum(bool(row.unconfirmed) for row in bus.connections),
            "open": [self.place(text) for text in draft.open],
            "notes": [self.place(text) for text in dict.fromkeys(draft.notes)],
        }

    def place(self, text: str) -> str:
        """Return a printable text in which the files have their uploaded names."""
        return printable(self._named(text))

    def _named(self, text: str) -> str:
        if self._folder is None:
            return text
        return text.replace(f"{self._root}/", "")

    @property
    def _root(self) -> str:
        return "" if self._folder is None else self._folder.name


def _possible(offer: Offer, lengths: Sequence[tuple[int, int]]) -> Addition:
    if offer.obstacle:
        raise InputError(f"{offer.order}: {offer.obstacle}")
    return addition_of(offer, lengths)


def _lengths(rows: object) -> list[tuple[int, int]]:
    """Return the frame lengths of each connection that a person has chosen."""
    if not isinstance(rows, list) or not all(
        isinstance(row, list) and [type(size) for size in row] == [int, int] for row in rows
    ):
        raise InputError("connections is a list of two lengths for each connection")
    return [(to, back) for to, back in rows]


def _take(workspace: Workspace, version: int, text: str, files: Mapping[str, str]) -> None:
    """Use a text that refers to device files, which get free names."""

    def change(document: Any, names: Sequence[str]) -> None:
        called = dict(zip(files, names, strict=True))
        for row in document["subdevices"]:
            row["config"] = called[row["config"]]

    workspace.change_with_files(version, list(files.items()), change, text=text)


def _worth_a_word(rows: list[Diagnostic]) -> list[Diagnostic]:
    return [row for row in dict.fromkeys(rows) if row.level is not Severity.INFO]


def _safe(name: str) -> str:
    """Return an external name as a path below a folder, without a way out of it."""
    parts = [re.sub(r"[^\w. ()+-]", "_", part).strip(". ") for part in re.split(r"[/\\]", name)]
    kept = [part for part in parts if part][-_DEEPEST:] or ["file"]
    return "/".join(_short(part) for part in kept)


def _short(part: str) -> str:
    stem, ending = os.path.splitext(part)
    return stem[:_LONGEST_NAME] + ending[:40]
