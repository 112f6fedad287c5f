"""One device of an ESI file: sync managers, assigned PDOs, modules in slots, start-up data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Severity, Span
from fsoe_net.diag.words import counted
from fsoe_net.formats.esi.catalogue import EsiRow
from fsoe_net.formats.esi.parts import EsiPdo, PartReader, SlotPlace, flag, name_of, slot_places
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import esi_number
from fsoe_net.formats.shared.xml_tree import Element
from fsoe_net.model.bus import Device, Direction, Pdo, Sdo, SyncManager
from fsoe_net.model.description import (
    ClockFacts,
    DescribedSubDevice,
    MailboxFacts,
    StartFacts,
    TypeFacts,
)

_MOST_SMS = 16  # as in an ENI
_PROTOCOLS = ("AoE", "EoE", "CoE", "FoE", "SoE", "VoE")
_PORTS = frozenset("YKBH ")
_MAX_NOTES = 100
_MAX_FINDINGS = 50
_MAX_ENTRIES = 100_000  # of a device with its modules


@dataclass(frozen=True, slots=True, kw_only=True)
class _Manager:
    """A sync manager as written. ``direction`` is ``None`` if it is unused."""

    index: int
    direction: Direction | None
    mailbox: bool
    virtual: bool
    start: int | None
    default_bytes: int
    span: Span


def read_esi_device(
    element: Element,
    row: EsiRow,
    out: Collector,
    *,
    path: str,
    modules: Sequence[int | None] | None,
    module: Callable[[int, Span], Element | None],
) -> DescribedSubDevice | None:
    """Convert the element of a device to the model.

    Args:
        element: The ``Device``.
        row: Its line in the catalogue.
        out: Takes its findings.
        path: The file.
        modules: Idents of the modules by slot, ``None`` for an empty slot; without it the default
            modules are used.
        module: Finds a module by its ident, or records that it is missing.

    Returns:
        The device, or ``None`` with a finding: a partly correct layout is not returned.
    """
    return _DeviceReader(element, row, out, path).read(modules, module)


class _DeviceReader:
    def __init__(self, element: Element, row: EsiRow, out: Collector, path: str) -> None:
        self._element = element
        self._row = row
        self._out = out
        self._path = path
        self._notes: list[str] = []
        self._broken = False
        self._entries = 0
        self._contradicted = 0
        self._at: dict[tuple[int, Direction], int] = {}
        self._written = self._managers()

    def read(
        self,
        modules: Sequence[int | None] | None,
        module: Callable[[int, Span], Element | None],
    ) -> DescribedSubDevice | None:
        pdos, sdos = self._part(self._element, PartReader(self._out))
        # Reversed, so that the first of two PDOs with the same number counts.
        self._at = {(p.index, p.direction): n for n, p in reversed([*enumerate(pdos)])}
        idents: list[int] = []
        added = False
        for place, ident in self._chosen(modules):
            found = module(ident, place.span)
            if found is None or self._is_too_much(place):
                self._broken = True
                break
            part = PartReader(self._out, pdo_step=place.pdo_step, index_step=place.index_step)
            more, more_sdos = self._part(found, part)
            added |= self._merge(pdos, more)
            sdos += more_sdos
            idents.append(ident)
        if added:
            pdos.sort(key=lambda p: p.index)
            self._note("PDOs of modules are put in the order of their index")
        if self._broken:
            return None
        managers, available = self._assign(pdos)
        row = self._row
        device = Device(
            path=self._path,
            vendor_id=row.vendor,
            product_code=row.product,
            assign_activate=self._assign_activate(),
            sync_managers=managers,
            sdos=tuple(sdos),
            span=self._element.span,
        )
        return DescribedSubDevice(
            name=row.name,
            order=row.type,
            device=device,
            available=available,
            revision=row.revision,
            module_ident=tuple(idents),
            notes=tuple(dict.fromkeys(self._notes))[:_MAX_NOTES],
            facts=self._facts(pdos),
            start=esi_start(self._element, row.revision, pdos),
            span=self._element.span,
        )

    def _facts(self, pdos: list[EsiPdo]) -> TypeFacts:
        mailbox = self._element.first("Mailbox")
        coe = mailbox.first("CoE") if mailbox is not None else None
        return TypeFacts(
            pdos=tuple(p for p in pdos if not p.virtual),
            assignable=None if coe is None else flag(coe, "PdoAssign"),
            modular=self._has_choice(),
            default_bytes={
                m.index: m.default_bytes
                for m in self._written
                if m.default_bytes > 0 and not m.mailbox
            },
        )

    def _has_choice(self) -> bool:
        """Whether the slots may contain modules other than the default ones."""
        slots = self._element.first("Slots")
        for slot in slots.all("Slot") if slots is not None else ():
            idents = slot.all("ModuleIdent")
            most = slot.attributes.get("MaxInstances", "1").strip()
            if len(idents) != 1 or not flag(idents[0], "Default") or most != "1":
                return True
        return False

    def _note(self, text: str) -> None:
        self._notes.append(text)

    def _part(self, element: Element, part: PartReader) -> tuple[list[EsiPdo], list[Sdo]]:
        pdos, sdos = part.pdos(element), part.sdos(element)
        self._entries += len(sdos) + sum(1 + len(p.pdo.entries) for p in pdos)
        self._broken |= part.broken
        self._notes += part.notes
        for pdo in pdos:
            if pdo.mark:
                self._note(f"PDO 0x{pdo.index:04x} is marked {pdo.mark}")
        return pdos, sdos

    def _is_too_much(self, place: SlotPlace) -> bool:
        # A small file can name one large module for thousands of slots.
        if self._entries <= _MAX_ENTRIES:
            return False
        message = f"the modules before slot {place.number} have more than {_MAX_ENTRIES} entries"
        self._out.add("FSN103", place.span, message, hint="choose the modules that are there")
        return True

    # -- modules ----------------------------------------------------------------------------------

    def _chosen(self, modules: Sequence[int | None] | None) -> list[tuple[SlotPlace, int]]:
        slots = self._element.first("Slots")
        places = slot_places(slots, self._out, len(modules or ()))
        if slots is not None and any(c.name == "ModulePdoGroup" for c in slots.children):
            self._note("the alignment of ModulePdoGroup is not applied")
        if modules is None:
            return self._built_in(places)
        if len(modules) > len(places):
            message = (
                f"{counted(len(modules), 'module')} are chosen, the device has {len(places)} slots"
            )
            self._refuse(slots.span if slots is not None else self._element.span, message)
            return []
        rows = []
        for place, ident in zip(places, modules, strict=False):
            if ident is None:
                continue
            if place.fits and ident not in place.fits:
                known = ", ".join(f"0x{i:x}" for i in place.fits[:8])
                message = f"module 0x{ident:x} is not among those of slot {place.number}"
                hint = f"its modules are {known}"
                self._out.add("FSN137", place.span, message, hint=hint, severity=Severity.WARNING)
            rows.append((place, ident))
        return rows

    def _built_in(self, places: list[SlotPlace]) -> list[tuple[SlotPlace, int]]:
        rows = []
        for place in places:
            if place.default is not None:
                rows.append((place, place.default))
            elif place.needed and len(place.fits) == 1:
                self._note(f"slot {place.number} has no default; its only module is taken")
                rows.append((place, place.fits[0]))
            elif place.needed:
                self._note(f"slot {place.number} has no default module and is left empty")
        return rows

    def _refuse(self, span: Span, message: str) -> None:
        self._broken = True
        self._out.add("FSN137", span, message, hint="choose a module for each slot, or none")

    def _merge(self, pdos: list[EsiPdo], more: list[EsiPdo]) -> bool:
        """Add the PDOs of a module; return whether one is new."""
        added = False
        for new in more:
            at = self._at.get((new.index, new.direction))
            if at is None:
                self._at[new.index, new.direction] = len(pdos)
                pdos.append(new)
                added = True
                continue
            old = pdos[at]
            if not old.by_module:
                self._note(f"PDO 0x{new.index:04x} of the device gives way to a module")
            sm = new.sm if new.sm is not None else old.sm
            pdos[at] = replace(new, sm=sm, mandatory=new.mandatory or old.mandatory)
        return added

    # -- assignment -------------------------------------------------------------------------------

    def _managers(self) -> list[_Manager]:
        rows = []
        for index, element in enumerate(self._element.all("Sm")):
            control = esi_number(element.attributes.get("ControlByte", ""))
            start = self._start(element)
            word = element.text.strip().lower()
            if word in ("outputs", "mboxout"):
                direction: Direction | None = Direction.OUTPUT
            elif word in ("inputs", "mboxin"):
                direction = Direction.INPUT
            # Without a word, the control byte shows the use; a start address of 0 means unused.
            elif control is None or not start:
                direction = None
            else:
                # Bits 2 and 3: 1 is written by the MainDevice (ETG.1000.4).
                direction = Direction.OUTPUT if control & 0x0C == 0x04 else Direction.INPUT
            mailbox = word.startswith("mbox") or (
                not word and control is not None and control & 0x03 == 0x02
            )
            rows.append(
                _Manager(
                    index=index,
                    direction=direction,
                    mailbox=mailbox,
                    virtual=flag(element, "Virtual"),
                    start=start or None,
                    default_bytes=esi_number(element.attributes.get("DefaultSize", "")) or 0,
                    span=element.span,
                )
            )
        return rows[:32]

    def _assign(self, pdos: list[EsiPdo]) -> tuple[tuple[SyncManager, ...], tuple[Pdo, ...]]:
        written = {m.index: m for m in self._written}
        assigned: dict[int, list[EsiPdo]] = {}
        available: list[Pdo] = []
        for pdo in pdos:
            index = self._place_of(pdo, written)
            if index is None:
                available.append(pdo.pdo)
            else:
                assigned.setdefault(index, []).append(pdo)
        self._contradictions([p for sm in assigned.values() for p in sm])
        managers = []
        for index in sorted({*written, *assigned}):
            own, carried = written.get(index), assigned.get(index, [])
            direction = own.direction if own is not None else None
            if direction is None:
                direction = carried[0].direction if carried else Direction.OUTPUT
            managers.append(
                SyncManager(
                    index=index,
                    direction=direction,
                    declared=own is not None,
                    pdos=tuple(p.pdo for p in carried),
                    start_byte=own.start if own is not None else None,
                    span=own.span if own is not None else self._element.span,
                )
            )
        return tuple(managers), tuple(available)

    def _place_of(self, pdo: EsiPdo, written: dict[int, _Manager]) -> int | None:
        what = f"PDO 0x{pdo.index:04x}"
        manager = written.get(pdo.sm) if pdo.sm is not None else None
        if pdo.virtual and (manager is None or not manager.virtual):
            self._note(f"{what} is virtual: it has no place in the process data")
            return None
        if pdo.sm is None:
            return self._place_of_mandatory(pdo, written) if pdo.mandatory else None
        if manager is None:
            message = f"{what} goes to SM{pdo.sm}, which the device does not have"
            self._contradiction(pdo, message, "compare Sm with the <Sm> elements of the device")
        elif manager.mailbox:
            message = f"{what} goes to SM{pdo.sm}, which is a mailbox"
            self._contradiction(pdo, message, "compare Sm with the <Sm> elements of the device")
        elif manager.direction not in (None, pdo.direction):
            message = f"{what} goes to SM{pdo.sm}, which has the other direction"
            self._contradiction(pdo, message, "an RxPdo goes to Outputs, a TxPdo to Inputs")
        return pdo.sm

    def _place_of_mandatory(self, pdo: EsiPdo, written: dict[int, _Manager]) -> int | None:
        for manager in written.values():
            if manager.direction is pdo.direction and not manager.mailbox:
                self._note(f"mandatory PDO 0x{pdo.index:04x} is put on SM{manager.index}")
                return manager.index
        self._note(f"mandatory PDO 0x{pdo.index:04x} is left out: no sync manager carries it")
        return None

    def _contradictions(self, assigned: list[EsiPdo]) -> None:
        seen: dict[tuple[int, Direction], EsiPdo] = {}
        by_index: dict[int, EsiPdo] = {}
        unwanted: dict[int, EsiPdo] = {}
        for pdo in assigned:
            index = pdo.index
            other = seen.get((index, pdo.direction))
            if other is not None:
                message = f"PDO 0x{index:04x} is assigned twice"
                self._contradiction(pdo, message, "take Sm from one of the two", other)
            earlier = unwanted.get(index) or next(
                (by_index[e] for e in pdo.excludes if e in by_index), None
            )
            if earlier is not None:
                message = f"PDO 0x{index:04x} and 0x{earlier.index:04x} exclude each other"
                hint = "only one can be assigned; take Sm from the other"
                self._contradiction(pdo, message, hint, earlier)
            seen[index, pdo.direction] = pdo
            by_index[index] = pdo
            # Either of the two PDOs may state the exclusion.
            unwanted.update((e, pdo) for e in pdo.excludes if e != index)

    def _contradiction(
        self, pdo: EsiPdo, message: str, hint: str, other: EsiPdo | None = None
    ) -> None:
        self._contradicted += 1
        if self._contradicted > _MAX_FINDINGS:
            return
        related = (Related(span=other.pdo.span, message="the other one"),) if other else ()
        self._out.add("FSN139", pdo.pdo.span, message, hint=hint, related=related)

    def _start(self, element: Element) -> int | None:
        text = element.attributes.get("StartAddress", "")
        start = esi_number(text)
        if start is not None and not 0 <= start <= 0xFFFF:
            message = f"StartAddress {text.strip()[:40]!r} is not an address; it is left out"
            hint = "an address is 0 to #xffff"
            self._out.add("FSN111", element.span, message, hint=hint, severity=Severity.WARNING)
            return None
        return start

    def _assign_activate(self) -> int:
        clock = self._element.first("Dc")
        modes = clock.all("OpMode") if clock is not None else []
        if not modes:
            return 0
        # TwinCAT also takes the first mode unless another one is chosen.
        if len(modes) > 1:
            names = ", ".join(name_of(m)[:40] for m in modes[:8])
            self._note(f"of the clock modes {names} the first is taken")
        word = modes[0].first("AssignActivate")
        number = esi_number(word.text) if word is not None else 0
        if word is not None and (number is None or not 0 <= number <= 0xFFFF):
            message = f"AssignActivate {word.text.strip()[:40]!r} is not a number; 0 is taken"
            hint = "write it as #x0300"
            self._out.add("FSN111", word.value_span, message, hint=hint, severity=Severity.WARNING)
            return 0
        return number or 0


def esi_start(element: Element, revision: int | None, pdos: Iterable[EsiPdo]) -> StartFacts:
    """Return the start-up data of a ``Device``; numbers out of range are omitted.

    Args:
        element: The ``Device``.
        revision: Its revision number.
        pdos: Its PDOs, with those of its modules.
    """
    managers = element.all("Sm")[:_MOST_SMS]
    mailbox = element.first("Mailbox")
    coe = mailbox.first("CoE") if mailbox is not None else None
    maps = coe is not None and flag(coe, "PdoConfig")
    physics = element.attributes.get("Physics", "")[:4].upper()
    return StartFacts(
        revision=revision,
        physics=physics if _PORTS.issuperset(physics) else "",
        mailbox=None if mailbox is None else _mailbox(mailbox, managers),
        clock=_clock(element),
        starts=_numbers(managers, "StartAddress", 0xFFFF),
        controls=_numbers(managers, "ControlByte", 0xFF),
        assigns=coe is not None and flag(coe, "PdoAssign"),
        maps=frozenset(p.index for p in pdos if maps and not p.fixed),
    )


def _number(element: Element, name: str, high: int) -> int | None:
    value = esi_number(element.attributes.get(name, ""))
    return value if value is not None and 0 <= value <= high else None


def _numbers(managers: list[Element], name: str, high: int) -> dict[int, int]:
    rows = {n: _number(sm, name, high) for n, sm in enumerate(managers)}
    return {n: value for n, value in rows.items() if value is not None}


def _mailbox(mailbox: Element, managers: list[Element]) -> MailboxFacts | None:
    windows: dict[str, tuple[int, int]] = {}
    # The mailbox is on SM0 and SM1 (ETG.1000.6).
    for sm in managers[:2]:
        start, size = _number(sm, "StartAddress", 0xFFFF), _number(sm, "DefaultSize", 0xFFFF)
        if start and size:
            windows.setdefault(sm.text.strip().lower(), (start, size))
    to_sub, from_sub = windows.get("mboxout"), windows.get("mboxin")
    if to_sub is None or from_sub is None:
        return None
    protocols = tuple(p for p in _PROTOCOLS if mailbox.first(p) is not None)
    return MailboxFacts(to_sub=to_sub, from_sub=from_sub, protocols=protocols)


def _clock(element: Element) -> ClockFacts | None:
    """Return the times of the first clock mode, which is the one that is used."""
    clock = element.first("Dc")
    mode = clock.first("OpMode") if clock is not None else None
    if mode is None:
        return None
    cycle, shift = mode.first("CycleTimeSync0"), mode.first("ShiftTimeSync0")
    factor = esi_number(cycle.attributes.get("Factor", "")) if cycle is not None else None
    return ClockFacts(
        cycle_ns=_time(cycle, 0), factor=factor or 1, shift_ns=_time(shift, -0x80000000)
    )


def _time(element: Element | None, low: int) -> int:
    value = esi_number(element.text) if element is not None else None
    return value if value is not None and low <= value <= 0x7FFFFFFF else 0
