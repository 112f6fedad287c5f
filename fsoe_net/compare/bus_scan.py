"""FSN414, FSN501 … FSN515: the bus compared with the files of a network."""

from __future__ import annotations

from dataclasses import dataclass, replace

from fsoe_net.compare.scan_fsoe import check_fsoe_values
from fsoe_net.compare.scan_match import Match, first_master, match_subdevices, place_of
from fsoe_net.diag.diagnostic import (
    Diagnostic,
    FindingList,
    Related,
    Severity,
    Span,
    sort_diagnostics,
)
from fsoe_net.diag.words import counted, identity_text
from fsoe_net.model.bus import Device, Direction, Pdo, SubDevice, SyncManager
from fsoe_net.model.layout import SmLayout
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.scan import Scan, ScannedSm, ScannedSubDevice
from fsoe_net.rules.context import ACCEPTED, SECURED, few
from fsoe_net.rules.entries import assignment_words, first_difference, listed

_SCAN = "`fsoe-net scan --interface IF -o DIR` writes the files of what is there"


def check_scan(resolution: Resolution, scan: Scan) -> list[Diagnostic]:
    """Return each difference between a bus and the files of its network, sorted by place.

    Args:
        resolution: The network, resolved.
        scan: Scan of the bus.
    """
    network, scan = _present(resolution.network, scan)
    out = FindingList()
    addresses = {
        fact.sub: fact.address
        for net in network.nets
        for fact in net.connections
        if fact.address is not None
    }
    match = match_subdevices(first_master(network), scan.subdevices, addresses)
    _aliases(out, network, scan)
    _same_place(out, match)
    _missing(out, network, scan, match)
    _order(out, match)
    _other(out, match)
    _extra(out, network, match)
    for sub, there in match.pairs:
        if there.is_silent:
            _silent(out, sub, there)
        else:
            _check_revision(out, sub, there)
            if sub.device is not None and there.sms is not None:
                _Layout(out, sub, sub.device, there).check()
    _health(out, network, scan, match)
    answering = {sub.name: there for sub, there in match.pairs if not there.is_silent}
    check_fsoe_values(out, network, answering)
    return sort_diagnostics(out.diagnostics)


def _present(network: NetworkConfig, scan: Scan) -> tuple[NetworkConfig, Scan]:
    """Leave out groups whose alias is not on the bus: they may be absent."""
    here = {there.alias for there in scan.subdevices if not there.is_silent}
    aliases = {sub.name: sub.alias for sub in network.subdevices}
    absent = {
        name
        for group in network.groups
        for name in group.subdevices
        if aliases.get(group.subdevices[0]) not in here
    }
    if not absent:
        return network, scan
    # A scan may list an absent SubDevice as silent; those after it are one place further.
    found = (t for t in scan.subdevices if not (t.is_silent and t.planned in absent))
    rows = tuple(replace(there, position=place) for place, there in enumerate(found))
    left = tuple(sub for sub in network.subdevices if sub.name not in absent)
    return replace(network, subdevices=left), replace(scan, subdevices=rows)


def _title(found: ScannedSubDevice) -> str:
    return f"{found.name} ({found.identity})" if found.name else found.identity


def _silent(out: FindingList, sub: SubDevice, there: ScannedSubDevice) -> None:
    out.add(
        "FSN501",
        place_of(sub),
        f"{sub.name} is missing: it was at position {there.position} and no longer answers",
        hint=f"{SECURED}look at its power and at the cable before it; the first silent one is "
        "where it broke",
        severity=None if sub.required else Severity.INFO,
    )


