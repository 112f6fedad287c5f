"""Causes on the running bus: devices, cables, frames, the cycle of the MainDevice."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator, Sequence

from fsoe_net.core.bus_documents import SubDeviceSnapshot
from fsoe_net.diag.words import counted
from fsoe_net.incident.candidate import Candidate, candidate, code_text, ms
from fsoe_net.incident.evidence import IncidentEvidence
from fsoe_net.incident.evidence_cycles import BadCycles
from fsoe_net.incident.incident import IncidentEvent, TriggerKind

_WATCHDOG = 5
_TENTH_MS = 100_000
# MAX_ERRNO of Linux; a damaged file may contain any number.
_MOST_ERRNO = 4095
_NO_INTERFACE = frozenset({errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.ENOLINK})
_TOGETHER_NS = 250_000_000  # SubDevices are checked one after another
_LINK_DOWN_NS = 100_000_000


def bus_causes(e: IncidentEvidence) -> Iterator[Candidate]:
    """Yield the matching causes on the bus."""
    # A bus that did not open is judged by `start_causes`.
    if e.head.trigger.kind is TriggerKind.BUS_FAILED:
        return
    yield from _other_main(e)
    yield from _gone(e)
    yield from _ring_opened(e)
    yield from _back(e)
    yield from _state(e)
    yield from _lost_frames(e)
    yield from _cycle(e)
    yield from _foreign(e)


def _other_main(e: IncidentEvidence) -> Iterator[Candidate]:
    """Another device sends EtherCAT frames: every other observation may be a consequence."""
    if not e.bus.foreign_frames:
        return
    c = e.head.counters
    yield candidate(
        e,
        "other_main_device",
        98,
        f"{counted(e.bus.foreign_frames, 'EtherCAT frame')} of another MainDevice within "
        f"{ms(e.bus.last_ns - e.bus.first_ns)}, during {counted(e.bus.cycles, 'cycle')} of "
        f"this one",
        f"{c.foreign_frames} since the start" if c is not None and c.cycles else "",
    )


def _gone(e: IncidentEvidence) -> Iterator[Candidate]:
    """SubDevices that no longer answer."""
    lost = e.lost_subdevices()
    if not lost or _all_late(e, lost):
        return
    first = lost[0]
    # The first missing one on the ring is next to the fault; the loss of later ones follows.
    gone = [s for s in lost if s.bus == first.bus]
    line, several = e.line(first.bus), len(gone) > 1
    # A loss that does not concern the devices of this connection is only a partial explanation.
    score = 92 if _own(e, [s.name for s in gone]) else 45
    facts = [*_facts_of_gone(e, gone), *_when(e, gone), *_ring(e), *_reported(first)]
    before = line[: line.index(first)]
    to_the_end = several and len(line) - len(before) == len(gone)
    # The whole line is missing and the interface is down: the fault is before the first device.
    if len(gone) == len(line) and _interface_down(e):
        yield candidate(e, "main_link_lost", score + 6, *facts, device=first.name)
    # All devices from one to the end are missing: only a cable or a connector explains that.
    elif to_the_end or _names_a_link(gone):
        other = before[-1].name if before else "the MainDevice"
        text = "all devices from there on are gone" if several else ""
        yield candidate(e, "cable_cut", score + 4, text, *facts, device=first.name, other=other)
        # A device without power also cuts off the rest of the line, so this remains possible.
        if several:
            yield candidate(e, "device_lost", score - 20, *facts, device=first.name)
    else:
        # An end of this connection, if there is one, explains most.
        seen = min(gone, key=lambda s: s.name not in _ends(e))
        yield candidate(e, "device_lost", score, *facts, device=seen.name)


def _reported(sub: SubDeviceSnapshot) -> Iterator[str]:
    if sub.detail:
        yield f"the bus reports for {sub.name}: {sub.detail}"


def _all_late(e: IncidentEvidence, lost: Sequence[SubDeviceSnapshot]) -> bool:
    """Whether all seem lost because frames return late: such frames have passed all devices."""
    return len(lost) == sum(s.known for s in e.head.subdevices) and _is_late(e)


def _ring(e: IncidentEvidence) -> Iterator[str]:
    """Yield the place where the ring is open, and the last report about it."""
    if e.head.ring_place:
        yield f"the ring is open: {e.head.ring_place}"
    for event in e.events("ring")[-3:]:
        side = "after" if event.now_ns > e.moment_ns else "before"
        yield f"event {ms(abs(e.moment_ns - event.now_ns))} {side} the moment: {event.text}"


def _ring_opened(e: IncidentEvidence) -> Iterator[Candidate]:
    """The ring lost a cable around that time, and all SubDevices are still present."""
    opened = [v for v in e.events("ring", e.window_ns[0]) if v.keys.get("place")]
    if opened and not e.lost_subdevices():
        event = opened[0]
        when = f"event {ms(abs(e.moment_ns - event.now_ns))} from the moment: {event.text}"
        yield candidate(e, "ring_open", 90, when, *_wkc(e), device=event.keys["place"])


def _facts_of_gone(e: IncidentEvidence, gone: list[SubDeviceSnapshot]) -> list[str]:
    names = ", ".join(s.name for s in gone[:6]) + (", ..." if len(gone) > 6 else "")
    return [f"does not answer: {names}", _unsent(e), *_wkc(e)]


def _names_a_link(gone: list[SubDeviceSnapshot]) -> bool:
    """Whether the first bus event of one of them is that the link before it is down."""
    return next((s.link_down for s in gone if s.detail), False)


def _ends(e: IncidentEvidence) -> tuple[str, ...]:
    return (e.plan.main, e.plan.sub) if e.plan else ()


def _own(e: IncidentEvidence, names: list[str]) -> list[str]:
    """Return those of the devices that are ends of the connection concerned."""
    return [name for name in names if name in _ends(e)]


def _unsent(e: IncidentEvidence) -> str:
    """Return how many frames the system did not send, and why; empty if there are none."""
    c = e.head.counters
    if c is None or not c.unsent_frames:
        return ""
    why = os.strerror(min(c.send_errno, _MOST_ERRNO))
    return f"{counted(c.unsent_frames, 'frame')} could not be sent: {why}"


def _scheduling(e: IncidentEvidence) -> Iterator[str]:
    """Yield the scheduling of the cyclic thread according to the counters."""
    c = e.head.counters
    if c is not None and c.overruns:
        yield f"{counted(c.overruns, 'overrun')} since the start"
    if c is not None and not c.realtime and e.head.backend != "emulated":
        yield "no real-time policy"


def _wkc(e: IncidentEvidence) -> list[str]:
    bus = e.bus
    if not bus.short:
        return []
    run = bus.short[-1]
    since = ms(max(0, e.moment_ns - run.start_ns))
    return [
        f"working counter {run.least} of {run.expected} since {since} before the moment"
        + (", to the end of the file" if bus.open_short else f", for {ms(run.length_ns)}")
    ]


def _when(e: IncidentEvidence, gone: list[SubDeviceSnapshot]) -> list[str]:
    names = {s.name for s in gone}
    return [
        f"event {ms(abs(e.moment_ns - v.now_ns))} "
        f"{'before' if v.now_ns <= e.moment_ns else 'after'} the moment: {v.text}"
        for v in e.events("subdevice")
        if v.keys.get("subdevice") in names and v.keys.get("after") == "none"
    ][-2:]


def _back(e: IncidentEvidence) -> Iterator[Candidate]:
    """SubDevices that were missing for a time: one, all after a certain one, or all of a bus."""
    fell: dict[str, IncidentEvent] = {}
    # A silent connection is noticed later than one that is reset.
    gaps = [r.start_ns for r in e.bus.short_between(*e.window_ns)]
    for event in e.events("subdevice", min([e.window_ns[0], *gaps])):
        # A device that lost power returns in INIT; the following states are steps of its start.
        if event.keys.get("after", "") in ("none", "INIT", "INIT+ERROR"):
            fell.setdefault(event.keys.get("subdevice", ""), event)
    for bus in sorted({s.bus for s in e.head.subdevices}):
        line = e.line(bus)
        back = [s for s in line if s.name in fell and s.answers]
        # Other devices are only a partial explanation for a reset of this connection.
        if back and _own(e, [s.name for s in back]):
            yield from _back_on(e, line, back, fell, 88)
        elif back:
            yield from _back_on(e, line, back, fell, 45)


def _back_on(
    e: IncidentEvidence,
    line: list[SubDeviceSnapshot],
    back: list[SubDeviceSnapshot],
    fell: dict[str, IncidentEvent],
    score: int,
) -> Iterator[Candidate]:
    """Judge the devices of one bus that were missing.

    Of the devices that dropped together, the first one in the ring is next to the fault: all later
    devices are cut off there, in whatever order their connections drop.
    """
    begun_ns = min(fell[s.name].now_ns for s in back)
    together = [s for s in back if fell[s.name].now_ns - begun_ns <= _TOGETHER_NS]
    first = together[0]
    before = line[: line.index(first)]
    other = before[-1].name if before else "the MainDevice"
    facts = [
        f"event: {fell[first.name].text}",
        f"times it has come back so far: {first.returns}" if first.returns else "",
        *_wkc(e),
    ]
    # Only one device: those after it continued, so its cable was intact.
    if len(together) == 1 and len(line) > 1:
        yield candidate(e, "device_interrupted", score, *facts, device=first.name)
        return
    names = ", ".join(s.name for s in together[:6]) + (", ..." if len(together) > 6 else "")
    facts.insert(0, f"gone together and back: {names}")
    if before:
        yield candidate(e, "cable_interrupted", score, *facts, device=first.name, other=other)
        yield candidate(e, "device_interrupted", score - 20, *facts, device=first.name)
    # For the first device, only the interface or its cable is left as the cause.
    elif _interface_down(e):
        yield candidate(e, "main_link_lost", 97, *facts, _unsent(e), device=first.name)
    elif len(line) == len(together) and _one_gap(e):
        yield candidate(e, "main_link_lost", score + 4, *facts, device=first.name)


def _interface_down(e: IncidentEvidence) -> bool:
    """Whether frames were not sent because the network interface was down or had no link."""
    c = e.head.counters
    return c is not None and c.unsent_frames > 0 and c.send_errno in _NO_INTERFACE


def _one_gap(e: IncidentEvidence) -> bool:
    """Whether nearly all missing cycles are one gap, too long for interference.

    Interference comes in bursts; a lost link stays down.
    """
    bursts = [r for r in e.bus.short if _is_burst(r)]
    longest = max((r.length_ns for r in bursts), default=0)
    return (
        not _is_late(e)
        and not e.events("ring", e.window_ns[0])
        and longest >= _LINK_DOWN_NS
        and 5 * longest >= 4 * sum(r.length_ns for r in bursts)
    )


def _state(e: IncidentEvidence) -> Iterator[Candidate]:
    """SubDevices that answer, but are not in OP."""
    for seen in e.head.subdevices:
        # A SubDevice that does not answer is the subject of another rule.
        if not seen.known or not seen.answers or seen.al == "OP":
            continue
        mine = bool(_own(e, [seen.name]))
        error = "ERROR" in seen.al
        # A device of another connection counts only if it reports an error.
        if not mine and not error:
            continue
        code = f", AL status code 0x{seen.al_code:04x}" if seen.al_code else ""
        yield candidate(
            e,
            "device_state",
            (86 if error else 62) - (0 if mine else 45),
            f"{seen.name} is in {seen.al}{code}",
            f"the bus reports: {seen.detail}" if seen.detail else "",
            device=seen.name,
        )


def _late(e: IncidentEvidence) -> tuple[int, int]:
    """Return the cycles without their frames around the moment, and the late replies."""
    lost = e.bus.lost_between(*e.window_ns)
    if not lost:
        return 0, 0
    # A late reply arrives some cycles after its own cycle.
    late = e.bus.old_between(lost[0].start_ns, lost[-1].end_ns + 4 * e.bus.cycle_ns)
    return sum(r.cycles for r in lost), late


def _is_late(e: IncidentEvidence) -> bool:
    """Whether frames counted as lost returned later."""
    lost, late = _late(e)
    return lost > 0 and 2 * late >= lost


def _lost_frames(e: IncidentEvidence) -> Iterator[Candidate]:
    """Bursts in which no data returned, and which ended."""
    start, end = e.window_ns
    # A burst that lasts to the end is a loss, not interference.
    bursts = [r for r in e.bus.short_between(start, end) if _is_burst(r) and not _goes_on(e, r)]
    lost = e.bus.lost_between(start, end)
    if not bursts and not lost:
        return
    there, _ = _late(e)
    missing = max(there, sum(r.cycles for r in bursts)) * e.bus.cycle_ns
    # Without a plan, the usual watchdog of the safety logic is the best estimate.
    watchdog = e.watchdog_ns or 100_000_000
    facts = [
        f"around the moment {counted(len(bursts) or len(lost), 'burst')}, {ms(missing)} "
        f"without data, the watchdog is {ms(watchdog)}",
        _in_the_whole_file(e),
    ]
    if _is_late(e):
        yield _late_replies(e, watchdog, facts)
        # Frames that return late were counted as lost before and need no second explanation.
        if 2 * there * e.bus.cycle_ns >= missing:
            return  # the missing frames returned later
    errors = _first_errors(e)
    yield candidate(
        e,
        "lost_frames",
        _lost_score(missing, watchdog, e.bus.cycle_ns) + (6 if errors else 0),
        *facts,
        f"{counted(e.bus.lost_frames, 'frame')} counted as lost" if e.bus.lost_frames else "",
        _unsent(e),
        errors,
    )


def _first_errors(e: IncidentEvidence) -> str:
    """Return where receive errors are counted first on the ring: next to a disturbed cable."""
    for sub in e.head.subdevices:
        if errors := sum(sub.rx_errors):
            return f"receive errors are counted first at {sub.name} ({errors})"
    return ""


def _late_replies(e: IncidentEvidence, watchdog_ns: int, facts: list[str]) -> Candidate:
    there, back = _late(e)
    score = 62 if there >= 2 else 32
    if there * e.bus.cycle_ns >= watchdog_ns // 4:
        score = 94  # a returned frame has passed all devices, so a cable does not explain it
    return candidate(
        e,
        "late_replies",
        score,
        f"{counted(there, 'cycle')} without frames around the moment, replies that came later: "
        f"{back}; in the whole file {e.bus.lost_frames} and {e.bus.old_replies}",
        *facts,
    )


def _is_burst(run: BadCycles) -> bool:
    """Whether no SubDevice answered in a run of cycles."""
    return run.least == 0 and run.expected > 0


def _goes_on(e: IncidentEvidence, run: BadCycles) -> bool:
    """Whether a run of cycles lasts to the end of the file."""
    return e.bus.open_short and run is e.bus.short[-1]


def _in_the_whole_file(e: IncidentEvidence) -> str:
    everywhere = [r for r in e.bus.short if _is_burst(r)]
    if not everywhere:
        return ""
    longest = max(r.length_ns for r in everywhere)
    return f"in the whole file {counted(len(everywhere), 'burst')}, the longest {ms(longest)}"


def _lost_score(missing_ns: int, watchdog_ns: int, cycle_ns: int) -> int:
    if missing_ns >= watchdog_ns // 4:
        return 84
    return 60 if missing_ns >= 2 * cycle_ns else 30


def _cycle(e: IncidentEvidence) -> Iterator[Candidate]:
    """Late cycles."""
    start, end = e.window_ns
    slow = [s for s in e.bus.slow_between(start, end) if s.extra_ns >= 2 * _TENTH_MS]
    # In a recording with many gaps, each cycle after a gap looks late.
    if not slow or e.bus.missed > e.bus.cycles // 20:
        return
    watchdog = e.watchdog_ns or 100_000_000
    worst = max(slow)
    total = sum(s.extra_ns for s in slow)
    facts = [
        f"cycle {worst.cycle} came {ms(worst.extra_ns)} late, "
        f"{ms(abs(e.moment_ns - worst.now_ns))} before the moment; the bus cycle is "
        f"{ms(e.bus.cycle_ns)}",
        f"{counted(len(slow), 'late cycle')} in the {ms(end - start)} before the moment, "
        f"{ms(total)} in all; "
        f"the watchdog is {ms(watchdog)}",
        *_scheduling(e),
    ]
    # One long pause has another cause than many short ones.
    if worst.extra_ns >= watchdog // 3 and 2 * worst.extra_ns > total:
        several = e.stopped()
        facts.append(
            f"{counted(len(several), 'connection')} are affected" if len(several) > 1 else ""
        )
        yield candidate(e, "stalled_main_device", 93, *facts)
    elif len(slow) >= 3:
        yield candidate(e, "cycle_overruns", 86 if total >= watchdog // 4 else 45, *facts)
    elif e.code == _WATCHDOG:
        yield candidate(e, "cycle_overruns", 35, *facts)


def _foreign(e: IncidentEvidence) -> Iterator[Candidate]:
    """Frames of other senders."""
    start, end = e.window_ns
    # More answers than SubDevices: another MainDevice sends on this bus.
    much = [r for r in e.bus.short_between(start, end) if r.least > r.expected > 0]
    # A late frame is first counted as lost, and as an old reply when it arrives.
    old = max(0, e.bus.old_replies - e.bus.lost_frames)
    if not much and old < 2:
        return
    yield candidate(
        e,
        "foreign_frames",
        90 if much else 82,
        f"the working counter was {much[0].least}, more than the {much[0].expected} there can be"
        if much
        else "",
        f"{old} replies did not belong to their cycle" if old else "",
        f"the connection was reset with {code_text(e.code)}" if e.code is not None else "",
    )
