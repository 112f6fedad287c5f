"""``ethercat config -v`` and ``ethercat domains -v``: configuration of a running master."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.terminal_text import Line, Pasted
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, Sdo, SyncManager, Watchdog
from fsoe_net.model.description import DescribedSubDevice, Description

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
_SDO_BYTES = (1, 2, 4, 8)


@dataclass(slots=True)
class _Config:
    span: Span
    alias: int = 0
    position: int = 0
    ring: int | None = None
    identity: dict[str, int] = field(default_factory=dict)
    managers: list[tuple[re.Match[str], Span, list[tuple[int, Span, list[Entry]]]]] = field(
        default_factory=list
    )
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
    for line in text:
        shown = line.stripped
        if match := _ALIAS.match(shown):
            _end_sdo(configs)
            configs.append(_Config(line.span, alias=int(match[1])))
        elif not configs or not _take(configs[-1], shown, line):
            text.strange(line, "`ethercat config -v`", _STARTS)
            continue
        text.good(line)
    _end_sdo(configs)
    if configs and not configs[-1].ended:
        text.cut(text.lines[-1], "its last configuration has no `IDN configuration:`")
    elif configs and configs[-1].open_sdo is not None:
        text.cut(text.lines[-1], "the data of its last SDO are missing")
    rows = [_described(c, text, last=c is configs[-1]) for c in configs]
    return text.described("ethercat-config", rows)


def _take(config: _Config, shown: str, line: Line) -> bool:
    """Take one line; false when it is not known."""
    if match := _ENTRY.match(shown):
        return _take_entry(config, match, line)
    if match := _SM.match(shown):
        config.managers.append((match, line.span, []))
    elif match := _PDO.match(shown):
        if config.managers:
            config.managers[-1][2].append((int(match[1], 16), line.span, []))
    else:
        return _take_fact(config, shown, line)
    return True


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
        config.data += [] if config.idn else shown.split()
    elif _OTHER.match(shown):
        if shown.startswith("IDN"):
            _end_sdo([config])
            config.ended = config.idn = True
    else:
        return False
    return True


def _take_entry(config: _Config, match: re.Match[str], line: Line) -> bool:
    if not config.managers or not config.managers[-1][2]:
        return False
    entry = Entry(
        span=line.span,
        index=int(match[1], 16),
        subindex=int(match[2], 16),
        bits=int(match[3]),
    )
    config.managers[-1][2][-1][2].append(entry)
    return True


def _end_sdo(configs: list[_Config]) -> None:
    """Close an SDO when all its bytes are there."""
    if not configs or configs[-1].open_sdo is None:
        return
    config = configs[-1]
    match, span = configs[-1].open_sdo
    size = int(match[3])
    if len(config.data) < min(size, 1024):
        return
    config.open_sdo = None
    if match[2] is None or size not in _SDO_BYTES:
        config.notes.append(f"start-up SDO 0x{match[1]} of {size} bytes is left out")
        return
    value = int.from_bytes(bytes.fromhex("".join(config.data[:size])), "little")
    config.sdos.append(
        Sdo(
            span=span,
            index=int(match[1], 16),
            subindex=int(match[2], 16),
            size_bytes=size,
            value=value,
        )
    )


def _described(config: _Config, text: Pasted, *, last: bool) -> DescribedSubDevice:
    managers = tuple(
        SyncManager(
            span=span,
            index=int(match[1]),
            direction=_DIRECTIONS[match[2]],
            carries=None,
            watchdog=_WATCHDOGS[match[3]],
            pdos=tuple(
                Pdo(span=place, index=index, entries=tuple(entries))
                for index, place, entries in pdos
            ),
        )
        for match, span, pdos in config.managers
    )
    notes = list(config.notes)
    if config.ring is None:
        notes.append("no SubDevice was attached to this configuration")
    device = Device(
        path=text.shown,
        vendor_id=config.identity.get("Vendor Id", 0),
        product_code=config.identity.get("Product code", 0),
        assign_activate=config.activate,
        sync_managers=managers,
        sdos=tuple(config.sdos),
    )
    ring = config.ring
    return DescribedSubDevice(
        span=config.span,
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
    base, size = 0, None
    for line in text:
        shown = line.stripped
        if match := _DOMAIN.match(shown):
            base, size = int(match[2], 16), int(match[3])
        elif match := _FMMU.match(shown):
            fmmus.append(_Fmmu(match, line.span))
        elif fmmus and _BYTES.match(shown):
            fmmus[-1].got += len(shown.split())
        else:
            text.strange(line, "`ethercat domains -v`", _DOMAIN_STARTS)
            continue
        text.good(line)
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
        managers = tuple(
            SyncManager(
                span=f.span,
                index=int(f.match[3]),
                direction=_DIRECTIONS[f.match[4]],
                carries=None,
                pdos=(_opaque(f),),
            )
            for f in members
        )
        rows.append(
            DescribedSubDevice(
                span=members[0].span,
                position=position if not alias else None,
                alias=alias,
                device=Device(path=text.shown, vendor_id=0, product_code=0, sync_managers=managers),
                truncated=text.truncated and fmmus[-1] in members,
                notes=("this text has sizes, but no identity and no entries",),
            )
        )
    return rows


def _opaque(fmmu: _Fmmu) -> Pdo:
    """Bytes of which nothing but their number is known: a PDO of padding."""
    padding = Entry(span=fmmu.span, index=0, subindex=0, bits=8 * fmmu.size)
    return Pdo(span=fmmu.span, index=0, entries=(padding,) if fmmu.size else ())
