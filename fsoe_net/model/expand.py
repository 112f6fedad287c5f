"""Converts shorthand connections to ordinary transfers; no other module does this.

A connection names two SubDevices and, if there are several frames, slots. If its net has no
transfers between these frames, the two transfers are created here, from the layout of the frames
alone (`DeviceLayout.frame_pairs`). Pure; a connection without a result is reported to the rules
with its cause.
"""

from __future__ import annotations

import enum
from collections import defaultdict
from dataclasses import field, replace
from itertools import islice, product
from typing import Any

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Located, SubDevice
from fsoe_net.model.layout import FramePair, FsoeBlock
from fsoe_net.model.network import (
    ConnectionFacts,
    Endpoint,
    Net,
    NetworkConfig,
    Transfer,
    TransferKind,
)
from fsoe_net.model.transfer_ends import ResolvedTransfer, find_end


class Obstacle(enum.Enum):
    """Reason why no transfers can be created from a connection."""

    MODULE = "no SubDevice has this name"
    SAME = "main and sub are one SubDevice"
    NOT_MAIN = "main is not the MainInstance of the net"
    MASTERS = "main and sub are on two masters"
    NO_FRAMES = "the device shows no FSoE frame"
    NO_SLOT = "the device has no such frame pair"
    UNMATCHED = "the frames of this slot do not belong together"
    LENGTHS = "the frames of the two ends have other lengths"
    SEVERAL = "several frames could be meant"
    USED = "the frame belongs to another connection"
    HIDDEN = "a driver would get another entry than the frame"


@dataclass(frozen=True, slots=True, kw_only=True)
class NotExpanded:
    """A connection for which no transfers were created.

    Attributes:
        net: The net, as `Resolution.network` has it.
        facts: The connection.
        obstacle: The reason.
        key: Key of the connection that causes it, e.g. ``sub_slot``.
        pairs: Frame pairs to report: those of this device, or the candidates.
        partners: With LENGTHS, the pairs of the SubInstance.
        name: SubDevice of these frames; with NOT_MAIN the MainInstance of the net.
        other: The user of the frame, or the key that states the MainInstance.
    """

    net: Net
    facts: ConnectionFacts
    obstacle: Obstacle
    key: str = "main"
    pairs: tuple[FramePair, ...] = ()
    partners: tuple[FramePair, ...] = ()
    name: str = ""
    other: Located | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Expansion:
    """A network with the transfers of its connections, placed after those of their net.

    ``left_out``: each connection without transfers because of an error, as number of the net and
    number in the net.
    """

    network: NetworkConfig
    troubles: tuple[NotExpanded, ...] = ()
    left_out: frozenset[tuple[int, int]] = frozenset()


_MOST_NAMED = 64  # frame pairs in one finding

_Frame = tuple[str, tuple[int, int]]  # SubDevice, FsoeBlock.key
_Couple = tuple[FramePair, FramePair]


class _Refusal(Exception):
    """Reason why a connection cannot be expanded: the values of its `NotExpanded`."""

    def __init__(self, obstacle: Obstacle, key: str = "main", **more: Any) -> None:
        super().__init__(obstacle.value)
        self.values = {"obstacle": obstacle, "key": key, **more}

    def trouble(self, net: Net, facts: ConnectionFacts) -> NotExpanded:
        """Return the reason as a finding for this connection."""
        return NotExpanded(net=net, facts=facts, **self.values)


@dataclass(slots=True, kw_only=True)
class _Request:
    """A connection to expand, with its possible frames."""

    facts: ConnectionFacts
    main: SubDevice
    sub: SubDevice
    couples: list[_Couple] = field(default_factory=list)

    def frames(self, couple: _Couple) -> list[_Frame]:
        """Return the frames of both ends."""
        return [
            (end.name, block.key)
            for end, pair in zip((self.main, self.sub), couple, strict=True)
            for block in pair.blocks
        ]


@dataclass(slots=True, kw_only=True)
class _Case:
    """A connection and its result; empty if its net already has the transfers."""

    facts: ConnectionFacts
    request: _Request | None = None
    made: tuple[Transfer, ...] = ()
    refusal: _Refusal | None = None
    silent: bool = False  # another error was found before

    @property
    def left_out(self) -> bool:
        """Whether it has no transfers."""
        return self.silent or self.refusal is not None


