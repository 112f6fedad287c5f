"""Acceptance records, written by ``fsoe-net acceptance record``."""

from __future__ import annotations

import base64
import binascii
import os
import re
import zlib
from datetime import date
from typing import TypeVar, cast

from fsoe_net.formats.own.safety_functions import safety_functions_from_yaml
from fsoe_net.formats.own.schema import check_structure
from fsoe_net.formats.recognise import refuse_other
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.limits import MAX_PLAN_BYTES, MAX_RECORD_BYTES
from fsoe_net.formats.shared.numbers import own_int, record_of
from fsoe_net.formats.shared.yaml_tree import MapNode, parse_yaml
from fsoe_net.model.acceptance import (
    Acceptance,
    Intervention,
    JustifiedFinding,
    JustifiedStep,
    Replaced,
    SignedBy,
)
from fsoe_net.model.network import SourceFile
from fsoe_net.model.written import same_person, says_something

_FIRST_KEY = re.compile(rb"^acceptance_record\s*:", re.MULTILINE)
_WITH_FORM_1 = "1"
_LOOKED_AT = 4096
_HASH = re.compile(r"[0-9a-f]{64}")
_MANY = 2**31 - 1
_Row = TypeVar("_Row", JustifiedFinding, JustifiedStep)


def is_acceptance(data: bytes) -> bool:
    """Whether a file appears to be an acceptance record."""
    return _FIRST_KEY.search(data[:_LOOKED_AT]) is not None


def load_acceptance(path: str | os.PathLike[str], out: Collector) -> Acceptance | None:
    """Read an acceptance record.

    Args:
        path: The file.
        out: Takes FSN101 … FSN116, FSN140, FSN162 and FSN163 with line and column.

    Returns:
        The record, or ``None`` if it is invalid. Whether its fingerprint is that of its plan is
        checked by `fsoe_net.plan.accepted.accepted_plan`, not here.
    """
    data = read_bytes(path, out, most=MAX_RECORD_BYTES)
    return None if data is None else parse_acceptance(data, os.fspath(path), out)


def parse_acceptance(data: bytes, file: str, out: Collector) -> Acceptance | None:
    """Read an acceptance record from the bytes of a file; see `load_acceptance`."""
    before = len(out.diagnostics)  # a key that is given twice counts
    root = None if refuse_other(data, "acceptance", file, out) else parse_yaml(data, file, out)
    if root is None:
        return None
    if root.text("acceptance_record") == _WITH_FORM_1:
        out.add(
            "FSN162",
            root.at("acceptance_record"),
            "a record of fingerprint form 1, which left out application parameters, names of "
            "values and what the driver acts on",
            hint="compare the report with the one that was signed, and accept again",
        )
        return None
    check_structure(root, "acceptance", out)
    # Any finding stops the reader, even a remark: a signed record must be read completely.
    if len(out.diagnostics) > before:
        return None
    record = _record(root, out)
    if same_person(record.author.name, record.verifier.name):
        out.add(
            "FSN163",
            root.at("verifier"),
            f"author and verifier are one person: {record.verifier.name}",
            hint="a person other than the author must verify; make the record again",
        )
    return None if len(out.diagnostics) > before else record


def _record(root: MapNode, out: Collector) -> Acceptance:
    replaced = root.get("replaces")
    sections = _map(root, "sections")
    test_record = _map(root, "test_record")
    return record_of(
        Acceptance,
        root,
        out,
        {"open_points": _MANY, "assumptions": _MANY},
        whole=_hash(root, "fingerprint", out),
        sections={name: _hash(sections, name, out) for name in sections.pairs},
        plan=_plan(root, out),
        safety_functions=safety_functions_from_yaml(root, out),
        inputs=tuple(_file(n, out) for n in root.maps("inputs")),
        reports=tuple(_file(n, out) for n in root.maps("reports")),
        test_record=_file(test_record, out),
        steps=own_int(test_record, "steps", _MANY, out) or 0,
        author=_person(_map(root, "author"), out),
        verifier=_person(_map(root, "verifier"), out),
        findings=_justified(JustifiedFinding, root, "justified_findings", out),
        steps_left_out=_justified(JustifiedStep, root, "steps_left_out", out),
        equipment=root.texts("equipment") or (),
        attachments=tuple(_file(n, out) for n in root.maps("attachments")),
        interventions=tuple(_intervention(n, out) for n in root.maps("interventions")),
        replaces=_replaced(replaced, out) if isinstance(replaced, MapNode) else None,
    )


def _text(node: MapNode, key: str) -> str:
    return node.text(key) or ""


def _stated(node: MapNode, key: str, out: Collector) -> str:
    text = _text(node, key).strip()
    if not says_something(text):
        out.add("FSN162", node.at(key), f"{key} is empty", hint="make the record again")
    return text


def _map(node: MapNode, key: str) -> MapNode:
    return cast(MapNode, node.pairs[key])  # ensured by the schema


def _hash(node: MapNode, key: str, out: Collector) -> str:
    text = _text(node, key).lower()
    if not _HASH.fullmatch(text):
        out.add(
            "FSN162",
            node.at(key),
            f"{key} is not a SHA-256 of 64 hexadecimal digits",
            hint="take the record from version control, or make it again",
        )
    return text


def _file(node: MapNode, out: Collector) -> SourceFile:
    path = _text(node, "file")
    if not path or "\0" in path:
        out.add("FSN162", node.at("file"), "file is not a path", hint="make the record again")
    return SourceFile(path=path, sha256=_hash(node, "sha256", out))


def _date(node: MapNode, out: Collector) -> str:
    text = _text(node, "date")
    try:
        date.fromisoformat(text)
    except ValueError:
        out.add("FSN162", node.at("date"), f"{text!r} is not a date", hint="write YYYY-MM-DD")
    return text


def _person(node: MapNode, out: Collector) -> SignedBy:
    return record_of(SignedBy, node, out, name=_stated(node, "name", out), date=_date(node, out))


def _justified(kind: type[_Row], root: MapNode, key: str, out: Collector) -> tuple[_Row, ...]:
    return tuple(
        record_of(kind, node, out, reason=_stated(node, "reason", out), by=_stated(node, "by", out))
        for node in root.maps(key)
    )


def _intervention(node: MapNode, out: Collector) -> Intervention:
    what, by = _stated(node, "what", out), _stated(node, "by", out)
    return record_of(Intervention, node, out, what=what, by=by, date=_date(node, out))


def _replaced(node: MapNode, out: Collector) -> Replaced:
    whole = _hash(node, "fingerprint", out)
    return record_of(Replaced, node, out, source=_file(node, out), whole=whole)


def _plan(root: MapNode, out: Collector) -> bytes:
    """Return the plan that the record contains (zlib, base64)."""
    unpack = zlib.decompressobj()
    try:
        packed = base64.b64decode("".join(_text(root, "plan").split()), validate=True)
        data = unpack.decompress(packed, MAX_PLAN_BYTES)
        if unpack.eof and not unpack.unused_data:
            return data
        trouble = "is cut short" if not unpack.unconsumed_tail else "unpacks to more than 64 MiB"
    except (binascii.Error, ValueError, zlib.error) as exc:
        trouble = f"cannot be unpacked: {exc}"
    out.add(
        "FSN162",
        root.at("plan"),
        f"the plan in this record {trouble}",
        hint="take the record from version control, or make it again",
    )
    return b""
