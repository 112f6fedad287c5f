"""Content of the bus: SubDevices with sync managers, PDOs and entries."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span

if TYPE_CHECKING:
    from fsoe_net.model.layout import DeviceLayout


WATCHDOG_BIT = 0x40
"""Of the control byte of a sync manager."""
SDO_BYTES = (1, 2, 4, 8)
"""Lengths of a start-up SDO."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Located:
    """Base of everything read from a file: its place, and the place of each of its keys."""

    span: Span = field(default=Span(""), compare=False, repr=False)
    fields: Mapping[str, Span] = field(default_factory=dict, compare=False, repr=False)

    def at(self, key: str) -> Span:
        """Return the place of a key's value, or of the object if the key is absent."""
        return self.fields.get(key, self.span)


class Direction(enum.Enum):
    """Direction of a sync manager, seen from the MainDevice."""

    OUTPUT = "output"  # MainDevice to SubDevice, RxPDO
    INPUT = "input"  # SubDevice to MainDevice, TxPDO


class Watchdog(enum.Enum):
    """Sync manager watchdog as set by the MainDevice; DEFAULT leaves the SII setting."""

    DEFAULT = "default"
    ENABLE = "enable"
    DISABLE = "disable"

    @classmethod
    def of(cls, control: int) -> Watchdog:
        """Return the watchdog by the control byte of a sync manager (ETG.1000.4)."""
        return cls.ENABLE if control & WATCHDOG_BIT else cls.DISABLE


@dataclass(frozen=True, slots=True, kw_only=True)
class EntryView(Located):
    """An item of ``data_mapping``: some bits of a PDO entry as a separate value.

    ``bit`` counts from the beginning of the entry. ``shift`` is the number of low bits that the
    mask excludes: the driver does not shift a masked value, so its values are larger by ``1 <<
    shift``.
    """

    bit: int
    bits: int
    shift: int = 0
    type_name: str = ""
    command_interface: str | None = None
    state_interface: str | None = None
    default: float | None = None
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry(Located):
    """One PDO entry (a *channel* in driver YAML).

    ``index`` 0 is padding. ``bits`` is the length in the PDO. ``type_name`` is the spelling in the
    file. ``written_by`` names the key that makes the driver write the entry each cycle, e.g.
    ``default`` or ``command_interface``; ``None`` if it never does. An input is ``factor * raw +
    offset`` to its users, an output ``factor * value + offset`` on the wire. ``component`` is the
    joint, gpio or sensor that its interfaces belong to, empty if not stated; ``driver`` is JSON
    with the keys used only by ethercat_driver_ros2.
    """

    index: int
    subindex: int
    bits: int
    type_name: str = ""
    skip: bool = False
    name: str = ""
    command_interface: str | None = None
    state_interface: str | None = None
    default: float | None = None
    mask: int | None = None
    factor: float = 1.0
    offset: float = 0.0
    views: tuple[EntryView, ...] = ()
    component: str = ""
    driver: str = ""
    restart_relevant: bool = False

    @property
    def is_gap(self) -> bool:
        """Whether this is padding, which no driver registers."""
        return self.index == 0

    @property
    def registered(self) -> bool:
        """Whether the driver asks the master for this entry's offset."""
        return not self.is_gap and not self.skip

    @property
    def address(self) -> str:
        """The address, such as ``0x6000:01``."""
        return f"0x{self.index:04x}:{self.subindex:02x}"

    @property
    def written_by(self) -> str | None:
        """The key that makes the driver write this output itself, or ``None``."""
        if self.command_interface is not None:
            return "command_interface"
        return "default" if self.default is not None else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Pdo(Located):
    """One PDO with its entries in wire order. Without entries, the device's own mapping is used.

    ``is_read`` is false if its entries could not be read from the device.
    """

    index: int
    entries: tuple[Entry, ...]
    name: str = ""
    is_read: bool = True

    @property
    def bits(self) -> int:
        """Sum of the entry lengths, including padding."""
        return sum(e.bits for e in self.entries)


@dataclass(frozen=True, slots=True, kw_only=True)
class SyncManager(Located):
    """One sync manager. ``carries`` is ``"rpdo"``, ``"tpdo"`` or ``None`` (nothing assigned).

    ``declared`` is false for the four that the driver adds if a file lists none. Sources that
    assign PDOs to each sync manager, such as ESI and ENI, set ``pdos``; ``carries`` is then
    ignored. ``start_byte`` is its address in the memory of the SubDevice, if known.
    """

    index: int
    direction: Direction
    carries: str | None = None
    watchdog: Watchdog = Watchdog.DEFAULT
    declared: bool = True
    pdos: tuple[Pdo, ...] | None = None
    start_byte: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Sdo(Located):
    """One start-up SDO: ``size_bytes`` is one of `SDO_BYTES`; ``value`` may be negative."""

    index: int
    subindex: int
    size_bytes: int
    value: int

    @classmethod
    def of(cls, index: int, subindex: int, data: bytes, span: Span) -> Sdo:
        """Return the SDO that writes these bytes."""
        value = int.from_bytes(data, "little")
        return cls(span=span, index=index, subindex=subindex, size_bytes=len(data), value=value)

    @property
    def raw(self) -> int:
        """The value in two's complement, as it is sent."""
        return self.value & ((1 << 8 * self.size_bytes) - 1)


