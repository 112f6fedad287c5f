"""Clean runs of a connection, with the points at which a fault can be injected."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from fsoe_net.campaign.channel import (
    Application,
    Channel,
    Peer,
    SessionIds,
    Way,
    can_fork,
    set_sequence,
    short_hex,
)
from fsoe_net.campaign.tables import MainTable, SubTable
from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import Command
from fsoe_net.fsoe.sub_instance import SubInstance

_DATA_COMMANDS = frozenset({int(Command.PROCESS_DATA), int(Command.FAIL_SAFE_DATA)})
_DATA_SPOTS = 96  # turns with a new frame in state Data per run
STARTUP_SHARE = 1 / 8  # of all points
_VARIANTS = 8  # start-ups with different session ids
_STARTUP_SPOTS = 96
_KEEP = 48  # previous frames that a walk in Data keeps
_KEPT_WALKS = 4
_SLOW_CYCLES = 20  # time that a foreign end may need to answer

MainFactory = Callable[[MainConfig], Peer]
SubFactory = Callable[[SubConfig], Peer]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialConnection:
    """A connection to try faults on.

    Args:
        name: For reports.
        main: Configuration of the main; sizes, watchdog and ConnID are taken from it.
        sub: Configuration of the sub.
        other: Main of another connection of the same sizes, whose frames are inserted.
        cycle_ns: Bus cycle in ns.
        delay_cycles: Bus cycles on the way to the sub and to the main.
        main_factory: Makes a foreign main; ``None`` for ours.
        sub_factory: Makes a foreign sub; ``None`` for ours.

    Raises:
        ConfigError: Sizes of the three configurations differ.
    """

    name: str
    main: MainConfig
    sub: SubConfig
    other: MainConfig
    cycle_ns: int = 1_000_000
    delay_cycles: tuple[int, int] = (1, 1)
    main_factory: MainFactory | None = None
    sub_factory: SubFactory | None = None

    def __post_init__(self) -> None:
        for config in (self.sub, self.other):
            if (config.safe_out_bytes, config.safe_in_bytes) != self.sizes:
                raise ConfigError(f"{self.name}: sizes of main, sub and other connection differ")

    @property
    def sizes(self) -> tuple[int, int]:
        """Safe data bytes to the sub and to the main."""
        return self.main.safe_out_bytes, self.main.safe_in_bytes

    @property
    def watchdog_ns(self) -> int:
        """Watchdog in ns."""
        return self.main.watchdog_ms * 1_000_000

    @property
    def watchdog_cycles(self) -> int:
        """Watchdog in whole bus cycles, rounded up."""
        return -(-self.watchdog_ns // self.cycle_ns)

    def channel(self, seed: int) -> Channel:
        """Return a fresh channel; session ids and data of our ends follow from the seed."""
        ids = SessionIds(0), SessionIds(0)  # mutants: `_between` sets the values
        main: Peer = MainInstance(self.main, session_ids=ids[0])
        sub: Peer = SubInstance(self.sub, session_ids=ids[1])
        if self.main_factory is not None:
            main = self.main_factory(self.main)
        if self.sub_factory is not None:
            sub = self.sub_factory(self.sub)
        return self._between(main, sub, ids, seed)

    def again(self, used: Channel, seed: int) -> Channel:
        """Return a fresh channel with the ends of a used one, after a power cycle."""
        for end in used.ends:
            end.power_cycle()
        return self._between(used.main, used.sub, used.session_ids, seed)

    def _between(self, main: Peer, sub: Peer, ids: tuple[SessionIds, ...], seed: int) -> Channel:
        # The two ends must not draw the same ids.
        for source, turn in zip(ids, (0, 0x5DEECE66D1234567), strict=True):
            source.value = seed ^ turn
        return Channel(
            main,
            sub,
            sizes=self.sizes,
            cycle_ns=self.cycle_ns,
            delay_cycles=self.delay_cycles,
            application=Application(key=seed),
            session_ids=ids,
            tables=(
                SubTable(self.sub, grace_ns=0 if self.sub_factory is None else self.cycle_ns),
                MainTable(self.main, grace_ns=0 if self.main_factory is None else self.cycle_ns),
            ),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """A turn in which an end is about to see a new frame.

    Attributes:
        way: Direction of the frame.
        frame: The frame.
        in_data: Whether it is a frame of state Data.
        sent: How many frames of this direction the channel remembers, this one included.
        state: Snapshot of the channel before the turn; ``None`` when an end cannot fork.
    """

    way: Way
    frame: bytes
    in_data: bool
    sent: int
    state: tuple[Any, ...] | None


@dataclass(slots=True, kw_only=True)  # not frozen: made a million times
class Scene:
    """A channel just before a turn at which a fault can be injected.

    Attributes:
        channel: The channel, with no fault.
        way: Direction of the frame about to be seen.
        frame: That frame.
        in_data: Whether it is a frame of state Data.
        frames: Frames of the run in this direction; later ones are known only for a clean run.
        index: Index of ``frame`` in them.
        watchdog_cycles: Watchdog in whole bus cycles, rounded up.
        startup_cycles: Bus cycles a clean start-up takes.
        constant: Whether the run has the same safe data in all its data frames.
    """

    channel: Channel
    way: Way
    frame: bytes = b""
    in_data: bool = False
    frames: tuple[bytes, ...] = ()
    index: int = 0
    watchdog_cycles: int
    startup_cycles: int = 0
    constant: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """A clean run: its spots, those in Data also per direction, and the frames per direction."""

    startup: tuple[Spot, ...]
    data: tuple[Spot, ...]
    data_to: tuple[tuple[Spot, ...], ...]
    startup_frames: tuple[tuple[bytes, ...], ...]
    frames: tuple[tuple[bytes, ...], ...]


class _StartUp:
    """The start of a run, up to the first frames of state Data."""

    def __init__(self, link: TrialConnection, channel: Channel) -> None:
        self.fork = all(can_fork(end) for end in channel.ends)
        self.spots: list[Spot] = []
        seen: set[Way] = set()
        # With one safe byte, each parameter byte takes a separate exchange.
        exchanges = 20 + len(link.main.app_parameters)
        # Longer than any exchange takes: a connection that is not in Data by then never will be.
        limit = exchanges * (sum(link.delay_cycles) + _SLOW_CYCLES) + 5 * link.watchdog_cycles
        while len(seen) < len(Way):
            if channel.cycle > limit:
                raise ConfigError(
                    f"{link.name}: the connection does not reach state Data; the frames sent last "
                    f"are {_frame(channel.newest(Way.TO_SUB))} to the sub and "
                    f"{_frame(channel.newest(Way.TO_MAIN))} to the main; the watchdog of "
                    f"{link.main.watchdog_ms} ms must exceed an exchange, which takes "
                    f"{sum(link.delay_cycles) * link.cycle_ns / 1e6:g} ms"
                )
            # Each spot keeps a copy of both ends; their number is limited for the memory.
            spot = _spot_here(channel, fork=self.fork and len(self.spots) < _STARTUP_SPOTS)
            if spot is not None and spot.in_data:
                seen.add(spot.way)
            elif spot is not None and len(self.spots) < _STARTUP_SPOTS:
                self.spots.append(spot)
            channel.turn()
        self.cycles = channel.cycle
        self.frames = tuple(tuple(frame for _, frame in rows) for rows in channel.sent)
        self.state = channel.snapshot() if self.fork else None


def _spot_here(channel: Channel, *, fork: bool) -> Spot | None:
    """Return the spot before the next turn, if its end is about to see a new frame."""
    way = channel.way
    frame = channel.image(way, channel.cycle)
    if frame is None or frame == channel.shown(way):
        return None
    return Spot(
        way=way,
        frame=frame,
        in_data=frame[0] in _DATA_COMMANDS,
        sent=len(channel.sent[way]),
        state=channel.snapshot() if fork else None,
    )


def _frame(frame: bytes | None) -> str:
    return "none" if frame is None else short_hex(frame)


class RunSource:
    """Creates clean runs of one connection and returns to points in them.

    Args:
        link: The connection.
        seed: Seed of all runs.

    Raises:
        ConfigError: In a call: the two ends never reach state Data.
    """

    def __init__(self, link: TrialConnection, seed: int) -> None:
        self.link, self._watchdog_cycles = link, link.watchdog_cycles
        self._key = f"{seed}/{link.name}"
        rng = random.Random(self._key)  # noqa: S311 - repeatable is the point
        self._ids = [rng.getrandbits(63) for _ in range(_VARIANTS)]
        self._channel = link.channel(self._ids[0])
        self._own = link.main_factory is None and link.sub_factory is None
        self.forks = all(can_fork(end) for end in self._channel.ends)
        self._startups: dict[int, _StartUp] = {}
        self._walks: dict[int, Walk] = {}

    def scene(
        self,
        number: int,
        rng: random.Random,
        *,
        data_to: Way | None = None,
        startup_share: float = STARTUP_SHARE,
    ) -> Scene:
        """Return a channel at a random point of run ``number``, a share of them in the start-up.

        In state Data the sequence numbers are random; in every fourth run they are just below
        65535. Foreign ends begin at 1. In another quarter of the runs the safe data are constant.
        The channel of an earlier scene can no longer be used. With ``data_to``, the point is always
        in state Data, before a frame of this direction.
        """
        # Drawn before the branch: both kinds of ends take the same random numbers.
        in_data = data_to is not None or rng.random() >= startup_share
        if not self.forks:
            return self._run_to(number, in_data, rng, data_to)
        walk = self.walk(number)
        spots = walk.startup
        if in_data:
            spots = walk.data if data_to is None else walk.data_to[data_to]
        spot = spots[int(rng.random() * len(spots))]
        self._channel.restore(spot.state or ())
        before = walk.startup_frames[spot.way]
        return Scene(
            channel=self._channel,
            way=spot.way,
            frame=spot.frame,
            in_data=in_data,
            frames=walk.frames[spot.way] if in_data else before,
            index=spot.sent - 1 + (len(before) if in_data else 0),
            watchdog_cycles=self._watchdog_cycles,
            startup_cycles=self._startup(number % _VARIANTS).cycles,
            constant=in_data and _is_constant(number),
        )

    def walk(self, number: int) -> Walk:
        """Return run ``number`` of ends that can fork: start-up and some hundred turns in Data."""
        if number not in self._walks:
            if len(self._walks) == _KEPT_WALKS:
                # The oldest is dropped: a walk keeps a copy of both ends for each of its spots.
                del self._walks[next(iter(self._walks))]
            self._walks[number] = self._make(number)
        return self._walks[number]

    def _make(self, number: int) -> Walk:
        rng = random.Random(f"{self._key}/{number}")  # noqa: S311 - repeatable is the point
        start = self._startup(number % _VARIANTS)
        channel = self._channel
        channel.restore(start.state or ())
        channel.application = replace(
            channel.application, key=rng.getrandbits(63), constant=_is_constant(number)
        )
        if self._own:
            # Our own ends can start with any sequence number, so the wrap-around is tested as well.
            self._renumber(rng, near=number % 4 == 0)
            # Old frames are not needed for faults and would be copied with each spot.
            channel.forget(_KEEP)
        spots: list[Spot] = []
        while len(spots) < _DATA_SPOTS:
            spot = _spot_here(channel, fork=True)
            if spot is not None:
                spots.append(spot)
            channel.turn()
        return Walk(
            startup=tuple(start.spots),
            data=tuple(spots),
            data_to=tuple(tuple(spot for spot in spots if spot.way is way) for way in Way),
            startup_frames=start.frames,
            frames=tuple(
                before + tuple(frame for _, frame in rows)
                for before, rows in zip(start.frames, channel.sent, strict=True)
            ),
        )

    def _startup(self, variant: int) -> _StartUp:
        if variant not in self._startups:
            # A foreign end draws its own session ids. Draw them now, before any fault makes it
            # draw.
            together = range(_VARIANTS) if self.forks and not self._own else (variant,)
            for number in together:
                self._startups[number] = _StartUp(self.link, self._fresh(number))
        return self._startups[variant]

    def _fresh(self, variant: int) -> Channel:
        """Return both ends to the start of a run."""
        self._channel = self.link.again(self._channel, self._ids[variant])
        return self._channel

    def _renumber(self, rng: random.Random, *, near: bool) -> None:
        for _ in Way:
            # The end that has just answered a frame receives nothing more in this direction.
            way = self._channel.way
            while self._channel.turn()[1] is None:
                way = self._channel.way
            number = 0xFFFF - rng.randrange(40) if near else rng.randrange(1, 0x10000)
            set_sequence(self._channel, way, number)

    def _run_to(self, number: int, in_data: bool, rng: random.Random, data_to: Way | None) -> Scene:
        """Bring ends that cannot fork to the point by running them again."""
        # A foreign end must be run again for each fault; fewer spots limit the time.
        start = self._startup(0)
        steps = rng.randrange(_DATA_SPOTS // 2) if in_data else rng.randrange(len(start.spots))
        channel = self._fresh(number % _VARIANTS)
        constant = _is_constant(number)
        channel.application = replace(channel.application, constant=constant)
        while True:
            spot = _spot_here(channel, fork=False)
            # A spot of the start-up may also occur in Data, but not the reverse.
            if spot is not None and spot.in_data >= in_data and data_to in (None, spot.way):
                if steps == 0:
                    break
                steps -= 1
            channel.turn()
        frames = tuple(frame for _, frame in channel.sent[spot.way])
        return Scene(
            channel=channel,
            way=spot.way,
            frame=spot.frame,
            in_data=spot.in_data,
            frames=frames,
            index=spot.sent - 1,
            watchdog_cycles=self._watchdog_cycles,
            startup_cycles=start.cycles,
            constant=constant,
        )


def _is_constant(number: int) -> bool:
    """Whether run ``number`` has constant data: one in four, except runs in which numbers wrap."""
    return number % 4 == 1


def miswired(link: TrialConnection) -> TrialConnection:
    """Return a link whose main belongs to another sub and therefore uses a wrong address."""
    return replace(link, name=f"{link.name}/miswired", main=link.other)


def other_link(link: TrialConnection, *, same_id: bool) -> TrialConnection:
    """Return the connection whose frames are misrouted into a link.

    Args:
        link: The connection that receives them.
        same_id: Give it the same ConnID and address, like a second system with copied settings.
    """
    main = link.main if same_id else link.other
    sub = SubConfig(
        address=main.address,
        safe_out_bytes=main.safe_out_bytes,
        safe_in_bytes=main.safe_in_bytes,
        app_parameter_bytes=len(main.app_parameters),
    )
    kind = "twin" if same_id else "other"
    return TrialConnection(
        name=f"{link.name}/{kind}",
        main=main,
        sub=sub,
        other=link.main,
        cycle_ns=link.cycle_ns,
        delay_cycles=link.delay_cycles,
    )
