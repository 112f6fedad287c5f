"""All content of an incident file in one pass, as evidence for causes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace

from fsoe_net.core.bus_documents import (
    Found,
    LayoutCopy,
    PlannedConnection,
    SubDeviceSnapshot,
)
from fsoe_net.core.json_object import clean
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.incident.evidence_cycles import BusFacts, BusWatch
from fsoe_net.incident.evidence_frames import (
    LinkFacts,
    LinkWatch,
    PairWatch,
    ResetSeen,
)
from fsoe_net.incident.incident import (
    FsoeFacts,
    FsoeSetting,
    IncidentEvent,
    IncidentHead,
    TriggerKind,
)
from fsoe_net.incident.incident_read import IncidentReader
from fsoe_net.plan.model import NONE, Plan

_MOST_PAIRED = 24
_NEAR_CYCLES = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class IncidentEvidence:
    """The evidence.

    ``name``: the connection concerned, which is that of the trigger, or else the first that is not
    in Data; may be empty. ``cut``: why the file ends early. ``crossed``: number of matching frames
    between the connection of the trigger and another one, by the name of the latter.
    """

    head: IncidentHead
    bus: BusFacts
    planned: dict[str, PlannedConnection]
    links: dict[str, LinkFacts]
    crossed: Mapping[str, int]
    name: str
    cut: str

    @property
    def moment_ns(self) -> int:
        """Time of the trigger."""
        return self.head.trigger.now_ns

    @property
    def plan(self) -> PlannedConnection | None:
        """The connection concerned, as planned."""
        return self.planned.get(self.name)

    def links_of(self, main: str) -> list[LinkFacts]:
        """Return the frames of all connections of a MainInstance."""
        own = [name for name, planned in self.planned.items() if planned.main == main]
        return [self.links[name] for name in own if name in self.links]

    @property
    def link(self) -> LinkFacts | None:
        """The frames of the connection concerned, or ``None`` if there are no cycles."""
        return self.links.get(self.name)

    @property
    def reset(self) -> ResetSeen | None:
        """The Reset with which the connection left Data, from its frames."""
        if self.link is None or self.head.trigger.kind is not TriggerKind.LEFT_DATA:
            return None
        return self.link.reset_at(self.moment_ns, _NEAR_CYCLES * max(self.bus.cycle_ns, 1_000_000))

    @property
    def code(self) -> int | None:
        """Reset code of the moment: as reported, or else from the frames."""
        reported = self.head.trigger.reset_code
        return reported if reported is not None or self.reset is None else self.reset.code

    @property
    def by(self) -> str:
        """The end that reset: ``main``, ``sub`` or empty."""
        reported = self.head.trigger.reset_by
        return reported if reported or self.reset is None else self.reset.by

    @property
    def left_data(self) -> bool:
        """Whether the connection was in Data before."""
        return self.head.trigger.kind is TriggerKind.LEFT_DATA

    @property
    def never(self) -> bool:
        """Whether the connection never reached Data in this file."""
        if self.head.trigger.kind is TriggerKind.NOT_CONNECTED:
            return True
        if self.head.trigger.kind is not TriggerKind.REQUEST or self.link is None:
            return False
        return not any(state.in_data for state in self.link.states)

    @property
    def watchdog_ns(self) -> int | None:
        """Watchdog of the connection: as sent by the main to the sub, or else as planned."""
        reported = self.link.sent_watchdog_ms if self.link else None
        plan = self.plan.watchdog_ms if self.plan else None
        value = reported or plan
        return None if value is None else value * 1_000_000

    @property
    def window_ns(self) -> tuple[int, int]:
        """Period before the moment that can contain the cause of an expired watchdog."""
        length = max(3 * (self.watchdog_ns or 100_000_000) // 2, 20_000_000)
        return self.moment_ns - length, self.moment_ns

    def subdevice(self, name: str) -> SubDeviceSnapshot | None:
        """Return the known state of a SubDevice on the bus."""
        return next((s for s in self.head.subdevices if s.name == name), None)

    def went_away(self, subdevice: str) -> bool:
        """Whether a SubDevice did not answer at any time in the file."""
        seen = self.subdevice(subdevice)
        return (seen is not None and not seen.answers) or any(
            v.keys.get("subdevice") == subdevice and v.keys.get("after") == "none"
            for v in self.events("subdevice")
        )

    def facts(self, subdevice: str) -> FsoeFacts | None:
        """Return the report of a SubDevice about its FSoE ends."""
        return next((f for f in self.head.fsoe if f.subdevice == subdevice), None)

    def address_of(self, subdevice: str) -> int | None:
        """Return the FSoE address that a SubDevice reports, even if it was rejected for it."""
        facts = self.facts(subdevice)
        if facts is not None and facts.address is not None:
            return facts.address
        seen = self.subdevice(subdevice)
        return (seen.fsoe_address or None) if seen else None

    def type_of(self, subdevice: str) -> tuple[int, int] | None:
        """Return the planned vendor and product of a SubDevice, or ``None`` without a plan."""
        rows = self.head.plan.subdevices if self.head.plan else ()
        found = next((s for s in rows if clean(s.name) == subdevice), None)
        return None if found is None else (found.vendor_id, found.product_code)

    def setting(self, name: str) -> FsoeSetting | None:
        """Return the settings of a connection's MainInstance, as reported by its device.

        Its connections are reported in the order of the plan if their number is equal.
        """
        plan = self.planned.get(name)
        found = self.facts(plan.main) if plan else None
        if plan is None or found is None:
            return None
        # Devices report their connections in plan order; if their number differs, the order proves
        # nothing.
        own = [p.name for p in self.planned.values() if p.main == plan.main]
        if len(own) != len(found.connections):
            return None
        return found.connections[own.index(name)]

    def events(
        self, event: str, start_ns: int = 0, end_ns: int | None = None
    ) -> list[IncidentEvent]:
        """Return the events of a kind in a period."""
        return [
            e
            for e in self.head.events
            if e.event == event and e.now_ns >= start_ns and (end_ns is None or e.now_ns <= end_ns)
        ]

    def lost_subdevices(self) -> list[SubDeviceSnapshot]:
        """Return the SubDevices that did not answer when the file was written, in bus order.

        A position with another device counts as answering.
        """
        return [
            s
            for bus in sorted({s.bus for s in self.head.subdevices})
            for s in self.line(bus)
            if not s.answers and s.found is not Found.IDENTITY
        ]

    def line(self, bus: int) -> list[SubDeviceSnapshot]:
        """Return the SubDevices of a bus in ring order, if the bus reports their state.

        If some have an alias, positions may be relative to it; then the order is that of the plan.
        """
        own = [s for s in self.head.subdevices if s.known and s.bus == bus]
        return own if any(s.alias for s in own) else sorted(own, key=lambda s: s.position)

    def stopped(self) -> list[str]:
        """Return all connections with a Reset close to the moment or that are not in Data."""
        near = max(self.watchdog_ns or 0, 100_000_000)
        return [
            name
            for name, link in self.links.items()
            if name == self.name
            or link.reset_at(self.moment_ns, near) is not None
            or not link.state_at_moment.in_data
        ]


def gather(reader: IncidentReader) -> IncidentEvidence:
    """Read a file to its end.

    Memory is bounded by the number of connections, not by the length of the file.
    """
    head = _at_moment(reader.head)
    planned = _planned(head)
    # A trigger of a SubDevice concerns the first connection that has an end there.
    name = head.trigger.connection or _of_subdevice(planned, head.trigger.subdevice)
    bus = BusWatch(head.cycle_ns or (head.plan.cycle_ns if head.plan else 0))
    watches = _watches(head)
    pairs = _pairs(head.layout.connections, watches, name)
    image: bytes | None = None
    for record in reader:
        bus.cycle(record)
        # An equal image is the same object: nothing was received in this cycle.
        if record.image is None or record.image is image:
            for watch in watches.values():
                watch.idle(record.now_ns)
            continue
        image = record.image
        for watch in watches.values():
            watch.cycle(record.cycle, record.now_ns, image)
        for pair in pairs:
            pair.cycle(record.now_ns)
    crossed: Counter[str] = Counter()
    for pair in pairs:
        crossed[pair.other] += pair.linked
    links = {watch_name: watch.facts() for watch_name, watch in watches.items()}
    return IncidentEvidence(
        head=head,
        bus=bus.facts(),
        planned=planned,
        links=links,
        crossed=+crossed,  # without those that have no match
        # Without a name in the trigger, the first connection that is not in Data is shown.
        name=name or _first_bad(links),
        cut=reader.cut,
    )


def _watches(head: IncidentHead) -> dict[str, LinkWatch]:
    frames = head.layout.connections
    # Places of other frames: a complete frame found there is not a shifted one.
    taken = frozenset(
        (copy.source_byte, copy.size_bytes) for c in frames for copy in (c.to_sub, c.to_main)
    )
    return {
        p.name: LinkWatch(
            p,
            head.trigger.now_ns,
            bounds=(_bounds(head, p.to_sub), _bounds(head, p.to_main)),
            taken=taken,
        )
        for p in frames
    }


def _at_moment(head: IncidentHead) -> IncidentHead:
    """Return the head with the SubDevice of the trigger in its state at the moment.

    A refused state is requested again each second: at the end of the file it may be between
    two refusals.
    """
    name = head.trigger.subdevice
    reported = [
        v.keys
        for v in head.events
        if name and v.keys.get("subdevice") == name and v.now_ns <= head.trigger.now_ns
    ]
    found = next((keys for keys in reversed(reported) if keys.get("found_code")), None)
    if found is None:
        return head
    rows = tuple(
        replace(
            s,
            found=Found.of(_number(found["found_code"])),
            fsoe_address=_number(found.get("fsoe_address", "")),
            detail=found.get("detail", ""),
        )
        if s.name == name
        else s
        for s in head.subdevices
    )
    return replace(head, subdevices=rows)


def _number(text: str) -> int:
    return int(text) if text.isdecimal() else 0


def _bounds(head: IncidentHead, frame: LayoutCopy) -> tuple[int, int]:
    """Return the range of the source sync manager of a frame: first byte and end."""
    for sm in head.layout.sms:
        end = sm.offset_bytes + sm.size_bytes
        if sm.offset_bytes <= frame.source_byte < end:
            return sm.offset_bytes, min(end, head.layout.image_bytes)
    return frame.source_byte, frame.source_byte + frame.size_bytes


def _of_subdevice(planned: dict[str, PlannedConnection], subdevice: str) -> str:
    """Return the first connection of a SubDevice, or an empty text."""
    ends = (n for n, p in planned.items() if subdevice and subdevice in (p.sub, p.main))
    return next(ends, "")


def _first_bad(links: dict[str, LinkFacts]) -> str:
    """Return a connection that is not in Data, or one with FailSafeData, or the first."""
    for name, link in links.items():
        if not link.state.in_data:
            return name
    for name, link in links.items():
        if link.state is not ConnectionState.DATA_PROCESS:
            return name
    return next(iter(links), "")


def _pairs(
    places: tuple[PlannedConnection, ...], watches: dict[str, LinkWatch], name: str
) -> list[PairWatch]:
    """Pair the ends of the connection of the trigger with those of other connections."""
    pairs: list[PairWatch] = []
    mine = watches.get(name)
    for other in places[: 4 * _MOST_PAIRED]:
        theirs = watches[other.name]
        if mine is None or other.name == name or len(pairs) > 2 * _MOST_PAIRED:
            continue
        pairs.append(PairWatch(other.name, mine, theirs))
        pairs.append(PairWatch(other.name, theirs, mine))
    return pairs


def _planned(head: IncidentHead) -> dict[str, PlannedConnection]:
    plan = head.plan
    if plan is None:
        return {
            c.name: PlannedConnection(name=c.name, main=c.main, sub=c.sub) for c in head.connections
        }
    return {
        clean(c.name): PlannedConnection(
            name=clean(c.name),
            main=_name(plan, c.main),
            sub=_name(plan, c.sub),
            connection_id=c.connection_id,
            address=c.address,
            watchdog_ms=c.watchdog_ms,
            safe_bytes=(c.safe_to_sub, c.safe_to_main),
            cycle_ns=plan.way_cycle_ns(c.main, c.sub) if plan.buses else 0,
        )
        for c in plan.connections
    }


def _name(plan: Plan, number: int) -> str:
    return "" if number == NONE else clean(plan.subdevices[number].name)
