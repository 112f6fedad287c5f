"""``ethercat pdos``, ``config -v`` and ``domains -v``: the layout of sync managers.

Indentation is ignored, because it is lost when text is pasted.
"""

from __future__ import annotations

import re
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.terminal_text import Line, Pasted, PrintedManager
from fsoe_net.model.bus import SDO_BYTES, Device, Direction, Entry, Sdo, Watchdog
from fsoe_net.model.description import DescribedSubDevice, Description, TypeFacts

HEADER = re.compile(r"=== Master (\d{1,3}), Slave (\d{1,5}) ===$")

# -- pdos -----------------------------------------------------------------------------------------

_PDOS_SM = re.compile(
    r"SM(\d{1,2}): PhysAddr 0x([0-9a-f]{4}), DefaultSize +(\d{1,5}), "
    r"ControlRegister 0x([0-9a-f]{2}), Enable (\d{1,3})$"
)
_PDOS_PDO = re.compile(r'([RT])xPDO 0x([0-9a-f]{4}) "(.*)"$')
_PDOS_ENTRY = re.compile(r'PDO entry 0x([0-9a-f]{4}):([0-9a-f]{2}), +(\d{1,3}) bit, "(.*)"$')
_PDOS_STARTS = ("=== Master", "SM", "RxPDO 0x", "TxPDO 0x", "PDO entry 0x")
_FIRST_PROCESS_SM = 2


@dataclass(slots=True)
class _Manager(PrintedManager):
    """A sync manager of ``ethercat pdos``."""

    control: int = 0
    default_size: int = 0

    @property
    def is_mailbox(self) -> bool:
        return self.control & 3 == 2


@dataclass(slots=True)
class _SubDevice:
    """A SubDevice of ``ethercat pdos`` while its lines are read."""

    span: Span
    position: int | None = None
    managers: list[_Manager] = field(default_factory=list)
    doubt: str = ""  # about its last sync manager

    def described(self, path: str, *, truncated: bool) -> DescribedSubDevice:
        """Return the description; mailboxes, which carry no PDOs, are omitted."""
        used = [m for m in self.managers if m.pdos or not m.is_mailbox]
        notes = []
        for manager in used:
            if self.doubt and manager is self.managers[-1]:
                notes.append(self.doubt)
            if manager.pdos and (manager.bits + 7) // 8 != manager.default_size:
                notes.append(
                    f"SM{manager.index}: DefaultSize {manager.default_size}, its PDOs "
                    f"{manager.bits} bits"
                )
        managers = tuple(m.built() for m in used)
        return DescribedSubDevice(
            span=self.span,
            position=self.position,
            device=Device(path=path, vendor_id=0, product_code=0, sync_managers=managers),
            truncated=truncated,
            notes=(*notes, "this text has no identity"),
            facts=TypeFacts(
                default_bytes={m.index: m.default_size for m in used if m.default_size}
            ),
        )


def read_pdos(text: Pasted) -> Description:
    """Read ``ethercat pdos``: the sync managers of each SubDevice with their PDOs."""
    subs: list[_SubDevice] = []
    text.read(lambda line: _take_pdos(subs, line), "`ethercat pdos`", _PDOS_STARTS)
    if subs and (why := _why_cut(subs)):
        text.cut(text.lines[-1], why)
    rows = [sub.described(text.shown, truncated=text.truncated and sub is subs[-1]) for sub in subs]
    return text.described("ethercat-pdos", rows)


def _take_pdos(subs: list[_SubDevice], line: Line) -> bool:
    shown = line.stripped
    if match := HEADER.search(shown):
        subs.append(_SubDevice(line.span, position=int(match[2])))
        return True
    if match := _PDOS_SM.search(shown):
        if not subs:
            subs.append(_SubDevice(line.span))
        subs[-1].managers.append(_manager(match, subs[-1].span))
        return True
    manager = subs[-1].managers[-1] if subs and subs[-1].managers else None
    if manager is None:
        return False
    if match := _PDOS_PDO.search(shown):
        manager.direction = Direction.OUTPUT if match[1] == "R" else Direction.INPUT
        manager.pdos.append((int(match[2], 16), line.span, []))
        return True
    match = _PDOS_ENTRY.search(shown)
    return match is not None and manager.add(_entry(match, line, match[4]))


