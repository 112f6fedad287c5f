"""Pieces of an ESI device as plain values: PDOs, entries, start-up commands, slots."""

from __future__ import annotations

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import esi_number
from fsoe_net.formats.shared.xml_tree import Element
from fsoe_net.model.bus import SDO_BYTES, Direction, Entry, Pdo, Sdo
from fsoe_net.model.description import OfferedPdo

MAX_PDO_BITS = 8 * 65536
MAX_SLOTS = 4096
_MAX_FINDINGS = 50  # of one device; a systematic error is clear by then
_ENGLISH = "1033"
_OTHER = {Direction.OUTPUT: "RxPdo", Direction.INPUT: "TxPdo"}


@dataclass(frozen=True, slots=True, kw_only=True)
class EsiPdo(OfferedPdo):
    """A PDO of a device or module; modules replace one that is ``by_module``."""

    by_module: bool
    mark: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotPlace:
    """A place for a module: its number, the modules that fit, the default one, the increments."""

    number: int
    name: str
    fits: tuple[int, ...]
    default: int | None
    needed: bool
    pdo_step: int
    index_step: int
    span: Span


def flag(element: Element, key: str) -> bool:
    """Return a boolean attribute; ESI files write ``1`` and ``true``."""
    return element.attributes.get(key, "").strip().lower() in ("1", "true")


def name_of(element: Element) -> str:
    """Return the English name, or else the first one."""
    names = element.all("Name")
    english = next((n for n in names if n.attributes.get("LcId") == _ENGLISH), None)
    chosen = english or next((n for n in names if n.text.strip()), None)
    return chosen.words if chosen is not None else ""


class PartReader:
    """Reads elements of one device or one module at a slot.

    Args:
        out: Takes FSN110, FSN111 and FSN113 at the invalid element.
        pdo_step: Added to the index of PDOs that depend on the slot.
        index_step: Added to the index of objects that depend on the slot.
    """

    def __init__(self, out: Collector, *, pdo_step: int = 0, index_step: int = 0) -> None:
        self.broken = False
        self.notes: list[str] = []
        self._found = 0
        self._out = out
        self._pdo_step = pdo_step
        self._index_step = index_step

    def pdos(self, parent: Element) -> list[EsiPdo]:
        """Return the PDOs of a ``Device`` or ``Module``, in the order of the file."""
        directions = {word: direction for direction, word in _OTHER.items()}
        found = (c for c in parent.children if c.name in directions)
        read = [self._pdo(c, directions[c.name]) for c in found]
        return [pdo for pdo in read if pdo is not None]

    def _pdo(self, element: Element, direction: Direction) -> EsiPdo | None:
        index = self._index(element, "Index", self._pdo_step)
        if index is None:
            return None
        entries = [self._entry(e) for e in element.all("Entry")]
        pdo = Pdo(
            index=index,
            entries=tuple(e for e in entries if e is not None),
            name=name_of(element),
            span=element.span,
        )
        if pdo.bits > MAX_PDO_BITS:
            message = f"PDO 0x{index:04x} has {pdo.bits} bits"
            self._wrong("FSN113", element.span, message, f"at most {MAX_PDO_BITS} fit")
            return None
        self._oversampling(element, index)
        excludes = (self._excluded(e) for e in element.all("Exclude"))
        return EsiPdo(
            pdo=pdo,
            index=index,
            direction=direction,
            sm=self._sm(element),
            fixed=flag(element, "Fixed"),
            mandatory=flag(element, "Mandatory"),
            virtual=flag(element, "Virtual"),
            by_module=flag(element, "OverwrittenByModule"),
            excludes=frozenset(e for e in excludes if e is not None),
            mark=element.attributes.get("SafetyPdoType", "")[:40],
        )

    def _oversampling(self, element: Element, index: int) -> None:
        text = {key: element.attributes.get(key, "")[:20] for key in ("OSFac", "OSMin", "OSMax")}
        if text["OSFac"].strip() not in ("", "0", "1"):
            self.notes.append(
                f"PDO 0x{index:04x} is oversampled: the device sends {text['OSFac']} samples of it "
                f"by default ({text['OSMin']} … {text['OSMax']}), one is written"
            )

    def _sm(self, element: Element) -> int | None:
        text = element.attributes.get("Sm", "").strip()
        if not text:
            return None
        number = esi_number(text)
        if number is None or not 0 <= number <= 31:
            message = f"Sm {text[:40]!r} is not a sync manager"
            self._wrong("FSN113", element.span, message, "write a number from 0 to 31")
            return None
        return number

    def _excluded(self, element: Element) -> int | None:
        number = esi_number(element.text)
        if number is None:
            return None
        return number + (self._pdo_step if flag(element, "DependOnSlot") else 0)

    def _entry(self, element: Element) -> Entry | None:
        bits = self._number(element, "BitLen", 0, MAX_PDO_BITS)
        index = self._index(element, "Index", self._index_step)
        if bits is None or index is None:
            return None
        if bits == 0:
            return None
        if element.first("SubIndex") is None:
            subindex: int | None = 0
        else:
            subindex = self._number(element, "SubIndex", 0, 255)
        if subindex is None:
            return None
        kind = element.first("DataType")
        return Entry(
            index=index,
            subindex=subindex,
            bits=bits,
            type_name=kind.words if kind is not None and index else "",
            name=name_of(element),
            span=element.span,
        )

    def _index(self, parent: Element, key: str, step: int) -> int | None:
        """Return an object index, shifted if it depends on the slot; 0 stays 0."""
        index = self._number(parent, key, 0, 0xFFFF)
        child = parent.first(key)
        if not index or child is None or not flag(child, "DependOnSlot"):
            return index
        if index + step > 0xFFFF:
            message = f"0x{index:04x} plus 0x{step:x} of its slot is not an object index"
            self._wrong("FSN113", child.value_span, message, "look at the increments of <Slots>")
            return None
        return index + step

    def _number(self, parent: Element, key: str, low: int, high: int) -> int | None:
        child = parent.first(key)
        if child is None:
            message = f"<{parent.name}> has no <{key}>"
            self._wrong("FSN110", parent.span, message, f"add <{key}>; is the file complete?")
            return None
        number = esi_number(child.text)
        if number is None:
            message = f"{key} {child.text.strip()[:40]!r} is not a number"
            self._wrong("FSN111", child.value_span, message, "write 6656 or #x1a00")
            return None
        if not low <= number <= high:
            message = f"{key} {child.text.strip()} is outside {low} … {high}"
            self._wrong("FSN113", child.value_span, message, "correct the number")
            return None
        return number

    def _wrong(self, code: str, span: Span, message: str, hint: str) -> None:
        self.broken = True
        self._found += 1
        if self._found <= _MAX_FINDINGS:
            self._out.add(code, span, message, hint=hint)

    # -- start-up ---------------------------------------------------------------------------------

    def sdos(self, parent: Element) -> list[Sdo]:
        """Return the start-up SDOs of ``Mailbox/CoE``; unsupported ones are notes."""
        mailbox = parent.first("Mailbox")
        coe = mailbox.first("CoE") if mailbox is not None else None
        read = [self._sdo(c) for c in coe.all("InitCmd")] if coe is not None else []
        return [sdo for sdo in read if sdo is not None]

    def _sdo(self, element: Element) -> Sdo | None:
        index = self._index(element, "Index", self._index_step)
        subindex = self._number(element, "SubIndex", 0, 255) if index is not None else None
        if index is None or subindex is None:
            return None
        child = element.first("Data")
        text = "".join(child.text.split()) if child is not None else ""
        try:
            data = bytes.fromhex(text)
        except ValueError:
            message = f"data {text[:40]!r} of a start-up SDO are not hex digits"
            self._wrong("FSN111", element.span, message, "write each byte as two hex digits")
            return None
        if len(data) in SDO_BYTES and not flag(element, "CompleteAccess"):
            return Sdo.of(index, subindex, data, element.span)
        how = "with complete access" if flag(element, "CompleteAccess") else f"of {len(data)} bytes"
        self.notes.append(f"start-up SDO 0x{index:04x}:{subindex:02x} {how} is left out")
        return None


