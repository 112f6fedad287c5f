"""One ``Box`` of a TwinCAT project: identity, sync managers, PDOs, and its variables.

Sync managers are 12 bytes in hexadecimal digits; the second half repeats the first:

    byte   0 .. 1   2 .. 3    4      5       6     7     8 .. 11
         +--------+--------+-------+------+--------+---+---------+
         | start  | length | ctrl  | stat | enable | - | use 1-4 |
         +--------+--------+-------+------+--------+---+---------+

Uses are mailbox out, mailbox in, outputs and inputs. The messages of a safety logic are one entry
each, of a type ``FSOE_n`` with n bytes; they are cut into the parts of a frame here.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from dataclasses import field, replace

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import esi_number
from fsoe_net.formats.shared.xml_tree import Element
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, SyncManager, Watchdog
from fsoe_net.model.description import DescribedSubDevice, MailboxFacts, StartFacts

_SM = struct.Struct("<HHBBBBI")
_USES = {3: Direction.OUTPUT, 4: Direction.INPUT}
_MOST_BITS = 0xFFFF
_MOST_NAMESAKES = 16
_MOST_FINDINGS = 200
_FRAME_TYPE = re.compile(r"FSOE_([0-9]{1,3})\Z")
_ARRAY = re.compile(r"ARRAY *\[([0-9]{1,6})\.\.([0-9]{1,6})\] OF +(\w+)\Z")
_FIRST_SLOT = {"EL1918": 8}  # its connections begin at 0x6080 and 0x7080, those of others at 0
_SIGNALS = {0x17F0: 0xF788, 0x1BF0: 0xF688}  # PDO of standard signals and its object
_MESSAGE = re.compile(r"Message_([0-9]{1,5}) [RT]xPDO\Z")
_BITS = {
    **dict.fromkeys(("BYTE", "USINT", "SINT"), 8),
    **dict.fromkeys(("WORD", "UINT", "INT"), 16),
    **dict.fromkeys(("DWORD", "UDINT", "DINT", "REAL"), 32),
    **dict.fromkeys(("LWORD", "ULINT", "LINT", "LREAL"), 64),
}
_BIT = re.compile(r"BIT([0-9]{0,2})\Z")
_LOGIC_NOTE = (
    "its objects are numbered as in the device library, not as in TwinCAT: compare them with "
    "the device (`ethercat pdos`)"
)
_PROTOCOLS = (("CoeType", "CoE"), ("FoeType", "FoE"), ("SoeChannels", "SoE"), ("EoeType", "EoE"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """Range of bits of a sync manager that a variable refers to."""

    sm_index: int
    bit: int
    bits: int
    direction: Direction


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """A frame of a safety logic: its number in the safety project, and its position."""

    number: int
    slot: int


@dataclass(slots=True, kw_only=True)
class Box:
    """A SubDevice with its place in the tree of TwinCAT.

    Attributes:
        path: Names from the master to it.
        described: Its description in the model.
        variables: Range of each variable, by name of PDO and name in it.
        messages: Messages of a safety logic, by name of PDO and entry.
        modules: PDOs of a module by its name.
        unread: Content that is not supported, in words.
    """

    path: tuple[str, ...]
    described: DescribedSubDevice
    variables: dict[tuple[str, str], list[tuple[int, Range]]] = field(default_factory=dict)
    messages: dict[tuple[str, str], Message] = field(default_factory=dict)
    modules: dict[str, set[int]] = field(default_factory=dict)
    unread: list[str] = field(default_factory=list)

    def find(self, rest: tuple[str, ...]) -> Range | None:
        """Return the range of a variable: ``(PDO, name)``, optionally preceded by its module."""
        if len(rest) not in (2, 3):
            return None
        rows = self.variables.get((rest[-2], rest[-1]), [])
        if len(rest) == 3 and rest[0] in self.modules:
            rows = [r for r in rows if r[0] in self.modules[rest[0]]]
        # Two PDOs have a variable of this name: no copy is better than a copy of the wrong bytes.
        return rows[0][1] if len(rows) == 1 else None


def type_bits_of(name: str, guid: str, types: Mapping[tuple[str, str], int]) -> int | None:
    """Return the bits of a type word, or ``None`` if unknown.

    Args:
        name: The word.
        guid: Its number in the project; empty for types of TwinCAT itself.
        types: Bits of the types that the project describes, by name and number.
    """
    name = name.strip()
    if (name, guid) in types:
        return types[name, guid]
    array = _ARRAY.match(name)
    if array is not None:
        low, high, inner = int(array[1]), int(array[2]), array[3]
        each = type_bits_of(inner, "", types)
        return None if each is None or high < low else each * (high - low + 1)
    frame = _FRAME_TYPE.match(name)
    if frame is not None:
        return 8 * int(frame[1])
    bit = _BIT.match(name)
    if bit is not None:
        return int(bit[1] or 1)
    return _BITS.get(name)


def read_box(
    element: Element,
    path: tuple[str, ...],
    position: int,
    types: Mapping[tuple[str, str], int],
    shown: str,
    out: Collector,
) -> Box:
    """Read a ``Box`` that is an EtherCAT SubDevice.

    Args:
        element: The ``Box``.
        path: Names from the master down to it.
        position: Its place in the ring.
        types: Bits of types, see `type_bits_of`.
        shown: The file.
        out: Takes FSN141, FSN143 and FSN147.
    """
    return _BoxReader(element, path, position, types, shown, out).box


class _BoxReader:
    def __init__(
        self,
        element: Element,
        path: tuple[str, ...],
        position: int,
        types: Mapping[tuple[str, str], int],
        shown: str,
        out: Collector,
    ) -> None:
        self._own = element.first("EtherCAT") or element
        self._types, self._out = types, out
        self._slots: dict[str, int] = {}  # messages so far, by PDO
        self._broken: set[int] = set()  # sync managers with an entry of unknown length
        self._is_logic = any(
            _MESSAGE.match(entry.attributes.get("Name", ""))
            for pdo in self._own.all("Pdo")
            for entry in pdo.all("Entry")
        )
        managers = self._managers()
        identity = {k: self._number(k, 0xFFFFFFFF) for k in ("VendorId", "ProductCode")}
        revision = self._number("RevisionNo", 0xFFFFFFFF)
        device = Device(
            span=element.span,
            path=shown,
            vendor_id=identity["VendorId"] or 0,
            product_code=identity["ProductCode"] or 0,
        )
        described = DescribedSubDevice(
            span=element.span,
            name=path[-1],
            order=self._own.attributes.get("Desc", "").strip()[:60],
            position=position,
            device=device,
            revision=revision,
            notes=(_LOGIC_NOTE,) if self._is_logic else (),
        )
        self.box = Box(path=path, described=described)
        self._modules()
        pdos, available = self._pdos()
        self._finish(device, described, managers, pdos, available)

    def _finish(
        self,
        device: Device,
        described: DescribedSubDevice,
        managers: list[tuple[int, int, int, int]],
        pdos: dict[int, list[Pdo]],
        available: list[Pdo],
    ) -> None:
        rows = []
        for index, (start, length, control, use) in enumerate(managers):
            direction = _USES.get(use)
            carried = pdos.get(index, [])
            if direction is None:
                continue
            bits = sum(p.bits for p in carried)
            # After an entry of unknown length, every later bit would be in the wrong place.
            if index in self._broken:
                carried = []
            elif length and (bits + 7) // 8 != length:
                self._add(
                    "FSN143",
                    self._own.span,
                    f"{self.box.path[-1][:60]}: the PDOs of SM{index} have {bits} bits, the sync "
                    f"manager has {length} bytes",
                    hint="open the project in TwinCAT, reload the device and save",
                )
            rows.append(
                SyncManager(
                    span=self._own.span,
                    index=index,
                    direction=direction,
                    watchdog=Watchdog.of(control),
                    pdos=tuple(carried),
                    start_byte=start or None,
                )
            )
        self.box.described = replace(
            described,
            device=replace(device, sync_managers=tuple(rows)),
            available=tuple(available),
            module_ident=self._idents(),
            start=StartFacts(
                revision=described.revision,
                mailbox=self._mailbox(managers),
                starts={n: m[0] for n, m in enumerate(managers)},
                controls={n: m[2] for n, m in enumerate(managers)},
            ),
        )
        for name, what in (("MBoxUserCmdData", "start-up commands"), ("DcMode", "clock modes")):
            if self._own.first(name) is not None:
                self.box.unread.append(what)

    def _number(self, key: str, high: int) -> int | None:
        text = self._own.attributes.get(key)
        value = None if text is None else esi_number(text)
        if text is not None and (value is None or not 0 <= value <= high):
            self._add(
                "FSN141",
                self._own.span,
                f"{key} {text[:40]!r} of {self.box_name()} is not a number from 0 to {high}",
                hint="open the project in TwinCAT and save it again",
            )
            return None
        return value

    def _add(self, code: str, span: Span, message: str, *, hint: str) -> None:
        if len(self._out.diagnostics) < _MOST_FINDINGS:
            self._out.add(code, span, message, hint=hint)

    def box_name(self) -> str:
        """Return the name of the box for a finding."""
        return self._own.attributes.get("Desc", "a box")[:60]

    def _managers(self) -> list[tuple[int, int, int, int]]:
        """Return start, length, control byte and use of each sync manager."""
        rows = []
        for element in self._own.all("SyncMan")[:16]:
            try:
                data = bytes.fromhex(element.text)
                start, length, control, _, _, _, use = _SM.unpack_from(data)
            except (ValueError, struct.error):
                self._add(
                    "FSN141",
                    element.value_span,
                    f"{self.box_name()}: a sync manager is 12 bytes in hexadecimal digits",
                    hint="open the project in TwinCAT and save it again",
                )
                return []
            rows.append((start, length, control, use))
        return rows

    def _mailbox(self, managers: list[tuple[int, int, int, int]]) -> MailboxFacts | None:
        windows = {use: (start, length) for start, length, _, use in managers if length}
        if 1 not in windows or 2 not in windows:
            return None
        protocols = tuple(p for key, p in _PROTOCOLS if key in self._own.attributes)
        return MailboxFacts(to_sub=windows[1], from_sub=windows[2], protocols=protocols)

    def _modules(self) -> None:
        for slot in self._own.all("Slot")[:256]:
            for module in slot.all("Module"):
                name = module.first("Name")
                numbers = {esi_number(p.text) for p in module.all("PdoIndex")}
                if name is not None:
                    indices = self.box.modules.setdefault(name.words, set())
                    indices.update(n for n in numbers if n is not None)

    def _idents(self) -> tuple[int, ...]:
        numbers = []
        for slot in self._own.all("Slot")[:256]:
            module = slot.first("Module")
            ident = None if module is None else esi_number(module.attributes.get("Class", ""))
            if ident is not None:
                numbers.append(ident)
        return tuple(numbers)

    # -- PDOs -------------------------------------------------------------------------------------

    def _pdos(self) -> tuple[dict[int, list[Pdo]], list[Pdo]]:
        assigned: dict[int, list[Pdo]] = {}
        available = []
        places: dict[int, int] = {}
        for element in self._own.all("Pdo"):
            index = esi_number(element.attributes.get("Index", ""))
            if index is None or not 0 <= index <= 0xFFFF:
                self._add(
                    "FSN141",
                    element.span,
                    f"a PDO of {self.box_name()} has no number",
                    hint="open the project in TwinCAT and save it again",
                )
                continue
            sm = esi_number(element.attributes.get("SyncMan", ""))
            output = element.attributes.get("InOut") == "1"
            direction = Direction.OUTPUT if output else Direction.INPUT
            first = places.get(sm, 0) if sm is not None else 0
            entries, bits = self._entries(element, index, direction, sm, first)
            pdo = Pdo(span=element.span, index=index, entries=tuple(entries))
            if sm is None or not 0 <= sm < 16:
                available.append(pdo)
            else:
                places[sm] = first + bits
                assigned.setdefault(sm, []).append(pdo)
        return assigned, available

    def _entries(
        self, element: Element, pdo: int, direction: Direction, sm: int | None, first: int
    ) -> tuple[list[Entry], int]:
        entries: list[Entry] = []
        title = element.attributes.get("Name", "").strip()
        at = first
        groups: dict[str, tuple[int, int]] = {}
        for child in element.all("Entry"):
            kind = child.first("Type")
            bits = self._bits_of(child, kind, sm)
            if bits is None:
                continue
            name = child.attributes.get("Name", "").strip()
            word = "" if kind is None else kind.words
            frame = _FRAME_TYPE.match(word)
            message = _MESSAGE.match(name)
            if frame is not None and message is not None and sm is not None:
                slot = self._slot(title, name, int(message[1]))
                first_slot = _FIRST_SLOT.get(self.box.described.order[:6], 0)
                entries += _frame(first_slot + slot, bits // 8, direction, child.span, name)
            else:
                entries.append(_entry(child, bits, name, word, own_numbers=not self._is_logic))
            if sm is not None:
                self._name(
                    title, name, pdo, Range(sm_index=sm, bit=at, bits=bits, direction=direction)
                )
                # A link may name `group` for all of its members `group__member`.
                group, mark, _ = name.partition("__")
                if mark:
                    begin = groups.get(group, (at, at))[0]
                    groups[group] = (begin, at + bits)
            at += bits
        # The device maps its standard signals as one entry; TwinCAT lists them bit by bit.
        if self._is_logic and pdo in _SIGNALS and at - first in (8, 16, 32):
            span = element.span
            entries = [
                Entry(span=span, index=_SIGNALS[pdo], subindex=0, bits=at - first, name=title)
            ]
        for group, (begin, end) in groups.items():
            found = Range(sm_index=sm or 0, bit=begin, bits=end - begin, direction=direction)
            self._name(title, group, pdo, found)
        return entries, at - first

    def _name(self, title: str, name: str, pdo: int, found: Range) -> None:
        rows = self.box.variables.setdefault((title, name), [])
        if name and len(rows) < _MOST_NAMESAKES:
            rows.append((pdo, found))

    def _slot(self, title: str, name: str, number: int) -> int:
        slot = self._slots.get(title, 0)
        self._slots[title] = slot + 1
        self.box.messages[title, name] = Message(number=number, slot=slot)
        return slot

    def _bits_of(self, entry: Element, kind: Element | None, sm: int | None) -> int | None:
        text = entry.attributes.get("BitLen")
        if text is not None:
            bits = esi_number(text)
        elif kind is None:
            bits = None
        else:
            bits = type_bits_of(kind.text, kind.attributes.get("GUID", ""), self._types)
        if bits is not None and 0 < bits <= _MOST_BITS:
            return bits
        if sm is not None and sm not in self._broken:
            self._broken.add(sm)
            word = "" if kind is None else kind.text.strip()[:40]
            word = word or entry.attributes.get("Name", "")[:40]
            self._add(
                "FSN147",
                entry.span,
                f"{self.box_name()}: the length of {word!r} is not stated, so the process data of "
                f"SM{sm} are left out",
                hint="give the ESI or the output of `ethercat pdos` of this device as well",
            )
        return None


def _entry(child: Element, bits: int, name: str, word: str, *, own_numbers: bool) -> Entry:
    """Return an entry; without ``own_numbers`` its numbers are TwinCAT's and are not used."""
    index = esi_number(child.attributes.get("Index", "")) or 0
    subindex = esi_number(child.attributes.get("Sub", "")) or 0
    known = 0 < index <= 0xFFFF and 0 <= subindex <= 0xFF
    known = known and (own_numbers or not 0x6000 <= index < 0x8000)
    plain = word if word in _BITS else ""
    shown = name.partition("__")[2] or name
    return Entry(
        span=child.span,
        index=index if known else 0,
        subindex=subindex if known else 0,
        bits=bits,
        type_name=plain if known else "",
        name=shown if known else "",
    )