def _missing(out: FindingList, network: NetworkConfig, scan: Scan, match: Match) -> None:
    count = len(scan.subdevices)
    for sub, place in match.missing:
        where = f"position {place}" if place is not None else f"alias {sub.alias}"
        if place is None:
            hint = "no SubDevice has this alias; write it to the device, or address it by position"
        elif count == 0:
            hint = "the bus is empty: is the interface right, the cable in, the power on?"
        elif place >= count:
            last = scan.subdevices[-1]
            hint = f"the bus ends at position {last.position}, {_title(last)}: {SECURED}"
            hint += "look at the cable after it, and at the power of the next"
        else:
            hint = f"all following SubDevices moved one position forward; {SECURED}put it back, "
            hint += f"or take it out here{ACCEPTED}"
        out.add(
            "FSN501",
            place_of(sub),
            f"{sub.name} is missing: no SubDevice on the bus matches it; expected at {where}",
            hint=hint,
            severity=None if sub.required else Severity.INFO,
        )
    for place in match.free_missing:
        following = next(
            (s for s in network.subdevices if not s.alias and s.position > place), None
        )
        out.add(
            "FSN501",
            place_of(following) if following is not None else network.span,
            f"position {place}, which the network leaves free, is missing: all following moved "
            "one place forward",
            hint=f"{SECURED}put the coupler or terminal back, or correct the positions here"
            f"{ACCEPTED}",
        )


def _order(out: FindingList, match: Match) -> None:
    for one, found_one, two, found_two in match.swapped:
        out.add(
            "FSN503",
            place_of(one),
            f"{one.name} and {two.name} are exchanged: {one.name} is at position "
            f"{found_one.position}, {two.name} at position {found_two.position}",
            hint=f"{SECURED}change their places or cables back, or the positions here{ACCEPTED}",
            related=(Related(span=place_of(two), message=f"{two.name} is expected here"),),
        )
    for sub, place, found in match.moved:
        out.add(
            "FSN503",
            place_of(sub),
            f"{sub.name} is at position {found.position}, expected at position {place}",
            hint=f"{SECURED}put it in its place, or correct the positions here{ACCEPTED}",
        )


def _other(out: FindingList, match: Match) -> None:
    for sub, found in match.other:
        device = sub.device
        if device is None:
            continue  # an unknown device matches any other
        expected = identity_text(*device.identity)
        out.add(
            "FSN504",
            place_of(sub),
            f"position {found.position} is {_title(found)}; {sub.name} is {expected}",
            hint=f"{SECURED}put the right device there, or name the file of this one as its config"
            f"{ACCEPTED}",
            related=(Related(span=device.at("product_id"), message="expected by this file"),),
        )


def _extra(out: FindingList, network: NetworkConfig, match: Match) -> None:
    for found in match.extra:
        effect = "it moves all following SubDevices one position back"
        if found.process_data:
            effect = "it has process data that the network does not use"
        out.add(
            "FSN502",
            network.span,
            f"position {found.position} is {_title(found)}, which the network does not name; "
            f"{effect}",
            hint=f"{SECURED}take it off the bus, or add it to the network (`fsoe-net scan -o DIR` "
            f"writes its file){ACCEPTED}",
        )
    for found in match.trailing:
        out.add(
            "FSN502",
            network.span,
            f"position {found.position} is {_title(found)}, after all SubDevices of the network "
            "and without process data",
            severity=Severity.INFO,
            hint="nothing to do",
        )


def _aliases(out: FindingList, network: NetworkConfig, scan: Scan) -> None:
    used = {s.alias: s for s in network.subdevices if s.alias}
    for alias, sub in used.items():
        places = [str(f.position) for f in scan.subdevices if f.alias == alias]
        if len(places) > 1:
            out.add(
                "FSN515",
                sub.at("alias"),
                f"alias {alias} is held by the SubDevices at positions {', '.join(places)}; "
                f"{sub.name} was looked for from the first",
                hint="give each its own; the new one counts after power is off and on",
            )


def _same_place(out: FindingList, match: Match) -> None:
    """FSN414, visible only on the bus: one SubDevice named by its alias and by its position."""
    first: dict[int, SubDevice] = {}
    # SubDevices without an alias come first, so that the finding is where the alias is given.
    for sub, found in sorted((*match.pairs, *match.other), key=lambda row: row[0].alias):
        there = first.setdefault(found.position, sub)
        if there is sub:
            continue
        out.add(
            "FSN414",
            place_of(sub),
            f"{sub.name} (alias {sub.alias}, position {sub.position}) and {there.name} are the "
            f"same SubDevice, at position {found.position} of this bus; it would be configured "
            "twice",
            hint="keep one of them",
            related=(Related(span=place_of(there), message=f"{there.name} is found here too"),),
        )


