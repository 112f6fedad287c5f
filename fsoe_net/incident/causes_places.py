"""Causes in wiring and configuration: wrong peer, wrong bytes, wrong address, wrong ID."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.core.bus_documents import PlannedConnection
from fsoe_net.diag.words import counted
from fsoe_net.fsoe.pdu import ResetCode
from fsoe_net.incident.candidate import Candidate, any_of, candidate, code_text
from fsoe_net.incident.causes_fsoe_ends import reported_codes
from fsoe_net.incident.evidence import IncidentEvidence
from fsoe_net.incident.evidence_frames import LinkFacts, WireSide
from fsoe_net.incident.incident import TriggerKind

_MAIN, _SUB = 0, 1
_FEW = 3
# Each pair is compared: the time grows with the square.
_MOST_COMPARED = 200


def place_causes(e: IncidentEvidence) -> Iterator[Candidate]:
    """Yield the matching causes in positions, addresses and IDs."""
    link, plan = e.link, e.plan
    if link is None or plan is None or e.head.trigger.kind is TriggerKind.BUS_FAILED:
        return
    yield from _torn(e, link)
    yield from _duplicates(e)
    yield from _roles(e, link)
    # Crossed copies also look like wrong addresses and IDs, so these are judged only without
    # crossed copies.
    crossed = list(_crossed(e, plan, link)) if e.never or e.left_data else []
    yield from crossed
    if not crossed:
        yield from swapped(e)
        yield from _refused_both(e, plan)
    # An incident on request shows a running connection, so its addresses cannot be wrong.
    if not e.never and not e.left_data:
        return
    yield from _address(e, plan, link)
    if not crossed:
        yield from _connection_id(e, plan, link)
    if e.never:
        yield from _shifted(e, plan, link)
        yield from _altered(e, plan, link)
        if not crossed:
            yield from _not_taken(e, plan, link)


def _torn(e: IncidentEvidence, link: LinkFacts) -> Iterator[Candidate]:
    """The destination differs from the source: another writer wrote there."""
    plan = e.plan
    for side, sender in zip(link.sides, (plan.main, plan.sub) if plan else ("", ""), strict=True):
        if side.torn:
            yield candidate(
                e,
                "second_writer",
                97,
                f"in {side.torn} cycles, first in cycle {side.torn_cycle}, the destination did "
                f"not hold the frame that {sender} had sent",
                f"{e.by} reset with {code_text(e.code)}" if e.code is not None else "",
            )


def _duplicates(e: IncidentEvidence) -> Iterator[Candidate]:
    """Two connections have the same connection ID, on the wire or in the devices."""
    names = list(e.planned)[:_MOST_COMPARED]
    ids = {name: _ids(e, name) for name in names}
    for number, one in enumerate(names):
        for two in names[number + 1 :]:
            both = ids[one] & ids[two]
            if both:
                yield _duplicate(e, one, two, min(both))


def _duplicate(e: IncidentEvidence, one: str, two: str, number: int) -> Candidate:
    reported = any(code == ResetCode.CONNECTION_ID for _, code in reported_codes(e))
    about = e.name in (one, two)
    # Two crossed connections carry each other's ID, which is not a duplicate.
    crossed = about and not e.crossed.keys().isdisjoint({one, two})
    bad = (reported or e.never) and about
    # In a running connection, a duplicate is a risk and not the cause of this incident.
    score = 40
    if bad:
        score = 95
    elif not e.left_data and not e.never:
        score = 88
    on_wire = _wire_ids(e, one) & _wire_ids(e, two)
    return candidate(
        e,
        "duplicate_connection_id",
        score - (40 if crossed else 0),
        f"connection ID {number} is used by {one} and {two} "
        f"{'on the wire' if on_wire else 'in the devices'}",
        f"planned are {e.planned[one].connection_id} and {e.planned[two].connection_id}",
        f"resets with {code_text(ResetCode.CONNECTION_ID)}" if reported else "",
        device=one,
        other=two,
    )


def _ids(e: IncidentEvidence, name: str) -> set[int]:
    setting = e.setting(name)
    reported = {setting.connection_id} if setting and setting.connection_id else set()
    return reported | _wire_ids(e, name)


def _wire_ids(e: IncidentEvidence, name: str) -> set[int]:
    """Return the ConnIDs that the main of a connection sent more than a few times."""
    link = e.links.get(name)
    return _sent_ids(link.sides[_MAIN]) if link else set()


def _sent_ids(side: WireSide) -> set[int]:
    return {number for number, times in side.connection_ids.items() if number and times >= _FEW}


def _crossed(e: IncidentEvidence, plan: PlannedConnection, link: LinkFacts) -> Iterator[Candidate]:
    """Frames of one connection answer those of another, or it uses the ConnID of another."""
    own = link.sides[_SUB].linked
    ids = _wire_ids(e, e.name)
    for other in e.planned.values():
        if other.name == e.name:
            continue
        fits = e.crossed.get(other.name, 0)
        theirs = _wire_ids(e, other.name)
        # A few frames match by chance: the CRC has 16 bits.
        if fits > _FEW and fits > own:
            yield candidate(
                e,
                "copies_crossed",
                97,
                f"{fits} frames fit a partner in {other.name}, {own} the planned one",
                f"{e.name} carries connection ID {_list(ids)}, planned is {plan.connection_id}"
                if ids and ids != {plan.connection_id}
                else "",
                other=other.name,
            )
        elif _are_exchanged(plan, ids, other, theirs):
            yield candidate(
                e,
                "copies_crossed",
                96,
                f"{e.name} carries connection ID {_list(ids)}, which is planned for {other.name}",
                f"{other.name} carries {_list(theirs)}" if theirs else "",
                other=other.name,
            )


def _are_exchanged(
    plan: PlannedConnection, ids: set[int], other: PlannedConnection, theirs: set[int]
) -> bool:
    """Whether one carries the planned ConnID of the other, which does not contradict this."""
    if not plan.connection_id or not other.connection_id:
        return False
    # An equal ID on both is a duplicate, not an exchange.
    if plan.connection_id == other.connection_id or ids != {other.connection_id}:
        return False
    return not theirs or theirs == {plan.connection_id}


def _list(numbers: set[int]) -> str:
    return ", ".join(str(n) for n in sorted(numbers))


def _expected_address(
    e: IncidentEvidence, plan: PlannedConnection, link: LinkFacts | None
) -> int | None:
    """Return the address that the main requests: as sent, as configured in it, or as planned."""
    if link is not None and link.sent_address is not None:
        return link.sent_address
    setting = e.setting(plan.name)
    if setting is not None and setting.address is not None:
        return setting.address
    return plan.address


def swapped_key(e: IncidentEvidence, one: str, *others: str) -> str:
    """Return the cause if devices have exchanged FSoE addresses.

    If each device is at its position, as shown by its type or because it never left the bus, only
    the addresses were exchanged. Otherwise only the person at the machine can find out.
    """
    names = [one, *others]
    # Devices of different types cannot have been exchanged: each is at its position.
    if len({e.type_of(name) for name in names}) > 1:
        return "addresses_swapped"
    # A device that never left the bus cannot have been moved.
    if e.left_data and not all(e.went_away(name) for name in names):
        return "addresses_swapped"
    return "devices_swapped"


def swapped(e: IncidentEvidence) -> Iterator[Candidate]:
    """Yield the devices with each other's address, those of this connection first."""
    sub = e.plan.sub if e.plan else ""
    has = {p.sub: e.address_of(p.sub) for p in e.planned.values()}
    wanted = {p.sub: _expected_address(e, p, e.links.get(p.name)) for p in e.planned.values()}
    owner = {number: sub for sub, number in wanted.items()}
    # The connection of this incident first, because a person looks for its devices.
    for first in sorted(has, key=lambda name: name != sub):
        round_ = _round(first, has, owner)
        if not round_:
            continue
        yield candidate(
            e,
            swapped_key(e, *round_),
            96 if sub and sub not in round_ else 98,
            *(f"{s} reports address {has[s]}, expected is {wanted[s]}" for s in round_[:6]),
            device=round_[0],
            other=", ".join(round_[1:6]),
        )
        return


