"""Causes visible at the FSoE ends: reset codes, answer times, FailSafeData."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from fsoe_net.core.bus_documents import PlannedConnection
from fsoe_net.diag.words import counted
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict
from fsoe_net.fsoe.pdu import Command, ResetCode, command_text
from fsoe_net.incident.candidate import Candidate, candidate, code_text, ms
from fsoe_net.incident.evidence import IncidentEvidence
from fsoe_net.incident.evidence_frames import LinkFacts, ResetSeen
from fsoe_net.incident.incident import TriggerKind

_SUB, _MAIN = 1, 0
_DATA_COMMANDS = (Command.PROCESS_DATA, Command.FAIL_SAFE_DATA)
_PARAMETER_CODES = range(ResetCode.COMM_PARAMETER_LENGTH, ResetCode.APP_PARAMETER + 1)


def reported_codes(e: IncidentEvidence) -> Counter[tuple[str, int]]:
    """Return ends and their reset codes: at the moment, or all if it never reached Data."""
    codes: Counter[tuple[str, int]] = Counter()
    # If it was in Data, earlier resets belong to other incidents.
    if e.left_data:
        if e.code is not None and e.by:
            codes[e.by, e.code] = 1
        return codes
    for reset in e.link.resets if e.link else ():
        # The initial Reset of a main and the answer to a Reset are not evidence.
        if reset.code != ResetCode.LOCAL:
            codes[reset.by, reset.code] += 1
    return codes


def end_causes(e: IncidentEvidence) -> Iterator[Candidate]:
    """Yield the matching causes in the ends."""
    link = e.link
    if link is None or e.head.trigger.kind is TriggerKind.BUS_FAILED:
        return
    codes = reported_codes(e)
    yield from _parameters(e, codes)
    yield from _silence(e, link)
    if e.left_data:
        yield from _local(e)
        yield from _forgot(e)
        yield from _crc(e, link)
    yield from _watchdog(e, link, codes)
    yield from _failsafe(e, link)


def _parameters(e: IncidentEvidence, codes: Counter[tuple[str, int]]) -> Iterator[Candidate]:
    for (by, code), times in codes.items():
        # Codes about parameters come from the SubInstance, which receives them.
        if by != "sub" or not (code in _PARAMETER_CODES or code >= 0x80):
            continue
        link, plan = e.link, e.plan
        sent = link.sent_watchdog_ms if link else None
        # The watchdog on the wire compared with the plan: the safety project may be another
        # version.
        planned = plan.watchdog_ms if plan else None
        differs = sent is not None and planned is not None and sent != planned
        yield candidate(
            e,
            "parameters_refused",
            94 if code in _PARAMETER_CODES else 80,
            f"{plan.sub if plan else 'the sub'} reset {counted(times, 'time')} with "
            f"{code_text(code)}",
            f"the main sends a watchdog of {sent} ms and "
            f"{link.sent_app_bytes} bytes of application parameters"
            if link and sent is not None
            else "",
            f"the configuration has a watchdog of {planned} ms" if differs else "",
        )


def _silence(e: IncidentEvidence, link: LinkFacts) -> Iterator[Candidate]:
    """One end has never sent a frame, or has stopped."""
    plan = e.plan
    if plan is None or not e.never:
        return
    main, sub = link.sides
    device = e.subdevice(plan.main)
    # A device that does not answer at all is handled by the causes on the bus.
    if not main.not_zero and not (device and not device.answers):
        own = e.links_of(plan.main)
        # All connections of a MainInstance without a frame: its safety program is not running.
        is_alone = len(own) < 2 or any(other.sides[_MAIN].not_zero for other in own)
        all_of = f"so it is for all {counted(len(own), 'connection')} of {plan.main}"
        yield candidate(
            e,
            "main_not_running",
            93,
            f"the frame of {plan.main} for {e.name} is all zero in every cycle",
            "" if is_alone else all_of,
            f"{plan.main} is in {device.al}" if device and device.known else "",
        )
    elif main.frames and not sub.not_zero:
        commands = ", ".join(f"{command_text(c)} {n}x" for c, n in main.commands.most_common(3))
        yield candidate(
            e,
            "sub_silent",
            72,
            f"{plan.main} sends ({commands})",
            f"the frame of {plan.sub} is all zero in every cycle",
        )


def _local(e: IncidentEvidence) -> Iterator[Candidate]:
    """Reset with code 0 in Data."""
    plan = e.plan
    if plan is None or e.code != ResetCode.LOCAL:
        return
    own, by_main = e.links_of(plan.main), e.by == "main"
    device = plan.main if by_main else plan.sub
    said = f"{device} reset with code 0, all frames before were right"
    # All connections of one MainInstance at once: the device itself has restarted.
    if by_main and len(own) > 1 and all(_reset_by_main(e, link) for link in own):
        all_of = (
            f"all {counted(len(own), 'connection')} of {plan.main} were reset with code 0 together"
        )
        yield candidate(e, "main_restarted", 86, said, all_of)
        yield candidate(e, "local_reset", 40, said, device=device)
    else:
        others = counted(len(own) - 1, "connection")
        rest = f"go on: the other {others} of {plan.main}" if len(own) > 1 else ""
        yield candidate(e, "local_reset", 78, said, rest, device=device)
        # With a single connection, both causes look the same.
        if by_main and len(own) == 1:
            yield candidate(e, "main_restarted", 60, said)


def _reset_by_main(e: IncidentEvidence, link: LinkFacts) -> bool:
    """Whether the MainInstance reset a connection with code 0 at the moment."""
    # At least 50 ms: several connections of one device are not reset in the same cycle.
    reset = link.reset_at(e.moment_ns, max(e.watchdog_ns or 0, 50_000_000))
    return reset is not None and reset.by == "main" and reset.code == 0


def _forgot(e: IncidentEvidence) -> Iterator[Candidate]:
    """An end that rejects a data frame in Data has lost the session."""
    reset, plan = e.reset, e.plan
    if reset is None or plan is None or e.code != ResetCode.COMMAND:
        return
    # Only an end that has lost the session rejects a correct data frame.
    if reset.last_right and reset.last_command in _DATA_COMMANDS:
        device = plan.sub if reset.by == "sub" else plan.main
        yield candidate(
            e,
            "device_restarted",
            90,
            f"{device} answered a right {command_text(reset.last_command)} frame in Data with "
            "`command not allowed in this state`: it had forgotten the session",
            device=device,
        )


def _crc(e: IncidentEvidence, link: LinkFacts) -> Iterator[Candidate]:
    """Wrong CRC, or invalid frames, while in Data."""
    reset, plan = e.reset, e.plan
    codes = (ResetCode.CRC, ResetCode.UNKNOWN_COMMAND, ResetCode.CONNECTION_ID, ResetCode.COMMAND)
    if reset is None or plan is None or e.code not in codes:
        return
    sender = plan.main if reset.by == "sub" else plan.sub
    victim = plan.sub if reset.by == "sub" else plan.main
    side = link.sides[_MAIN if reset.by == "sub" else _SUB]
    # Torn frames give the same code but have another cause.
    if side.torn:
        return  # the bytes were altered in the image itself: see causes_places
    if reset.last_verdict is CrcVerdict.WRONG and e.code == ResetCode.CRC:
        yield candidate(
            e,
            "frames_damaged",
            88,
            f"the last frame of {sender} before the reset has a wrong CRC where it comes in",
            f"{side.wrong} frames of {sender} with a wrong CRC in this file, {side.right} right",
            device=sender,
        )
    # The frame was correct in the image and copied completely: it was altered afterwards.
    elif reset.last_right and not _was_restart(reset, e.code):
        yield candidate(
            e,
            "second_writer",
            84 if e.code in (ResetCode.CRC, ResetCode.UNKNOWN_COMMAND) else 60,
            f"{victim} reset with {code_text(e.code)}",
            f"the last frame of {sender} was right in the process image, and was copied whole",
        )


def _was_restart(reset: ResetSeen, code: int | None) -> bool:
    return code == ResetCode.COMMAND and reset.last_command in _DATA_COMMANDS


def _watchdog(
    e: IncidentEvidence, link: LinkFacts, codes: Counter[tuple[str, int]]
) -> Iterator[Candidate]:
    """The watchdog expired: find the slow part."""
    watchdog, plan = e.watchdog_ns, e.plan
    times = sum(n for (_, code), n in codes.items() if code == ResetCode.WATCHDOG)
    if not times or watchdog is None or plan is None:
        return
    main, sub = link.sides
    means = [main.waits_mean_ns, sub.waits_mean_ns]
    most = [s.waits_most_ns for s in (main, sub)]
    # The cycle of the path decides, as the buses of both ends may differ.
    cycle = _way_cycle_ns(e, plan)
    round_trip = sum(means)
    facts = [
        f"the watchdog is {ms(watchdog)}, the bus cycle {ms(cycle)}",
        f"answers of {plan.main}: {ms(means[0])} on average, {ms(most[0])} at most; "
        f"of {plan.sub}: {ms(means[1])}, {ms(most[1])}"
        if any(means)
        else "",
    ]
    yield from _slow(e, plan, watchdog, means, most, facts)
    # Even without a slow device, such a watchdog expires occasionally.
    if watchdog <= 4 * cycle or (round_trip and watchdog <= 2 * round_trip):
        yield _tight(e, link, facts, is_quick=max(means) <= 4 * cycle)
    elif e.left_data and e.reset is not None:
        yield from _fell_silent(e, plan, e.reset, facts)


def _way_cycle_ns(e: IncidentEvidence, plan: PlannedConnection) -> int:
    """Return the longest bus cycle between both ends: a slow bus is not a slow device."""
    return max(plan.cycle_ns or e.bus.cycle_ns, 1)


def _tight(e: IncidentEvidence, link: LinkFacts, facts: list[str], *, is_quick: bool) -> Candidate:
    """The watchdog is too short; this is more likely if both ends were fast."""
    if not is_quick:
        return candidate(e, "watchdog_tight", 50, *facts)
    if not all(side.linked for side in link.sides):
        return candidate(e, "watchdog_tight", 75, *facts)
    return candidate(e, "watchdog_tight", 89, *facts, "both ends answer within a few cycles")


def _slow(
    e: IncidentEvidence,
    plan: PlannedConnection,
    watchdog: int,
    means: list[float],
    most: list[int],
    facts: list[str],
) -> Iterator[Candidate]:
    cycle = _way_cycle_ns(e, plan)
    calm = not (e.bus.short or e.bus.lost or e.bus.late_cycles)
    for end, device in ((_MAIN, plan.main), (_SUB, plan.sub)):
        mean, other = means[end], means[1 - end]
        # Slow on average, compared with the other end: a single delay is not sufficient.
        slow = mean > 4 * cycle and mean >= watchdog * 0.2 and mean >= 2 * other
        # A single long answer counts only on a quiet bus; otherwise frames were lost.
        uneven = calm and most[end] >= watchdog * 0.6 and most[end] >= 3 * most[1 - end]
        if slow or uneven:
            yield candidate(e, "slow_device", 87 if slow else 66, *facts, device=device)


def _fell_silent(
    e: IncidentEvidence, plan: PlannedConnection, reset: ResetSeen, facts: list[str]
) -> Iterator[Candidate]:
    """The end that had to answer stopped, although its bus interface continued."""
    device = plan.sub if reset.waiting_for == "sub" else plan.main
    seen = e.subdevice(device)
    start, end = e.window_ns
    quiet_bus = not e.bus.short_between(start, end) and not e.bus.lost_between(start, end)
    # Losses on the bus already explain the silence.
    if not quiet_bus or (seen and not seen.answers):
        return
    silent = ms(max(reset.silent_ns))
    yield candidate(
        e,
        "end_silent",
        64,
        f"it was the turn of {device}, which said nothing new for {silent}",
        "its process data came with a complete working counter all the time",
        *facts,
        device=device,
    )


def _failsafe(e: IncidentEvidence, link: LinkFacts) -> Iterator[Candidate]:
    """In Data, but one end sends only FailSafeData."""
    plan = e.plan
    if plan is None or link.state is not ConnectionState.DATA_FAILSAFE or e.left_data:
        return
    length = max(e.bus.last_ns - e.bus.first_ns, 1)
    ends = ((_MAIN, plan.main), (_SUB, plan.sub))
    for end, device in ends:
        spent = link.time_in_failsafe_ns[end]
        # FailSafeData for a moment is normal at the start of Data.
        if spent < length // 20:
            continue
        # If both send it, neither is identified as the cause.
        both = all(link.time_in_failsafe_ns[n] >= length // 20 for n, _ in ends)
        yield candidate(
            e,
            "failsafe",
            90 if end == _MAIN else 84,
            f"{device} has sent FailSafeData for {ms(spent)} of {ms(length)}",
            "both ends do" if both else "the other end sends ProcessData",
            "all frames of both directions have right CRCs"
            if not link.sides[0].wrong + link.sides[1].wrong
            else "",
            device=device,
        )
        return
