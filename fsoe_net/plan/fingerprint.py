"""The fingerprint of a plan: SHA-256 over a canonical text of everything safety-relevant in it.

The text is described line by line in ``docs/reference/fingerprint.md``; the C core creates the same
text from the tables that it has loaded (``master_core/src/plan/fingerprint.c``). Both are
independent of each other.
"""

from __future__ import annotations

import hashlib
import re
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain, islice

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.pause import without_collector
from fsoe_net.errors import PlanFormatError
from fsoe_net.model.safety import SafetyElement, SafetyFunction
from fsoe_net.plan.model import NONE, Plan, PlanEntry, PlanSdo, PlanSymbol, PlanSyncManager

FORM = "fsoe-net fingerprint 2"
"""Name and version of the canonical text; every section and the whole begin with it."""

SECTIONS = ("devices", "process_data", "copies", "connections", "cycle", "safety_functions")
_PLAIN = frozenset(range(0x21, 0x7F)) - {ord("%")}
_HASH = re.compile(r"[0-9a-fA-F]{64}")
_BITS = struct.Struct("<d")
_HASHED_LINES = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Fingerprint:
    """The fingerprint of an accepted or a current state.

    Attributes:
        whole: SHA-256 over the names and hashes of all sections, in hex.
        sections: SHA-256 of each section in hex, in the order of `SECTIONS`.
    """

    whole: str
    sections: Mapping[str, str]

    @property
    def short(self) -> str:
        """The part that people compare: the first 16 hex digits in groups of four."""
        return short_code(self.whole)

    def changed(self, other: Fingerprint) -> tuple[str, ...]:
        """Return the sections that differ, in the order of `SECTIONS`."""
        return tuple(n for n in SECTIONS if self.sections[n] != other.sections[n])

    def to_json(self) -> dict[str, object]:
        """Return the stable JSON form."""
        return {
            "form": FORM,
            "short": self.short,
            "whole": self.whole,
            "sections": dict(self.sections),
        }


def short_code(sha256: str) -> str:
    """Return the part of a hash that people compare: four groups of four hex digits."""
    return " ".join(sha256[n : n + 4].upper() for n in range(0, 16, 4))


@without_collector
def fingerprint_of(plan: Plan) -> Fingerprint:
    """Return the fingerprint of a plan, from its tables."""
    hashes = {}
    for name in SECTIONS:
        if name == "safety_functions" and plan.safety_sha256:
            hashes[name] = plan.safety_sha256
        else:
            hashes[name] = _sha256(_section(plan, name))
    return fingerprint_of_sections(hashes)


def fingerprint_of_sections(sections: Mapping[str, str]) -> Fingerprint:
    """Return the fingerprint whose sections have these hashes (hex).

    Raises:
        KeyError: A section is missing.
    """
    ordered = {name: sections[name].lower() for name in SECTIONS}
    lines = [FORM, *(f"{name} {ordered[name]}" for name in SECTIONS)]
    return Fingerprint(whole=_sha256(lines), sections=ordered)


def fingerprint_from_json(document: object) -> Fingerprint:
    """Return the fingerprint of a JSON document: `Fingerprint.to_json`, or a plan in JSON.

    Raises:
        PlanFormatError: It is not a fingerprint, has another form, or its total hash does not match
            its sections.
    """
    if isinstance(document, Mapping):
        document = document.get("fingerprint", document)
    if not isinstance(document, Mapping) or not isinstance(document.get("sections"), Mapping):
        raise PlanFormatError("no fingerprint; `fsoe-net plan --format json` makes one")
    if document.get("form") != FORM:
        raise PlanFormatError(
            f"fingerprint of the form {document.get('form')!r}; this fsoe-net makes {FORM!r}, "
            "which holds more: make the fingerprint again, compare the report, and accept again"
        )
    sections = document["sections"]
    for name in SECTIONS:
        if not _HASH.fullmatch(str(sections.get(name))):
            raise PlanFormatError(f"section {name!r} has no SHA-256 of 64 hexadecimal digits")
    # Computed again, because an edited total hash must not pass.
    found = fingerprint_of_sections({name: str(sections[name]) for name in SECTIONS})
    if str(document.get("whole")).lower() != found.whole:
        raise PlanFormatError("the whole does not fit the sections: the fingerprint was changed")
    return found


def cycle_sha256(cycle_ns: int) -> str:
    """Return the hash of the section ``cycle`` for a bus cycle in ns, 0 if not stated."""
    return _sha256([f"{FORM} cycle", _cycle_line(cycle_ns)])


