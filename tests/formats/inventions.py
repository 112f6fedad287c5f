"""Documents that a JSON Schema allows, invented by Hypothesis: the part that our schemas use."""

from __future__ import annotations

import json
import math
from typing import Any

from hypothesis import strategies as st

from fsoe_net.diag.printable import first_control
from fsoe_net.formats.own.json_schema import read_schema

_TEXTS = st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), max_size=6)


def documents(name: str) -> st.SearchStrategy[Any]:
    """Return documents of a schema such as ``network``; lists are short."""
    root = read_schema(name)
    return _of(root, root)


def _of(schema: dict[str, Any], root: dict[str, Any]) -> st.SearchStrategy[Any]:
    if "$ref" in schema:
        file, _, path = schema["$ref"].partition("#")
        root = read_schema(file.partition(".")[0]) if file else root
        found: Any = root
        for part in path.strip("/").split("/"):
            found = found[part]
        return st.deferred(lambda: _of(found, root))
    if "const" in schema:
        return st.just(schema["const"])
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    for some in ("anyOf", "oneOf"):
        if some in schema:
            return st.one_of([_of(_joined(schema, part, some), root) for part in schema[some]])
    kinds = schema.get("type", "null")
    kinds = [kinds] if isinstance(kinds, str) else kinds
    return st.one_of([_of_kind(kind, schema, root) for kind in kinds])


def _joined(schema: dict[str, Any], part: dict[str, Any], some: str) -> dict[str, Any]:
    """Return an object that is also as one of its alternatives says."""
    properties = dict(schema.get("properties", {}))
    for key, more in part.get("properties", {}).items():
        properties[key] = {**properties[key], **more}
    needed = [*schema.get("required", ()), *part.get("required", ())]
    rest = {k: v for k, v in schema.items() if k != some}
    return {**rest, "properties": properties, "required": needed}


def _of_kind(kind: str, schema: dict[str, Any], root: dict[str, Any]) -> st.SearchStrategy[Any]:
    if kind == "object":
        return _objects(schema, root)
    if kind == "array":
        least = schema.get("minItems", 0)
        return st.lists(
            _of(schema.get("items", {}), root),
            min_size=least,
            max_size=min(schema.get("maxItems", 3), max(least, 3)),
            unique_by=json.dumps if schema.get("uniqueItems") else None,
        )
    if kind == "string":
        if "pattern" in schema:
            matching = st.from_regex(schema["pattern"], fullmatch=True)
            return matching.filter(lambda text: not first_control(text))  # refused in any file
        return _TEXTS.filter(lambda t: len(t) >= schema.get("minLength", 0))
    low, high = schema.get("minimum"), schema.get("maximum")
    if kind == "integer":
        return st.integers(low, high)
    if kind == "number":
        over = schema.get("exclusiveMinimum")
        floats = st.floats(
            low if over is None else over,
            high,
            exclude_min=over is not None,
            allow_nan=False,
            allow_infinity=False,
        )
        return st.one_of(floats, st.integers(_up(low, over), high))
    return st.booleans() if kind == "boolean" else st.none()


def _up(low: float | None, over: float | None) -> int | None:
    return (
        None
        if low is None and over is None
        else math.ceil(over + 1 if over is not None else low or 0)
    )


def _objects(schema: dict[str, Any], root: dict[str, Any]) -> st.SearchStrategy[Any]:
    parts = {key: _of(part, root) for key, part in schema.get("properties", {}).items()}
    needed = set(schema.get("required", ()))
    more = schema.get("additionalProperties", False)
    if not parts and isinstance(more, dict):
        names = st.from_regex(schema["propertyNames"]["pattern"], fullmatch=True)
        return st.dictionaries(names, _of(more, root), max_size=3)
    fixed = st.fixed_dictionaries(
        {k: v for k, v in parts.items() if k in needed},
        optional={k: v for k, v in parts.items() if k not in needed},
    )
    rules = {k: v for k, v in schema.items() if k in ("allOf", "if", "then")}
    return fixed.filter(lambda made: _holds(made, rules)) if rules else fixed


def _holds(made: dict[str, Any], rule: dict[str, Any]) -> bool:
    from jsonschema import Draft202012Validator

    return bool(Draft202012Validator(rule).is_valid(made))
