"""Acceptance records as YAML, for people to read and for version control."""

from __future__ import annotations

import base64
import textwrap
import zlib
from typing import Any

import yaml

from fsoe_net.model.acceptance import Acceptance, SignedBy
from fsoe_net.model.network import SourceFile
from fsoe_net.model.safety import SafetyElement, SafetyFunction

_HEAD = """\
# Acceptance record of the copies of an FSoE network, written by fsoe-net. Keep it under
# version control, and sign what is signed: the report. It states which configuration was accepted,
# by whom and on what grounds. It is not a certificate and does not protect against a person with
# bad intent. `fsoe-net acceptance verify --accepted FILE` compares with it; do not edit it by hand.
"""


def write_acceptance(record: Acceptance) -> str:
    """Return the text of a record; the same record gives the same text."""
    document: dict[str, Any] = {
        "acceptance_record": 2,
        "project": record.project,
        "network": record.network,
        "made_with": record.made_with,
        "fingerprint": record.whole,
        "sections": dict(record.sections),
        "author": _person(record.author),
        "verifier": _person(record.verifier),
        "inputs": [_file(f) for f in record.inputs],
        "reports": [_file(f) for f in record.reports],
        "open_points": record.open_points,
        "assumptions": record.assumptions,
        "test_record": {**_file(record.test_record), "steps": record.steps},
        "justified_findings": [
            values_of(row, "code", "place", "message", "reason", "by") for row in record.findings
        ],
        "steps_left_out": [values_of(row, "step", "reason", "by") for row in record.steps_left_out],
        "interventions": [values_of(row, "what", "by", "date") for row in record.interventions],
    }
    if record.equipment:
        document["equipment"] = list(record.equipment)
    if record.environment:
        document["environment"] = record.environment
    if record.attachments:
        document["attachments"] = [_file(f) for f in record.attachments]
    if record.replaces is not None:
        document["replaces"] = {
            **_file(record.replaces.source),
            "fingerprint": record.replaces.whole,
        }
    if record.safety_functions:
        document["safety_functions"] = [_function(f) for f in record.safety_functions]
    body = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=100)
    # The plan is in the record, so that later changes are shown without the old files.
    packed = base64.b64encode(zlib.compress(record.plan, 9)).decode("ascii")
    lines = textwrap.indent("\n".join(textwrap.wrap(packed, 96)), "  ")
    return f"{_HEAD}{body}plan: |\n{lines}\n"


def _file(source: SourceFile) -> dict[str, Any]:
    return {"file": source.path, "sha256": source.sha256}


def values_of(row: object, *keys: str) -> dict[str, Any]:
    """Return the attributes by name."""
    return {key: getattr(row, key) for key in keys}


def _stated(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None and value != ""}


def _person(person: SignedBy) -> dict[str, Any]:
    return values_of(person, "name", "date") | _stated(values_of(person, "competence"))


def _function(f: SafetyFunction) -> dict[str, Any]:
    texts = values_of(f, "name", "trigger", "reaction", "reset", "modes", "required_reaction_ms")
    elements = [_element(e) for e in f.elements]
    return _stated(texts | {"required": _level(f), "elements": elements})


def _level(row: SafetyFunction | SafetyElement) -> dict[str, Any] | None:
    return _stated(values_of(row, "pl", "sil")) or None


def _element(e: SafetyElement) -> dict[str, Any]:
    return _stated(
        {
            "kind": e.kind.value,
            **values_of(e, "sub", "name", "time_ms", "pfh_per_hour", "zero_because"),
            "claim": _level(e),
            **values_of(e, "category", "mission_years", "source", "manual"),
            "bits": [_stated(values_of(b, "slot", "bit", "name")) for b in e.bits] or None,
        }
    )
