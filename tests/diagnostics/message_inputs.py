"""Inputs of messages that no edit of the clean files reaches: a bus, and descriptions by others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from compare.robot import (
    COUPLER,
    at,
    bus,
    changed,
    fact,
    found,
    more_entries,
    ours,
    out_pdo,
    pdos,
    product,
    project,
    slots,
    types,
)
from compare.scan_changes import CASES, ROBOT, renumbered, scan_findings
from scans import COUPLER as SCANNED_COUPLER
from scans import scan_of, subdevice

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.model.bus import Pdo
from fsoe_net.model.description import DescribedConnection, Description, TypeFacts


def scanned(change: Callable[[list[dict[str, Any]]], object]) -> list[Diagnostic]:
    """Return what is found in the scan of the robot cell with its SubDevices changed."""
    document = scan_of(ROBOT)
    change(document["subdevices"])
    return scan_findings(ROBOT, renumbered(document))


def _silent(rows: list[dict[str, Any]]) -> None:
    rows[3] |= {"al_status": 0, "sms": [], "fsoe": None, "problems": ["it does not answer"]}


def _given(rows: list[dict[str, Any]]) -> None:
    """Values that only the SubInstances have."""
    told = rows[1]["fsoe"]["connections"]
    rows[1]["fsoe"] = None
    for row, one in zip(rows[2:], told, strict=True):
        row["fsoe"]["given"] = [{**one, "object": 0x9001}]
    rows[3]["fsoe"]["given"][0] |= {"connection_id": 77, "watchdog_ms": 5}


def _copies(moved: int = 0, longer: int = 0) -> Description:
    """The robot cell with one copy from another byte, or of another length."""
    made = bus()
    number = next(n for n, c in enumerate(made.copies) if c.destination.subdevice == 1)
    copies = list(made.copies)
    one = copies[number]
    source = replace(one.source, bit_offset=one.source.bit_offset + moved)
    copies[number] = replace(one, source=source, bits=one.bits + longer)
    return replace(made, copies=tuple(copies))


def _moved() -> Description:
    made = bus()
    rows = list(made.subdevices)
    rows[1] = at(9, rows[1])
    return replace(made, subdevices=tuple(rows), copies=(), connections=())


def _more() -> Description:
    made = bus()
    rows = (COUPLER, *made.subdevices, at(6, made.subdevices[2]))
    return replace(made, subdevices=rows, copies=())


def _unnamed() -> Description:
    """A text that names no device, with one entry more in a PDO."""
    row = replace(product(0)(bus().subdevices[0]), position=None)
    row = replace(row, device=replace(row.device, vendor_id=0))
    first = next(m.pdos or () for m in row.device.sync_managers if m.index == 2)
    changed_row = pdos(2, more_entries(first[0]), *first[1:])(row)
    return Description(format="ethercat-pdos", path="pdos.txt", subdevices=(changed_row,))


def _order_of_pdos() -> Description:
    sub = bus().subdevices[0]
    there = next(m.pdos or () for m in sub.device.sync_managers if m.index == 2)
    return changed(0, pdos(2, *reversed(there)))


def _foreign() -> Description:
    """A file of other devices that says no place of any of them."""
    made = bus()
    rows = tuple(at(None, product(7 + n)(s)) for n, s in enumerate(made.subdevices))
    return replace(made, subdevices=rows, copies=(), connections=())


def _project(*order: int) -> Description:
    rows = ours()
    return project(*(rows[n] for n in order))


FOREIGN = [DescribedConnection(address=9 + n, connection_id=9 + n, watchdog_ms=5) for n in range(9)]
MODULAR = replace(fact(fixed=True), modular=True)
INPUTS: dict[str, Callable[[], list[Diagnostic]]] = {
    **{f"scan: {name}": lambda change=case[0]: scanned(change) for name, case in CASES.items()},
    "scan: no answer": lambda: scanned(_silent),
    "scan: an empty bus": lambda: scanned(list.clear),
    "scan: all behind a cut": lambda: scanned(lambda rows: rows.__delitem__(slice(3, None))),
    "scan: a coupler behind all": lambda: scanned(
        lambda rows: rows.append(subdevice(6, **SCANNED_COUPLER))
    ),
    "scan: values given by a silent main": lambda: scanned(_given),
    "PDOs in another order": lambda: found(_order_of_pdos()),
    "a PDO besides": lambda: found(changed(1, pdos(2, out_pdo(), Pdo(index=0x1605, entries=())))),
    "entries of a device with modules": lambda: found(
        types(pdos(2, more_entries(out_pdo())), facts=MODULAR)
    ),
    "entries that may be mapped": lambda: found(
        types(pdos(2, more_entries(out_pdo())), facts=fact())
    ),
    "entries of unknown rights": lambda: found(
        types(pdos(2, more_entries(out_pdo())), facts=TypeFacts())
    ),
    "a SubDevice at another position": lambda: found(_moved()),
    "SubDevices that the network does not name": lambda: found(_more()),
    "a text that names no device": lambda: found(_unnamed()),
    "a type of another machine": lambda: found(types(product(7))),
    "a bus of another machine": lambda: found(_foreign()),
    "a copy from another byte": lambda: found(_copies(moved=8)),
    "a copy that is too long": lambda: found(_copies(longer=8)),
    "a copy that is too short": lambda: found(_copies(longer=-8)),
    "a copy that is missing": lambda: found(replace(bus(), copies=bus().copies[1:])),
    "two slots exchanged": lambda: found(slots(2, 1, 3, 4)),
    "three slots in another order": lambda: found(slots(2, 3, 1, 4)),
    "two connections of a project exchanged": lambda: found(_project(1, 0, 2, 3)),
    "three connections of a project in another order": lambda: found(_project(2, 0, 1, 3)),
    "a project without connections": lambda: found(project()),
    "a project, but a network without connections": lambda: found(
        _project(0, 1, 2, 3), replace(ROBOT, connections=())
    ),
    "a project of another machine": lambda: found(project(*FOREIGN, orders=("EK1960",) * 9)),
}
