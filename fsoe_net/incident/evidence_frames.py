"""Facts from the frames of one connection in the cycles of an incident file."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field

from fsoe_net.core.bus_documents import LayoutCopy, PlannedConnection
from fsoe_net.core.monitor import Monitor
from fsoe_net.fsoe.chain import fits_start
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict
from fsoe_net.fsoe.parameters import NOT_OBSERVED
from fsoe_net.fsoe.pdu import Command, decode_pdu, is_frame_length, safe_data_length

_LEGAL = frozenset(int(c) for c in Command)
_DATA_COMMANDS = (Command.PROCESS_DATA, Command.FAIL_SAFE_DATA)
_START_COMMANDS = (Command.CONNECTION, Command.PARAMETER)
# The CRC chain begins with these, so their own CRC shows whether they are complete.
_BEGINS = (Command.RESET, Command.SESSION)
_KEEP = 60
_MOST_RESETS = 1_000
_SEARCH = 8
_SEARCHES = 200
_LONGEST_SEARCHED = 63


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameSeen:
    """A new frame of a connection. ``changed``: bytes that differ from the previous frame."""

    cycle: int
    now_ns: int
    direction: int
    data: bytes
    verdict: CrcVerdict
    state: ConnectionState
    changed: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ResetSeen:
    """A Reset that began: its sender, and the state just before.

    ``silent_ns``: time since the last new frame of main and of sub. ``waiting_for`` is the end
    whose turn it was: ``main`` or ``sub``. ``last_verdict`` and ``last_command`` are those of the
    newest frame of the other end.
    """

    now_ns: int
    cycle: int
    by: str
    code: int
    state: ConnectionState
    silent_ns: tuple[int, int]
    waiting_for: str
    last_verdict: CrcVerdict
    last_command: int
    last_right: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """Complete frames were found next to the planned place, or with another length."""

    offset_bytes: int
    size_bytes: int
    times: int


@dataclass(slots=True)
class WireSide:
    """One direction, as in the image; index 0 is main to sub.

    ``right`` and ``wrong`` count new frames by their CRCs, ``illegal`` those whose first byte is no
    FSoE command. ``linked`` are right frames other than Reset that match the frames of the other
    end. ``torn`` are cycles in which the destination differed from the source. ``waits_ns``
    describes how long the other end waited for an answer in Data: count, sum, maximum.
    """

    frames: int = 0
    right: int = 0
    wrong: int = 0
    illegal: int = 0
    linked: int = 0
    torn: int = 0
    torn_cycle: int = 0
    not_zero: bool = False
    last_ns: int = -1
    commands: Counter[int] = field(default_factory=Counter)
    connection_ids: Counter[int] = field(default_factory=Counter)
    waits: int = 0
    waits_sum_ns: int = 0
    waits_most_ns: int = 0

    @property
    def waits_mean_ns(self) -> float:
        """The mean of its waits; 0 if there are none."""
        return self.waits_sum_ns / self.waits if self.waits else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFacts:
    """Facts about the frames of one connection.

    ``frames`` are those around the moment. ``sent_…`` are values from the last Connection and
    Parameter frames of the main. ``state`` is the last state, ``states`` are all states that
    occurred. ``begun`` counts the sessions that each side has begun, which only a main should do.
    ``time_in_failsafe_ns``: how long each direction carried FailSafeData in Data.
    """

    name: str
    sides: tuple[WireSide, WireSide]
    resets: tuple[ResetSeen, ...]
    frames: tuple[FrameSeen, ...]
    state: ConnectionState
    state_at_moment: ConnectionState
    states: frozenset[ConnectionState]
    sent_address: int | None
    sent_watchdog_ms: int | None
    sent_app_bytes: int | None
    shifts: tuple[Shift | None, Shift | None]
    begun: tuple[int, int]
    time_in_failsafe_ns: tuple[int, int]

    def reset_at(self, now_ns: int, within_ns: int) -> ResetSeen | None:
        """Return the Reset closest to a time."""
        near = [r for r in self.resets if abs(r.now_ns - now_ns) <= within_ns]
        return min(near, key=lambda r: abs(r.now_ns - now_ns)) if near else None


class LinkWatch:
    """Follows one connection cycle by cycle.

    Args:
        places: Places of its frames.
        moment_ns: Time of the trigger; frames around it are kept.
        bounds: Range to search for frames that are missing at their place, by direction: first byte
            and end.
        taken: Places of other frames, ``(first byte, length)``; excluded from the search.
    """

    def __init__(
        self,
        places: PlannedConnection,
        moment_ns: int,
        *,
        bounds: tuple[tuple[int, int], tuple[int, int]],
        taken: frozenset[tuple[int, int]],
    ) -> None:
        self._places = places
        self._areas = (places.to_sub, places.to_main)
        self._moment_ns = moment_ns
        self._bounds = bounds
        self._taken = taken
        out = safe_data_length(places.to_sub.size_bytes)
        back = safe_data_length(places.to_main.size_bytes)
        self._monitor = Monitor(out, back)
        self._begun = [0, 0]
        self.sides = (WireSide(), WireSide())
        self._last = [bytes(a.size_bytes) for a in self._areas]
        self._verdicts = [CrcVerdict.SAME, CrcVerdict.SAME]
        self._resets: list[ResetSeen] = []
        self._before: deque[FrameSeen] = deque(maxlen=_KEEP)
        self._after: list[FrameSeen] = []
        self._states: set[ConnectionState] = set()
        self._sent = NOT_OBSERVED
        self._searched = [0, 0]
        self._found: tuple[Counter[tuple[int, int]], Counter[tuple[int, int]]] = (
            Counter(),
            Counter(),
        )
        self._at_moment: ConnectionState | None = None
        self._failsafe_ns = [0, 0]
        self._now_ns = -1
        self.new: list[bytes | None] = [None, None]
        """New frames of the last cycle by direction."""

    def size(self, direction: int) -> int:
        """Return the safe data bytes of a direction."""
        return safe_data_length(self._areas[direction].size_bytes)

    def cycle(self, cycle: int, now_ns: int, image: bytes) -> None:
        """Process the image of one cycle."""
        # The state before the frame of this moment, because the frame itself is the event.
        if self._at_moment is None and now_ns >= self._moment_ns:
            self._at_moment = self._monitor.state
        self._count_failsafe(now_ns)
        self.new = [None, None]
        for direction in (1, 0):  # inputs are older than outputs: the answer comes first
            area = self._areas[direction]
            data = image[area.source_byte : area.source_byte + area.size_bytes]
            copied = image[area.destination_byte : area.destination_byte + area.size_bytes]
            side = self.sides[direction]
            # Source and destination differ: the copy was torn, or there is another writer.
            if copied != data:
                side.torn += 1
                side.torn_cycle = side.torn_cycle or cycle
            if data != self._last[direction] and not any(data):
                # A cleared image is not a frame: a device in SAFEOP, or a missing one.
                self._last[direction] = data
            elif data != self._last[direction]:
                self.new[direction] = data
                self._frame(direction, data, cycle, now_ns, image)
        self._states.add(self._monitor.state)

    def idle(self, now_ns: int) -> None:
        """Process a cycle with an unchanged image."""
        if self._at_moment is None and now_ns >= self._moment_ns:
            self._at_moment = self._monitor.state
        self._count_failsafe(now_ns)
        self.new = [None, None]

    def _count_failsafe(self, now_ns: int) -> None:
        if self._now_ns >= 0 and self._monitor.state is ConnectionState.DATA_FAILSAFE:
            for direction in (0, 1):
                if self._last[direction][0] == Command.FAIL_SAFE_DATA:
                    self._failsafe_ns[direction] += now_ns - self._now_ns
        self._now_ns = now_ns

    def _frame(self, direction: int, data: bytes, cycle: int, now_ns: int, image: bytes) -> None:
        side, other = self.sides[direction], self.sides[1 - direction]
        before = self._monitor.state
        old = self._last[direction]
        verdict = self._monitor.frame(direction, data, now_ns)
        pdu = decode_pdu(data)
        legal = pdu.command in _LEGAL
        # The answer to a Session frame depends on the chain; only a main begins a session.
        self._begun[direction] += pdu.command == Command.SESSION and fits_start(pdu)
        # Counted even if wrong: the content of a wrong frame shows its origin.
        self._count(side, pdu.command, pdu.connection_id, verdict, legal=legal)
        side.not_zero |= any(data)
        # Only answers in Data count: the times of the start-up differ.
        answers = pdu.command in _DATA_COMMANDS and other.last_ns > side.last_ns >= 0
        if before.in_data and answers:
            wait = now_ns - other.last_ns
            side.waits += 1
            side.waits_sum_ns += wait
            side.waits_most_ns = max(side.waits_most_ns, wait)
        # The same Reset is repeated until it is answered; only the first one counts.
        if pdu.command == Command.RESET and old[0] != Command.RESET:
            self._reset(direction, pdu.safe_data[0], before, cycle, now_ns)
        if direction == 0 and pdu.command in _START_COMMANDS:
            self._sent = self._monitor.parameters  # kept, because the next session clears them
        # An invalid frame may be in another place because the mapping is shifted.
        if not legal or verdict is CrcVerdict.WRONG:
            self._search(direction, image)
        side.last_ns = now_ns
        self._verdicts[direction] = verdict
        self._last[direction] = data
        self._keep(
            FrameSeen(
                cycle=cycle,
                now_ns=now_ns,
                direction=direction,
                data=data,
                verdict=verdict,
                state=self._monitor.state,
                changed=tuple(n for n in range(len(data)) if data[n] != old[n]),
            )
        )

    def _count(
        self, side: WireSide, command: int, connection_id: int, verdict: CrcVerdict, *, legal: bool
    ) -> None:
        side.frames += 1
        side.right += verdict is CrcVerdict.RIGHT
        side.wrong += verdict is CrcVerdict.WRONG
        side.illegal += not legal
        side.linked += verdict is CrcVerdict.RIGHT and command != Command.RESET
        if legal:
            side.commands[command] += 1
            # These two have connection ID 0. Bounded: damaged frames may contain any number.
            if command not in (Command.RESET, Command.SESSION) and len(side.connection_ids) < 64:
                side.connection_ids[connection_id] += 1

    def _keep(self, seen: FrameSeen) -> None:
        if seen.now_ns <= self._moment_ns:
            self._before.append(seen)
        elif len(self._after) < _KEEP:
            self._after.append(seen)

    def _reset(
        self, direction: int, code: int, before: ConnectionState, cycle: int, now_ns: int
    ) -> None:
        # Resets that repeat for hours give no new facts; the first ones are sufficient.
        if len(self._resets) >= _MOST_RESETS:
            return
        main, sub = self.sides
        self._resets.append(
            ResetSeen(
                now_ns=now_ns,
                cycle=cycle,
                by="main" if direction == 0 else "sub",
                code=code,
                state=before,
                silent_ns=(
                    now_ns - main.last_ns if main.last_ns >= 0 else now_ns,
                    now_ns - sub.last_ns if sub.last_ns >= 0 else now_ns,
                ),
                waiting_for="sub" if main.last_ns >= sub.last_ns else "main",
                last_verdict=self._verdicts[1 - direction],
                last_command=self._last[1 - direction][0],
                last_right=self._verdicts[1 - direction] is CrcVerdict.RIGHT,
            )
        )

    def _search(self, direction: int, image: bytes) -> None:
        """Search for complete frames next to the planned place."""
        # The search is slow, and its result is stable after some frames.
        if self._searched[direction] >= _SEARCHES:
            return
        self._searched[direction] += 1
        area = self._areas[direction]
        first, end = self._bounds[direction]
        for offset in range(-_SEARCH, _SEARCH + 1):
            start = area.source_byte + offset
            # A frame outside of the process data of this device belongs to another device.
            if not first <= start < end or image[start] not in _BEGINS:
                continue
            for size in _sizes(area):
                if (start, size) in self._taken or start + size > end:
                    continue
                data = image[start : start + size]
                if (offset or size != area.size_bytes) and _begins(data, size):
                    self._found[direction][offset, size] += 1
                    break

    def facts(self) -> LinkFacts:
        """Return the result."""
        state = self._monitor.state
        return LinkFacts(
            name=self._places.name,
            sides=self.sides,
            resets=tuple(self._resets),
            frames=(*self._before, *self._after),
            state=state,
            state_at_moment=self._at_moment or state,
            states=frozenset(self._states),
            sent_address=self._sent.address,
            sent_watchdog_ms=self._sent.watchdog_ms,
            sent_app_bytes=self._sent.app_bytes,
            shifts=(_shift(self._found[0]), _shift(self._found[1])),
            begun=(self._begun[0], self._begun[1]),
            time_in_failsafe_ns=(self._failsafe_ns[0], self._failsafe_ns[1]),
        )


class PairWatch:
    """Follows the main of one connection and the sub of another.

    ``linked`` counts right frames of one, except Resets, that answer those of the other.

    Args:
        other: Name of the connection that is not that of the trigger.
        main: The watch of one connection.
        sub: The watch of the other connection.
    """

    def __init__(self, other: str, main: LinkWatch, sub: LinkWatch) -> None:
        out = main.size(0)
        back = sub.size(1)
        self._monitor = Monitor(out, back)
        self._ends = main, sub
        self.other, self.linked = other, 0

    def cycle(self, now_ns: int) -> None:
        """Process the new frames that the two watches found in this cycle."""
        main, sub = self._ends
        for direction, data in ((1, sub.new[1]), (0, main.new[0])):
            if data is not None:
                sent = _links(self._monitor, direction, data, now_ns)
                self.linked += sent and direction == 1


def _links(monitor: Monitor, direction: int, data: bytes, now_ns: int) -> bool:
    """Whether a frame other than Reset matches the previous frame of the other end."""
    right = monitor.frame(direction, data, now_ns) is CrcVerdict.RIGHT
    return right and data[0] != Command.RESET


def _sizes(area: LayoutCopy) -> list[int]:
    """Return the possible lengths of a frame, the planned one first."""
    others = (n for n in range(6, _LONGEST_SEARCHED + 1) if is_frame_length(n))
    return [area.size_bytes, *(n for n in others if n != area.size_bytes)]


def _begins(data: bytes, size: int) -> bool:
    """Whether these bytes are a Reset or the first frame of a session."""
    return len(data) == size and fits_start(decode_pdu(data))


def _shift(found: Counter[tuple[int, int]]) -> Shift | None:
    if not found:
        return None
    (offset, size), times = found.most_common(1)[0]
    return Shift(offset_bytes=offset, size_bytes=size, times=times)
