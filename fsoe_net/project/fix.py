"""Applies hints that have exactly one solution to the files."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Iterable, Mapping, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Diagnostic, Edit
from fsoe_net.formats.own.patch import patch_yaml
from fsoe_net.formats.shared.files import STDIN, read_unchanged
from fsoe_net.formats.shared.write_files import write_all
from fsoe_net.model.network import SourceFile

_AGAIN = "check it again"


@dataclass(frozen=True, slots=True, kw_only=True)
class Fixes:
    """The changes of the hints.

    Attributes:
        before: The original files, by path.
        after: The changed files.
        fixed: Number of findings fixed.
    """

    before: Mapping[str, bytes]
    after: Mapping[str, bytes]
    fixed: int

    @classmethod
    def of(cls, found: Sequence[Diagnostic], sources: Sequence[SourceFile]) -> Fixes:
        """Return the changes that the hints of findings make in their files.

        Raises:
            InputError: A file has changed since it was read.
        """
        hashes = {source.path: source.sha256 for source in sources}
        named = dict.fromkeys(e.span.file for d in found for e in d.edits)
        own = [path for path in named if path in hashes and path != STDIN]
        before = {path: read_unchanged(path, hashes[path], next_step=_AGAIN) for path in own}
        after: dict[str, bytes] = {}
        made: set[Edit] = set()
        for path, data in before.items():
            # A finding with edits in two files is skipped: half an edit would be worse than none.
            fitting = [d for d in found if {e.span.file for e in d.edits} == {path}]
            patched, edits = _patched(data, path, fitting)
            made |= edits
            if patched != data:
                after[path] = patched
        fixed = sum(bool(d.edits) and set(d.edits) <= made for d in found)
        return cls(before=before, after=after, fixed=fixed)

    def diff(self) -> str:
        """Return the change as a unified diff; empty if there is none."""
        lines: list[str] = []
        for path, data in self.after.items():
            old, new = (text.decode("utf-8").splitlines() for text in (self.before[path], data))
            lines += difflib.unified_diff(old, new, path, f"{path}, fixed", lineterm="")
        return "".join(f"{line}\n" for line in lines)

    def write(self) -> None:
        """Write the files, all or none.

        Raises:
            InputError: A file has been changed since it was read.
            EnvironmentFault: A file cannot be written.
        """
        for path in self.after:
            sha256 = hashlib.sha256(self.before[path]).hexdigest()
            read_unchanged(path, sha256, next_step=_AGAIN)
        write_all("", self.after, overwrite=True)


def _patched(data: bytes, path: str, found: Iterable[Diagnostic]) -> tuple[bytes, frozenset[Edit]]:
    """Return the file with all findings fixed whose edits can be applied."""
    rows = list(found)
    while True:
        patched, made = patch_yaml(data, path, [e for d in rows for e in d.edits])
        whole = [d for d in rows if set(d.edits) <= made]
        if len(whole) == len(rows):
            return patched, made
        # The edits of a finding that cannot be fixed as a whole must not stay.
        rows = whole