def _refused_both(e: IncidentEvidence, plan: PlannedConnection) -> Iterator[Candidate]:
    """Devices of one type reject their address, and their actual addresses are unknown."""
    partners = [o.sub for o in e.planned.values() if _both_refuse(e, plan, o)]
    if partners and all(e.address_of(sub) is None for sub in (plan.sub, *partners)):
        other = any_of(partners)
        yield candidate(
            e,
            "devices_swapped",
            93,
            f"{plan.sub} and {other} are of the same type, and refuse their address",
            "what addresses they have could not be read",
            device=plan.sub,
            other=other,
        )


def _round(first: str, has: dict[str, int | None], owner: dict[int | None, str]) -> list[str]:
    """Return devices of which each has the address of the next, and the last that of the first."""
    names = [first]
    while (number := has.get(names[-1])) is not None and (then := owner.get(number)) is not None:
        # A cycle of addresses is an exchange; a chain that ends elsewhere is a wrong address.
        if then == first:
            return names if len(names) > 1 else []
        if then in names:
            return []
        names.append(then)
    return []


def _both_refuse(e: IncidentEvidence, one: PlannedConnection, two: PlannedConnection) -> bool:
    """Whether two devices of the same type both reset with code 6."""
    # Devices of another type would have been recognised by their identity.
    if one.sub == two.sub or None is e.type_of(one.sub) or e.type_of(one.sub) != e.type_of(two.sub):
        return False
    links = [e.links.get(p.name) for p in (one, two)]
    return all(
        link is not None
        and sum(r.by == "sub" and r.code == ResetCode.ADDRESS for r in link.resets) >= 1
        for link in links
    )