def _manager(match: re.Match[str], span: Span) -> _Manager:
    control = int(match[4], 16)
    return _Manager(
        span=span,
        index=int(match[1]),
        direction=Direction.OUTPUT if control & 4 else Direction.INPUT,
        watchdog=Watchdog.of(control),
        start_byte=int(match[2], 16),
        control=control,
        default_size=int(match[3]),
    )


def _entry(match: re.Match[str], line: Line, name: str = "") -> Entry:
    index = int(match[1], 16)
    return Entry(
        span=line.span,
        index=index,
        subindex=int(match[2], 16),
        bits=int(match[3]),
        name=name if index else "",
    )


def _why_cut(subs: list[_SubDevice]) -> str:
    """Return what is certainly missing at the end; a doubt is noted at the SubDevice.

    A final PDO without entries was truncated after its name if other PDOs have entries.
    """
    sub = subs[-1]
    if not sub.managers:
        return "nothing follows the header"
    last = sub.managers[-1]
    if last.pdos and not last.pdos[-1][2] and _has_entries(subs):
        return "the last PDO has no entries"
    if last.index < _FIRST_PROCESS_SM and last.control & 2:
        return f"nothing follows the mailbox SM{last.index}"
    if last.default_size and not last.pdos:
        return f"SM{last.index} has data but no PDOs"
    if last.index == _FIRST_PROCESS_SM and any(m.is_mailbox for m in sub.managers):
        return "a SubDevice with mailboxes has more than SM2"
    if 8 * last.default_size > last.bits:
        sub.doubt = "the text may be cut off: fewer bits than DefaultSize at its end"
    return ""


def _has_entries(subs: list[_SubDevice]) -> bool:
    return any(pdo[2] for s in subs for m in s.managers for pdo in m.pdos)


# -- config ---------------------------------------------------------------------------------------

_DIRECTIONS = {"Input": Direction.INPUT, "Output": Direction.OUTPUT}
_WATCHDOGS = {
    "Default": Watchdog.DEFAULT,
    "Enable": Watchdog.ENABLE,
    "Disable": Watchdog.DISABLE,
    "???": Watchdog.DEFAULT,
}
_ALIAS = re.compile(r"Alias: (\d{1,5})$")
_POSITION = re.compile(r"Position: (\d{1,5})$")
_IDENTITY = re.compile(r"(Vendor Id|Product code): 0x([0-9a-f]{8})$")
_ATTACHED = re.compile(r"Attached slave: (?:(\d{1,5}) \(\S+\)|none)$")
_SM = re.compile(r"SM(\d{1,2}), Dir: (Input|Output), Watchdog: (Default|Enable|Disable|\?\?\?)$")
_PDO = re.compile(r"PDO 0x([0-9a-f]{4})$")
_ENTRY = re.compile(r"PDO entry 0x([0-9a-f]{4}):([0-9a-f]{2}), +(\d{1,3}) bit$")
_SDO = re.compile(r"0x([0-9a-f]{4})(?::([0-9a-f]{2})| C), (\d{1,9}) byte$")
_BYTES = re.compile(r"[0-9a-f]{2}( [0-9a-f]{2})*$")
_ACTIVATE = re.compile(r"AssignActivate: 0x([0-9a-f]{4})$")
_OTHER = re.compile(
    r"(Watchdog (divider|intervals): (\(Default\)|\d+)|(SDO|IDN|DC) configuration:|None\.?|"
    r"Cycle \[ns\].*|SYNC\d +\d+ +-?\d+|Drive \d+, .*|Master\d+|\.\.\.)$"
)
_STARTS = (
    *("Alias:", "Position:", "Vendor Id:", "Product code:", "Attached slave:", "Watchdog ", "SM"),
    *("PDO 0x", "PDO entry 0x", "SDO configuration:", "IDN configuration:", "AssignActivate:"),
)


