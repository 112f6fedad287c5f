"""Structure of YAML files, checked with the same JSON Schemas an editor uses.

The schemas define the keys, which are required, and the type of their values. Spelling and range of
numbers are checked by `fsoe_net.formats.shared.numbers`, which models how each reader interprets a
spelling; those schema keywords are for editors. Input that a schema allows is rejected by a reader
only because of other keys or files.
"""

from __future__ import annotations

import functools
import itertools
import re
from typing import TYPE_CHECKING, Any

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.diag.guesses import extends, guesses, near_misses, one_of
from fsoe_net.formats.own.json_schema import SchemaError, read_schema, referred, schema_errors
from fsoe_net.formats.shared.numbers import decimal_comma
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, ScalarNode, SeqNode

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from fsoe_net.diag.diagnostic import Span
    from fsoe_net.formats.shared.files import Collector

_OF_DRIVER = frozenset({"slave", "transfers"})  # files that ethercat_driver_ros2 also reads
MOST_UNKNOWN = 100
"""Maximum number of unknown keys of a document that are reported individually, with suggestions."""

_CONFUSED = {
    "sub_index": "subindex",
    "subIndex": "subindex",
    "SubIndex": "subindex",
    "module": "ec_module",
    "rpdos": "rpdo",
    "tpdos": "tpdo",
    "product_code": "product_id",
    "sync_manager": "sm",
    "length": "size",
    "bytes": "size",
    "entries": "channels",
    "conn_id": "connection_id",
    "watchdog": "watchdog_ms",
    "slaves": "subdevices",
    "devices": "subdevices",
    "fsoe_address": "address",
    "default_value": "default",
}
_OF_FORKS = frozenset({"complete_access", "value_hex", "right_shift", "pdo_offset", "start", "end"})
"""Keys of a slave YAML that only forks of ethercat_driver_ros2 read."""


_ASKED_FOR = frozenset(
    {"acceptance", "test-record", "scenario", "device"}
)  # an option names the expected type
_NAMED = {  # by their keys; the description and the consumer
    "test-record": ("a test record", "`fsoe-net report NETWORK --test-record FILE` takes it"),
    "acceptance": (
        "an acceptance record",
        "`fsoe-net acceptance verify NETWORK --accepted FILE` takes it",
    ),
    "device": ("a device file", "`fsoe-net init --list NAME --device-file FILE` takes it"),
    "network": ("a network", "`fsoe-net check FILE` takes it"),
    "slave": ("a slave YAML", "a network names it: `config: FILE`"),
    "answers": ("a file of answers", "`fsoe-net init --answers FILE` takes it"),
    "scenario": ("a scenario", "`fsoe-net run NETWORK --scenario FILE` takes it"),
}
_TELLTALES = (
    ("test-record", {"plan_sha256"}),
    ("acceptance", {"acceptance_record"}),
    ("device", {"identities", "mappings"}),
    ("network", {"subdevices", "buses"}),
    ("slave", {"vendor_id", "rpdo", "tpdo"}),
    ("scenario", {"duration_s", "expect", "steps"}),
)


def kind_by_keys(root: MapNode) -> str | None:
    """Return the schema of a file of this project, if its keys occur in no other one."""
    keys = set(root.pairs)
    rows = root.maps("subdevices")
    if any("type" in row.pairs for row in rows) and not any("config" in row.pairs for row in rows):
        return "answers"
    return next((name for name, telling in _TELLTALES if telling & keys), None)


def refuse_kind(root: MapNode, kind: str, wanted: str, code: str, out: Collector) -> None:
    """Report the type of this file and where it can be used."""
    what, hint = _NAMED[kind]
    hint = hint.replace("FILE", root.span.file)
    out.add(code, root.span, f"this is {what}, not {_NAMED[wanted][0]}", hint=hint)


def schema_keys(name: str) -> frozenset[str]:
    """Return the top-level keys that a schema allows."""
    return frozenset(read_schema(name)["properties"])


def check_structure(root: MapNode, name: str, out: Collector) -> bool:
    """Add a finding for each unknown, missing or wrongly typed key of a document.

    With very many unknown keys only the first are reported, each compared with the known keys; then
    the file is rejected, because further guesses cost time without benefit.

    Args:
        root: The document.
        name: Schema, e.g. ``transfers``.
        out: Takes FSN109, FSN110, FSN111, FSN116 and FSN451; only FSN140 where the keys are those
            of another file of this project.

    Returns:
        Whether reading can continue.
    """
    other = kind_by_keys(root) if name in _ASKED_FOR else None
    if other is not None and other != name:
        refuse_kind(root, other, name, "FSN140", out)
        return False
    sample = _Forms(_worded_keys(name)).sample(root)
    if next(schema_errors(sample, name), None) is None:
        return True  # the usual case: thousands of transfers of one form, checked once
    of_driver = name in _OF_DRIVER
    unknown = _Unknown(out, of_driver=of_driver)
    for error in schema_errors(_plain(root), name):
        _translate(error, root, out, unknown, of_driver=of_driver)
        if unknown.too_many:
            break
    return not unknown.too_many


