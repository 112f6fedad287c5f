"""One SubDevice of a capture: its captured registers, EEPROM and objects."""

from __future__ import annotations

from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.formats.capture.sdo import CapturedSdo, SdoAbort, SdoFollower
from fsoe_net.formats.capture.sii import SII_REGISTERS, SiiReads
from fsoe_net.model.bus import SDO_BYTES, Direction

FMMUS, MANAGERS = range(0x0600, 0x0700), range(0x0800, 0x0880)
MAPPINGS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))
_ALIAS, _AL_CONTROL, _DC_ACTIVATION = 0x0012, 0x0120, 0x0980
_LATCHED = range(0x0010, 0x0014)
_MEMORY = 0x1000
_OPERATIONAL = 8
_ASSIGNMENTS = range(0x1C10, 0x1C30)
_PROCESS_DATA = range(2, 16)  # sync managers that assignment objects can refer to
_IDENTITY, _NAME, _MODULES = 0x1018, 0x1008, (0xF030, 0xF050)
_MOST_BYTES = 64  # of a value that is stored
_MOST_SDOS = 4096
_MOST_ABORTS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Manager:
    """A sync manager register block: the position of its buffer, and whether it is active."""

    start: int
    length: int
    control: int
    enabled: bool

    @property
    def is_mailbox(self) -> bool:
        """Whether it carries a mailbox instead of process data."""
        return self.control & 3 == 2

    @property
    def direction(self) -> Direction:
        """The writer."""
        return Direction.OUTPUT if self.control >> 2 & 3 == 1 else Direction.INPUT


@dataclass(frozen=True, slots=True, kw_only=True)
class CapturedFmmu:
    """An FMMU that maps whole bytes, and is active."""

    logical: int
    length: int
    physical: int
    direction: Direction


