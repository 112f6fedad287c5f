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

__all__ = ["NetworkEdit", "edited_text", "with_lines_kept"]


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
        self._before = data.decode("utf-8-sig")
        self._sha256 = source.sha256
        self.document = _loaded(self._before, path)

    @property
    def text(self) -> str:
        """The file as it would be: lines without a change stay as they are.

        Raises:
            ValueError: Something in `document` is nothing that YAML can hold.
        """
        return _written(self.document, self._before, self.path)

    def diff(self) -> str:
        """Return the change as a unified diff; empty when there is none."""
        before, after = self._before.splitlines(), self.text.splitlines()
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
        self._before, self._sha256 = text.decode("utf-8"), hashlib.sha256(text).hexdigest()
        return self._load_again()


def edited_text(text: str, change: Callable[[Any], None], *, path: str) -> str:
    """Return a text of YAML with a change of what it says; lines without a change stay.

    Args:
        text: The text.
        change: Changes its maps and lists (`dict`, `list`) in place.
        path: What messages call it.

    Raises:
        InputError: The text cannot be read.
        ValueError: The change brings something that YAML cannot hold.
    """
    document = _loaded(text, path)
    change(document)
    return _written(document, text, path)


def _loaded(text: str, path: str) -> Any:
    from ruamel.yaml.error import YAMLError

    try:
        # The reader takes the ends of other systems for a part of comments.
        return _like(text).load(text.replace("\r\n", "\n"))
    except (YAMLError, ValueError) as exc:
        raise InputError(f"{path} cannot be edited: {exc}") from exc


def _written(document: Any, before: str, path: str) -> str:
    return with_lines_kept(
        before, _dumped(_loaded(before, path), before, path), _dumped(document, before, path)
    )


def _dumped(document: Any, like: str, path: str) -> str:
    from ruamel.yaml.error import YAMLError

    stream = io.StringIO()
    try:
        # A new one each time: after an error, one writes nothing more and does not say so.
        _like(like).dump(document, stream)
    except YAMLError as exc:
        raise ValueError(f"{path} cannot be written: {exc}") from exc
    return stream.getvalue()


def with_lines_kept(before: str, laid_out: str, after: str) -> str:
    """Return a text after a change in which only lines that the change touched are new.

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
    for kind, begin, stop, first, last in SequenceMatcher(
        None, plain, new, autojunk=False
    ).get_opcodes():
        if kind == "equal":
            lines += own[begin:stop]
        else:
            lines += [line.rstrip("\r\n") + end for line in new[first:last]]
    return "".join(lines)


def _like(text: str) -> YAML:
    """Return a reader and writer that keeps the layout of a text."""
    from ruamel.yaml import YAML
    from ruamel.yaml.util import load_yaml_guess_indent

    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = 1_000_000
    _, indent, offset = load_yaml_guess_indent(text)
    yaml.indent(
        mapping=2,
        sequence=4 if indent is None else indent,
        offset=2 if offset is None else offset,
    )
    yaml.representer.add_representer(
        type(None),
        lambda representer, _: representer.represent_scalar("tag:yaml.org,2002:null", "null"),
    )
    return yaml