def canonical_section(plan: Plan, name: str) -> str:
    """Return the text whose SHA-256 is the hash of a section.

    A plan contains only the hash of the safety functions. `safety_text` returns their text; this
    function returns the text of a plan without any.

    Raises:
        KeyError: Unknown section.
    """
    return _text(_section(plan, name))


def _section(plan: Plan, name: str) -> Iterator[str]:
    return chain((f"{FORM} {name}",), _LINES[name](plan))


def safety_text(functions: Sequence[SafetyFunction]) -> str:
    """Return the text of the section ``safety_functions``."""
    return _text(_safety(functions))


def _safety(functions: Sequence[SafetyFunction]) -> Iterator[str]:
    yield f"{FORM} safety_functions"
    # Sorted as bytes, because every language sorts bytes alike.
    for f in sorted(functions, key=lambda f: f.name.encode("utf-8")):
        yield (
            f"function name={_word(f.name)} trigger={_word(f.trigger)} reaction={_word(f.reaction)}"
            f" reset={_word(f.reset)} modes={_word(f.modes)}"
            f" required_ms={_real(f.required_reaction_ms)} pl={f.pl or '-'} sil={_stated(f.sil)}"
        )
        for e in f.elements:
            yield from _element(e)


def _element(e: SafetyElement) -> Iterator[str]:
    yield (
        f"element kind={e.kind.value} sub={_word(e.sub)} name={_word(e.name)}"
        f" time_ms={_real(e.time_ms)} pfh_per_hour={_real(e.pfh_per_hour)}"
        f" zero_because={_word(e.zero_because)} pl={e.pl or '-'} sil={_stated(e.sil)}"
        f" category={e.category or '-'} mission_years={_real(e.mission_years)}"
        f" source={_word(e.source)} manual={_word(e.manual)}"
    )
    for b in e.bits:
        yield f"safe_bit slot={_stated(b.slot)} bit={b.bit} name={_word(b.name)}"


def safety_sha256(functions: Sequence[SafetyFunction]) -> str:
    """Return the hash of the section (hex) in a plan; empty without safety functions."""
    return _sha256(_safety(functions)) if functions else ""


def _text(lines: Iterable[str]) -> str:
    return "\n".join((*lines, ""))


def _sha256(lines: Iterable[str]) -> str:
    found, left = hashlib.sha256(), iter(lines)
    # In parts: the text of a large bus takes more memory than its plan.
    while part := _text(islice(left, _HASHED_LINES)):
        found.update(part.encode("ascii"))
    return found.hexdigest()


def _word(text: str) -> str:
    """Return a text as one word: UTF-8, with ``%XX`` for ``%`` and all but visible ASCII."""
    if text.isalnum() and text.isascii():
        return text
    raw = text.replace("\0", "").encode("utf-8")
    return "".join(chr(b) if b in _PLAIN else f"%{b:02X}" for b in raw)


def _stated(value: int | None) -> str:
    return "-" if value is None else str(value)


def _real(value: float | None) -> str:
    return "-" if value is None else repr(float(value))


def _devices(plan: Plan) -> Iterator[str]:
    for number, bus in enumerate(plan.buses):
        yield (
            f"bus {number} cycle_ns={bus.cycle_ns} first={bus.first_subdevice}"
            f" devices={bus.subdevice_count} name={_word(bus.name)}"
        )
    for number, group in enumerate(plan.groups):
        yield (
            f"group {number} first={group.first_subdevice} devices={group.subdevice_count}"
            f" name={_word(group.name)} place={_word(group.place)}"
        )
    for number, s in enumerate(plan.subdevices):
        yield (
            f"device {number} alias={s.alias} position={s.position}"
            f" vendor=0x{s.vendor_id:08x} product=0x{s.product_code:08x}"
            f" revision=0x{s.revision_low:08x}-0x{s.revision_high:08x}"
            f" dc=0x{s.assign_activate:04x} in_copy={int(s.in_copy)}"
            f" name={_word(s.name)} driver={_word(s.driver)}"
        )
        for sdo in plan.sdos[s.first_sdo : s.first_sdo + s.sdo_count]:
            yield _sdo(sdo)


def _sdo(sdo: PlanSdo) -> str:
    # Two's complement, as in the write to the object.
    raw = sdo.value & ((1 << (8 * sdo.size_bytes)) - 1)
    return f"sdo 0x{sdo.index:04x}:{sdo.subindex:02x} bytes={sdo.size_bytes} value=0x{raw:016x}"