@dataclass(slots=True)
class Station:
    """What the MainDevice and one SubDevice exchanged.

    Attributes:
        number: Identifier while the capture is read.
        packet: Number of its first packet.
        position: Position in the ring, if an auto-increment access shows it.
        address: Station address.
        objects: Values by index and subindex; a complete access is split into its parts.
        places: Packet of the last value of an object, by index.
        downloads: Start-up SDOs, in the order of their last write.
        late: Downloads while the SubDevice was in OP or its state was unknown.
        changed: Whether anything that affects the layout has changed since this was last cleared.
    """

    number: int
    packet: int
    position: int | None = None
    address: int | None = None
    sii: SiiReads = field(default_factory=SiiReads)
    objects: dict[tuple[int, int], bytes] = field(default_factory=dict)
    places: dict[int, int] = field(default_factory=dict)
    downloads: dict[tuple[int, int], tuple[bytes, int]] = field(default_factory=dict)
    aborts: list[tuple[SdoAbort, int]] = field(default_factory=list)
    late: int = 0
    odd: int = 0
    changed: bool = True
    _registers: dict[int, int] = field(default_factory=dict)
    _sdo: SdoFollower = field(default_factory=SdoFollower)
    _asked_state: int | None = None

    # -- observed traffic --------------------------------------------------------------------------

    def wrote(self, register: int, data: bytes, packet: int) -> None:
        """Process a write that the SubDevice accepted."""
        if register >= _MEMORY:
            if self._is_mailbox(register, Direction.OUTPUT):
                self._finish(self._sdo.request(data), packet)
            return
        self._keep(register, data)
        end = register + len(data)
        if register < SII_REGISTERS.stop and end > SII_REGISTERS.start:
            self.sii.written(register, data)
        if register <= _AL_CONTROL < end:
            self._asked_state = data[_AL_CONTROL - register] & 0x0F

    def read(self, register: int, data: bytes, packet: int) -> None:
        """Process the answer of the SubDevice."""
        if register >= _MEMORY:
            if self._is_mailbox(register, Direction.INPUT):
                self._finish(self._sdo.response(data), packet)
            return
        self._keep(register, data)
        if register < SII_REGISTERS.stop and register + len(data) > SII_REGISTERS.start:
            self.sii.read(register, data)

    def _is_mailbox(self, register: int, direction: Direction) -> bool:
        managers = self.managers()
        if not managers:
            return True  # the capture begins after the set-up; the mailbox itself must match
        return any(
            m.is_mailbox and m.direction is direction and m.start <= register < m.start + m.length
            for m in managers.values()
        )

    def _keep(self, register: int, data: bytes) -> None:
        end = register + len(data)
        for area in (_LATCHED, FMMUS, MANAGERS, range(_DC_ACTIVATION, _DC_ACTIVATION + 2)):
            for place in range(max(register, area.start), min(end, area.stop)):
                value = data[place - register]
                if self._registers.get(place) != value:
                    self._registers[place] = value
                    # Status and PDI bytes of a sync manager change at run time.
                    self.changed |= area is not MANAGERS or place & 7 not in (5, 7)

    def _finish(self, found: CapturedSdo | SdoAbort | None, packet: int) -> None:
        if isinstance(found, SdoAbort):
            layout = found.index in _ASSIGNMENTS or any(found.index in m for m in MAPPINGS)
            if found.written and layout and len(self.aborts) < _MOST_ABORTS:
                self.aborts.append((found, packet))
        elif found is not None:
            self._store(found, packet)

    def _store(self, value: CapturedSdo, packet: int) -> None:
        width = _width(value.index)
        if width is None:
            if value.written:
                self._download(value, packet)
            return
        parts = (
            _parts(value, width) if value.complete else {value.subindex: value.data[:_MOST_BYTES]}
        )
        for subindex, data in parts.items():
            key = (value.index, subindex)
            if self.objects.get(key) != data:
                self.objects[key] = data
                self.places[value.index] = packet
                self.changed = True

    def _download(self, value: CapturedSdo, packet: int) -> None:
        if self._asked_state is None or self._asked_state >= _OPERATIONAL:
            self.late += 1
        elif value.complete or len(value.data) not in SDO_BYTES:
            self.odd += 1
        elif len(self.downloads) < _MOST_SDOS:
            self.downloads.pop((value.index, value.subindex), None)
            self.downloads[value.index, value.subindex] = (value.data, packet)

    # -- known facts -------------------------------------------------------------------------------

    def _bytes(self, start: int, size: int) -> bytes | None:
        found = [self._registers.get(place) for place in range(start, start + size)]
        known = [value for value in found if value is not None]
        return bytes(known) if len(known) == size else None

    def managers(self) -> dict[int, Manager]:
        """Return the sync managers with captured registers, except those of length 0."""
        found = {}
        for number in range(len(MANAGERS) // 8):
            at = MANAGERS.start + 8 * number
            head, active = self._bytes(at, 5), self._registers.get(at + 6)
            if head is None or active is None or not (head[2] or head[3]):
                continue
            found[number] = Manager(
                start=int.from_bytes(head[:2], "little"),
                length=int.from_bytes(head[2:4], "little"),
                control=head[4],
                enabled=bool(active & 1),
            )
        return found

    def fmmus(self) -> tuple[CapturedFmmu, ...]:
        """Return the active FMMUs that map whole bytes."""
        found = []
        for at in range(FMMUS.start, FMMUS.stop, 16):
            row = self._bytes(at, 13)
            # Only whole bytes: an FMMU for single bits cannot carry a frame.
            if row is None or not row[12] & 1 or row[6] or row[7] != 7 or row[10]:
                continue
            length = int.from_bytes(row[4:6], "little")
            if length and row[11] in (1, 2):
                found.append(
                    CapturedFmmu(
                        logical=int.from_bytes(row[:4], "little"),
                        length=length,
                        physical=int.from_bytes(row[8:10], "little"),
                        direction=Direction.INPUT if row[11] == 1 else Direction.OUTPUT,
                    )
                )
        return tuple(found)

    @property
    def alias(self) -> int:
        """Return the configured station alias, from the register, else from the EEPROM, else 0."""
        row = self._bytes(_ALIAS, 2)
        return int.from_bytes(row, "little") if row is not None else self.sii.words.get(4, 0)

    @property
    def dc_activation(self) -> int:
        """Return the word in the DC activation register, 0 if not written."""
        return int.from_bytes(self._bytes(_DC_ACTIVATION, 2) or b"", "little")

    def object_number(self, index: int, subindex: int) -> int | None:
        """Return a number of the object dictionary."""
        data = self.objects.get((index, subindex))
        return int.from_bytes(data, "little") if data else None

    def assigned(self, manager: int) -> tuple[int, ...] | None:
        """Return the PDOs of a sync manager of process data.

        ``None`` for one of a mailbox, or if the object was not captured completely.
        """
        return self._list(_ASSIGNMENTS.start + manager) if manager in _PROCESS_DATA else None

    def mapping(self, pdo: int) -> tuple[int, ...] | None:
        """Return the entries of a PDO: index, subindex and bits in 16, 8 and 8 bits."""
        return self._list(pdo)

    def modules(self) -> tuple[int, ...]:
        """Return the modules in the slots, as configured or else as detected."""
        return next((found for index in _MODULES if (found := self._list(index))), ())

    def name(self) -> str:
        """Return the name of the SubDevice in object 0x1008."""
        raw = self.objects.get((_NAME, 0), b"").split(b"\0", 1)[0]
        return "".join(c for c in raw.decode("latin-1") if c.isprintable()).strip()

    def _list(self, index: int) -> tuple[int, ...] | None:
        count = self.object_number(index, 0)
        if count is None:
            return None
        rows = [self.object_number(index, n) for n in range(1, count + 1)]
        known = [row for row in rows if row is not None]
        return tuple(known) if len(known) == count else None


def _width(index: int) -> int | None:
    """Return the entry size of an object that is stored; 0 for a text."""
    if index in _ASSIGNMENTS:
        return 2
    if index in _MODULES or index == _IDENTITY or any(index in m for m in MAPPINGS):
        return 4
    return 0 if index == _NAME else None


def _parts(value: CapturedSdo, width: int) -> dict[int, bytes]:
    """Split a complete access: the count in 16 or 8 bits, then entries of one width."""
    if not width:
        return {value.subindex: value.data[:_MOST_BYTES]}
    data, parts = value.data, {}
    if value.subindex == 0:
        if not data:
            return {}
        parts[0] = data[:1]
        padded = len(data) >= 2 and (len(data) - 2) % width == 0
        data = data[2:] if padded else data[1:]
    for number in range(len(data) // width):
        parts[number + 1] = data[number * width : (number + 1) * width]
    return parts
