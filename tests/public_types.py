"""Finds the types that a user of the public names can meet, by the type hints of these names."""

from __future__ import annotations

import ast
import functools
import importlib
import inspect
import typing
from collections.abc import Collection, Iterator
from types import SimpleNamespace
from typing import Any

import fsoe_net

_SPECIAL = ("__call__", "__getitem__", "__iter__")


def reachable_types(left_out: Collection[str]) -> dict[str, str]:
    """Return the full name of each type of the package that can be met, and where it was met.

    Args:
        left_out: Attributes that are not followed, such as ``Draft.inputs``.
    """
    reached: dict[str, str] = {}
    ahead = [(getattr(fsoe_net, name), name) for name in fsoe_net.__all__]
    while ahead:
        thing, place = ahead.pop()
        if not inspect.isclass(thing):
            ahead += [(found, place) for found in _types(_hints(thing, thing.__module__))]
            continue
        name = f"{thing.__module__}.{thing.__qualname__}"
        if not name.startswith("fsoe_net.") or name in reached:
            continue
        reached[name] = place
        for owner in thing.__mro__:
            if owner.__module__.startswith("fsoe_net."):
                for attribute, hints in _attributes(owner):
                    place = f"{thing.__name__}.{attribute}"
                    if place not in left_out:
                        ahead += [(found, place) for found in _types(hints)]
    return reached


def _attributes(owner: type) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the public attributes of a class, each with its type hints."""
    for name, hint in inspect.get_annotations(owner).items():
        if not name.startswith("_"):
            yield name, _hints(SimpleNamespace(__annotations__={name: hint}), owner.__module__)
    for name, value in vars(owner).items():
        if name.startswith("_") and name not in _SPECIAL:
            continue
        if isinstance(value, property):
            value = value.fget
        elif isinstance(value, functools.cached_property):
            value = value.func
        elif isinstance(value, classmethod | staticmethod):
            value = value.__func__
        if inspect.isfunction(value) and value.__module__ == owner.__module__:
            yield name, _hints(value, owner.__module__)


def _hints(thing: Any, module: str) -> dict[str, Any]:
    return typing.get_type_hints(thing, _names(module))


@functools.cache
def _names(module: str) -> dict[str, Any]:
    """Return the names of a module, with those that are imported for type checkers only."""
    loaded = importlib.import_module(module)
    names = dict(vars(loaded))
    for node in ast.parse(inspect.getsource(loaded)).body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            exec(ast.unparse(node.body), names)  # imports
    return names


def _types(hints: dict[str, Any]) -> Iterator[type]:
    ahead: list[Any] = list(hints.values())
    while ahead:
        hint = ahead.pop()
        ahead += hint if isinstance(hint, list) else typing.get_args(hint)
        found = typing.get_origin(hint) or hint
        if inspect.isclass(found):
            yield found
