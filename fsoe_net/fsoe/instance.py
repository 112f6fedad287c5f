"""What MainInstance and SubInstance share: configuration, events, chunks, watchdog, safe data."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.chain import Chain, reset_frame
from fsoe_net.fsoe.pdu import SAFE_SIZES, Command, Pdu, decode_pdu, frame_crcs, frame_length

__all__ = ["Event", "EventKind", "Instance", "MainConfig", "State", "SubConfig", "Verdict"]

_DATA_COMMANDS = (Command.PROCESS_DATA, Command.FAIL_SAFE_DATA)
_RESET_CODES = range(12)
_MAX_EVENTS = 1024

SessionIds = Callable[[], int]
Verdict = Callable[[int, bytes], int]


class State(enum.Enum):
    """State of a connection end."""

    RESET = "reset"
    SESSION = "session"
    CONNECTION = "connection"
    PARAMETER = "parameter"
    DATA = "data"


class EventKind(enum.Enum):
    """What an event tells."""

    STATE = "state"
    RESET_SENT = "reset_sent"
    RESET_RECEIVED = "reset_received"


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something worth logging. ``code`` is the reset code, 0 for plain state changes."""

    now_ns: int
    kind: EventKind
    code: int
    before: State
    after: State


def _need(good: bool, message: str) -> None:
    if not good:
        raise ConfigError(message)


def _check_sizes(to_sub: int, to_main: int) -> None:
    for name, value in (("safe_to_sub", to_sub), ("safe_to_main", to_main)):
        _need(value in SAFE_SIZES, f"{name} is {value}; allowed are 1, 2, 4, 6 … 126 bytes")


@dataclass(frozen=True, slots=True, kw_only=True)
class MainConfig:
    """Configuration of a MainInstance.

    Args:
        connection_id: 1 … 65535, unique in the network.
        address: FSoE address of the SubInstance, 0 … 65535.
        watchdog_ms: 1 … 65535, used here and sent to the SubInstance.
        safe_to_sub: Safe data bytes to the SubInstance: 1, 2, 4 … 126.
        safe_to_main: Safe data bytes from the SubInstance: 1, 2, 4 … 126.
        app_parameters: Application parameters, low bytes first.

    Raises:
        ConfigError: A value is outside its range; the message names it.
    """

    connection_id: int
    address: int
    watchdog_ms: int
    safe_to_sub: int
    safe_to_main: int
    app_parameters: bytes = b""

    def __post_init__(self) -> None:
        _need(1 <= self.connection_id <= 0xFFFF, f"connection_id {self.connection_id}: 1 … 65535")
        _need(0 <= self.address <= 0xFFFF, f"address {self.address}: 0 … 65535")
        _need(1 <= self.watchdog_ms <= 0xFFFF, f"watchdog_ms {self.watchdog_ms}: 1 … 65535")
        _need(len(self.app_parameters) <= 0xFFFF, "app_parameters: at most 65535 bytes")
        _check_sizes(self.safe_to_sub, self.safe_to_main)


@dataclass(frozen=True, slots=True, kw_only=True)
class SubConfig:
    """Configuration of a SubInstance.

    Args:
        address: Own FSoE address, 0 … 65535.
        safe_to_sub: Safe data bytes received.
        safe_to_main: Safe data bytes sent.
        app_parameter_bytes: Expected length of the application parameters.
        verify: Called with watchdog (ms) and application parameters when they are complete;
            returns 0 to accept, else the reset code (9, 11, 0x80 … 0xFF). ``None`` accepts all.

    Raises:
        ConfigError: A value is outside its range; the message names it.
    """

    address: int
    safe_to_sub: int
    safe_to_main: int
    app_parameter_bytes: int = 0
    verify: Verdict | None = None

    def __post_init__(self) -> None:
        _need(0 <= self.address <= 0xFFFF, f"address {self.address}: 0 … 65535")
        _need(0 <= self.app_parameter_bytes <= 0xFFFF, "app_parameter_bytes: 0 … 65535")
        _check_sizes(self.safe_to_sub, self.safe_to_main)


