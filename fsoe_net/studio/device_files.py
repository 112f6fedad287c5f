"""Device files of a network that is being edited; they are not yet written."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable, Iterator, Sequence

from fsoe_net.errors import InputError
from fsoe_net.formats.shared.files import read_source
from fsoe_net.formats.shared.write_files import write_all


class DeviceFiles:
    """Texts that stay in memory until the network that refers to them is saved.

    They are kept after undo, so that redo finds them, until another change discards redo. Existing
    files are never replaced.

    Args:
        folder: Folder of the network file, which their names are relative to.

    Attributes:
        contents: Bytes by path, as used by readers.
    """

    def __init__(self, folder: str) -> None:
        self._folder = folder
        self._names: dict[str, str] = {}  # by path
        self.contents: dict[str, bytes] = {}

    def keep(self, files: Sequence[tuple[str, str]]) -> list[str]:
        """Store texts and return the name of each: a free one, or that of an equal text.

        Args:
            files: Proposed names, each with its text.
        """
        names = []
        for proposed, text in files:
            data = text.encode("utf-8")
            name, path = next(
                (name, path)
                for name, path in self._candidates(proposed)
                if self._has(path) in (None, data)
            )
            names.append(name)
            if not os.path.lexists(path):
                self._names[path] = name
                self.contents[path] = data
        return names

    def those_in(self, texts: Iterable[str]) -> DeviceFiles:
        """Return the files that are named by one of the texts; the other names become free."""
        kept = DeviceFiles(self._folder)
        wanted = {name for text in texts for name in self.named_in(text)}
        kept._names = {path: name for path, name in self._names.items() if name in wanted}
        kept.contents = {path: self.contents[path] for path in kept._names}
        return kept

    def named_in(self, text: str) -> Iterator[str]:
        """Yield the names that occur in a text."""
        return (name for name in self._names.values() if name in text)

    def write(self, text: str) -> None:
        """Write the files named in a text, all or none.

        Raises:
            InputError: A file with another content has been created in the meantime.
            EnvironmentFault: A file cannot be written.
        """
        # Files named only by an undone step are not written; they are kept for redo.
        wanted = [path for path, name in self._names.items() if name in text]
        # All are checked before one is written, so that an error leaves the folder unchanged.
        for path in wanted:
            if os.path.lexists(path) and _content(path) != self.contents[path]:
                raise InputError(
                    f"nothing written: {path} was created meanwhile; undo, and add the "
                    "SubDevice again: its file then gets another name"
                )
        absent = {path: self.contents[path] for path in wanted if not os.path.lexists(path)}
        write_all("", absent, overwrite=False)
        for path in wanted:
            del self._names[path], self.contents[path]

    def _candidates(self, proposed: str) -> Iterator[tuple[str, str]]:
        stem, ending = os.path.splitext(proposed)
        for number in itertools.count(1):
            name = proposed if number == 1 else f"{stem}_{number}{ending}"
            yield name, os.path.normpath(os.path.join(self._folder, name))

    def _has(self, path: str) -> bytes | None:
        """Return the current or future content of a path; ``None`` if it is free."""
        if path in self.contents and not os.path.lexists(path):
            return self.contents[path]
        return _content(path) if os.path.lexists(path) else None


def _content(path: str) -> bytes:
    """Return the content of a file; an unreadable file matches no format."""
    try:
        return read_source(path)[1]
    except InputError:
        return b""
