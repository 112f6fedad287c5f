"""The head of an incident file: JSON to plain values."""

from __future__ import annotations

import base64
import binascii
import hashlib

from fsoe_net.core.snapshot import Histogram
from fsoe_net.errors import PlanFormatError
from fsoe_net.fsoe.pdu import is_frame_length
from fsoe_net.observe.incident import (
    Area,
    Counters,
    DirectionSeen,
    FsoeFacts,
    FsoeSetting,
    IncidentEvent,
    IncidentHead,
    LinkSeen,
    Places,
    SubDeviceSeen,
    Trigger,
    TriggerKind,
)
from fsoe_net.observe.incident_values import Values
from fsoe_net.plan.codec import decode_plan
from fsoe_net.plan.model import Plan

__all__ = ["head_of"]

_HISTOGRAMS = ("latency", "period", "work", "copy", "round_trip", "dc_offset")
_VERSION = 1


def head_of(values: Values) -> IncidentHead:
    """Return the head.

    Raises:
        IncidentError: A key is missing or has a value it cannot have.
    """
    version = values.whole("incident", missing=0)
    if version == 0:
        raise values.bad("incident", "is missing: this is no incident file")
    if version > _VERSION:
        raise values.bad("incident", f"is {version}; this fsoe-net reads version {_VERSION}")
    remarks: list[str] = []
    plan = _plan(values, remarks)
    layout = values.child("layout")
    image_bytes = layout.whole("image_bytes", missing=0)
    places = tuple(_places(row, image_bytes) for row in layout.children("connections"))
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
        counters=_counters(values.child("statistics")),
        connections=tuple(_link(row) for row in values.children("connections")),
        subdevices=tuple(_subdevice(row) for row in values.children("subdevices")),
        events=tuple(_event(row) for row in values.children("events")),
        image_bytes=image_bytes,
        places=places,
        areas=tuple((row.whole("byte"), row.whole("bytes")) for row in layout.children("sms")),
        fsoe=tuple(_facts(row) for row in values.children("fsoe")),
        remarks=tuple(remarks),
    )


def _plan(values: Values, remarks: list[str]) -> Plan | None:
    """Return the plan; one that is damaged costs names and facts, not the file."""
    text = values.text("plan")
    if not text:
        remarks.append("the file holds no plan: addresses and watchdogs are not known")
        return None
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        remarks.append("the plan in the file is damaged (no base64): its facts are not used")
        return None
    told = values.label("plan_sha256")
    if told and hashlib.sha256(data).hexdigest() != told:
        remarks.append("the plan in the file does not fit its SHA-256: its facts are not used")
        return None
    try:
        return decode_plan(data)
    except PlanFormatError as exc:
        remarks.append(f"the plan in the file is damaged ({exc}): its facts are not used")
        return None


def _trigger(row: Values) -> Trigger:
    kind = row.text("kind")
    if kind not in {k.value for k in TriggerKind}:
        raise row.bad("kind", f"is not one of {', '.join(k.value for k in TriggerKind)}")
    code = row.optional("reset_code")
    by = row.label("reset_by")
    if code is not None and code > 0xFF:
        raise row.bad("reset_code", "is no byte")
    return Trigger(
        kind=TriggerKind(kind),
        connection=row.label("connection"),
        subdevice=row.label("subdevice"),
        before=_state(row.label("before")),
        after=_state(row.label("after")),
        reset_by=by if by in ("main", "sub") else "",
        reset_code=code if by in ("main", "sub") else None,
        cycle=row.whole("cycle", missing=0),
        now_ns=row.whole("now_ns", missing=0),
        text=row.label("text"),
    )


def _state(word: str) -> str:
    """Return a state word of ours for one of `fsn-master`."""
    return {"process data": "data_process", "failsafe data": "data_failsafe"}.get(word, word)


