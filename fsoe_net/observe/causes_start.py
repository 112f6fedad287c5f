"""Causes for a bus that did not open: what its fault and its SubDevices say."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.observe.candidate import Candidate, candidate
from fsoe_net.observe.evidence import Evidence
from fsoe_net.observe.incident import SubDeviceSeen, TriggerKind

__all__ = ["start_causes"]


def start_causes(e: Evidence) -> Iterator[Candidate]:
    """Yield what fits a bus that did not open."""
    if e.head.trigger.kind is not TriggerKind.BUS_FAILED:
        return
    text = e.head.trigger.text
    fault = f"the bus says: {text}"
    low = text.lower()
    if "another maindevice" in low:
        yield candidate(e, "other_main_device", 95, fault)
    elif "has no link" in low:
        yield candidate(e, "no_link", 95, fault)
    elif "no ethercat subdevice" in low or "no subdevice answers" in low:
        yield candidate(e, "bus_silent", 90, fault)
    wrong = [s for s in e.head.subdevices if s.known and _kind(s)]
    yield from _exchanged(e, wrong, fault)
    for number, seen in enumerate(wrong[:8]):
        # The first one is what the bus stopped at; the others may follow from it.
        named = seen.name in text
        yield _one(e, seen, 92 - 5 * number + 4 * named, fault if named else "")


def _kind(seen: SubDeviceSeen) -> str:
    """Return the cause that the bus's own words about a SubDevice name, or an empty text."""
    words = {
        "does not answer": "device_missing",
        "another device": "wrong_device",
        "other process data": "wrong_mapping",
        "another FSoE address": "wrong_address",
        "refused a start-up SDO": "sdo_refused",
        "refused a state": "state_refused",
    }
    return words.get(seen.found, "")


def _one(e: Evidence, seen: SubDeviceSeen, score: int, fault: str) -> Candidate:
    key = _kind(seen)
    if key == "wrong_device" and _same_product(e, seen):
        key = "wrong_revision"
    found = f"{seen.name}: {seen.found}" + (f": {seen.detail}" if seen.detail else "")
    code = f"AL status code of {seen.name}: 0x{seen.al_code:04x}" if seen.al_code else ""
    if key == "wrong_address":
        score += 1
    return candidate(e, key, score, found, code, fault, device=seen.name)


def _same_product(e: Evidence, seen: SubDeviceSeen) -> bool:
    """Whether vendor and product are those of the plan, so only the revision differs."""
    plan = e.head.plan
    rows = plan.subdevices if plan else ()
    return any(
        s.name == seen.name and (s.vendor_id, s.product_code) == seen.identity[:2] for s in rows
    )


def _exchanged(e: Evidence, wrong: list[SubDeviceSeen], fault: str) -> Iterator[Candidate]:
    """Two SubDevices of which each stands where the other one should, or has its address."""
    plan = e.head.plan
    if plan is None:
        return
    planned = {s.name: (s.vendor_id, s.product_code) for s in plan.subdevices}
    addresses = {p.sub: p.address for p in e.planned.values()}
    for number, one in enumerate(wrong):
        for two in wrong[number + 1 :]:
            a, b = planned.get(one.name), planned.get(two.name)
            if a and b and a != b and one.identity[:2] == b and two.identity[:2] == a:
                each = f"at the place of {one.name} stands a {two.name}, and the other way round"
                yield candidate(
                    e, "devices_swapped_places", 98, each, fault, device=one.name, other=two.name
                )
            told = e.address_of(one.name), e.address_of(two.name)
            if None not in told and told == (addresses.get(two.name), addresses.get(one.name)):
                each = f"{one.name} has FSoE address {told[0]}, {two.name} has {told[1]}"
                yield candidate(
                    e, "devices_swapped_places", 98, each, fault, device=one.name, other=two.name
                )
