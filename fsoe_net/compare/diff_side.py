"""One side of a comparison: common form of networks, plans, descriptions and scans.

A fact is ``None`` where the source is silent, and is then not compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fsoe_net.diag.words import identity_text
from fsoe_net.model.description import DescribedConnection
from fsoe_net.model.layout import SmLayout
from fsoe_net.model.safety import SafetyFunction

Managers = Mapping[int, SmLayout]
"""The sync managers with process data by number."""
Sdos = dict[tuple[int, int], tuple[int, int]]
"""Size and value of start-up SDOs by index and subindex."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SideSubDevice:
    """One SubDevice; ``fsoe_addresses`` as devices report them."""

    name: str
    alias: int | None = None
    position: int | None = None
    identity: tuple[int, int] | None = None
    revision: int | None = None
    managers: Managers | None = None
    sdos: Sdos | None = None
    fsoe_addresses: tuple[int, ...] | None = None

    @property
    def place(self) -> tuple[int, int] | None:
        """Its alias and position, where it has a place in a ring."""
        return None if self.position is None else (self.alias or 0, self.position)

    @property
    def title(self) -> str:
        """Its name, else its position."""
        if self.name:
            return self.name
        return "unnamed SubDevice" if self.position is None else f"position {self.position}"

    @property
    def identity_text(self) -> str | None:
        """``vendor 0x00000002, product 0x07703052``."""
        if self.identity is None:
            return None
        return identity_text(*self.identity)


@dataclass(frozen=True, slots=True)
class SideEnd:
    """An end of a copy: number of the SubDevice, and the entry there.

    ``subdevice`` is ``None`` when it is in a file that was not given; ``address`` then names it.
    Without an entry, ``address`` is the sync manager and the bit.
    """

    subdevice: int | None
    address: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SideCopy:
    """One copy; ``kind`` is ``fsoe``, ``standard`` or ``None``."""

    source: SideEnd
    destination: SideEnd
    bits: int
    kind: str | None = None
    net: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """All facts of one source.

    Attributes:
        format: ``network``, ``plan``, ``scan``, ``eni`` and so on.
        path: Path of the source.
        whole: ``None`` inside it means *not set*, which differs from a value on the other side.
        cycle_ns: Cycle of the bus; of several, that of the first.
        bus_cycles: Cycles of all buses but the first by name.
        copies: ``None`` when the source has no copies, as an ESI or a scan.
        connections: ``None`` likewise.
        functions: ``None`` likewise, and for a plan, which holds only
        functions_sha256: their hash; empty without any.
    """

    format: str
    path: str
    whole: bool
    cycle_ns: int | None = None
    bus_cycles: Mapping[str, int | None] = field(default_factory=dict)
    subdevices: tuple[SideSubDevice, ...] = ()
    copies: tuple[SideCopy, ...] | None = None
    connections: tuple[DescribedConnection, ...] | None = None
    functions: tuple[SafetyFunction, ...] | None = None
    functions_sha256: str | None = None
