"""Configuration of linuxcnc-ethercat: SubDevices, and the partners of each logic.

``<modParam name="fsoeSlaveIdx" value="6"/>`` at a logic names a SubDevice of the same master by its
``idx``; the order of these lines is the order of the connections in the logic.
"""

from __future__ import annotations

import re
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Span
from fsoe_net.diag.words import counted, listed
from fsoe_net.formats.recognise import is_format
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import Source, source_bytes
from fsoe_net.formats.shared.xml_text import readable_xml
from fsoe_net.formats.shared.xml_tree import Element, parse_xml
from fsoe_net.model.bus import SDO_BYTES, Device, Direction, Entry, Pdo, Sdo, SyncManager
from fsoe_net.model.description import DescribedConnection, DescribedSubDevice, Description

_PARAMETER = "fsoeSlaveIdx"
_DIRECTIONS = {"out": Direction.OUTPUT, "in": Direction.INPUT}
_HEX = re.compile(r"(?:0[xX])?0{0,40}([0-9a-fA-F]{1,8})\Z")
_DECIMAL = re.compile(r"0{0,40}([0-9]{1,10})\Z")


def load_lcec(
    source: Source, out: Collector, *, name: str = "<xml>", master: str = ""
) -> Description | None:
    """Read a configuration of linuxcnc-ethercat.

    Args:
        source: Path, or the bytes.
        out: Takes findings, located.
        name: Name shown when ``source`` is bytes.
        master: ``idx`` or name of the master to read; the first one by default.

    Returns:
        SubDevices and connections. Only ``generic`` types have PDOs in the file; the others are
        known to the driver by their type.
    """
    data, shown = source_bytes(source, out, name)
    if data is None or not is_format(data, "lcec", shown, out):
        return None
    root = parse_xml(
        readable_xml(data, shown, out), shown, out, what="a configuration of linuxcnc-ethercat"
    )
    if root is None:
        return None
    masters = root.all("master")
    if root.name != "masters" or not masters:
        message, hint = "no <master> in <masters>", "give a configuration of linuxcnc-ethercat"
        out.add("FSN140", root.span, message, hint=hint)
        return None
    names = [_names_of(e, n, out) for n, e in enumerate(masters)]
    known = listed([" or ".join(row) for row in names])
    # A missing name is the empty text, which matches the first master.
    chosen = next((n for n, row in enumerate(names) if master in (*row, "")), None)
    if chosen is None:
        message = f"this file has no master {master!r}"
        out.add("FSN140", root.span, message, hint=f"choose one with --master: {known}")
        return None
    if len(masters) > 1 and not master:
        out.add(
            "FSN147",
            masters[1].span,
            f"this file has {counted(len(masters), 'master')} ({known}); only the first is read",
            hint=f"--master {names[1][0]} reads another one",
        )
    return _Master(masters[chosen], shown, out).description()


def _names_of(element: Element, number: int, out: Collector) -> list[str]:
    """Return the ``idx`` of a master, and its name if it has one."""
    index = _number(element, "idx", out, default=number)
    name = element.attributes.get("name", "").strip()
    return [str(index), *([name] if name else [])]


def _number(
    element: Element,
    key: str,
    out: Collector,
    *,
    hexadecimal: bool = False,
    default: int | None = None,
) -> int | None:
    """Return an attribute as the driver reads it: ids are hexadecimal without a prefix."""
    text = element.attributes.get(key)
    if text is None:
        return default
    match = (_HEX if hexadecimal else _DECIMAL).match(text.strip())
    if match is None:
        kind = "hexadecimal, without a mark: 1a00" if hexadecimal else "decimal"
        out.add(
            "FSN141",
            element.span,
            f"{key}={text[:40]!r} of <{element.name}> is not a number",
            hint=f"write it {kind}",
        )
        return None
    return int(match[1], 16 if hexadecimal else 10)


