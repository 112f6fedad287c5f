"""ESI data for starting a device: ports, mailbox, sync managers, clock."""

from __future__ import annotations

from collections.abc import Iterable

from fsoe_net.formats.esi.parts import EsiPdo, flag
from fsoe_net.formats.shared.source import esi_number
from fsoe_net.formats.shared.xml_tree import Element
from fsoe_net.model.description import ClockFacts, MailboxFacts, StartFacts

_MOST_SMS = 16  # as an ENI has them
_PROTOCOLS = ("AoE", "EoE", "CoE", "FoE", "SoE", "VoE")
_PORTS = frozenset("YKBH ")


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
        maps=frozenset(p.pdo.index for p in pdos if maps and not p.fixed),
    )


def _number(element: Element, name: str, high: int) -> int | None:
    value = esi_number(element.attributes.get(name, ""))
    return value if value is not None and 0 <= value <= high else None


def _numbers(managers: list[Element], name: str, high: int) -> dict[int, int]:
    rows = {n: _number(sm, name, high) for n, sm in enumerate(managers)}
    return {n: value for n, value in rows.items() if value is not None}


def _mailbox(mailbox: Element, managers: list[Element]) -> MailboxFacts | None:
    windows: dict[str, tuple[int, int]] = {}
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
    """Return the times of the first clock mode, which is the one that is taken."""
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
