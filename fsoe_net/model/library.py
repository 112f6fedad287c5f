"""Prior knowledge about FSoE devices: identity, process data, frames, figures, sources.

The library is used for proposals and explanations. The device and its files take precedence.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.words import counted
from fsoe_net.fsoe.pdu import safe_data_length
from fsoe_net.model.bus import Device, Direction, Entry, Located, Pdo, SyncManager
from fsoe_net.model.layout import DeviceLayout


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryIdentity(Located):
    """One identity that shares the facts of a library device."""

    order: str
    vendor_id: int
    product_code: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryFrame(Located):
    """One FSoE frame as stated by the library; ``byte_offset`` is within the sync manager."""

    sm_index: int
    byte_offset: int
    frame_bytes: int
    safe_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryMapping(Located):
    """Process data observed for a device.

    Attributes:
        name: Distinguishes the mappings of a device.
        role: ``sub`` (SubInstance) or ``main`` (MainInstance, safety logic).
        source: Key of `LibraryDevice.sources`.
        sync_managers: With their PDOs. PDO 0, which is padding only, represents unknown preceding
            PDOs.
        frames: Stated frames, by sync manager and place.
        restart_relevant: Index and subindex of standard outputs that can start a machine.
        revision_from: First revision it was observed on; ``None`` if unknown.
        revision_to: Last revision it applies to; ``None`` if open.
        module_ident: Module that adds it; ``None`` for PDOs of the device itself.
        notes: Notes for the user.
    """

    name: str
    role: str
    source: str
    sync_managers: tuple[SyncManager, ...]
    frames: tuple[LibraryFrame, ...]
    restart_relevant: tuple[tuple[int, int], ...] = ()
    revision_from: int | None = None
    revision_to: int | None = None
    module_ident: int | None = None
    notes: tuple[str, ...] = ()

    @property
    def slots(self) -> int:
        """Connections of a safety logic in this mapping; 0 for a SubInstance."""
        if self.role != "main":
            return 0
        outputs = {s.index for s in self.sync_managers if s.direction is Direction.OUTPUT}
        return sum(f.sm_index in outputs for f in self.frames)

    def fits(self, revision: int | None) -> bool:
        """Whether it may apply to a revision; always true if the revision is unknown."""
        if revision is None:
            return True
        return (self.revision_from or 0) <= revision and (
            self.revision_to is None or revision <= self.revision_to
        )

    def device(self, identity: LibraryIdentity, path: str) -> Device:
        """Return a device with this mapping."""
        return Device(
            path=path,
            vendor_id=identity.vendor_id,
            product_code=identity.product_code,
            sync_managers=self.sync_managers,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LibrarySide(Located):
    """Where the frames of connection 0 are in one direction."""

    sm_index: int
    pdo: int
    object: int
    data: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryPattern(Located):
    """Process data of safety logic, with as many connections as its safety project has.

    Attributes:
        source: Key of `LibraryDevice.sources`.
        most: Maximum number of connections.
        step: Distance of the objects of two connections; PDOs are consecutive.
        outputs: Frames of SubInstances, to the device.
        inputs: Frames of its MainInstances.
    """

    source: str
    most: int
    step: int
    outputs: LibrarySide
    inputs: LibrarySide

    def mapping(self, lengths: Sequence[tuple[int, int]]) -> LibraryMapping:
        """Return the process data for connections with these bytes to the device and from it.

        Raises:
            ValueError: No connection, more than ``most``, or a length that FSoE does not have.
        """
        if not 0 < len(lengths) <= self.most:
            raise ValueError(f"the device has 1 to {self.most} connections, not {len(lengths)}")
        sides = (
            (self.outputs, Direction.OUTPUT, [to for to, _ in lengths]),
            (self.inputs, Direction.INPUT, [back for _, back in lengths]),
        )
        return LibraryMapping(
            span=self.span,
            name=f"{counted(len(lengths), 'connection')} by its pattern",
            role="main",
            source=self.source,
            sync_managers=tuple(
                SyncManager(
                    span=self.span,
                    index=side.sm_index,
                    direction=direction,
                    pdos=tuple(self._pdo(side, n, size) for n, size in enumerate(sizes)),
                )
                for side, direction, sizes in sides
            ),
            frames=tuple(
                LibraryFrame(
                    span=self.span,
                    sm_index=side.sm_index,
                    byte_offset=sum(sizes[:n]),
                    frame_bytes=size,
                    safe_bytes=safe_data_length(size),
                )
                for side, _, sizes in sides
                for n, size in enumerate(sizes)
            ),
        )

    def _pdo(self, side: LibrarySide, number: int, frame_bytes: int) -> Pdo:
        shift, safe = self.step * number, safe_data_length(frame_bytes)
        rows = [(side.object, 1, 8)]
        # A block of safe data, one byte or two, and its CRC; the connection ID is last.
        for block in range((safe + 1) // 2):
            rows += [(side.data, block + 1, min(safe, 2) * 8), (side.object, block + 3, 16)]
        rows.append((side.object, 2, 16))
        entries = (
            Entry(span=self.span, index=index + shift, subindex=sub, bits=bits)
            for index, sub, bits in rows
        )
        return Pdo(span=self.span, index=side.pdo + number, entries=tuple(entries))


class DeviceFunction(Enum):
    """What a person looks for in the list of devices."""

    SAFE_INPUT = "safe_input"
    SAFE_OUTPUT = "safe_output"
    DRIVE = "drive"
    SAFETY_LOGIC = "safety_logic"


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryFigure(Located):
    """A device time (``…_ms``) or ``pfh_per_hour`` of a public source; never verified here."""

    name: str
    value: float
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryDevice(Located):
    """One device.

    Attributes:
        sources: Sources of the facts, by key.
        mappings: Observed process data; none if they are defined by a project of the user.
        role: ``sub`` or ``main`` for a device without mappings; otherwise empty, as the mappings
            state it.
        functions: Its functions, for the search in a list of devices.
        connections: Pattern of its process data, for safety logic.
    """

    name: str
    about: str
    identities: tuple[LibraryIdentity, ...]
    sources: dict[str, str]
    mappings: tuple[LibraryMapping, ...]
    role: str = ""
    functions: tuple[DeviceFunction, ...] = ()
    connections: LibraryPattern | None = None
    figures: tuple[LibraryFigure, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def roles(self) -> tuple[str, ...]:
        """Sides of FSoE connections that it can be on, ``main`` first."""
        return tuple(sorted({m.role for m in self.mappings} or {self.role}))


@dataclass(frozen=True, slots=True, kw_only=True)
class Library:
    """All devices, by name."""

    devices: tuple[LibraryDevice, ...]

    def find(self, vendor_id: int, product_code: int) -> LibraryDevice | None:
        """Return the device with an identity, or ``None``."""
        wanted = (vendor_id, product_code)
        for device in self.devices:
            if any((i.vendor_id, i.product_code) == wanted for i in device.identities):
                return device
        return None

    def named(self, name: str) -> LibraryDevice | None:
        """Return the device with a name or order number, ignoring case, or ``None``."""
        wanted = name.casefold()
        for device in self.devices:
            words = [device.name, *(i.order for i in device.identities)]
            if wanted in (w.casefold() for w in words):
                return device
        return None


def contradictions(device: LibraryDevice) -> list[tuple[Located, str]]:
    """Return contradictions within a device or with FSoE, each with the object concerned.

    The frames found by the structural detector must be exactly the stated ones, with lengths
    permitted by FSoE, and each output frame needs its partner.
    """
    found: list[tuple[Located, str]] = []
    # A role at the device and roles at its mappings would contradict each other.
    if bool(device.role) is bool(device.mappings):
        found.append((device, "a role is at the device if it has no mapping, and only then"))
    names = [m.name for m in device.mappings]
    for mapping in device.mappings:
        if names.count(mapping.name) > 1:
            found.append((mapping, f"mapping {mapping.name!r} is there twice"))
        found += _frames(device, mapping)
    return found


def _frames(device: LibraryDevice, mapping: LibraryMapping) -> list[tuple[Located, str]]:
    found: list[tuple[Located, str]] = []
    stated = {(f.sm_index, f.byte_offset): f for f in mapping.frames}
    layout = mapping.device(device.identities[0], "").layout
    seen = {b.key: b for sm in layout.managers for b in sm.blocks}
    # Found but not stated: the figures of this frame would be missing.
    for key in sorted(seen.keys() - stated.keys()):
        at = f"byte {key[1]} of sync manager {key[0]}"
        found.append((mapping, f"the entries have a frame at {at} that is not stated"))
    for key, frame in stated.items():
        block = seen.get(key)
        at = f"frame at byte {key[1]} of sync manager {key[0]}"
        if block is None:
            found.append((frame, f"{at}: the entries have none there"))
            continue
        if block.frame_bytes != frame.frame_bytes:
            found.append((frame, f"{at}: {frame.frame_bytes} bytes, {block.frame_bytes} by entry"))
        # The number of safe bytes follows from the frame length; a stated one must match.
        elif safe_data_length(frame.frame_bytes) != frame.safe_bytes:
            right = safe_data_length(frame.frame_bytes)
            found.append((frame, f"{at}: {frame.safe_bytes} safe bytes, FSoE has {right} in it"))
        # An output frame without its partner cannot form a connection.
        if block.direction is Direction.OUTPUT and key not in layout.partners:
            found.append((frame, f"{at}: no frame in the other direction belongs to it"))
    found += _restart(mapping, layout)
    return found


def _restart(mapping: LibraryMapping, layout: DeviceLayout) -> list[tuple[Located, str]]:
    outputs = {
        (p.entry.index, p.entry.subindex)
        for sm in layout.managers
        if sm.sm.direction is Direction.OUTPUT
        for p in sm.placed
        if sm.block_at(p.bit_offset) is None
    }
    return [
        (mapping, f"restart relevant {index:04X}:{sub:02X} is not a standard output of the mapping")
        for index, sub in mapping.restart_relevant
        if (index, sub) not in outputs
    ]
