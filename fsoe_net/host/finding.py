"""Findings about a host, and the form of a check."""

from __future__ import annotations

import enum
import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass

from fsoe_net.host.seam import Host, Unreadable


class MachineLevel(enum.Enum):
    """Effect of a fact about the host on real-time EtherCAT."""

    GOOD = "good"
    NOTE = "note"
    WARNING = "warning"
    BAD = "bad"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineFix:
    """A fix that can be undone.

    ``do`` and ``undo``: commands of a shell; ``undo`` restores the values that were read. ``boot``:
    words to add to the kernel command line, which count after a reboot only.
    """

    do: tuple[str, ...] = ()
    undo: tuple[str, ...] = ()
    boot: str = ""


def written(new: Mapping[str, str], old: Mapping[str, str]) -> MachineFix:
    """Return the fix that writes new contents to files, each of which has an old one."""
    return MachineFix(do=tuple(map(_write, new.items())), undo=tuple(map(_write, old.items())))


def _write(row: tuple[str, str]) -> str:
    # Old contents are those of the kernel, and never code of the script.
    path, text = map(shlex.quote, row)
    return f"printf '%s\\n' {text} > {path}"


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineFacts:
    """Result of one check; ``now``: commands that fix it, ``keep``: how to make that permanent."""

    level: MachineLevel
    text: str
    now: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()
    fix: MachineFix | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineFinding:
    """One fact about the host with its meaning.

    ``name``: stable name of the check; ``text``: the fact; ``why``: its effect on the cycle and on
    the FSoE watchdogs; ``now``, ``keep`` and ``fix``: see `MachineFacts`.
    """

    name: str
    level: MachineLevel
    text: str
    why: str
    now: tuple[str, ...]
    keep: tuple[str, ...]
    fix: MachineFix | None = None

    def to_json(self) -> dict[str, object]:
        """Return the finding for the JSON document."""
        document = asdict(self) | {"level": self.level.value}
        del document["fix"]  # `fix_script` and `undo_script` are its form for programs
        return document


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One check of the host; ``look`` may raise `Unreadable`, which becomes a separate finding."""

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
            fix=seen.fix,
        )