def _health(out: FindingList, network: NetworkConfig, scan: Scan, match: Match) -> None:
    subs = {there.position: sub for sub, there in match.pairs}
    for there in scan.subdevices:
        sub = subs.get(there.position)
        if sub is None:
            _check_health(out, network.span, there.name or "a SubDevice", there)
        else:
            _check_health(out, place_of(sub), sub.name, there)


# -- one SubDevice --------------------------------------------------------------------------------


def _check_revision(out: FindingList, sub: SubDevice, found: ScannedSubDevice) -> None:
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


def _check_health(out: FindingList, span: Span, name: str, found: ScannedSubDevice) -> None:
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
        both = (port.link_lost, "lost link"), (port.rx_errors, "receive error")
        counts = [counted(number, word) for number, word in both if number]
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


@dataclass(frozen=True, slots=True)
class _Layout:
    """FSN506, FSN507: PDO assignment, mapping and length of each sync manager."""

    out: FindingList
    sub: SubDevice
    device: Device
    found: ScannedSubDevice

    def check(self) -> None:
        """Compare all sync managers with process data."""
        there = {sm.index: sm for sm in self.found.sms or ()}
        for planned in self.device.layout.managers:
            if planned.sm.carries is None or not self.device.pdos_of(planned.sm):
                continue
            sm = there.pop(planned.sm.index, None)
            if sm is None:
                self._add_length(planned, "the device has no such sync manager")
            elif sm.complete:  # an incomplete one is reported by FSN514
                self._sync_manager(planned, sm)
        for sm in there.values():
            if sm.is_process_data and sm.size_bytes and sm.complete:
                self.out.add(
                    "FSN507",
                    self.device.at("sm"),
                    f"{self.sub.name}: SM{sm.index} has {counted(sm.size_bytes, 'byte')} of "
                    f"{sm.kind} on the device and none in the file",
                    hint=f"state what it carries, or leave it empty on the device; {_SCAN}",
                )

    def _sync_manager(self, planned: SmLayout, sm: ScannedSm) -> None:
        way = "outputs" if planned.sm.direction is Direction.OUTPUT else "inputs"
        size = sm.size_bytes
        if sm.kind != way:
            self._add_length(planned, f"it is for {sm.kind.replace('_', ' ')}")
        elif sm.pdos is not None and self._pdos_differ(planned.sm, sm.pdos):
            return  # the length differs as a consequence
        elif planned.complete and size is not None and size != planned.size_bytes:
            self._add_length(planned, counted(size, "byte"))

    def _add_length(self, planned: SmLayout, why: str) -> None:
        self.out.add(
            "FSN507",
            planned.sm.span if planned.sm.declared else self.device.span,
            f"{self.sub.name}: SM{planned.sm.index} has {counted(planned.size_bytes, 'byte')} by "
            f"the file; on the device at position {self.found.position} {why}",
            hint=f"the file must describe what the device has; {_SCAN}",
        )

    def _pdos_differ(self, sm: SyncManager, found: tuple[Pdo, ...]) -> bool:
        """Add a finding for another assignment, otherwise one per PDO with another mapping."""
        pdos = self.device.pdos_of(sm)
        ours, theirs = [p.index for p in pdos], [p.index for p in found]
        if ours != theirs:
            text = f"SM{sm.index} carries {listed(ours)} by the file, {listed(theirs)} on the "
            self._add_pdo(pdos[0].span, f"{text}device{assignment_words(ours, theirs)}")
            return True
        different = False
        for pdo, there in zip(pdos, found, strict=True):
            is_known = pdo.entries and there.is_read
            first = first_difference(pdo, there.entries) if is_known else None
            if first is None:
                continue
            different = True
            number, span, mine, other = first
            text = f"entry {number} of PDO 0x{pdo.index:04x} is {mine} in the file, {other} on the "
            self._add_pdo(span, f"{text}device")
        return different

    def _add_pdo(self, span: Span, text: str) -> None:
        self.out.add(
            "FSN506",
            span,
            f"{self.sub.name}: {text}",
            hint="the MainDevice writes it at the start; a device whose PDOs are fixed refuses "
            f"that; {_SCAN}",
        )