@functools.cache
def _worded_keys(name: str) -> frozenset[str]:
    """Return the keys whose values, or parts of them, the schema compares with words."""
    found: set[str] = set()
    pending: list[tuple[str, str, Mapping[str, Any]]] = [("", name, read_schema(name))]
    followed: set[tuple[str, str, str]] = set()
    while pending:
        key, name, part = pending.pop()
        if "enum" in part or "const" in part:
            found.add(key)
        pending += [(k, name, inner) for k, inner in part.get("properties", {}).items()]
        inner = [part[word] for word in ("items", "additionalProperties") if word in part]
        pending += [(key, name, one) for one in inner if isinstance(one, dict)]
        if "$ref" in part and (key, name, part["$ref"]) not in followed:
            followed.add((key, name, part["$ref"]))
            pending.append((key, *referred(part["$ref"], name)))
    return frozenset(found)


class _Forms:
    """Numbers the forms of values; values of one form have the same keys and types throughout."""

    def __init__(self, worded: frozenset[str]) -> None:
        self._worded = worded
        self._numbers: dict[object, int] = {}
        self._samples: list[Any] = []  # a plain value of each form
        self._scalars: tuple[dict[str, int], dict[str, int]] = ({}, {})  # not plain, plain

    def sample(self, root: Node) -> Any:
        """Return the document as plain values; its lists contain one map or list of each form."""
        return self._samples[self._of(root)]

    def _of(self, node: Node, key: str = "") -> int:
        if isinstance(node, ScalarNode):
            known = None if key in self._worded else self._scalars[node.plain].get(node.text)
            return self._of_scalar(node, key) if known is None else known
        if isinstance(node, MapNode):
            pairs = node.pairs
            above = key if key in self._worded else ""
            parts = [self._of(value, above or name) for name, value in pairs.items()]
            form: object = (*pairs, *parts)
        else:
            pairs = None
            parts = [self._of(item, key) for item in node.items]
            # The number of scalars in a list may be limited.
            if not all(isinstance(item, ScalarNode) for item in node.items):
                parts = sorted(set(parts))
            form = (None, *parts)
        number = self._numbers.get(form)
        if number is None:
            values = [self._samples[part] for part in parts]
            sample = values if pairs is None else dict(zip(pairs, values, strict=True))
            number = self._new(form, sample)
        return number

    def _of_scalar(self, node: ScalarNode, key: str) -> int:
        value = _plain(node)
        if key in self._worded:
            # 1 equals True in Python, so the type is part of the form.
            form = (type(value), value)
            return self._numbers[form] if form in self._numbers else self._new(form, value)
        # JSON Schema counts 2.0 as an integer.
        form = (type(value), isinstance(value, float) and value.is_integer())
        number = self._numbers[form] if form in self._numbers else self._new(form, value)
        self._scalars[node.plain][node.text] = number
        return number

    def _new(self, form: object, sample: Any) -> int:
        self._samples.append(sample)
        self._numbers[form] = len(self._numbers)
        return self._numbers[form]


def _plain(node: Node) -> Any:
    """Return dicts, lists and values as a YAML 1.2 reader would."""
    if isinstance(node, MapNode):
        return {key: _plain(value) for key, value in node.pairs.items()}
    if isinstance(node, SeqNode):
        return [_plain(item) for item in node.items]
    if node.is_null:
        return None
    if not node.plain:
        return node.text
    return _plain_scalar(node.text)


_BOOLEANS = {"true": True, "false": False, "yes": True, "no": False, "on": True, "off": False}


def _plain_scalar(text: str) -> object:
    first = text[0]
    if first.isdigit() or first in "+-.":
        if re.fullmatch(r"[+-]?[0-9]+|0[xX][0-9a-fA-F]+", text):
            try:
                return int(text, 16 if text[1:2] in ("x", "X") else 10)
            except ValueError:  # more digits than Python converts
                return text
        if re.fullmatch(
            r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?\.(inf|nan)", text
        ):
            return float(text.replace(".inf", "inf").replace(".nan", "nan"))
    return _BOOLEANS.get(text.lower(), text)


def _node_at(root: Node, path: Iterable[str | int]) -> Node:
    node = root
    for step in path:
        if isinstance(node, MapNode) and isinstance(step, str):
            node = node.pairs[step]
        elif isinstance(node, SeqNode) and isinstance(step, int):
            node = node.items[step]
    return node