class Instance:
    """One end of a connection; `MainInstance` and `SubInstance` add their state tables.

    Args:
        sends: Safe data bytes this end sends.
        receives: Safe data bytes this end receives.
        session_ids: Source of 16-bit session ids; a new one is drawn for every session.
    """

    def __init__(self, *, sends: int, receives: int, session_ids: SessionIds) -> None:
        self.enable = False
        self.state = State.RESET
        self.connection_id = 0
        self._sends = sends
        self._receives = receives
        self._rx_bytes = frame_length(receives)
        self._chunk = min(sends, receives)  # §4: both directions use the smaller size
        self._session_ids = session_ids
        self._chain = Chain()
        self._tx_safe = bytes(sends)
        self._rx_safe = bytes(receives)
        self._valid = False
        # §16: the memory for unchanged frames starts as an empty process image.
        self._seen = bytes(self._rx_bytes)
        self._now_ns = 0
        self._watchdog_start_ns: int | None = None
        self._reset_requested = False
        self._events: list[Event] = []

    @property
    def received_safe_data(self) -> bytes:
        """Safe data for the application; zeros while not valid."""
        return self._rx_safe

    @property
    def data_valid(self) -> bool:
        """Whether the last accepted frame was ProcessData in state Data."""
        return self._valid

    def set_safe_data(self, data: bytes) -> None:
        """Set what this end sends while `enable` is on.

        Raises:
            ConfigError: Wrong number of bytes.
        """
        _need(len(data) == self._sends, f"{len(data)} safe data bytes given, {self._sends} needed")
        self._tx_safe = bytes(data)

    def request_reset(self) -> None:
        """Reset the connection in the next step (code 0)."""
        self._reset_requested = True

    def take_events(self) -> list[Event]:
        """Return the events since the last call."""
        events, self._events = self._events, []
        return events

    def _log(self, kind: EventKind, code: int, before: State) -> None:
        if len(self._events) < _MAX_EVENTS:
            self._events.append(
                Event(now_ns=self._now_ns, kind=kind, code=code, before=before, after=self.state)
            )

    def _enter(self, state: State) -> None:
        before, self.state = self.state, state
        if before is not state:
            self._log(EventKind.STATE, 0, before)

    def _fail_safe(self) -> None:
        self._rx_safe, self._valid = bytes(self._receives), False

    def _reset(self, code: int) -> bytes:
        """Send a Reset: clear chain, safe data and enable (§5, §6, §9)."""
        before = self.state
        self.state = State.RESET
        self._log(EventKind.RESET_SENT, code, before)
        self._chain.clear()
        self._fail_safe()
        self.enable = False
        self.connection_id = 0
        return reset_frame(code, self._sends)

    def _new_frame(self, received: bytes | None) -> Pdu | None:
        """Return a frame that is an event (§10): right length, any byte differs from the last."""
        if received is None or len(received) != self._rx_bytes or received == self._seen:
            return None
        self._seen = bytes(received)
        return decode_pdu(received)

    def _draw_session_id(self, old: int) -> bytes:
        """Return a session id whose first frame no known variant mistakes (§11.3)."""
        for _ in range(16):
            session = (self._session_ids() & 0xFFFF).to_bytes(2, "little")
            data = session[: self._chunk] + bytes(self._sends - min(2, self._chunk))
            crc = frame_crcs(old, 0, 1, Command.SESSION, data)[0]
            if crc and crc not in self._reset_crcs():
                break
        return session

    def _reset_crcs(self) -> set[int]:
        return {
            frame_crcs(0, 0, 1, Command.RESET, bytes((c,)) + bytes(self._sends - 1))[0]
            for c in _RESET_CODES
        }

    def _send(self, command: Command, data: bytes) -> bytes:
        in_session = command is Command.SESSION
        padded = data + bytes(self._sends - len(data))
        return self._chain.seal(command, padded, 0 if in_session else self.connection_id)

    def _send_data(self) -> bytes:
        """ProcessData when enabled, else FailSafeData with zeros (§9, §16)."""
        if self.enable:
            return self._send(Command.PROCESS_DATA, self._tx_safe)
        return self._send(Command.FAIL_SAFE_DATA, bytes(self._sends))

    def _take_data(self, pdu: Pdu) -> None:
        """Rows 19 and 20 of the main, 22 and 23 of the sub: what the application sees."""
        if pdu.command == Command.PROCESS_DATA:
            self._rx_safe, self._valid = pdu.safe_data, True
        else:
            self._fail_safe()


def is_known(command: int) -> bool:
    """Whether a command byte is one of the six."""
    return command in _KNOWN


_KNOWN = frozenset(int(c) for c in Command)


def is_data(command: int) -> bool:
    """Whether a command carries safe data."""
    return command in _DATA_COMMANDS
