"""The black channel in virtual time: two ends, held images, a delay and faults per direction.

The ends are anything with the `Peer` protocol, so that a device developer's own implementation can
replace one of ours.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from fsoe_net.campaign.departure import Departure
from fsoe_net.campaign.tables import StateTable
from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.chain import Chain
from fsoe_net.fsoe.instance import Instance
from fsoe_net.fsoe.pdu import Command


class Way(enum.IntEnum):
    """Direction of a frame; also the index of everything kept per direction."""

    TO_SUB = 0
    TO_MAIN = 1


BACK = (Way.TO_MAIN, Way.TO_SUB)
_DATA_COMMANDS = frozenset({int(Command.PROCESS_DATA), int(Command.FAIL_SAFE_DATA)})
_MASK = (1 << 64) - 1
_SHOWN_BYTES = 31


class Peer(Protocol):
    """One end of a connection, ours or a device developer's.

    `step` reads at most one frame and returns at most one: the answer to a frame comes from the
    call that was given the frame. The following are used if the end has them:
    ``set_safe_data(data)``, ``enable`` (may ProcessData be sent), ``snapshot()`` and
    ``restore(state)`` (the campaign is some ten times quicker with them),
    ``watchdog_remaining_ns(now_ns)`` (lets idle time be left out).
    """

    def step(self, now_ns: int, received: bytes | None) -> bytes | None:
        """Read the input image at a time in ns; return the frame for the output image, if any."""

    def power_cycle(self) -> None:
        """Reset all state, as if the device were switched off and on."""

    @property
    def received_safe_data(self) -> bytes:
        """Safe data for the application."""

    @property
    def data_valid(self) -> bool:
        """Whether the application may use them."""


def can_fork(end: Peer) -> bool:
    """Whether an end can return to an earlier point of its run."""
    return hasattr(end, "snapshot") and hasattr(end, "restore")


class SessionIds:
    """A repeatable source of session ids whose state can be restored."""

    __slots__ = ("drawn", "value")

    def __init__(self, seed: int) -> None:
        self.value = seed & _MASK
        self.drawn: int | None = None

    def __call__(self) -> int:
        """Return the next id, 0 … 65535."""
        # The MMIX generator (Knuth): its whole state is one number, so `restore` is cheap.
        self.value = (self.value * 6364136223846793005 + 1442695040888963407) & _MASK
        # Only the high bits are used: the low bits of such a generator have short periods.
        self.drawn = self.value >> 40 & 0xFFFF
        return self.drawn


@dataclass(frozen=True, slots=True, kw_only=True)
class Application:
    """Behaviour of the safety applications of both ends.

    New data in every cycle, rarely fail-safe; or constant data, as a machine at rest sends for
    hours.

    Args:
        key: Seed; runs with different keys have different data.
        fail_safe_share: One in this number of cycles is sent as FailSafeData; 0 for none.
        constant: Whether each direction sends the same data in every cycle, and no FailSafeData.
        withdrawn_from: First cycle with everything disabled.
        hands_off_from: First cycle from which the enable is left unchanged.
    """

    key: int = 0
    fail_safe_share: int = 16
    constant: bool = False
    withdrawn_from: int | None = None
    hands_off_from: int | None = None

    def at(self, way: Way, cycle: int, size: int) -> tuple[bytes, bool]:
        """Return the data for this direction and cycle, and whether ProcessData may be sent."""
        turn = 0 if self.constant else 2 * cycle
        # A hash of cycle and way: the same data in each run, without the memory of a generator.
        x = ((turn + way + self.key) * 0x9E3779B97F4A7C15) & _MASK
        x = ((x ^ x >> 31) * 0xBF58476D1CE4E5B9) & _MASK
        x ^= x >> 29
        data = x.to_bytes(8, "little")
        if size > 8:
            data *= -(-size // 8)
        share = 0 if self.constant else self.fail_safe_share
        # The application withdraws its enable: from then on, no end may send ProcessData.
        if self.withdrawn_from is not None and cycle >= self.withdrawn_from:
            return data[:size], False
        return data[:size], not share or (x >> 8) % share != 0


class Fault(Protocol):
    """A disturbance of one direction of a channel for a limited time.

    A fault with ``early_ns`` shifts the bus cycle: from ``start`` on it begins that much earlier.
    """

    @property
    def way(self) -> Way:
        """The direction it acts on."""

    @property
    def start(self) -> int:
        """First cycle in which it acts."""

    @property
    def until(self) -> int:
        """First cycle without a further effect."""

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return what the receiver sees instead of ``image``; ``image`` if the fault is idle."""

    def next_change(self, channel: Channel) -> int | None:
        """Return the first cycle from now on in which its effect may differ from the last one.

        ``None`` if the effect no longer changes.
        """


