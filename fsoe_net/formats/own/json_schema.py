"""Finds violations of a JSON Schema: keys, types, words and lengths of lists.

Only violations reported by `fsoe_net.formats.own.schema` are checked. Patterns, ranges and
combinations of keys are for editors; the readers report these in more detail.
"""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from fsoe_net.dataclass import dataclass

LEFT_TO_READERS = frozenset(
    {"pattern", "minimum", "maximum", "exclusiveMinimum", "minLength", "uniqueItems"}
    | {"anyOf", "oneOf", "not", "propertyNames"}
    | {"allOf", "if", "then"}  # on these keywords
)
_TYPES: Mapping[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "boolean": (bool,),
    "null": (type(None),),
    "number": (int, float),
    "integer": (int,),
}
_ABOVE = ("../../../..", "../../..")  # the source tree, the package

Steps = tuple[str | int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SchemaError:
    """A violation of the schema.

    Attributes:
        keyword: Keyword of the schema.
        path: Keys and item numbers that lead to the place.
        schema: The part of the schema for that place.
        value: The value found there.
        key: The key that is missing, for ``required``.
    """

    keyword: str
    path: Steps
    schema: Mapping[str, Any]
    value: object
    key: str = ""


@functools.cache
def read_schema(name: str) -> dict[str, Any]:
    """Return one schema, e.g. ``transfers``, from the installed package or the source tree.

    Raises:
        FileNotFoundError: Unknown schema; the installation is damaged.
    """
    # First a source tree, also for an editable installation.
    paths = (os.path.normpath(f"{__file__}/{up}/schemas/{name}.schema.json") for up in _ABOVE)
    with open(next(filter(os.path.isfile, paths), name), encoding="utf-8") as stream:
        loaded: dict[str, Any] = json.load(stream)
    return loaded


def schema_errors(value: object, name: str) -> Iterator[SchemaError]:
    """Yield the violations in a document of plain values, in its order.

    Args:
        value: The document.
        name: The schema, e.g. ``transfers``.
    """
    return _errors(value, read_schema(name), name, ())


def _errors(
    value: object, schema: Mapping[str, Any], name: str, path: Steps
) -> Iterator[SchemaError]:
    for keyword, wanted in schema.items():
        if keyword == "$ref":
            other, part = referred(wanted, name)
            yield from _errors(value, part, other, path)
        elif isinstance(value, dict):
            yield from _of_object(keyword, value, schema, name, path)
        elif keyword == "items" and isinstance(value, list):
            for number, item in enumerate(value):
                yield from _errors(item, wanted, name, (*path, number))
        if keyword in _CHECKS and not _CHECKS[keyword](value, wanted):
            yield SchemaError(keyword=keyword, path=path, schema=schema, value=value)


def _of_object(
    keyword: str, value: dict[str, Any], schema: Mapping[str, Any], name: str, path: Steps
) -> Iterator[SchemaError]:
    wanted = schema[keyword]
    if keyword == "properties":
        for key, inner in wanted.items():
            if key in value:
                yield from _errors(value[key], inner, name, (*path, key))
    elif keyword == "additionalProperties":
        known = schema.get("properties", {})
        others = [key for key in value if key not in known]
        if isinstance(wanted, dict):
            for key in others:
                yield from _errors(value[key], wanted, name, (*path, key))
        elif others and not wanted:
            yield SchemaError(keyword=keyword, path=path, schema=schema, value=value)
    elif keyword == "required":
        for key in wanted:
            if key not in value:
                yield SchemaError(keyword=keyword, path=path, schema=schema, value=value, key=key)


def referred(reference: str, name: str) -> tuple[str, Mapping[str, Any]]:
    """Return the name and the part of the schema for a reference in the schema ``name``.

    A reference is, for example, ``transfers.schema.json#/$defs/net``.
    """
    file, _, place = reference.partition("#")
    name = file.removesuffix(".schema.json") or name
    part: Mapping[str, Any] = read_schema(name)
    for step in place.strip("/").split("/"):
        part = part[step]
    return name, part


def _has_type(value: object, wanted: str | list[str]) -> bool:
    names = [wanted] if isinstance(wanted, str) else wanted
    # bool is an int in Python, but not an integer of JSON.
    if isinstance(value, bool):
        return "boolean" in names
    # JSON Schema counts 2.0 as an integer.
    if isinstance(value, float) and value.is_integer() and "integer" in names:
        return True
    return any(isinstance(value, _TYPES[name]) for name in names)


def _is_same(value: object, wanted: object) -> bool:
    return value == wanted and isinstance(value, bool) == isinstance(wanted, bool)


_CHECKS: Mapping[str, Callable[[Any, Any], bool]] = {
    "type": _has_type,
    "enum": lambda value, wanted: any(_is_same(value, word) for word in wanted),
    "const": _is_same,
    "minItems": lambda value, wanted: not isinstance(value, list) or len(value) >= wanted,
    "maxItems": lambda value, wanted: not isinstance(value, list) or len(value) <= wanted,
}
