"""The head of an incident file, from JSON to plain values."""

from __future__ import annotations

import base64
import binascii
import hashlib

from fsoe_net.core.bus_documents import (
    read_connections,
    read_layout,
    read_statistics,
    read_subdevice,
)
from fsoe_net.core.json_object import JsonObject
from fsoe_net.errors import PlanFormatError
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.incident.incident import (
    BusFault,
    FsoeFacts,
    FsoeSetting,
    IncidentEvent,
    IncidentHead,
    Trigger,
    TriggerKind,
)
from fsoe_net.plan.codec import decode_plan
from fsoe_net.plan.model import Plan

_VERSION = 1


def head_of(values: JsonObject) -> IncidentHead:
    """Return the head.

    Raises:
        IncidentError: A key is missing or has an invalid value.
    """
    version = values.whole("incident", missing=0)
    # This can be any JSON object: the version key identifies an incident file.
    if version == 0:
        raise values.bad("incident", "is missing: this is not an incident file")
    if version > _VERSION:
        raise values.bad("incident", f"is {version}; this fsoe-net reads version {_VERSION}")
    remarks: list[str] = []
    plan = _plan(values, remarks)
    return IncidentHead(
        utc=values.label("utc"),
        version=values.label("version"),
        interface=values.label("interface"),
        backend=values.label("backend"),
        plan_file=values.label("plan_file"),
        plan_sha256=values.label("plan_sha256"),
        plan=plan,
        cycle_ns=values.whole("cycle_ns", missing=0),
        trigger=_trigger(values.child("trigger")),
        counters=read_statistics(values.child("statistics")) if values.has("statistics") else None,
        connections=read_connections(values),
        subdevices=tuple(read_subdevice(row) for row in values.children("subdevices")),
        events=tuple(_event(row) for row in values.children("events")),
        layout=read_layout(values.child("layout")),
        fsoe=tuple(_facts(row) for row in values.children("fsoe")),
        remarks=tuple(remarks),
        ring_place=values.child("ring").label("place"),
    )


def _plan(values: JsonObject, remarks: list[str]) -> Plan | None:
    """Return the plan; if it is damaged, names and facts are missing, but the file is readable."""
    text = values.text("plan")
    if not text:
        remarks.append("the file holds no plan: addresses and watchdogs are not known")
        return None
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        remarks.append("the plan in the file is damaged (no base64): its facts are not used")
        return None
    # A plan that does not belong to the recording would give wrong names to its bytes.
    stated = values.label("plan_sha256")
    if stated and hashlib.sha256(data).hexdigest() != stated:
        remarks.append("the plan in the file does not fit its SHA-256: its facts are not used")
        return None
    try:
        return decode_plan(data)
    except PlanFormatError as exc:
        remarks.append(f"the plan in the file is damaged ({exc}): its facts are not used")
        return None


def _trigger(row: JsonObject) -> Trigger:
    kind = row.text("kind")
    if kind not in {k.value for k in TriggerKind}:
        raise row.bad("kind", f"is not one of {', '.join(k.value for k in TriggerKind)}")
    code = row.optional("reset_code")
    by = row.label("reset_by")
    if code is not None and code > 0xFF:
        raise row.bad("reset_code", "is not a byte")
    return Trigger(
        kind=TriggerKind(kind),
        connection=row.label("connection"),
        subdevice=row.label("subdevice"),
        before=_state(row.label("before")),
        after=_state(row.label("after")),
        # A code without the end that sent it cannot be assigned.
        reset_by=by if by in ("main", "sub") else "",
        reset_code=code if by in ("main", "sub") else None,
        cycle=row.whole("cycle", missing=0),
        now_ns=row.whole("now_ns", missing=0),
        text=row.label("text"),
        fault=_fault(row.child("fault")) if row.has("fault") else None,
    )


def _fault(row: JsonObject) -> BusFault:
    return BusFault(
        status=row.label("status"),
        subdevice=row.label("subdevice"),
        link_down=row.flag("link_down"),
    )


def _state(word: str) -> ConnectionState | None:
    return ConnectionState.from_event(word) if word else None


def _event(row: JsonObject) -> IncidentEvent:
    return IncidentEvent(
        event=row.label("event"),
        now_ns=row.whole("now_ns", missing=0),
        level=row.label("level"),
        text=row.label("text"),
        keys=row.plain(),
    )


def _facts(row: JsonObject) -> FsoeFacts:
    return FsoeFacts(
        subdevice=row.label("subdevice"),
        address=row.optional("address"),
        connections=tuple(
            FsoeSetting(
                address=c.optional("address"),
                connection_id=c.optional("connection_id"),
                watchdog_ms=c.optional("watchdog_ms"),
            )
            for c in row.children("connections")
        ),
    )