def _address(e: IncidentEvidence, plan: PlannedConnection, link: LinkFacts) -> Iterator[Candidate]:
    """The device rejects the address, or reports another one."""
    refused = sum(n for (by, c), n in reported_codes(e).items() if c == ResetCode.ADDRESS)
    reported = e.address_of(plan.sub)
    expected = _expected_address(e, plan, link)
    differs = reported is not None and expected is not None and reported != expected
    if not refused and not (differs and e.never):
        return
    # The plan and the MainInstance may differ: then both numbers are shown.
    planned = plan.address is not None and expected is not None and plan.address != expected
    yield candidate(
        e,
        "wrong_address",
        92 if refused else 60,
        f"{plan.sub} reset {refused} times with {code_text(ResetCode.ADDRESS)}" if refused else "",
        f"the main asks for address {expected}",
        f"{plan.sub} reports {reported}" if reported is not None else "",
        f"the configuration has {plan.address}" if planned else "",
    )


def _connection_id(
    e: IncidentEvidence, plan: PlannedConnection, link: LinkFacts
) -> Iterator[Candidate]:
    """Reset code 3, or another ConnID on the wire than planned."""
    refused = sum(n for (_, c), n in reported_codes(e).items() if c == ResetCode.CONNECTION_ID)
    ids = _wire_ids(e, e.name)
    # Another ID on the wire than planned means the parameters of another safety project.
    other = bool(ids and plan.connection_id and plan.connection_id not in ids)
    answers = _sent_ids(link.sides[_SUB])
    if not refused and not (other and e.never):
        return
    yield candidate(
        e,
        "connection_id",
        (80 if refused else 45) + (8 if other else 0),
        f"resets with {code_text(ResetCode.CONNECTION_ID)}: {refused}" if refused else "",
        f"{plan.main} sends {_list(ids)}, planned is {plan.connection_id}" if other else "",
        f"{plan.sub} answers with {_list(answers)}" if answers and answers != ids else "",
    )