@dataclass(slots=True)
class _Config:
    span: Span
    alias: int = 0
    position: int = 0
    ring: int | None = None
    identity: dict[str, int] = field(default_factory=dict)
    managers: list[PrintedManager] = field(default_factory=list)
    sdos: list[Sdo] = field(default_factory=list)
    open_sdo: tuple[re.Match[str], Span] | None = None
    data: list[str] = field(default_factory=list)
    activate: int = 0
    ended: bool = False
    idn: bool = False
    notes: list[str] = field(default_factory=list)


def read_config(text: Pasted) -> Description:
    """Read ``ethercat config -v``: the layout a running master uses."""
    configs: list[_Config] = []
    text.read(lambda line: _take(configs, line), "`ethercat config -v`", _STARTS)
    _end_sdo(configs)
    if configs and not configs[-1].ended:
        text.cut(text.lines[-1], "its last configuration has no `IDN configuration:`")
    elif configs and configs[-1].open_sdo is not None:
        text.cut(text.lines[-1], "the data of its last SDO are missing")
    rows = [_described(c, text, last=c is configs[-1]) for c in configs]
    return text.described("ethercat-config", rows)


def _take(configs: list[_Config], line: Line) -> bool:
    """Process one line; false if it is unknown."""
    shown = line.stripped
    if match := _ALIAS.match(shown):
        _end_sdo(configs)
        configs.append(_Config(line.span, alias=int(match[1])))
        return True
    if not configs:
        return False
    managers = configs[-1].managers
    if match := _ENTRY.match(shown):
        return bool(managers) and managers[-1].add(_entry(match, line))
    if match := _SM.match(shown):
        managers.append(_config_manager(match[1], match[2], line.span, _WATCHDOGS[match[3]]))
    elif match := _PDO.match(shown):
        if managers:
            managers[-1].pdos.append((int(match[1], 16), line.span, []))
    else:
        return _take_fact(configs[-1], shown, line)
    return True


def _config_manager(
    index: str, direction: str, span: Span, watchdog: Watchdog = Watchdog.DEFAULT
) -> PrintedManager:
    return PrintedManager(span, int(index), _DIRECTIONS[direction], watchdog)


def _take_fact(config: _Config, shown: str, line: Line) -> bool:
    if match := _POSITION.match(shown):
        config.position = int(match[1])
    elif match := _IDENTITY.match(shown):
        config.identity[match[1]] = int(match[2], 16)
    elif match := _ATTACHED.match(shown):
        config.ring = None if match[1] is None else int(match[1])
    elif match := _ACTIVATE.match(shown):
        config.activate = int(match[1], 16)
    elif match := _SDO.match(shown):
        _end_sdo([config])
        config.open_sdo, config.data = (match, line.span), []
    elif _BYTES.match(shown):
        # Bytes after `IDN configuration:` belong to SoE.
        config.data += [] if config.idn else shown.split()
    elif _OTHER.match(shown):
        if shown.startswith("IDN"):
            _end_sdo([config])
            config.ended = config.idn = True
    else:
        return False
    return True


def _end_sdo(configs: list[_Config]) -> None:
    """Complete an SDO if all its bytes were read."""
    if not configs or configs[-1].open_sdo is None:
        return
    config = configs[-1]
    match, span = configs[-1].open_sdo
    size = int(match[3])
    # IgH prints at most 1024 bytes (EC_MAX_SDO_DATA_SIZE).
    if len(config.data) < min(size, 1024):
        return
    config.open_sdo = None
    if match[2] is None or size not in SDO_BYTES:
        config.notes.append(f"start-up SDO 0x{match[1]} of {size} bytes is left out")
        return
    data = bytes.fromhex("".join(config.data[:size]))
    config.sdos.append(Sdo.of(int(match[1], 16), int(match[2], 16), data, span))