def _counters(row: Values) -> Counters:
    histograms = {}
    for name in _HISTOGRAMS:
        if row.has(name):
            histogram = _histogram(row.child(name))
            if histogram.count and histogram.buckets:
                histograms[name] = histogram
    return Counters(
        cycles=row.whole("cycles", missing=0),
        overruns=row.whole("overruns", missing=0),
        wkc_errors=row.whole("wkc_errors", missing=0),
        lost_frames=row.whole("lost_frames", missing=0),
        old_replies=row.whole("old_replies", missing=0),
        foreign_frames=row.whole("foreign_frames", missing=0),
        unsent_frames=row.whole("unsent_frames", missing=0),
        send_errno=row.whole("send_errno", missing=0),
        expected_wkc=row.whole("expected_wkc", missing=0),
        actual_wkc=row.whole("actual_wkc", missing=0),
        realtime=row.flag("realtime"),
        histograms=histograms,
    )


def _histogram(row: Values) -> Histogram:
    count = row.whole("count", missing=0)
    percentiles = row.child("percentiles_ns")
    buckets = row.pairs("buckets")
    floors = [floor for floor, _ in buckets]
    if floors != sorted(set(floors)) or any(times == 0 for _, times in buckets):
        raise row.bad("buckets", "do not rise")
    return Histogram(
        count=count,
        min_ns=row.whole("min_ns", missing=0),
        mean_ns=row.whole("sum_ns", missing=0) // count if count else 0,
        p50_ns=percentiles.whole("p50", missing=0),
        p99_ns=percentiles.whole("p99", missing=0),
        p999_ns=percentiles.whole("p999", missing=0),
        max_ns=row.whole("max_ns", missing=0),
        buckets=buckets,
    )


def _link(row: Values) -> LinkSeen:
    return LinkSeen(
        name=row.label("name"),
        main=row.label("main"),
        sub=row.label("sub"),
        state=_state(row.label("state")),
        to_sub=_direction(row.child("to_sub")),
        to_main=_direction(row.child("to_main")),
    )


def _direction(row: Values) -> DirectionSeen:
    intervals = row.whole("intervals", missing=0)
    return DirectionSeen(
        frames=row.whole("frames", missing=0),
        wrong=row.whole("wrong", missing=0),
        resets=row.whole("resets", missing=0),
        reset_code=row.whole("reset_code", missing=0),
        interval_mean_ns=row.whole("interval_sum_ns", missing=0) // intervals if intervals else 0,
        interval_max_ns=row.whole("interval_max_ns", missing=0),
    )


def _subdevice(row: Values) -> SubDeviceSeen:
    known = row.flag("known")
    return SubDeviceSeen(
        name=row.label("name"),
        position=row.whole("position", missing=0),
        known=known,
        al=(row.label("al") or "none") if known else "",
        al_code=row.whole("al_code", missing=0),
        found=row.label("found_text"),
        detail=row.label("detail"),
        returns=row.whole("returns", missing=0),
        stale_cycles=row.whole("stale_cycles", missing=0),
        identity=(
            row.whole("vendor_id", missing=0),
            row.whole("product_code", missing=0),
            row.whole("revision", missing=0),
        ),
        link_lost=row.numbers("link_lost"),
        rx_errors=row.numbers("rx_errors"),
    )


def _event(row: Values) -> IncidentEvent:
    return IncidentEvent(
        event=row.label("event"),
        now_ns=row.whole("now_ns", missing=0),
        level=row.label("level"),
        text=row.label("text"),
        keys=row.plain(),
    )


def _places(row: Values, image_bytes: int) -> Places:
    return Places(
        name=row.label("name"),
        to_sub=_area(row.child("to_sub"), image_bytes),
        to_main=_area(row.child("to_main"), image_bytes),
    )


def _area(row: Values, image_bytes: int) -> Area:
    area = Area(
        source_byte=row.whole("source_byte"),
        destination_byte=row.whole("destination_byte"),
        size_bytes=row.whole("bytes"),
    )
    if not is_frame_length(area.size_bytes):
        raise row.bad("bytes", f"is {area.size_bytes}: no FSoE frame has this length")
    if max(area.source_byte, area.destination_byte) + area.size_bytes > image_bytes:
        raise row.bad("source_byte", "lies outside the image")
    return area


def _facts(row: Values) -> FsoeFacts:
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
