"""Steps of a run, and the expected observations."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Located
from fsoe_net.model.drives import DriveSetup


class Action(enum.Enum):
    """The action of a step."""

    SET = "set"
    PRESS = "press"
    RELEASE = "release"
    BREAK = "break"
    HEAL = "heal"
    POWER_CYCLE = "power_cycle"
    LOCAL_RESET = "local_reset"
    OUTPUT = "output"
    FSOE_ADDRESS = "fsoe_address"
    PLUG = "plug"
    PULL = "pull"
    DRIVE_FAULT = "drive_fault"
    # On an emulated segment only:
    CUT = "cut"
    SPLICE = "splice"
    SWAP = "swap"
    WRONG = "wrong"
    RIGHT = "right"
    NARROW_CLOCK = "narrow_clock"
    SDO_ABORT = "sdo_abort"
    MAILBOX_DELAY = "mailbox_delay_ms"
    AL_DELAY = "al_delay_ms"
    RX_ERRORS = "rx_errors"
    LOSE = "lose"
    LOSE_EVERY = "lose_every"
    REPEAT = "repeat"
    DELAY = "delay_us"
    STALL = "stall_ms"

    @property
    def needs_segment(self) -> bool:
        """Whether it requires an emulated EtherCAT segment."""
        return self in _ON_SEGMENT


_ON_SEGMENT = frozenset(Action) - {
    Action.SET,
    Action.PRESS,
    Action.RELEASE,
    Action.BREAK,
    Action.HEAL,
    Action.POWER_CYCLE,
    Action.LOCAL_RESET,
    Action.OUTPUT,
    Action.FSOE_ADDRESS,
    Action.PLUG,
    Action.PULL,
    Action.DRIVE_FAULT,
}


RESET_OF_ALL = "reset"
"""Target of a button: the reset of each safety logic."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioStep(Located):
    """An action at a time.

    ``target`` is the SubDevice or connection, or `RESET_OF_ALL`; ``other`` is what it is swapped
    with. ``values`` are values by name: of signals, by SubDevice, or the fields of ``wrong`` and
    ``sdo_abort``. ``number`` is a count or a time in the unit of the action.
    """

    at_ns: int
    action: Action
    target: str = ""
    other: str = ""
    number: int = 0
    values: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation(Located):
    """A condition from ``from_ns`` to ``to_ns`` (equal for a single moment).

    ``drives`` are states of emulated axes, in the words of a statusword.

    ``state`` is a word such as ``data_process`` for ``connection`` (empty: for all).
    ``safe_outputs`` are values that SubInstances pass to their outputs. ``outputs_on`` is the
    verdict of the logic. ``min_resets`` and ``max_resets`` bound the Resets since the start.
    """

    from_ns: int
    to_ns: int
    connection: str = ""
    state: str = ""
    safe_outputs: Mapping[str, int] = field(default_factory=dict)
    outputs_on: bool | None = None
    min_resets: int | None = None
    max_resets: int | None = None
    drives: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class LogicChoice:
    """The safe inputs that must be 1, and the safe outputs to switch; ``None`` for the default.

    ``delays_ns`` are outputs that switch off later than the others, such as those of an SS1.
    """

    inputs: tuple[str, ...] | None = None
    outputs: tuple[str, ...] | None = None
    delays_ns: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario(Located):
    """A scenario file; ``drives`` are emulated axes by name."""

    path: str
    duration_ns: int | None
    initial: Mapping[str, int] = field(default_factory=dict)
    logic: LogicChoice = field(default_factory=LogicChoice)
    drives: Mapping[str, DriveSetup] = field(default_factory=dict)
    steps: tuple[ScenarioStep, ...] = ()
    expectations: tuple[Expectation, ...] = ()