def _process_data(plan: Plan) -> Iterator[str]:
    # The text of a PDO is created once for all SubDevices of its type.
    known: dict[tuple[int, tuple[PlanEntry, ...]], str] = {}
    for sm in plan.sync_managers:
        yield (f"sm {_place(sm)} direction={sm.direction} watchdog={sm.watchdog} bits={sm.bits}")
        for pdo in plan.pdos[sm.first_pdo : sm.first_pdo + sm.pdo_count]:
            entries = plan.entries[pdo.first_entry : pdo.first_entry + pdo.entry_count]
            lines = known.get((pdo.index, entries))
            if lines is None:
                lines = "\n".join((f"pdo 0x{pdo.index:04x}", *map(_entry, entries)))
                known[pdo.index, entries] = lines
            yield lines
    # Sorted: the order of records must not change the fingerprint.
    for block in sorted(plan.blocks, key=lambda b: (b.sm, b.byte_offset)):
        yield (
            f"frame {_place(plan.sync_managers[block.sm])} byte={block.byte_offset}"
            f" bytes={block.frame_bytes} safe={block.safe_bytes} copied={int(block.copied)}"
        )
    for key in sorted(_symbol(s) for s in plan.symbols):
        number, bit, bits, kind, output, restart, stop, factor, offset, name = key
        yield (
            f"symbol {_place(plan.sync_managers[number])} bit={bit} bits={bits} type={kind}"
            f" output={output} restart={restart} stop=0x{stop:016x}"
            f" factor=0x{factor:016x} offset=0x{offset:016x} name={_word(name.decode())}"
        )


def _entry(e: PlanEntry) -> str:
    return (
        f"entry 0x{e.index:04x}:{e.subindex:02x} bits={e.bits} type={e.kind}"
        f" registered={int(e.registered)}"
    )


_Symbol = tuple[int, int, int, int, int, int, int, int, int, bytes]


def _symbol(s: PlanSymbol) -> _Symbol:
    return (
        s.sm,
        s.bit_offset,
        s.bits,
        s.kind,
        int(s.output),
        int(s.restart_relevant),
        s.stop_value,
        _pattern(s.factor),
        _pattern(s.offset),
        s.name.encode("utf-8"),
    )


def _pattern(value: float) -> int:
    # The bits of a number are used, because languages print decimals differently.
    return int.from_bytes(_BITS.pack(value), "little")


def _place(sm: PlanSyncManager) -> str:
    return f"{sm.subdevice}.{sm.index}"


def _connection_order(plan: Plan) -> list[int]:
    """Return the connections in the order of the bytes written to their SubInstance."""
    # Connection numbers follow the order in the files, which must not affect the fingerprint.
    ends = [plan.copies[c.copy_to_sub] for c in plan.connections]
    return sorted(range(len(ends)), key=lambda n: (ends[n].destination_sm, ends[n].destination_bit))


def _copies(plan: Plan) -> Iterator[str]:
    rank = {number: n for n, number in enumerate(_connection_order(plan))}
    for c in sorted(plan.copies, key=lambda c: (c.destination_sm, c.destination_bit)):
        source, destination = plan.sync_managers[c.source_sm], plan.sync_managers[c.destination_sm]
        connection = "-" if c.connection == NONE else str(rank[c.connection])
        yield (
            f"copy from={_place(source)}@{c.source_bit} to={_place(destination)}"
            f"@{c.destination_bit} bits={c.bits} kind={c.kind} connection={connection}"
            f" net={_word(c.net)}"
        )


def _connections(plan: Plan) -> Iterator[str]:
    for n, number in enumerate(_connection_order(plan)):
        c = plan.connections[number]
        yield (
            f"connection {n} main={c.main} sub={c.sub} id={_stated(c.connection_id)}"
            f" address={_stated(c.address)} watchdog_ms={_stated(c.watchdog_ms)}"
            f" safe_to_sub={c.safe_to_sub} safe_to_main={c.safe_to_main}"
            f" app_parameters={c.app_parameters} name={_word(c.name)} net={_word(c.net)}"
        )


def _cycle(plan: Plan) -> Iterator[str]:
    yield _cycle_line(plan.cycle_ns)


def _cycle_line(cycle_ns: int) -> str:
    return f"cycle_ns={cycle_ns or '-'}"


def _nothing(_: Plan) -> Iterator[str]:
    return iter(())


_LINES: Mapping[str, Callable[[Plan], Iterator[str]]] = {
    "devices": _devices,
    "process_data": _process_data,
    "copies": _copies,
    "connections": _connections,
    "cycle": _cycle,
    "safety_functions": _nothing,
}
