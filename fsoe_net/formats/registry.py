"""The file formats, one folder each, discovered by the `FORMAT` that a folder declares.

A new format is a folder next to this file whose ``__init__`` has a `FORMAT`, a section of
``docs/reference/input-files.md`` and tests. Commands, their help, completion and errors then
include it. Readers and writers are named as text, ``module:function``, and imported on first use.
"""

from __future__ import annotations

import enum
import functools
import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any

from fsoe_net import formats
from fsoe_net.dataclass import dataclass
from fsoe_net.formats.shared.ring import fits_on_bus

if TYPE_CHECKING:
    from fsoe_net.formats.shared.files import Collector
    from fsoe_net.formats.shared.source import Source
    from fsoe_net.model.description import Description


class Yields(enum.Enum):
    """What a file of a format yields to readers."""

    NETWORK = "a network, or a part of one"  # read together by `own.network.load_network`
    BUS = "SubDevices with their places"
    TYPES = "device types, without places"
    CATALOGUE = "device types, of which only those that are there are read"  # ESI
    CONNECTIONS = "connections of a safety project, without places"


@dataclass(frozen=True, slots=True, kw_only=True)
class Signature:
    """Identifies a file by content. Patterns are regular expressions.

    Attributes:
        words: Description of such a file, with an article.
        begins: Start of the file.
        root: Its XML root element.
        text: Text in its first 64 KiB; combined with ``root`` if both are given.
        confirm: ``module:function`` that checks the same bytes, where ``begins`` is not sufficient.
        next_step: Next step, if no reader supports it.
    """

    words: str
    begins: bytes = b""
    root: str = ""
    text: bytes = b""
    confirm: str = ""
    next_step: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A way to write a format.

    Attributes:
        name: Value of ``convert --to``.
        write: ``module:function``, which takes a `Description`, ``file=`` and the ``options`` and
            returns a `Written`.
        options: Further arguments of that function.
        suffixes: Suffixes that select this target.
        is_folder: Whether it consists of several files, with their own names.
        renew: ``module:function`` that puts the copies of a network into a file of this format
            instead of its own; takes the `Description`, the path and a list for notes.
        needs_start: Whether ESI start-up data of a device is written.
    """

    name: str
    write: str
    options: Mapping[str, object] = field(default_factory=dict)
    suffixes: tuple[str, ...] = ()
    is_folder: bool = False
    renew: str = ""
    needs_start: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """One format of files.

    Attributes:
        kind: Value of ``convert --from``.
        title: Description of such a file, with an article.
        expects: Appearance of such a file; shown for unknown files.
        yields: Purpose of reading it.
        read: ``module:function``, which takes a `Source`, a `Collector` and ``name=`` and returns a
            `Description` or ``None``; empty if it yields a network.
        signatures: Definite signatures; the first match counts.
        guesses: Patterns in the first 64 KiB that indicate the format if no signature matches and
            the suffix is unknown.
        suffixes: Suffixes that identify it if the content does not.
        is_streamed: Whether it is read from a path piece by piece, whatever its size.
        has_masters: Whether a file may have several EtherCAT masters; the reader takes ``master=``.
        is_binary: Whether it accepts binary files that no other format identifies.
        parts: Suffixes of files named by another file of the same folder, by the suffix of that
            file.
        targets: Ways to write it.
    """

    kind: str
    title: str
    expects: str
    yields: Yields
    read: str = ""
    signatures: tuple[Signature, ...] = ()
    guesses: tuple[bytes, ...] = ()
    suffixes: tuple[str, ...] = ()
    is_streamed: bool = False
    has_masters: bool = False
    is_binary: bool = False
    parts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    targets: tuple[Target, ...] = ()


@functools.cache
def all_formats() -> Mapping[str, Format]:
    """Return the formats by kind, in the order of their folders."""
    found = {}
    for folder in sorted(m.name for m in pkgutil.iter_modules(formats.__path__) if m.ispkg):
        module = importlib.import_module(f"{formats.__name__}.{folder}")
        declared = getattr(module, "FORMAT", None)
        if declared is not None:
            found[declared.kind] = declared
    return found


@functools.cache
def all_targets() -> Mapping[str, Target]:
    """Return the available targets, by name."""
    return {t.name: t for f in all_formats().values() for t in f.targets}


def target_of(path: str) -> tuple[str, Target | None]:
    """Return the longest known suffix of a file, and its target.

    The suffix is empty if unknown; the target is missing for read-only formats.
    """
    known: dict[str, Target | None] = {}
    for one in all_formats().values():
        known |= dict.fromkeys(one.suffixes)
    for target in all_targets().values():
        known |= dict.fromkeys(target.suffixes, target)
    suffix = max((s for s in known if path.lower().endswith(s)), key=len, default="")
    return suffix, known.get(suffix)


def function_of(place: str) -> Callable[..., Any]:
    """Return the function named ``module:function``."""
    module, _, name = place.partition(":")
    found: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return found


def read_foreign(
    source: Source, found: Format, out: Collector, *, name: str = "<file>", master: str = ""
) -> Description | None:
    """Read a file of another tool that describes a bus, or all devices of a small ESI.

    Args:
        source: Path, or the bytes of the file.
        found: Its format; it does not yield a network.
        out: Takes its findings.
        name: Name shown when ``source`` is bytes.
        master: Number or name of the master to read if a file has several.
    """
    chosen = {"master": master} if found.has_masters else {}
    read: Description | None = function_of(found.read)(source, out, name=name, **chosen)
    is_bus = read is not None and found.yields is Yields.BUS
    return None if read is None or (is_bus and not fits_on_bus(read.subdevices, out)) else read
