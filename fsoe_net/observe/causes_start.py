"""Causes for a bus that did not open: what its fault and its SubDevices say."""

from __future__ import annotations

import re
from collections.abc import Iterator

from fsoe_net.observe.bus_documents import SubDeviceSnapshot
from fsoe_net.observe.candidate import Candidate, any_of, candidate
from fsoe_net.observe.causes_places import swapped, swapped_key
from fsoe_net.observe.evidence import IncidentEvidence
from fsoe_net.observe.incident import TriggerKind
from fsoe_net.observe.json_object import clean

__all__ = ["start_causes"]

_FAULT = re.compile(r"FSN_E_BUS_([A-Z]+)(?:: SubDevice \d+ \(([^)]{1,200})\))?")
_IDENTITY = re.compile(r"found vendor 0x([0-9a-f]{1,8}) product 0x([0-9a-f]{1,8})")
_ADDRESS = re.compile(r"it has FSoE address (\d{1,5}),")
_STATUS = {
    "BUSY": "other_main_device",
    "SILENT": "bus_silent",
    "MISSING": "device_missing",
    "IDENTITY": "wrong_device",
    "MAPPING": "wrong_mapping",
    "ADDRESS": "wrong_address",
    "SDO": "sdo_refused",
    "MAILBOX": "sdo_unanswered",
    "STATE": "state_refused",
}


def start_causes(e: IncidentEvidence) -> Iterator[Candidate]:
    """Yield what fits a bus that did not open, and SubDevices that are not as planned."""
    failed = e.head.trigger.kind is TriggerKind.BUS_FAILED
    text = _told(e.head.trigger.text) if failed else ""
    fault = f"the bus says: {text}" if failed else ""
    if failed:
        yield from _no_bus(e, text, fault)
        yield from _by_status(e, text, fault)
        yield from swapped(e)
    wrong = [s for s in e.head.subdevices if s.known and _kind(s)]
    yield from _exchanged(e, wrong, fault)
    for number, seen in enumerate(wrong[:8]):
        if failed:
            # The first one is what the bus stopped at; the others may follow from it.
            named = seen.name in text
            yield _one(e, seen, 92 - 5 * number + 4 * named, fault if named else "")
        elif _kind(seen) != "device_missing":  # who is lost while the bus runs: `bus_causes`
            yield _one(e, seen, _while_running(e, seen))


def _while_running(e: IncidentEvidence, seen: SubDeviceSnapshot) -> int:
    """Return how well it fits that a SubDevice is not as planned, while the bus runs.

    What was found in its place is a fact, and those behind it may be gone with it.
    """
    if _kind(seen) == "wrong_device":
        return 97
    if seen.name == e.head.trigger.subdevice:
        return 96
    mine = e.plan is not None and seen.name in (e.plan.main, e.plan.sub)
    return (80 if _kind(seen) == "state_refused" else 93) - (0 if mine else 40)


def _no_bus(e: IncidentEvidence, text: str, fault: str) -> Iterator[Candidate]:
    """What the words of a fault say of the bus as a whole."""
    low = text.lower()
    if "another maindevice" in low:
        yield candidate(e, "other_main_device", 95, fault)
    elif "has no link" in low:
        yield candidate(e, "no_link", 95, fault)
    elif "no ethercat subdevice" in low or "no subdevice answers" in low:
        yield candidate(e, "bus_silent", 90, fault)


def _told(text: str) -> str:
    """Return the fault without what every fault begins with."""
    return text.removeprefix("the bus does not open: ")


def _by_status(e: IncidentEvidence, text: str, fault: str) -> Iterator[Candidate]:
    """What the name of the status and the SubDevice in the fault say."""
    found = _FAULT.search(text)
    key = _STATUS.get(found[1], "") if found else ""
    if found is None or not key:
        return
    device = found[2] or ""
    if not device and key not in ("other_main_device", "bus_silent"):
        return
    if key == "bus_silent" and "has no link" in text:
        return
    other = why = ""
    if key == "wrong_device":
        key, other = _identity(e, text, device)
        why = f"what stands at the place of {device} is what the plan has as {other}"
    elif key == "wrong_address":
        other = _owner(e, text, device)
        key = swapped_key(e, device, other) if other else key
        why = f"the address that {device} has is planned for {other}"
    yield candidate(e, key, 94, fault, why if other else "", device=device, other=other)


def _identity(e: IncidentEvidence, text: str, device: str) -> tuple[str, str]:
    """Return which kind of another device it is, and whose identity it has."""
    numbers = _IDENTITY.search(text)
    rows = e.head.plan.subdevices if e.head.plan else ()
    if numbers is None:
        return "wrong_device", ""
    seen = int(numbers[1], 16), int(numbers[2], 16)
    planned = {clean(s.name): (s.vendor_id, s.product_code) for s in rows}
    if planned.get(device) == seen:
        return "wrong_revision", ""
    others = [name for name, identity in planned.items() if identity == seen]
    if e.head.subdevices and all(s.known for s in e.head.subdevices):
        # Of several of one type it is that in whose place another device was found, too.
        wrong = {s.name for s in e.head.subdevices if _kind(s) == "wrong_device"}
        others = [name for name in others if name in wrong]
    return ("devices_swapped_places", any_of(others)) if others else ("wrong_device", "")


def _owner(e: IncidentEvidence, text: str, device: str) -> str:
    """Return the SubDevice that should have the FSoE address that a fault names."""
    number = _ADDRESS.search(text)
    if number is None:
        return ""
    names = [p.sub for p in e.planned.values() if p.address == int(number[1]) and p.sub != device]
    return names[0] if names else ""


def _kind(seen: SubDeviceSnapshot) -> str:
    """Return the cause that the bus's own words about a SubDevice name, or an empty text."""
    words = {
        "does not answer": "device_missing",
        "another device": "wrong_device",
        "other process data": "wrong_mapping",
        "another FSoE address": "wrong_address",
        "refused a start-up SDO": "sdo_refused",
        "does not answer an SDO": "sdo_unanswered",
        "refused a state": "state_refused",
    }
    return words.get(seen.found, "")


def _one(e: IncidentEvidence, seen: SubDeviceSnapshot, score: int, fault: str = "") -> Candidate:
    key = _kind(seen)
    if key == "wrong_device" and seen.identity == e.type_of(seen.name):
        key = "wrong_revision"
    found = f"{seen.name}: {seen.found}" + (f": {seen.detail}" if seen.detail else "")
    code = f"AL status code of {seen.name}: 0x{seen.al_code:04x}" if seen.al_code else ""
    return candidate(e, key, score, found, code, fault, device=seen.name)


def _exchanged(
    e: IncidentEvidence, wrong: list[SubDeviceSnapshot], fault: str
) -> Iterator[Candidate]:
    """Two SubDevices of which each stands where the other one should."""
    for one in wrong:
        partners = [
            two.name
            for two in wrong
            if one.identity == e.type_of(two.name) != e.type_of(one.name) == two.identity
        ]
        if partners:
            other = any_of(partners)
            yield candidate(
                e,
                "devices_swapped_places",
                98,
                f"at the place of {one.name} stands a device of the type of {other}, and the other "
                "way round",
                fault,
                device=one.name,
                other=other,
            )
