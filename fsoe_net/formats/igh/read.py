"""Output of the ``ethercat`` tool of the IgH master into descriptions.

``pdos``, ``slaves``, ``slaves -v``, ``config -v`` and ``domains -v`` here; ``cstruct``, ``xml`` and
``sii_read -v`` in modules of their own. Nothing is taken from indentation, which pastes lose.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.formats.igh import CSTRUCT
from fsoe_net.formats.igh.read_config import read_config, read_domains
from fsoe_net.formats.igh.read_cstruct import read_cstruct
from fsoe_net.formats.igh.read_sii import read_sii_text
from fsoe_net.formats.igh.read_xml import read_xml
from fsoe_net.formats.recognise import is_format, recognise
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import Source, source_bytes
from fsoe_net.formats.shared.terminal_text import Line, Pasted, pasted
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, SyncManager, Watchdog
from fsoe_net.model.description import DescribedSubDevice, Description, TypeFacts

_HEADER = re.compile(r"=== Master (\d{1,3}), Slave (\d{1,5}) ===$")
_SM = re.compile(
    r"SM(\d{1,2}): PhysAddr 0x([0-9a-f]{4}), DefaultSize +(\d{1,5}), "
    r"ControlRegister 0x([0-9a-f]{2}), Enable (\d{1,3})$"
)
_PDO = re.compile(r'([RT])xPDO 0x([0-9a-f]{4}) "(.*)"$')
_ENTRY = re.compile(r'PDO entry 0x([0-9a-f]{4}):([0-9a-f]{2}), +(\d{1,3}) bit, "(.*)"$')
_PDOS_STARTS = ("=== Master", "SM", "RxPDO 0x", "TxPDO 0x", "PDO entry 0x")
_FIRST_PROCESS_SM = 2
_ROOTS = ("EtherCATInfo", "EtherCATInfoList")


def load_igh_text(source: Source, out: Collector, *, name: str = "<text>") -> Description | None:
    """Read output of the ``ethercat`` tool; the command is recognised by its content.

    Args:
        source: Path, or the bytes.
        out: Takes findings; a text that is cut off is FSN146, never a shorter map.
        name: Name shown when ``source`` is bytes.
    """
    data, shown = source_bytes(source, out, name)
    if data is None:
        return None
    found = recognise(data)
    text = pasted(data, shown, out)
    if found is not None and found.kind == "esi" and b"<Groups" in data:
        is_format(data, "ethercat", shown, out)
        return None
    if found is not None and found.signature is CSTRUCT:
        _one_master(text)
        return read_cstruct(text)
    is_xml = found is not None and (found.kind == "esi" or found.root in _ROOTS)
    if is_xml or any("<EtherCATInfo" in line.text for line in text):
        return read_xml(data, shown, out)
    _one_master(text)
    reader = _reader_of(text)
    if reader is not None:
        return reader(text)
    what = "no line of this is known" if found is None else f"this is {found.words}"
    out.add(
        "FSN140",
        Span(shown, 1, 1),
        f"{what}, not output of the `ethercat` tool",
        hint="paste the output of ethercat pdos, cstruct, xml, slaves -v, sii_read -v, config -v "
        "or domains -v",
    )
    return None


def _reader_of(text: Pasted) -> Callable[[Pasted], Description | None] | None:
    for wanted, reader in _READERS:
        if any(wanted.search(line.text) for line in text):
            return reader
    return None


_MASTER = re.compile(r"(?:=== |/\* )Master (\d{1,3}), Slave |Master ?(\d{1,3})$")


def _one_master(text: Pasted) -> None:
    """Keep the lines of the first master: two of them are two buses."""
    first: str | None = None
    current: str | None = None
    kept: list[Line] = []
    others: Line | None = None
    for line in text:
        match = _MASTER.match(line.stripped)
        if match:
            current = match[1] or match[2]
            first = current if first is None else first
        if current == first:
            kept.append(line)
        elif others is None:
            others = line
    if others is None:
        return
    text.out.add(
        "FSN147",
        others.span,
        f"here begins another master; only master {first} is read",
        severity=Severity.INFO,
        hint="give each master's output on its own: ethercat -m N",
    )
    text.lines = tuple(kept)


# -- pdos -----------------------------------------------------------------------------------------


@dataclass(slots=True)
class Building:
    """A SubDevice while its lines come."""

    span: Span
    position: int | None = None
    managers: list[SyncManager] = field(default_factory=list)
    pdos: list[tuple[int, str, Span]] = field(default_factory=list)
    entries: list[Entry] = field(default_factory=list)
    done: list[Pdo] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    control: int = 0
    mailboxes: bool = False
    number: int | None = None
    start: int | None = None
    default_size: int = 0
    direction: Direction = Direction.OUTPUT
    watchdog: Watchdog = Watchdog.DEFAULT
    sizes: dict[int, int] = field(default_factory=dict)

    def end_pdo(self) -> None:
        """Close the PDO whose entries were read."""
        if self.pdos:
            index, _name, span = self.pdos.pop()
            self.done.append(Pdo(span=span, index=index, entries=tuple(self.entries)))
            self.entries = []

    def end_manager(self) -> None:
        """Close the sync manager; mailboxes, which carry no PDOs, are left out."""
        self.end_pdo()
        if self.number is None:
            return
        if self.control & 3 != 2 or self.done:
            self.managers.append(
                SyncManager(
                    span=self.span,
                    index=self.number,
                    direction=self.direction,
                    carries=None,
                    watchdog=self.watchdog,
                    pdos=tuple(self.done),
                    start_byte=self.start,
                )
            )
            if self.default_size:
                self.sizes[self.number] = self.default_size
            bits = sum(p.bits for p in self.done)
            if self.done and (bits + 7) // 8 != self.default_size:
                self.notes.append(
                    f"SM{self.number}: DefaultSize {self.default_size}, its PDOs {bits} bits"
                )
        self.number, self.done = None, []

    def described(self, path: str, *, truncated: bool = False) -> DescribedSubDevice:
        """Return what was built."""
        self.end_manager()
        device = Device(path=path, vendor_id=0, product_code=0, sync_managers=tuple(self.managers))
        return DescribedSubDevice(
            span=self.span,
            position=self.position,
            device=device,
            truncated=truncated,
            notes=(*self.notes, "this text has no identity"),
            facts=TypeFacts(default_bytes=self.sizes),
        )


def _read_pdos(text: Pasted) -> Description:
    subs: list[Building] = []
    for line in text:
        shown = line.stripped
        if match := _HEADER.search(shown):
            if subs:
                subs[-1].end_manager()
            subs.append(Building(line.span, position=int(match[2])))
        elif match := _SM.search(shown):
            if not subs:
                subs.append(Building(line.span))
            _start_manager(subs[-1], match)
        elif subs and subs[-1].number is not None and (match := _PDO.search(shown)):
            sub = subs[-1]
            sub.end_pdo()
            sub.direction = Direction.OUTPUT if match[1] == "R" else Direction.INPUT
            sub.pdos.append((int(match[2], 16), match[3], line.span))
        elif subs and subs[-1].pdos and (match := _ENTRY.search(shown)):
            subs[-1].entries.append(_entry(match, line))
        else:
            text.strange(line, "`ethercat pdos`", _PDOS_STARTS)
            continue
        text.good(line)
    _ends_like_pdos(text, subs)
    made = [sub.described(text.shown, truncated=text.truncated and sub is subs[-1]) for sub in subs]
    return text.described("ethercat-pdos", made)


def _start_manager(sub: Building, match: re.Match[str]) -> None:
    sub.end_manager()
    control = int(match[4], 16)
    sub.control = control
    sub.mailboxes = sub.mailboxes or control & 3 == 2
    sub.number = int(match[1])
    sub.start = int(match[2], 16)
    sub.default_size = int(match[3])
    sub.direction = Direction.OUTPUT if control & 4 else Direction.INPUT
    sub.watchdog = Watchdog.ENABLE if control & 0x40 else Watchdog.DISABLE


def _entry(match: re.Match[str], line: Line) -> Entry:
    index = int(match[1], 16)
    return Entry(
        span=line.span,
        index=index,
        subindex=int(match[2], 16),
        bits=int(match[3]),
        name=match[4] if index else "",
    )


def _ends_like_pdos(text: Pasted, subs: list[Building]) -> None:
    """Report a final PDO without entries, where others have some: it was cut off after its name.

    The same for an enabled sync manager with data by its DefaultSize but without PDOs.
    """
    if not subs or not text.lines:
        return
    sub = subs[-1]
    why = ""
    if sub.pdos and not sub.entries and _has_entries(subs):
        why = "the last PDO has no entries"
    elif sub.number is not None:
        why = _why_cut(sub, sub.number)
    elif not sub.managers:
        why = "nothing follows the header"
    if why:
        text.cut(text.lines[-1], why)


def _why_cut(sub: Building, number: int) -> str:
    """Return what the last sync manager lacks, for certain; a doubt is noted at the SubDevice."""
    if number < _FIRST_PROCESS_SM and sub.control & 2:
        return f"nothing follows the mailbox SM{number}"
    if sub.default_size and not sub.pdos and not sub.done:
        return f"SM{number} has data but no PDOs"
    if number == _FIRST_PROCESS_SM and sub.mailboxes:
        return "a SubDevice with mailboxes has more than SM2"
    bits = sum(e.bits for e in sub.entries) + sum(p.bits for p in sub.done)
    if 8 * sub.default_size > bits:
        sub.notes.append("the text may be cut off: fewer bits than DefaultSize at its end")
    return ""


def _has_entries(subs: list[Building]) -> bool:
    done = (p for s in subs for p in s.done)
    return any(
        p.entries for p in (*done, *(p for s in subs for m in s.managers for p in m.pdos or ()))
    )


# -- slaves ---------------------------------------------------------------------------------------

_SLAVE = re.compile(
    r"^\s*(\d{1,5})\s+(\d{1,5}):(\d{1,5})\s+"
    r"((?:INIT|PREOP|BOOT|SAFEOP|OP|\?\?\?)(?:\+ERROR)?)\s+([+E])\s+(.+)$"
)
_RAW_NAME = re.compile(r"0x([0-9a-f]{8}):0x([0-9a-f]{8})$")
_VALUE = re.compile(r"^\s*([A-Z][A-Za-z ]{1,40}):\s*(.*)$")
_HEX_KEYS = {
    "Vendor Id": "vendor",
    "Product code": "product",
    "Revision number": "revision",
    "Serial number": "serial",
}
_LINE_OF_TEXT = re.compile(
    r"^\s*(\d\*?\s+(MII|EBUS|N/A|\S+)\s+(up|down)|Port\s+Type|Bootstrap|Standard|"
    r"Supported protocols|Enable |Image name|Group|CoE details|Flags|Current consumption|"
    r"FMMU|Distributed|DC system|\d+\*? )"
)


_VERBOSE_STARTS = ("=== Master", *_HEX_KEYS, "Alias", "State", "Device", "Order number")


def _digits(line: Line) -> tuple[str, ...]:
    """A line of the list begins with the position; a truncated one has only that."""
    match = re.match(r"\d{1,5}(\s+\d{0,5}:?|$)", line.stripped)
    return (match[0],) if match else ()


def _read_slaves(text: Pasted) -> Description:
    rows = []
    for line in text:
        match = _SLAVE.match(line.text)
        if match is None:
            if not re.match(r"\s*(Master\d+|xxx LINK FAILURE xxx)", line.text):
                text.strange(line, "`ethercat slaves`", _digits(line))
            continue
        raw = _RAW_NAME.search(match[6])
        identity = (int(raw[1], 16), int(raw[2], 16)) if raw else (0, 0)
        device = Device(path=text.shown, vendor_id=identity[0], product_code=identity[1])
        order = "" if raw else match[6].split(" ")[0].rstrip(",")
        rows.append(
            DescribedSubDevice(
                span=line.span,
                name=match[6].strip(),
                order=order,
                position=int(match[1]),
                alias=0 if match[2] == "65535" else int(match[2]),
                device=device,
                notes=() if raw else ("this text has no identity; paste `slaves -v`",),
            )
        )
        text.good(line)
    return text.described("ethercat-slaves", rows)


def _read_slaves_verbose(text: Pasted) -> Description:
    sections: list[tuple[Line, int | None, dict[str, str]]] = []
    for line in text:
        if match := _HEADER.search(line.stripped):
            sections.append((line, int(match[2]), {}))
        elif match := _VALUE.match(line.text):
            if not sections:
                sections.append((line, None, {}))
            sections[-1][2].setdefault(match[1].strip(), match[2].strip())
        elif sections and _LINE_OF_TEXT.match(line.text):
            pass
        else:
            text.strange(line, "`ethercat slaves -v`", _VERBOSE_STARTS)
            continue
        text.good(line)
    rows = []
    for number, (line, position, values) in enumerate(sections):
        final = number == len(sections) - 1
        missing = [key for key in _HEX_KEYS if not re.match(r"0x[0-9a-f]{8}$", values.get(key, ""))]
        if missing and final:
            text.cut(text.lines[-1], f"{missing[0]} of the last SubDevice is missing")
        elif missing:
            text.out.add(
                "FSN147",
                line.span,
                f"this SubDevice has no {missing[0]}",
                hint="paste the output of `ethercat slaves -v` again, unchanged",
            )
        rows.append(_identity(text, line, position, values, truncated=final and text.truncated))
    return text.described("ethercat-slaves", rows)


def _identity(
    text: Pasted, line: Line, position: int | None, values: dict[str, str], *, truncated: bool
) -> DescribedSubDevice:
    numbers = {
        name: int(values[key], 16) if re.match(r"0x[0-9a-f]{8}$", values.get(key, "")) else None
        for key, name in _HEX_KEYS.items()
    }
    alias = values.get("Alias", "")
    notes = []
    if values.get("Enable notLRW") == "yes":
        notes.append("it cannot take part in an LRW")
    if values.get("Enable PDO Assign") == "no" and values.get("Enable PDO Configuration") == "no":
        notes.append("its PDO mapping is fixed")
    device = Device(
        path=text.shown, vendor_id=numbers["vendor"] or 0, product_code=numbers["product"] or 0
    )
    return DescribedSubDevice(
        span=line.span,
        name=values.get("Device name", ""),
        order=values.get("Order number", ""),
        position=position,
        alias=int(alias) if alias.isdigit() and len(alias) < 6 and alias != "65535" else 0,
        device=device,
        revision=numbers["revision"],
        serial=numbers["serial"],
        truncated=truncated,
        notes=tuple(notes),
    )


_READERS = (
    (re.compile(r"Domain\d+: LogBaseAddr"), read_domains),
    (re.compile(r"\bSII Area:$"), read_sii_text),
    (re.compile(r"^\s*Watchdog divider:|SM\d+, Dir: "), read_config),
    (re.compile(r"SM\d+: PhysAddr"), _read_pdos),
    (re.compile(r"^\s*(Vendor Id|Identity):"), _read_slaves_verbose),
    (_SLAVE, _read_slaves),
)
