"""Acceptance records as YAML, for people to read and for version control."""

from __future__ import annotations

import base64
import textwrap
import zlib
from typing import Any

import yaml

from fsoe_net.model.acceptance import Acceptance, SignedBy
from fsoe_net.model.network import SourceFile
from fsoe_net.model.safety import SafeBit, SafetyElement, SafetyFunction

_HEAD = """\
# Acceptance record of the copies of an FSoE network, written by fsoe-net. Keep it under
# version control, and sign what is signed: the report. It says which configuration was accepted,
# by whom and on what grounds. It is no certificate and no protection against somebody who means
# harm. `fsoe-net acceptance verify --accepted FILE` compares with it; do not edit it by hand.
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
            {"code": f.code, "place": f.place, "message": f.message, "reason": f.reason, "by": f.by}
            for f in record.findings
        ],
        "steps_left_out": [
            {"step": s.step, "reason": s.reason, "by": s.by} for s in record.steps_left_out
        ],
        "interventions": [
            {"what": i.what, "by": i.by, "date": i.date} for i in record.interventions
        ],
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
    packed = base64.b64encode(zlib.compress(record.plan, 9)).decode("ascii")
    lines = textwrap.indent("\n".join(textwrap.wrap(packed, 96)), "  ")
    return f"{_HEAD}{body}plan: |\n{lines}\n"


def _file(source: SourceFile) -> dict[str, Any]:
    return {"file": source.path, "sha256": source.sha256}


def _person(person: SignedBy) -> dict[str, Any]:
    row = {"name": person.name, "date": person.date}
    return row | ({"competence": person.competence} if person.competence else {})


def _function(f: SafetyFunction) -> dict[str, Any]:
    return _stated(
        {
            "name": f.name,
            "trigger": f.trigger or None,
            "reaction": f.reaction or None,
            "reset": f.reset or None,
            "modes": f.modes or None,
            "required_reaction_ms": f.required_reaction_ms,
            "required": _level(f.pl, f.sil),
            "elements": [_element(e) for e in f.elements],
        }
    )


def _level(pl: str, sil: int | None) -> dict[str, Any] | None:
    return _stated({"pl": pl or None, "sil": sil}) or None


def _element(e: SafetyElement) -> dict[str, Any]:
    return _stated(
        {
            "kind": e.kind.value,
            "sub": e.sub or None,
            "name": e.name,
            "time_ms": e.time_ms,
            "pfh_per_hour": e.pfh_per_hour,
            "zero_because": e.zero_because or None,
            "claim": _level(e.pl, e.sil),
            "category": e.category or None,
            "mission_years": e.mission_years,
            "source": e.source or None,
            "manual": e.manual or None,
            "bits": [_bit(b) for b in e.bits] or None,
        }
    )


def _bit(b: SafeBit) -> dict[str, Any]:
    return _stated({"slot": b.slot, "bit": b.bit, "name": b.name})


def _stated(pairs: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in pairs.items() if value is not None}
