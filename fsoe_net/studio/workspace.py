"""A network file that people edit in a browser: its text, its findings, undo and redo.

The text is the only state. Every change in the page is a change of the text: comments and the order
of keys are preserved, and nothing is written before ``save``.
"""

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from typing import Any

from fsoe_net.errors import InputError
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.patch import patch_yaml
from fsoe_net.formats.shared.files import read_source, read_unchanged, replaced_files
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.model.network import SourceFile
from fsoe_net.project.check import Checked, check_files
from fsoe_net.project.edit import EditedText
from fsoe_net.studio.changes import change_of
from fsoe_net.studio.device_files import DeviceFiles

MAX_TEXT_BYTES = 4 * 1024 * 1024
"""Maximum size of a text edited in the page; the commands accept larger files."""

_MOST_STEPS = 200  # of undo
_MOST_KEPT_BYTES = 64 * 1024 * 1024  # of all steps together


class StaleVersion(Exception):
    """The page has sent a change of an outdated text."""


@dataclass(slots=True)
class _Steps:
    """Earlier texts, or later ones; the oldest are dropped first."""

    texts: list[str] = field(default_factory=list)

    def add(self, text: str) -> None:
        self.texts.append(text)
        while len(self.texts) > 1 and (
            len(self.texts) > _MOST_STEPS or sum(map(len, self.texts)) > _MOST_KEPT_BYTES
        ):
            del self.texts[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class _OnDisk:
    """The file as last read or written: its text, the hash of its bytes, its mark.

    ``sha256`` is empty while the file does not exist.
    """

    text: str = ""
    sha256: str = ""
    mark: bytes = b""


class Workspace:
    """One network file being edited; every method may be called from any thread.

    Args:
        path: The file.
        loading: Options for following references.
        new_text: Initial text if the file does not exist, not yet written.

    Attributes:
        path: The file.
        loading: Options for following references.
        version: Counts changes of the displayed text; a change names the version that it is based
            on.
        text: The text in the page.
        outside: Whether another program has changed the file since it was read or written here.
        checked: The network of the text, with its findings.

    Raises:
        InputError: The file cannot be read, is not text, or has more than ``MAX_TEXT_BYTES``.
    """

    def __init__(
        self, path: str, loading: LoadOptions | None = None, *, new_text: str | None = None
    ) -> None:
        self.path = path
        self.loading = loading or LoadOptions()
        self._new = DeviceFiles(os.path.dirname(path))
        self._lock = threading.RLock()
        self._undo, self._redo = _Steps(), _Steps()
        self.version = 1
        self.outside = False
        # A new file must not replace one that was created in the meantime.
        is_new = new_text is not None and not os.path.lexists(path)
        self._file = _OnDisk() if is_new else _read(path)
        self._signature: tuple[tuple[str, int, int], ...] = ()
        self.text = new_text if is_new and new_text is not None else self._file.text
        self.checked = self._check()

    @property
    def is_new(self) -> bool:
        """Whether the file does not exist yet; `save` creates it."""
        return not self._file.sha256

    @property
    def is_saved(self) -> bool:
        """Whether the file has this text."""
        return self.text == self._file.text and not self.is_new

    @property
    def unwritten(self) -> tuple[str, ...]:
        """Names of the device files that `save` writes next to the network file."""
        return tuple(self._new.named_in(self.text))

    @contextmanager
    def read_as_edited(self) -> Iterator[None]:
        """Make readers use the text and the device files of the page."""
        with self._lock:
            contents = self._contents()
        with replaced_files(contents):
            yield

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return bool(self._undo.texts)

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to redo."""
        return bool(self._redo.texts)

    def replace(self, version: int, text: str) -> None:
        """Accept a text entered by a person.

        Raises:
            StaleVersion: ``version`` is not the current one.
            InputError: The text is too long.
        """
        with self._lock:
            self._expect(version)
            _limit(text)
            if "\r" in self.text:  # a browser supports only one line ending
                text = _with_line_ends(self.text, text)
            self._set(text)

    def change(self, version: int, request: Mapping[str, object]) -> None:
        """Make a change of the network; see `fsoe_net.studio.changes`.

        Raises:
            StaleVersion: ``version`` is not the current one.
            InputError: Unknown change, or the text is not valid YAML.
        """
        with self._lock:
            self._expect(version)
            change = change_of(request, self.checked)
            edited = EditedText(self.text, self.path)
            change(edited.document)
            self._set(edited.text)

    def change_with_files(
        self,
        version: int,
        files: Sequence[tuple[str, str]],
        change: Callable[[Any, Sequence[str]], None],
        *,
        text: str | None = None,
    ) -> None:
        """Make a change that needs device files; `save` writes them without replacing any.

        Args:
            version: Version of the text.
            files: Proposed names of device files, each with its text.
            change: Changes the maps and lists of the file; takes the names of the device files.
            text: Text to change instead of the current one.

        Raises:
            StaleVersion: ``version`` is not the current one.
            InputError: The text is not valid YAML.
        """
        with self._lock:
            self._expect(version)
            edited = EditedText(self.text if text is None else text, self.path)
            new = self._new.those_in([self.text, *self._undo.texts])
            names = new.keep(files)
            change(edited.document, names)
            made = edited.text
            _limit(made)
            if made != self.text:  # otherwise redo is kept
                self._new = new
            self._set(made)

    def fix(self, version: int, number: int) -> None:
        """Apply the hint of a finding that has exactly one solution.

        Args:
            version: Version of the text.
            number: Number of the finding, from 0.

        Raises:
            StaleVersion: ``version`` is not the current one.
            InputError: The finding has no such hint, or it is about another file.
        """
        with self._lock:
            self._expect(version)
            rows = self.checked.diagnostics
            edits = rows[number].edits if 0 <= number < len(rows) else ()
            data, made = patch_yaml(self.text.encode("utf-8"), self.path, edits)
            if not edits or made != set(edits):
                raise InputError("this finding has no hint that the page could follow")
            self._set(data.decode("utf-8"))

    def undo(self, version: int) -> None:
        """Undo the last step, if any. Raises as in `replace`."""
        self._step(version, self._undo, self._redo)

    def redo(self, version: int) -> None:
        """Redo the last undone step. Raises as in `replace`."""
        self._step(version, self._redo, self._undo)

    def save(self, version: int) -> None:
        """Write the file, completely or not at all, even if the network has errors.

        New device files of the network are written first.

        Raises:
            StaleVersion: ``version`` is not the current one.
            InputError: The file was changed by another program (`take_file` loads it), or a device
                file with another content was created in the meantime.
            EnvironmentFault: A file cannot be written; the existing content is unchanged.
        """
        with self._lock:
            self._expect(version)
            step = "take the file's text, and yours comes back with undo"
            if not self.is_new:
                read_unchanged(self.path, self._file.sha256, next_step=step)
            elif os.path.lexists(self.path):
                raise InputError(f"nothing written: {self.path} was created meanwhile; {step}")
            mark = self._file.mark
            data = mark + self.text.encode("utf-8")
            self._new.write(self.text)
            write_whole(self.path, data, overwrite=not self.is_new)
            sha256 = hashlib.sha256(data).hexdigest()
            self._file = _OnDisk(text=self.text, sha256=sha256, mark=mark)
            self.outside = False
            self._signature = self._signed()
            self.version += 1

    def take_file(self, version: int) -> None:
        """Use the current text of the file; `undo` restores the previous one.

        Raises:
            StaleVersion: ``version`` is not the current one.
            InputError: The file cannot be read.
        """
        with self._lock:
            self._expect(version)
            self._file = _read(self.path)
            self.outside = False
            self._set(self._file.text)

    def look(self) -> bool:
        """Check whether a file has changed on disk; return whether the page must be notified.

        The network file is read again if the text has no changes; every other file counts
        immediately.
        """
        with self._lock:
            # Sizes and times only: this is called often, and reading all files takes time.
            if self._signature == self._signed():
                return False
            self._signature = self._signed()
            found = None
            try:
                found = _read(self.path)
            # An editor replaces a file in two steps, so it may be missing for a moment.
            except InputError:
                self.outside = not self.is_new or os.path.lexists(self.path)
            else:
                self.outside = found.sha256 != self._file.sha256
            # Without own changes, using the text on disk loses nothing.
            if self.outside and self.is_saved and found is not None:
                self._file, self.outside = found, False
                self._set(found.text)
            else:
                # A device file has changed: the text is the same, but its findings may differ.
                self._renew()
            return True

    def _step(self, version: int, back: _Steps, forth: _Steps) -> None:
        with self._lock:
            self._expect(version)
            if back.texts:
                forth.add(self.text)
                self.text = back.texts.pop()
                self._renew()

    def _expect(self, version: int) -> None:
        if version != self.version:
            raise StaleVersion

    def _set(self, text: str) -> None:
        _limit(text)
        if text == self.text:
            self.version += 1
            return
        self._undo.add(self.text)
        self._redo.texts.clear()
        self.text = text
        self._renew()

    def _renew(self) -> None:
        self.checked = self._check()
        self.version += 1

    def _check(self) -> Checked:
        with replaced_files(self._contents()):
            checked = check_files([self.path], self.loading, compared=True)
        network = checked.network
        self._sources: tuple[SourceFile, ...] = () if network is None else network.sources
        self._signature = self._signed()
        return checked

    def _contents(self) -> dict[str, bytes]:
        return {**self._new.contents, self.path: self.text.encode("utf-8")}

    def _signed(self) -> tuple[tuple[str, int, int], ...]:
        paths = dict.fromkeys([self.path, *(source.path for source in self._sources)])
        return tuple(_state(path) for path in paths)


def _limit(text: str) -> None:
    try:
        size = len(text.encode("utf-8"))
    except UnicodeEncodeError as exc:
        raise InputError("the text has half a character in it, which no file can hold") from exc
    if size > MAX_TEXT_BYTES:
        raise InputError(f"the text has more than {MAX_TEXT_BYTES >> 20} MiB")


def _with_line_ends(before: str, after: str) -> str:
    """Return a text from a browser, which has one line ending, with those of the file."""
    # Compared line by line: lines that were not edited keep their own line ending.
    own, new = before.splitlines(keepends=True), after.splitlines(keepends=True)
    plain = [line.replace("\r\n", "\n") for line in own]
    end = "\r\n" if own[0].endswith("\r\n") else "\n"
    lines: list[str] = []
    # `autojunk` would ignore frequent lines, such as empty ones, from 200 lines on.
    for kind, begin, stop, first, last in SequenceMatcher(
        None, plain, new, autojunk=False
    ).get_opcodes():
        if kind == "equal":
            lines += own[begin:stop]
        else:
            lines += [line.replace("\n", end) for line in new[first:last]]
    return "".join(lines)


def _state(path: str) -> tuple[str, int, int]:
    try:
        found = os.stat(path)
    except OSError:
        return path, -1, -1
    return path, found.st_mtime_ns, found.st_size


def _read(path: str) -> _OnDisk:
    source, data = read_source(path, most=MAX_TEXT_BYTES)
    # Editors of Windows write a byte order mark; the file keeps it.
    mark = b"\xef\xbb\xbf" if data.startswith(b"\xef\xbb\xbf") else b""
    try:
        text = data[len(mark) :].decode("utf-8")
    except UnicodeDecodeError as exc:
        raise InputError(f"{path} is not UTF-8 text, as a network file must be: {exc}") from exc
    return _OnDisk(text=text, sha256=source.sha256, mark=mark)
