"""The robot cell as other files tell it, and what the comparison finds in them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from described import entry
from networks import EXAMPLES, example, resolved

from fsoe_net.compare.references import check_references
from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.formats.own.library import builtin_library
from fsoe_net.model.bus import Device, Direction, Pdo
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import (
    DescribedConnection,
    DescribedSubDevice,
    Description,
    PdoFacts,
    TypeFacts,
)
from fsoe_net.model.resolve import Resolution

ROBOT = example("el6910")  # 1 el6910, 2 el1904, 3 el2904, 4 drive_1, 5 drive_2; 0 is a coupler
LIBRARY = builtin_library()
MADE = describe(ROBOT.network)


def bus(resolution: Resolution = ROBOT, **more) -> Description:
    """What an ENI of exactly this network says."""
    made = MADE if resolution is ROBOT else describe(resolution.network)
    rows = tuple(_resolved(s) for s in made.subdevices)
    return replace(made, format="eni", path="other", subdevices=rows, **more)


def _resolved(sub: DescribedSubDevice) -> DescribedSubDevice:
    """Give each sync manager its PDOs, as files of other tools do."""
    device = sub.device
    managers = tuple(replace(sm, pdos=device.pdos_of(sm)) for sm in device.sync_managers)
    return replace(sub, device=replace(device, sync_managers=managers, rpdos=(), tpdos=()))


def found(reference: Description, resolution: Resolution = ROBOT) -> list[Diagnostic]:
    return check_references(resolution, [reference], library=LIBRARY)


def codes(reference: Description, resolution: Resolution = ROBOT) -> list[str]:
    return [d.code for d in found(reference, resolution)]


def with_text(folder: Path, *changes: tuple[str, str]) -> Resolution:
    """The robot cell in a folder, with changes of its text; each must hit something."""
    shutil.copytree(EXAMPLES / "el6910", folder, dirs_exist_ok=True)
    file = folder / "network.yaml"
    text = file.read_text("utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file.write_text(text, "utf-8")
    return resolved(file)


def crossed(folder: Path) -> Resolution:
    """EL1904 and EL2904 each hear the one frame pair and answer the other (FSN225)."""
    return with_text(
        folder,
        ("el6910, index: 0x7000", "el6910, index: 0x70ff"),
        ("el6910, index: 0x7010", "el6910, index: 0x7000"),
        ("el6910, index: 0x70ff", "el6910, index: 0x7010"),
    )


COUPLER = DescribedSubDevice(
    position=0, device=Device(path="", vendor_id=2, product_code=0x044C2C52)
)

Change = Callable[[DescribedSubDevice], DescribedSubDevice]


def types(change: Change | None = None, *, facts: TypeFacts | None = None) -> Description:
    """What an ESI with the EL1904 says."""
    row = replace(bus().subdevices[1], position=None, revision=0x100000)
    row = replace(row, facts=facts or TypeFacts())
    return Description(format="esi", path="esi", subdevices=(change(row) if change else row,))


def changed(number: int, change: Change) -> Description:
    made = bus()
    rows = list(made.subdevices)
    rows[number] = change(rows[number])
    return replace(made, subdevices=tuple(rows))


def pdos(sm: int, *new: Pdo) -> Change:
    """Replace the PDOs of a sync manager."""

    def change(sub: DescribedSubDevice) -> DescribedSubDevice:
        managers = tuple(
            replace(m, pdos=new) if m.index == sm else m for m in sub.device.sync_managers
        )
        return replace(sub, device=replace(sub.device, sync_managers=managers))

    return change


def out_pdo() -> Pdo:
    """The PDO of the EL1904 with the frame to it."""
    sub = bus().subdevices[1]
    return next(m.pdos[0] for m in sub.device.sync_managers if m.index == 2 and m.pdos)


def fact(**more) -> TypeFacts:
    return TypeFacts(
        pdos=(PdoFacts(index=0x1600, direction=Direction.OUTPUT, sm=2, **more),), assignable=True
    )


def product(number: int) -> Change:
    return lambda s: replace(s, device=replace(s.device, product_code=number))


def at(place: int | None, sub: DescribedSubDevice) -> DescribedSubDevice:
    return replace(sub, position=place)


def more_entries(pdo: Pdo) -> Pdo:
    return replace(pdo, entries=(*pdo.entries, entry(0x7002, 1, 8)))


def slots(*subs: int) -> Description:
    rows = tuple(DescribedConnection(main=0, sub=s, slot=n) for n, s in enumerate(subs))
    return replace(bus(), format="lcec", copies=(), connections=rows)


def project(*rows: DescribedConnection, orders: tuple[str, ...] = ()) -> Description:
    """A TwinSAFE export with these connections in this order."""
    device = Device(path="", vendor_id=0, product_code=0)
    subs = [DescribedSubDevice(name="logic", device=device)]
    subs += [
        DescribedSubDevice(device=device, order=orders[n] if n < len(orders) else "")
        for n in range(len(rows))
    ]
    numbered = tuple(replace(r, main=0, sub=n + 1, slot=n) for n, r in enumerate(rows))
    return Description(
        format="twinsafe", path="safety.xml", subdevices=tuple(subs), connections=numbered
    )


def ours() -> list[DescribedConnection]:
    return list(describe(ROBOT.network).connections)
