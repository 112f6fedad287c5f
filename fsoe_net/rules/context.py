"""The context of every rule, and a shorthand for adding a finding."""

from __future__ import annotations

from collections.abc import Iterator, KeysView, Sequence
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import FindingList
from fsoe_net.diag.guesses import Guesses, one_of
from fsoe_net.diag.words import listed
from fsoe_net.model.bus import Device, Direction, SubDevice
from fsoe_net.model.layout import FsoeBlock, SmLayout
from fsoe_net.model.network import TransferKind
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.transfer_ends import ResolvedEnd, ResolvedTransfer

ACCEPTED = "; after a change: calculate the reaction times again, accept again"
"""End of a hint about a change of the accepted configuration."""
SECURED = "secure the machine, then "
"""Beginning of a hint to work on a device or a cable."""


@dataclass(slots=True, kw_only=True)
class Context(FindingList):
    """One run of the rules over one network.

    The sets prevent that one mistake is reported twice: module pairs that already have an error,
    devices whose PDO groups are exchanged or on no sync manager, nets with an unknown part, each by
    its number. ``name_twice`` is set with FSN134.
    """

    resolution: Resolution
    blamed_pairs: set[frozenset[str]] = field(default_factory=set)
    exchanged: set[int] = field(default_factory=set)
    unassigned: set[int] = field(default_factory=set)
    unsure_nets: set[int] = field(default_factory=set)
    name_twice: bool = False
    _names: dict[str, str] = field(default_factory=dict)
    _used: set[tuple[str, tuple[int, int]]] | None = None
    _guesses: Guesses | None = None

    def devices(self) -> Iterator[tuple[int, Device, SubDevice]]:
        """Yield each device description once, with the first SubDevice that uses it.

        Its number is that of this SubDevice (`Resolution.device_numbers`).
        """
        rows = zip(self.resolution.device_numbers, self.resolution.network.subdevices, strict=True)
        for place, (number, sub) in enumerate(rows):
            if sub.device is not None and number == place:
                yield number, sub.device, sub

    @property
    def names(self) -> KeysView[str]:
        """The names of all SubDevices, in bus order; sets are compared with it by ``<=``, ``&``."""
        if not self._names:
            self._names = {s.name: s.name for s in self.resolution.network.subdevices}
        return self._names.keys()

    def nearest_names(self, name: str) -> tuple[str, ...]:
        """Return the SubDevices that may be meant."""
        if self._guesses is None:
            self._guesses = Guesses(self.names)
        return self._guesses.of(name)

    def name_hint(self, meant: Sequence[str]) -> str:
        """Return the hint for an unknown name: similar names, or else all valid names."""
        if meant:
            return f"write {one_of(meant)}"
        return f"known: {few(sorted(self.names), 20) or 'none'}"

    def is_copied_to(self, sub: SubDevice) -> bool:
        """Whether a standard transfer writes outputs of a SubDevice, which needs no command."""
        return any(
            transfer.kind is TransferKind.STANDARD and transfer.destination.module == sub.name
            for net in self.resolution.network.nets
            for transfer in net.transfers
        )

    def used_blocks(self) -> set[tuple[str, tuple[int, int]]]:
        """Return (SubDevice, frame) of every frame that a transfer uses; calculated once."""
        if self._used is None:
            self._used = {
                (end.subdevice.name, end.block.key)
                for row in self.resolution.transfers
                for end in (row.source, row.destination)
                if end.block is not None and end.subdevice is not None
            }
        return self._used

    def free_frames(
        self, end: ResolvedEnd, direction: Direction, size: int | None = None
    ) -> list[FsoeBlock]:
        """Return the frames of a SubDevice, of this length if given, that no transfer uses."""
        if end.layout is None or end.subdevice is None:
            return []
        name, used = end.subdevice.name, self.used_blocks()
        return [
            block
            for block in end.layout.blocks
            if block.direction is direction
            and size in (None, block.frame_bytes)
            and (name, block.key) not in used
        ]

    def blame(self, row: ResolvedTransfer) -> None:
        """Record that the two modules of a transfer already have their own error."""
        self.blamed_pairs.add(module_pair(row))

    def is_blamed(self, row: ResolvedTransfer) -> bool:
        """Whether the two modules of a transfer already have their own error."""
        return bool(self.blamed_pairs) and module_pair(row) in self.blamed_pairs

    def is_exchanged(self, end: ResolvedEnd) -> bool:
        """Whether the device of this end has its PDO groups exchanged (FSN401)."""
        return self._is_in(end, self.exchanged)

    def is_unassigned(self, end: ResolvedEnd) -> bool:
        """Whether PDOs of the device of this end are on no sync manager (FSN409)."""
        return self._is_in(end, self.unassigned)

    def _is_in(self, end: ResolvedEnd, devices: set[int]) -> bool:
        if not devices or end.subdevice is None:
            return False
        number = self.resolution.numbers[end.subdevice.name]
        return self.resolution.device_numbers[number] in devices


def module_pair(row: ResolvedTransfer) -> frozenset[str]:
    """Return the names of the two modules that a transfer connects."""
    return frozenset((row.transfer.source.module, row.transfer.destination.module))


def describe_sm(sm: SmLayout) -> str:
    """Return ``SM2, MainDevice to SubDevice``."""
    way = (
        "MainDevice to SubDevice"
        if sm.sm.direction.value == "output"
        else ("SubDevice to MainDevice")
    )
    return f"SM{sm.sm.index}, {way}"


def describe_end(end: ResolvedEnd) -> str:
    """Return ``el1918 0x7080:01 is in RxPDO 0x1600 (SM2, MainDevice to SubDevice)``."""
    if end.sm is None or end.placed is None:
        return str(end.endpoint)
    group = "RxPDO" if end.sm.sm.carries == "rpdo" else "TxPDO"
    return f"{end.endpoint} is in {group} 0x{end.placed.pdo.index:04x} ({describe_sm(end.sm)})"


def touched_bytes(end: ResolvedEnd, size_bytes: int) -> tuple[int, int]:
    """Return the first byte of a copy in its SM, and the byte after its last one."""
    return end.byte_offset, end.byte_offset + size_bytes


def few(names: list[str], limit: int = 6) -> str:
    """Return the first names of a list, and the number of further ones."""
    return listed(names, limit)


def block_text(module: str, block: FsoeBlock) -> str:
    """Return ``ek1914 0x7000:01``."""
    return f"{module} {block.command.address}"
