"""A YAML file of a network, changed by a program; comments and layout stay."""

from __future__ import annotations

import difflib
import hashlib
import io
from collections.abc import Callable
from difflib import SequenceMatcher
from typing import TYPE_CHECKING, Any

from fsoe_net.errors import InputError
from fsoe_net.formats.shared.files import (
    Collector,
    read_source,
    read_unchanged,
    replaced_files,
)
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.formats.shared.yaml_tree import parse_yaml
from fsoe_net.project.findings import Findings

if TYPE_CHECKING:
    from ruamel.yaml import YAML

    from fsoe_net.project.network import Network

__all__ = ["EditedText", "NetworkEdit", "with_lines_kept"]


class NetworkEdit:
    """A file of a network that is being changed; see `fsoe_net.Network.edit`.

    Attributes:
        path: The file.
        document: Its maps and lists, as `dict` and `list`, to be changed in place.
    """

    document: Any

    def __init__(self, path: str, load_again: Callable[[], Network]) -> None:
        source, data = read_source(path)
        out = Collector()
        if parse_yaml(data, path, out) is None:
            raise InputError(f"{path} cannot be edited", out.diagnostics)
        self.path = path
        self._load_again = load_again
        self._sha256 = source.sha256
        self._edited = EditedText(data.decode("utf-8-sig"), path)
        self.document = self._edited.document

    @property
    def text(self) -> str:
        """The file as it would be: lines without a change stay as they are.

        Raises:
            ValueError: Something in `document` is nothing that YAML can hold.
        """
        return self._edited.text

    def diff(self) -> str:
        """Return the change as a unified diff; empty when there is none."""
        before, after = self._edited.before.splitlines(), self.text.splitlines()
        lines = difflib.unified_diff(before, after, self.path, f"{self.path}, edited", lineterm="")
        return "".join(f"{line}\n" for line in lines)

    def check(self) -> Findings:
        """Return what `fsoe_net.Network.check` would find after `save`; nothing is written."""
        with replaced_files({self.path: self.text.encode("utf-8")}):
            return self._load_again().check()

    def save(self) -> Network:
        """Write the file, and return the network as it is now.

        Raises:
            InputError: Somebody else has changed the file since it was read.
            EnvironmentFault: It cannot be written; what was there is unchanged.
        """
        text = self.text.encode("utf-8")
        read_unchanged(self.path, self._sha256, next_step="edit it again")
        write_whole(self.path, text, overwrite=True)
        self._edited.settle()
        self._sha256 = hashlib.sha256(text).hexdigest()
        return self._load_again()


class EditedText:
    """A text of YAML whose maps and lists a program changes; lines without a change stay.

    Args:
        text: The text.
        path: What messages call it.

    Attributes:
        before: The text.
        document: Its maps and lists, as `dict` and `list`, to be changed in place.

    Raises:
        InputError: The text cannot be read.
    """

    document: Any

    def __init__(self, text: str, path: str) -> None:
        from ruamel.yaml.error import YAMLError
        from ruamel.yaml.util import load_yaml_guess_indent

        self.before, self._path = text, path
        given = text.replace("\r\n", "\n")  # the reader takes "\r" for a part of comments
        indent = offset = None
        try:
            try:
                self.document, indent, offset = load_yaml_guess_indent(given, yaml=_yaml())
            except IndexError:  # the guess stumbles over lines of dashes only
                self.document = _yaml().load(given)
        except (YAMLError, ValueError) as exc:
            raise InputError(f"{path} cannot be edited: {exc}") from exc
        self._indent = (4 if indent is None else indent, 2 if offset is None else offset)
        self._laid_out = self._dumped()

    @property
    def text(self) -> str:
        """The text as it would be.

        Raises:
            ValueError: Something in `document` is nothing that YAML can hold.
        """
        return with_lines_kept(self.before, self._laid_out, self._dumped())

    def settle(self) -> None:
        """Count further changes from the text as it is now."""
        self.before, self._laid_out = self.text, self._dumped()

    def _dumped(self) -> str:
        from ruamel.yaml.error import YAMLError

        stream = io.StringIO()
        yaml = _yaml()  # a new one: after an error, one writes nothing more and does not say so
        yaml.indent(mapping=2, sequence=self._indent[0], offset=self._indent[1])
        try:
            yaml.dump(self.document, stream)
        except YAMLError as exc:
            raise ValueError(f"{self._path} cannot be written: {exc}") from exc
        return stream.getvalue()


def with_lines_kept(before: str, laid_out: str, after: str) -> str:
    """Return a text after a change in which only lines that the change touched are new.

    Comments before and behind a part stay when the part goes.

    Args:
        before: The text as a person laid it out.
        laid_out: The same as the writer lays it out, which has other spaces in it.
        after: The changed text as the writer lays it out.
    """
    if after == laid_out:
        return before
    own, plain, new = (text.splitlines(keepends=True) for text in (before, laid_out, after))
    if len(own) != len(plain):  # a line that the writer folds in another way
        return after
    end = "\r\n" if own and own[0].endswith("\r\n") else "\n"
    lines: list[str] = []
    lost: list[tuple[int, list[str]]] = []
    for kind, begin, stop, first, last in SequenceMatcher(
        None, plain, new, autojunk=False
    ).get_opcodes():
        if kind == "equal":
            lines += own[begin:stop]
        else:
            lines += [line.rstrip("\r\n") + end for line in new[first:last]]
            lost.append((len(lines), _comments_behind(own[begin:stop])))
    # The writer takes the comment before a part for one behind the part above it.
    for at, comments in reversed(lost):
        with_comments = [*lines[:at], *comments, *lines[at:]]
        if comments and _says(with_comments) == _says(lines):
            lines = with_comments
    return "".join(lines)


def _comments_behind(lines: list[str]) -> list[str]:
    """Return the lines without a word of YAML at the end of a part that goes."""
    words = [n for n, line in enumerate(lines) if line.strip() and line.lstrip()[0] != "#"]
    behind = lines[words[-1] + 1 :] if words else lines
    return behind if any(line.strip() for line in behind) else []


def _says(lines: list[str]) -> object:
    """Return what lines say: one that looks like a comment may belong to a longer value."""
    import yaml

    try:
        return yaml.load("".join(lines), getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # noqa: S506 - safe
    except yaml.YAMLError:
        return None


def _yaml() -> YAML:
    """Return a reader and writer that keeps quotes, long lines and nulls as they are."""
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = 1_000_000
    yaml.representer.add_representer(
        type(None),
        lambda representer, _: representer.represent_scalar("tag:yaml.org,2002:null", "null"),
    )
    return yaml
