"""FSN433 … FSN441: the process data of one SubDevice compared with another file."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace

from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import Device, Direction, Pdo, SyncManager, Watchdog
from fsoe_net.model.description import DescribedSubDevice, PdoFacts
from fsoe_net.model.layout import SmLayout
from fsoe_net.rules.context import describe_sm
from fsoe_net.rules.entries import assignment_words, first_difference, items_of, listed

_LOOK = "one of the two is wrong: `ethercat pdos` or `fsoe-net scan` shows what the device has"
_MODULES = "the default modules of the file were compared; the device may have others"


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """A finding about a SubDevice, not yet with its name; ``there`` is the place in the file."""

    code: str
    span: Span
    text: str
    there: Span
    hint: str = _LOOK
    severity: Severity | None = None


def compare_layout(
    device: Device,
    row: DescribedSubDevice,
    *,
    source: str,
    is_type: bool,
    is_setup: bool,
) -> list[Remark]:
    """Compare the process data of a device with those of a file.

    Args:
        device: As the user describes it.
        row: The same device in the other file.
        source: The file, as shown.
        is_type: The file describes the capabilities of the device (ESI, SII), not its set-up.
        is_setup: The file is a configuration, so its watchdogs were chosen deliberately.
    """
    side = _Side(device=device, row=row, source=source, is_type=is_type)
    if row.truncated:
        return []
    if side.numberless:
        side.compare_numberless()
    elif side.pdos:
        side.compare_pdos()
    if is_setup:
        side.compare_watchdogs()
    side.compare_default_sizes()
    # Other modules than the default ones may be in the slots, so a difference is not a mistake.
    if row.facts.modular:
        return [
            r if r.code == "FSN441" else replace(r, hint=_MODULES, severity=Severity.INFO)
            for r in side.remarks
        ]
    return side.remarks


@dataclass(slots=True, kw_only=True)
class _Side:
    """Both sides of one SubDevice; collects remarks, at most one per PDO or sync manager."""

    device: Device
    row: DescribedSubDevice
    source: str
    is_type: bool
    remarks: list[Remark] = field(default_factory=list)
    named: set[int] = field(default_factory=set)  # sync managers that have a remark
    ours: list[tuple[SmLayout, tuple[Pdo, ...]]] = field(init=False)
    theirs: dict[int, SyncManager] = field(init=False)
    pdos: dict[int, Pdo] = field(default_factory=dict)  # PDOs of the file, assigned ones first
    facts: dict[int, PdoFacts] = field(init=False)

    def __post_init__(self) -> None:
        rows = [(sm, self.device.pdos_of(sm.sm)) for sm in self.device.layout.managers]
        self.ours = [(sm, pdos) for sm, pdos in rows if pdos]
        self.theirs = {sm.index: sm for sm in self.row.device.sync_managers}
        self.facts = {f.index: f for f in self.row.facts.pdos}
        assigned = (p for sm in self.theirs.values() for p in sm.pdos or ())
        for pdo in (*assigned, *self.row.available):
            self.pdos.setdefault(pdo.index, pdo)

    @property
    def numberless(self) -> bool:
        """Whether the file has bytes of sync managers without PDO numbers."""
        return any(p.index == 0 for sm in self.theirs.values() for p in sm.pdos or ())

    def add(
        self,
        code: str,
        span: Span,
        text: str,
        there: Span,
        *,
        sm: Iterable[int] = (),
        hint: str = _LOOK,
        severity: Severity | None = None,
    ) -> None:
        self.named.update(sm)
        self.remarks.append(
            Remark(code=code, span=span, text=text, there=there, hint=hint, severity=severity)
        )

    def span_of(self, sm: SyncManager) -> Span:
        return sm.span if sm.declared else self.device.span

    # -- whole sync managers ----------------------------------------------------------------------

    def compare_numberless(self) -> None:
        for planned, pdos in self.ours:
            sm = self.theirs.get(planned.sm.index)
            if sm is None or not sm.pdos or self._direction(planned, sm):
                continue
            entries = tuple(e for p in sm.pdos for e in p.entries)
            if all(e.is_gap for e in entries):
                self._length(planned, sm, sum(e.bits for e in entries))
            elif planned.complete:
                whole = replace(pdos[0], entries=tuple(e for p in pdos for e in p.entries))
                there = replace(sm.pdos[0], entries=entries)
                self._mapping(planned.sm.index, whole, there, f"SM{planned.sm.index}")

    def _direction(self, planned: SmLayout, sm: SyncManager) -> bool:
        if planned.sm.direction is sm.direction:
            return False
        way = "outputs" if sm.direction is Direction.OUTPUT else "inputs"
        self.add(
            "FSN440",
            self.span_of(planned.sm),
            f"{describe_sm(planned)}, is for {way} in {self.source}",
            sm.span,
            sm=(planned.sm.index,),
        )
        return True

    def _length(self, planned: SmLayout, sm: SyncManager, bits: int) -> None:
        size = (bits + 7) // 8
        if planned.complete and planned.size_bytes != size:
            self.add(
                "FSN440",
                self.span_of(planned.sm),
                f"SM{sm.index} has {counted(planned.size_bytes, 'byte')}, "
                f"{counted(size, 'byte')} in {self.source}",
                sm.span,
                sm=(sm.index,),
            )

    def compare_watchdogs(self) -> None:
        for planned, _ in self.ours:
            own = planned.sm
            sm = self.theirs.get(own.index)
            if sm is None or own.direction is not Direction.OUTPUT or not own.declared:
                continue
            if Watchdog.DEFAULT in (own.watchdog, sm.watchdog) or own.watchdog is sm.watchdog:
                continue
            words = {Watchdog.ENABLE: "on", Watchdog.DISABLE: "off"}
            self.add(
                "FSN440",
                own.at("watchdog"),
                f"the watchdog of SM{own.index} is {words[own.watchdog]}, "
                f"{words[sm.watchdog]} in {self.source}",
                sm.span,
                hint="choose one; FSoE has its own watchdog and does not need this one",
            )

    def compare_default_sizes(self) -> None:
        """FSN441, once per device: it is a note, whatever the number of sync managers."""
        sizes = self.row.facts.default_bytes
        wrong = [
            planned
            for planned, _ in self.ours
            if planned.complete
            and planned.sm.index not in self.named
            and sizes.get(planned.sm.index, 0) not in (0, planned.size_bytes)
        ]
        if not wrong:
            return
        texts = [f"{sizes[p.sm.index]} bytes for SM{p.sm.index} of {p.size_bytes}" for p in wrong]
        self.add(
            "FSN441",
            self.span_of(wrong[0].sm),
            f"DefaultSize in {self.source} is {', '.join(texts)}",
            self.theirs.get(wrong[0].sm.index, self.row).span,
            hint="nothing to do: the PDOs give the length, DefaultSize is often left as it was",
            severity=Severity.INFO,
        )

    # -- PDOs -------------------------------------------------------------------------------------

    def compare_pdos(self) -> None:
        moved = self._moved()
        self._excluded()
        known = self.pdos
        for planned, pdos in self.ours:
            number = planned.sm.index
            sm = self.theirs.get(number)
            if sm is not None and sm.pdos and self._direction(planned, sm):
                continue
            theirs = sm.pdos or () if sm is not None else ()
            self._assignment(number, pdos[0].span, _without(pdos, moved), _without(theirs, moved))
            for pdo in pdos:
                if pdo.index in known:
                    self._mapping(number, pdo, known[pdo.index], f"PDO 0x{pdo.index:04x}")
        here = {sm.sm.index for sm, _ in self.ours}
        for number, sm in self.theirs.items():
            others = _without(sm.pdos or (), moved)
            if number not in here and others:
                self._assignment(number, self.device.at("sm"), [], others)

    def _moved(self) -> set[int]:
        """FSN439: PDOs on another sync manager; one finding for each pair of sync managers."""
        place = {f.index: f.sm for f in self.row.facts.pdos if f.sm is not None}
        for number, sm in self.theirs.items():
            # The assignment takes precedence over the default sync manager of a PDO.
            place.update((p.index, number) for p in sm.pdos or ())
        moves: dict[tuple[int, int], list[Pdo]] = {}
        for planned, pdos in self.ours:
            for pdo in pdos:
                other = place.get(pdo.index, planned.sm.index)
                if other != planned.sm.index:
                    moves.setdefault((planned.sm.index, other), []).append(pdo)
        for (own, other), gone in moves.items():
            numbers = listed([p.index for p in gone])
            words = f"PDOs {numbers} are" if len(gone) > 1 else f"PDO {numbers} is"
            self.add(
                "FSN439",
                gone[0].span,
                f"{words} on SM{own}, on SM{other} in {self.source}",
                self.pdos.get(gone[0].index, self.row).span,
                sm=(own, other),
                hint=f"list SM{other} with its PDOs under sm; a slave YAML that cannot say it does "
                "not fit this device",
            )
        return {p.index for gone in moves.values() for p in gone}

    def _excluded(self) -> None:
        """FSN438."""
        rows = {p.index: (p, sm.sm.index) for sm, pdos in self.ours for p in pdos}
        order = {index: n for n, index in enumerate(rows)}
        pairs = {
            tuple(sorted((f.index, other), key=order.__getitem__))
            for f in self.row.facts.pdos
            if f.index in rows
            for other in f.excludes
            if other in rows and other != f.index
        }
        for first, second in sorted(pairs):
            pdo, number = rows[second]
            self.add(
                "FSN438",
                pdo.span,
                f"PDO 0x{second:04x} and 0x{first:04x} exclude each other by {self.source}",
                self.pdos.get(second, self.row).span,
                sm=(number,),
                hint="assign one of them only; the device refuses both together",
            )

    def _assignment(self, number: int, span: Span, ours: list[Pdo], theirs: list[Pdo]) -> None:
        """FSN433, FSN437: the PDOs of a sync manager and their order."""
        here = {p.index for p in ours}
        # A PDO that another one excludes, or that is reported as missing, is not reported twice.
        blocked = self._excluded_by(here) | self._missing(number, span, _without(theirs, here))
        mine = [p.index for p in ours]
        other = [p.index for p in theirs if p.index in here or p.index not in blocked]
        if mine == other:
            return
        unknown = [p for p in ours if p.index not in self.pdos]
        if self.is_type and not unknown and self.row.facts.assignable and set(other) <= set(mine):
            return  # optional PDOs, which a MainDevice may assign
        self.add(
            "FSN433",
            unknown[0].span if unknown else span,
            f"SM{number} carries {listed(mine)} here, {listed(other)} in {self.source}"
            f"{assignment_words(mine, other)}",
            theirs[0].span if theirs else self.row.span,
            sm=(number,),
            severity=self._assignment_severity(unknown),
        )

    def _assignment_severity(self, unknown: list[Pdo]) -> Severity | None:
        if not self.is_type:
            return None
        if unknown:
            return Severity.ERROR
        return Severity.INFO if self.row.facts.assignable else None

    def _missing(self, number: int, span: Span, pdos: list[Pdo]) -> set[int]:
        """FSN437; return the unassigned PDOs that are mandatory."""
        if not self.is_type:
            return set()
        missing = [p for p in pdos if p.index in self.facts and self.facts[p.index].mandatory]
        for pdo in missing:
            self.add(
                "FSN437",
                span,
                f"PDO 0x{pdo.index:04x} is mandatory on SM{number} by {self.source} and not "
                "assigned",
                pdo.span,
                sm=(number,),
                hint="assign it; a device whose mandatory PDO is missing does not start",
            )
        return {p.index for p in missing}

    def _excluded_by(self, here: set[int]) -> set[int]:
        """Return the PDOs that exclude these, or are excluded by them."""
        excluded = {index for index, facts in self.facts.items() if facts.excludes & here}
        return excluded.union(*(self.facts[i].excludes for i in here if i in self.facts))

    def _mapping(self, number: int, pdo: Pdo, there: Pdo, what: str) -> None:
        """FSN434, FSN435, FSN436: the entries of a PDO."""
        if not pdo.entries or not there.entries:
            return
        first = first_difference(pdo, there.entries)
        if first is None:
            return
        entry, span, mine, other = first
        facts = self.facts.get(pdo.index)
        fixed = facts is not None and facts.fixed
        free = facts is not None and not fixed
        # Only padding differs: every entry is right, but the entries after it are shifted.
        gap = _without_gaps(pdo) == _without_gaps(there)
        severity = None
        if gap:
            code, severity = "FSN435", Severity.WARNING if free else None
        elif fixed:
            code = "FSN436"
        else:
            code, severity = "FSN434", Severity.INFO if free else None
        text = f"entry {entry} of {what} is {mine}, {other} in {self.source}"
        hint = _LOOK
        if fixed:
            text += ", where the PDO is fixed"
            hint = "a fixed PDO is as the device has it: write the entries of the file"
        elif free:
            hint = "the device lets a MainDevice map other entries; is this one meant?"
        self.add(code, span, text, there.span, sm=(number,), hint=hint, severity=severity)


def _without_gaps(pdo: Pdo) -> list[tuple[int, int, int]]:
    return [item.key for item in items_of(pdo.entries) if item.index]


def _without(pdos: Iterable[Pdo], numbers: Collection[int]) -> list[Pdo]:
    return [pdo for pdo in pdos if pdo.index not in numbers]
