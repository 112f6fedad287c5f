"""One side of a comparison: common form of networks, plans, descriptions and scans.

A fact is ``None`` where the source is silent, and is then not compared.
"""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.model.description import DescribedConnection
from fsoe_net.model.safety import SafetyFunction


@dataclass(frozen=True, slots=True)
class SideEntry:
    """An entry at its bit in the process data. ``restart``: restart relevant, where known."""

    index: int
    subindex: int
    bit: int
    bits: int
    restart: bool | None = None

    @property
    def address(self) -> str:
        """``0x6000:01``."""
        return f"0x{self.index:04x}:{self.subindex:02x}"


@dataclass(frozen=True, slots=True)
class SideFrame:
    """An FSoE frame; ``address`` is the entry of its command."""

    address: str
    byte: int
    size_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SideManager:
    """One sync manager with process data; entries without padding."""

    index: int
    direction: str
    bits: int | None
    entries: tuple[SideEntry, ...] | None = None
    frames: tuple[SideFrame, ...] = ()
    watchdog: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SideSubDevice:
    """One SubDevice; ``fsoe_addresses`` as devices report them."""

    name: str
    alias: int | None = None
    position: int | None = None
    identity: tuple[int, int] | None = None
    revision: int | None = None
    managers: dict[int, SideManager] | None = None
    sdos: dict[tuple[int, int], tuple[int, int]] | None = None
    fsoe_addresses: tuple[int, ...] | None = None


@dataclass(frozen=True, slots=True)
class SideEnd:
    """An end of a copy: number of the SubDevice, sync manager, bit, and the entry there.

    ``subdevice`` is ``None`` when it is in a file that was not given; ``address`` then names it.
    """

    subdevice: int | None
    sm_index: int
    bit: int
    address: str

    @property
    def place(self) -> tuple[int | None, str]:
        """What stays when data in front change: the SubDevice, and the entry if there is one."""
        return self.subdevice, self.address or f"SM{self.sm_index} bit {self.bit}"


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
        copies: ``None`` when the source has no copies, as an ESI or a scan.
        connections: ``None`` likewise.
        functions: ``None`` likewise, and for a plan, which holds only
        functions_sha256: their hash; empty without any.
    """

    format: str
    path: str
    whole: bool
    cycle_ns: int | None = None
    subdevices: tuple[SideSubDevice, ...] = ()
    copies: tuple[SideCopy, ...] | None = None
    connections: tuple[DescribedConnection, ...] | None = None
    functions: tuple[SafetyFunction, ...] | None = None
    functions_sha256: str | None = None
