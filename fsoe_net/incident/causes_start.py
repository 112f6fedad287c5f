"""Causes for a bus that did not open, from its fault and its SubDevices."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.core.bus_documents import Found, SubDeviceSnapshot
from fsoe_net.incident.candidate import Candidate, any_of, candidate
from fsoe_net.incident.causes_places import swapped, swapped_key
from fsoe_net.incident.evidence import IncidentEvidence
from fsoe_net.incident.incident import BusFault, TriggerKind

_BY_STATUS = {
    "FSN_E_BUS_BUSY": "other_main_device",
    "FSN_E_BUS_SILENT": "bus_silent",
    "FSN_E_BUS_MISSING": "device_missing",
    "FSN_E_BUS_IDENTITY": "wrong_device",
    "FSN_E_BUS_MAPPING": "wrong_mapping",
    "FSN_E_BUS_ADDRESS": "wrong_address",
    "FSN_E_BUS_SDO": "sdo_refused",
    "FSN_E_BUS_MAILBOX": "sdo_unanswered",
    "FSN_E_BUS_STATE": "state_refused",
}
_BY_FOUND = {
    Found.NOTHING: "device_missing",
    Found.IDENTITY: "wrong_device",
    Found.MAPPING: "wrong_mapping",
    Found.ADDRESS: "wrong_address",
    Found.SDO: "sdo_refused",
    Found.MAILBOX: "sdo_unanswered",
    Found.STATE: "state_refused",
}


def start_causes(e: IncidentEvidence) -> Iterator[Candidate]:
    """Yield causes for a bus that did not open, or for SubDevices that differ from the plan."""
    trigger = e.head.trigger
    failed = trigger.kind is TriggerKind.BUS_FAILED
    text = f"the bus reports: {trigger.text}" if failed else ""
    stopped_at = ""
    if failed:
        if trigger.fault is not None:
            stopped_at = trigger.fault.subdevice
            yield from _by_status(e, trigger.fault, text)
        yield from swapped(e)
    # A SubDevice that was not read provides no facts about the device.
    wrong = [s for s in e.head.subdevices if s.known and s.found in _BY_FOUND]
    yield from _exchanged(e, wrong, text)
    for number, seen in enumerate(wrong[:8]):
        if failed:
            # The bus stopped at the first one; the others may be a consequence.
            named = seen.name == stopped_at
            # In ring order: a missing device shifts all following ones, which then also look wrong.
            yield _one(e, seen, 92 - 5 * number + 4 * named, text if named else "")
        elif seen.found is not Found.NOTHING:  # a loss on a running bus: `bus_causes`
            yield _one(e, seen, _while_running(e, seen))


def _while_running(e: IncidentEvidence, seen: SubDeviceSnapshot) -> int:
    """Return the score for a SubDevice that differs from the plan while the bus runs.

    The device found at its position is a fact; the following ones may be missing with it.
    """
    if seen.found is Found.IDENTITY:
        return 97
    if seen.name == e.head.trigger.subdevice:
        return 96
    score = 80 if seen.found is Found.STATE else 93
    if e.plan is None or seen.name not in (e.plan.main, e.plan.sub):
        # A device of another connection is only a partial explanation of this incident.
        score -= 40
    return score


def _by_status(e: IncidentEvidence, fault: BusFault, text: str) -> Iterator[Candidate]:
    """Yield causes from the status of the fault and its SubDevice."""
    key, device = _BY_STATUS.get(fault.status, ""), fault.subdevice
    # Without a link, no other fact can be known.
    if fault.link_down:
        yield candidate(e, "no_link", 95, text)
        return
    # All other causes name a device in their text.
    if not key or (not device and key not in ("other_main_device", "bus_silent")):
        return
    other = why = ""
    if key == "wrong_device":
        key, other = _identity(e, device)
        why = f"the device at the position of {device} is the one planned as {other}"
    elif key == "wrong_address":
        other = _owner(e, device)
        key = swapped_key(e, device, other) if other else key
        why = f"the address that {device} has is planned for {other}"
    score = 97 if other else 94
    yield candidate(e, key, score, text, why if other else "", device=device, other=other)


def _identity(e: IncidentEvidence, device: str) -> tuple[str, str]:
    """Return the type of difference, and the SubDevice that has this identity."""
    seen = e.subdevice(device)
    if seen is None or not seen.vendor_id:
        return "wrong_device", ""
    # Same type: only the revision can differ.
    if e.type_of(device) == seen.identity:
        return "wrong_revision", ""
    others = [s for s in e.head.subdevices if e.type_of(s.name) == seen.identity]
    if all(s.known for s in e.head.subdevices):
        # If several have the type, it is the one at whose position another device was also found.
        others = [s for s in others if s.found is Found.IDENTITY]
    if not others:
        return "wrong_device", ""
    return "devices_swapped_places", any_of([s.name for s in others])


def _owner(e: IncidentEvidence, device: str) -> str:
    """Return the SubDevice whose planned FSoE address another one has."""
    address = e.address_of(device)
    names = [p.sub for p in e.planned.values() if p.address == address and p.sub != device]
    return names[0] if names and address is not None else ""


def _one(e: IncidentEvidence, seen: SubDeviceSnapshot, score: int, fault: str = "") -> Candidate:
    key = _BY_FOUND[seen.found]
    if key == "wrong_device" and seen.identity == e.type_of(seen.name):
        key = "wrong_revision"
    found = f"{seen.name}: {seen.found_text}" + (f": {seen.detail}" if seen.detail else "")
    code = f"AL status code of {seen.name}: 0x{seen.al_code:04x}" if seen.al_code else ""
    return candidate(e, key, score, found, code, fault, device=seen.name)


def _exchanged(
    e: IncidentEvidence, wrong: list[SubDeviceSnapshot], fault: str
) -> Iterator[Candidate]:
    """Two SubDevices have exchanged positions."""
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
                f"the device at the position of {one.name} has the type of {other}, and the other "
                "way round",
                fault,
                device=one.name,
                other=other,
            )