@dataclass(slots=True, kw_only=True)
class _NetCases:
    """A net with its FSoE transfers and its connections.

    ``main`` is the MainInstance according to the connections, if the net does not state it.
    """

    net: Net
    rows: list[ResolvedTransfer] = field(default_factory=list)
    cases: list[_Case] = field(default_factory=list)
    main: str | None = None

    @property
    def left_out(self) -> list[int]:
        """The numbers of the connections without transfers."""
        return [number for number, case in enumerate(self.cases) if case.left_out]

    @property
    def is_changed(self) -> bool:
        """Whether the net differs from the original one."""
        return any(case.made or case.left_out for case in self.cases)

    def troubles(self, net: Net) -> list[NotExpanded]:
        """Return the errors of its connections; `net` is the resulting net."""
        return [c.refusal.trouble(net, c.facts) for c in self.cases if c.refusal is not None]

    def done(self) -> Net:
        """Return the net with the transfers of its connections."""
        net = self.net
        if not self.is_changed:
            return net
        made = tuple(transfer for case in self.cases for transfer in case.made)
        return replace(
            net,
            # The main is stored, so that later readers need not derive it again.
            safety_master=net.safety_master or self.main,
            transfers=net.transfers + made,
            connections=tuple(case.facts for case in self.cases),
            incomplete=net.incomplete or bool(self.left_out),
        )


def expand(
    network: NetworkConfig,
    rows: tuple[ResolvedTransfer, ...],
    by_name: dict[str, SubDevice],
) -> Expansion:
    """Create the transfers for the connections of a network. Never raises.

    Args:
        network: The network as read.
        rows: Its transfers with their ends.
        by_name: Its SubDevices.
    """
    if not any(net.connections for net in network.nets):
        return Expansion(network=network)
    return _Expander(network, rows, by_name).expand()