def _described(config: _Config, text: Pasted, *, last: bool) -> DescribedSubDevice:
    notes = list(config.notes)
    if config.ring is None:
        notes.append("no SubDevice was attached to this configuration")
    device = Device(
        path=text.shown,
        vendor_id=config.identity.get("Vendor Id", 0),
        product_code=config.identity.get("Product code", 0),
        assign_activate=config.activate,
        sync_managers=tuple(m.built() for m in config.managers),
        sdos=tuple(config.sdos),
    )
    ring = config.ring
    return DescribedSubDevice(
        span=config.span,
        # Without an alias, the position of a configuration is the position in the ring.
        position=config.position if ring is None and not config.alias else ring,
        alias=config.alias,
        device=device,
        truncated=last and text.truncated,
        notes=tuple(notes),
    )


# -- domains --------------------------------------------------------------------------------------

_DOMAIN = re.compile(
    r"Domain(\d{1,3}): LogBaseAddr 0x([0-9a-f]{8}), Size +(\d{1,9}), WorkingCounter \d+/(\d+)"
)
_FMMU = re.compile(
    r"SlaveConfig (\d{1,5}):(\d{1,5}), SM(\d{1,2}) \( *(Input|Output)\), "
    r"LogAddr 0x([0-9a-f]{8}), Size (\d{1,5})$"
)
_DOMAIN_STARTS = ("Domain", "SlaveConfig ")


@dataclass(slots=True)
class _Fmmu:
    match: re.Match[str]
    span: Span
    got: int = 0

    @property
    def size(self) -> int:
        return int(self.match[6])


def read_domains(text: Pasted) -> Description:
    """Read ``ethercat domains -v``: sync managers with their sizes, no entries."""
    fmmus: list[_Fmmu] = []
    domain: list[tuple[int, int]] = []  # start and size of each

    def take(line: Line) -> bool:
        shown = line.stripped
        if match := _DOMAIN.match(shown):
            domain.append((int(match[2], 16), int(match[3])))
        elif match := _FMMU.match(shown):
            fmmus.append(_Fmmu(match, line.span))
        elif fmmus and _BYTES.match(shown):
            fmmus[-1].got += len(shown.split())
        else:
            return False
        return True

    text.read(take, "`ethercat domains -v`", _DOMAIN_STARTS)
    base, size = domain[-1] if domain else (0, 0)
    if fmmus and fmmus[-1].got < fmmus[-1].size:
        got, want = fmmus[-1].got, fmmus[-1].size
        text.cut(text.lines[-1], f"{got} of {want} bytes of its last sync manager are there")
    elif size:
        ends = [int(f.match[5], 16) + f.size for f in fmmus]
        if not fmmus or max(ends) < base + size:
            text.cut(text.lines[-1], f"the sync managers do not fill the {size} bytes")
    return text.described("ethercat-domains", _grouped(fmmus, text))


def _grouped(fmmus: list[_Fmmu], text: Pasted) -> list[DescribedSubDevice]:
    groups: dict[tuple[int, int], list[_Fmmu]] = {}
    for fmmu in fmmus:
        key = (int(fmmu.match[1]), int(fmmu.match[2]))
        groups.setdefault(key, []).append(fmmu)
    rows = []
    for (alias, position), members in groups.items():
        managers = tuple(_opaque(f).built() for f in members)
        rows.append(
            DescribedSubDevice(
                span=members[0].span,
                # With an alias, it counts from the SubDevice that has the alias.
                position=position if not alias else None,
                alias=alias,
                device=Device(path=text.shown, vendor_id=0, product_code=0, sync_managers=managers),
                truncated=text.truncated and fmmus[-1] in members,
                notes=("this text has sizes, but no identity and no entries",),
            )
        )
    return rows


def _opaque(fmmu: _Fmmu) -> PrintedManager:
    """Return bytes with unknown content as a PDO of padding."""
    manager = _config_manager(fmmu.match[3], fmmu.match[4], fmmu.span)
    padding = Entry(span=fmmu.span, index=0, subindex=0, bits=8 * fmmu.size)
    manager.pdos.append((0, fmmu.span, [padding] if fmmu.size else []))
    return manager