def _shifted(e: IncidentEvidence, plan: PlannedConnection, link: LinkFacts) -> Iterator[Candidate]:
    """Whole frames next to the planned place, or with another length."""
    for side, (shift, device) in enumerate(zip(link.shifts, (plan.main, plan.sub), strict=True)):
        if shift is None:
            continue
        # Only frames that were wrong at the planned place make a shifted place probable.
        bad = link.sides[side].illegal + link.sides[side].wrong
        if shift.offset_bytes:
            yield candidate(
                e,
                "mapping_shifted",
                94 if shift.times >= _FEW else 75,
                f"{counted(shift.times, 'whole frame')} of {device} begin "
                f"{counted(abs(shift.offset_bytes), 'byte')} "
                f"{'after' if shift.offset_bytes > 0 else 'before'} the planned place",
                f"{bad} times the bytes at the planned place were not a correct frame",
                device=device,
            )
        else:
            yield candidate(
                e,
                "frame_size",
                94 if shift.times >= 2 else 80,
                f"{counted(shift.times, 'frame')} of {device} are whole with "
                f"{shift.size_bytes} bytes",
                f"{bad} times they were not a correct frame with the planned length",
                device=device,
            )


def _roles(e: IncidentEvidence, link: LinkFacts) -> Iterator[Candidate]:
    """The end that should wait begins sessions."""
    main, sub = link.begun
    # A single session may start by accident after a disturbance; a quarter of all cannot.
    if sub > main or (sub >= 2 and sub >= main // 4):
        score = 45 if e.left_data else 90
        yield candidate(
            e,
            "roles_exchanged",
            95 if e.never else score,
            f"the SubInstance has begun {sub} sessions, the MainInstance {main}: only a "
            "MainInstance begins one",
        )


def _altered(e: IncidentEvidence, plan: PlannedConnection, link: LinkFacts) -> Iterator[Candidate]:
    """Frames are correct in the image, but an end rejects them on the way to Data."""
    # A shifted mapping already explains why frames are refused.
    if any(link.shifts):
        return
    for side, sender, victim, by in (
        (link.sides[_MAIN], plan.main, plan.sub, "sub"),
        (link.sides[_SUB], plan.sub, plan.main, "main"),
    ):
        codes = reported_codes(e)
        times = codes[by, ResetCode.CRC] + codes[by, ResetCode.UNKNOWN_COMMAND]
        # With many wrong frames the sender itself is at fault.
        if times < 2 or side.wrong > side.right // 4:
            continue
        yield candidate(
            e,
            "second_writer",
            70,
            f"{victim} refused frames {counted(times, 'time')} as damaged",
            f"the frames of {sender} were right where they came in: {side.right}, wrong "
            f"{side.wrong}",
        )


def _not_taken(
    e: IncidentEvidence, plan: PlannedConnection, link: LinkFacts
) -> Iterator[Candidate]:
    """The sub answers correctly, but the main still waits: the answer is at a wrong place."""
    if not _waits_in_vain(link):
        return
    said = (
        f"{plan.sub} answers right, its frames are copied, and {plan.main} still waits until its "
        "watchdog expires"
    )
    for other in e.planned.values():
        theirs = e.links.get(other.name)
        # Only connections of the same MainInstance can have exchanged slots.
        if theirs is None or other.name == e.name or other.main != plan.main:
            continue
        # Frames of another length would not fit the slot.
        if not _waits_in_vain(theirs) or other.safe_bytes != plan.safe_bytes:
            continue
        order = _slots_disagree(e, e.name, other.name)
        yield candidate(
            e,
            "copies_crossed",
            95 if order else 76,
            said,
            f"so does {other.name}, whose frames have the same lengths",
            f"the order of both in the outputs of {plan.main} is not that in its inputs"
            if order
            else "",
            other=other.name,
        )
    yield candidate(e, "mapping_shifted", 62, said, device=plan.main)


def _waits_in_vain(link: LinkFacts) -> bool:
    sub = link.sides[_SUB]
    vain = [r for r in link.resets if r.code == ResetCode.WATCHDOG and r.waiting_for == "main"]
    return len(vain) >= _FEW and sub.linked >= _FEW and not sub.wrong


def _slots_disagree(e: IncidentEvidence, one: str, two: str) -> bool:
    """Whether the main sends two connections in another order than it receives them."""
    places = {p.name: p for p in e.head.layout.connections}
    a, b = places[one], places[two]
    sends = a.to_sub.source_byte < b.to_sub.source_byte
    takes = a.to_main.destination_byte < b.to_main.destination_byte
    return sends is not takes