def slot_places(slots: Element | None, out: Collector, most: int) -> list[SlotPlace]:
    """Return the places for modules, in order.

    Args:
        slots: The element ``Slots`` of a device.
        out: Takes FSN111 for unreadable numbers.
        most: Number of places requested. Further places are returned only up to the last default
            module.
    """
    if slots is None:
        return []
    places: list[SlotPlace] = []
    number = 0
    for slot in slots.all("Slot"):
        count = _attribute(slot, "MaxInstances", 1, out)
        least = min(_attribute(slot, "MinInstances", 0, out), count, MAX_SLOTS)
        if len(places) >= MAX_SLOTS:
            break
        idents = [(esi_number(m.text), m) for m in slot.all("ModuleIdent")]
        fits = tuple(i for i, _ in idents if i is not None)
        defaults = [i for i, m in idents if i is not None and flag(m, "Default")]
        # One default module applies to all mandatory instances.
        if len(defaults) == 1:
            defaults *= max(least, 1)
        wanted = min(max(len(defaults), least, most - number), count)
        for n in range(min(wanted, MAX_SLOTS - len(places))):
            places.append(
                SlotPlace(
                    number=number + n,
                    name=name_of(slot),
                    fits=fits,
                    default=defaults[n] if n < len(defaults) else None,
                    needed=n < least,
                    pdo_step=(number + n) * _step(slots, slot, "SlotPdoIncrement", out),
                    index_step=(number + n) * _step(slots, slot, "SlotIndexIncrement", out),
                    span=slot.span,
                )
            )
        # Unused instances also count, because increments depend on the slot number.
        number += count
    return places


def _step(slots: Element, slot: Element, key: str, out: Collector) -> int:
    """Return an increment; that of a slot has precedence."""
    return _attribute(slot if key in slot.attributes else slots, key, 0, out)


def _attribute(element: Element, key: str, default: int, out: Collector) -> int:
    text = element.attributes.get(key)
    if text is None:
        return default
    number = esi_number(text)
    if number is None or not 0 <= number <= 0xFFFF:
        message = f"{key} {text[:40]!r} is not a number; {default} is taken"
        hint = "write 1 or #x1"
        out.add("FSN111", element.span, message, hint=hint, severity=Severity.WARNING)
        return default
    return number
