"""What was found out about a host, and how a check is written."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass

from fsoe_net.host.seam import Host, Unreadable


class MachineLevel(enum.Enum):
    """How a fact of the host bears on real-time EtherCAT."""

    GOOD = "good"
    NOTE = "note"
    WARNING = "warning"
    BAD = "bad"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineFacts:
    """What one check saw; ``now``: commands that fix it at once, ``keep``: what makes it last."""

    level: MachineLevel
    text: str
    now: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineFinding:
    """One fact of the host with its meaning.

    ``name``: which check, stable; ``text``: what was found; ``why``: what it does to the cycle and
    to the watchdogs of FSoE; ``now`` and ``keep``: as `MachineFacts`.
    """

    name: str
    level: MachineLevel
    text: str
    why: str
    now: tuple[str, ...]
    keep: tuple[str, ...]

    def to_json(self) -> dict[str, object]:
        """Return it for the JSON document."""
        return asdict(self) | {"level": self.level.value}


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One look at the host; ``look`` may raise `Unreadable`, which is a finding of its own."""

    name: str
    why: str
    look: Callable[[Host], Iterator[MachineFacts]]


def examined(host: Host, check: Check) -> Iterator[MachineFinding]:
    """Yield the findings of a check."""
    rows: list[MachineFacts] = []
    try:
        rows.extend(check.look(host))
    except Unreadable as why:
        rows.append(MachineFacts(level=MachineLevel.UNKNOWN, text=str(why)))
    for seen in rows:
        yield MachineFinding(
            name=check.name,
            level=seen.level,
            text=seen.text,
            why=check.why,
            now=seen.now,
            keep=seen.keep,
        )
