"""FSN505, FSN506, FSN507, FSN511, FSN512, FSN514: a SubDevice compared with its file."""

from __future__ import annotations

from fsoe_net.diag.diagnostic import FindingList, Span
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import Direction, Pdo, SubDevice
from fsoe_net.model.layout import SmLayout
from fsoe_net.model.scan import ScannedPdo, ScannedSm, ScannedSubDevice
from fsoe_net.rules.context import ACCEPTED, SECURED, few
from fsoe_net.rules.entries import assignment_words, first_difference, listed

_SCAN = "`fsoe-net scan --interface IF -o DIR` writes the files of what is there"


def check_revision(out: FindingList, sub: SubDevice, found: ScannedSubDevice) -> None:
    """FSN505."""
    if sub.revision is None or found.revision is None or sub.revision == found.revision:
        return
    out.add(
        "FSN505",
        sub.at("revision"),
        f"{sub.name}: revision 0x{found.revision:08x} at position {found.position}, the network "
        f"states 0x{sub.revision:08x}",
        hint="was the device exchanged or its firmware updated? If its manual states that the two "
        f"are compatible, write the new revision here{ACCEPTED}",
    )


def check_health(out: FindingList, span: Span, name: str, found: ScannedSubDevice) -> None:
    """FSN511, FSN512, FSN514: error state, lost links, unreadable data."""
    if found.in_error:
        out.add(
            "FSN511",
            span,
            f"{name} (position {found.position}) is in {found.al or 'a state'} with an error: "
            f"{found.al_error}",
            hint="a start of the bus acknowledges it; when it returns, `fsoe-net run` names the "
            "cause",
        )
    for port in found.ports:
        counts = [
            text
            for number, text in (
                (port.link_lost, counted(port.link_lost, "lost link")),
                (port.rx_errors, counted(port.rx_errors, "receive error")),
            )
            if number
        ]
        if counts:
            out.add(
                "FSN512",
                span,
                f"{name} (position {found.position}), port {port.port}: {' and '.join(counts)} "
                "since it was switched on",
                hint=f"{SECURED}look at cable and plug of this port; the counters start again at "
                "power-up",
            )
    if found.problems and not found.is_silent:
        out.add(
            "FSN514",
            span,
            f"{name} (position {found.position}) was not read completely: "
            f"{few(list(found.problems), 3)}",
            hint="what was not read was not compared",
        )


def check_layout(out: FindingList, sub: SubDevice, found: ScannedSubDevice) -> None:
    """FSN506, FSN507: PDO assignment, mapping and length of each sync manager."""
    device = sub.device
    if found.sms is None or device is None:
        return
    there = {sm.index: sm for sm in found.sms}
    for planned in device.layout.managers:
        if planned.sm.carries is None or not device.pdos_of(planned.sm):
            continue
        sm = there.pop(planned.sm.index, None)
        if sm is not None and not sm.complete:
            continue  # reported by FSN514
        if sm is None:
            _add_length(out, sub, planned, found, "the device has no such sync manager")
        else:
            _sync_manager(out, sub, found, planned, device.pdos_of(planned.sm), sm)
    for sm in there.values():
        if sm.is_process_data and sm.size_bytes and sm.complete:
            out.add(
                "FSN507",
                device.at("sm"),
                f"{sub.name}: SM{sm.index} has {counted(sm.size_bytes, 'byte')} of {sm.kind} on "
                "the device and none in the file",
                hint=f"state what it carries, or leave it empty on the device; {_SCAN}",
            )


def _add_length(
    out: FindingList, sub: SubDevice, planned: SmLayout, found: ScannedSubDevice, why: str
) -> None:
    out.add(
        "FSN507",
        planned.sm.span if planned.sm.declared or sub.device is None else sub.device.span,
        f"{sub.name}: SM{planned.sm.index} has {counted(planned.size_bytes, 'byte')} by the file; "
        f"on the device at position {found.position} {why}",
        hint=f"the file must describe what the device has; {_SCAN}",
    )


def _sync_manager(
    out: FindingList,
    sub: SubDevice,
    found: ScannedSubDevice,
    planned: SmLayout,
    pdos: tuple[Pdo, ...],
    sm: ScannedSm,
) -> None:
    way = "outputs" if planned.sm.direction is Direction.OUTPUT else "inputs"
    if sm.kind != way:
        _add_length(out, sub, planned, found, f"it is for {sm.kind.replace('_', ' ')}")
        return
    if sm.pdos is not None and _pdos_differ(out, sub, planned, pdos, sm.pdos):
        return
    if planned.complete and sm.size_bytes is not None and sm.size_bytes != planned.size_bytes:
        _add_length(out, sub, planned, found, f"{counted(sm.size_bytes, 'byte')}")


def _pdos_differ(
    out: FindingList,
    sub: SubDevice,
    planned: SmLayout,
    pdos: tuple[Pdo, ...],
    found: tuple[ScannedPdo, ...],
) -> bool:
    """Add a finding for another assignment, else one per PDO with another mapping."""
    ours, theirs = [p.index for p in pdos], [p.index for p in found]
    fixed = "the MainDevice writes it at the start; a device whose PDOs are fixed refuses that"
    if ours != theirs:
        out.add(
            "FSN506",
            pdos[0].span,
            f"{sub.name}: SM{planned.sm.index} carries {listed(ours)} by the file, "
            f"{listed(theirs)} on the device" + assignment_words(ours, theirs),
            hint=f"{fixed}; {_SCAN}",
        )
        return True
    different = False
    for pdo, there in zip(pdos, found, strict=True):
        if not pdo.entries or there.entries is None:
            continue
        first = first_difference(pdo, there.entries)
        if first is None:
            continue
        different = True
        number, span, mine, other = first
        out.add(
            "FSN506",
            span,
            f"{sub.name}: entry {number} of PDO 0x{pdo.index:04x} is {mine} in the file, {other} "
            "on the device",
            hint=f"{fixed}; {_SCAN}",
        )
    return different