@dataclass(frozen=True, kw_only=True)  # no slots, as `layout` is cached
class Device(Located):
    """Content of a slave-config file about a device type.

    ``driver`` is JSON with the settings only for ethercat_driver_ros2: its own keys, and masks.
    """

    path: str
    vendor_id: int
    product_code: int
    assign_activate: int = 0
    sync_managers: tuple[SyncManager, ...] = ()
    rpdos: tuple[Pdo, ...] = ()
    tpdos: tuple[Pdo, ...] = ()
    sdos: tuple[Sdo, ...] = ()
    driver: str = ""

    @property
    def identity(self) -> tuple[int, int]:
        """Vendor ID and product code."""
        return self.vendor_id, self.product_code

    def pdos_of(self, sm: SyncManager) -> tuple[Pdo, ...]:
        """Return the PDOs that a sync manager carries, in assignment order."""
        if sm.pdos is not None:
            return sm.pdos
        if sm.carries == "rpdo":
            return self.rpdos
        return self.tpdos if sm.carries == "tpdo" else ()

    @cached_property
    def layout(self) -> DeviceLayout:
        """Every entry with its place, and the FSoE frames; computed once for equal terminals."""
        from fsoe_net.model.layout import place_device

        return place_device(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotComponent:
    """A joint, gpio or sensor of a robot description that uses a SubDevice.

    ``kind`` is ``joint``, ``gpio`` or ``sensor``; ``states`` and ``commands`` are the names of its
    interfaces in the order of the description, ``places`` are their places in the file, the states
    first. ``limits`` are the lowest and highest position of a joint in rad or m, if stated;
    ``max_velocity`` and ``max_effort`` its other limits, 0 if not stated. ``joint_type``: as in
    the URDF, such as ``prismatic``.
    """

    kind: str
    name: str
    states: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    limits: tuple[float, float] | None = field(default=None, compare=False)
    max_velocity: float = field(default=0.0, compare=False)
    max_effort: float = field(default=0.0, compare=False)
    joint_type: str = field(default="", compare=False)
    places: tuple[Span, ...] = field(default=(), compare=False)

    def __str__(self) -> str:
        return f"{self.kind} {self.name}"

    def interfaces(self) -> Iterator[tuple[bool, str, Span]]:
        """Yield for each interface whether it is a command, its name and its place."""
        sides = [(False, name) for name in self.states] + [(True, name) for name in self.commands]
        for (is_command, name), place in zip(sides, self.places, strict=True):
            yield is_command, name, place


@dataclass(frozen=True, slots=True, kw_only=True)
class SubDevice(Located):
    """One SubDevice on the bus: a name, an address and its device description.

    ``alias`` 0: ``position`` is the ring position; otherwise ``position`` counts from the SubDevice
    with that alias. ``device`` is ``None`` if its file could not be read: the loader has reported
    it, and rules skip its content. ``revision`` is ``None`` if any is accepted. ``components`` are
    the joints, gpios and sensors of a URDF that use it. ``origin`` is the section of its
    declaration: ``network``, ``joint``, ``gpio``, ``sensor``, ``transfer_modules`` or
    ``safety_modules``. ``system`` and ``hardware``: name and plugin of its ``ros2_control`` block.
    ``master_id``: number of the EtherCAT master, or of the bus if the network
    file has several.
    """

    name: str
    alias: int = 0
    position: int
    device: Device | None
    revision: int | None = None
    plugin: str | None = None
    required: bool = True
    origin: str = "network"
    components: tuple[RobotComponent, ...] = ()
    system: str = ""
    hardware: str = field(default="", compare=False)
    master_id: int = 0

    @property
    def layout(self) -> DeviceLayout | None:
        """The layout of its device, if that could be read."""
        return None if self.device is None else self.device.layout


def same_devices(devices: Iterable[Device | None]) -> tuple[int, ...]:
    """Return for each device the number of the first one that is the same object.

    Compares objects, not content: two files may be equal, and a finding must name its file.
    """
    first: dict[int, int] = {}
    return tuple(first.setdefault(id(device), n) for n, device in enumerate(devices))