def _where(path: Sequence[str | int]) -> str:
    text = ""
    for step in path:
        text += f" {step + 1}" if isinstance(step, int) else f", {step}"
    return text.removeprefix(", ") or "the document"


def _translate(
    error: SchemaError, root: MapNode, out: Collector, unknown: _Unknown, *, of_driver: bool
) -> None:
    node = _node_at(root, error.path)
    if error.keyword == "additionalProperties" and isinstance(node, MapNode):
        unknown.keys_of(node, error.schema.get("properties", {}), error.path)
    elif error.keyword == "required" and isinstance(node, MapNode):
        _missing_key(node, error, out)
    elif error.keyword in ("enum", "const"):
        _not_allowed(node, error, out)
    elif error.keyword == "type":
        _wrong_type(node, error, out, of_driver=of_driver)
    else:
        length = "short" if error.keyword == "minItems" else "long"
        message = f"{_where(error.path)}: {error.value!r} is too {length}"
        out.add("FSN111", node.span, message, hint="see the schema")


def nearest_keys(key: str, allowed: Iterable[str]) -> tuple[str, ...]:
    """Return the keys that may be meant."""
    known = list(allowed)
    confused = {v: k for k, v in _CONFUSED.items()} | _CONFUSED
    if confused.get(key) in known:
        return (confused[key],)
    return near_misses(re.sub(r"[^a-zA-Z0-9_-]", "", key), known, cutoff=0.72)


class _Unknown:
    """The unknown keys of a document, up to the maximum."""

    def __init__(self, out: Collector, *, of_driver: bool) -> None:
        self._out = out
        self._of_driver = of_driver
        self._count = 0
        self.too_many = False

    def keys_of(
        self, node: MapNode, properties: Mapping[str, Any], path: Sequence[str | int]
    ) -> None:
        """Report the unknown keys of one map."""
        free = [k for k in properties if k not in node.pairs]
        for key in node.pairs:
            if key in properties:
                continue
            self._count += 1
            if self._count > MOST_UNKNOWN:
                self._refuse(node.keys[key])
                return
            comma = _comma_before(node, key, properties)
            meant = nearest_keys(key, free)
            where = f"in {_where(path)}" if path else "at the top level"
            self._out.add(
                "FSN109",
                node.keys[key],
                f"unknown key {key!r} {where}",
                severity=_severity(key, properties, is_misspelt=bool(meant or comma)),
                hint=comma or _instead(key, meant) or self._without_guess(key, properties),
            )

    def _without_guess(self, key: str, properties: Mapping[str, Any]) -> str:
        if self._of_driver and key in _OF_FORKS:
            return "only forks of ethercat_driver_ros2 read it; delete it, or run such a fork"
        return f"known here: {', '.join(sorted(properties))}"

    def _refuse(self, span: Span) -> None:
        self.too_many = True
        self._out.add(
            "FSN109",
            span,
            f"more than {MOST_UNKNOWN} unknown keys; the file is not read on",
            hint="give the file that was meant, or take out what does not belong there",
        )


def _severity(key: str, known: Iterable[str], *, is_misspelt: bool) -> Severity | None:
    if is_misspelt:
        return None
    # A program may have such a key; a word that resembles none is a remark of the user.
    is_of_another = key in _OF_FORKS or any(extends(key, k) for k in known)
    return Severity.WARNING if is_of_another else Severity.INFO


def _comma_before(node: MapNode, key: str, properties: Mapping[str, Any]) -> str:
    """Return the hint if ``factor: 1,5`` in braces became ``factor: 1`` and a key ``5``."""
    value = node.pairs[key]
    is_digits = re.fullmatch(r"[0-9]+([eE][+-]?[0-9]+)?", key)
    if not (is_digits and isinstance(value, ScalarNode) and value.is_null):
        return ""
    keys = list(node.pairs)
    before = keys[keys.index(key) - 1] if keys[0] != key else ""
    number = node.text(before) or ""
    if not re.fullmatch(r"[+-]?[0-9]+", number):
        return ""
    if properties.get(before, {}).get("type") == "integer":
        return f"the comma ends {before}: write a whole number"
    return f"the comma ends {before}: {decimal_comma(f'{number},{key}')}"


def _instead(key: str, meant: Sequence[str]) -> str:
    """Return the hint if an unknown key is meant for another one, otherwise an empty string."""
    if key.startswith("-") and meant:
        return f"write {meant[0]!r}; where a list item begins, `- ` with a blank before it"
    return f"write {one_of([repr(m) for m in meant])}" if meant else ""


