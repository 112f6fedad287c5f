"""Safety functions as stated by the user: action, parts, and time limit."""

from __future__ import annotations

import enum

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Located


class ElementKind(enum.Enum):
    """The part of a safety function that an element forms, in the order of the signal."""

    SENSOR = "sensor"
    INPUT = "input"
    LOGIC = "logic"
    OUTPUT = "output"
    ACTUATOR = "actuator"


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeBit(Located):
    """A bit of the safe data of an FSoE frame that carries the signal of an element.

    Attributes:
        bit: Number in the safe data of the frame, from 0, the lowest bit of each byte first.
        name: Common name of the signal, such as ``K1``.
        slot: Frame pair of the SubDevice (`frame_pairs`), from 0; ``None`` when not stated.
    """

    bit: int
    name: str
    slot: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyElement(Located):
    """One part of a safety function.

    Attributes:
        kind: The part of the function.
        sub: Name of the SubDevice; empty for other parts, such as a contactor.
        name: Common name; by default the name of the SubDevice.
        time_ms: Processing time in ms according to its manual; ``None`` if not stated.
        pfh_per_hour: PFH per hour according to its manual; ``None`` if not stated.
        zero_because: Reason for a time or PFH of 0, in words; empty when not stated.
        pl: Performance level that its manual claims, ``a`` … ``e``; empty when not stated.
        sil: Safety integrity level that its manual claims, 1 … 3; ``None`` when not stated.
        category: ``B``, ``1`` … ``4`` by ISO 13849-1; empty when not stated.
        mission_years: Mission time, for which its PFH holds, in years; ``None`` when not stated.
        source: Source of all values, in words.
        manual: Revision of the manual consulted; empty when not stated.
        bits: Safe bits that carry its signal, ascending by slot and bit; empty if not stated. An
            input has them in the frame that its SubDevice sends, an output in the frame that it
            receives.
    """

    kind: ElementKind
    sub: str = ""
    name: str
    time_ms: float | None = None
    pfh_per_hour: float | None = None
    zero_because: str = ""
    pl: str = ""
    sil: int | None = None
    category: str = ""
    mission_years: float | None = None
    source: str = ""
    manual: str = ""
    bits: tuple[SafeBit, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyFunction(Located):
    """A safety function as required by the user.

    Attributes:
        name: Unique in the network.
        trigger: The event, in words.
        reaction: The state that is reached, in words.
        reset: How the function is reset, in words.
        modes: Operating modes of the machine in which it is active, in words.
        elements: Parts in the order of the signal.
        required_reaction_ms: Longest time allowed by the risk assessment, ms.
        pl: Required performance level, ``a`` … ``e``; empty when not stated.
        sil: Required safety integrity level, 1 … 3; ``None`` when not stated.
    """

    name: str
    trigger: str = ""
    reaction: str = ""
    reset: str = ""
    modes: str = ""
    elements: tuple[SafetyElement, ...]
    required_reaction_ms: float | None = None
    pl: str = ""
    sil: int | None = None


def level_words(of: SafetyElement | SafetyFunction) -> list[str]:
    """Return the claimed or required levels, such as ``PL d``, ``SIL 2``; none if not stated."""
    pl = [f"PL {of.pl}"] if of.pl else []
    return pl if of.sil is None else [*pl, f"SIL {of.sil}"]
