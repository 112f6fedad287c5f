"""FSN431 … FSN447: a network compared with other files that describe the same devices or bus.

One cause is one finding: consequences of another device, position or process data are not reported
again for copies and connections. A fact missing in a file is not a difference.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from fsoe_net.compare.reference_copies import check_copies, check_slots
from fsoe_net.compare.reference_layout import Remark, compare_layout
from fsoe_net.compare.reference_twinsafe import check_twinsafe
from fsoe_net.compare.scan_match import (
    Identity,
    Match,
    first_master,
    identity_of,
    is_same,
    match_subdevices,
    place_of,
)
from fsoe_net.diag.diagnostic import (
    Diagnostic,
    FindingList,
    Related,
    Severity,
    Span,
    sort_diagnostics,
)
from fsoe_net.diag.words import counted, identity_text
from fsoe_net.model.bus import Device, SubDevice
from fsoe_net.model.description import DescribedSubDevice, Description
from fsoe_net.model.joined_descriptions import has_layout
from fsoe_net.model.library import Library
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.scan import ScannedSm, ScannedSubDevice
from fsoe_net.proposal.safety_project import projects_of
from fsoe_net.rules.context import few

_TYPES = frozenset({"esi", "sii"})
_WHOLE = frozenset(
    {"eni", "twincat", "ethercat-slaves", "ethercat-slaves-v", "lcec", "soem-slaveinfo"}
)
_SETUP = frozenset({"eni", "ethercat-config"})
_BLAMED = frozenset({"FSN401", "FSN402", "FSN403", "FSN404", "FSN407", "FSN409", "FSN410"})
_BLAMED |= {"FSN412", "FSN413"}
_MOST_PLACES = 65_536
_WITH_PROJECT = "twincat"  # a bus that includes its safety project

_Pair = tuple[SubDevice, int]


def check_references(
    resolution: Resolution,
    references: Sequence[Description],
    *,
    library: Library,
    found: Iterable[Diagnostic] = (),
) -> list[Diagnostic]:
    """Return each difference between a network and other files, sorted by place.

    Args:
        resolution: The network, resolved.
        references: Content of the other files.
        library: Identity of devices for which a file has only the order number.
        found: Findings so far; a device whose file has an error in its process data is not
            compared.
    """
    out = FindingList()
    broken = {d.span.file for d in found if d.code in _BLAMED}
    for reference in references:
        _Check(resolution, reference, library, broken, out).run()
    return sort_diagnostics(out.diagnostics)


@dataclass(slots=True)
class _Check:
    """One file compared with the network."""

    resolution: Resolution
    file: Description
    library: Library
    broken: set[str]
    out: FindingList
    blamed: set[str] = field(default_factory=set)
    guessed: str = ""
    # Keyed by the content of both sides, so that a hundred equal terminals are compared once.
    compared: dict[tuple[object, ...], list[Remark]] = field(default_factory=dict)
    remarks: dict[tuple[str, Span, str], tuple[Remark, list[str]]] = field(default_factory=dict)
    identities: list[Identity | None] = field(init=False)  # one per row of the file

    def __post_init__(self) -> None:
        self.identities = [self._identity(row) for row in self.file.subdevices]

    def run(self) -> None:
        """Add all findings."""
        if self.file.format == "twinsafe":
            check_twinsafe(self.out, self.resolution, self.file, self.library)
            return
        rows = self.file.subdevices
        if not any(s.device is not None for s in self.network.subdevices):
            return
        if self.is_type or all(r.position is None and not r.alias for r in rows):
            pairs = self._types()
        else:
            pairs = self._bus()
        if pairs is None:
            return
        for sub, number in pairs:
            row = rows[number]
            self._revision(sub, row)
            if sub.device is not None:
                self._layout(sub, sub.device, row)
        self._say()
        self._cycle()
        by_row = {number: sub for sub, number in pairs}
        check_copies(self.out, self.resolution, self.file, by_row, self.blamed)
        check_slots(self.out, self.resolution, self.file, by_row, self.blamed)
        if self.file.format == _WITH_PROJECT:
            for project in projects_of(self.file):
                check_twinsafe(self.out, self.resolution, project, self.library, slots=False)

    @property
    def network(self) -> NetworkConfig:
        """The network."""
        return self.resolution.network

    @property
    def is_type(self) -> bool:
        """Whether the file describes device types."""
        return self.file.format in _TYPES

    def _identity(self, row: DescribedSubDevice) -> Identity | None:
        """Return vendor and product of a row; by its order number if the file has nothing else."""
        device = row.device
        if all(device.identity):
            return device.identity
        known = self.library.named(row.order) if row.order else None
        for item in known.identities if known is not None else ():
            if item.order.casefold() == row.order.casefold():
                return item.vendor_id, item.product_code
        return None

    # -- which SubDevice is which -----------------------------------------------------------------

    def _nothing(self, why: str, hint: str, severity: Severity | None = None) -> None:
        self.out.add(
            "FSN443",
            self.network.span,
            f"no SubDevice of this network is in {self.file.path}{why}",
            hint=hint,
            severity=severity,
        )

    def _types(self) -> list[_Pair] | None:
        """Pair by identity; the exact revision first, as in `convert`."""
        rows: dict[Identity | None, list[int]] = {}
        for number, identity in enumerate(self.identities):
            rows.setdefault(identity, []).append(number)
        pairs = []
        for sub in self.network.subdevices:
            identity = identity_of(sub)
            same = rows.get(identity, []) if identity is not None else []
            exact = [n for n in same if self.file.subdevices[n].revision == sub.revision]
            if same:
                pairs.append((sub, (exact or same)[0]))
        pairs = pairs or self._lone()
        if pairs:
            return pairs
        if self.is_type:
            hint = "nothing of it was compared; leave it out, or give the file of these devices"
            self._nothing("", hint, Severity.INFO)
        elif any(self.identities):
            self._nothing("", "is this the output of another machine?")
        else:
            hint = "it names no device: `ethercat cstruct` and `ethercat xml` say which one it is"
            self._nothing(" as far as it states", hint)
        return None

    def _lone(self) -> list[_Pair]:
        """Pair a text without any identity with the only device type that has its PDOs.

        If there is only one device type, that one is used.
        """
        if self.identities != [None]:
            return []
        first = enumerate(self.resolution.device_numbers)
        subs = [self.network.subdevices[n] for n, number in first if n == number]
        devices = [(s, s.device) for s in subs if s.device is not None]
        if len(devices) > 1:
            numbers = _numbers(self.file.subdevices[0].device)
            devices = [row for row in devices if _numbers(row[1]) == numbers]
            self.guessed = " (which names no device; its PDO numbers are those of this one)"
        return [(devices[0][0], 0)] if len(devices) == 1 else []

    def _bus(self) -> list[_Pair] | None:
        known = set(self.identities) - {None}
        if known.isdisjoint(map(identity_of, self.network.subdevices)) and known:
            what = counted(len(self.identities), "SubDevice")
            self._nothing(f", which has {what}", "is this the file of another machine?")
            return None
        if self.network.partial:
            first: dict[Identity | None, int] = {}
            first |= {k: n for n, k in reversed([*enumerate(self.identities)]) if k is not None}
            pairs = ((s, first.get(identity_of(s))) for s in self.network.subdevices)
            return [(sub, number) for sub, number in pairs if number is not None]
        if self.file.format in _WHOLE and not self.file.truncated:
            return self._whole()
        return self._by_place()

    def _by_place(self) -> list[_Pair]:
        """Pair by position, for files that name only some SubDevices."""
        places: dict[tuple[int, int], int] = {}
        for number, row in enumerate(self.file.subdevices):
            if row.alias:
                places.setdefault((row.alias, 0), number)
            if row.position is not None:
                places.setdefault((0, row.position), number)
        pairs = []
        for sub in first_master(self.network):
            at = places.get((sub.alias, sub.position))
            if at is not None and is_same(identity_of(sub), self.identities[at]):
                pairs.append((sub, at))
            elif at is not None:
                self._other(sub, at)
        return pairs

    def _whole(self) -> list[_Pair]:
        """Pair all SubDevices of a bus, and report missing, moved and different devices."""
        rows = self.file.subdevices
        numbers: dict[int, int] = {}
        for number, row in enumerate(rows):
            if row.position is not None and row.position < _MOST_PLACES:
                numbers.setdefault(row.position, number)
        subs = first_master(self.network)
        if not any(r.alias for r in rows):
            subs = [s for s in subs if not s.alias]  # the file does not state aliases
        bus = [
            self._as_scanned(place, numbers.get(place))
            for place in range(max(numbers, default=-1) + 1)
        ]
        match = match_subdevices(subs, bus, {})
        for sub, there in match.other:
            self._other(sub, numbers[there.position])
        self._places(match, numbers)
        return [
            (sub, numbers[there.position])
            for sub, there in match.pairs
            if there.position in numbers
        ]

    def _as_scanned(self, place: int, number: int | None) -> ScannedSubDevice:
        """Return a row as a scan would; a position that the file leaves out is unknown."""
        if number is None:
            return ScannedSubDevice(position=place)
        row, identity = self.file.subdevices[number], self.identities[number]
        vendor_id, product_code = identity or (None, None)
        return ScannedSubDevice(
            position=place,
            alias=row.alias,
            vendor_id=vendor_id,
            product_code=product_code,
            name=row.name or row.order,
            # The match only needs to know whether there are process data, not how many.
            sms=tuple(
                ScannedSm(index=sm, kind="outputs", size_bytes=1) for sm in _numbers(row.device)
            ),
        )

    def _places(self, match: Match, numbers: dict[int, int]) -> None:
        for one, at_one, two, at_two in match.swapped:
            self._moved(
                one,
                f"{one.name} and {two.name} are exchanged: {one.name} is at position "
                f"{at_one.position}, {two.name} at position {at_two.position} in {self.file.path}",
                numbers.get(at_one.position),
            )
            self.blamed.add(two.name)
        for sub, at, found in match.moved:
            self._moved(
                sub,
                f"{sub.name} is at position {at}, at position {found.position} in {self.file.path}",
                numbers.get(found.position),
            )
        rows = zip(self.identities, self.file.subdevices, strict=True)
        free = {identity for identity, row in rows if row.position is None} - {None}
        for sub, _ in match.missing:
            if identity_of(sub) in free:
                continue  # in a group that may be absent
            self._moved(sub, f"{sub.name} is not in {self.file.path}", None)
        extra = [s.name or s.identity for s in match.extra if s.position in numbers]
        if extra:
            self.out.add(
                "FSN442",
                self.network.span,
                f"{self.file.path} has {counted(len(extra), 'SubDevice')} that the network does "
                f"not name: {few(extra)}",
                hint="name them here when they have process data in the same ring",
                severity=Severity.INFO,
                related=(Related(span=self.file.span, message="described here"),),
            )

    def _moved(self, sub: SubDevice, text: str, number: int | None) -> None:
        self.blamed.add(sub.name)
        there = self.file.span if number is None else self.file.subdevices[number].span
        self.out.add(
            "FSN442",
            place_of(sub),
            text,
            hint="correct the place here, or make the other file again; `ethercat slaves` and "
            "`fsoe-net scan` report what is there",
            severity=None if sub.required else Severity.INFO,
            related=(Related(span=there, message="the other file"),),
        )

    def _other(self, sub: SubDevice, number: int) -> None:
        self.blamed.add(sub.name)
        row = self.file.subdevices[number]
        own, there = (
            "" if known is None else identity_text(*known)
            for known in (identity_of(sub), self.identities[number])
        )
        name = (row.name or row.order)[:60]
        place = f"alias {sub.alias}" if sub.alias else f"position {sub.position}"
        self.out.add(
            "FSN431",
            place_of(sub),
            f"{sub.name} at {place} is {own}, {name}{', ' if name else ''}{there} in "
            f"{self.file.path}",
            hint="one of the two files is of another machine or an older state; compare with the "
            "label of the device",
            related=(Related(span=row.span, message="the device there"),),
        )

    # -- one SubDevice ----------------------------------------------------------------------------

    def _revision(self, sub: SubDevice, row: DescribedSubDevice) -> None:
        if None in (sub.revision, row.revision) or sub.revision == row.revision:
            return
        chosen = "; it is compared with that one" if self.is_type else ""
        self.out.add(
            "FSN432",
            sub.at("revision"),
            f"{sub.name} has revision 0x{sub.revision or 0:08x}, 0x{row.revision or 0:08x} in "
            f"{self.file.path}{chosen}",
            hint="was the device exchanged, or is the file older? take the file of this revision",
            related=(Related(span=row.span, message="the other revision"),),
        )

    def _layout(self, sub: SubDevice, device: Device, row: DescribedSubDevice) -> None:
        if device.path in self.broken or not has_layout(device):
            return
        source = self.file.path + self.guessed
        if self.is_type and sub.revision is None and row.revision is not None:
            source += f" (revision 0x{row.revision:08x})"
        facts = row.facts
        key = (
            device,
            source,
            row.device,
            row.available,
            row.truncated,
            (facts.pdos, facts.assignable, facts.modular, tuple(facts.default_bytes.items())),
        )
        remarks = self.compared.get(key)
        if remarks is None:
            remarks = self.compared[key] = compare_layout(
                device,
                row,
                source=source,
                is_type=self.is_type,
                is_setup=self.file.format in _SETUP,
            )
        for remark in remarks:
            known = self.remarks.setdefault((remark.code, remark.span, remark.text), (remark, []))
            known[1].append(sub.name)
            # A note about DefaultSize does not make the copies doubtful.
            if remark.code != "FSN441":
                self.blamed.add(sub.name)

    def _say(self) -> None:
        """Add the remarks, once for all SubDevices of one type."""
        for remark, names in self.remarks.values():
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            self.out.add(
                remark.code,
                remark.span,
                f"{names[0]}{more}: {remark.text}",
                hint=remark.hint,
                severity=remark.severity,
                related=(Related(span=remark.there, message="the other file"),),
            )

    def _cycle(self) -> None:
        own, other = self.network.cycle_ns, self.file.cycle_us
        if own is None or not other or own == 1000 * other:
            return
        self.out.add(
            "FSN445",
            self.network.at("cycle_us"),
            f"the bus cycle is {own / 1000:g} us, {other} us in {self.file.path}",
            hint="FSoE watchdogs are chosen for one cycle time; say the one the bus runs with",
            related=(Related(span=self.file.span, message="the other file"),),
        )


def _numbers(device: Device) -> dict[int, list[int]]:
    """Return the PDO numbers by sync manager."""
    rows = {sm.index: [p.index for p in device.pdos_of(sm)] for sm in device.sync_managers}
    return {sm: numbers for sm, numbers in rows.items() if numbers}
