"""Changes of a YAML file of a network by a program; comments and layout are preserved."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import yaml

from fsoe_net.errors import InputError
from fsoe_net.formats.shared.changed_text import changed_text
from fsoe_net.formats.shared.files import (
    Collector,
    read_source,
    read_unchanged,
    replaced_files,
)
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.formats.shared.yaml_parts import Part, ReadText, adopt, is_same
from fsoe_net.formats.shared.yaml_tree import parse_yaml
from fsoe_net.project.findings import Findings

if TYPE_CHECKING:
    from fsoe_net.network import Network


class NetworkEdit:
    """A file of a network that is being edited; see `fsoe_net.Network.edit`.

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
        """The resulting file; lines without a change are preserved.

        Raises:
            ValueError: A value in `document` cannot be represented in YAML.
        """
        return self._edited.text

    def diff(self) -> str:
        """Return the change as a unified diff; empty if there is none."""
        before, after = self._edited.before.splitlines(), self.text.splitlines()
        lines = difflib.unified_diff(before, after, self.path, f"{self.path}, edited", lineterm="")
        return "".join(f"{line}\n" for line in lines)

    def check(self) -> Findings:
        """Return the findings of `fsoe_net.Network.check` after `save`, without writing a file."""
        with replaced_files({self.path: self.text.encode("utf-8")}):
            return self._load_again().check()

    def save(self) -> Network:
        """Write the file, and return the resulting network.

        Raises:
            InputError: The file has been changed since it was read.
            EnvironmentFault: The file cannot be written; the existing content is unchanged.
        """
        text = self.text.encode("utf-8")
        read_unchanged(self.path, self._sha256, next_step="edit it again")
        write_whole(self.path, text, overwrite=True)
        self._edited.settle()
        self._sha256 = hashlib.sha256(text).hexdigest()
        return self._load_again()


class EditedText:
    """YAML text edited through its maps and lists; unchanged lines are preserved.

    Args:
        text: The text.
        path: Name used in messages.

    Attributes:
        before: The text.
        document: Its maps and lists, as `dict` and `list`, to be changed in place. A moved or
            replaced one is rewritten without its comments.

    Raises:
        InputError: The text cannot be read.
    """

    document: Any

    def __init__(self, text: str, path: str) -> None:
        self._path = path
        try:
            self._read = ReadText(text)
        except ValueError as exc:
            raise InputError(f"{path} cannot be edited: {exc}") from exc
        self.before, self.document = text, self._read.root.value

    @property
    def text(self) -> str:
        """The resulting text.

        Raises:
            ValueError: A value in `document` cannot be represented in YAML, or the layout of the
                lines next to a change does not allow it.
        """
        why = (
            "cannot be edited: the lines next to the change have an unusual layout; change it "
            "in the text"
        )
        try:
            if is_same(self._read.root, self.document):
                return self.before
            text = changed_text(self._read, self.document)
            if text is not None:
                if not self.before.endswith("\n"):
                    text = text.removesuffix("\n").removesuffix("\r")
                # Lines may have another meaning at their new place.
                if is_same(_root(text), self.document):
                    return text
        except RecursionError:
            why = "cannot be written: it is nested too deep"
        except yaml.YAMLError as exc:
            why = f"cannot be written: {exc}"
        raise ValueError(f"{self._path} {why}")

    def settle(self) -> None:
        """Make the current text the base of further changes."""
        self.before = self.text
        self._read = ReadText(self.before)
        adopt(self._read.root, self.document)


def _root(text: str) -> Part:
    try:
        return ReadText(text).root
    except ValueError:
        return Part("", 0, None, 0, 0)