class _Expander:
    def __init__(
        self,
        network: NetworkConfig,
        rows: tuple[ResolvedTransfer, ...],
        by_name: dict[str, SubDevice],
    ) -> None:
        self._network = network
        self._by_name = by_name
        self._nets = [_NetCases(net=net) for net in network.nets]
        self._used: dict[_Frame, Located] = {}
        for row in rows:
            # Only FSoE transfers connect two ends; standard data may have the same SubDevices.
            if row.transfer.kind is TransferKind.FSOE:
                self._nets[row.net_number].rows.append(row)
            for end in (row.source, row.destination):
                if end.block is not None:
                    self._used.setdefault((end.endpoint.module, end.block.key), row.transfer)

    def expand(self) -> Expansion:
        """Expand the connections, net by net, in the order of the file."""
        for group in self._nets:
            group.cases = [self._case(group, facts) for facts in group.net.connections]
        requests = [(c, c.request) for g in self._nets for c in g.cases if c.request is not None]
        # All requests are collected before one is expanded: two of them may compete for one frame.
        reserved = self._reserved([request for _, request in requests])
        for case, request in requests:
            self._make(case, request, reserved)
        if not any(group.is_changed for group in self._nets):
            return Expansion(network=self._network)
        nets = tuple(group.done() for group in self._nets)
        return Expansion(
            network=replace(self._network, nets=nets),
            troubles=tuple(
                trouble
                for net, group in zip(nets, self._nets, strict=True)
                for trouble in group.troubles(net)
            ),
            left_out=frozenset(
                (number, left) for number, group in enumerate(self._nets) for left in group.left_out
            ),
        )

    # -- which connections ------------------------------------------------------------------------

    def _case(self, group: _NetCases, facts: ConnectionFacts) -> _Case:
        case = _Case(facts=facts)
        if self._is_stated(group, facts):
            return case
        if group.net.incomplete:  # the missing parts may be its transfers, or use its frames
            case.silent = True
            return case
        try:
            case.request = self._request(group, facts)
        except _Refusal as refusal:
            case.refusal = refusal
        case.silent = case.request is None and case.refusal is None
        return case

    def _is_stated(self, group: _NetCases, facts: ConnectionFacts) -> bool:
        """Whether the net has transfers of this connection, which then only states facts."""
        two = {facts.main, facts.sub}
        between = [
            row
            for row in group.rows
            if {row.transfer.source.module, row.transfer.destination.module} == two
        ]
        if not between:
            return False
        wanted = self._stated_frames(facts)
        # Slots decide if a SubDevice has several frames; without slots, any transfer matches.
        if wanted is None:
            return True
        for row in between:
            for end in (row.source, row.destination):
                # A transfer that does not resolve has no frame: it counts as the stated one, to
                # avoid a second error.
                if end.block is None or (end.endpoint.module, end.block.key) in wanted:
                    return True
        return False

    def _stated_frames(self, facts: ConnectionFacts) -> set[_Frame] | None:
        """Return the frames that the slots of a connection name; ``None`` if it names none."""
        if facts.slot is None and facts.sub_slot is None:
            return None
        found: set[_Frame] = set()
        for name, slot in ((facts.main, facts.slot), (facts.sub, facts.sub_slot)):
            sub = self._by_name.get(name)
            pairs = _pairs(sub) if sub is not None and slot is not None else ()
            found |= {(name, b.key) for pair in pairs if pair.slot == slot for b in pair.blocks}
        return found

    def _request(self, group: _NetCases, facts: ConnectionFacts) -> _Request | None:
        """Return the possible frames of a connection; ``None`` after an earlier error.

        Raises:
            _Refusal: The connection has no possible frames.
        """
        for key, name in (("main", facts.main), ("sub", facts.sub)):
            # A partial network lacks SubDevices on purpose; their absence is not an error of the
            # connection.
            if name not in self._by_name and self._network.partial:
                return None
            if name not in self._by_name:
                raise _Refusal(Obstacle.MODULE, key, name=name)
        if facts.main == facts.sub:
            raise _Refusal(Obstacle.SAME, "sub", name=facts.sub)
        main_name, said = self._main_of(group)
        if main_name is None:
            return None
        if main_name != facts.main:
            raise _Refusal(Obstacle.NOT_MAIN, "main", name=main_name, other=said)
        main, sub = self._by_name[facts.main], self._by_name[facts.sub]
        # A missing device file is already reported; a second finding would only distract.
        if main.device is None or sub.device is None:
            return None
        # Copies across separate buses are not possible.
        if not self._network.has_way(main, sub):
            raise _Refusal(Obstacle.MASTERS, "sub")
        request = _Request(facts=facts, main=main, sub=sub)
        ours = self._eligible(main, facts.slot, "main", "slot")
        theirs = self._eligible(sub, facts.sub_slot, "sub", "sub_slot")
        # Equal lengths in both directions are the only evidence in the layout.
        request.couples = [(one, two) for one, two in product(ours, theirs) if one.fits(two)]
        if not request.couples:
            raise _Refusal(
                Obstacle.LENGTHS,
                "slot" if facts.slot is not None else "main",
                pairs=_pairs(main),
                partners=tuple(theirs),
            )
        return request

    def _main_of(self, group: _NetCases) -> tuple[str | None, Located]:
        """Return the MainInstance of a net and its source; an empty name if it is invalid."""
        net = group.net
        if net.safety_master is not None:
            # A MainInstance that does not exist is reported for the net.
            there = net.safety_master in self._by_name
            return net.safety_master if there else None, net
        # Without a stated master, the SubDevice that all transfers share is the MainInstance.
        ends = [{row.transfer.source.module, row.transfer.destination.module} for row in group.rows]
        shared = set.intersection(*ends) if ends else set()
        known = [c for c in net.connections if c.main in self._by_name]
        # A connection that matches the transfers is a better source than the first one.
        first = next((c for c in known if not ends or c.main in shared), known[0])
        if group.main is None:
            group.main = shared.pop() if len(shared) == 1 else first.main
        return group.main, first

    def _eligible(
        self, sub: SubDevice, slot: int | None, key: str, slot_key: str
    ) -> list[FramePair]:
        """Return the possible frame pairs of a connection on one device.

        Raises:
            _Refusal: There is none.
        """
        pairs = _pairs(sub)
        if not pairs:
            raise _Refusal(Obstacle.NO_FRAMES, key, name=sub.name)
        if slot is not None:
            if slot >= len(pairs):
                raise _Refusal(Obstacle.NO_SLOT, slot_key, pairs=pairs, name=sub.name)
            # Two frames of a slot that do not belong together cannot form a connection.
            if not pairs[slot].matched:
                raise _Refusal(Obstacle.UNMATCHED, slot_key, pairs=(pairs[slot],), name=sub.name)
            return [pairs[slot]]
        matched = [pair for pair in pairs if pair.matched]
        if not matched:
            raise _Refusal(Obstacle.UNMATCHED, key, pairs=pairs[:1], name=sub.name)
        return matched

    # -- which frames -----------------------------------------------------------------------------

    def _reserved(self, requests: list[_Request]) -> dict[_Frame, list[ConnectionFacts]]:
        """Return the frames that connections name by their slots."""
        reserved: dict[_Frame, list[ConnectionFacts]] = defaultdict(list)
        for request in requests:
            for frame in self._stated_frames(request.facts) or ():
                reserved[frame].append(request.facts)
        return reserved

    def _choose(self, request: _Request, reserved: dict[_Frame, list[ConnectionFacts]]) -> _Couple:
        """Return the only pair of frame pairs that a connection can refer to.

        Raises:
            _Refusal: There is none, or there are several.
        """

        def user(frame: _Frame, *, early: bool) -> Located | None:
            """Return the user of the frame; ``early``: also consider earlier connections."""
            used = self._used.get(frame)
            # Transfers are stated, connections are expanded here: at first only stated use counts.
            if used is not None and (early or isinstance(used, Transfer)):
                return used
            others = [f for f in reserved.get(frame, ()) if f is not request.facts]
            return others[0] if others and not early else None

        unused = (
            c for c in request.couples if not any(user(f, early=False) for f in request.frames(c))
        )
        # Sufficient for a message; a large network has thousands of combinations.
        free = list(islice(unused, _MOST_NAMED)) or request.couples[:1]
        if len(free) > 1:
            raise _several(request, free)
        # If an earlier connection uses the frame, that connection is reported.
        for frame in request.frames(free[0]):
            other = user(frame, early=True)
            if other is not None:
                key = "main" if frame[0] == request.main.name else "sub"
                pair = free[0][0] if key == "main" else free[0][1]
                stated = f"{key}_slot" if key == "sub" else "slot"
                at = stated if stated in request.facts.fields else key
                raise _Refusal(Obstacle.USED, at, pairs=(pair,), name=frame[0], other=other)
        return free[0]

    def _make(
        self, case: _Case, request: _Request, reserved: dict[_Frame, list[ConnectionFacts]]
    ) -> None:
        try:
            couple = main, sub = self._choose(request, reserved)
            facts = replace(request.facts, slot=main.slot, sub_slot=sub.slot)
            to_main = self._transfer(facts, request.sub, sub.sends, request.main, main.takes)
            to_sub = self._transfer(facts, request.main, main.sends, request.sub, sub.takes)
        except _Refusal as refusal:
            case.refusal = refusal
            return
        case.facts, case.made = facts, (to_main, to_sub)
        for frame in request.frames(couple):
            self._used.setdefault(frame, request.facts)

    def _transfer(
        self,
        facts: ConnectionFacts,
        source: SubDevice,
        sends: FsoeBlock | None,
        destination: SubDevice,
        takes: FsoeBlock | None,
    ) -> Transfer:
        assert sends is not None  # noqa: S101  (only matched pairs are chosen)
        assert takes is not None  # noqa: S101
        return Transfer(
            span=facts.span,
            size_bytes=sends.frame_bytes,
            source=self._endpoint(facts, source, sends),
            destination=self._endpoint(facts, destination, takes),
        )

    def _endpoint(self, facts: ConnectionFacts, sub: SubDevice, block: FsoeBlock) -> Endpoint:
        key = "main" if sub.name == facts.main else "sub"
        end = Endpoint(
            span=facts.at(key),
            module=sub.name,
            index=block.command.index,
            subindex=block.command.subindex,
        )
        found = find_end(end, sub, block.direction).block
        # A driver gets the first entry of an address, which may be outside of the frame.
        if found is None or found.key != block.key:
            raise _Refusal(Obstacle.HIDDEN, key, name=str(end))
        return end


def _pairs(sub: SubDevice) -> tuple[FramePair, ...]:
    layout = sub.layout
    return () if layout is None else layout.frame_pairs


def _several(request: _Request, free: list[_Couple]) -> _Refusal:
    """Several pairs are free: report which end has the choice."""
    pairs = {main.slot: main for main, _ in free}
    key, name = "main", request.main.name
    if len(pairs) == 1:
        pairs = {sub.slot: sub for _, sub in free}
        key, name = "sub", request.sub.name
    return _Refusal(Obstacle.SEVERAL, key, pairs=tuple(pairs.values()), name=name)