def _missing_key(node: MapNode, error: SchemaError, out: Collector) -> None:
    properties = error.schema.get("properties", {})
    free = [m for m in properties if m not in node.pairs]
    others = (k for k in node.pairs if k not in properties)
    if any(error.key in nearest_keys(k, free) for k in itertools.islice(others, MOST_UNKNOWN)):
        return  # it is present, but misspelt
    message = f"{_where(error.path)} has no {error.key!r}"
    hint = f"add {error.key}{_what_to_write(properties.get(error.key, {}))}"
    if "channels" in error.path:
        message += "; the driver continues with a random value"
        out.add("FSN404", node.span, message, hint=hint)
    else:
        out.add("FSN110", node.span, message, hint=hint)


def _what_to_write(schema: dict[str, Any]) -> str:
    """Return the only valid value after a colon, or else the meaning of the value in brackets."""
    if "const" in schema:
        return f": {schema['const']}"
    meaning = str(schema.get("description", "")).partition(". ")[0].rstrip(".")
    word = meaning.partition(" ")[0]
    # An abbreviation keeps its capitals.
    start = word.lower() if word[1:].islower() or word == "A" else word
    return f" ({start}{meaning[len(word) :]})" if meaning else ""


def _not_allowed(node: Node, error: SchemaError, out: Collector) -> None:
    allowed = error.schema["enum"] if error.keyword == "enum" else [error.schema["const"]]
    words = [str(w) for w in allowed if w not in (None, "")]
    text = node.text if isinstance(node, ScalarNode) else "a list or map"
    close = guesses(text, words)
    out.add(
        "FSN116",
        node.span,
        f"{_where(error.path)} is {text!r}; allowed: {', '.join(words)}",
        hint=f"write {one_of(close)}" if close else f"write one of: {', '.join(words)}",
    )


def _is_read_later(schema: Mapping[str, Any], node: ScalarNode) -> bool:
    """Whether a reader reports a scalar of the wrong type in more detail: numbers, patterns."""
    if "pattern" in schema:
        return True
    is_word = node.plain and isinstance(_plain_scalar(node.text), str)
    has_limit = "minimum" in schema or "exclusiveMinimum" in schema
    return is_word and schema["type"] in ("integer", "number") and has_limit


def _spells(text: str, names: Sequence[str]) -> bool:
    """Whether a text would be a number of one of these types if it had no quotes."""
    value = _plain_scalar(text) if text else ""
    return ("number" in names and isinstance(value, float)) or (
        not {"integer", "number"}.isdisjoint(names) and type(value) is int
    )


_KINDS = {"object": "a map", "array": "a list", "string": "a text", "null": "nothing"}


def _expected(names: Sequence[str]) -> str:
    """Return the types that a schema expects, in words."""
    if names == ["boolean", "string"]:
        return "true or false"
    if "boolean" in names and "string" in names:
        return "a text"
    if "number" in names:
        return "a number"
    if "integer" in names:
        return "a whole number"
    return " or ".join(_KINDS.get(n, f"a {n}") for n in names if n != "null")


def _reads_nothing(node: Node, names: Sequence[str]) -> bool:
    """Whether yaml-cpp reads a value of the wrong type without an exception.

    It reads a scalar in place of a list as no rows, and null in place of a text as ``null``.
    """
    if not isinstance(node, ScalarNode):
        return False
    return names[0] == "array" or (names[0] == "string" and node.is_null)


def _type_hint(node: Node, names: Sequence[str]) -> str:
    """Return how to correct a frequent mistake, otherwise an empty string."""
    if isinstance(node, ScalarNode) and not node.plain and _spells(node.text, names):
        return f"write {node.text}, without quotes"
    if names[0] == "array":
        return "start each item with `- `"
    is_item = names[0] == "object" and isinstance(node, SeqNode)
    return "delete the `- ` in front of the keys" if is_item else ""


def _wrong_type(node: Node, error: SchemaError, out: Collector, *, of_driver: bool) -> None:
    wanted = error.schema["type"]
    names = [wanted] if isinstance(wanted, str) else list(wanted)
    if isinstance(node, ScalarNode) and not node.is_null and _is_read_later(error.schema, node):
        return
    expected = _expected(names)
    if isinstance(node, ScalarNode):
        found = "empty" if node.is_null else f"{node.text[:60]!r}"
    else:
        found = "a list" if isinstance(node, SeqNode) else "a map"
    hint = _type_hint(node, names) or f"write {expected}"
    # The number readers do not report this value again.
    out.mistyped.add(node.span)
    code = "FSN451" if of_driver and _reads_nothing(node, names) else "FSN111"
    out.add(code, node.span, f"{_where(error.path)} must be {expected}, it is {found}", hint=hint)
