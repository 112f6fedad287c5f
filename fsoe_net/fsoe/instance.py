"""Shared by MainInstance and SubInstance: safe data, watchdog, events, frames in and out."""

from __future__ import annotations

import abc
from collections import deque
from collections.abc import Callable
from typing import Any

from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.chain import Chain, reset_frame
from fsoe_net.fsoe.crc import frame_crcs
from fsoe_net.fsoe.event import Event, EventKind, State
from fsoe_net.fsoe.pdu import Command, Pdu, ResetCode, decode_pdu, frame_length

_MAX_EVENTS = 1024
_MAX_DRAWS = 16


class Instance(abc.ABC):
    """One end of a connection; `MainInstance` and `SubInstance` add their state tables.

    Attributes:
        enable: Whether ProcessData may be sent; otherwise FailSafeData with zeros. Set it in state
            Data only: if set earlier, the very first data frame is ProcessData. Every reset clears
            it (§9).
        state: State of the connection.
        connection_id: ConnID in use, 0 if there is none.
    """

    def __init__(self, *, sends: int, receives: int, session_ids: Callable[[], int]) -> None:
        self._sends = sends
        self._receives = receives
        self._rx_bytes = frame_length(receives)
        self._chunk_bytes = min(sends, receives)  # §4: the smaller size, in both directions
        self._session_ids = session_ids
        # §11.3: first Session frames must not look like a Reset frame or an empty image.
        self._shunned_crcs = frozenset(
            {0} | {decode_pdu(reset_frame(code, sends)).crcs[0] for code in ResetCode}
        )
        self._power_up()

    def _power_up(self) -> None:
        self.enable = False
        self.state = State.RESET
        self.connection_id = 0
        self._events: deque[Event] = deque(maxlen=_MAX_EVENTS)
        self._chain = Chain()
        self._tx_safe = bytes(self._sends)
        self._rx_safe = bytes(self._receives)
        self._valid = False
        self._seen = bytes(self._rx_bytes)  # §10, §16: an empty process image is not an event
        self._now_ns = 0
        self._watchdog_ns = 0
        self._watchdog_start_ns: int | None = None
        self._reset_requested = False

    @abc.abstractmethod
    def step(self, now_ns: int, received: bytes | None) -> bytes | None:
        """Read at most one frame and send at most one.

        Args:
            now_ns: Monotonic time, never decreasing.
            received: Frame bytes in the input image; unchanged bytes are not an event, nor is a
                frame of a wrong length. ``None`` before the first delivery.

        Returns:
            The frame for the output image, or ``None`` to leave the image unchanged.
        """

    @property
    def received_safe_data(self) -> bytes:
        """Safe data for the application; zeros if they are not valid."""
        return self._rx_safe

    @property
    def data_valid(self) -> bool:
        """Whether the last accepted frame was ProcessData and the state is still Data."""
        return self._valid

    def set_safe_data(self, data: bytes) -> None:
        """Set the safe data that this end sends while in Data and enabled.

        Raises:
            ConfigError: Wrong number of bytes.
        """
        if len(data) != self._sends:
            raise ConfigError(f"{len(data)} safe data bytes given; this end sends {self._sends}")
        self._tx_safe = bytes(data)

    def request_reset(self) -> None:
        """Reset the connection in the next step, with code 0."""
        self._reset_requested = True

    def power_cycle(self) -> None:
        """Reset all state, as if the device were switched off and on."""
        self._power_up()

    def snapshot(self) -> dict[str, Any]:
        """Return the complete state of this end, for `restore`; later steps do not change it."""
        state = self.__dict__.copy()
        state["_chain"] = self._chain.copy()
        state["_events"] = self._events.copy()
        return state

    def restore(self, state: dict[str, Any]) -> None:
        """Return to a `snapshot` of this end, any number of times.

        The source of session ids belongs to the caller and is not reset.
        """
        self.__dict__.update(state)
        self._chain = state["_chain"].copy()
        self._events = state["_events"].copy()

    def take_events(self) -> list[Event]:
        """Return the events since the last call, oldest first; at most the newest 1024."""
        events = list(self._events)
        self._events.clear()
        return events

    def watchdog_remaining_ns(self, now_ns: int) -> int | None:
        """Return the time until the watchdog expires, or ``None`` if it is not running."""
        if self._watchdog_start_ns is None:
            return None
        return max(0, self._watchdog_start_ns + self._watchdog_ns - now_ns)

    def _watchdog_expired(self) -> bool:
        """§8: it has expired at exactly T after the start."""
        start_ns = self._watchdog_start_ns
        return start_ns is not None and self._now_ns - start_ns >= self._watchdog_ns

    def _new_frame(self, received: bytes | None) -> Pdu | None:
        """Return the frame if it is an event: valid length (§1), any byte new (§10)."""
        if received is None or len(received) != self._rx_bytes or received == self._seen:
            return None
        self._seen = bytes(received)
        return decode_pdu(self._seen)

    def _enter(self, state: State, kind: EventKind = EventKind.STATE, code: int = 0) -> None:
        before, self.state = self.state, state
        if before is state and kind is EventKind.STATE:
            return
        self._events.append(
            Event(now_ns=self._now_ns, kind=kind, code=code, state_before=before, state_after=state)
        )

    def _clear_safe_data(self) -> None:
        """§9: the application receives zeros and must enable again."""
        self._rx_safe, self._valid = bytes(self._receives), False
        self.enable = False

    def _reset(self, code: int, *, by_peer: int | None = None) -> bytes:
        """Return a Reset frame and enter state Reset.

        Args:
            code: Code to send.
            by_peer: Code in the Reset frame that this one acknowledges.
        """
        self._chain.clear()
        self._clear_safe_data()
        self.connection_id = 0
        if by_peer is None:
            self._enter(State.RESET, EventKind.RESET_LOCAL, code)
        else:
            self._enter(State.RESET, EventKind.RESET_BY_PEER, by_peer)
        return reset_frame(code, self._sends)

    def _draw_session_id(self) -> bytes:
        """Return a new session id, low byte first.

        §11.3, §16: drawn again if CRC_0 of the first Session frame would be 0 or that of a Reset
        frame, which some receivers reject. If a source yields only such ids, one is finally used.
        """
        session_id = b""
        for _ in range(_MAX_DRAWS):
            session_id = (self._session_ids() & 0xFFFF).to_bytes(2, "little")
            data = self._padded(session_id[: self._chunk_bytes])
            if frame_crcs(self._chain.last, 0, 1, Command.SESSION, data)[0] in self._shunned_crcs:
                continue
            break
        return session_id

    def _padded(self, chunk: bytes) -> bytes:
        return chunk.ljust(self._sends, b"\0")

    def _send(self, command: Command, chunk: bytes) -> bytes:
        """Return a frame of the chain; §4: unused bytes are 0, ConnID is 0 in Session."""
        return self._chain.send(command, self._padded(chunk), self.connection_id)

    def _send_data(self) -> bytes:
        """Return ProcessData if enabled, otherwise FailSafeData with zeros (§9, §16)."""
        if self.enable:
            return self._send(Command.PROCESS_DATA, self._tx_safe)
        return self._send(Command.FAIL_SAFE_DATA, b"")

    def _take_data(self, pdu: Pdu) -> None:
        """§9: whatever FailSafeData contains, the application receives zeros (§16)."""
        self._valid = pdu.command == Command.PROCESS_DATA
        self._rx_safe = pdu.safe_data if self._valid else bytes(self._receives)
