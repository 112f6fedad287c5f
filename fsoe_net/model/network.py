"""The user's network: nets, transfers, connection facts, and the whole network."""

from __future__ import annotations

import enum
import itertools
from collections.abc import Mapping
from dataclasses import field
from functools import cached_property

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.model.bus import Located, SubDevice
from fsoe_net.model.report_facts import ReportFacts
from fsoe_net.model.robot import Robot
from fsoe_net.model.safety import SafetyFunction

MOST_COMBINATIONS = 64
"""Maximum number of combinations of groups that are listed."""


class TransferKind(enum.Enum):
    """Content of a transfer: one FSoE frame, or ordinary process data."""

    FSOE = "fsoe"
    STANDARD = "standard"


@dataclass(frozen=True, slots=True, kw_only=True)
class Endpoint(Located):
    """One end of a transfer: the first entry of the bytes."""

    module: str
    index: int
    subindex: int

    def __str__(self) -> str:
        return f"{self.module} 0x{self.index:04x}:{self.subindex:02x}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer(Located):
    """Copy ``size_bytes`` from an input entry to an output entry, every bus cycle."""

    size_bytes: int
    source: Endpoint
    destination: Endpoint
    kind: TransferKind = TransferKind.FSOE


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionFacts(Located):
    """A connection as stated by the user: frames, and facts not in PDOs. ``None`` if not stated.

    ``main`` and ``sub`` are SubDevice names; ``main`` may be empty in an answer of the user.
    ``slot`` is the number of the frame pair of ``main``, from 0 in the order of the process image
    (`frame_pairs`); ``sub_slot`` the same for ``sub``. Missing transfers of the net are created
    from it (`expand`). ``unconfirmed``: not yet compared with the safety project; the text is the
    reason, and may be empty.
    """

    main: str = ""
    sub: str
    slot: int | None = None
    sub_slot: int | None = None
    unconfirmed: str | None = None
    address: int | None = None
    connection_id: int | None = None
    watchdog_ms: int | None = None
    app_parameters: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class Net(Located):
    """One FSoE MainInstance with its transfers.

    ``incomplete``: a transfer or a connection could not be read or expanded, so missing parts are
    not separate findings.
    """

    name: str
    safety_master: str | None
    transfers: tuple[Transfer, ...]
    connections: tuple[ConnectionFacts, ...] = ()
    incomplete: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Bus(Located):
    """One of several buses; ``cycle_ns`` is ``None`` if the file does not state it.

    ``interface``: the network interface of the PC, or the number of the IgH master; if it is empty,
    it must be given on the command line.
    """

    name: str
    interface: str = ""
    cycle_ns: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Group(Located):
    """SubDevices that may be absent, by name, in bus order.

    The first one is found by its alias. Groups with the same ``place`` are alternatives that are
    never present together; empty without alternatives. ``places``: place of each name in the file.
    """

    name: str
    place: str = ""
    subdevices: tuple[str, ...] = ()
    places: tuple[Span, ...] = field(default=(), compare=False, repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceFile:
    """One file that was read: path as shown to the user and SHA-256 of its bytes (hex)."""

    path: str
    sha256: str


@dataclass(frozen=True, kw_only=True)  # no slots, as the groups by name are cached
class NetworkConfig(Located):
    """All facts known before the bus exists.

    ``subdevices``: in the order in which a driver adds them to its master, which is the order of
    the process image. ``cycle_ns`` is ``None`` if no file states it. ``partial``: modules may be
    declared in a file that was not given, so unknown names are not errors. ``project`` is the
    heading of reports; empty if not stated. ``report``: for their title block. ``buses``: at least
    two, numbered by ``master_id`` of the SubDevices, or empty if the file has one bus; ``cycle_ns``
    is that of the first bus. ``groups``: SubDevices that may be absent; all others are always
    present. ``robot``: the robot description with its controllers, if files of controllers were
    given.
    """

    name: str
    cycle_ns: int | None
    subdevices: tuple[SubDevice, ...]
    nets: tuple[Net, ...]
    safety_functions: tuple[SafetyFunction, ...] = ()
    project: str = ""
    report: ReportFacts = field(default_factory=ReportFacts)
    sources: tuple[SourceFile, ...] = ()
    partial: bool = False
    buses: tuple[Bus, ...] = ()
    groups: tuple[Group, ...] = ()
    robot: Robot | None = None

    def group_of(self, subdevice: str) -> Group | None:
        """Return the group of a SubDevice, or ``None`` if it is always present."""
        return self._groups.get(subdevice)

    @cached_property
    def _groups(self) -> Mapping[str, Group]:
        found: dict[str, Group] = {}
        for group in self.groups:
            for name in group.subdevices:
                found.setdefault(name, group)
        return found

    def combinations(self) -> tuple[tuple[str, ...], ...]:
        """Return the combinations of groups that may be present: at most one group per place.

        At most `MOST_COMBINATIONS`, beginning with the one without any group; empty without groups.
        """
        if not self.groups:
            return ()
        places: dict[str, list[str]] = {}
        for group in self.groups:
            # Groups of one place exclude each other; a group without a place is independent.
            places.setdefault(f"place {group.place}" if group.place else group.name, []).append(
                group.name
            )
        rows = itertools.product(*(["", *names] for names in places.values()))
        found = (tuple(filter(None, row)) for row in rows)
        # The number of combinations grows exponentially.
        return tuple(itertools.islice(found, MOST_COMBINATIONS))

    def has_way(self, source: SubDevice, destination: SubDevice) -> bool:
        """Whether one program moves frames between them; with several masters, none does."""
        return bool(self.buses) or source.master_id == destination.master_id

    def way(self, source: SubDevice, destination: SubDevice) -> tuple[int, ...]:
        """Return the buses whose cycles move a frame from one SubDevice to another.

        Each step is an exchange between two cycles. The first bus copies all frames that cross
        buses.
        """
        ends = (source.master_id, destination.master_id)
        if ends[0] == ends[1]:
            return ends[:1]
        return ends if 0 in ends else (ends[0], 0, ends[1])

    def way_cycles_ns(self, source: SubDevice, destination: SubDevice) -> tuple[int, ...] | None:
        """Return the cycle of each bus on that path in ns; ``None`` if one is not stated."""
        way = self.way(source, destination)
        cycles = [self.buses[n].cycle_ns if self.buses else self.cycle_ns for n in way]
        known = tuple(ns for ns in cycles if ns)
        return known if len(known) == len(way) else None
