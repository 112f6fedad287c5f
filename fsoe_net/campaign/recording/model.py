"""Content of a recorded run; the file format is in §13 of the protocol notes."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import dataclass

from fsoe_net.fsoe.config import MainConfig, SubConfig


class SideName(enum.Enum):
    """An end of the connection; the value is its name in the file."""

    MAIN = "master"
    SUB = "slave"

    @property
    def label(self) -> str:
        """Name as shown to people: ``main`` or ``sub``."""
        return self.name.lower()


class OrderKind(enum.Enum):
    """Type of a recorded command to an end."""

    ENABLE = "enable"
    DISABLE = "disable"
    RESET = "reset"
    DATA = "data"
    SESSION = "session"
    POWER_CYCLE = "power_cycle"
    VERIFY = "verify"


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """One recorded command, such as ``slave.data=0f00``.

    Attributes:
        side: The end concerned.
        kind: The call.
        data: Safe data of DATA, else empty.
        number: Session id of SESSION and POWER_CYCLE (``None``: unchanged), code of VERIFY.
    """

    side: SideName
    kind: OrderKind
    data: bytes = b""
    number: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Result of one call, recorded or ours.

    Attributes:
        frame: Frame sent, or ``None``.
        state: Name of the state after the call; ``None`` if the end reports none, like a foreign
            end in a campaign. Then only frames, validity and data are compared.
        reset_by: ``none``, ``this end`` or ``the other end``.
        reset_code: Code of that reset.
        valid: Whether the application has valid data.
        data: Safe data the application sees.
    """

    frame: bytes | None
    state: str | None
    reset_by: str
    reset_code: int | None
    valid: bool
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """One recorded call of one end.

    Attributes:
        safe_data: Safe data from its application.
        received: Input image; ``None`` before the first delivery. Of any length.
        session_id: The session id drawn, if any.
        expected: Its action.
    """

    safe_data: bytes
    received: bytes | None
    session_id: int | None
    expected: Answer


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedStep:
    """One bus cycle: the commands, then one call of each end.

    Attributes:
        number: Step number given in the file.
        time_us: Time of the calls.
        quirk: Both answers are correct from here to the next Reset (§11).
        orders: Commands before the calls.
        calls: Calls of the recorded ends; a scripted end has none.
        sub_frame: Frame sent by the sub's side, of any length.
    """

    number: int
    time_us: int
    quirk: bool
    orders: tuple[Order, ...]
    calls: dict[SideName, Call]
    sub_frame: bytes | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Skip:
    """Cycles in lockstep without loss, recorded only as a hash.

    Attributes:
        cycles: Number of cycles.
        sha256: Hash of all frames, in hex; per cycle, the frame of the main and then of the sub.
    """

    cycles: int
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """The configuration of a recorded run and its lines, which are read on demand.

    Attributes:
        main: Configuration of the MainInstance.
        sub: Configuration of the SubInstance; its verdict is an order.
        first_ids: First session id of each recorded end; scripted ends are missing.
        bus_cycle_us: Bus cycle; 0 if unknown; then the recording must not contain skipped cycles.
        lines: Number of each line with what it holds.
    """

    main: MainConfig
    sub: SubConfig
    first_ids: dict[SideName, int]
    bus_cycle_us: int
    lines: Iterator[tuple[int, RecordedStep | Skip]]
