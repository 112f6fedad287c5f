"""Macros of a xacro file that nothing in it calls, and the files next to it that call them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence

from fsoe_net.formats.shared.xml_tree import Element

MACRO = "xacro:macro"
_PARTS = frozenset({"ros2_control", "ec_module"})
# A parameter with its default: `name:=value`, `name:='a value'`, `name:=^|value`.
_PARAMETER = re.compile(r"""(\*{0,2}[^\s:=]+)(:?=(?:\^\|)?(?:'[^']*'|"[^"]*"|[^\s'"]*))?""")
_MOST_FILES, _MOST_BYTES = 200, 65_536


def macros_of(written: Element) -> list[Element]:
    """Return the macros of a document with a part of the driver."""
    macros = (e for e in written.walk() if e.name == MACRO)
    return [m for m in macros if any(e.name in _PARTS for e in m.walk())]


def callable_macros(macros: Sequence[Element]) -> tuple[str, ...]:
    """Return the names of the macros with a whole block whose parameters all have defaults."""
    return tuple(
        name_of(m)
        for m in macros
        if any(e.name == "ros2_control" for e in m.walk()) and not required_parameters(m)
    )


def name_of(macro: Element) -> str:
    """Return the name by which a macro is called, without the prefix ``xacro:``."""
    return macro.attributes.get("name", "").removeprefix("xacro:")


def required_parameters(macro: Element) -> list[str]:
    """Return the parameters of a macro that have no default."""
    found = _PARAMETER.findall(macro.attributes.get("params", ""))
    # `name:=^` takes the value of the caller, which does not exist here.
    return [name for name, default in found if not default or default.endswith("^")]


def callers_of(path: str, names: Sequence[str]) -> list[str]:
    """Return the xacro files around a file that call one of its macros."""
    calls = re.compile(
        rb"<xacro:(?:" + b"|".join(re.escape(name.encode()) for name in names) + rb")[\s/>]"
    )
    return [
        file
        for file in _xacro_files(os.path.dirname(path) or ".")
        if not _same(file, path) and calls.search(_head(file))
    ]


def _xacro_files(folder: str) -> Iterator[str]:
    """Yield the xacro files of a folder and of those next to it, such as ``config``."""
    left = _MOST_FILES
    above = os.path.normpath(os.path.join(folder, os.pardir))
    others = [e for e in _entries(above) if not os.path.islink(e) and not _same(e, folder)]
    for here in (folder, above, *others):
        for file in _entries(here):
            if left and file.endswith(".xacro") and os.path.isfile(file):
                left -= 1
                yield file


def _entries(folder: str) -> list[str]:
    try:
        return sorted(os.path.normpath(os.path.join(folder, n)) for n in os.listdir(folder))
    except OSError:
        return []


def _same(one: str, other: str) -> bool:
    return os.path.realpath(one) == os.path.realpath(other)


def _head(path: str) -> bytes:
    try:
        with open(path, "rb") as stream:
            return stream.read(_MOST_BYTES)
    except OSError:
        return b""
