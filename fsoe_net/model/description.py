"""Bus description from files of other tools: output of every reader, input of every writer.

A description is not yet a network: names may be missing, FSoE blocks are not paired, a device may
be only a type without a place in the ring.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Device, Direction, Located, Pdo, RobotComponent


@dataclass(frozen=True, slots=True, kw_only=True)
class PdoFacts:
    """Facts of a device type about one of its PDOs.

    Attributes:
        index: Its number.
        direction: Whether it is an RxPDO or a TxPDO.
        sm: Sync manager that it belongs to; ``None`` if open.
        fixed: Whether its entries cannot be changed.
        mandatory: Whether it must be assigned.
        excludes: PDOs that cannot be assigned together with it.
    """

    index: int
    direction: Direction
    sm: int | None = None
    fixed: bool = False
    mandatory: bool = False
    excludes: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class OfferedPdo(PdoFacts):
    """A PDO with the facts of its source; a ``virtual`` one has no place in the process data."""

    pdo: Pdo
    virtual: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class TypeFacts:
    """Facts of a source about a device, in addition to its current process data.

    Attributes:
        pdos: Facts about PDOs.
        assignable: Whether a MainDevice may assign other PDOs; ``None`` if not stated.
        modular: Whether its PDOs depend on the modules in its slots.
        default_bytes: ``DefaultSize`` of sync managers by number, those that are not 0.
    """

    pdos: tuple[PdoFacts, ...] = ()
    assignable: bool | None = None
    modular: bool = False
    default_bytes: Mapping[int, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class MailboxFacts:
    """The mailbox of a SubDevice.

    Attributes:
        to_sub: Address in the memory of the SubDevice and length in bytes, for data to the
            SubDevice.
        from_sub: The same for data from the SubDevice.
        protocols: ``CoE``, ``FoE`` and so on, in the order of the source.
    """

    to_sub: tuple[int, int]
    from_sub: tuple[int, int]
    protocols: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockFacts:
    """Times of the distributed clock.

    Attributes:
        cycle_ns: Period of SYNC0; 0 for the bus cycle, multiplied by ``factor``.
        factor: Multiplies the bus cycle; a negative one divides it.
        shift_ns: Shift of SYNC0.
    """

    cycle_ns: int = 0
    factor: int = 1
    shift_ns: int = 0

    def period_ns(self, cycle_us: int) -> int:
        """Return the period of SYNC0 for a bus cycle in microseconds."""
        if self.cycle_ns:
            return self.cycle_ns
        cycle = 1000 * cycle_us
        return cycle // -self.factor if self.factor < 0 else cycle * max(self.factor, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class StartFacts:
    """What a MainDevice needs to start a SubDevice, beyond its process data.

    Attributes:
        revision: Revision that these facts apply to; ``None`` if not stated.
        physics: Media of its ports in the letters of ESI and ENI, such as ``YY`` or ``YKY``.
        mailbox: The mailbox; ``None`` if there is none.
        clock: The distributed clock; ``None`` if not stated.
        starts: Start address of sync managers by number.
        controls: Control byte of sync managers by number.
        assigns: Whether its PDOs are assigned by start-up SDOs.
        maps: PDOs whose entries are written by start-up SDOs.
    """

    revision: int | None = None
    physics: str = ""
    mailbox: MailboxFacts | None = None
    clock: ClockFacts | None = None
    starts: Mapping[int, int] = field(default_factory=dict)
    controls: Mapping[int, int] = field(default_factory=dict)
    assigns: bool = False
    maps: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedSubDevice(Located):
    """One SubDevice, or one device type.

    Attributes:
        name: Name in the source; may be empty, foreign or duplicate.
        order: Order number or type, such as ``EL1904``; may be empty.
        position: Ring position from 0; ``None`` for a device type, or if not stated.
        alias: Configured station alias, 0 for none.
        device: Identity, sync managers with their assigned PDOs (`pdos` of each), start-up SDOs.
        available: PDOs that the device offers but the source does not assign.
        revision: Revision number; a device type may leave it open.
        serial: Serial number.
        module_ident: Modules chosen for the slots, in order, for modular devices.
        fsoe_address: FSoE address that the device itself reports.
        truncated: Whether the source ends in the middle of this SubDevice.
        notes: Assumptions of the reader, in words.
        components: The joints, gpios and sensors of a robot description that use it; not compared.
        plugin: Class of ethercat_driver_ros2 that drives it; not compared.
        facts: Facts besides the process data; not compared.
        start: Data that a MainDevice needs to start it; ``None`` if not stated; not compared.
    """

    name: str = ""
    order: str = ""
    position: int | None = None
    alias: int = 0
    device: Device
    available: tuple[Pdo, ...] = ()
    revision: int | None = None
    serial: int | None = None
    module_ident: tuple[int, ...] = ()
    fsoe_address: int | None = None
    truncated: bool = False
    notes: tuple[str, ...] = ()
    components: tuple[RobotComponent, ...] = field(default=(), compare=False)
    plugin: str | None = field(default=None, compare=False)
    facts: TypeFacts = field(default_factory=TypeFacts, compare=False)
    start: StartFacts | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedEnd(Located):
    """A place in the process data of a SubDevice: its number in the description, SM and bit."""

    subdevice: int
    sm_index: int
    bit_offset: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedCopy(Located):
    """A copy in the source, to be done by the MainDevice, such as a ``CopyInfo`` of an ENI.

    ``fsoe``: whether it is FSoE according to the source; ``None`` if not stated.
    """

    source: DescribedEnd
    destination: DescribedEnd
    bits: int
    fsoe: bool | None = None
    name: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedConnection(Located):
    """An FSoE connection named by the source; SubDevice numbers, ``None`` if not stated.

    ``slot`` is the number of the frame pair of the MainInstance (`frame_pairs`); sources that list
    the connections of a logic in that order state it by their order.
    ``sub_slot`` is that of the SubInstance. ``net``: name of its net. ``unconfirmed``: why the
    connection is not yet confirmed; empty without objections.
    """

    name: str = ""
    main: int | None = None
    sub: int | None = None
    address: int | None = None
    connection_id: int | None = None
    watchdog_ms: int | None = None
    app_parameters: bytes = b""
    slot: int | None = None
    sub_slot: int | None = None
    net: str = ""
    unconfirmed: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Description(Located):
    """All facts of one source.

    Attributes:
        format: ``esi``, ``eni``, ``sii``, ``ethercat-pdos``, ``lcec`` and so on.
        path: Path of the source.
        subdevices: In ring order, if the source has one.
        cycle_us: Bus cycle, microseconds.
        truncated: Whether the text ends too early; its content is correct but incomplete.
    """

    format: str
    path: str
    subdevices: tuple[DescribedSubDevice, ...] = ()
    copies: tuple[DescribedCopy, ...] = ()
    connections: tuple[DescribedConnection, ...] = ()
    cycle_us: int | None = None
    truncated: bool = False

    @property
    def placeless(self) -> bool:
        """Whether there are no ring positions: then the SubDevices are only device types.

        This includes texts about one device, such as the output of ``ethercat xml -p 3``.
        """
        placed = any(s.alias or s.position is not None for s in self.subdevices)
        return not placed and not self.copies and not self.connections

    def without_positions(self) -> Description:
        """Return the description without positions, like that of a partial network."""
        return replace(self, subdevices=tuple(replace(s, position=None) for s in self.subdevices))