class Channel:
    """Two ends and the path between them; in each cycle, the main runs first and then the sub.

    Args:
        main: The end that opens the connection.
        sub: The end that answers.
        sizes: Safe data bytes to the sub and to the main.
        cycle_ns: Bus cycle in ns.
        delay_cycles: Bus cycles from an output image to the other end's input image, to the sub
            and to the main, at least 1 each.
        application: Source of the safe data.
        session_ids: Sources to restore together with the ends.
        tables: Per direction, the state table that its receiver must follow; ``None`` to judge
            nothing.

    Attributes:
        cycle: Bus cycle of the next turn.
        way: Direction whose receiver runs next.
        sent: Per direction, frames sent: cycle in which they become visible, frame.
        exchanges: Per direction, what its receiver answered to: frame seen, frame sent.
        base: Per direction, the chain of its receiver before the first of ``exchanges``.
        session_ids: Sources that are restored together with the ends.
        answered_ns: Per direction, when its receiver last sent a frame.
        departed: Direction and first departure of its receiver from its table.
    """

    def __init__(
        self,
        main: Peer,
        sub: Peer,
        *,
        sizes: tuple[int, int],
        cycle_ns: int = 1_000_000,
        delay_cycles: tuple[int, int] = (1, 1),
        application: Application | None = None,
        session_ids: Sequence[SessionIds] = (),
        tables: tuple[StateTable | None, StateTable | None] = (None, None),
    ) -> None:
        if cycle_ns < 1 or min(delay_cycles) < 1:
            raise ConfigError("cycle and delays must be at least 1")
        self.ends: tuple[Peer, Peer] = (sub, main)
        self.sizes, self.cycle_ns, self.delay_cycles = sizes, cycle_ns, delay_cycles
        self.application = application or Application()
        self.cycle, self.way = 0, Way.TO_MAIN
        self.faults = ()
        self.sent: list[list[tuple[int, bytes]]] = [[], []]
        self.exchanges: list[list[tuple[bytes | None, bytes]]] = [[], []]
        self.base = (Chain(), Chain())
        self.answered_ns = [0, 0]
        self.session_ids = tuple(session_ids)
        self.tables = tables
        self.departed: tuple[Way, Departure] | None = None
        self._shown: list[bytes | None] = [None, None]
        self._in_data = [False, False]
        self._feed = tuple(_feed(end) for end in self.ends)

    @property
    def main(self) -> Peer:
        """The end that opens the connection."""
        return self.ends[Way.TO_MAIN]

    @property
    def sub(self) -> Peer:
        """The end that answers."""
        return self.ends[Way.TO_SUB]

    @property
    def now_ns(self) -> int:
        """Time of the next turn."""
        now_ns = self.cycle * self.cycle_ns
        for start, early_ns in self._early:
            if start <= self.cycle:
                now_ns -= early_ns
        return now_ns

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Faults on the path, applied in this order."""
        return self._faults

    @faults.setter
    def faults(self, faults: tuple[Fault, ...]) -> None:
        self._faults = faults
        early = ((fault.start, getattr(fault, "early_ns", 0)) for fault in faults)
        self._early = tuple(row for row in early if row[1]) if faults else ()

    def newest(self, way: Way) -> bytes | None:
        """Return the frame sent last in a direction."""
        frames = self.sent[way]
        return frames[-1][1] if frames else None

    def image(self, way: Way, cycle: int) -> bytes | None:
        """Return the image at the receiver in the given cycle of a channel without faults."""
        for visible, frame in reversed(self.sent[way]):
            if visible <= cycle:
                return frame
        return None

    def shown(self, way: Way) -> bytes | None:
        """Return the image at the receiver in its last turn, faults included."""
        return self._shown[way]

    def turn(self) -> tuple[bytes | None, bytes | None]:
        """Run one end; return the image it saw, and the frame it sent if that is a new one."""
        way, cycle = self.way, self.cycle
        image = self.image(way, cycle)
        # The order of faults matters: a torn copy of a delayed frame differs from a delayed torn
        # one.
        for fault in self._faults:
            if fault.way is way:
                image = fault.apply(self, image)
        # Only a new image is a new event; ends may be called any number of times with the same
        # image.
        if image != self._shown[way]:
            self._shown[way] = image
            feed = self._feed[way]
            if feed is not None:
                back = BACK[way]
                data, enabled = self.application.at(back, cycle, self.sizes[back])
                self._enable(way, feed, data, enabled)
        answer = self.ends[way].step(self.now_ns, image)
        if answer is not None:
            if answer == self.newest(BACK[way]):
                answer = None  # the image is unchanged; some ends return it in every call
            else:
                self._put(way, image, answer)
        table = self.tables[way]
        if table is not None and self.departed is None:
            # After a departure the requirements of the table no longer apply.
            self._compare(way, table, image, answer)
        if way is Way.TO_MAIN:
            self.way = Way.TO_SUB
        else:
            self.way = Way.TO_MAIN
            self.cycle = cycle + 1
        return image, answer

    def _enable(
        self, way: Way, feed: Callable[[bytes, bool | None], None], data: bytes, enabled: bool
    ) -> None:
        # From then on the application is silent, like a crashed program.
        hands_off = self.application.hands_off_from
        if hands_off is not None and self.cycle >= hands_off:
            feed(data, None)
            return
        # The table forbids the enable before state Data.
        enable = enabled and self._in_data[way]
        feed(data, enable)
        table = self.tables[way]
        if table is not None and hasattr(self.ends[way], "enable"):
            table.enabled = enable

    def _compare(
        self, way: Way, table: StateTable, image: bytes | None, answer: bytes | None
    ) -> None:
        found = table.call(self.now_ns, image, answer)
        if found is None:
            end = self.ends[way]
            found = table.shows(valid=end.data_valid, data=end.received_safe_data)
        if found is not None:
            self.departed = way, found

    def _put(self, way: Way, image: bytes | None, answer: bytes) -> None:
        back = BACK[way]
        self.answered_ns[way] = self.now_ns
        self.exchanges[way].append((image, answer))
        self.sent[back].append((self.cycle + self.delay_cycles[back], answer))
        self._in_data[way] = answer[0] in _DATA_COMMANDS

    def run(self, cycles: int) -> None:
        """Run both ends for this number of cycles."""
        for _ in range(2 * cycles):
            self.turn()

    def skip_idle(self) -> int:
        """Skip cycles in which nothing can happen; return their number.

        Only before a turn of the main, and only when both ends state their watchdogs.
        """
        if self.way is not Way.TO_MAIN:
            return 0
        now_ns, due = self.now_ns, []
        for way in Way:
            # A foreign end does not state its watchdog: no cycle may be skipped.
            remaining = getattr(self.ends[way], "watchdog_remaining_ns", None)
            if remaining is None:
                return 0
            left_ns = remaining(now_ns)
            if left_ns is not None:
                due.append(self.cycle - (-left_ns // self.cycle_ns))
            # A frame that is on its way arrives in one of the next cycles.
            if self.sent[way] and self.sent[way][-1][0] >= self.cycle:  # not visible yet
                return 0
        due += [at for fault in self.faults if (at := fault.next_change(self)) is not None]
        skipped = max(0, min(due) - self.cycle) if due else 0
        self.cycle += skipped
        return skipped

    def snapshot(self) -> tuple[Any, ...]:
        """Return the whole state, for `restore`; both ends must be able to fork."""
        return (
            # Shallow copies: frames are bytes and never change, so that a snapshot is cheap.
            tuple(end.snapshot() for end in self.ends),  # type: ignore[attr-defined]
            (self.cycle, self.way, self.faults, self.base, self.application, self.departed),
            [(rows, len(rows)) for rows in self.sent + self.exchanges],
            (tuple(self.answered_ns), tuple(self._shown), tuple(self._in_data)),
            tuple(source.value for source in self.session_ids),
            [None if table is None else table.snapshot() for table in self.tables],
        )

    def restore(self, state: tuple[Any, ...]) -> None:
        """Return to a `snapshot` of this channel, or of one with ends of the same kind."""
        ends, self_state, logs, flags, ids, tables = state
        self.ends[0].restore(ends[0])  # type: ignore[attr-defined]  # can_fork
        self.ends[1].restore(ends[1])  # type: ignore[attr-defined]  # can_fork
        self.cycle, self.way, self.faults, self.base = self_state[:4]
        self.application, self.departed = self_state[4:]
        for table, known in zip(self.tables, tables, strict=True):
            if table is not None:
                table.restore(known)
        rows = [log[:length] for log, length in logs]
        self.sent, self.exchanges = rows[:2], rows[2:]
        answered, shown, in_data = flags
        self.answered_ns, self._shown, self._in_data = list(answered), list(shown), list(in_data)
        for source, value in zip(self.session_ids, ids, strict=True):
            source.value = value

    def forget(self, keep: int) -> None:
        """Drop all but the newest frames of the logs, and restart the exchanges.

        Only for two of our own ends: their chains become the new ``base``.
        """
        self.sent = [rows[-keep:] for rows in self.sent]
        self.exchanges = [[], []]
        self.base = (_chain(self.sub).copy(), _chain(self.main).copy())


def set_sequence(channel: Channel, way: Way, number: int) -> None:
    """Continue a direction with another sequence number, as after a long run.

    Both ends are set, so the connection continues undisturbed.

    Args:
        channel: A channel between two of our own ends.
        way: Direction in which no frame is under way.
        number: Sequence number of the next frame, 1 … 65535.

    Raises:
        ConfigError: A frame is under way in this direction: it was made with the old number.
    """
    sender, receiver = _chain(channel.ends[BACK[way]]), _chain(channel.ends[way])
    if sender.tx_sequence != receiver.rx_sequence:
        raise ConfigError("a frame of this direction is under way")
    sender.tx_sequence = receiver.rx_sequence = number
    to, back = channel.tables[way], channel.tables[BACK[way]]
    if to is not None and back is not None:
        to.rx_sequence = back.tx_sequence = number


def short_hex(data: bytes) -> str:
    """Return bytes as hex for a message; long data are cut and their length is added."""
    if len(data) <= _SHOWN_BYTES:
        return data.hex()
    return f"{data[:_SHOWN_BYTES].hex()}... ({len(data)} bytes)"


def _chain(end: Peer) -> Chain:
    if not isinstance(end, Instance):
        raise ConfigError("only our own ends show their chain")
    return end._chain


def _feed(end: Peer) -> Callable[[bytes, bool | None], None] | None:
    """Return a function that passes application data to an end; ``None`` keeps its enable."""
    take = getattr(end, "set_safe_data", None)
    if take is None:
        return None
    if not hasattr(end, "enable"):
        return lambda data, _enabled: take(data)
    device: Any = end

    def feed(data: bytes, enabled: bool | None) -> None:
        take(data)
        if enabled is not None:
            device.enable = enabled

    return feed