def _frame(slot: int, size: int, direction: Direction, span: Span, name: str) -> list[Entry]:
    """Return a message as the parts of a frame.

    TwinCAT numbers the messages of a logic differently; the device uses 0x6000 and 0x7000 + 16 n
    for the n-th connection, see the device library.
    """
    base = (0x6000 if direction is Direction.INPUT else 0x7000) + 16 * slot
    # Not the length of an FSoE frame (ETG.5100: 6, 7, 11, 15 …): one entry without an address.
    if not (size == 6 or (size >= 7 and size % 4 == 3)) or base > 0x7FF0:
        return [Entry(span=span, index=0, subindex=0, bits=8 * size)]

    def part(index: int, subindex: int, bits: int, word: str) -> Entry:
        return Entry(span=span, index=index, subindex=subindex, bits=bits, name=f"{name} {word}")

    rows = [part(base, 1, 8, "CMD")]
    # Each CRC follows two safe bytes; only the shortest frame has a single one (ETG.5100).
    data = [8] if size == 6 else [16] * ((size - 3) // 4)
    for number, bits in enumerate(data):
        rows.append(part(base + 1, number + 1, bits, f"data {number}"))
        rows.append(part(base, number + 3, 16, f"CRC {number}"))
    return [*rows, part(base, 2, 16, "ConnID")]
