"""Answers of a user to questions that files leave open: ring, roles, frames, connections."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.model.bus import Located
from fsoe_net.model.network import ConnectionFacts


class Ask(enum.Enum):
    """The subject of a question; the values are the keys of an answers file."""

    SUBDEVICES = "subdevices"
    PROCESS_DATA = "process_data"
    FRAMES = "frames"
    MAIN = "main"
    CONNECTIONS = "connections"


@dataclass(frozen=True, slots=True, kw_only=True)
class AnsweredDevice(Located):
    """``count`` consecutive SubDevices of a type; ``position`` is that of the first one."""

    type: str
    name: str = ""
    count: int = 1
    position: int | None = None
    revision: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AnsweredWord(Located):
    """A word with its place: the name of a SubDevice or of process data, or yes and no."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers(Located):
    """All answers.

    Attributes:
        name: Name of the network.
        cycle_us: Bus cycle in microseconds.
        subdevices: SubDevices in ring order; only if no file lists them.
        main: The SubDevices that are FSoE MainInstances; ``None`` if not answered.
        process_data: Mapping of the device library to use, by SubDevice.
        frames: Whether the probable frames of a SubDevice are FSoE frames.
        connections: Connections and known facts about them.
        passed: Questions that a person has left open.
    """

    name: str = ""
    cycle_us: int | None = None
    subdevices: tuple[AnsweredDevice, ...] = ()
    main: tuple[AnsweredWord, ...] | None = None
    process_data: Mapping[str, AnsweredWord] = field(default_factory=dict)
    frames: Mapping[str, AnsweredWord] = field(default_factory=dict)
    connections: tuple[ConnectionFacts, ...] = ()
    passed: frozenset[tuple[Ask, str, int | None]] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """A question that only a person can answer.

    Attributes:
        ask: Kind of question.
        subject: Name of the SubDevice; may be empty.
        sub_slot: Its frame, if it has several.
        text: The question.
        facts: Known facts, one line each.
        choices: Possible answers with their meaning; empty for any text.
        span: The file that leaves the question open.
    """

    ask: Ask
    text: str
    subject: str = ""
    sub_slot: int | None = None
    facts: tuple[str, ...] = ()
    choices: tuple[tuple[str, str], ...] = ()
    span: Span = field(default=Span(""), compare=False, repr=False)

    @property
    def key(self) -> tuple[Ask, str, int | None]:
        """The key that distinguishes questions."""
        return (self.ask, self.subject, self.sub_slot)