@dataclass(slots=True)
class _Logic:
    number: int
    wanted: list[tuple[int, Span]] = field(default_factory=list)


class _Master:
    """Reads one ``<master>``."""

    def __init__(self, element: Element, shown: str, out: Collector) -> None:
        self._element = element
        self._shown = shown
        self._out = out
        self._units: list[str] = []  # sync unit of each SubDevice

    def description(self) -> Description:
        """Return the content of the master."""
        subs: list[DescribedSubDevice] = []
        logics: list[_Logic] = []
        for number, element in enumerate(self._element.all("slave")):
            subs.append(self._slave(element, number))
            self._units.append(element.attributes.get("syncUnit", "").strip() or "default")
            wanted = [
                (index, p.span)
                for p in element.all("modParam")
                if p.attributes.get("name") == _PARAMETER
                and (index := _number(p, "value", self._out)) is not None
            ]
            if wanted:
                logics.append(_Logic(number, wanted))
        # The file states nanoseconds.
        period = _number(self._element, "appTimePeriod", self._out)
        return Description(
            span=self._element.span,
            format="lcec",
            path=self._shown,
            subdevices=tuple(subs),
            connections=tuple(self._connections(subs, logics)),
            cycle_us=None if period is None else period // 1000,
        )

    def _connections(
        self, subs: list[DescribedSubDevice], logics: list[_Logic]
    ) -> list[DescribedConnection]:
        by_index: dict[int | None, int] = {}
        for number, sub in enumerate(subs):
            if sub.position in by_index:
                self._wrong(sub.span, f"two SubDevices with idx {sub.position}", "correct one")
            by_index.setdefault(sub.position, number)
        taken: dict[int, Span] = {}
        connections = []
        for logic in logics:
            for slot, (index, span) in enumerate(logic.wanted):
                target = by_index.get(index)
                if target is None or target == logic.number:
                    what = (
                        "the logic itself" if target is not None else "no SubDevice of this master"
                    )
                    hint = f"give the idx of the SubDevice that slot {slot} talks to"
                    self._wrong(span, f"{_PARAMETER} {index} is {what}", hint)
                    target = None
                elif index in taken:
                    self._wrong(
                        span,
                        f"{_PARAMETER} {index} is given twice",
                        "a SubDevice has one connection",
                        (Related(span=taken[index], message="the first one"),),
                    )
                if target is not None:
                    self._check_unit(subs, logic.number, target, span)
                taken.setdefault(index, span)
                connections.append(
                    DescribedConnection(
                        span=span,
                        name=f"{subs[logic.number].name}-{slot}",
                        main=logic.number,
                        sub=target,
                        slot=slot,
                    )
                )
        return connections

    def _check_unit(self, subs: list[DescribedSubDevice], main: int, sub: int, span: Span) -> None:
        """FSN467: the copy uses a single process image, but each sync unit has its own."""
        units = self._units
        if units[main] == units[sub]:
            return
        self._out.add(
            "FSN467",
            span,
            f"{subs[sub].name} is in sync unit {units[sub]!r}, its logic {subs[main].name} in "
            f"{units[main]!r}; frames are copied inside one sync unit only",
            hint=f'write syncUnit="{units[main]}" at {subs[sub].name}, or leave it out at both',
            related=(Related(span=subs[sub].span, message=f"{subs[sub].name} is here"),),
        )

    def _wrong(
        self, span: Span, message: str, hint: str, related: tuple[Related, ...] = ()
    ) -> None:
        self._out.add("FSN148", span, message, hint=hint, related=related)

    def _slave(self, element: Element, number: int) -> DescribedSubDevice:
        kind = element.attributes.get("type", "").strip()
        position = _number(element, "idx", self._out, default=number)
        dc = element.first("dcConf")
        managers = tuple(
            sm for e in element.all("syncManager") if (sm := self._manager(e)) is not None
        )
        notes = []
        if kind != "generic":
            notes.append("its identity and PDOs are in the driver, by its type")
        if modules := element.all("subModule"):
            names = [m.attributes.get("name") or m.attributes.get("ident", "") for m in modules]
            self._out.add(
                "FSN147",
                modules[0].span,
                f"{counted(len(modules), 'subModule')} not read: {listed(names, 6)}; their process "
                "data are in the driver",
                hint="an ESI, ENI or scan has the process data of this SubDevice",
            )
        activate = (
            None if dc is None else _number(dc, "assignActivate", self._out, hexadecimal=True)
        )
        device = Device(
            span=element.span,
            path=self._shown,
            vendor_id=_number(element, "vid", self._out, hexadecimal=True) or 0,
            product_code=_number(element, "pid", self._out, hexadecimal=True) or 0,
            assign_activate=(activate or 0) & 0xFFFF,
            sync_managers=managers,
            sdos=self._sdos(element, notes),
        )
        return DescribedSubDevice(
            span=element.span,
            name=element.attributes.get("name", "").strip() or str(position),
            order="" if kind == "generic" else kind,
            position=position,
            device=device,
            notes=tuple(notes),
        )

    def _manager(self, element: Element) -> SyncManager | None:
        index = _number(element, "idx", self._out)
        direction = _DIRECTIONS.get(element.attributes.get("dir", ""))
        pdos = [self._pdo(p) for p in element.all("pdo")]
        if index is None or direction is None:
            self._out.add(
                "FSN141",
                element.span,
                "sync manager without idx or dir",
                hint='write idx="2" dir="out" or dir="in"',
            )
            return None
        # SM0 and SM1 without PDOs are the mailbox.
        if index < 2 and not pdos:
            return None
        return SyncManager(
            span=element.span,
            index=index,
            direction=direction,
            pdos=tuple(p for p in pdos if p is not None),
        )

    def _pdo(self, element: Element) -> Pdo | None:
        index = _number(element, "idx", self._out, hexadecimal=True)
        if index is None:
            if "idx" not in element.attributes:
                self._out.add("FSN141", element.span, "PDO without idx", hint="add idx")
            return None
        entries = []
        for child in element.all("pdoEntry"):
            entry_index = _number(child, "idx", self._out, hexadecimal=True)
            bits = _number(child, "bitLen", self._out)
            if entry_index is None or bits is None:
                if not {"idx", "bitLen"} <= child.attributes.keys():
                    what = "PDO entry without idx or bitLen"
                    self._out.add("FSN141", child.span, what, hint="add both")
                continue
            entries.append(
                Entry(
                    span=child.span,
                    index=entry_index & 0xFFFF,
                    subindex=(_number(child, "subIdx", self._out, hexadecimal=True) or 0) & 0xFF,
                    bits=bits,
                    type_name=child.attributes.get("halType", ""),
                    name=child.attributes.get("halPin", ""),
                )
            )
        return Pdo(span=element.span, index=index & 0xFFFF, entries=tuple(entries))

    def _sdos(self, element: Element, notes: list[str]) -> tuple[Sdo, ...]:
        sdos = []
        left_out = 0
        for config in element.all("sdoConfig"):
            data = "".join(e.attributes.get("data", "") for e in config.all("sdoDataRaw"))
            index = _number(config, "idx", self._out, hexadecimal=True)
            try:
                value = bytes.fromhex(data)
            except ValueError:
                value = b""
            complete = config.attributes.get("subIdx") == "complete"
            if complete or index is None or len(value) not in SDO_BYTES:
                left_out += 1
                continue
            sub = _number(config, "subIdx", self._out, hexadecimal=True) or 0
            sdos.append(Sdo.of(index & 0xFFFF, sub & 0xFF, value, config.span))
        if left_out:
            what = counted(left_out, "start-up SDO")
            notes.append(f"{what} left out: not plain bytes of 1, 2, 4 or 8")
        return tuple(sdos)
