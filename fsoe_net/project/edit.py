"""A YAML file of a network, changed by a program; comments and layout stay."""

from __future__ import annotations

import difflib
import hashlib
import io
from collections.abc import Callable
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
from fsoe_net.project.lines_kept import said, with_lines_kept

if TYPE_CHECKING:
    from ruamel.yaml import YAML

    from fsoe_net.project.network import Network

__all__ = ["EditedText", "NetworkEdit"]


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
            ValueError: Something in `document` is nothing that YAML can hold, or the lines beside a
                change are laid out in such a way that it cannot be put there.
        """
        after = self._dumped()
        if after == self._laid_out:
            return self.before
        text = with_lines_kept(self.before, self._laid_out, after)
        # What the writer makes is compared first, which is quicker; it has faults of its own.
        if said([text]) != said([after]) and _loaded(text) != self.document:
            raise ValueError(
                f"{self._path} cannot be edited: the lines beside the change are laid out in an "
                "odd way; change it in the text"
            )
        return text

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


def _loaded(text: str) -> object:
    from ruamel.yaml.error import YAMLError

    try:
        return _yaml().load(text)
    except (YAMLError, ValueError):
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
